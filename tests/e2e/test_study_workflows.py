"""The examples of docs/examples/study with the local engines of Snakemake and Dask, which pip
installs: a job is killed midway, and the tables are those of the local pool. Where the two are
missing it says so and ends well."""
import json
import os
import subprocess
import sys
import tempfile
import unittest

import runs

EXAMPLES = os.path.abspath("docs/examples/study")
# a Python with both packages, such as that of a virtual environment
PYTHON = os.environ.get("BORESIGHT_WORKFLOWS_PYTHON", sys.executable)
# kills the process that calls it once, in the midst of part 2
KILLER = """#!/bin/sh
case "$*" in *--shard\\ 2/3*) mkdir "{folder}/killed" 2>/dev/null &&
  {{ "{program}" "$@" & sleep 0.3; kill -9 $! {parent}; wait; exit 137; }};; esac
exec "{program}" "$@"
"""


def has(module):
    return subprocess.run([PYTHON, "-c", f"import {module}"], capture_output=True).returncode == 0


class Workflows(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = runs.scratch()
        cls.study = os.path.join(cls.folder, "study.json")
        with open(cls.study, "w", encoding="utf-8") as file:
            json.dump({"boresight_study": 1, "name": "small", "kind": "loop", "seed": "0x51",
                       "scenarios": [{"file": os.path.abspath("scenarios/day_generator.json")}],
                       "set": {"/duration_s": 120, "/world/star_catalogue": "embedded"},
                       "replicates": 60}, file)
        cls.local = os.path.join(cls.folder, "local")
        runs.call_well("study", cls.study, "--out", cls.local, "--quiet", timeout=600)

    def killing_program(self, parent):
        folder = tempfile.mkdtemp(dir=self.folder)
        path = os.path.join(folder, "boresight")
        with open(path, "w", encoding="utf-8") as file:
            file.write(KILLER.format(folder=folder, program=os.path.abspath(runs.BORESIGHT),
                                     parent=parent))
        os.chmod(path, 0o755)
        return path

    def check_tables(self, out, program):
        self.assertTrue(os.path.isdir(os.path.join(os.path.dirname(program), "killed")))
        for name in ("runs.csv", "settings.csv", "statistics.csv"):
            with open(os.path.join(out, name), "rb") as mine, \
                    open(os.path.join(self.local, name), "rb") as local:
                self.assertEqual(mine.read(), local.read(), name)

    def test_snakemake(self):
        if not has("snakemake"):
            self.skipTest(f"snakemake is not installed for {PYTHON}: BORESIGHT_WORKFLOWS_PYTHON")
        out = os.path.join(self.folder, "snakemake")
        program = self.killing_program("")
        result = subprocess.run(
            [PYTHON, "-m", "snakemake", "--snakefile", EXAMPLES + "/Snakefile", "--cores", "2",
             "--config", f"study={self.study}", f"out={out}", "parts=3", f"boresight={program}"],
            capture_output=True, text=True, timeout=600, cwd=self.folder)
        self.assertEqual(result.returncode, 0, result.stderr)
        self.check_tables(out, program)

    def test_dask(self):
        if not has("dask.distributed"):
            self.skipTest(f"dask.distributed is not installed for {PYTHON}: BORESIGHT_WORKFLOWS_PYTHON")
        out = os.path.join(self.folder, "dask")
        program = self.killing_program("$PPID")  # with the worker of Dask that called it
        result = subprocess.run([PYTHON, EXAMPLES + "/dask_study.py", self.study, out, "3"],
                                capture_output=True, text=True, timeout=600,
                                env={**os.environ, "BORESIGHT": program})
        self.assertEqual(result.returncode, 0, result.stderr)
        self.check_tables(out, program)


if __name__ == "__main__":
    unittest.main()
