#!/usr/bin/env python3
"""Five observers among 5,018 objects, with tasks: who saw what, the same however it is run.

Ten minutes of it, or with --full the day.

Usage, from the repository root:
  /usr/bin/python3 tests/e2e/test_constellation.py BORESIGHT [--full]
"""
import collections
import hashlib
import os
import sys
import unittest

import runs

FULL = "--full" in sys.argv
if FULL:
    sys.argv.remove("--full")
QUICK = "scenarios/constellation_quick.json"
SCENARIO = "scenarios/day_constellation.json" if FULL else QUICK
# the embedded catalogue has enough stars for an attitude in wider fields only
WIDE = [f"/observers/{i}/sensors/0/camera/pixel_scale_arcsec=6" for i in range(5)]
CUSTODY_S = 21600.0
BREAK_S = 60.0


def content(out, but=()):
    """A digest of each table."""
    db = runs.database(out)
    digests = {}
    for (name,) in db.execute("SELECT \"table\" FROM tables ORDER BY 1").fetchall():
        if name not in but:
            digest = hashlib.sha256()
            for row in db.execute(f"SELECT * FROM \"{name}\" ORDER BY rowid"):
                digest.update(repr(tuple(row)).encode())
            digests[name] = digest.hexdigest()
    return digests


class Constellation(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = runs.scratch()
        cls.out = os.path.join(cls.folder, "run")
        cls.manifest = runs.run(SCENARIO, cls.out, *WIDE, threads=2 if FULL else 1)
        cls.db = runs.database(cls.out)
        cls.end_s = cls.db.execute("SELECT max(end_tick) FROM exposures").fetchone()[0] / 6000.0
        print({k: v for k, v in cls.manifest["sightings"].items()}, file=sys.stderr)

    def test_every_sensor_works_and_finds_what_it_is_given(self):
        frames = dict(self.db.execute("SELECT sensor, count(*) FROM exposures GROUP BY sensor"))
        self.assertEqual(len(frames), 5)
        self.assertEqual(len(set(frames.values())), 1)
        s = self.manifest["sightings"]
        self.assertEqual(s["objects"], 5018)
        self.assertGreater(s["tasks"], 40)
        # catalogue and world agree here: what the rule chooses can be found
        self.assertGreater(s["tasks_done"], 0.9 * (s["tasks"] - 5))
        (found,) = self.db.execute(
            "SELECT count(DISTINCT k.object) FROM tasks k JOIN tasks n ON n.sensor = k.sensor"
            " AND n.task_id = k.task_id + 1 WHERE n.before = 'done'").fetchone()
        self.assertGreaterEqual(s["objects_seen"], found)

    def test_tasks_are_consistent(self):
        held = {}
        rows = self.db.execute("SELECT time_s, sensor, task_id, object FROM tasks"
                               " ORDER BY time_s, sensor").fetchall()
        last = collections.defaultdict(int)
        i = 0
        while i < len(rows):
            now = rows[i][0]
            batch = [row for row in rows[i:] if row[0] == now]
            i += len(batch)
            for _, sensor, task, obj in batch:
                self.assertEqual(task, last[sensor] + 1)
                last[sensor] = task
                held[sensor] = obj
            # no two sensors have one target
            objects = [obj for obj in held.values() if obj >= 0]
            self.assertEqual(len(objects), len(set(objects)))

    def test_targets_are_where_they_may_be_looked_at(self):
        """Tracked targets keep clear of Earth, Sun and shadow: from the truth of their passes."""
        rows = self.db.execute(
            "SELECT t.sunlit_fraction, t.occulted, t.snr FROM tasks k JOIN exposures e"
            " ON e.sensor = k.sensor AND e.start_tick BETWEEN k.tick + 60000 AND k.tick + 120000"
            " JOIN truth t ON t.sensor = e.sensor AND t.exposure_id = e.exposure_id"
            " AND t.id = k.object AND t.in_field = 1 AND k.time_s < 400 LIMIT 2000").fetchall()
        self.assertGreater(len(rows), 50)
        for lit, occulted, snr in rows:
            self.assertGreater(lit, 0.4)
            self.assertEqual(occulted, 0)
            self.assertGreater(snr, 4.0)  # near the edge, or while it still slews

    def test_sums_follow_from_the_passes(self):
        passes = collections.defaultdict(list)
        for row in self.db.execute("SELECT object, sensor, frames, detected, first_s, last_s"
                                   " FROM passes"):
            passes[row[0]].append(row[1:])
        sums = self.db.execute(
            "SELECT object, passes, frames, detected, first_s, last_s, custody_fraction FROM"
            " sightings WHERE sensor IS NULL").fetchall()
        self.assertEqual(len(sums), len(passes))
        for obj, count, frames, detected, first, last, custody in sums:
            mine = passes[obj]
            self.assertEqual(count, len(mine))
            self.assertEqual(frames, sum(p[1] for p in mine))
            self.assertEqual(detected, sum(p[2] for p in mine))
            firsts = [p[3] for p in mine if p[3] is not None]
            if firsts:
                self.assertEqual(first, min(firsts))
                self.assertEqual(last, max(p[4] for p in mine if p[4] is not None))
                most = min(CUSTODY_S * count, self.end_s - first) / self.end_s
                self.assertLessEqual(custody, most + 1e-3 + 60.0 / self.end_s)
                self.assertGreater(custody, 0.0)
            else:
                self.assertEqual(custody, 0.0)

    def test_passes_follow_from_the_truth(self):
        """Frames in the field by object and sensor, counted from the table truth."""
        truth = dict()
        for sensor, obj, n in self.db.execute(
                "SELECT sensor, id, count(*) FROM truth WHERE kind = 'object' AND in_field = 1"
                " AND occulted = 0 GROUP BY sensor, id"):
            truth[sensor, obj] = n
        told = {(s, o): n for s, o, n in self.db.execute(
            "SELECT sensor, object, sum(frames) FROM passes GROUP BY sensor, object")}
        self.assertEqual(truth, told)

    def test_accuracy(self):
        s = self.manifest["sightings"]
        # 3 arcsec pixels, point images of SNR 10 to 40
        self.assertLess(s["place_rms_arcsec"], 1.5)
        self.assertLess(s["track_rms_arcsec"], 1.0)

    def test_the_rest_of_the_sky_is_told(self):
        texts = [row[0] for row in self.db.execute(
            "SELECT text FROM events WHERE source = 'tasking' AND kind = 'visible'")]
        self.assertGreaterEqual(len(texts), 1)
        self.assertRegex(texts[0], r"^\d+ of 50\d\d targets can be seen, 0 have been; not: ")

    def test_observations_can_be_exported(self):
        result = runs.subprocess.run(
            [runs.BORESIGHT, "export", self.out, "--observations", "tdm", "--table", "csv",
             "--tables", "sightings,passes,tasks", "--out", os.path.join(self.folder, "files")],
            capture_output=True, text=True)
        self.assertEqual(result.returncode, 0, result.stderr)
        names = os.listdir(os.path.join(self.folder, "files"))
        for name in ("sightings.csv", "passes.csv", "tasks.csv"):
            self.assertIn(name, names)
        angles = 0
        for name in names:
            if name.endswith(".tdm"):
                with open(os.path.join(self.folder, "files", name), encoding="ascii") as f:
                    angles += f.read().count("ANGLE_1 =")
        self.assertGreater(angles, 500)


@unittest.skipIf(FULL, "of the quick version")
class Repeated(unittest.TestCase):
    def test_serial_and_overlapped_runs_are_equal(self):
        folder = runs.scratch()
        a, b = os.path.join(folder, "a"), os.path.join(folder, "b")
        runs.run(QUICK, a, *WIDE, duration=120, threads=2)  # sensors by two threads
        runs.run(QUICK, b, *WIDE, duration=120, serial=True)
        self.assertEqual(content(a), content(b))


def tearDownModule():
    runs.clean()


if __name__ == "__main__":
    unittest.main()
