"""The main job on sensors that bloom, smear and have hot pixels that image processing has no map of.

A target that blooms is found, placed as its covariance says and labelled an object; the smear of a
frame transfer and unmapped hot pixels start at most one false track; the bad pixels are learned; and
the tracked target is the right one.

Usage, from the repository root:
  /usr/bin/python3 tests/e2e/test_detector_effects.py BORESIGHT [SEEDS]
SEEDS: so many seeds and the full duration, instead of one short run of each effect.
"""
import math
import sys
import unittest

import runs

SEEDS = int(sys.argv.pop()) if len(sys.argv) > 1 and sys.argv[-1].isdigit() else 0
DURATION = 150 if SEEDS else 45
SIDE = 1024 if SEEDS else 512  # px
SMALL = [f"{runs.SENSOR}/camera/{side}_px={SIDE}" for side in ("width", "height")]
DETECTOR = runs.SENSOR + "/camera/detector"
# of no account; the kernels of test_calframes.py, compiled once
PATTERNS = [] if SEEDS else [f"{DETECTOR}/{key}" for key in (
    "prnu_rms=1e-6", "column_offset_rms_e=1e-6", "cosmic_rays/rate_per_cm2_s=1e-9")]
# a smaller cue error: the search is not what is tested
CUE = [] if SEEDS else [runs.SENSOR + "/cue/offset_deg=0.1", runs.SENSOR + "/cue/sigma_deg=0.1"]


def bright(v_mag):
    """The target made so bright; it has V 12.5 with 4 m^2."""
    area = 4 * 10 ** (0.4 * (12.5 - v_mag))
    return [f"/world/objects/0/area_m2={area}", runs.SENSOR + f"/cue/v_mag={v_mag}"]


def false_tracks(db):
    """Confirmed tracks whose places are not those of an object, for most of their frames."""
    place = {row["exposure_id"]: (row["x"], row["y"]) for row in db.execute(
        "SELECT exposure_id, x_centroid_px AS x, y_centroid_px AS y FROM truth WHERE kind = 'object'")}
    frames, right = {}, {}
    for row in db.execute("SELECT exposure_id, track_id, x_px, y_px FROM tracks WHERE status = "
                          "'confirmed'"):
        track = row["track_id"]
        frames[track] = frames.get(track, 0) + 1
        at = place.get(row["exposure_id"])
        near = at and math.hypot(at[0] - row["x_px"], at[1] - row["y_px"]) < 4
        right[track] = right.get(track, 0) + bool(near)
    return [t for t in frames if right[t] < 0.5 * frames[t]]


def target_errors(db, first):
    """Of frames from exposure `first` on with the target well in the field: the detection nearest
    to it, and its error over its standard deviation, both axes."""
    found = db.execute(
        "SELECT t.exposure_id AS e, t.x_centroid_px AS x, t.y_centroid_px AS y, d.* FROM truth t JOIN "
        "detections d ON d.exposure_id = t.exposure_id AND abs(d.x_px - t.x_centroid_px) < 2 AND "
        "abs(d.y_px - t.y_centroid_px) < 2 WHERE t.kind = 'object' AND t.in_field AND t.exposure_id >= ?"
        " ORDER BY e, d.snr DESC", (first,)).fetchall()
    best = {}
    for row in found:
        best.setdefault(row["e"], row)
    errors = [(row["x_px"] - row["x"]) ** 2 / row["cov_xx_px2"] +
              (row["y_px"] - row["y"]) ** 2 / row["cov_yy_px2"] for row in best.values()]
    return list(best.values()), sum(errors) / (2 * max(len(errors), 1))


