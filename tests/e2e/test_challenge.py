#!/usr/bin/env python3
"""boresight challenge: the public frames show what the hidden truth lists, and do not give it away.

Usage, from the repository root: /usr/bin/python3 tests/e2e/test_challenge.py BORESIGHT
"""
import csv
import json
import os
import unittest

import numpy as np
from astropy.io import fits

import runs
from runs import call


def tearDownModule():
    runs.clean()


# long enough not to be in a file by chance; its exposures have the greatest length, 5 s
SEED = 0x5EED1234


class Challenge(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.out = runs.scratch() + "/set"
        result = call("challenge", "1", "--out", cls.out, "--sequences", "2", "--size-px", "128", "--catalogue",
                      "embedded", "--threads", "1")
        assert (result.returncode, result.stderr) == (0, ""), result.stderr
        with open(cls.out + "/truth/truth.csv", encoding="utf-8") as file:
            cls.truth = list(csv.DictReader(file))

    def test_truth_is_in_the_frames(self):
        with open(self.out + "/public/frames.csv", encoding="utf-8") as file:
            frames = list(csv.DictReader(file))
        self.assertEqual([(int(f["sequence"]), int(f["frame"])) for f in frames],
                         [(s, k) for s in (1, 2) for k in range(1, 6)])
        bright = [row for row in self.truth if row["snr"] and float(row["snr"]) > 30]
        self.assertGreater(len(bright), 0)
        with fits.open(self.out + "/public/frames.fits") as hdus:
            for row in bright:
                at = next(f for f in frames if (f["sequence"], f["frame"]) == (row["sequence"], row["frame"]))
                image = hdus[int(at["hdu"]) - 1].data.astype(float)
                self.assertEqual(image.shape, (128, 128))
                x, y = round(float(row["x"])), round(float(row["y"]))
                box = image[max(y - 1, 0):y + 2, max(x - 1, 0):x + 2]
                # SNR 30 over a PSF of up to 3 px: the brightest pixel is above 5 standard deviations
                sigma = 1.4826 * np.median(np.abs(image - np.median(image)))
                self.assertGreater(box.max() - np.median(image), 5 * sigma, row)

    def test_the_public_part_does_not_name_objects_or_seed(self):
        out = runs.scratch() + "/secret"
        result = call("challenge", hex(SEED), "--out", out, "--sequences", "1", "--size-px", "64", "--catalogue", "embedded")
        self.assertEqual((result.returncode, result.stderr), (0, ""))
        with open(out + "/truth/scenario.json", encoding="utf-8") as file:
            scenario = json.load(file)
        names = [thing["name"] for thing in scenario["world"]["objects"]]
        self.assertGreater(len(names), 0)
        self.assertEqual(int(scenario["seed"], 0), SEED)
        self.assertEqual(scenario["observers"][0]["sensors"][0]["exposure"]["exposure_s"], 5)
        self.assertEqual(sorted(os.listdir(out + "/public")), ["frames.csv", "frames.fits"])
        for name in os.listdir(out + "/public"):
            with open(os.path.join(out, "public", name), "rb") as file:
                content = file.read().lower()
            for word in [*names, f"{SEED:x}", str(SEED)]:
                self.assertFalse(word.lower().encode() in content, f"{name} has {word}")
        with fits.open(out + "/public/frames.fits") as hdus:
            for hdu in hdus:
                self.assertNotIn("SEED", hdu.header)

    def test_truth_scores_perfectly(self):
        result = call("score", self.out + "/truth/truth.csv", "--truth", self.out + "/truth/truth.csv", "--json", "-")
        scored = json.loads(result.stdout)
        self.assertEqual(scored["frames"], 10)
        self.assertEqual(scored["truths"], sum(row["x"] != "" for row in self.truth))
        self.assertEqual(scored["figures"]["f1"]["value"], 1)
        result = call("score", self.out + "/truth/truth.csv", "--truth", self.out + "/truth/truth.csv", "--json", "-",
                      "--least-snr", "30")
        self.assertEqual(json.loads(result.stdout)["optional_truths"],
                         sum(row["x"] != "" and float(row["snr"]) < 30 for row in self.truth))

    def test_a_set_is_not_replaced(self):
        result = call("challenge", "1", "--out", self.out)
        self.assertEqual(result.returncode, 1)
        self.assertIn("is there already; give a new folder", result.stderr)


if __name__ == "__main__":
    unittest.main()
