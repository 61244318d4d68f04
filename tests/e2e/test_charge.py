"""The main job on a sensor with hot pixels and radiation hits that image processing has no map of:
no maps, no list of bad pixels, and none learned (test_detector_effects.py has those).

Usage, from the repository root: /usr/bin/python3 tests/e2e/test_charge.py BORESIGHT
"""
import unittest

import runs

DETECTOR = runs.SENSOR + "/camera/detector"
CHARGE = [DETECTOR + "/hot_fraction=0.0005", DETECTOR + "/hot_median_e_per_s=1000",
          DETECTOR + "/cosmic_rays/rate_per_cm2_s=20",
          # of no account; the kernels of test_calframes.py, compiled once
          DETECTOR + "/prnu_rms=1e-6", DETECTOR + "/column_offset_rms_e=1e-6",
          runs.SENSOR + "/modules/imgproc/bad_pixel_learning/enabled=false"]


class Charge(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.out = runs.scratch()
        cls.manifest = runs.run(runs.TRACK, cls.out + "/run", runs.NO_FRAMES, *CHARGE, seed=1,
                                duration=60)
        cls.db = runs.database(cls.out + "/run")

    def test_the_loop_tracks(self):
        summary = self.manifest["summary"]
        self.assertEqual(summary["final_mode"], "track")
        self.assertEqual(summary["wrong_target_frames"], 0)
        self.assertGreater(summary["track_fraction"], 0.95)

    def test_labels(self):
        """In track, frames hold some 470 hot pixels above the threshold, 18 hits, one object."""
        count = {row["label"]: row["n"] for row in self.db.execute(
            "SELECT label, count(*) / 20.0 AS n FROM detections WHERE exposure_id BETWEEN 35 AND 54"
            " GROUP BY label")}
        self.assertGreater(count["hot_pixel"], 430)
        self.assertLess(count["hot_pixel"], 500)
        hits = self.db.execute("SELECT avg(hits) AS n FROM exposures WHERE exposure_id BETWEEN 35"
                               " AND 54").fetchone()["n"]
        self.assertAlmostEqual(count["hit"], hits, delta=0.3 * hits)
        self.assertLess(count["object"], 6)
        worst = self.db.execute(
            "SELECT min(label_probability) AS low, max(label_probability) AS high FROM detections"
            " WHERE label != 'unknown'").fetchone()
        self.assertGreater(worst["low"], 0)
        self.assertLessEqual(worst["high"], 1)


def tearDownModule():
    runs.clean()


if __name__ == "__main__":
    unittest.main()
