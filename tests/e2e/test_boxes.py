#!/usr/bin/env python3
"""boresight export --coco and --yolo: images and bounding boxes, computed again from run.sqlite.

Usage, from the repository root: /usr/bin/python3 tests/e2e/test_boxes.py BORESIGHT
"""
import json
import os
import unittest

import numpy as np
from astropy.io import fits

import runs
from runs import call
from readers import read_png

LIMIT, BOX = 12.0, 16.0
WINDOW = (100, 60, 800, 640)  # x0, y0, width, height in sensor pixels


def tearDownModule():
    runs.clean()


def corners(box):
    x, y, width, height = box
    return np.array([x, y, x + width, y + height])


def fill(polygon, shape):
    """Pixels of an image whose centres a polygon x, y, x, y, ... holds: even-odd rule."""
    x, y = np.array(polygon[0::2], float), np.array(polygon[1::2], float)
    inside = np.zeros(shape, int)
    left, right = int(x.min()), int(np.ceil(x.max()))
    for row in range(int(y.min()), int(np.ceil(y.max()))):
        centre, x2, y2 = row + 0.5, np.roll(x, -1), np.roll(y, -1)
        cut = (y > centre) != (y2 > centre)
        at = x[cut] + (centre - y[cut]) * (x2[cut] - x[cut]) / (y2[cut] - y[cut])
        columns = np.arange(left, right) + 0.5
        inside[row, left:right] = (columns[:, None] < at[None, :]).sum(axis=1) % 2
    return inside


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
            runs.run(runs.STARE, made, '/record/planes=["segmentation"]', *some, duration=4)
            result = call("export", made, "--coco", "coco", "--yolo", "yolo", "--star-limit", str(LIMIT),
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
                            row, (row["x_centroid_px"] - x0 + 0.5) / binning,
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
            for a, (category, box, row, x, y), line in zip(mine, truth, lines, strict=True):
                # numbers are printed in full in JSON; the text has 1e-9 of the image
                np.testing.assert_allclose(corners(a["bbox"]), box, atol=1e-9)
                self.assertAlmostEqual(a["x_centroid"], x, delta=1e-9)
                self.assertAlmostEqual(a["y_centroid"], y, delta=1e-9)
                self.assertEqual((a["iscrowd"], a["norad"]), (0, row["norad"]))
                self.assertAlmostEqual(a["v_mag"], row["v_mag"], delta=1e-12)
                self.assertAlmostEqual(a["snr"], row["snr"], delta=1e-9)
                self.assertEqual(a["object_name"], "" if row["kind"] == "star" else "INMARSAT GX5")
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

    def test_segmentation(self):
        """Polygons, filled by the even-odd rule at the centres of pixels, are the masks."""
        for name in self.parts:
            data = self.coco(name)
            frames = {i["id"]: i for i in data["images"]}
            with fits.open(f"{self.folder}/{name}/segmentation.fits") as hdus:
                masks = {h.header["FRAMEID"]: h.data.copy() for h in hdus[1:]}
            sizes = {k: dict(zip(*np.unique(m, return_counts=True))) for k, m in masks.items()}  # pixels of each source
            tables = runs.database(self.folder + "/" + name)
            shown = 0
            for a in data["annotations"]:
                image = frames[a["image_id"]]
                mask = masks[image["exposure_id"]]
                near = np.array([[a["x_centroid"], a["y_centroid"]]])
                rows = tables.execute(
                    "SELECT item, x_centroid_px, y_centroid_px FROM truth WHERE exposure_id = ?",
                    (image["exposure_id"],)).fetchall()
                binning, x0, y0 = self.parts[name]
                places = np.array([[(r[1] - x0 + 0.5) / binning, (r[2] - y0 + 0.5) / binning]
                                   for r in rows], dtype=float)
                item = rows[np.nanargmin(np.hypot(*(places - near).T))][0]
                # all of it lies in the part of the image that the polygons reach
                xs, ys = ([v for p in a["segmentation"] for v in p[k::2]] for k in range(2))
                corner = (int(min(xs, default=0)), int(min(ys, default=0)))
                part = np.s_[corner[1]:int(np.ceil(max(ys, default=0))), corner[0]:int(np.ceil(max(xs, default=0)))]
                filled = sum((fill(np.array(p) - np.resize(corner, len(p)), mask[part].shape) for p in a["segmentation"]),
                             np.zeros(mask[part].shape, int))
                np.testing.assert_array_equal(filled, mask[part] == item)
                self.assertEqual(filled.sum(), sizes[image["exposure_id"]].get(item, 0))
                if a["segmentation"]:
                    self.assertEqual(a["area"], filled.sum())
                    shown += 1
                else:
                    self.assertAlmostEqual(a["area"], a["bbox"][2] * a["bbox"][3], delta=1e-6)
            self.assertGreater(shown, 20)

    def test_without_masks(self):
        folder = runs.scratch()
        runs.run(runs.STARE, folder + "/run", duration=1)
        result = call("export", folder + "/run", "--coco", folder + "/out")
        self.assertEqual(result.returncode, 0)
        self.assertIn("the run has no masks", result.stdout)
        with open(folder + "/out/annotations.json", encoding="utf-8") as file:
            annotations = json.load(file)["annotations"]
        self.assertEqual({str(a["segmentation"]) for a in annotations}, {"[]"})

    def test_plain(self):
        self.check("plain")

    def test_binned_part(self):
        self.check("binned")
        image = self.coco("binned")["images"][0]
        self.assertEqual((image["width"], image["height"]), (WINDOW[2] // 2, WINDOW[3] // 2))

    def test_satnet_of_a_binned_part(self):
        """The same frames as SatNet has them: places as fractions of the image, field of view of a pixel, WCS."""
        made, out = self.folder + "/binned", runs.scratch() + "/set"
        result = call("export", made, "--satnet", out, "--star-limit", str(LIMIT), "--box", "0")
        self.assertEqual((result.returncode, result.stderr), (0, ""))
        with open(out + "/Annotations/binned.0001.json", encoding="utf-8") as file:
            data = json.load(file)["data"]
        self.assertAlmostEqual(data["sensor"]["iFOVx"], 2 * 3 / 3600, delta=1e-12)
        self.assertAlmostEqual(data["sensor"]["iFOVy"], 2 * 3 / 3600, delta=1e-12)
        self.assertEqual((data["sensor"]["width"], data["sensor"]["height"]), (400, 320))
        truth = {(row["kind"], round(row["ra_deg"], 9)): row for row in runs.database(made).execute(
            "SELECT * FROM truth WHERE exposure_id = 1")}
        with fits.open(made + "/frames.fits") as frames, fits.open(out + "/ImageFiles/binned.0001.fits") as single:
            np.testing.assert_array_equal(single[0].data, frames[2].data)
            for key in ("CRPIX1", "CRPIX2", "CRVAL1", "CRVAL2", "CD1_1", "CD1_2", "CD2_1", "CD2_2", "WINX0", "WINY0", "BINNING",
                        "PIXSCALE", "GAIN", "DATE-OBS"):
                expected = frames[2].header.get(key, frames[0].header.get(key))
                if isinstance(expected, float):
                    self.assertAlmostEqual(single[0].header[key], expected, delta=1e-9, msg=key)
                else:
                    self.assertEqual(single[0].header[key], expected, key)
        satellites = 0
        for o in data["objects"]:
            row = truth[o["class_name"].replace("Satellite", "object").lower(), round(o["ra"], 9)]
            for axis, size, start in (("x", 400, WINDOW[0]), ("y", 320, WINDOW[1])):
                place = lambda when: (row[f"{axis}_{when}_px"] - start + 0.5) / 2 / size  # noqa: E731
                way = [place(when) for when in ("start", "mid", "end")]
                np.testing.assert_allclose([o[f"{axis}_{k}"] for k in ("start", "mid", "end", "centroid", "chief")],
                                           way + [place("centroid"), place("chief")], atol=1e-12)
                np.testing.assert_allclose([o[f"{axis}_min"], o[f"{axis}_max"], o[f"{axis}_center"]],
                                           [min(way), max(way), (min(way) + max(way)) / 2], atol=1e-12)
                self.assertAlmostEqual(o["bbox_width" if axis == "x" else "bbox_height"], max(way) - min(way), delta=1e-12)
            self.assertAlmostEqual(o["dec"], row["dec_deg"], delta=1e-12)
            if row["kind"] == "object":
                satellites += 1
                self.assertEqual((o["object_name"], o["object_id"]), ("INMARSAT GX5", "44801"))
            else:
                self.assertEqual(o["object_id"], str(row["id"]))
        self.assertEqual((data["stats"]["num_obs"], data["stats"]["num_obs_initial"]), (satellites, satellites))
        self.assertGreater(len(data["objects"]), 10)

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
        result = call("export", self.folder + "/binned", "--yolo", out + "/set", "--bits", "8", "--first",
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
        result = call("export", folder + "/run", "--coco", folder + "/out")
        self.assertEqual(result.returncode, 1)
        self.assertIn("holds no truth to label frames by", result.stderr)


if __name__ == "__main__":
    unittest.main()
