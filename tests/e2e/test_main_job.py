#!/usr/bin/env python3
"""The main job: NEOSSat finds INMARSAT GX5 from a wrong cue and follows it.

The figures of the manifest are computed again from the tables of the run (figures.py).

Usage, from the repository root: /usr/bin/python3 tests/e2e/test_main_job.py BORESIGHT
"""
import os
import unittest

import figures
import runs


class MainJob(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.out = os.path.join(runs.scratch(), "track")
        cls.manifest = runs.run(runs.TRACK, cls.out, runs.NO_FRAMES, threads=os.cpu_count(),
                                 pictures=True)
        cls.summary = cls.manifest["summary"]
        print("summary:", cls.summary)

    def test_figures_of_the_issue(self):
        self.assertTrue(self.manifest["complete"])
        self.assertEqual(self.summary["frames"], 300)
        self.assertEqual(self.summary["final_mode"], "track")
        self.assertLessEqual(self.summary["time_to_confirm_s"], 45)
        self.assertGreaterEqual(self.summary["track_fraction"], 0.98)
        self.assertLessEqual(self.summary["pointing_rms_px"], 0.5)
        self.assertEqual(self.summary["wrong_target_frames"], 0)

    def test_manifest_ends_with_the_summary(self):
        self.assertEqual(list(self.manifest)[-1], "summary")
        self.assertEqual(list(self.summary)[:7],
                         ["frames", "final_mode", "time_to_confirm_s", "track_fraction",
                          "pointing_rms_px", "pointing_p99_px", "real_time_factor"])
        # 300 s at 6000 ticks/s end before tick 1,800,000; the plant's last step is a period earlier
        self.assertEqual(self.manifest["last_tick"], 1_800_000 - 6)

    def test_target_is_outside_the_field_at_first(self):
        db = runs.database(self.out)
        first = db.execute("SELECT min(exposure_id) FROM truth WHERE kind = 'object' AND in_field"
                           ).fetchone()[0]
        self.assertGreater(first, 0)

    def test_recomputed_from_the_tables(self):
        orbit = figures.Orbit("scenarios/catalogue_2022-06.tle", 44801, "2022-06-16T22:10:00Z")
        mine, unclear = figures.judge(figures.Frames(runs.database(self.out), orbit, 44801))
        print("recomputed:", mine)
        self.assertEqual(unclear, 0)
        for key in ("frames", "visible_frames", "breaks", "pointing_frames", "track_frames"):
            self.assertEqual(mine[key], self.summary[key], key)
        # ticks over rate on both sides; the same formulae in another order
        for key in ("time_to_confirm_s", "time_to_acquire_s", "time_to_settle_s", "custody",
                    "track_fraction", "pointing_rms_px", "pointing_bias_px", "pointing_max_px",
                    "detected_fraction", "track_rms_px", "track_max_px"):
            self.assertAlmostEqual(mine[key], self.summary[key], delta=1e-8, msg=key)
        # nearest rank, from bins of 0.1 %
        for key in ("pointing_median_px", "pointing_p99_px", "track_median_px"):
            self.assertAlmostEqual(mine[key] / self.summary[key], 1, delta=0.00051, msg=key)

    def test_pictures(self):
        for name in ("quicklook.png", "pointing.png"):
            with open(os.path.join(self.out, name), "rb") as file:
                content = file.read()
            self.assertEqual(content[:8], b"\x89PNG\r\n\x1a\n", name)
            self.assertEqual(content[-8:-4], b"IEND", name)
            width, height = (int.from_bytes(content[i:i + 4], "big") for i in (16, 20))
            self.assertGreater(min(width, height), 300, name)


def tearDownModule():
    runs.clean()


if __name__ == "__main__":
    unittest.main()
