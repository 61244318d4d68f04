#!/usr/bin/env python3
"""`boresight study` with random objects: runs by hand, resumption and shards give the same, and the
objects are in the truth of the runs.

Usage, from the repository root: /usr/bin/python3 tests/e2e/test_study_populations.py BORESIGHT
"""
import json
import os
import sqlite3
import subprocess
import unittest

import runs
from test_study import rows, study, tables, write

TARGET = "INMARSAT GX5"
POPULATIONS = [
    {"name": "neighbours", "number": {"distribution": "poisson", "mean": 2, "max": 6},
     "object": {"orbit": {"source": "relative", "reference": TARGET, "offset_rtn_m": [0, 0, 0]},
                "brightness": {"model": "standard_magnitude"}},
     "dispersions": [{"path": "/orbit/offset_rtn_m/1", "distribution": "normal", "sigma": 20e3},
                     {"path": "/orbit/offset_rtn_m/2", "from": -40e3, "to": 40e3},
                     {"path": "/brightness/standard_v_mag", "from": 2, "to": 5}]},
    {"name": "others", "number": {"distribution": "uniform", "from": 0, "to": 2},
     "elements_file": os.path.abspath("scenarios/objects_2022-06.tle"),
     "object": {"area_m2": 10}},
    {"name": "orbits", "object": {"orbit": {
        "source": "numerical", "state": {"source": "keplerian", "semi_major_axis_m": 42.164e6},
        "forces": {"gravity": "two_body", "sun": False, "moon": False, "solar_pressure": False,
                   "drag": False}}},
     "dispersions": [{"path": "/orbit/state/mean_anomaly_deg", "from": 0, "to": 360},
                     {"path": "/orbit/state/inclination_deg", "from": 0, "to": 10}]}]


class Custody(unittest.TestCase):
    """Figures of the catalogue's custody: those of the run itself, kept or not."""
    def test_figures(self):
        settings = {"/duration_s": 20, "/world/star_catalogue": "embedded", "/record/custody": True,
                    "/observers/0/sensors/0/observation_source": "generator",
                    "/observers/0/sensors/0/cue/offset_deg": 0}
        figures = []
        for keep in ("summary", "tables"):
            folder = runs.scratch()
            path = write(folder, set=settings, sweeps=None, dispersions=None, replicates=1, keep=keep)
            out = os.path.join(folder, "out")
            result = study(path, "--out", out)
            self.assertEqual((result.returncode, result.stderr), (0, ""))
            figures.append({k: v for k, v in rows(out)[0].items() if k.startswith("catalogue_")})
        self.assertEqual(figures[0], figures[1])
        manifests = [os.path.join(p, "manifest.json") for p, _, names in os.walk(out)
                     if "manifest.json" in names and "run.sqlite" in names]
        with open(manifests[0], encoding="utf-8") as file:
            own = json.load(file)["custody"]
        names = {"updated": "updated", "in_custody": "in_custody", "correlated": "tracks", "ambiguous": "ambiguous",
                 "cross_tags": "cross_tags", "age_mean_s": "age_mean_s", "sigma_median_m": "sigma_median_m",
                 "sigma_updated_median_m": "sigma_updated_median_m", "nees_mean": "nees"}
        for key, name in names.items():
            self.assertEqual(float(figures[0]["catalogue_" + name]), own[key], name)
        self.assertEqual(len(figures[0]), len(names))
        self.assertGreaterEqual(own["updated"], 1)


