#!/usr/bin/env python3
"""Every key of a scenario or a study that the docs name exists.

Usage, from the repository root: /usr/bin/python3 tests/e2e/test_docs_keys.py BORESIGHT
"""
import glob
import json
import os
import re
import subprocess
import unittest

import runs

# words with a unit that name no key of a scenario: columns, members of structs, columns of files that users write
FILES = ("c", "h", "cl", "py", "md", "json", "sqlite", "fits", "csv", "mp4", "oem", "txt", "packets")
UNITS = "_(s|px|deg|m|km|hz|e|mag|arcsec|mps|rad|radps|um|nm|k|kg|nm|pct|db|per_s)"


def properties(node, parents, out):
    """out: name -> names of the blocks that have it as a key; lists and choices are looked through."""
    if isinstance(node, list):
        for one in node:
            properties(one, parents, out)
    elif isinstance(node, dict):
        for name, child in node.get("properties", {}).items():
            out.setdefault(name, set()).update(parents)
            properties(child, {name}, out)
        for word in ("items", "oneOf", "anyOf", "allOf", "then", "else", "additionalProperties"):
            properties(node.get(word), parents, out)


def schema(*words):
    shown = subprocess.run([runs.BORESIGHT, *words], capture_output=True, text=True, check=True).stdout
    out = {}
    properties(json.loads(shown), {""}, out)
    return out


class Docs(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.keys = schema("schema")
        with open("scenarios/study.schema.json", encoding="utf-8") as file:
            properties(json.load(file), {""}, cls.keys)
        folder = "python/boresight"
        cls.package = {name.split(".")[0] for name in os.listdir(folder)} | {"config", "messages"}
        with open(folder + "/__init__.py", encoding="utf-8") as file:
            cls.package |= set(re.findall(r"import \w+ as (\w+)", file.read()))

    def words(self):
        for path in sorted(glob.glob("docs/**/*.md", recursive=True)) + ["README.md"]:
            with open(path, encoding="utf-8") as file:
                for number, line in enumerate(file, 1):
                    for word in re.findall(r"`([^`]+)`", line):
                        yield f"{path}:{number}", word

    def test_dotted_keys_exist(self):
        """`exposure.window`: where the first part is a block, the rest are keys in it, one in the other."""
        wrong = []
        for place, word in self.words():
            if not re.fullmatch(r"[a-z][a-z0-9_]*(\.[a-z][a-z0-9_]*)+", word):
                continue
            parts = word.split(".")
            if parts[0] == "boresight" and parts[-1] not in FILES:  # a name in the Python package
                if parts[1] not in self.package:
                    wrong.append(f"{place}: {word}: not in python/boresight")
                continue
            if parts[0] not in self.keys or parts[-1] in FILES or "icd.md" in place:
                continue
            for parent, name in zip(parts, parts[1:]):
                if parent not in self.keys.get(name, ()):
                    wrong.append(f"{place}: {word}: no key {name} in {parent}")
        self.assertEqual(wrong, [])

    def test_words_with_units_exist(self):
        """A word that ends in a unit is a key, or what the program calls something: a column, a field, an option."""
        known = set(self.keys) | {"phot_g_mean_mag"}  # a column of Gaia's
        out = os.path.join(runs.scratch(), "run")
        runs.run(runs.TRACK, out, runs.NO_FRAMES, duration=1)
        known |= {row[0] for row in runs.database(out).execute('SELECT "column" FROM columns')}
        for folder in ("sim", "scenegen", "gimbal", "imgproc", "tracker", "control", "obsgen", "docs/examples", "python"):
            for path in glob.glob(folder + "/**/*.*", recursive=True):
                if os.path.splitext(path)[1] in (".c", ".h", ".inc", ".cl", ".cpp", ".py"):
                    with open(path, encoding="utf-8") as file:
                        known |= set(re.findall("[a-z][a-z0-9_]*", file.read()))
        wrong = [f"{place}: {word}" for place, word in self.words()
                 if re.fullmatch("[a-z][a-z0-9_]*" + UNITS, word) and word not in known]
        self.assertEqual(wrong, [])


def tearDownModule():
    runs.clean()


if __name__ == "__main__":
    unittest.main()
