"""What image processing says that things are, in a field of 100,000 stars with targets and radiation
hits: the scenario galactic_core with 50 targets at 2 to 15 arcsec/s and 500 hits per frame.

Usage, from the repository root: /usr/bin/python3 tests/e2e/test_discrimination.py BORESIGHT [--full]
Without --full only the 6,000 brightest detections of a frame are looked at, and spikes with one
seed.
"""
import collections
import json
import sys
import unittest

import numpy as np

import runs

FULL = "--full" in sys.argv
if FULL:
    sys.argv.remove("--full")
ROOM = 40000 if FULL else 6000
SIDE = 2048
TARGETS = 50
FRAMES = 5 if FULL else 4
CENTRE = np.radians([270.89, -30.03])
PIXEL = np.radians(3.4 / 3600)
RANGE_KM = 1e6  # far enough to be without parallax


def orbits(random):
    """One OEM of targets that cross the field on straight lines."""
    ra, dec = CENTRE
    centre = np.array([np.cos(dec) * np.cos(ra), np.cos(dec) * np.sin(ra), np.sin(dec)])
    east = np.array([-np.sin(ra), np.cos(ra), 0])
    north = np.cross(centre, east)
    lines = ["CCSDS_OEM_VERS = 2.0", "CREATION_DATE = 2022-01-01T00:00:00", "ORIGINATOR = TEST", ""]
    for k in range(TARGETS):
        x, y = random.uniform(-0.44, 0.44, 2) * SIDE * PIXEL
        rate = np.radians(random.uniform(2, 15) / 3600)
        angle = random.uniform(0, 2 * np.pi)
        way = rate * (np.cos(angle) * east + np.sin(angle) * north)
        lines += ["META_START", f"OBJECT_NAME = T{k:02d}", f"OBJECT_ID = 2099-{k:03d}A",
                  "CENTER_NAME = EARTH", "REF_FRAME = GCRF", "TIME_SYSTEM = UTC",
                  "START_TIME = 2022-06-16T22:08:00", "STOP_TIME = 2022-06-16T22:13:00",
                  "INTERPOLATION = LINEAR", "INTERPOLATION_DEGREE = 1", "META_STOP"]
        for t, minute in ((-120, 8), (180, 13)):
            place = RANGE_KM * (centre + x * east + y * north + way * t)
            lines.append(f"2022-06-16T22:{minute:02d}:00.000 "
                         + " ".join(f"{v:.9f}" for v in (*place, *(RANGE_KM * way))))
        lines.append("")
    return "\n".join(lines)