class Random(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = runs.scratch()
        cls.path = write(cls.folder, populations=POPULATIONS, dispersions=None, keep="tables",
                         set={"/duration_s": 20, "/world/star_catalogue": "embedded",
                              "/observers/0/sensors/0/cue/offset_deg": 0},
                         replicates=4)
        cls.out = os.path.join(cls.folder, "out")
        cls.result = study(cls.path, "--out", cls.out, "--workers", "2")

    def emitted(self, run):
        result = study(self.path, "--emit", str(run))
        self.assertEqual(result.returncode, 0, result.stderr)
        return json.loads(result.stdout)

    def test_ends_well(self):
        self.assertEqual((self.result.returncode, self.result.stderr), (0, ""))
        self.assertIn("8 of 8 runs in 2 settings", self.result.stdout)

    def test_numbers_are_in_the_tables(self):
        with sqlite3.connect(os.path.join(self.out, "study.sqlite")) as database:
            axes = database.execute("SELECT name, role FROM axes ORDER BY axis").fetchall()
        self.assertEqual(axes, [("read_noise_e", "sweep")] +
                         [(p["name"], "population") for p in POPULATIONS])
        counts = set()
        for run, row in enumerate(rows(self.out)):
            names = [o["name"] for o in self.emitted(run)["world"]["objects"]]
            for population in POPULATIONS:
                own = [n for n in names if n.startswith(population["name"] + "_")]
                self.assertEqual(own, [f"{population['name']}_{k + 1}"
                                       for k in range(int(row[population["name"]]))])
            counts.add((row["neighbours"], row["others"]))
            self.assertEqual(row["orbits"], "1")
        self.assertGreater(len(counts), 3)

    def test_objects_are_in_the_truth(self):
        """The neighbours are in the field, 0.85 degrees wide; satellites are of the file."""
        with open(POPULATIONS[1]["elements_file"], encoding="ascii") as file:
            known = {int(line[2:7]) for line in file if line.startswith("2 ") and line[2] < "A"}
        seen = 0
        for run in range(8):
            objects = self.emitted(run)["world"]["objects"]
            with runs.database(os.path.join(self.out, "runs", f"{run:06d}")) as database:
                there = {name for name, in database.execute("SELECT name FROM objects")}
            neighbours = {o["name"] for o in objects if o["name"].startswith("neighbours_")}
            self.assertLessEqual(neighbours | {TARGET}, there)
            seen += len(neighbours)
            norads = [o["orbit"]["norad"] for o in objects if o["name"].startswith("others_")]
            self.assertLessEqual(set(norads), known)
            self.assertEqual(len(set(norads)), len(norads))
        self.assertGreater(seen, 4)

    def test_run_by_hand(self):
        scenario, out = os.path.join(self.folder, "run3.json"), os.path.join(self.folder, "run3")
        with open(scenario, "w", encoding="utf-8") as file:
            json.dump(self.emitted(3), file)
        result = subprocess.run([runs.BORESIGHT, "run", scenario, "--quiet", "--out", out],
                                capture_output=True, text=True, timeout=600)
        self.assertEqual(result.returncode, 0, result.stderr)
        with runs.database(out) as by_hand, \
                runs.database(os.path.join(self.out, "runs", "000003")) as own:
            query = "SELECT * FROM truth"
            reported = own.execute(query).fetchall()
            self.assertEqual(by_hand.execute(query).fetchall(), reported)
        self.assertGreater(len(reported), 0)

    def test_shards_and_resumption_make_the_same_tables(self):
        out = os.path.join(self.folder, "by_hand")
        for i in (2, 1):
            result = study(self.path, "--out", out, "--shard", f"{i}/3")
            self.assertEqual(result.returncode, 0, result.stderr)
        result = study(out, "--resume", "--workers", "1")
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertEqual(tables(out), tables(self.out))

    def test_report_names_them(self):
        result = subprocess.run([runs.BORESIGHT, "report", self.out], capture_output=True, text=True,
                                timeout=300)
        self.assertEqual(result.returncode, 0, result.stderr)
        with open(os.path.join(self.out, "report.html"), encoding="utf-8") as file:
            page = file.read()
        self.assertIn("<td>neighbours</td><td>population</td>", page)

    def test_mistakes_are_found_before_anything_runs(self):
        bright = json.loads(json.dumps(POPULATIONS))
        bright[0]["dispersions"][2]["to"] = 99
        lost = json.loads(json.dumps(POPULATIONS))
        lost[0]["object"]["orbit"]["reference"] = "INMARSAT GX6"
        out = os.path.join(self.folder, "never")
        for populations, text in (
                (bright, "/populations/0/dispersions/2: value 99 of /brightness/standard_v_mag: "),
                (lost, 'no object "INMARSAT GX6" before this one')):
            path = write(runs.scratch(), populations=populations)
            result = study(path, "--out", out)
            self.assertEqual(result.returncode, 1)
            self.assertIn(text, result.stderr)
            self.assertFalse(os.path.exists(out))


def tearDownModule():
    runs.clean()


if __name__ == "__main__":
    unittest.main()
