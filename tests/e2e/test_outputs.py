#!/usr/bin/env python3
"""Where commands may write: every output option of every command, as --help lists them.

Usage, from the repository root: /usr/bin/python3 tests/e2e/test_outputs.py BORESIGHT
"""
import hashlib
import json
import os
import re
import shutil
import unittest

import runs
from runs import call


class Outputs(unittest.TestCase):
    """No output option of any command writes over what the command reads, over files of a run, or
    to a path that is a slip. The options are taken from --help, so that a new one is tested too."""
    # a command's other words: input first, {} is its path
    WORDS = {"run": ["{scenario}", "--quiet", "--duration", "0"], "view": ["{scenario}", "--no-browser"],
             "report": ["{run}"], "export": ["{run}", "--table", "csv"], "orbit": ["{run}"],
             "loop": ["{scenario}"], "check": ["{scenario}"], "serve": ["{scenario}", "--link", "ipc:///nowhere", "--as", "x"],
             "propagate": ["--elements", "{elements}", "--norad", "44801", "--start",
                           "2022-06-16T22:00:00Z", "--stop", "2022-06-16T22:00:00Z", "--step", "1"],
             "calframes": ["{scenario}", "--bias", "1", "--dark", "0", "--flat", "0"],
             "link-keys": [],
             "calibrate-obsgen": ["{scenario}", "--check", "--seeds", "1"], "bench": ["crc32c", "--curve"],
             "new": ["--observer-tle", "{elements}"],
             "lightcurve": ["{scenario}", "--duration", "0"], "turntable": ["{satellite}"],
             "study": ["{study}"], "process": ["{run}", "--map", "boresight"],
             "twin": ["{run}", "--map", "boresight"],
             "challenge": ["1"],
             "calibrate-camera": ["{run}"],
             "characterize": ["--map", "boresight", "--bias", "{run}/frames.fits"],
             "score": ["{run}", "--truth", "{run}"], "pd": ["{scenario}", "--trials", "1"]}
    # options that name what is read
    INPUTS = {("run", "replay"), ("run", "restore"), ("run", "link-keys"), ("serve", "link-keys"),
              ("schema", "plugin"), ("orbit", "observer"), ("propagate", "elements"), ("propagate", "tle"), ("propagate", "eop"),
              ("calibrate-obsgen", "calibration"), ("bench", "tle"), ("bench", "scenario"),
              ("calibrate-camera", "extends"), ("characterize", "bias"), ("characterize", "dark"), ("characterize", "flat"), ("characterize", "linearity"), ("characterize", "simulated"), ("characterize", "warm"), ("characterize", "extends"),
              ("score", "truth"), ("study", "site"), ("study", "scheduler"), ("lightcurve", "satellite"), ("lightcurve", "elements")}

    @classmethod
    def setUpClass(cls):
        cls.folder = runs.scratch()
        cls.made = os.path.join(cls.folder, "run")
        cls.scenario = os.path.join(cls.folder, "scenario.json")
        cls.elements = os.path.join(cls.folder, "elements.tle")
        shutil.copy("scenarios/catalogue_2022-06.tle", cls.elements)
        cls.satellite = os.path.join(cls.folder, "satellite.json")
        shutil.copy("scenarios/satellites/cubesat_3u.json", cls.satellite)
        with open(cls.scenario, "w", encoding="utf-8") as file:
            json.dump({"extends": os.path.abspath(runs.TRACK),
                       "set": {"/world/objects/0/orbit/elements_file": "elements.tle"}}, file)
        cls.study = os.path.join(cls.folder, "study.json")
        with open(cls.study, "w", encoding="utf-8") as file:
            json.dump({"boresight_study": 1, "name": "s", "kind": "loop", "seed": "0x1",
                       "scenarios": [{"file": "scenario.json"}], "replicates": 1}, file)
        runs.run(cls.scenario, cls.made, duration=1)
        cls.before = cls.content()
        cls.options = []
        listed = call("--help").stdout.split("commands:")[1].split("\n\n")[0]
        for command in re.findall(r"^  ([a-z-]+) ", listed, re.MULTILINE):
            for name, _ in re.findall(r"^  --([a-z-]+) (FILE|FOLDER|RUN|PATH)\b",
                                      call(command, "--help").stdout, re.MULTILINE):
                cls.options.append((command, name))

    @classmethod
    def content(cls):
        found = {}
        for folder, _, names in os.walk(cls.folder):
            for name in names:
                with open(os.path.join(folder, name), "rb") as file:
                    found[os.path.join(folder, name)] = hashlib.sha256(file.read()).hexdigest()
        return found

    def words(self, command):
        return [word.format(run=self.made, scenario=self.scenario, elements=self.elements,
                            study=self.study, satellite=self.satellite) for word in self.WORDS[command]]

    def outputs(self):
        return [(command, name) for command, name in self.options
                if (command, name) not in self.INPUTS]

    def refused(self, command, name, value, *texts):
        result = call(command, *self.words(command), "--" + name, value)
        what = (command, name, value, result.stdout, result.stderr)
        self.assertEqual(result.returncode, 2, what)
        for text in texts:
            self.assertIn(text, result.stderr, what)
        self.assertEqual(self.content(), self.before, what)

    def test_every_option_is_known(self):
        self.assertGreaterEqual(len(self.outputs()), 19)
        self.assertLessEqual(self.INPUTS, set(self.options))
        for command, _ in self.outputs():
            self.assertIn(command, self.WORDS)

    def test_slips(self):
        for command, name in self.outputs():
            self.refused(command, name, os.path.join(self.folder, "no", "x"),
                         f"there is no folder {self.folder}/no; ", "mkdir -p ")
            self.refused(command, name, os.path.join(self.folder, "a\nb"),
                         "the path holds a control character (found 0x0A after ")
            self.refused(command, name, os.path.join(self.elements, "x"), "Not a directory")

    def test_inputs(self):
        links = runs.scratch()
        for command, name in self.outputs():
            read = next(word for word in self.words(command) + [self.scenario]
                        if word.startswith(self.folder))
            if read == self.made:
                read = os.path.join(self.made, "run.sqlite")
            soft, hard = (os.path.join(links, kind + command + name) for kind in ("soft", "hard"))
            os.symlink(read, soft)
            os.link(read, hard)
            for path in (read, soft, hard):
                if command not in ("bench", "challenge", "link-keys"):  # which read none of these
                    self.refused(command, name, path, f"--{name} {path}: ")

    def test_files_that_the_scenario_is_made_of(self):
        for command, name in (("loop", "json"), ("pd", "json")):
            result = call(command, *self.words(command), "--" + name, self.elements)
            self.assertEqual(result.returncode, 1)
            self.assertIn("is the file ", result.stderr)
            self.assertIn("which is read: the scenario names it", result.stderr)
            self.assertEqual(self.content(), self.before)
        base = os.path.join(self.folder, "base.json")
        shutil.copy(self.scenario, base)
        with open(os.path.join(self.folder, "top.json"), "w", encoding="utf-8") as file:
            json.dump({"extends": "base.json"}, file)
        result = call("loop", os.path.join(self.folder, "top.json"), "--json", base)
        os.remove(base)
        os.remove(os.path.join(self.folder, "top.json"))
        self.assertEqual(result.returncode, 1)
        self.assertIn("which is read: the scenario extends it", result.stderr)

    def test_files_of_a_run(self):
        """Also of another run than the one that is read, and where the run has no such file yet."""
        for name in ("frames.fits", "manifest.json", "run.sqlite-wal", "targets.fits",
                     "frames_neossat_telescope.fits"):
            for command, option in (("loop", "json"), ("propagate", "output"), ("report", "out")):
                self.refused(command, option, os.path.join(self.made, name),
                             "is a file of the run in that folder, which is not changed")
        self.refused("orbit", "oem", self.elements, "run/scenario.json names it")

    def test_two_options_of_one_path(self):
        path = os.path.join(self.folder, "both")
        result = call("loop", self.scenario, "--json", path, "--plot", path)
        self.assertEqual(result.returncode, 2)
        self.assertIn("--plot goes there too; give two paths", result.stderr)

    def test_what_is_right_goes_on(self):
        page = os.path.join(self.made, "report.html")
        for words in ((), (), ("--out", self.made), ("--out", page)):
            result = call("report", self.made, *words)
            self.assertEqual((result.returncode, result.stdout), (0, page + "\n"), result.stderr)
        os.remove(page)
        result = call("propagate", *self.words("propagate"), "--output", "/dev/null")
        self.assertEqual((result.returncode, result.stderr), (0, ""))
        result = call("loop", self.scenario, "--json", "-")
        self.assertEqual(json.loads(result.stdout)["scenario"], "neossat_geo_track")

    def test_star_import(self):
        out = os.path.join(self.folder, "no", "x.stars")
        result = call("stars", "import", "none.tar.xz", "--out", out)
        self.assertEqual(result.returncode, 2)
        self.assertIn(f"there is no folder {self.folder}/no; ", result.stderr)


def tearDownModule():
    runs.clean()


if __name__ == "__main__":
    unittest.main()
