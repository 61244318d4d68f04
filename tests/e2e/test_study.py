"""`boresight study` from outside: runs by hand give the same figures, tables do not depend on who
made them, a study that was cut down anywhere goes on, mistakes are found before anything runs.

Usage, from the repository root: /usr/bin/python3 tests/e2e/test_study.py BORESIGHT [KILLS]
"""
import csv
import glob
import json
import math
import os
import random
import shutil
import signal
import sqlite3
import subprocess
import sys
import time
import unittest

from astropy.io import fits

import runs
import study_figures

KILLS = int(sys.argv.pop(1)) if len(sys.argv) > 1 and sys.argv[1].isdigit() else 2
SENSOR = "/observers/0/sensors/0"
NOISE = SENSOR + "/camera/read_noise_e"
TABLES = ["runs.csv", "settings.csv", "statistics.csv", "sensors.csv", "sensors_statistics.csv"]


def write(folder, **changes):
    """A study of 12 short runs in 2 settings."""
    study = {"boresight_study": 1, "name": "small", "kind": "loop", "seed": "0x51",
             "scenarios": [{"file": os.path.abspath("scenarios/day_generator.json")}],
             "set": {"/duration_s": 60, "/world/star_catalogue": "embedded",
                     "/record/detections_of": "all"},
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
    return runs.call("study", *words, timeout=900, **options)


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


class Whole(study_figures.StudyFigures, unittest.TestCase):
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
        for name in ("frames", "pointing_rms_px", "pointing_median_px", "pointing_p99_px",
                     "pointing_bias_px", "track_fraction", "custody", "breaks", "visible_frames",
                     "wrong_target_frames", "detected_fraction", "track_rms_px", "track_median_px",
                     "track_p95_px", "tracks", "false_tracks", "time_to_confirm_s",
                     "time_to_acquire_s", "time_to_settle_s"):
            reported = float(row[name]) if row[name] else None
            if reported is None:
                self.assertIsNone(summary[name], name)
            else:  # a manifest has 15 digits where they are within an epsilon of the number
                self.assertAlmostEqual(reported, summary[name], delta=3e-16 * abs(reported), msg=name)
        with runs.database(out) as database:
            count, = database.execute("SELECT count(*) FROM detections").fetchone()
        self.assertEqual(int(row["detections"]), count)
        self.check_sightings(row, out)

    def test_several_observers(self):
        """The same of five with tasks, which have a row each in another table."""
        folder = os.path.join(self.folder, "constellation")
        os.mkdir(folder)
        sensors = "/observers/{}/sensors/0/camera/pixel_scale_arcsec"
        path = write(folder, sweeps=None, dispersions=None, replicates=1,
                     scenarios=[{"file": os.path.abspath("scenarios/constellation_quick.json")}],
                     set={"/duration_s": 60, "/world/star_catalogue": "embedded",
                          "/observers/3/sensors/0/exposure/period_s": 1.5,
                          "/epoch_utc": runs.DARK.split("=")[1], **{sensors.format(i): 6 for i in range(5)}})
        result = study(path, "--out", os.path.join(folder, "out"), "--workers", "1")
        self.assertEqual(result.returncode, 0, result.stderr)
        with open(os.path.join(folder, "run.json"), "w", encoding="utf-8") as file:
            file.write(study(path, "--emit", "0").stdout)
        by_hand = os.path.join(folder, "run")
        result = subprocess.run([runs.BORESIGHT, "run", os.path.join(folder, "run.json"), "--quiet",
                                 "--out", by_hand], capture_output=True, text=True, timeout=600)
        self.assertEqual(result.returncode, 0, result.stderr)
        row, = rows(os.path.join(folder, "out"))
        self.assertGreater(float(row["tasks"]), 5)
        self.check_sightings(row, by_hand)
        self.check_sensors(row, rows(os.path.join(folder, "out"), "sensors"), by_hand)

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
            reported = rows(self.out, name)
            self.assertEqual(len(stored), len(reported))
            for a, b in zip(stored, reported):
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
        cls.path = write(cls.folder, replicates=20 if KILLS > 2 else 7)
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

    def test_killed_while_it_writes_tables(self):
        out = os.path.join(self.folder, "tables")
        os.makedirs(out)
        shutil.copy(os.path.join(self.whole, "study.json"), out)
        for name in ("study.sqlite.tmp.123", "runs.csv.tmp.7", "mine.tmp", "tmp.5"):
            with open(os.path.join(out, name), "w", encoding="utf-8") as file:
                file.write("half")
        self.finish(out)
        self.assertEqual(sorted(n for n in os.listdir(out) if "tmp" in n), ["mine.tmp", "tmp.5"])

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
        for size in [0] + [self.random.randrange(512, 20000) for _ in range(KILLS // 2)]:
            subprocess.run(["sh", "-c", f"ulimit -f {size // 512}; exec \"$@\"", "sh",
                            runs.BORESIGHT, "study", self.path, "--out", out, "--resume"],
                           capture_output=True, text=True, timeout=600, check=False)
        self.finish(out)


class Elsewhere(unittest.TestCase):
    def test_scenario_extends_a_file_of_another_folder(self):
        """Paths start from the folder of the file that gives them, for studies as for `check`."""
        folder = runs.scratch()
        os.mkdir(os.path.join(folder, "base"))
        for name in ("day_generator.json", "neossat_geo_track.json"):
            shutil.copy(os.path.join("scenarios", name), os.path.join(folder, "base"))
        with open("scenarios/day_generator.json", encoding="utf-8") as file:
            elements = json.load(file)["world"]["objects"][0]["orbit"]["elements_file"]
        shutil.copy(os.path.join("scenarios", elements), os.path.join(folder, "base"))
        near = os.path.join(folder, "near.json")
        with open(near, "w", encoding="utf-8") as file:
            json.dump({"extends": "base/day_generator.json", "name": "near",
                       "set": {SENSOR + "/modules/obsgen/calibration_file": ""}}, file)
        path = write(folder, scenarios=[{"file": near}], replicates=1)
        checked = subprocess.run([runs.BORESIGHT, "check", near, "--set",
                                  "/world/star_catalogue=embedded"],
                                 capture_output=True, text=True, timeout=60)
        emitted = study(path, "--emit", "0")
        self.assertEqual((checked.returncode, emitted.returncode), (0, 0), emitted.stderr)
        for text in (checked.stdout, emitted.stdout):
            self.assertEqual(json.loads(text)["world"]["objects"][0]["orbit"]["elements_file"],
                             os.path.join(os.path.realpath(folder), "base", elements))
        result = study(path, "--out", os.path.join(folder, "out"))
        self.assertEqual(result.returncode, 0, result.stderr)


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


class Pd(unittest.TestCase):
    """Kind pd: curves are those of boresight pd."""

    def test_curves(self):
        folder = runs.scratch()
        path = write(folder, kind="pd", scenarios=[{"file": os.path.abspath(runs.STARE)}],
                     set={"/world/star_catalogue": "embedded"}, dispersions=None, replicates=2,
                     sweeps=[{"axes": [{"path": "/pd/streak_px", "values": [0, 6]}]}],
                     pd={"snr_first": 4, "snr_last": 6, "snr_step": 1, "trials": 90,
                         "empty_frames": 6, "false_alarms_per_frame": 20})
        out = os.path.join(folder, "out")
        result = study(path, "--out", out)
        self.assertEqual((result.returncode, result.stderr), (0, ""))
        emitted = study(path, "--emit", "3")
        scenario = os.path.join(folder, "run3.json")
        with open(scenario, "w", encoding="utf-8") as file:
            file.write(emitted.stdout)
        words = emitted.stderr.split("boresight ")[1].split()
        self.assertEqual(words[:2], ["pd", "SCENARIO.json"])
        reported = os.path.join(folder, "pd.json")
        result = subprocess.run([runs.BORESIGHT, "pd", scenario, *words[2:], "--json", reported],
                                capture_output=True, text=True, timeout=600)
        self.assertEqual(result.returncode, 0, result.stderr)
        with open(reported, encoding="utf-8") as file:
            reported = json.load(file)
        row = rows(out)[3]
        self.assertEqual(float(row["streak_px"]), 6)
        # the JSON has 15 digits
        for name in ("loss_db_pd50", "false_alarms_per_frame", "threshold_snr"):
            self.assertAlmostEqual(float(row[name] or "nan"), reported[name] or math.nan,
                                   delta=1e-14 * abs(reported[name] or 1), msg=name)
        curve = [r for r in rows(out, "curve") if r["run"] == "3"]
        self.assertEqual([(float(r["snr"]), float(r["trials"]), float(r["detected"]))
                          for r in curve],
                         [(p["snr"], p["trials"], p["detected"]) for p in reported["points"]])
        for r, p in zip(curve, reported["points"]):
            self.assertAlmostEqual(float(r["pd"]), p["pd"], delta=1e-14)
        for pooled in rows(out, "curve_statistics"):
            of = [r for r in rows(out, "curve") if r["snr"] == pooled["snr"] and
                  int(r["run"]) // 2 == int(pooled["setting"])]
            self.assertEqual(float(pooled["trials"]), 180)
            self.assertEqual(float(pooled["detected"]), sum(float(r["detected"]) for r in of))
            self.assertEqual(float(pooled["rate"]), float(pooled["detected"]) / 180)

    def test_settings_are_checked(self):
        folder = runs.scratch()
        for pd, text in (({"snr_frist": 3}, "/pd/snr_frist: unknown key; did you mean"),
                         ({"snr_first": 9, "snr_last": 3}, "/pd: SNR from 9 to 3"),
                         ({"known_rate": True}, "/pd/known_rate: needs a streak_px")):
            path = write(folder, kind="pd", scenarios=[{"file": os.path.abspath(runs.STARE)}],
                         set=None, dispersions=None, pd=pd)
            result = study(path, "--dry-run")
            self.assertEqual(result.returncode, 1)
            self.assertIn(text, result.stderr)


class Cubes(unittest.TestCase):
    """Kind cubes: frames are those of boresight run, labels those of its truth."""

    @classmethod
    def setUpClass(cls):
        cls.folder = runs.scratch()
        cls.path = write(cls.folder, kind="cubes", sweeps=None, replicates=5,
                         scenarios=[{"file": os.path.abspath("scenarios/datacube.json")}],
                         set={"/world/star_catalogue": "embedded", "/duration_s": 4,
                              "/observers/0/sensors/0/camera/width_px": 160,
                              "/observers/0/sensors/0/camera/height_px": 128},
                         dispersions=[{"path": NOISE, "from": 5, "to": 12}],
                         cubes={"train": 60, "validation": 20, "test": 20, "masks": True})
        cls.out = os.path.join(cls.folder, "out")
        cls.result = study(cls.path, "--out", cls.out)

    def read(self, *name):
        with open(os.path.join(self.out, *name), "rb") as file:
            return file.read()

    def test_frames_and_labels_by_hand(self):
        self.assertEqual((self.result.returncode, self.result.stderr), (0, ""))
        scenario = os.path.join(self.folder, "run2.json")
        with open(scenario, "w", encoding="utf-8") as file:
            file.write(study(self.path, "--emit", "2").stdout)
        out = os.path.join(self.folder, "run2")
        result = subprocess.run([runs.BORESIGHT, "run", scenario, "--quiet", "--out", out],
                                capture_output=True, text=True, timeout=600)
        self.assertEqual(result.returncode, 0, result.stderr)
        with open(os.path.join(out, "frames.fits"), "rb") as file:
            self.assertEqual(file.read(), self.read("ImageFiles", "000002.fits"))
        labels = json.loads(self.read("Annotations", "000002.json"))["data"]
        self.check_masks(out, labels)
        self.assertEqual(len(labels["frames"]), int(rows(self.out)[2]["frames"]))
        self.assertGreaterEqual(len(labels["frames"]), 3)
        with runs.database(out) as database:
            for frame in labels["frames"]:
                truth = {(row["kind"], str(row["norad"] or row["id"])): row
                         for row in database.execute(
                             "SELECT * FROM truth WHERE exposure_id = ? AND electrons > 0",
                             (frame["sequence_id"],))}
                seen = 0
                for item in frame["objects"]:
                    kind = "star" if item["class_name"] == "Star" else "object"
                    row = truth[kind, item["object_id"]]
                    seen += kind == "object"
                    # 12 digits of a fraction of the image
                    self.assertAlmostEqual(item["x_mid"] * 160 - 0.5, row["x_mid_px"], delta=1e-8)
                    self.assertAlmostEqual(item["y_end"] * 128 - 0.5, row["y_end_px"], delta=1e-8)
                    self.assertAlmostEqual(item["snr_aperture"], row["snr"],
                                           delta=1e-9 * row["snr"])
                self.assertEqual(seen, 1)

    def check_masks(self, out, labels):
        """Masks are those of the run by hand; where an object's light is, its number is."""
        with fits.open(os.path.join(out, "segmentation.fits")) as theirs, \
                fits.open(os.path.join(self.out, "MaskFiles", "000002.fits")) as ours:
            self.assertEqual(len(ours), len(labels["frames"]) + 1)
            found = 0
            for one, other, frame in zip(ours[1:], theirs[1:], labels["frames"], strict=True):
                self.assertTrue((one.data == other.data).all())
                self.assertEqual(one.header["FRAMEID"], frame["sequence_id"])
                numbers = [item["seg_id"] for item in frame["objects"]]
                self.assertEqual(len(set(numbers)), len(numbers))
                self.assertGreater(min(numbers), 0)
                for item in frame["objects"]:
                    x, y = int(item["x_mid"] * 160), int(item["y_mid"] * 128)
                    if item["snr_aperture"] > 50 and 0 <= x < 160 and 0 <= y < 128:
                        self.assertIn(item["seg_id"], one.data)
                        found += 1
            self.assertGreater(found, 0)
        self.assertEqual(int(rows(self.out)[2]["mask_bytes"]),
                         os.path.getsize(os.path.join(self.out, "MaskFiles", "000002.fits")))

    def test_parts_and_card(self):
        listed, card = [], json.loads(self.read("card.json"))
        for part, name in enumerate(("train", "val", "test")):
            lines = self.read(name + ".txt").decode().split("\n")[:-1]
            listed += lines
            self.assertEqual([int(line[11:17]) for line in lines], [int(r["run"]) for r in rows(self.out) if int(r["part"]) == part])
        self.assertEqual(sorted(listed), [f"ImageFiles/{i:06}.fits Annotations/{i:06}.json" for i in range(5)])
        parts = [int(r["part"]) for r in rows(self.out)]
        self.assertEqual(card["split"], {name: parts.count(k) for k, name in enumerate(("train", "validation", "test"))})
        frames = [frame for i in range(5) for frame in json.loads(self.read("Annotations", f"{i:06}.json"))["data"]["frames"]]
        classes = [item["class_name"] for frame in frames for item in frame["objects"]]
        self.assertEqual(card["counts"], {
            "sequences": 5, "failed": 0, "frames": len(frames), "satellite_labels": classes.count("Satellite"),
            "star_labels": classes.count("Star"), "bytes": sum(len(self.read("ImageFiles", f"{i:06}.fits")) for i in range(5))})
        noise, varied = [float(r["read_noise_e"]) for r in rows(self.out)], card["varied"][0]
        self.assertEqual((varied["least"], varied["greatest"]), (min(noise), max(noise)))
        self.assertAlmostEqual(varied["mean"], sum(noise) / 5, delta=1e-12)

    def test_what_is_gone_is_made_again(self):
        before = self.read("ImageFiles", "000003.fits"), self.read("runs.csv")
        os.truncate(os.path.join(self.out, "ImageFiles", "000003.fits"), 2880)
        os.remove(os.path.join(self.out, "Annotations", "000000.json"))
        result = study(self.out, "--resume")
        self.assertEqual(result.returncode, 0)
        self.assertIn("files of 2 runs are gone", result.stderr)
        self.assertEqual((self.read("ImageFiles", "000003.fits"), self.read("runs.csv")), before)
        self.assertTrue(os.path.exists(os.path.join(self.out, "Annotations", "000000.json")))


class Devices(unittest.TestCase):
    """Workers with a device each. Two of PoCL's CPU devices stand for two GPUs."""

    def small(self, folder):
        return write(folder, kind="cubes", sweeps=[], dispersions=[], replicates=4, keep="run",
                     scenarios=[{"file": os.path.abspath("scenarios/datacube.json")}],
                     set={"/duration_s": 1, "/world/star_catalogue": "embedded"})

    def test_unknown_device(self):
        """It is the workers' trouble, not the runs'."""
        folder = runs.scratch()
        result = study(self.small(folder), "--out", folder + "/out", "--device", "nonesuch",
                       "--workers", "1")
        self.assertEqual(result.returncode, 1, result.stderr)
        self.assertIn('--device: no OpenCL device matches "nonesuch"; there is: 0:0 ',
                      result.stdout)
        self.assertIn("4 runs are missing", result.stdout)

    @unittest.skipUnless(KILLS > 2, "slow: builds kernels for a second device")
    def test_each_worker_has_its_own(self):
        folder = runs.scratch()
        path = self.small(folder)
        environment = {**os.environ, "POCL_DEVICES": "pthread basic"}
        for name, words in (("one", ("--device", "pthread", "--workers", "1")),
                            ("two", ("--device", "0:0,0:1", "--shard-runs", "1"))):
            result = study(path, "--out", f"{folder}/{name}", *words, env=environment)
            self.assertEqual(result.returncode, 0, result.stderr)
        cards = [sorted(glob.glob(f"{folder}/{name}/ImageFiles/*.fits")) for name in ("one", "two")]
        self.assertEqual([len(c) for c in cards], [4, 4])
        # both of PoCL's are the same processor: no bit differs
        for one, two in zip(*cards):
            with open(one, "rb") as a, open(two, "rb") as b:
                self.assertEqual(a.read(), b.read())

    def test_cores(self):
        """A worker with one core has one thread of PoCL, and stays on it."""
        folder = runs.scratch()
        path = write(folder, replicates=40 if KILLS > 2 else 12)
        job = subprocess.Popen([runs.BORESIGHT, "study", path, "--out", folder + "/out", "--quiet",
                                "--workers", "1", "--cores", "1"], stdout=subprocess.DEVNULL)
        seen = set()
        while job.poll() is None:
            for worker in children(job.pid):
                try:
                    seen.add(len(os.sched_getaffinity(worker)))
                except ProcessLookupError:
                    pass
            time.sleep(0.01)
        self.assertEqual(job.returncode, 0)
        self.assertIn(1, seen)


def children(pid):
    try:
        with open(f"/proc/{pid}/task/{pid}/children", encoding="ascii") as file:
            return [int(word) for word in file.read().split()]
    except OSError:
        return []


def tearDownModule():
    runs.clean()


if __name__ == "__main__":
    unittest.main()
