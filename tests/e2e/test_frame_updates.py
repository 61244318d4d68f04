#!/usr/bin/env python3
"""A run that a file drives frame by frame, as its user sees it: windows, exposures, field of view and
the place of an injected object in every frame, worked out again with astropy from the file alone.

Usage, from the repository root: /usr/bin/python3 tests/e2e/test_frame_updates.py BORESIGHT
"""
import json
import os
import subprocess
import unittest

import numpy as np
from astropy.constants import c
from astropy.coordinates import get_body_barycentric_posvel
from astropy.io import fits
from astropy.time import Time, TimeDelta
from astropy.utils import iers

import runs

iers.conf.auto_download = False
iers.conf.iers_degraded_accuracy = "ignore"
iers.conf.auto_max_age = None

SCENARIO = "scenarios/frame_by_frame.json"
UPDATES = "scenarios/updates/frame_by_frame.json"
KEY = runs.SENSOR + "/frame_updates_file"


def tearDownModule():
    runs.clean()


def rotate(q, v):
    """v in the axes that the scalar-last quaternion q leads to."""
    x, y, z, w = np.array(q) / np.linalg.norm(q)
    matrix = np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]])
    return matrix @ v


class FrameByFrame(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.out = os.path.join(runs.scratch(), "run")
        runs.run(SCENARIO, cls.out)
        with open(UPDATES, encoding="utf-8") as file:
            cls.frames = json.load(file)["frames"]
        with open(SCENARIO, encoding="utf-8") as file:
            cls.epoch = json.load(file)["epoch_utc"]

    def test_settings_stay_until_changed(self):
        with fits.open(os.path.join(self.out, "frames.fits")) as hdus:
            shown = [(h.header["NAXIS1"], h.header["WINX0"], h.header["EXPTIME"],
                      h.header["PIXSCALE"]) for h in hdus[1:]]
        self.assertEqual(shown, [(512, 0, 0.5, 6), (512, 0, 0.5, 6), (512, 0, 0.5, 6),
                                 (512, 0, 0.25, 6), (256, 128, 0.25, 6), (256, 128, 0.25, 6),
                                 (512, 0, 0.25, 12), (512, 0, 0.25, 12)])
        starts = [row[0] for row in runs.database(self.out).execute(
            "SELECT start_s FROM frames ORDER BY exposure_id")]
        self.assertEqual(starts, [0, 1, 2, 3, 4, 5, 6, 6.75])

    def test_the_object_is_where_the_file_puts_it(self):
        """Light time and aberration by hand, pinhole with the file's attitude."""
        rows = {row["exposure_id"]: row for row in runs.database(self.out).execute(
            "SELECT t.*, e.start_tick, e.end_tick, e.pixel_scale_arcsec FROM truth t"
            " JOIN exposures e USING (exposure_id) WHERE kind = 'object'")}
        self.assertEqual(len(rows), 8)
        for frame in self.frames:
            row = rows[frame["frame"]]
            eye, visitor = frame["objects"]
            for end in ("start", "end"):
                time_s = row[end + "_tick"] / 6000
                r, v = (np.array(eye[f"{end}_{w}"]) for w in ("position_m", "velocity_mps"))
                target, motion = (np.array(visitor[f"{end}_{w}"])
                                  for w in ("position_m", "velocity_mps"))
                when = Time(self.epoch.rstrip("Z"), scale="utc") + TimeDelta(time_s, format="sec")
                earth = get_body_barycentric_posvel("earth", when)[1].xyz.to_value("m/s")
                light_s = np.linalg.norm(target - r) / c.value
                # the Earth moves on while the light is under way; then aberration, to first order
                way = target - light_s * (motion + earth) - r
                seen = way / np.linalg.norm(way) + (v + earth) / c.value
                q = frame.get(f"q_cam_from_gcrf_{end}")
                if q is None:
                    q = frame["pointing"][0 if end == "start" else -1]["q_cam_from_gcrf"]
                x, y, z = rotate(q, seen)
                scale = np.deg2rad(row["pixel_scale_arcsec"] / 3600)
                # second order of aberration: 1e-8 rad, 4e-4 px
                self.assertAlmostEqual(row[f"x_{end}_px"], 255.5 + x / z / scale, delta=2e-3)
                self.assertAlmostEqual(row[f"y_{end}_px"], 255.5 + y / z / scale, delta=2e-3)

    def test_the_light_is_there(self):
        with fits.open(os.path.join(self.out, "frames.fits")) as hdus:
            for hdu in hdus[1:]:
                x, y = 254 - hdu.header["WINX0"], 254 - hdu.header["WINY0"]
                core = hdu.data[y:y + 4, x:x + 4].astype(float)
                # V 6.4: 8e4 electrons over a PSF of 2 px, noise of some 10 counts
                self.assertGreater(core.max(), np.median(hdu.data) + 1000)

    def test_binning_changes_on_the_way(self):
        folder = runs.scratch()
        with open(UPDATES, encoding="utf-8") as file:
            updates = json.load(file)
        for frame, binning in ((2, 2), (4, 3), (6, 1)):
            updates["frames"][frame]["binning"] = binning
        path, out = os.path.join(folder, "updates.json"), os.path.join(folder, "run")
        with open(path, "w", encoding="utf-8") as file:
            json.dump(updates, file)
        runs.run(SCENARIO, out, f"{KEY}={path}", f"/observers/0/orbit/states_file={path}",
                 f"/world/objects/0/orbit/states_file={path}")
        with fits.open(os.path.join(out, "frames.fits")) as hdus:
            sides = [h.header["NAXIS1"] for h in hdus[1:]]
            scales = [3600 * np.hypot(h.header["CD1_1"], h.header["CD2_1"]) for h in hdus[1:]]
            pixels = [hdus[i].data.astype(float) for i in (1, 3)]
            offset = hdus[0].header["OFFSET"]
        self.assertEqual(sides, [512, 512, 256, 256, 85, 85, 512, 512])
        np.testing.assert_allclose(scales, [6, 6, 12, 12, 18, 18, 12, 12], rtol=1e-3)
        # the sky of four pixels, to its noise in 65536 of them
        sky = []
        for image in pixels:
            middle, spread = np.median(image), 1.4826 * np.median(np.abs(image - np.median(image)))
            dark = image[np.abs(image - middle) < 4 * spread + 1]
            sky.append(dark.mean() - offset)
        self.assertAlmostEqual(sky[1] / sky[0], 4, delta=0.3)
        bins = [row[0] for row in runs.database(out).execute(
            "SELECT binning FROM frames ORDER BY exposure_id")]
        self.assertEqual(bins, [1, 1, 2, 2, 3, 3, 1, 1])

    def test_faults_end_before_anything_is_written(self):
        folder = runs.scratch()
        with open(UPDATES, encoding="utf-8") as file:
            good = json.load(file)
        for change, words in (
                (lambda f: f[2].pop("q_cam_from_gcrf_end"), ["(frame 2)", "q_cam_from_gcrf_end"]),
                (lambda f: f[4].update(window_px=[400, 0, 256, 256]),
                 ["(frame 4)/window_px", "512 x 512"]),
                (lambda f: f[3].update(exposure=1), ["(frame 3)/exposure", "exposure_s"]),
                (lambda f: f.pop(1), ["frame 1", "missing_frames"])):
            bad = json.loads(json.dumps(good))
            change(bad["frames"])
            path = os.path.join(folder, "updates.json")
            with open(path, "w", encoding="utf-8") as file:
                json.dump(bad, file)
            out = os.path.join(folder, "run")
            result = subprocess.run(
                runs.command(SCENARIO, out, f"{KEY}={path}",
                             f"/observers/0/orbit/states_file={path}",
                             f"/world/objects/0/orbit/states_file={path}"),
                capture_output=True, text=True, timeout=60, check=False)
            self.assertEqual(result.returncode, 1)
            for word in words + ["updates.json"]:
                self.assertIn(word, result.stderr)
            self.assertEqual(os.listdir(folder), ["updates.json"])


if __name__ == "__main__":
    unittest.main()
