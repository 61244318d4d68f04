#!/usr/bin/env python3
"""boresight export --satnet: images and labels as SatNet's readers take them, checked with astropy.

Usage, from the repository root: /usr/bin/python3 tests/e2e/test_satnet.py BORESIGHT
"""
import glob
import json
import os
import shutil
import sqlite3
import unittest

import numpy as np
from astropy.io import fits
from astropy.wcs import WCS

import runs
from runs import call

SCENARIO = "scenarios/frame_by_frame.json"
# keys of satsim/io/satnet.py, github.com/ssc-ai/satsim
OBJECT_KEYS = {
    "class_name", "class_id", "y_min", "x_min", "y_max", "x_max", "y_center", "x_center",
    "bbox_height", "bbox_width", "source", "magnitude", "pe_per_sec", "y_start", "x_start", "y_mid",
    "x_mid", "y_end", "x_end", "seg_id", "object_name", "object_id", "pixels", "snr",
    "snr_aperture", "ra", "dec", "x_chief", "y_chief", "x_centroid", "y_centroid"}


def tearDownModule():
    runs.clean()


def annotations(folder):
    out = []
    for path in sorted(glob.glob(folder + "/Annotations/*.json")):
        with open(path, encoding="utf-8") as file:
            out.append(json.load(file)["data"])
    return out


