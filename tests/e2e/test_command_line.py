#!/usr/bin/env python3
"""The program at the command line: exit codes, messages, help, the resolved scenario, the schema.

Usage, from the repository root: /usr/bin/python3 tests/e2e/test_command_line.py BORESIGHT
"""
import glob
import json
import os
import re
import sqlite3
import subprocess
import unittest

import erfa

import runs
from runs import call

try:
    import jsonschema
except ImportError:
    jsonschema = None

SCENARIOS = sorted(set(glob.glob("scenarios/**/*.json", recursive=True)) -
                   set(glob.glob("scenarios/updates/*.json")) - set(glob.glob("scenarios/studies/*.json")) -
                   set(glob.glob("scenarios/satellites/*.json")) - set(glob.glob("scenarios/maps/*.json")) -
                   {"scenarios/boresight.schema.json", "scenarios/study.schema.json"})
GIMBAL = runs.SENSOR + "/modules/gimbal"
NO_IMAGES = ("--set", runs.GENERATOR)
# run with their images by other tests, or with the camera of such a scenario
RUN_ELSEWHERE = re.compile(r"scenarios/(knowledge/.*|leo_leo_.*|galactic_core|crowded_geo_track|link_realtime|"
                           r"neossat_geo_(track|stare|rate_open))\.json")


