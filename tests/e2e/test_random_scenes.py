#!/usr/bin/env python3
"""Generator against images on scenes that are not shipped (random_scenes.py, seed 21).

Usage, from the repository root:
  /usr/bin/python3 tests/e2e/test_random_scenes.py BORESIGHT [--full]

Without --full: one scene, few seeds, the embedded star catalogue; each interval must reach into
twice its margin, but for one known bias (see BIAS). With --full: ten scenes, a hundred seeds, the
full star catalogue: prints which intervals lie inside their margins
(docs/how-to/observation_generator.md), and fails where a figure is further off than the known
differences.
"""
import json
import subprocess
import sys
import unittest

FULL = "--full" in sys.argv
sys.argv = [word for word in sys.argv if word != "--full"]

import random_scenes  # noqa: E402  (after the arguments)
import runs  # noqa: E402

SEED = 21


class Scenes(unittest.TestCase):
    def figures(self, path, seeds, duration):
        out = path + ".figures"
        subprocess.run([runs.BORESIGHT, "calibrate-obsgen", "--check", path, "--seeds", str(seeds),
                        "--duration", str(duration), "--json", out], check=False,
                       stdout=subprocess.DEVNULL, timeout=14000)
        with open(out, encoding="utf-8") as file:
            return json.load(file)["figures"]

    def test_the_same_seed_draws_the_same_scene(self):
        made = [random_scenes.scene(SEED, 4, "embedded", True) for _ in range(2)]
        self.assertEqual(made[0], made[1])
        other = random_scenes.scene(SEED + 1, 4, "embedded", True)
        self.assertNotEqual(made[0]["observers"], other["observers"])

    @unittest.skipIf(FULL, "the short version")
    def test_no_difference_is_shown_on_a_scene(self):
        folder = runs.scratch()
        for number in SHORT:
            path = random_scenes.write(folder, SEED, number, runs.BORESIGHT, "embedded", True)
            for f in self.figures(path, 3, 4):
                middle = 1.0 if "ratio" in f else 0.0
                # a figure is never both shown to be right and shown to be wrong
                self.assertFalse(f["inside"] and f["beyond"], (number, f))
                self.assertGreaterEqual(f["sigma"], 0.0, (number, f))
                # twice the margin: with three seeds resampling finds too small an interval
                wide = 2.0 * f["margin"]
                bias = next((v for name, v in BIAS.items() if f["name"].startswith(name)), 0.0)
                self.assertLess(f["low"], middle + max(wide, bias), (number, f))
                self.assertGreater(f["high"], middle - wide, (number, f))

    @unittest.skipUnless(FULL, "--full")
    def test_ten_scenes_differ_by_no_more_than_is_known(self):
        runs.need_full_catalogue()
        folder, further, inside, all_of_them = runs.scratch(), [], 0, 0
        for number in range(10):
            path = random_scenes.write(folder, SEED, number, runs.BORESIGHT, "default", True)
            for f in self.figures(path, 100, 60):
                off = f["ratio"] - 1.0 if "ratio" in f else f["difference"]
                inside += f["inside"]
                all_of_them += 1
                print(f"{number} {f['name']}: {off:+.4f} [{f['low']:.4f}, {f['high']:.4f}] "
                      f"{'inside' if f['inside'] else 'OUTSIDE'} {f['margin']}", flush=True)
                limit = next(v for name, v in KNOWN.items() if f["name"].startswith(name))
                if not abs(off) <= limit:
                    further.append((number, f["name"], off))
        print(f"{inside} of {all_of_them} inside their margins")
        self.assertEqual(further, [])


# greatest differences of ten scenes by seed 21: streaks of diffraction patterns (Pd, alarms on their
# rings), crowded fields (alarms: blends that are separated differently), few blends in one field
KNOWN = {"Pd": 0.12, "false alarms": 1.1, "RMS of places": 0.5, "RMS of the track": 0.5,
         "time to confirm": 0.3}
# one whose kernels other tests compile: hits in a crowded sky
SHORT = (2,)
# biases of the generator in SHORT that are known and not mended, upwards: places are 1.13 in the
# frames of the slew, beyond the margin of 0.05 by far more than sampling. Stars beside another are
# merged by the generator and apart in images (docs/results/observation_generator.md).
BIAS = {"RMS of places": 0.15}


def tearDownModule():
    runs.clean()


if __name__ == "__main__":
    unittest.main()
