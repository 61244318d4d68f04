#!/usr/bin/env python3
"""The statistical sky from outside: galactic_core has its hundred thousand stars and their light, the
same for every seed, and the main job still finds and follows its target among stars that the
onboard catalogue does not know.

Usage, from the repository root: /usr/bin/python3 tests/e2e/test_faint_sky.py BORESIGHT
"""
import os
import unittest

import numpy as np
from astropy.io import fits

import runs

CORE = "scenarios/galactic_core.json"
FAINT_ID = 1 << 31


class GalacticCore(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = runs.scratch()
        cls.out = os.path.join(cls.folder, "core")
        runs.run(CORE, cls.out, seed=1, duration=3)
        cls.other = os.path.join(cls.folder, "other")
        runs.run(CORE, cls.other, runs.NO_FRAMES, seed=2, duration=3, threads=2)
        cls.bare = os.path.join(cls.folder, "bare")
        runs.run(CORE, cls.bare, "/world/faint_stars=none", seed=1, duration=3)

    def exposure(self, out):
        return runs.database(out).execute("SELECT * FROM exposures").fetchone()

    def image(self, out):
        with fits.open(os.path.join(out, "frames.fits")) as hdus:
            return hdus[0].data[0].astype(float)

    def test_a_hundred_thousand_stars(self):
        row = self.exposure(self.out)
        self.assertGreater(row["sources"] + row["lost"], 100_000)
        self.assertEqual(row["sources"], 4096)
        self.assertLess(self.exposure(self.bare)["sources"], 2000)

    def test_the_sky_is_the_same_for_every_seed(self):
        stars = [runs.database(out).execute("SELECT id, v_mag, ra_deg, dec_deg FROM truth "
                                            "ORDER BY id").fetchall()
                 for out in (self.out, self.other)]
        a, b = [{row["id"]: tuple(row) for row in rows} for rows in stars]
        # jitter moves the edge of the field: a few of the 4096 brightest differ
        self.assertGreater(len(a.keys() & b.keys()), 4000)
        self.assertTrue(all(a[key] == b[key] for key in a.keys() & b.keys()))
        self.assertGreater(sum(key >= FAINT_ID for key in a), 1000)

    def test_the_light_is_in_the_image(self):
        keys = self.exposure(self.out), self.exposure(self.bare)
        with fits.open(os.path.join(self.out, "frames.fits")) as hdus:
            gain = hdus[0].header["GAIN"]
        level = [np.percentile(self.image(out), 2) * gain for out in (self.out, self.bare)]
        # the darkest pixels see hardly more than the background, less 2 sigma of its noise
        expected = keys[0]["background_e"] - keys[1]["background_e"]
        self.assertGreater(expected, 20)
        noise = [2 * np.sqrt(key["background_e"] + 25) for key in keys]
        self.assertAlmostEqual(level[0] - level[1] + noise[0] - noise[1], expected,
                               delta=0.25 * expected)


class MainJob(unittest.TestCase):
    def test_the_target_is_found_among_unknown_stars(self):
        out = os.path.join(runs.scratch(), "track")
        summary = runs.run(runs.TRACK, out, runs.NO_FRAMES, "/world/faint_stars=statistical",
                           "/world/faint_limit_v_mag=16", seed=1, duration=60)["summary"]
        self.assertEqual(summary["final_mode"], "track")
        self.assertEqual(summary["wrong_target_frames"], 0)
        self.assertEqual(summary["track_fraction"], 1)


def tearDownModule():
    runs.clean()


if __name__ == "__main__":
    unittest.main()
