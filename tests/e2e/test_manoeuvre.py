"""A target that burns unknown to the cue is held by every filter: accelerations from 0.1 to 100 m/s^2
for minutes, from rates that are the cue's to 80 arcsec/s away from it.

Usage, from the repository root: /usr/bin/python3 tests/e2e/test_manoeuvre.py BORESIGHT
"""
import json
import os
import sqlite3
import subprocess
import unittest

import runs

MODULES = runs.SENSOR + "/modules"
# a geostationary orbit in sight of the observer, integrated so that burns may last
ORBIT = {"source": "numerical",
         "state": {"position_gcrf_m": [-15348589.2, -39280031.2, -44163.1],
                   "velocity_gcrf_mps": [2863.24853, -1118.97675, -0.49126]}}
START_S = 100


def held(tracker, mps2, length_s, direction=(0, 1, 0)):
    """Share of the frames from the burn's start on in which the tracker names the target."""
    duration = START_S + length_s + 60
    sets = {
        "/world/objects/0/orbit": ORBIT,
        "/world/objects/0/burns": [{"time_s": START_S, "duration_s": length_s,
                                    "dv_rtn_mps": [mps2 * length_s * x for x in direction]}],
        "/world/star_catalogue": "embedded", "/record/frames": "none",
        "/record/truth_stars": False,
        runs.SENSOR + "/observation_source": "generator",
        MODULES + "/tracker/type": tracker,
    }
    words = [word for path, value in sets.items()
             for word in ("--set", f"{path}={json.dumps(value)}")]
    out = os.path.join(runs.scratch(), "run")
    result = subprocess.run([runs.BORESIGHT, "run", runs.TRACK, "--quiet", "--out", out,
                             "--duration", str(duration), *words], capture_output=True, text=True,
                            timeout=600)
    if result.returncode != 0:
        raise AssertionError(result.stderr)
    with sqlite3.connect(os.path.join(out, "run.sqlite")) as db:
        frames, named, names = db.execute(
            "select count(*), sum(target_id > 0), count(distinct target_id) from track_frames "
            "where time_s > ?", (START_S,)).fetchone()
    return named / frames, names


class Manoeuvre(unittest.TestCase):
    def check(self, tracker, cases):
        for mps2, length_s, direction in cases:
            with self.subTest(tracker=tracker, mps2=mps2, length_s=length_s):
                share, names = held(tracker, mps2, length_s, direction)
                self.assertEqual(share, 1.0)
                self.assertEqual(names, 1)

    def test_imm(self):
        self.check("imm", ((0.1, 200, (0, 1, 0)), (10, 200, (0, 1, 0)), (10, 200, (0, 0, 1)),
                           (30, 200, (0, 1, 0))))

    def test_ekf(self):
        self.check("ekf", ((1, 200, (0, 1, 0)), (10, 200, (0, 1, 0)), (30, 200, (0, 1, 0)),
                           (30, 100, (0, 0, 1)), (100, 100, (0, 1, 0))))

    def test_ukf(self):
        self.check("ukf", ((10, 200, (0, 0, -1)), (30, 200, (0, 1, 0))))


def tearDownModule():
    runs.clean()


if __name__ == "__main__":
    unittest.main()
