"""`boresight study` from outside: runs by hand give the same figures, tables do not depend on who
made them, a study that was cut down anywhere goes on, mistakes are found before anything runs.

Usage, from the repository root: /usr/bin/python3 tests/e2e/test_study.py BORESIGHT [KILLS]
"""
import csv
import json
import math
import os
import random
import signal
import sqlite3
import subprocess
import sys
import time
import unittest

try:
    import jsonschema
except ImportError:
    jsonschema = None

import runs

KILLS = int(sys.argv.pop(1)) if len(sys.argv) > 1 and sys.argv[1].isdigit() else 2
NOISE = "/observers/0/sensors/0/camera/read_noise_e"
TABLES = ["runs.csv", "settings.csv", "statistics.csv", "sensors.csv", "sensors_statistics.csv"]


def write(folder, **changes):
    """A study of 12 short runs in 2 settings."""
    study = {"boresight_study": 1, "name": "small", "kind": "loop", "seed": "0x51",
             "scenarios": [{"file": os.path.abspath("scenarios/day_generator.json")}],
             "set": {"/duration_s": 60, "/world/star_catalogue": "embedded",
                     "/record/detection_stars": True},
             "sweeps": [{"axes": [{"path": NOISE, "values": [5, 15]}]}],
             "dispersions": [{"path": "/observers/0/sensors/0/camera/dark_current_e_per_s",
                              "from": 0.1, "to": 0.3}],
             "replicates": 6}
    study.update(changes)
    path = os.path.join(folder, "study.json")
    with open(path, "w", encoding="utf-8") as file:
        json.dump({k: v for k, v in study.items() if v is not None}, file)
    return path


def study(*words, **options):
    return subprocess.run([runs.BORESIGHT, "study", *words], capture_output=True, text=True,
                          timeout=900, **options)


def tables(out):
    """The bytes of all tables but speed."""
    result = {}
    for name in TABLES:
        with open(os.path.join(out, name), "rb") as file:
            result[name] = file.read()
    return result


