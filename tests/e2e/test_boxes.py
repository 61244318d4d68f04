#!/usr/bin/env python3
"""boresight export --coco and --yolo: images and bounding boxes, computed again from run.sqlite.

Usage, from the repository root: /usr/bin/python3 tests/e2e/test_boxes.py BORESIGHT
"""
import json
import os
import subprocess
import unittest

import numpy as np
from astropy.io import fits

import runs
from readers import read_png

LIMIT, BOX = 12.0, 16.0
WINDOW = (100, 60, 800, 640)  # x0, y0, width, height in sensor pixels


def tearDownModule():
    runs.clean()


def export(*words):
    return subprocess.run([runs.BORESIGHT, "export", *words], capture_output=True, text=True,
                          timeout=120, check=False)


def corners(box):
    x, y, width, height = box
    return np.array([x, y, x + width, y + height])


class Boxes(unittest.TestCase):
    """A run with a cube of frames, and one whose frames are binned parts of the sensor."""

    @classmethod
    def setUpClass(cls):
        cls.folder = runs.scratch()
        exposure = runs.SENSOR + "/exposure/"
        cls.parts = {"plain": (1, 0, 0), "binned": (2, *WINDOW[:2])}
        sets = {"plain": [], "binned": ["/record/frames=extensions", exposure + "binning=2",
                                        exposure + f"window_px={json.dumps(list(WINDOW))}"]}
        for name, some in sets.items():
            made = os.path.join(cls.folder, name)
            runs.run(runs.STARE, made, *some, duration=4)
            result = export(made, "--coco", "coco", "--yolo", "yolo", "--star-limit", str(LIMIT),
                            "--box", str(BOX), "--out", os.path.join(cls.folder, name + ".out"))
            assert (result.returncode, result.stderr) == (0, ""), result.stderr

    def coco(self, name):
        with open(f"{self.folder}/{name}.out/coco/annotations.json", encoding="utf-8") as file:
            return json.load(file)

    def expected(self, name, exposure, width, height):
        """Category, corners in the image's pixels from its edge, and centroid, of each source."""
        binning, x0, y0 = self.parts[name]
        out = []
        rows = runs.database(self.folder + "/" + name).execute(
            "SELECT * FROM truth WHERE exposure_id = ? AND electrons > 0", (exposure,))
        for row in rows:
            if row["kind"] == "star" and not row["v_mag"] <= LIMIT:
                continue
            ends = []
            for axis, start in (("x", x0), ("y", y0)):
                beside = row[f"{axis}_centroid_px"] - row[f"{axis}_chief_px"]
                way = [(row[f"{axis}_{when}_px"] + beside - start + 0.5) / binning
                       for when in ("start", "mid", "end")]
                ends.append((min(way) - BOX / 2, max(way) + BOX / 2))
            box = np.clip([ends[0][0], ends[1][0], ends[0][1], ends[1][1]], 0,
                          [width, height, width, height])
            if box[2] - box[0] >= 1 and box[3] - box[1] >= 1:
                out.append((2 if row["kind"] == "star" else 1, box,
                            (row["x_centroid_px"] - x0 + 0.5) / binning,
                            (row["y_centroid_px"] - y0 + 0.5) / binning))
        return out

    def check(self, name):
        data = self.coco(name)
        self.assertEqual([(c["id"], c["name"]) for c in data["categories"]],
                         [(1, "satellite"), (2, "star")])
        self.assertEqual([i["id"] for i in data["images"]], [1, 2, 3, 4])
        self.assertEqual([a["id"] for a in data["annotations"]],
                         list(range(1, len(data["annotations"]) + 1)))
        whole = stars = satellites = 0
        for image in data["images"]:
            width, height = image["width"], image["height"]
            mine = [a for a in data["annotations"] if a["image_id"] == image["id"]]
            truth = self.expected(name, image["exposure_id"], width, height)
            self.assertEqual([a["category_id"] for a in mine], [t[0] for t in truth])
            with open(f"{self.folder}/{name}.out/yolo/labels/"
                      f"{image['file_name'].replace('.png', '.txt')}", encoding="ascii") as file:
                lines = [[float(word) for word in line.split()] for line in file]
            self.assertEqual(len(lines), len(mine))
            for a, (category, box, x, y), line in zip(mine, truth, lines, strict=True):
                # numbers are printed in full in JSON; the text has 1e-9 of the image
                np.testing.assert_allclose(corners(a["bbox"]), box, atol=1e-9)
                self.assertAlmostEqual(a["area"], a["bbox"][2] * a["bbox"][3], delta=1e-6)
                self.assertAlmostEqual(a["x_centroid"], x, delta=1e-9)
                self.assertAlmostEqual(a["y_centroid"], y, delta=1e-9)
                kind, cx, cy, w, h = line
                self.assertEqual(kind, category - 1)
                np.testing.assert_allclose(
                    [(cx - w / 2) * width, (cy - h / 2) * height, (cx + w / 2) * width,
                     (cy + h / 2) * height], box, atol=1e-5)
                if 0 < box[0] and 0 < box[1] and box[2] < width and box[3] < height:
                    whole += 1
                    # the light lies on the way, without what the box was grown by; the three
                    # places on it miss the way's own bend
                    half = BOX / 2 - 0.1
                    self.assertTrue(box[0] + half <= x <= box[2] - half)
                    self.assertTrue(box[1] + half <= y <= box[3] - half)
                stars += category == 2
                satellites += category == 1
        self.assertGreater(min(whole, stars), 20)
        self.assertGreater(satellites, 0)

    def test_plain(self):
        self.check("plain")

    def test_binned_part(self):
        self.check("binned")
        image = self.coco("binned")["images"][0]
        self.assertEqual((image["width"], image["height"]), (WINDOW[2] // 2, WINDOW[3] // 2))

    def test_images_are_the_counts(self):
        names = [i["file_name"] for i in self.coco("binned")["images"]]
        with fits.open(self.folder + "/binned/frames.fits") as hdus:
            counts = hdus[2].data
        for form in ("coco", "yolo"):
            folder = f"{self.folder}/binned.out/{form}/images/"
            self.assertEqual(sorted(os.listdir(folder)), names)
            width, height, rows = read_png(folder + names[1])
            image = np.frombuffer(b"".join(rows), ">u2").reshape(height, width)
            np.testing.assert_array_equal(image, counts)
        # the brightest pixel of the frame is in a box of its own picture
        y, x = np.unravel_index(np.argmax(counts), counts.shape)
        self.assertTrue(any(
            b[0] <= x + 0.5 <= b[2] and b[1] <= y + 0.5 <= b[3]
            for b in (corners(a["bbox"]) for a in self.coco("binned")["annotations"]
                      if a["image_id"] == 2)))

    def test_eight_bits_and_choice_of_frames(self):
        out = runs.scratch()
        result = export(self.folder + "/binned", "--yolo", out + "/set", "--bits", "8", "--first",
                        "2", "--last", "2")
        self.assertEqual((result.returncode, result.stderr), (0, ""))
        self.assertEqual(os.listdir(out + "/set/labels"), ["binned.0002.txt"])
        width, height, rows = read_png(out + "/set/images/binned.0002.png")
        self.assertEqual((width, height, len(rows[0])), (400, 320, 400))
        self.assertGreater(len(set(b"".join(rows))), 20)
        with open(out + "/set/data.yaml", encoding="ascii") as file:
            self.assertIn("names:\n  0: satellite\n  1: star\n", file.read())

    def test_no_truth(self):
        folder = runs.scratch()
        runs.run(runs.STARE, folder + "/run", "/record/truth=false", duration=1)
        result = export(folder + "/run", "--coco", folder + "/out")
        self.assertEqual(result.returncode, 1)
        self.assertIn("holds no truth to label frames by", result.stderr)


if __name__ == "__main__":
    unittest.main()
