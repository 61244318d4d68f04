#!/usr/bin/env python3
"""Documents of earlier versions: former names of keys give the same configuration, with warnings.

Usage, from the repository root: /usr/bin/python3 tests/e2e/test_former_names.py BORESIGHT

former_names/ holds scenarios as they were shipped before their keys were renamed; only their paths
to other files have changed.
"""
import glob
import json
import os
import re
import unittest

import jsonschema

import runs

EARLIER = "tests/e2e/former_names"
CAMERA = runs.SENSOR + "/camera"
TRACKER = runs.SENSOR + "/modules/tracker"
WARNING = re.compile(r"boresight: warning: .*: /\S+: former name, now \w+")


def former_rows(node, out):
    """Sets of the keys of each block that the schema marks as deprecated, with their present names."""
    if isinstance(node, list):
        for item in node:
            former_rows(item, out)
    elif isinstance(node, dict):
        for key, child in node.get("properties", {}).items():
            if isinstance(child, dict) and child.get("deprecated"):
                out[key] = child["description"].removeprefix("Former name of ").rstrip(".")
        for child in node.values():
            former_rows(child, out)
    return out


def keys_of(node, out):
    if isinstance(node, list):
        for item in node:
            keys_of(item, out)
    elif isinstance(node, dict):
        for key, child in node.items():
            out |= set(key.split("/")) if key.startswith("/") else {key}
            keys_of(child, out)
    elif isinstance(node, str) and node.startswith("/"):
        out |= set(node.split("/"))
    return out


