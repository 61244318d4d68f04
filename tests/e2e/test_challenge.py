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
                x, y = round(float(row["x"])), round(float(row["y"]))
                box = image[max(y - 1, 0):y + 2, max(x - 1, 0):x + 2]
                # SNR 30 over a PSF of up to 3 px: the brightest pixel is above 5 standard deviations
                sigma = 1.4826 * np.median(np.abs(image - np.median(image)))
                self.assertGreater(box.max() - np.median(image), 5 * sigma, row)

    def test_the_public_part_does_not_name_objects_or_seed(self):
        self.assertEqual(sorted(os.listdir(self.out + "/public")), ["frames.csv", "frames.fits"])
        with fits.open(self.out + "/public/frames.fits") as hdus:
            for hdu in hdus:
                for word in ("object0", "object1", "object2"):
                    self.assertNotIn(word, repr(hdu.header))
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