class Messages(unittest.TestCase):
    """What is wrong is said with file, place, value and what is allowed; nothing is written."""

    def setUp(self):
        self.folder = runs.scratch()
        self.out = os.path.join(self.folder, "run")

    def fails(self, code, pattern, *words):
        result = call(*words)
        self.assertEqual(result.returncode, code, result.stderr)
        self.assertRegex(result.stderr, pattern)
        self.assertEqual(result.stdout, "")
        self.assertEqual(os.listdir(self.folder), [])

    def bad_set(self, assignment, pattern):
        self.fails(1, re.escape(runs.TRACK) + pattern, "run", runs.TRACK, "--out", self.out, "--set",
                   assignment)

    def test_usage(self):
        self.fails(2, r"usage: boresight \[--plugin FILE\]\.\.\. \[--no-plugins\] COMMAND")
        self.fails(2, "--plugin takes the path of a shared library, and a command", "--plugin", "a")
        self.fails(2, 'no command "rum"', "rum")
        self.fails(2, "one scenario file is expected, 0 were given", "run")
        self.fails(2, "one scenario file is expected, 2 were given", "check", "a", "b")
        self.fails(2, r"unknown option --sed; did you mean --seed\?|--set\?", "run", runs.TRACK,
                   "--sed", "3")
        self.fails(2, "--threads 0: give an integer from 1", "run", runs.TRACK, "--threads", "0")
        self.fails(2, "--duration long: give a number", "run", runs.TRACK, "--duration", "long")
        self.fails(2, "--out needs a value", "run", runs.TRACK, "--out")
        self.fails(2, "no argument is expected", "icd", "x")
        self.fails(2, "one scenario file at most is expected, 2 were", "schema", "x", "y")
        self.fails(2, "--start is missing", "propagate")

    def test_distortion_beyond_the_wcs(self):
        # a barrel of 900 (12.1 arcmin * sqrt 2)^2 = 10 % in the corners: 0.05 px (conventions.md)
        out = runs.scratch() + "/run"
        result = call(*runs.command(runs.TRACK, out, runs.SENSOR + '/camera/distortion={"k1": -900}',
                                    duration=1)[1:])
        self.assertEqual(result.returncode, 0, result.stderr)
        found = re.findall(r"^boresight: warning: neossat/telescope: the WCS of its frames misfits the "
                           r"camera's distortion by up to ([0-9.e-]+) px: ", result.stderr, re.M)
        self.assertEqual(len(found), 1, result.stderr)
        manifest = runs.manifest(out)
        misfit = manifest["wcs_misfit_px"]["neossat/telescope"]
        self.assertAlmostEqual(float(found[0]), misfit, delta=0.0005)  # two digits
        self.assertTrue(0.02 < misfit < 0.1, misfit)  # the order of the documented figure
        self.assertEqual(manifest["warnings"], 1)

    def test_bad_values(self):
        self.bad_set("/world/object=3", ': /world/object: unknown key; did you mean "objects"')
        self.bad_set("/duration_s=-1", r": /duration_s: out of range \(found -1; allowed: .*from 0")
        self.bad_set("/duration_s=long", r": /duration_s: wrong type \(found \"?long")
        self.bad_set("/seed=-5", ": /seed: .*hexadecimal")
        self.bad_set("/epoch_utc=yesterday", ": /epoch_utc")
        self.bad_set(GIMBAL + "/type=three_axis", f": {GIMBAL}/type: there is no gimbal of type "
                     '"three_axis" .*"second_order"')
        self.bad_set(GIMBAL + "/rate_hz=999", f": {GIMBAL}/rate_hz: .*857.142857 and 1000 Hz")
        self.bad_set(GIMBAL + "/platform/history_s=0.4", ": neossat/telescope/gimbal: platform/"
                     r"history_s: 0\.4 s do not cover the longest exposure_s of this sensor, 0\.5 s "
                     r"\(its exposure's, or what control commands; .*\); make history_s at least as "
                     "long")
        self.bad_set(GIMBAL.replace("gimbal", "control") + "/exposure_s=4.5",
                     r": neossat/telescope/gimbal: platform/history_s: 4 s do not cover the longest "
                     r"exposure_s of this sensor, 4\.5 s \(")
        self.bad_set("/record={\"frames\": \"cube\", \"compression\": \"rice\"}",
                     ': /record/compression: "rice" compresses frames in extensions only; ')
        self.bad_set(GIMBAL + "/platform/jitter_high_band_hz=[5]", r": .*/platform/jitter_high_band_hz: wrong type \(found \[5\]; "
                     "allowed: an array of 2 numbers")
        self.bad_set("/world/objects/0/orbit/norad=1", ": /world/objects/0/orbit/elements_file: .*no element set of satellite 1, ")
        self.bad_set("/world/objects/0/orbit/elements_file=none.tle",
                     ": /world/objects/0/orbit/elements_file: .*none.tle: cannot be opened")
        self.bad_set(runs.SENSOR + "/modules/imgproc={\"type\": \"standard\", \"delay_s\": "
                     "{\"frames\": 1}}", ": .*/imgproc/delay_s/frames: not an input .*allowed: frame")

    def test_override_that_is_none(self):
        for command in (("run", runs.TRACK, "--out", self.out), ("check", runs.TRACK)):
            self.fails(2, "--set duration_s=3: expected /json/path=value", *command, "--set",
                       "duration_s=3")
            self.fails(2, "--set /duration_s: expected /json/path=value", *command, "--set",
                       "/duration_s")
        self.fails(1, 'there is no element "3"', "run", runs.TRACK, "--out", self.out, "--set",
                   "/observers/3/name=x")

    def test_missing_module(self):
        scenario = json.loads(call("check", runs.TRACK).stdout)
        del scenario["observers"][0]["sensors"][0]["modules"]["gimbal"]
        self.bad_scenario(json.dumps(scenario), "which no module writes; add the module that makes it: gimbal")

    def bad_scenario(self, text, pattern):
        path = os.path.join(runs.scratch(), "bad.json")
        with open(path, "w", encoding="utf-8") as file:
            file.write(text)
        self.fails(1, re.escape(path) + f".*(?:{pattern})", "run", path, "--out", self.out)

    def test_bad_files(self):
        self.fails(1, "none.json: cannot be opened: No such file", "run", "none.json", "--out",
                   self.out)
        with open(runs.TRACK, encoding="utf-8") as file:
            text = file.read()
        self.bad_scenario(text[:-200], ":")
        self.bad_scenario(text + "{}", "after")
        self.bad_scenario(text.replace('"duration_s": 300', '"duration_s": 300, "duration_s": 30'),
                          "duration_s.*twice|duplicate")
        self.bad_scenario(text.replace('"duration_s": 300', '"duration_s": 1e400'), ":7:19: the number is too large")
        self.bad_scenario(text.replace('"duration_s": 300,', ""), "duration_s")

    def test_unknown_device(self):
        self.fails(1, 'no OpenCL device matches "abacus"; there is: ', "run", runs.TRACK, "--out",
                   self.out, "--device", "abacus")


