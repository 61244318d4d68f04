#!/usr/bin/env python3
"""Windows round predicted places: while a target is followed only they are looked at, and track and
attitude stay as good as with whole frames.

Usage, from the repository root: /usr/bin/python3 tests/e2e/test_windows.py BORESIGHT
"""
import os
import unittest

import numpy as np

import runs

WINDOWS = runs.SENSOR + "/modules/imgproc/track_windows=true"


class Windows(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        folder = runs.scratch()
        cls.out = {name: os.path.join(folder, name) for name in ("whole", "windows")}
        runs.parallel(lambda name: runs.run(
            runs.TRACK, cls.out[name], runs.NO_FRAMES, *([WINDOWS] if name == "windows" else []),
            duration=150), cls.out)

    @classmethod
    def tearDownClass(cls):
        runs.clean()

    def rows(self, name, query):
        return runs.database(self.out[name]).execute(query).fetchall()

    def test_windows_are_used_while_a_target_is_followed(self):
        modes = {name: np.array([row[0] for row in self.rows(
            name, "SELECT windows FROM detection_frames ORDER BY exposure_id")])
            for name in self.out}
        self.assertTrue(np.all(modes["whole"] == 0))
        # the first confirmed track is published in a frame and seen by the one after the next
        target = [row[0] for row in self.rows(
            "windows", "SELECT exposure_id FROM track_frames WHERE target_id > 0")]
        self.assertTrue(np.all(modes["windows"][:target[0]] == 0))
        for i in range(target[0] + 2, len(modes["windows"])):
            self.assertEqual(modes["windows"][i] == 0, i % 60 < 6, i)
        # 16 stars and the target
        self.assertTrue(np.all(modes["windows"] <= 17))

    def test_track_and_attitude_stay(self):
        figures = {name: runs.manifest(out)["summary"] for name, out in self.out.items()}
        sigma = {name: np.array(self.rows(
            name, "SELECT attitude_sigma_x_arcsec, attitude_sigma_y_arcsec FROM track_frames WHERE "
            "attitude_valid AND time_s > 30")) for name in self.out}
        ratio = np.sqrt(np.mean(sigma["windows"] ** 2) / np.mean(sigma["whole"] ** 2))
        print(f"pointing RMS {figures['windows']['pointing_rms_px']:.4f} px in windows, "
              f"{figures['whole']['pointing_rms_px']:.4f} px in whole frames; sigma of the "
              f"attitude {ratio:.3f} times")
        self.assertEqual(figures["windows"]["final_mode"], "track")
        self.assertEqual(figures["windows"]["track_fraction"], figures["whole"]["track_fraction"])
        # 0.2 px of jitter in both, the same one; what the centroids add is a tenth of that
        self.assertLess(abs(figures["windows"]["pointing_rms_px"] /
                            figures["whole"]["pointing_rms_px"] - 1), 0.02)
        # the 16 brightest stars of some 25 hold most of the information
        self.assertLess(ratio, 1.1)
        self.assertGreater(len(sigma["windows"]), 0.98 * len(sigma["whole"]))


if __name__ == "__main__":
    unittest.main()