class FormerNames(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.schema = json.loads(runs.call_well("schema"))
        cls.study_schema = json.loads(runs.call_well("study", "--schema"))

    def check(self, *words, warnings):
        """Standard output of a command that succeeds with so many warnings, all about former names."""
        result = runs.call(*words)
        lines = result.stderr.splitlines()
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertEqual(len(lines), warnings, result.stderr)
        for line in lines:
            self.assertRegex(line, WARNING)
        return result.stdout

    def test_earlier_scenarios_are_the_same(self):
        for name, warnings in (("crowded_geo_track", 1), ("full_plant", 1), ("rendezvous", 4)):
            with self.subTest(name):
                earlier = self.check("check", f"{EARLIER}/{name}.json", warnings=warnings)
                self.assertEqual(json.loads(earlier), json.loads(runs.call_well("check", f"scenarios/{name}.json")))

    def test_earlier_scenarios_fit_the_schema(self):
        for path in glob.glob(EARLIER + "/*.json"):
            with open(path, encoding="utf-8") as file:
                jsonschema.validate(json.load(file), self.schema)

    def test_an_earlier_scenario_runs_equal(self):
        rows = []
        for scenario in (f"{EARLIER}/full_plant.json", "scenarios/full_plant.json"):
            out = os.path.join(runs.scratch(), "run")
            runs.run(scenario, out, runs.NO_FRAMES, duration=3)
            db = runs.database(out)
            rows.append([[tuple(row) for row in db.execute(f"SELECT * FROM {table}")]
                         for table in ("los_commands", "detections", "exposures", "truth", "pointing")])
        self.assertEqual(rows[0], rows[1])
        self.assertGreater(min(len(table) for table in rows[0]), 0)

    def test_overrides(self):
        former = self.check("check", runs.TRACK, "--set", CAMERA + "/detector/hits/rate_per_cm2_s=5", "--set",
                            TRACKER + "/memory_s=60", "--set", CAMERA + '/detector/hits={"frame_s": 0.5, "rate_per_cm2_s": 5}', warnings=4)
        present = runs.call_well("check", runs.TRACK, "--set", CAMERA + "/detector/cosmic_rays/rate_per_cm2_s=5", "--set",
                                 TRACKER + "/max_dormant_s=60", "--set", CAMERA + '/detector/cosmic_rays={"readout_s": 0.5, "rate_per_cm2_s": 5}')
        self.assertEqual(former, present)
        self.assertIn('"max_dormant_s"', former)
        self.assertNotIn('"memory_s"', former)

    def test_both_names_are_an_error(self):
        path = os.path.join(runs.scratch(), "both.json")
        with open(path, "w", encoding="utf-8") as file:
            json.dump({"extends": os.path.abspath(runs.TRACK),
                       "set": {CAMERA + "/detector": {"hits": {}, "cosmic_rays": {}}}}, file)
        result = runs.call("check", path)
        self.assertEqual(result.returncode, 1)
        self.assertIn("/camera/detector/hits: former name of cosmic_rays, which is given too", result.stderr)

    def test_a_slip_of_a_former_name(self):
        result = runs.call("check", runs.TRACK, "--set", TRACKER + "/memory_ss=60")
        self.assertEqual(result.returncode, 1)
        self.assertIn('unknown key; did you mean "max_dormant_s"?', result.stderr)

    def test_studies(self):
        """Keys of a study, pointers into its scenarios, its populations and its own block."""
        present = {"boresight_study": 1, "name": "former", "scenarios": [{"file": os.path.abspath(runs.TRACK)}],
                   "set": {TRACKER + "/max_dormant_s": 50},
                   "sweeps": [{"axes": [{"path": TRACKER + "/merge_distance_px", "values": [2, 3],
                                         "linked_paths": [TRACKER + "/merged_systematic_px"]}]}],
                   "dispersions": [{"path": CAMERA + "/detector/cosmic_rays/readout_s", "from": 0, "to": 1},
                                   {"path": "/populations/0/number/max", "distribution": "table", "values": [5]}],
                   "populations": [{"name": "p", "number": {"distribution": "poisson", "mean": 2, "max": 4},
                                    "object": {"orbit": {"source": "numerical", "state": {"source": "keplerian"}}},
                                    "dispersions": [{"path": "/orbit/state/semi_major_axis_m", "from": 7e6, "to": 8e6}]}]}
        text = json.dumps(present)
        for now, before in (("max_dormant_s", "memory_s"), ("merge_distance_px", "merge_px"),
                            ("linked_paths", "also"), ("merged_systematic_px", "merge_floor_px"),
                            ("cosmic_rays/readout_s", "hits/frame_s"), ("number/max", "number/most"),
                            ('"max"', '"most"'), ('"state": {"source"', '"state": {"from"')):
            self.assertIn(now, text)
            text = text.replace(now, before)
        former = json.loads(text)
        jsonschema.validate(former, self.study_schema)
        folder = runs.scratch()
        paths = [os.path.join(folder, name) for name in ("present.json", "former.json")]
        for path, document in zip(paths, (present, former)):
            with open(path, "w", encoding="utf-8") as file:
                json.dump(document, file)
        emitted = [runs.call("study", path, "--emit", "1") for path in paths]
        self.assertEqual([e.returncode for e in emitted], [0, 0], emitted[1].stderr)
        self.assertEqual(emitted[0].stdout, emitted[1].stdout)
        warnings = [line for line in emitted[1].stderr.splitlines() if "former name" in line]
        self.assertEqual(len(warnings), 9, emitted[1].stderr)
        self.assertNotIn("former name", emitted[0].stderr)

    def test_shipped_documents_have_present_names(self):
        former = former_rows(self.study_schema, former_rows(self.schema, {}))
        self.assertGreater(len(former), 50)
        # these are present names of other blocks
        former = set(former) - {"from", "dropped_fraction"}
        for path in glob.glob("scenarios/**/*.json", recursive=True):
            if not path.endswith("schema.json"):
                with open(path, encoding="utf-8") as file:
                    self.assertEqual(keys_of(json.load(file), set()) & former, set(), path)

    def test_every_former_name_is_documented(self):
        """By the schema, whose names the reference lists, or, of files without one, by hand."""
        listed = former_rows(self.study_schema, former_rows(self.schema, {}))
        with open("docs/reference/file_formats.md", encoding="utf-8") as file:
            listed |= dict(re.findall(r"\| `(\w+)` \| `(\w+)` \|", file.read()))
        for path in glob.glob("*/**/*.[ch]", recursive=True):
            if path.startswith(("build", "tests", "docs")):
                continue
            with open(path, encoding="utf-8") as file:
                for before, now in re.findall(r'BST_FORMER\(\s*"(\w+)",\s*"(\w+)"\)', file.read()):
                    self.assertEqual(listed.get(before), now, path)


def tearDownModule():
    runs.clean()


if __name__ == "__main__":
    unittest.main()
