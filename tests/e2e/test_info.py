#!/usr/bin/env python3
"""boresight info: folders of runs in every state, by exact message, and nothing in them changed.

Usage, from the repository root: /usr/bin/python3 tests/e2e/test_info.py BORESIGHT
"""
import hashlib
import json
import os
import shutil
import signal
import subprocess
import time
import unittest

import runs
from runs import call


def fingerprint(folder):
    """Names, contents and times of what a folder holds."""
    out = []
    for name in sorted(os.listdir(folder)):
        path = os.path.join(folder, name)
        with open(path, "rb") as file:
            out.append((name, hashlib.sha256(file.read()).hexdigest(), os.stat(path).st_mtime_ns))
    return out, os.stat(folder).st_mtime_ns


# rows are committed every 2 s: until then the processor is left to others
PACED = ["--pacing", "realtime", "--set", "/pacing/speed=4"]
SMALL = [f"{runs.SENSOR}/camera/{side}_px=256" for side in ("width", "height")]


def start(folder, *sets):
    """A long run of small frames that is under way: its tables hold frames."""
    process = subprocess.Popen(runs.command(runs.TRACK, os.path.join(folder, "run"), *SMALL, *sets,
                                            duration=3000) + PACED,
                               stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    partial = os.path.join(folder, "run.partial")
    for _ in range(600):
        time.sleep(0.1)
        result = call("info", partial, "--json")
        if result.stdout:
            info = json.loads(result.stdout)
            if info["sensors"] and info["sensors"][0]["frames"] >= 3:
                return process, partial, info
    process.kill()
    process.wait()
    raise AssertionError(f"the run does not get under way: {result.stderr}")


class Complete(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = runs.scratch()
        cls.made = os.path.join(cls.folder, "run")
        cls.manifest = runs.run(runs.TRACK, cls.made, duration=5, seed=0x2A)

    def copy(self):
        to = os.path.join(runs.scratch(), "copy")
        shutil.copytree(self.made, to)
        return to

    def test_json(self):
        before = fingerprint(self.made)
        result = call("info", self.made, "--json")
        self.assertEqual((result.returncode, result.stderr), (0, ""))
        self.assertEqual(fingerprint(self.made), before)
        info = json.loads(result.stdout)
        for key in ("version", "git_revision", "seed", "run", "device", "summary", "counters",
                    "scenario", "scenario_file", "warnings", "wall_time_s", "stars"):
            self.assertEqual(info[key], self.manifest[key], key)
        self.assertEqual(info["state"], "complete")
        self.assertEqual(info["problems"], [])
        self.assertEqual((info["start_utc"], info["end_utc"], info["simulated_s"]),
                         ("2022-06-16T22:10:00.000Z", "2022-06-16T22:10:05.000Z", 5))
        self.assertEqual(info["seed"], "0x2A")
        size = os.path.getsize(self.made + "/frames.fits")
        self.assertEqual(info["sensors"], [
            {"sensor": 0, "observer": "neossat", "name": "telescope", "target": "INMARSAT GX5",
             "file": "frames.fits", "width_px": 1024, "height_px": 1024, "frames": 5, "bits": 16,
             "file_bytes": size, "frames_in_file": 5, "layout": "extensions",
             "compression": "rice", "cut_off": False}])
        database = runs.database(self.made)
        names = [row[0] for row in database.execute('SELECT "table" FROM tables ORDER BY rowid')]
        self.assertEqual([t["name"] for t in info["tables"]], names)
        for table in info["tables"]:
            rows = database.execute(f'SELECT count(*) FROM "{table["name"]}"').fetchone()[0]
            self.assertEqual(table["rows"], rows, table["name"])
            columns = [c[1] for c in database.execute(f'PRAGMA table_info("{table["name"]}")')]
            self.assertEqual([c["name"] for c in table["columns"]], columns)
            self.assertTrue(all(c["doc"] for c in table["columns"]), table["name"])
        events = dict(database.execute("SELECT kind, count(*) FROM events GROUP BY kind"))
        self.assertEqual(info["events"], events)
        files = {name: os.path.getsize(os.path.join(self.made, name))
                 for name in os.listdir(self.made)}
        self.assertEqual({f["name"]: f["bytes"] for f in info["files"]}, files)
        self.assertEqual(info["bytes"], sum(files.values()))

    def test_text(self):
        result = call("info", self.made + "/")
        self.assertEqual((result.returncode, result.stderr), (0, ""))
        lines = result.stdout.splitlines()
        self.assertEqual(lines[0], f"{self.made}: complete")
        self.assertIn("  neossat/telescope: 5 frames, 1024 x 1024 px, 16 bit, target INMARSAT GX5",
                      lines)
        self.assertTrue(any(line.startswith("    frames.fits: 5 image extensions, Rice, ")
                            for line in lines))
        self.assertNotIn("cov_xx_px2", result.stdout)
        self.assertIn("cov_xx_px2", call("info", self.made, "--columns").stdout)

    def test_cube_and_no_frames(self):
        folder = runs.scratch()
        runs.run(runs.TRACK, folder + "/cube", "/record/frames=cube", duration=2)
        sensor = json.loads(call("info", folder + "/cube", "--json").stdout)["sensors"][0]
        self.assertEqual((sensor["layout"], sensor["frames_in_file"]), ("cube", 2))
        runs.run(runs.TRACK, folder + "/none", runs.NO_FRAMES, duration=2)
        sensor = json.loads(call("info", folder + "/none", "--json").stdout)["sensors"][0]
        self.assertEqual((sensor["file"], sensor["frames"], sensor["frames_in_file"]), ("", 2, 0))
        self.assertIn("    frames are not kept\n", call("info", folder + "/none").stdout)

    def damaged(self, run, *messages):
        before = fingerprint(run)
        result = call("info", run)
        self.assertEqual(result.returncode, 1)
        self.assertEqual(result.stderr.splitlines(), [f"boresight: {m}" for m in messages])
        self.assertIn(", damaged", result.stdout.splitlines()[0])
        self.assertEqual(fingerprint(run), before)

    def test_damaged(self):
        run = self.copy()
        os.remove(run + "/run.sqlite")
        self.damaged(run, "run.sqlite is missing")
        run = self.copy()
        with open(run + "/run.sqlite", "wb") as file:
            file.write(b"no database at all" * 100)
        self.damaged(run, f"{run}/run.sqlite: cannot be read: file is not a database")
        run = self.copy()
        os.remove(run + "/frames.fits")
        self.damaged(run, "frames.fits is missing")
        run = self.copy()
        os.truncate(run + "/frames.fits", os.path.getsize(run + "/frames.fits") // 2)
        self.damaged(run, "frames.fits holds 2 whole frames, the table frames 5")
        run = self.copy()
        with open(run + "/frames.fits", "wb") as file:
            file.write(b"no FITS at all. " * 360)
        self.damaged(run, f"{run}/frames.fits: HDU 1: does not begin with SIMPLE")
        run = self.copy()
        with open(run + "/manifest.json", "w", encoding="ascii") as file:
            file.write('{"complete": true')
        result = call("info", run)
        self.assertEqual(result.returncode, 1)
        self.assertRegex(result.stderr, f"^boresight: {run}/manifest.json:1:")
        self.assertTrue(result.stdout.startswith(f"{run}: left over from a killed run, damaged\n"))
        run = self.copy()
        os.remove(run + "/scenario.json")
        self.damaged(run, "scenario.json is missing")
        run = self.copy()
        os.remove(run + "/manifest.json")
        self.damaged(run, "manifest.json is missing")

    def test_read_only(self):
        run = self.copy()
        for name in os.listdir(run):
            os.chmod(os.path.join(run, name), 0o444)
        os.chmod(run, 0o555)
        options = {}
        if os.geteuid() == 0:  # root may write everywhere: run as another user
            os.chmod(os.path.dirname(run), 0o755)
            options = {"user": 65534, "group": 65534}
            try:
                call("--version", **options)
            except PermissionError:
                self.skipTest("the program is out of reach for the user nobody")
        result = call("info", run, **options)
        self.assertEqual((result.returncode, result.stderr), (0, ""))
        self.assertEqual(result.stdout.splitlines()[0], f"{run}: complete")
        os.chmod(run, 0o755)

    def test_renamed(self):
        # a whole run under an unfinished one's name is one that was killed while it closed
        to = os.path.join(runs.scratch(), "run.partial")
        shutil.copytree(self.made, to)
        self.assertEqual(json.loads(call("info", to, "--json").stdout)["state"], "killed")


class Unfinished(unittest.TestCase):
    def end(self, number, *sets):
        folder = runs.scratch()
        process, partial, info = start(folder, *sets)
        self.assertEqual(info["state"], "running")
        result = call("info", os.path.join(folder, "run"))
        self.assertEqual((result.returncode, result.stderr),
                         (1, f"boresight: {folder}/run: No such file or directory; there is an "
                             f"unfinished run, {partial}\n"))
        process.send_signal(number)
        process.wait(timeout=60)
        return partial

    def check_left(self, partial, state, words):
        before = fingerprint(partial)
        result = call("info", partial, "--json")
        self.assertEqual((result.returncode, result.stderr), (0, ""))
        info = json.loads(result.stdout)
        self.assertEqual(info["state"], state)
        sensor = info["sensors"][0]
        # rows are committed every two seconds, frames are there at once
        self.assertGreaterEqual(sensor["frames"], 3)
        self.assertGreaterEqual(sensor["frames_in_file"], 3)
        self.assertEqual(info["version"], call("--version").stdout.split()[1])
        self.assertGreater(info["simulated_s"], 2.0)
        self.assertLess(info["simulated_s"], 3000.0)
        self.assertEqual(call("info", partial).stdout.splitlines()[0], f"{partial}: {words}")
        self.assertEqual(fingerprint(partial), before)
        # what is left can be exported
        out = os.path.join(runs.scratch(), "out")
        result = call("export", partial, "--table", "csv", "--tables", "frames", "--frames", "png",
                      "--last", "1", "--annotate", "--orbits", "oem", "--out", out)
        self.assertEqual((result.returncode, result.stderr), (0, ""))
        self.assertEqual(sorted(os.listdir(out)), ["frames", "frames.csv", "orbits.oem"])
        self.assertEqual(sorted(os.listdir(out + "/frames")),
                         ["frame_000000.png", "frame_000001.png"])
        self.assertEqual(fingerprint(partial), before)

    def test_killed(self):
        self.check_left(self.end(signal.SIGKILL), "killed", "left over from a killed run")

    def test_killed_cube(self):
        self.check_left(self.end(signal.SIGKILL, "/record/frames=cube"), "killed",
                        "left over from a killed run")

    def test_interrupted(self):
        self.check_left(self.end(signal.SIGINT), "interrupted", "interrupted")

    def test_killed_at_once(self):
        # before the database: there is the lock alone
        folder = os.path.join(runs.scratch(), "run.partial")
        os.mkdir(folder)
        with open(folder + "/lock", "w", encoding="ascii"):
            pass
        result = call("info", folder)
        self.assertEqual(result.stdout.splitlines()[0],
                         f"{folder}: left over from a killed run, damaged")
        self.assertEqual((result.returncode, result.stderr),
                         (1, "boresight: run.sqlite is missing\n"))


class NoRun(unittest.TestCase):
    def fails(self, path, message, code=1):
        for words in (("info", path), ("export", path, "--table", "csv", "--out",
                                       runs.scratch() + "/out")):
            result = call(*words)
            self.assertEqual((result.returncode, result.stdout, result.stderr),
                             (code, "", f"boresight: {message}\n"))
            self.assertEqual(os.path.exists(words[-1]), words[0] == "info")

    def test_what_is_no_run(self):
        folder = runs.scratch()
        missing = folder + "/none"
        result = call("info", missing)
        self.assertEqual((result.returncode, result.stderr),
                         (1, f"boresight: {missing}: No such file or directory\n"))
        self.fails(folder, f"{folder}: is not the folder of a run: it holds neither manifest.json "
                   "nor run.sqlite")
        path = folder + "/thesis.tex"
        with open(path, "w", encoding="ascii") as file:
            file.write("x")
        self.fails(path, f"{path}: is not a folder; give the folder of a run")
        with open(folder + "/manifest.json", "w", encoding="ascii") as file:
            file.write('{"name": "some web page"}')
        self.fails(folder, f"{folder}: is not the folder of a run: manifest.json is not one of "
                   "boresight")
        loop = folder + "/loop"
        os.symlink(loop, loop)
        self.fails_to_open(loop, f"{loop}: Too many levels of symbolic links")

    def fails_to_open(self, path, message):
        result = call("info", path)
        self.assertEqual((result.returncode, result.stderr), (1, f"boresight: {message}\n"))

    def test_usage(self):
        result = call("info")
        self.assertEqual(result.returncode, 2)
        self.assertIn("one folder of a run is expected, 0 were given", result.stderr)


def tearDownModule():
    runs.clean()


if __name__ == "__main__":
    unittest.main()
