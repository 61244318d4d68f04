#!/usr/bin/env python3
"""The studies that ship, and the schema of studies.

Usage, from the repository root: /usr/bin/python3 tests/e2e/test_study_files.py BORESIGHT [--full]
"""
import glob
import json
import os
import sys
import unittest

try:
    import jsonschema
except ImportError:
    jsonschema = None

import runs
from test_study import study, write


FULL = "--full" in sys.argv and not sys.argv.remove("--full")
# whose every setting is quickly looked at
QUICK = ("day_in_the_life", "sensitivity", "sensitivity_morris")


class Ready(unittest.TestCase):
    def test_ready_studies_are_right(self):
        """All settings of the quick ones, the first run of the others (--full: all settings of all)."""
        for path in sorted(glob.glob("scenarios/studies/*.json")):
            whole = FULL or os.path.basename(path)[:-5] in QUICK
            result = study(path, *(["--dry-run"] if whole else ["--emit", "0"]))
            if not whole:
                self.assertEqual(result.returncode, 0, result.stderr)
                self.assertIn("modules", json.loads(result.stdout)["observers"][0]["sensors"][0], path)
                continue
            # where there is no full catalogue, the warning of that is right
            said = [line for line in result.stderr.splitlines() if "star catalogue" not in line]
            self.assertEqual((result.returncode, said), (0, []), path)


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
        jsonschema.Draft202012Validator.check_schema(schema)  # once: it takes most of the time
        validator = jsonschema.Draft202012Validator(schema)
        folder = runs.scratch()
        for path in [write(folder), *glob.glob("scenarios/studies/*.json")]:
            with open(path, encoding="utf-8") as file:
                validator.validate(json.load(file))


def tearDownModule():
    runs.clean()


if __name__ == "__main__":
    unittest.main()