class Folders(unittest.TestCase):
    quick = ("--quiet", "--no-pictures", "--duration", "1", *NO_IMAGES, "--set", runs.NO_FRAMES, "--set",
             "/world/star_catalogue=embedded")

    def run_to(self, out, *words):
        return call("run", runs.TRACK, "--out", out, *self.quick, *words)

    def test_existing_folder(self):
        out = os.path.join(runs.scratch(), "run")
        self.assertEqual(self.run_to(out).returncode, 0)
        self.assertEqual(sorted(os.listdir(out)), ["manifest.json", "run.sqlite", "scenario.json", "wall_clock.csv"])
        first = os.stat(os.path.join(out, "manifest.json")).st_ino
        result = self.run_to(out)
        self.assertEqual(result.returncode, 1)
        self.assertIn(f"{out}: exists already", result.stderr)
        self.assertEqual(os.stat(os.path.join(out, "manifest.json")).st_ino, first)
        self.assertEqual(self.run_to(out, "--overwrite").returncode, 0)
        self.assertEqual(os.listdir(os.path.dirname(out)), ["run"])

    def test_overwrite_keeps_what_no_run_wrote(self):
        out = os.path.join(runs.scratch(), "run")
        self.assertEqual(self.run_to(out, "--seed", "0x1").returncode, 0)
        mine = {"notes.txt": "n", "frames_stacked.fits": "f", "work/a/b.txt": "b", "run.sqlite.bak": "s",
                ".hidden": "h"}

        def put(folder):
            for name, text in mine.items():
                path = os.path.join(folder, name)
                os.makedirs(os.path.dirname(path), exist_ok=True)
                with open(path, "w", encoding="ascii") as file:
                    file.write(text)

        def expect_mine():
            for name, text in mine.items():
                with open(os.path.join(out, name), encoding="ascii") as file:
                    self.assertEqual(file.read(), text)
            self.assertEqual(os.listdir(os.path.dirname(out)), ["run"])

        put(out)
        os.symlink("/nowhere", os.path.join(out, "link"))
        for name in ("report.html", "frames_a_b.fits", "targets.fits"):  # of the former run
            with open(os.path.join(out, name), "w", encoding="ascii"):
                pass
        result = self.run_to(out, "--overwrite", "--seed", "0x2")
        self.assertEqual((result.returncode, result.stderr), (0, ""))
        expect_mine()
        self.assertEqual(os.readlink(os.path.join(out, "link")), "/nowhere")
        self.assertEqual(runs.manifest(out)["seed"], "0x2")
        self.assertFalse({"report.html", "frames_a_b.fits", "targets.fits"} & set(os.listdir(out)))
        # the same of what a killed run left
        os.rename(out, out + ".partial")
        result = self.run_to(out)
        self.assertEqual(result.returncode, 0, result.stderr)
        expect_mine()

    def test_names_stay_in_their_folder(self):
        """What a scenario or a study is called becomes a folder below runs/ and studies/."""
        folder = runs.scratch()
        for name in ("../../x", "a/b", "..", ".x", "a\nb"):
            for words in (("check",), ("run", "--quiet", "--duration", "0")):
                result = call(words[0], os.path.abspath(runs.TRACK), *words[1:], "--set",
                              "/name=" + json.dumps(name), cwd=folder)
                self.assertEqual(result.returncode, 1)
                self.assertIn("/name: ", result.stderr)
                self.assertIn("cannot be the name of a folder", result.stderr)
            self.assertEqual(os.listdir(folder), [])
            path = os.path.join(folder, "study.json")
            with open(path, "w", encoding="utf-8") as file:
                json.dump({"boresight_study": 1, "name": name, "kind": "loop", "seed": "0x1",
                           "scenarios": [{"file": os.path.abspath(runs.TRACK)}], "replicates": 1},
                          file)
            result = call("study", path, cwd=folder)
            self.assertEqual(result.returncode, 1)
            self.assertIn("cannot be the name of a folder", result.stderr)
            os.remove(path)

    def test_what_is_no_run_is_not_overwritten(self):
        folder = runs.scratch()
        with open(os.path.join(folder, "thesis.tex"), "w", encoding="ascii") as file:
            file.write("x")
        result = self.run_to(folder, "--overwrite")
        self.assertEqual(result.returncode, 1)
        self.assertIn("not overwritten", result.stderr)
        self.assertEqual(os.listdir(folder), ["thesis.tex"])

    def test_folder_that_cannot_be_made(self):
        folder = runs.scratch()
        with open(os.path.join(folder, "file"), "w", encoding="ascii"):
            pass
        result = self.run_to(os.path.join(folder, "file", "run"))
        self.assertEqual(result.returncode, 2)
        self.assertRegex(result.stderr, f"{folder}/file.*Not a directory")

    def test_read_only_folder(self):
        folder, home = runs.scratch(), runs.scratch()
        os.chmod(folder, 0o555)
        options = {}
        if os.geteuid() == 0:  # root may write everywhere: run as another user
            os.chown(home, 65534, 65534)
            options = {"user": 65534, "group": 65534, "env": {**os.environ, "HOME": home}}
            try:
                with open(runs.TRACK, "rb"):
                    call("--version", **options)
            except PermissionError:
                self.skipTest("the program is out of reach for the user nobody")
        result = call("run", runs.TRACK, "--out", os.path.join(folder, "run"), *self.quick,
                      **options)
        self.assertEqual(result.returncode, 2)
        self.assertRegex(result.stderr, f"{folder}/run.*Permission denied")


