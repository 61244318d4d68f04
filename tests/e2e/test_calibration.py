#!/usr/bin/env python3
"""The calibration that ships is what the command writes.

Usage, from the repository root:
  /usr/bin/python3 tests/e2e/test_calibration.py BORESIGHT
"""
import json
import os
import subprocess
import unittest

import runs

FOLDER = "scenarios/calibration/"


class Calibration(unittest.TestCase):
    def test_is_what_the_command_writes(self):
        out = os.path.join(runs.scratch(), "made.obsgen")
        subprocess.run([runs.BORESIGHT, "calibrate-obsgen",
                        *[FOLDER + name + ".json" for name in ("points", "streaks", "quiet")],
                        "--seeds", "12", "--out", out], check=True, stdout=subprocess.DEVNULL)
        made = json.load(open(out))
        shipped = json.load(open(FOLDER + "neossat.obsgen"))
        self.assertEqual(set(made), set(shipped))
        for key, value in shipped.items():
            if isinstance(value, str):
                continue  # names the program's version
            for a, b in zip(made[key] if isinstance(value, list) else [made[key]],
                            value if isinstance(value, list) else [value]):
                # the same frames to the last digit on one device; another one's rounding moves
                # some noise by a step, and a few of 1200 false alarms with it
                self.assertAlmostEqual(a, b, delta=0.02 + 0.02 * abs(b), msg=key)


def tearDownModule():
    runs.clean()


if __name__ == "__main__":
    unittest.main()