class Effects(unittest.TestCase):
    def seeds(self):
        return range(1, SEEDS + 1) if SEEDS else [1]

    def expose(self, name, *sets, duration=DURATION, most_false=1):
        """Runs of all seeds, one after the other: (manifest, tables) of each."""
        jobs = [(seed, f"{runs.scratch()}/{name}-{seed}") for seed in self.seeds()]
        runs.parallel(lambda job: runs.run(runs.TRACK, job[1], runs.NO_FRAMES, *SMALL, *CUE, *sets,
                                           seed=job[0], duration=duration), jobs)
        out = [(runs.manifest(folder), runs.database(folder)) for _, folder in jobs]
        for manifest, db in out:
            with self.subTest(name=name, seed=manifest["seed"]):
                summary = manifest["summary"]
                self.assertEqual(summary["final_mode"], "track")
                self.assertEqual(summary["wrong_target_frames"], 0)
                self.assertGreater(summary["track_fraction"], 0.95)
                self.assertLessEqual(len(false_tracks(db)), most_false)
        return out

    def test_hot_pixels(self):
        """The share that is hot has a log-normal dark current about 1000 e-/s;
        98 % of them are brighter than the 80 e- that a single frame shows."""
        for share in (0.001, 0.01) if SEEDS else (0.01,):
            for manifest, db in self.expose(f"hot{share}", *PATTERNS, DETECTOR + f"/hot_fraction={share}"):
                last = db.execute("SELECT bad_pixels AS n FROM detection_frames ORDER BY "
                                  "exposure_id DESC LIMIT 1").fetchone()["n"]
                self.assertGreater(last, 0.9 * share * SIDE * SIDE)
                self.assertLess(last, 1.05 * share * SIDE * SIDE)
                self.assertEqual(manifest["summary"]["bad_pixels"], last)

    def test_hot_pixels_at_five_frames_a_second(self):
        """0.1 s of the same dark current: four in five are brighter than what a frame shows."""
        for manifest, _ in self.expose(
                "fast", *PATTERNS, DETECTOR + "/hot_fraction=0.01", runs.SENSOR + "/exposure/period_s=0.2",
                runs.SENSOR + "/exposure/exposure_s=0.1",
                runs.SENSOR + "/modules/control/exposure_s=0.1",
                duration=60 if SEEDS else 20, most_false=0):
            self.assertGreater(manifest["summary"]["bad_pixels"], 0.75 * 0.01 * SIDE * SIDE)

    @unittest.skipUnless(SEEDS, "slow")
    def test_hot_pixels_under_a_narrow_psf(self):
        """A FWHM of 1.2 px: the shape of a maximum says little."""
        for manifest, _ in self.expose("narrow", DETECTOR + "/hot_fraction=0.01",
                                       runs.SENSOR + "/camera/psf_fwhm_px=1.2",
                                       duration=100, most_false=0):
            self.assertGreater(manifest["summary"]["bad_pixels"], 0.95 * 0.01 * SIDE * SIDE)

    def test_frame_transfer(self):
        for time_s in (0.05, 0.3, 1.0) if SEEDS else (0.3,):
            self.expose(f"transfer{time_s}", DETECTOR + f"/frame_transfer_s={time_s}")

    def test_blooming(self):
        for v_mag in (7, 5, 2.5, 0) if SEEDS else (5,):
            for _, db in self.expose(f"bloom{v_mag}", DETECTOR + '/saturation="bloom"',
                                     *bright(v_mag)):
                found, error2 = target_errors(db, DURATION - 30)
                self.assertGreater(len(found), 25)
                self.assertEqual({row["label"] for row in found}, {"object"})
                if v_mag < 6:
                    self.assertEqual({row["bloom"] for row in found}, {1})
                # 60 squares of unit mean and more where the covariance is a bound
                self.assertLess(error2, 2)

    def test_serial_is_the_same(self):
        """What is learned in one frame is used three frames later, whether or not frames overlap."""
        tables = []
        for serial in (False, True):
            out = f"{runs.scratch()}/run"
            runs.run(runs.RATE_OPEN, out, runs.NO_FRAMES, *PATTERNS, DETECTOR + "/hot_fraction=0.003", seed=3,
                     duration=4, serial=serial)
            tables.append([tuple(row) for row in runs.database(out).execute(
                "SELECT exposure_id, x_px, y_px, snr, label FROM detections "
                "ORDER BY exposure_id, item")])
        self.assertGreater(len(tables[0]), 400)
        self.assertEqual(tables[0], tables[1])


def tearDownModule():
    runs.clean()


if __name__ == "__main__":
    unittest.main()