class Help(unittest.TestCase):
    def test_help(self):
        result = call("--help")
        self.assertEqual((result.returncode, result.stderr), (0, ""))
        commands = re.findall(r"^  ([a-z]+) {2,}\S", result.stdout, re.MULTILINE)
        self.assertLessEqual({"run", "check", "schema", "stars", "propagate"}, set(commands))
        for command in commands:
            result = call(command, "--help")
            self.assertEqual((result.returncode, result.stderr), (0, ""), command)
            # what it does, and an example
            self.assertIn(f"boresight {command}", result.stdout)
            self.assertGreater(len(result.stdout.splitlines()), 4, command)

    def test_help_of_a_command(self):
        for command in ("run", "stars", "calibrate-obsgen"):
            self.assertEqual(call("help", command).stdout, call(command, "--help").stdout)
            self.assertEqual(call("help", command).returncode, 0)
        self.assertEqual(call("help").stdout, call("--help").stdout)
        self.assertEqual(call("help", "help").stdout, call("--help").stdout)
        result = call("help", "rnu")
        self.assertEqual((result.returncode, result.stdout), (2, ""))
        self.assertIn('there is no command "rnu"; did you mean "run"?', result.stderr)
        self.assertEqual(call("help", "run", "check").returncode, 2)

    def test_suggestions(self):
        for words, text in ((("chekc",), 'did you mean "check"?'), (("exprot", "x"), '"export"?'),
                            (("calibrate-obsgn",), '"calibrate-obsgen"?'),
                            (("--plugni", "x"), "did you mean --plugin?"),
                            (("--no-plugin", "run"), "did you mean --"),
                            (("run", "x.json", "--overwrit"), "did you mean --overwrite?")):
            result = call(*words)
            self.assertEqual((result.returncode, result.stdout), (2, ""), words)
            self.assertIn(text, result.stderr)
        self.assertNotIn("did you mean", call("xyzzy").stderr)

    def test_seed(self):
        """Decimal and hexadecimal, on the command line and in a scenario."""
        seed = lambda *words: json.loads(call("check", runs.TRACK, *NO_IMAGES, *words).stdout)["seed"]
        self.assertEqual(seed("--seed", "12"), "0xC")
        self.assertEqual(seed("--seed", "0x12"), "0x12")
        self.assertEqual(seed("--set", "/seed=12"), "0xC")
        self.assertEqual(seed("--seed", "18446744073709551615"), "0xFFFFFFFFFFFFFFFF")
        for bad in ("1F", "-1", "1.5", "18446744073709551616", "twelve"):
            result = call("check", runs.TRACK, *NO_IMAGES, "--seed", bad)
            self.assertEqual((result.returncode, result.stdout), (1, ""))
            self.assertRegex(result.stderr, "/seed: (not a seed|not an integer|out of range)")

    def test_no_plugins(self):
        """A scenario that names a shared library is refused before anything of it is loaded."""
        imgproc = "--set", runs.SENSOR + '/modules/imgproc={"plugin": "/nowhere/x.so"}'
        for command in ("check", "loop", "run"):
            out = os.path.join(runs.scratch(), "run")
            words = ("--out", out) if command == "run" else ()
            result = call("--no-plugins", command, runs.TRACK, *imgproc, *words)
            self.assertEqual((result.returncode, result.stdout), (1, ""))
            self.assertIn("plug-ins are not loaded here, as --no-plugins asks", result.stderr)
        self.assertNotIn("--no-plugins asks", call("check", runs.TRACK, *imgproc).stderr)
        self.assertEqual(call("--no-plugins", "check", runs.TRACK, "--quiet").returncode, 0)
        self.assertEqual(call("--no-plugins").returncode, 2)

    def test_version(self):
        result = call("--version")
        self.assertEqual(result.returncode, 0)
        self.assertRegex(result.stdout, r"^boresight \d+\.\d+\.\d+ \(\S*\)\n$")
        self.assertEqual(call("version").stdout, result.stdout)
        all_of_it = json.loads(call("version", "--json").stdout)
        self.assertEqual(f"boresight {all_of_it['version']} ({all_of_it['git_revision']})\n", result.stdout)
        self.assertEqual(all_of_it["libraries"]["SQLite"], sqlite3.sqlite_version)
        self.assertEqual(all_of_it["libraries"]["ERFA"], erfa.version.erfa_version)
        shown = call("version", "--verbose").stdout
        for name, value in all_of_it["libraries"].items():
            self.assertRegex(shown, rf"\n  {name} +{re.escape(value)}\n")
        with open("docs/reference/file_formats.md", encoding="utf-8") as page:
            documented = re.search(r"^\| link \|[^|]*\| (\d+) \|", page.read(), re.MULTILINE)[1]
        self.assertRegex(shown, rf"\nlink_protocol +{documented}\n")


