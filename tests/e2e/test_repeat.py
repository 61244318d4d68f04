#!/usr/bin/env python3
"""The same scenario and seed give the same run, whatever the number of threads and whether processing
and recording overlap with the simulation; another seed gives another one.

Usage, from the repository root: /usr/bin/python3 tests/e2e/test_repeat.py BORESIGHT
"""
import os
import unittest

import numpy as np
from astropy.io import fits

import runs

# so that it is found at once
NEAR = [runs.SENSOR + f"/cue/{key}=0.1" for key in ("offset_deg", "sigma_deg")]
JOBS = {  # name: scenario, record, seed, threads, seconds
    "first": (runs.TRACK, "extensions", 1, 1, 20),
    "serial": (runs.TRACK, "extensions", 1, 1, 20),
    "threads": (runs.TRACK, "extensions", 1, 8, 20),
    "cube": (runs.RATE_OPEN, "cube", 7, 1, 8),
    "cube threads": (runs.RATE_OPEN, "cube", 7, 8, 8),
    "cube serial": (runs.RATE_OPEN, "cube", 7, 2, 8),
    "other seed": (runs.TRACK, "extensions", 2, 1, 6),
}


def tables(out):
    """All of the run's tables as text."""
    db = runs.database(out)
    names = [row[0] for row in db.execute("SELECT name FROM sqlite_master WHERE type = 'table' "
                                          "ORDER BY name")]
    return {name: [tuple(row) for row in db.execute(f'SELECT * FROM "{name}"')] for name in names}


class Repeat(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = runs.scratch()

        def one(name):
            scenario, form, seed, threads, duration = JOBS[name]
            return runs.run(scenario, os.path.join(cls.folder, name), f"/record/frames={form}",
                            *(NEAR if scenario == runs.TRACK else []), seed=seed, threads=threads, duration=duration,
                            serial=name.endswith("serial"), pictures=True)
        cls.manifests = dict(zip(JOBS, runs.parallel(one, JOBS)))

    def path(self, name, file="frames.fits"):
        return os.path.join(self.folder, name, file)

    def assert_same(self, a, b):
        # no key holds wall time, so that headers agree in every card as well
        with open(self.path(a), "rb") as one, open(self.path(b), "rb") as two:
            frames = one.read()
            self.assertTrue(frames == two.read(), (a, b))
        self.assertGreater(len(frames), 1e6)
        mine, other = tables(self.path(a, "")), tables(self.path(b, ""))
        self.assertEqual(list(mine), list(other))
        for name, rows in mine.items():
            self.assertEqual(rows, other[name], name)
        self.assertGreater(sum(len(rows) for rows in mine.values()), 1000)
        with open(self.path(a, "scenario.json"), "rb") as one, \
                open(self.path(b, "scenario.json"), "rb") as two:
            self.assertEqual(one.read(), two.read())
        summaries = [dict(self.manifests[name]["summary"]) for name in (a, b)]
        for summary in summaries:
            del summary["real_time_factor"]
        self.assertEqual(*summaries)
        for picture in ("quicklook.png",):
            with open(self.path(a, picture), "rb") as one, open(self.path(b, picture), "rb") as two:
                self.assertEqual(one.read(), two.read())

    def test_serial(self):
        self.assert_same("first", "serial")
        self.assert_same("cube", "cube serial")
        for name in ("counters", "warnings", "last_tick"):
            self.assertEqual(self.manifests["cube"][name], self.manifests["cube serial"][name])

    def test_threads(self):
        self.assert_same("first", "threads")
        # the loop was closed: otherwise equal tables would say little
        self.assertEqual(self.manifests["first"]["summary"]["final_mode"], "track")

    def test_threads_datacube(self):
        self.assert_same("cube", "cube threads")

    def test_another_seed_is_another_run(self):
        with fits.open(self.path("first")) as one, fits.open(self.path("other seed")) as two:
            self.assertFalse(np.array_equal(one[1].data, two[1].data))
        self.assertNotEqual(tables(self.path("first", ""))["detections"][:20],
                            tables(self.path("other seed", ""))["detections"][:20])


def tearDownModule():
    runs.clean()


if __name__ == "__main__":
    unittest.main()
