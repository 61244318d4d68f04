#!/usr/bin/env python3
"""The main job: NEOSSat finds INMARSAT GX5 from a wrong cue and follows it.

The figures of the manifest are computed again here from the tables of the run, which hold the true
attitude, the target's true place and the tracks; the stellar aberration between place and attitude
is ERFA's.

Usage, from the repository root: /usr/bin/python3 tests/e2e/test_main_job.py BORESIGHT
"""
import os
import unittest

import erfa
import numpy as np

import runs

# the definitions of sim/eval: a track is the target's within 5 px, the loop has settled in track
# mode within 3 px
RIGHT_TARGET_PX, SETTLED_PX, PIXEL_ARCSEC = 5.0, 3.0, 3.0


def unit(ra_deg, dec_deg):
    ra, dec = np.radians(ra_deg), np.radians(dec_deg)
    return np.array([np.cos(dec) * np.cos(ra), np.cos(dec) * np.sin(ra), np.sin(dec)])


def track_direction(row, time_s):
    """Place of a row of `tracks` at another time, by its rates."""
    d = unit(row["ra_deg"], row["dec_deg"])
    east = np.array([-np.sin(np.radians(row["ra_deg"])), np.cos(np.radians(row["ra_deg"])), 0])
    north = np.cross(d, east)
    arcsec = np.radians(1 / 3600)
    d = d + (time_s - row["time_s"]) * arcsec * (row["rate_east_arcsec_per_s"] * east +
                                                 row["rate_north_arcsec_per_s"] * north)
    return d / np.linalg.norm(d)


def arcseconds(a, b):
    return np.degrees(np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b)) * 3600


def camera_pixels(exposure, ra_deg, dec_deg):
    """Where a direction (ICRS, geometric) falls, from the boresight, by the true attitude."""
    light = 299792458.0
    velocity = np.array([exposure[f"velocity_bary_{k}_mps"] for k in "xyz"]) / light
    sun = np.linalg.norm([exposure[f"sun_{k}_m"] for k in "xyz"]) / 149597870700.0
    apparent = erfa.ab(unit(ra_deg, dec_deg), velocity, sun, np.sqrt(1 - velocity @ velocity))
    q = np.array([exposure[f"q_cam_from_gcrf_mid_{k}"] for k in "xyzw"])
    v, w = q[:3], q[3]
    x, y, z = apparent + 2 * np.cross(v, np.cross(v, apparent) + w * apparent)
    scale = np.radians(PIXEL_ARCSEC / 3600)
    return np.array([x / z, y / z]) / scale


def judge(out):
    """The summary of a run with a visible target, from its tables alone."""
    db = runs.database(out)
    rate = db.execute("SELECT tick_rate_hz FROM run").fetchone()[0]
    target = {row["exposure_id"]: row for row in
              db.execute("SELECT * FROM truth WHERE kind = 'object' AND norad = 44801")}
    exposures = db.execute("SELECT * FROM exposures ORDER BY exposure_id").fetchall()
    tracked = {row["exposure_id"]: row for row in db.execute(
        "SELECT t.*, f.written_tick FROM tracks t JOIN track_frames f USING (sensor, exposure_id)"
        " WHERE target_of_interest AND status IN ('confirmed', 'coasting')")}
    modes = db.execute("SELECT time_s, mode FROM control ORDER BY tick").fetchall()
    confirmed = settled = None
    visible = in_track = wrong = 0
    errors = []
    for exposure in exposures:
        number, mid = exposure["exposure_id"], exposure["mid_s"]
        truth, track = target.get(number), tracked.get(number)
        on_target = False
        if track and truth:
            off = arcseconds(track_direction(track, mid), unit(truth["ra_deg"], truth["dec_deg"]))
            on_target = off <= RIGHT_TARGET_PX * PIXEL_ARCSEC
        wrong += bool(track) and not on_target
        if confirmed is not None and mid >= confirmed:
            visible += 1
            in_track += on_target
        if on_target and confirmed is None:
            confirmed = track["written_tick"] / rate
        if truth:
            error = np.linalg.norm(camera_pixels(exposure, truth["ra_deg"], truth["dec_deg"]))
            mode = [m["mode"] for m in modes if m["time_s"] <= exposure["end_tick"] / rate][-1]
            if (settled is None and confirmed is not None and mode == "track" and
                    error < SETTLED_PX):
                settled = exposure["start_tick"] / rate
            if settled is not None:
                errors.append(error)
    errors = np.array(errors)
    return {"frames": len(exposures), "time_to_confirm_s": confirmed, "time_to_settle_s": settled,
            "track_fraction": in_track / visible, "wrong_target_frames": wrong,
            "pointing_rms_px": np.sqrt(np.mean(errors ** 2)),
            "pointing_p99_px": np.quantile(errors, 0.99)}


class MainJob(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.out = os.path.join(runs.scratch(), "track")
        cls.manifest = runs.run(runs.TRACK, cls.out, runs.NO_FRAMES, threads=os.cpu_count())
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
        mine = judge(self.out)
        print("recomputed:", mine)
        for key in ("frames", "wrong_target_frames"):
            self.assertEqual(mine[key], self.summary[key])
        # ticks over rate on both sides
        for key in ("time_to_confirm_s", "time_to_settle_s", "track_fraction"):
            self.assertAlmostEqual(mine[key], self.summary[key], delta=1e-9)
        # the same formulae in another order: rounding
        self.assertAlmostEqual(mine["pointing_rms_px"], self.summary["pointing_rms_px"], delta=1e-6)
        # the manifest's percentile comes from bins of 1 %; that of 279 values lies between the
        # third and fourth largest, whose distance is a few per cent
        self.assertAlmostEqual(mine["pointing_p99_px"] / self.summary["pointing_p99_px"], 1,
                               delta=0.1)

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