class SmallStack(unittest.TestCase):
    """Nothing depends on the stack that the process is given (ulimit -s)."""

    def test_commands(self):
        folder = runs.scratch()
        made = os.path.join(folder, "run")
        kernels = ("run", runs.STARE, "--quiet", "--duration", "1", "--overwrite", "--out", made,
                   "--set", "/world/star_catalogue=embedded")
        # test_bad_input.py compiles kernels, which takes the most, with a small stack
        kib = 64
        for words in (kernels, ("report", made), ("check", runs.TRACK, "--quiet"),
                      ("loop", runs.TRACK), ("export", made, "--table", "csv", "--orbits", "oem"),
                      ("study", "scenarios/studies/noise.json", "--emit", "0")):
            result = subprocess.run(["sh", "-c", f'ulimit -s {kib}; exec "$@"', "sh",
                                     runs.BORESIGHT, *words], capture_output=True, text=True,
                                    timeout=120)
            self.assertEqual(result.returncode, 0, (kib, words, result.stderr))


class Resolved(unittest.TestCase):
    def test_check_is_a_fixed_point_and_runs_identically(self):
        first = call("check", runs.TRACK, "--set", "/world/star_catalogue=embedded", "--set",
                     runs.NO_FRAMES, "--duration", "5", "--seed", "0xABC")
        self.assertEqual((first.returncode, first.stderr), (0, ""))
        scenario = json.loads(first.stdout)
        self.assertEqual((scenario["duration_s"], scenario["seed"]), (5, "0xABC"))
        folder = runs.scratch()
        path = os.path.join(folder, "resolved.json")
        with open(path, "w", encoding="utf-8") as file:
            file.write(first.stdout)
        self.assertEqual(call("check", path).stdout, first.stdout)
        runs.run(path, os.path.join(folder, "a"))
        runs.run(runs.TRACK, os.path.join(folder, "b"), runs.NO_FRAMES, duration=5, seed=0xABC)
        dumps = ["\n".join(runs.database(os.path.join(folder, name)).iterdump()) for name in "ab"]
        self.assertEqual(*dumps)
        # the run keeps the resolved scenario, from which it can be repeated
        with open(os.path.join(folder, "b", "scenario.json"), encoding="utf-8") as file:
            self.assertEqual(json.load(file), scenario)

    def test_check_writes_nothing(self):
        folder = runs.scratch()
        result = call("check", os.path.abspath(runs.TRACK), "--quiet", cwd=folder)
        self.assertEqual((result.returncode, result.stdout, result.stderr), (0, "", ""))
        self.assertEqual(os.listdir(folder), [])

    def test_check_compiles_no_kernel(self):
        """A check needs no kernel: with an empty cache it would compile for seconds."""
        cache = runs.scratch()
        runs.call_well("check", runs.TRACK, "--quiet", env={**os.environ, "POCL_CACHE_DIR": cache})
        self.assertEqual(glob.glob(os.path.join(cache, "**", "*.bc"), recursive=True), [])

    def test_shipped_scenarios(self):
        self.assertGreaterEqual(len(SCENARIOS), 4)
        for path in SCENARIOS:
            # without the predictions of a whole day, and with fewer wavelengths of the PSF that takes long
            words = ["--duration", "60"] if path.startswith("scenarios/day_") else []
            if RUN_ELSEWHERE.fullmatch(path):
                words += NO_IMAGES
            if path == "scenarios/diffraction.json":
                words += ["--set", runs.SENSOR + "/camera/optics/wavelengths=2"]
            result = call("check", path, "--quiet", *words)
            said = [line for line in result.stderr.splitlines()
                    if "the cue is out of reach from" not in line
                    and " is in the field from " not in line
                    # the eclipse season is 100 days after the catalogue
                    and "element sets of observers and listed objects" not in line]
            self.assertEqual((result.returncode, said), (0, []), path)