class Discrimination(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        folder = runs.scratch()
        random = np.random.default_rng(5)
        with open(folder + "/targets.oem", "w", encoding="utf-8") as file:
            file.write(orbits(random))
        objects = [{"name": f"T{k:02d}",
                    "orbit": {"source": "oem", "oem_file": folder + "/targets.oem",
                              "oem_object": f"T{k:02d}"},
                    "brightness": {"model": "standard_magnitude",
                                   "standard_v_mag": random.uniform(10.5, 15.0) - 16.25}}
                   for k in range(TARGETS)]
        camera = runs.SENSOR + "/camera"
        modules = runs.SENSOR + "/modules"
        runs.run("scenarios/galactic_core.json", folder + "/run", runs.NO_FRAMES,
                 "/world/objects=" + json.dumps(objects),
                 camera + "/detector=" + json.dumps({"cosmic_rays": {"rate_per_cm2_s": 35}}),
                 modules + f"/scenegen/truth_capacity={3 * ROOM // 2}",
                 modules + f'/imgproc={{"type": "standard", "capacity": {ROOM}}}',
                 duration=3 * FRAMES + 1)
        cls.db = runs.database(folder + "/run")

    def compare(self, frame):
        """Labels of the detectable stars and targets that were found, and the number of others."""
        threshold, lost = self.db.execute("SELECT threshold_snr, lost FROM detection_frames WHERE"
                                          " exposure_id = ?", (frame,)).fetchone()
        if lost:  # what is sure to be among the brightest
            threshold = 1.2 * self.db.execute(
                "SELECT min(snr) FROM detections WHERE exposure_id = ? AND label = 'star'"
                " AND NOT blend", (frame,)).fetchone()[0]
        cells = collections.defaultdict(list)
        for d in self.db.execute("SELECT x_px, y_px, label FROM detections WHERE exposure_id = ?",
                                 (frame,)):
            cells[int(d["x_px"]) // 4, int(d["y_px"]) // 4].append([d["x_px"], d["y_px"],
                                                                    d["label"]])
        labels = {"star": collections.Counter(), "object": collections.Counter()}
        for t in self.db.execute(
                "SELECT kind, x_chief_px AS x, y_chief_px AS y FROM truth WHERE exposure_id = ? AND"
                " in_field AND snr >= ? AND x_chief_px BETWEEN 3 AND ? AND y_chief_px BETWEEN 3 AND ?"
                " ORDER BY snr DESC", (frame, threshold, SIDE - 4, SIDE - 4)):
            near = [d for i in (-1, 0, 1) for j in (-1, 0, 1)
                    for d in cells[int(t["x"]) // 4 + i, int(t["y"]) // 4 + j]
                    if np.hypot(d[0] - t["x"], d[1] - t["y"]) < 2]
            if near:
                best = min(near, key=lambda d: np.hypot(d[0] - t["x"], d[1] - t["y"]))
                labels[t["kind"]][best[2]] += 1
                cells[int(best[0]) // 4, int(best[1]) // 4].remove(best)
        rest = collections.Counter(d[2] for cell in cells.values() for d in cell)
        return labels["star"], labels["object"], rest

    def test_labels(self):
        """From the third frame on; before, nothing is known of what stays where it is."""
        stars, objects, rest = (collections.Counter() for _ in range(3))
        for frame in range(2, FRAMES):
            for total, found in zip((stars, objects, rest), self.compare(frame)):
                total.update(found)
        hits = self.db.execute("SELECT sum(hits) FROM exposures WHERE exposure_id BETWEEN 2 AND ?",
                               (FRAMES - 1,)).fetchone()[0]
        print(f"stars {dict(stars)}, targets {dict(objects)}, no source {dict(rest)}, hits {hits}")
        self.assertGreater(sum(stars.values()), (FRAMES - 2) * (0.8 * ROOM if FULL else 3000))
        self.assertGreater(sum(objects.values()), (FRAMES - 2) * (35 if FULL else 15))
        self.assertGreaterEqual(stars["star"], 0.99 * sum(stars.values()))
        self.assertGreaterEqual(objects["object"], 0.95 * sum(objects.values()))
        if FULL:  # the others are below the threshold or on stars
            self.assertGreater(rest["hit"], 0.6 * hits)


def distance_to_paths(paths, x, y):
    """Distance in px of (x, y) from each path; columns: start, middle and end, x and y each."""
    place = np.array([x, y])
    nearest = np.full(len(paths), np.inf)
    for begin, end in ((0, 2), (2, 4)):
        start, way = paths[:, begin:begin + 2], paths[:, end:end + 2] - paths[:, begin:begin + 2]
        share = np.sum((place - start) * way, axis=1) / np.maximum(np.sum(way**2, axis=1), 1e-12)
        foot = start + np.clip(share, 0, 1)[:, None] * way
        nearest = np.minimum(nearest, np.hypot(*(foot - place).T))
    return nearest


class BrightStars(unittest.TestCase):
    """Two saturated stars with diffraction spikes among stars that no catalogue has: these are
    found as ever, and the spikes are distinguished from them. In the first frame the camera settles, and
    the stars' paths are 6 px long; in the others they are points."""

    SEEDS = range(1, 9) if FULL else (3,)
    VANES_DEG = 28  # of the first of four

    def count(self, seed):
        """Of one run: frames, detections without a source, those of them that are no artefacts,
        detections of sources far from every spike, those of them that are artefacts."""
        out = f"{runs.scratch()}/spikes{seed}"
        runs.run("scenarios/diffraction.json", out, "/world/faint_stars=statistical",
                 "/world/faint_limit_v_mag=13.5", seed=seed, duration=3, threads=2)
        db = runs.database(out)
        spikes, alarms, real, lost = 0, 0, 0, 0
        angle = np.radians(self.VANES_DEG)
        vanes = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        frames = [row[0] for row in db.execute("SELECT exposure_id FROM detection_frames")]
        for frame in frames:
            truth = np.array(db.execute(
                "SELECT x_start_px, y_start_px, x_mid_px, y_mid_px, x_end_px, y_end_px, v_mag"
                " FROM truth WHERE snr > 2.5 AND exposure_id = ?", (frame,)).fetchall())
            bright = truth[truth[:, 6] < 3]
            self.assertEqual(len(bright), 2)
            for x, y, label in db.execute(
                    "SELECT x_px, y_px, label FROM detections WHERE exposure_id = ? AND edge = 0",
                    (frame,)):
                if distance_to_paths(truth, x, y).min() > 3:
                    spikes += 1
                    alarms += label != "artefact"
                elif np.abs((bright[:, 2:4] - [x, y]) @ vanes).min() > 8:  # px from every spike
                    real += 1
                    lost += label == "artefact"
        print(f"seed {seed}, {len(frames)} frames: without a source {spikes}, of them no artefacts "
              f"{alarms}; sources {real}, artefacts of them {lost}")
        return np.array([len(frames), spikes, alarms, real, lost])

    def test_spikes_are_artefacts(self):
        frames, spikes, alarms, real, lost = sum(self.count(seed) for seed in self.SEEDS)
        self.assertGreater(spikes, 25 * frames)  # pieces of one spike become one source
        # One false alarm of noise a frame is asked for; four deviations of its Poisson distribution.
        self.assertLess(alarms, frames + 4 * np.sqrt(frames))
        self.assertGreater(real, 200 * frames)
        self.assertLess(lost, 0.02 * real)


def tearDownModule():
    runs.clean()


if __name__ == "__main__":
    unittest.main()
