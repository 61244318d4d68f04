#!/usr/bin/env python3
"""boresight solve: a rendered frame of a wide field, without any attitude.

Usage, from the repository root: /usr/bin/python3 tests/e2e/test_solve.py BORESIGHT
"""
import json
import os
import re
import sqlite3
import unittest

import numpy
from astropy.io import fits

import runs
from runs import call

UTC = "2022-06-16T22:10:00Z"
CAMERA = "/observers/0/sensors/0/camera/"


class Solve(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        """One frame of 10 degrees, of the embedded catalogue, as a plain image."""
        cls.folder = runs.scratch()
        scenario = os.path.join(cls.folder, "wide.json")
        with open(scenario, "w", encoding="utf-8") as file:
            json.dump({"extends": os.path.abspath(runs.TRACK),
                       "set": {CAMERA + "width_px": 300, CAMERA + "height_px": 300,
                               CAMERA + "pixel_scale_arcsec": 120, CAMERA + "aperture_m": 0.04,
                               "/world/star_catalogue": "embedded",
                               "/observers/0/sensors/0/cue/offset_deg": 0,
                               "/observers/0/sensors/0/modules/control/strategy": "stare"}},
                      file)
        made = os.path.join(cls.folder, "run")
        runs.run(scenario, made, duration=1)
        with fits.open(os.path.join(made, "frames.fits")) as file:
            pixels = next(hdu.data for hdu in file if hdu.data is not None).astype(numpy.float32)
        cls.frame = os.path.join(cls.folder, "frame.fits")
        fits.writeto(cls.frame, pixels)
        fits.writeto(os.path.join(cls.folder, "mirrored.fits"), pixels[:, ::-1].copy())
        with sqlite3.connect(os.path.join(made, "run.sqlite")) as run:
            cls.truth = run.execute("SELECT crval1_deg, crval2_deg FROM frames").fetchone()

    def solve(self, name, scale):
        return call("solve", os.path.join(self.folder, name), "--scale", str(scale), "--utc", UTC,
                    "--v-limit", "7.5", "--least-snr", "8", "--catalogue", "embedded")

    def test_the_boresight_is_found(self):
        for scale in (120, 116):  # right, and 3 % wrong
            result = self.solve("frame.fits", scale)
            self.assertEqual(result.returncode, 0, result.stdout + result.stderr)
            ra, dec = map(float, re.search(r"RA (\S+) deg, Dec (\S+) deg", result.stdout).groups())
            # the WCS is astrometric: aberration is up to 25 arcsec; a fifth of a pixel is 24 arcsec
            off = numpy.hypot((ra - self.truth[0]) * numpy.cos(numpy.radians(dec)), dec - self.truth[1])
            self.assertLess(off, 50 / 3600)
            self.assertAlmostEqual(float(re.search(r"scale +(\S+)", result.stdout).group(1)), 120, delta=0.2)

    def test_a_mirrored_frame_is_not(self):
        result = self.solve("mirrored.fits", 120)
        self.assertEqual(result.returncode, 1, result.stdout)
        self.assertIn("no attitude", result.stdout)


def tearDownModule():
    runs.clean()


if __name__ == "__main__":
    unittest.main()