class Schema(unittest.TestCase):
    def test_shipped_schema_is_current(self):
        result = call("schema")
        self.assertEqual((result.returncode, result.stderr), (0, ""))
        schema = json.loads(result.stdout)
        self.assertEqual(schema["$schema"], "https://json-schema.org/draft/2020-12/schema")
        with open("scenarios/boresight.schema.json", encoding="utf-8") as file:
            self.assertEqual(file.read(), result.stdout, "to make it current: build/boresight "
                             "schema > scenarios/boresight.schema.json")

    @unittest.skipIf(jsonschema is None, "needs python3-jsonschema")
    def test_scenarios_fit_the_schema(self):
        schema = json.loads(call("schema").stdout)
        jsonschema.Draft202012Validator.check_schema(schema)  # once: it takes most of the time
        validator = jsonschema.Draft202012Validator(schema)
        for path in SCENARIOS:
            with open(path, encoding="utf-8") as file:
                validator.validate(json.load(file))

    def test_scenarios_name_the_schema(self):
        for path in SCENARIOS:
            with open(path, encoding="utf-8") as file:
                schema = json.load(file)["$schema"]
            self.assertEqual(os.path.normpath(os.path.join(os.path.dirname(path), schema)),
                             "scenarios/boresight.schema.json", path)