def rows(out, name="runs"):
    with open(os.path.join(out, name + ".csv"), newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


class Whole(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = runs.scratch()
        cls.path = write(cls.folder)
        cls.out = os.path.join(cls.folder, "out")
        cls.result = study(cls.path, "--out", cls.out, "--workers", "2")

    def test_ends_well(self):
        self.assertEqual((self.result.returncode, self.result.stderr), (0, ""))
        self.assertIn("12 of 12 runs in 2 settings", self.result.stdout)
        again = study(self.out, "--resume")
        self.assertEqual(again.returncode, 0, again.stderr)

    def test_one_worker_makes_the_same_tables(self):
        out = os.path.join(self.folder, "one")
        result = study(self.path, "--out", out, "--workers", "1", "--shard-runs", "5")
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertEqual(tables(out), tables(self.out))

    def test_shards_by_hand_make_the_same_tables(self):
        out = os.path.join(self.folder, "by_hand")
        for i in (2, 1, 3):
            result = study(self.path, "--out", out, "--shard", f"{i}/3")
            self.assertEqual(result.returncode, 0, result.stderr)
        result = study(out, "--resume")
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertEqual(tables(out), tables(self.out))

    def test_run_by_hand(self):
        """A run that is written out and run gives the figures of its row, to the last digit."""
        emitted = study(self.path, "--emit", "8")
        self.assertEqual(emitted.returncode, 0, emitted.stderr)
        self.assertIn("boresight run", emitted.stderr)
        scenario = os.path.join(self.folder, "run8.json")
        with open(scenario, "w", encoding="utf-8") as file:
            file.write(emitted.stdout)
        row = rows(self.out)[8]
        values = json.loads(emitted.stdout)
        camera = values["observers"][0]["sensors"][0]["camera"]
        self.assertEqual(camera["read_noise_e"], float(row["read_noise_e"]))
        self.assertEqual(camera["dark_current_e_per_s"], float(row["dark_current_e_per_s"]))
        self.assertEqual((values["seed"], values["run"]), ("0x51", 8))
        out = os.path.join(self.folder, "run8")
        result = subprocess.run([runs.BORESIGHT, "run", scenario, "--quiet", "--out", out],
                                capture_output=True, text=True, timeout=600)
        self.assertEqual(result.returncode, 0, result.stderr)
        summary = runs.manifest(out)["summary"]
        for name in ("frames", "pointing_rms_px", "pointing_p99_px", "pointing_bias_px",
                     "track_fraction", "time_to_confirm_s", "time_to_settle_s"):
            told = float(row[name]) if row[name] else None
            self.assertEqual(told, summary[name], name)
        with runs.database(out) as database:
            count, = database.execute("SELECT count(*) FROM detections").fetchone()
        self.assertEqual(int(row["detections"]), count)

    def test_tables_agree(self):
        """Statistics are those of the rows; the database holds what the CSV files do."""
        noise = [float(r["read_noise_e"]) for r in rows(self.out)]
        self.assertEqual(noise, [5.0] * 6 + [15.0] * 6)
        dark = [float(r["dark_current_e_per_s"]) for r in rows(self.out)]
        self.assertEqual(len(set(dark)), 12)
        self.assertTrue(all(0.1 <= d <= 0.3 for d in dark))
        for stat in rows(self.out, "statistics"):
            of = [r for r in rows(self.out) if stat["setting"] in ("", r["setting"])]
            values = sorted(float(r[stat["metric"]]) for r in of if r[stat["metric"]])
            self.assertEqual((len(values), len(of) - len(values)),
                             (int(stat["runs"]), int(stat["missing"])))
            if not values:
                continue
            mean = math.fsum(values) / len(values)
            self.assertAlmostEqual(float(stat["mean"]), mean, delta=1e-12 * max(1, abs(mean)))
            self.assertEqual(float(stat["maximum"]), values[-1])
            if stat["method"] == "wilson":
                z2, n = 1.959963984540054**2, len(values)
                middle = (mean + z2 / (2 * n)) / (1 + z2 / n)
                self.assertAlmostEqual((float(stat["low"]) + float(stat["high"])) / 2, middle,
                                       delta=1e-12)
        connection = sqlite3.connect(os.path.join(self.out, "study.sqlite"))
        connection.row_factory = sqlite3.Row
        for name in ("runs", "settings", "statistics", "speed"):
            stored = [dict(r) for r in connection.execute(f"SELECT * FROM {name}")]
            told = rows(self.out, name)
            self.assertEqual(len(stored), len(told))
            for a, b in zip(stored, told):
                self.assertEqual({k: "" if v is None else str(v) for k, v in a.items()
                                  if not isinstance(v, float)},
                                 {k: v for k, v in b.items() if not isinstance(a[k], float)})
                for k, v in a.items():
                    if isinstance(v, float):
                        self.assertEqual(v, float(b[k]))
        units = dict(connection.execute("SELECT name, unit FROM columns WHERE tab = 'runs'"))
        self.assertEqual(units["pointing_rms_px"], "px")
        connection.close()

    def test_folder_is_not_overrun(self):
        result = study(self.path, "--out", self.out)
        self.assertEqual(result.returncode, 1)
        self.assertIn("holds this study already; go on with --resume", result.stderr)
        other = write(os.path.join(runs.scratch()), replicates=7)
        result = study(other, "--out", self.out, "--resume")
        self.assertEqual(result.returncode, 1)
        self.assertIn("holds another study", result.stderr)
        result = study(other, "--out", os.path.join(self.folder, "out", "shards"))
        self.assertEqual(result.returncode, 1)
        self.assertIn("is in the way and holds no study", result.stderr)


class CutDown(unittest.TestCase):
    """Killed in random places and begun again, a study ends with the tables of one that was not."""

    @classmethod
    def setUpClass(cls):
        cls.folder = runs.scratch()
        cls.path = write(cls.folder, replicates=20)
        cls.whole = os.path.join(cls.folder, "whole")
        started = time.monotonic()
        result = study(cls.path, "--out", cls.whole)
        cls.seconds = time.monotonic() - started
        if result.returncode != 0:
            raise AssertionError(result.stderr)
        cls.random = random.Random(7)

    def start(self, out):
        words = [runs.BORESIGHT, "study", self.path, "--out", out]
        if os.path.exists(out):
            words.append("--resume")
        return subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)

    def finish(self, out):
        for _ in range(20):  # an orphan may hold what it is writing for a moment
            result = study(self.path, "--out", out, *(["--resume"] if os.path.exists(out) else []))
            if result.returncode == 0:
                break
            time.sleep(0.5)
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertEqual(tables(out), tables(self.whole))
        self.assertNotIn("differ", result.stdout)
        self.assertFalse([n for n in os.listdir(out) if ".tmp." in n])
        self.assertFalse([n for n in os.listdir(os.path.join(out, "shards")) if ".tmp." in n])

    def test_driver_is_killed(self):
        out = os.path.join(self.folder, "killed")
        for _ in range(KILLS):
            process = self.start(out)
            time.sleep(self.random.uniform(0.02, 0.6 * self.seconds))
            process.kill()
            process.communicate()
        self.finish(out)

    def test_workers_are_killed(self):
        out = os.path.join(self.folder, "workers")
        process = self.start(out)
        for _ in range(KILLS):
            time.sleep(self.random.uniform(0.05, 0.6 * self.seconds / KILLS))
            listed = subprocess.run(["ps", "-o", "pid=", "--ppid", str(process.pid)],
                                    capture_output=True, text=True, check=False).stdout.split()
            if listed:
                try:
                    os.kill(int(self.random.choice(listed)), signal.SIGKILL)
                except ProcessLookupError:
                    pass
        process.communicate()
        self.finish(out)

    def test_interrupted(self):
        out = os.path.join(self.folder, "interrupted")
        process = self.start(out)
        time.sleep(0.5 * self.seconds)
        process.send_signal(signal.SIGINT)
        said, errors = process.communicate(timeout=60)
        self.assertEqual(errors, "")
        if process.returncode == 130:
            self.assertIn("--resume", said)
        else:
            self.assertEqual(process.returncode, 0)  # it was done already
        self.finish(out)

    def test_disk_is_full(self):
        """A limit on the size of files stands for the disk: results that do not fit are made again
        when there is room."""
        out = os.path.join(self.folder, "full")
        for size in (0, self.random.randrange(1, 3000)):
            subprocess.run(["sh", "-c", f"ulimit -f {size // 512}; exec \"$@\"", "sh",
                            runs.BORESIGHT, "study", self.path, "--out", out, "--resume"],
                           capture_output=True, text=True, timeout=600, check=False)
        self.finish(out)


class Mistakes(unittest.TestCase):
    def refused(self, *texts, **changes):
        folder = runs.scratch()
        path = write(folder, **changes)
        out = os.path.join(folder, "out")
        for words in ((), ("--dry-run",)):
            result = study(path, "--out", out, *words)
            self.assertEqual(result.returncode, 1, result.stdout)
            for text in texts:
                self.assertIn(text, result.stderr)
            self.assertFalse(os.path.exists(out))

    def test_path(self):
        self.refused("/sweeps/0/axes/0: value 5 of read_ose_e",
                     "day_generator.json: /observers/0/sensors/0/camera/read_ose_e: unknown key; "
                     "did you mean \"read_noise_e\"?",
                     sweeps=[{"axes": [{"path": NOISE[:-7] + "ose_e", "values": [5]}]}])
        self.refused("/sweeps/0/axes/0: there is no element \"7\"",
                     sweeps=[{"axes": [{"path": "/observers/7/name", "values": ["x"]}]}])

    def test_value_at_the_end_of_a_range(self):
        self.refused("/sweeps/0/axes/0: value 1e+30 of read_noise_e", "out of range",
                     sweeps=[{"axes": [{"path": NOISE, "from": 5, "to": 1e30, "count": 3}]}])
        self.refused("/dispersions/0: value -1 of dark_current_e_per_s", "out of range",
                     dispersions=[{"path": NOISE[:-12] + "dark_current_e_per_s",
                                   "distribution": "normal", "mean": 1, "sigma": 0.5}])

    def test_type(self):
        self.refused("/sweeps/0/axes/0: value \"much\" of read_noise_e", "wrong type",
                     sweeps=[{"axes": [{"path": NOISE, "values": [5, "much"]}]}])

    def test_names(self):
        self.refused("/metrics/0: kind loop has no metric \"pointing_rms\"; did you mean "
                     "\"pointing_rms_px\"?", metrics=["pointing_rms"])
        self.refused("/scenarios/0/file", "none.json", scenarios=[{"file": "none.json"}])

    def test_world(self):
        self.refused("no such object", set={"/observers/0/sensors/0/cue/object": "no such object"})


class Schema(unittest.TestCase):
    def test_shipped_schema_is_current(self):
        result = study("--schema")
        with open("scenarios/study.schema.json", encoding="utf-8") as file:
            self.assertEqual(file.read(), result.stdout, "to make it current: build/boresight "
                             "study --schema > scenarios/study.schema.json")

    @unittest.skipIf(jsonschema is None, "needs python3-jsonschema")
    def test_studies_fit_the_schema(self):
        with open("scenarios/study.schema.json", encoding="utf-8") as file:
            schema = json.load(file)
        folder = runs.scratch()
        for path in [write(folder)]:
            with open(path, encoding="utf-8") as file:
                jsonschema.validate(json.load(file), schema)


def tearDownModule():
    runs.clean()


if __name__ == "__main__":
    unittest.main()