class SatNet(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        folder = runs.scratch()
        cls.made, cls.out = os.path.join(folder, "fly"), os.path.join(folder, "set")
        runs.run(SCENARIO, cls.made, '/record/planes=["segmentation"]',
                 "/world/faint_stars=statistical")
        result = call("export", cls.made, "--satnet", cls.out, "--star-limit", "13", "--split", "80,10,10")
        assert (result.returncode, result.stderr) == (0, ""), result.stderr

    def test_in_the_folder_of_out(self):
        folder = runs.scratch()
        for words, where in ((("--satnet", "set", "--out", folder + "/a"), "a/set"),
                             (("--satnet", folder + "/b", "--out", folder + "/c"), "b")):
            result = call("export", self.made, "--last", "0", *words)
            self.assertEqual((result.returncode, result.stderr), (0, ""))
            self.assertEqual(os.listdir(os.path.join(folder, where, "ImageFiles")),
                             ["fly.0000.fits"])
        self.assertFalse(os.path.exists("set"))

    def test_tree(self):
        self.assertEqual(sorted(os.listdir(self.out)),
                         ["Annotations", "ImageFiles", "test.txt", "train.txt", "val.txt"])
        self.assertEqual(sorted(os.listdir(self.out + "/ImageFiles")),
                         [f"fly.{k:04d}.fits" for k in range(8)])
        self.assertEqual(sorted(os.listdir(self.out + "/Annotations")),
                         [f"fly.{k:04d}.json" for k in range(8)])
        self.assertFalse(os.path.exists(self.made + ".export"))

    def compare_keys(self, one, other):
        """All keys of the frame but those of the file's structure."""
        keys = set(one) & set(other) - {"SIMPLE", "XTENSION", "EXTEND", "BITPIX", "NAXIS", "PCOUNT", "GCOUNT", "COMMENT", ""}
        self.assertGreater(keys, {"DATE-OBS", "EXPTIME", "GAIN", "WINX0", "WINY0", "BINNING", "FRAMEID", "PIXSCALE", "OBSPOSZ",
                                  "OBSVELY", "CRVAL1", "CRPIX2", "CD1_2", "CD2_1", "CD2_2"})
        for key in keys:
            if isinstance(other[key], float):  # the same solution from what the tables hold
                self.assertAlmostEqual(one[key], other[key], delta=1e-12 * max(1, abs(other[key])))
            else:
                self.assertEqual(one[key], other[key], key)

    def test_images_are_the_frames(self):
        with fits.open(self.made + "/frames.fits") as hdus:
            for k, hdu in enumerate(hdus[1:]):
                with fits.open(f"{self.out}/ImageFiles/fly.{k:04d}.fits") as single:
                    single.verify("exception")
                    self.assertEqual(len(single), 1)
                    self.assertEqual(single[0].data.dtype, np.uint16)
                    np.testing.assert_array_equal(single[0].data, hdu.data)
                    self.compare_keys(single[0].header, hdu.header)

    def check_places(self, o, row, keys, image):
        """Fractions of the image against pixels of the sensor."""
        for axis, size in (("x", image.shape[1]), ("y", image.shape[0])):
            beside = row[axis + "_centroid_px"] - row[axis + "_chief_px"]  # boxes enclose the light

            def of(when, beside=0.0, axis=axis, size=size):
                return (row[f"{axis}_{when}_px"] + beside - keys[f"WIN{axis.upper()}0"] + 0.5) / keys["BINNING"] / size

            places = [of(when, beside) for when in ("start", "mid", "end")]
            for name, want in (("start", places[0]), ("mid", places[1]), ("end", places[2]), ("chief", of("chief")),
                               ("centroid", of("centroid")), ("min", min(places)), ("max", max(places)),
                               ("center", (min(places) + max(places)) / 2)):
                self.assertAlmostEqual(o[f"{axis}_{name}"], want, delta=1e-11)

    def test_labels(self):
        rows = runs.database(self.made)
        for k, data in enumerate(annotations(self.out)):
            with fits.open(f"{self.out}/ImageFiles/{data['file']['filename']}") as hdus:
                image, keys = hdus[0].data, hdus[0].header
            height, width = image.shape
            self.assertEqual((data["file"]["dirname"], data["file"]["sequence_id"]), ("set", k))
            self.assertEqual((data["sensor"]["height"], data["sensor"]["width"]), (height, width))
            self.assertAlmostEqual(data["sensor"]["iFOVx"], keys["PIXSCALE"] / 3600, delta=1e-15)
            self.assertEqual(data["stats"]["num_obs"], 1)
            wcs, stars = WCS(keys), 0
            for o in data["objects"]:
                self.assertEqual(set(o), OBJECT_KEYS)
                row = rows.execute("SELECT * FROM truth WHERE exposure_id = ? AND item = ?",
                                   (k, o["seg_id"])).fetchone()
                self.assertEqual(o["class_name"], "Star" if row["kind"] == "star" else "Satellite")
                self.assertEqual(o["class_id"], 2 if row["kind"] == "star" else 1)
                self.check_places(o, row, keys, image)
                self.assertAlmostEqual(o["bbox_width"] * width, 20, delta=1e-9)
                self.assertAlmostEqual(o["bbox_height"] * height, 20, delta=1e-9)
                self.assertAlmostEqual(o["magnitude"], row["v_mag"], delta=1e-12)
                self.assertAlmostEqual(o["snr_aperture"] / row["snr"], 1.0, delta=1e-14)
                self.assertAlmostEqual(o["pe_per_sec"] * keys["EXPTIME"], row["electrons"],
                                       delta=1e-9 * row["electrons"])
                if row["kind"] == "star":
                    stars += 1
                    self.assertLessEqual(o["magnitude"], 13)
                    x, y = wcs.all_world2pix(o["ra"], o["dec"], 0)
                    # WCS of the mean attitude against the middle of a shaken exposure
                    self.assertAlmostEqual(float(x), o["x_mid"] * width - 0.5, delta=1.5)
                    self.assertAlmostEqual(float(y), o["y_mid"] * height - 0.5, delta=1.5)
                else:
                    self.assertEqual(o["object_name"], "visitor")
                    x, y = round(o["x_mid"] * width - 0.5), round(o["y_mid"] * height - 0.5)
                    self.assertGreater(image[y - 1:y + 2, x - 1:x + 2].max(),
                                       np.median(image) + 1000)
            self.assertGreater(stars, 0)

    def test_score_by_annotations_and_by_truth(self):
        """The labels of a run are its truth, and its detections score the same against both."""
        def score(*words):
            return json.loads(call("score", *words, "--json", "-", "--resamples", "50").stdout)

        perfect = score(self.out, "--truth", self.made)
        self.assertEqual((perfect["frames"], perfect["truths"], perfect["true_positives"],
                          perfect["false_positives"]), (8, 8, 8, 0))
        self.assertLess(perfect["figures"]["rms_px"]["value"], 1e-9)  # rounding
        by_truth = score(self.made, "--truth", self.made)
        by_labels = score(self.made, "--truth", self.out)
        self.assertEqual(by_truth["true_positives"], by_labels["true_positives"])
        self.assertEqual(by_truth["false_positives"], by_labels["false_positives"])
        found = runs.database(self.made).execute(
            "SELECT count(*) FROM detections WHERE label = 'object'").fetchone()[0]
        self.assertEqual(by_truth["true_positives"] + by_truth["false_positives"], found)
        copy = os.path.join(runs.scratch(), "copy")
        shutil.copytree(self.made, copy)
        with sqlite3.connect(copy + "/run.sqlite") as tables:
            tables.execute("DROP TABLE frames")  # as with /record/frames none
        self.assertEqual(score(copy, "--truth", copy)["figures"], by_truth["figures"])
        with sqlite3.connect(copy + "/run.sqlite") as tables:
            tables.execute("UPDATE exposures SET dropped = 1 WHERE exposure_id = 3")
        self.assertEqual(score(self.out, "--truth", copy)["truths"], 7)  # a dropped frame shows nothing
        with sqlite3.connect(copy + "/run.sqlite") as tables:  # the only sensor, but not the first
            for (name,) in tables.execute("SELECT m.name FROM sqlite_master m, pragma_table_info(m.name) c"
                                          " WHERE m.type = 'table' AND c.name = 'sensor'").fetchall():
                tables.execute(f"UPDATE {name} SET sensor = 1")
        self.assertEqual(score(copy, "--truth", self.out)["true_positives"], by_labels["true_positives"])
        os.mkdir(copy + "/labels")
        for name, numbered in (("a", {}), ("b", {"sequence_id": 0}), ("c", {"sequence_id": 5}), ("d", {"sequence_id": 0})):
            with open(f"{copy}/labels/{name}.json", "w", encoding="utf-8") as file:
                json.dump({"data": {**annotations(self.out)[0], "file": numbered}}, file)
        for name in "bd":  # the place of a is 0
            self.assertIn("is in two files", call("score", copy + "/labels", "--truth", copy).stderr)
            os.remove(f"{copy}/labels/{name}.json")
        self.assertEqual(call("score", copy + "/labels", "--truth", copy).returncode, 0)

    def test_split_follows_names(self):
        def parts(folder):
            out = {}
            for part in ("train", "val", "test"):
                with open(f"{folder}/{part}.txt", encoding="utf-8") as file:
                    for line in file:
                        image, label = line.split()
                        self.assertTrue(os.path.exists(f"{folder}/{image}"))
                        self.assertTrue(os.path.exists(f"{folder}/{label}"))
                        self.assertNotIn(image, out)
                        out[image] = part
            return out

        whole = parts(self.out)
        self.assertEqual(len(whole), 8)
        some = os.path.join(runs.scratch(), "some")
        self.assertEqual(call("export", self.made, "--satnet", some, "--split", "80,10,10", "--first", "1",
                                "--every", "3").returncode, 0)
        self.assertEqual(parts(some), {k: whole[k] for k in parts(some)})
        self.assertEqual(len(parts(some)), 3)
        self.assertEqual(call("export", self.made, "--satnet", some, "--split", "0,0,1").returncode, 0)
        self.assertEqual(set(parts(some).values()), {"test"})

    def test_cube_of_a_window_and_boxes(self):
        folder = runs.scratch()
        made, out = os.path.join(folder, "cube"), os.path.join(folder, "set")
        runs.run(runs.STARE, made, "/record/frames=cube", f"{runs.SENSOR}/exposure/binning=2",
                 f"{runs.SENSOR}/exposure/window_px=[96,148,800,600]", f"{runs.SENSOR}/modules=" + json.dumps(
            {"gimbal": {"type": "ideal", "object": "INMARSAT GX5"},
             "scenegen": {"type": "opencl"}}), duration=3)
        self.assertEqual(call("export", made, "--satnet", out, "--box", "0").returncode, 0)
        found = annotations(out)
        with fits.open(made + "/frames.fits") as hdus:
            self.assertEqual(len(found), len(hdus[0].data))
            for k, plane in enumerate(hdus[0].data):
                np.testing.assert_array_equal(
                    fits.getdata(f"{out}/ImageFiles/cube.{k:04d}.fits"), plane)
        rows = runs.database(made)
        with fits.open(f"{out}/ImageFiles/cube.0001.fits") as hdus:
            image, keys = hdus[0].data, hdus[0].header
            self.assertEqual((image.shape, keys["WINX0"], keys["WINY0"], keys["BINNING"]), ((300, 400), 96, 148, 2))
        places = {(o["class_id"], o["object_id"]): o for o in found[1]["objects"]}
        self.assertEqual(len(places), len(found[1]["objects"]))
        self.assertGreater(len(places), 2)
        for row in rows.execute("SELECT * FROM truth WHERE exposure_id = 1"):
            o = places.pop((2 if row["kind"] == "star" else 1, str(row["norad"] or row["id"])), None)
            if o:
                self.check_places(o, row, keys, image)
                self.assertEqual(o["seg_id"], -1)
                self.assertAlmostEqual(o["bbox_width"], o["x_max"] - o["x_min"], delta=1e-15)
                self.assertAlmostEqual(o["bbox_height"], o["y_max"] - o["y_min"], delta=1e-15)
        self.assertFalse(places)

    def test_misuse(self):
        for words in (("--split", "80,10,10"), ("--satnet", "x", "--split", "80,10"),
                      ("--satnet", "x", "--split", "0,0,0"), ("--satnet", "x", "--split", "-1,1,1"),
                      ("--satnet", "x", "--box", "-1")):
            result = call("export", self.made, *words)
            self.assertEqual(result.returncode, 2, words)
            self.assertIn(words[-2], result.stderr)
        blind = os.path.join(runs.scratch(), "blind")
        runs.run(SCENARIO, blind, "/record/truth=false", duration=1)
        result = call("export", blind, "--satnet", blind + ".set")
        self.assertEqual(result.returncode, 1)
        self.assertIn("/record/truth=true", result.stderr)


if __name__ == "__main__":
    unittest.main()