class Extended(unittest.TestCase):
    """A scenario that extends another is that one with some values changed."""

    def setUp(self):
        self.folder = runs.scratch()

    def write(self, file_name, /, **values):
        path = os.path.join(self.folder, file_name)
        os.makedirs(os.path.dirname(path), exist_ok=True)
        with open(path, "w", encoding="utf-8") as file:
            json.dump(values, file)
        return path

    def test_it_is_the_other_with_values_changed(self):
        shipped = json.loads(call("check", "scenarios/knowledge/clock.json", *NO_IMAGES).stdout)
        by_hand = json.loads(call("check", runs.TRACK, *NO_IMAGES, "--duration", "120", "--set",
                                  "/name=knowledge_clock", "--set", runs.SENSOR +
                                  "/knowledge/clock_offset_s=1").stdout)
        self.assertEqual(shipped, by_hand)
        self.assertFalse({"extends", "set"} & set(shipped))

    def test_the_resolved_one_stands_alone(self):
        for scenario in ("scenarios/knowledge/psf.json", "scenarios/oem_orbits.json"):
            alone = self.write("alone.json", **json.loads(call("check", scenario, *NO_IMAGES).stdout))
            result = call("check", alone, cwd="/")
            self.assertEqual((result.returncode, result.stderr), (0, ""))
            with open(alone, encoding="utf-8") as file:
                self.assertEqual(json.loads(result.stdout), json.load(file))

    def test_paths_start_from_the_file_that_names_them(self):
        track, elements = os.path.abspath(runs.TRACK), os.path.abspath("scenarios/catalogue_2022-06.tle")
        orbit = "/observers/0/orbit/elements_file"
        with open(elements, encoding="ascii") as file:
            text = file.read()
        for name in ("a/own.tle", "b/own.tle"):
            self.write(name)
            with open(os.path.join(self.folder, name), "w", encoding="ascii") as file:
                file.write(text)
        self.write("a/base.json", extends=track, set={orbit: "own.tle"})
        path = self.write("b/top.json", extends="../a/base.json")
        found = lambda *words: json.loads(call("check", path, *NO_IMAGES, *words).stdout)
        self.assertEqual(found()["observers"][0]["orbit"]["elements_file"],
                         os.path.realpath(os.path.join(self.folder, "a/own.tle")))
        self.assertEqual(found()["world"]["objects"][0]["orbit"]["elements_file"], elements)
        self.assertEqual(found("--set", orbit + "=own.tle")["observers"][0]["orbit"]["elements_file"],
                         os.path.realpath(os.path.join(self.folder, "b/own.tle")))

    def fails(self, path, message):
        for words in (("check", path), ("run", path, "--out", os.path.join(self.folder, "run"))):
            result = call(*words)
            self.assertEqual((result.returncode, result.stdout), (1, ""))
            self.assertIn(message, result.stderr)
            self.assertFalse(os.path.exists(os.path.join(self.folder, "run")))

    def test_messages_name_the_file_at_fault(self):
        track = os.path.abspath(runs.TRACK)
        scale, cue = runs.SENSOR + "/camera/pixel_scale_arcsec", runs.SENSOR + "/cue/object"
        base = self.write("base.json", extends=track, set={scale: -1})
        path = self.write("top.json", extends="base.json", duration_s=7)
        self.fails(path, f"boresight: {base}: {scale}: out of range (found -1; ")
        path = self.write("top.json", extends="base.json", set={scale: 3, "/duration_s": -2})
        self.fails(path, f"boresight: {path}: /duration_s: out of range (found -2; ")
        # what only the world finds
        base = self.write("base.json", extends=track, set={cue: "nobody"})
        path = self.write("top.json", extends="base.json", duration_s=7)
        self.fails(path, f'boresight: {base}: {cue}: there is no object "nobody" ')
        base = self.write("base.json", extends=track,
                          set={"/world/objects/0/orbit/elements_file": "gone.tle"})
        path = self.write("sub/top.json", extends="../base.json")
        self.fails(path, f"{self.folder}/gone.tle: cannot be opened: No such file")
        base = self.write("base.json", extends=track,
                          set={runs.SENSOR + "/modules/imgproc/dark_file": "gone.fits"})
        self.fails(path, f"{self.folder}/sub/../base.json: {runs.SENSOR}/modules/imgproc/dark_file: "
                   f"there is no file {self.folder}/sub/../gone.fits")
        self.fails(self.write("x.json", extends="x.json"), "x.json extends itself by way of 1 file")
        whole = json.loads(call("check", runs.TRACK).stdout)
        self.fails(self.write("x.json", set={"/duration_s": 3}, **whole),
                   'x.json: /set: there is nothing that it changes (found {"/duration_s":3}; allowed: '
                   'only beside "extends")')

    def test_overrides_come_last(self):
        result = call("check", "scenarios/knowledge/clock.json", "--set", runs.SENSOR +
                      "/knowledge/clock_offset_s=-1e9")
        self.assertIn(f"scenarios/knowledge/clock.json: {runs.SENSOR}/knowledge/clock_offset_s: out of "
                      "range (found -1", result.stderr)


def tearDownModule():
    runs.clean()


if __name__ == "__main__":
    unittest.main()
