"""Masks of the parts of shapes in studies of kind cubes."""
import csv
import json
import os
import subprocess
import unittest

from astropy.io import fits

import runs


class CubeParts(unittest.TestCase):
    """Kind cubes with part_masks: the plane of parts of the run by hand, and the parts' names."""

    def check_labels(self, frames, database):
        """Fractions of a binned window against pixels of the sensor."""
        rows = {}
        for row in database.execute("SELECT * FROM truth"):
            rows[row["exposure_id"], row["kind"], str(row["norad"] or row["id"])] = row
        backgrounds = dict(database.execute("SELECT exposure_id, background_e FROM exposures"))
        seen = 0
        for frame in frames:
            # 12 digits
            self.assertAlmostEqual(frame["background_e"] / backgrounds[frame["sequence_id"]], 1, delta=1e-10)
            for item in frame["objects"]:
                row = rows[frame["sequence_id"], "star" if item["class_id"] == 2 else "object", item["object_id"]]
                for axis, first, size in (("x", 72, 256), ("y", 40, 200)):
                    beside = row[axis + "_centroid_px"] - row[axis + "_chief_px"]
                    places = [(row[f"{axis}_{when}_px"] + beside - first + 0.5) / size for when in ("start", "mid", "end")]
                    chief = (row[axis + "_chief_px"] - first + 0.5) / size
                    for name, want in (("start", places[0]), ("mid", places[1]), ("end", places[2]), ("chief", chief),
                                       ("centroid", chief + beside / size), ("min", min(places)), ("max", max(places)),
                                       ("center", (min(places) + max(places)) / 2)):
                        self.assertAlmostEqual(item[f"{axis}_{name}"], want, delta=1e-10)
                for name, want in (("magnitude", row["v_mag"]), ("ra", row["ra_deg"]), ("dec", row["dec_deg"]),
                                   ("pe_per_sec", row["electrons"] / frame["exposure_s"])):
                    self.assertAlmostEqual(item[name] / want, 1, delta=1e-10)
                seen += 1
        self.assertGreaterEqual(seen, 3)

    def test_parts(self):
        folder = runs.scratch()
        sensor = "/observers/0/sensors/0/"
        path = os.path.join(folder, "study.json")
        wanted = {"boresight_study": 1, "name": "parts", "kind": "cubes", "seed": "0x51", "replicates": 1,
                  "scenarios": [{"file": os.path.abspath("scenarios/inspection.json")}],
                  "set": {"/duration_s": 4, "/world/star_catalogue": "embedded", "/observers/0/burns": [],
                          "/observers/0/orbit/offset_rtn_m": [0, -60, 0], sensor + "exposure/exposure_s": 0.01,
                          sensor + "camera/width_px": 384, sensor + "camera/height_px": 320,
                          sensor + "exposure/window_px": [72, 40, 256, 200], sensor + "exposure/binning": 2,
                          sensor + "modules": {"gimbal": {"type": "ideal", "object": "target"},
                                               "scenegen": {"type": "opencl", "star_limit_v_mag": 5}}},
                  "cubes": {"part_masks": True}}
        with open(path, "w", encoding="utf-8") as file:
            json.dump(wanted, file)
        out, scenario, hand = (os.path.join(folder, name) for name in ("out", "one.json", "hand"))
        result = runs.call("study", path, "--out", out)
        self.assertEqual((result.returncode, result.stderr), (0, ""))
        with open(scenario, "w", encoding="utf-8") as file:
            file.write(runs.call("study", path, "--emit", "0").stdout)
        result = subprocess.run([runs.BORESIGHT, "run", scenario, "--quiet", "--no-pictures", "--out", hand], capture_output=True,
                                text=True, timeout=600)
        self.assertEqual(result.returncode, 0, result.stderr)
        ours_path = os.path.join(out, "PartFiles", "000000.fits")
        with fits.open(os.path.join(hand, "parts.fits")) as theirs, fits.open(ours_path) as ours:
            self.assertEqual(len(ours), len(theirs))
            self.assertGreaterEqual(len(ours), 3)
            for one, other in zip(ours[1:], theirs[1:], strict=True):
                self.assertTrue((one.data == other.data).all())
                for key in ("FRAMEID", "DATE-OBS", "DATE-END", "EXPTIME", "WINX0", "WINY0", "BINNING", "PIXSCALE"):
                    self.assertEqual(one.header[key], other.header[key], key)
                self.assertGreaterEqual(len(set(one.data.ravel())), 3)  # none and two parts at least
        with open(os.path.join(out, "Annotations", "000000.json"), encoding="utf-8") as file:
            labels = json.load(file)["data"]
        parts = labels["parts"]
        with runs.database(hand) as database:
            self.check_labels(labels["frames"], database)
            self.assertEqual([(p["number"], p["object_name"], p["name"]) for p in parts],
                             [tuple(row) for row in database.execute("SELECT number, object, part FROM parts")])
        self.assertEqual(len(parts), 5)
        with open(os.path.join(hand, "frames.fits"), "rb") as one, \
                open(os.path.join(out, "ImageFiles", "000000.fits"), "rb") as other:
            self.assertEqual(one.read(), other.read())
        with open(os.path.join(out, "runs.csv"), encoding="utf-8", newline="") as file:
            self.assertEqual(int(next(csv.DictReader(file))["part_bytes"]), os.path.getsize(ours_path))
        self.assertFalse(os.path.exists(os.path.join(out, "MaskFiles")))


def tearDownModule():
    runs.clean()


if __name__ == "__main__":
    unittest.main()
