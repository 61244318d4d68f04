#!/usr/bin/env python3
"""boresight info and boresight export on folders of runs that are damaged in every part: exact
message and exit code, nothing in them changed, no crash (the sanitized build runs this too).

Usage, from the repository root: /usr/bin/python3 tests/e2e/test_hostile_folders.py BORESIGHT
"""
import errno
import os
import re
import shutil
import sqlite3
import unittest

import runs
from runs import call

TABLES = ("--table", "csv", "--tables", "frames")
FRAMES = ("--frames", "png")


def put(name, content):
    def damage(run):
        with open(f"{run}/{name}", "wb") as file:
            file.write(content)
    return damage


def cut(name, size):
    return lambda run: os.truncate(f"{run}/{name}", size)


def instead(name, make):
    """Something else in the place of a file."""
    def damage(run):
        os.remove(f"{run}/{name}")
        make(f"{run}/{name}")
    return damage


def loop(path):
    os.symlink(os.path.basename(path), path)


def flip(name, first, step):
    def damage(run):
        with open(f"{run}/{name}", "r+b") as file:
            content = bytearray(file.read())
            content[first::step] = bytes(b ^ 0x5a for b in content[first::step])
            file.seek(0)
            file.write(content)
    return damage


def foreign_database(path):
    database = sqlite3.connect(path)
    database.execute("CREATE TABLE sensors (sensor, observer, name, target, file, width_px,"
                     " height_px)")
    database.execute("INSERT INTO sensors VALUES ('x', 1.5, NULL, zeroblob(9), '../../etc/passwd',"
                     " -3, 1e300)")
    database.commit()
    database.close()


JSON_END = (": this is not valid JSON (found the end of the text; allowed: a key in double "
            "quotes)")
MALFORMED = "cannot be read: database disk image is malformed"
NOT_DATABASE = "cannot be read: file is not a database"

# what is done to a run; what info says of it, a line each, RUN/ being the folder; the exit codes and
# last messages of `export --table` and of `export --frames`: None: they succeed
CASES = [
    (put("manifest.json", b""),
     ["RUN/manifest.json:1:1: the file is empty (a JSON object is expected)"], None, None),
    (put("manifest.json", b"[1, 2]"), ["RUN/manifest.json: is not a JSON object"], None, None),
    (put("manifest.json", b"\0\xff"),
     ["RUN/manifest.json:1:1: byte 0x00 is not UTF-8 text (allowed: UTF-8)"], None, None),
    (put("manifest.json", b'{"complete": true,'), ["RUN/manifest.json:1:19" + JSON_END], None,
     None),
    (put("manifest.json", b'{"program": "boresight", "complete": 7, "version": [], "seed": {},'
         b' "summary": 3, "sensors": "x", "counters": [1], "device": null}'), [], None, None),
    (instead("manifest.json", os.mkdir), ["manifest.json is missing"], None, None),
    (put("scenario.json", b'{"boresight": 1,'), ["RUN/scenario.json:1:17" + JSON_END], None, None),
    (put("scenario.json", b'{"epoch_utc": 5, "world": 3}'), [], None, None),
    (cut("frames.fits", 0), ["RUN/frames.fits: HDU 1: the header has no END"], None,
     "RUN/frames.fits: HDU 1: the header has no END"),
    (cut("frames.fits", 2800), ["RUN/frames.fits: HDU 1: the header has no END"], None,
     "RUN/frames.fits: HDU 1: the header has no END"),
    (put("frames.fits", b"no FITS at all. " * 360),
     ["RUN/frames.fits: HDU 1: does not begin with SIMPLE"], None,
     "RUN/frames.fits: HDU 1: does not begin with SIMPLE"),
    (flip("frames.fits", 20000, 701), ["frames.fits holds 1 whole frames, the table frames 2"], None,
     "RUN/frames.fits: HDU 2: row ANY of the compressed pixels is damaged"),
    (instead("frames.fits", os.mkfifo), ["RUN/frames.fits: is not a file"], None,
     "RUN/frames.fits: is not a file"),
    (instead("frames.fits", os.mkdir), ["RUN/frames.fits: is not a file"], None,
     "RUN/frames.fits: is not a file"),
    (instead("frames.fits", loop), ["frames.fits is missing"], None,
     "RUN/frames.fits: cannot be opened: Too many levels of symbolic links"),
    (lambda run: os.remove(f"{run}/frames.fits"), ["frames.fits is missing"], None,
     "RUN/frames.fits: cannot be opened: No such file or directory"),
    (put("run.sqlite", b""),
     [f"RUN/run.sqlite: no such table: {name}" for name in ("sensors", "tables", "columns")],
     "RUN/run.sqlite: no such table: tables", "RUN/run.sqlite: no such table: sensors"),
    (put("run.sqlite", b"no database at all. " * 500), [f"RUN/run.sqlite: {NOT_DATABASE}"],
     "RUN: has no tables that could be read", None),
    (cut("run.sqlite", 100), [f"RUN/run.sqlite: {MALFORMED}"],
     "RUN: has no tables that could be read", None),
    (cut("run.sqlite", 32768), [f"RUN/run.sqlite: {MALFORMED}"],
     "RUN: has no tables that could be read", None),
    (instead("run.sqlite", os.mkdir), ["run.sqlite is missing"],
     "RUN: has no tables that could be read", None),
    (instead("run.sqlite", os.mkfifo), ["run.sqlite is missing"],
     "RUN: has no tables that could be read", None),
    (instead("run.sqlite", foreign_database),
     [f"RUN/run.sqlite: no such table: {name}" for name in ("tables", "columns")],
     "RUN/run.sqlite: no such table: tables", "RUN: its frames were not kept"),
    (put("run.sqlite-wal", b"junk" * 5000), [], None, None),
]


class Hostile(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.made = runs.scratch() + "/made"
        runs.run(runs.TRACK, cls.made, "/record/compression=rice", runs.SENSOR + "/camera/width_px=320",
                 runs.SENSOR + "/camera/height_px=256", duration=2)

    def copy(self):
        run = runs.scratch() + "/run"
        shutil.copytree(self.made, run)
        return run

    def ends(self, result, run, message, what):
        """As it should: by success, or by one message with exit code 1; never by a signal."""
        self.assertEqual(result.returncode, 1 if message else 0, (what, result.stderr))
        last = (result.stderr.splitlines() or [""])[-1]
        if message and " ANY " in message: # which one it is depends on the noise
            last = re.sub(r" \d+ of the", " ANY of the", last)
        if message:
            self.assertEqual(last, "boresight: " + message.replace("RUN", run), what)
        else:
            self.assertTrue(not last or last.startswith("boresight: warning: "), (what, last))

    def test_damage(self):
        for number, (damage, says, tables, frames) in enumerate(CASES):
            run, out = self.copy(), runs.scratch() + "/out"
            damage(run)
            names = sorted(os.listdir(run))
            for words in ((), ("--json",)):
                result = call("info", run, *words)
                self.assertEqual(result.stderr.splitlines(),
                                 ["boresight: " + line.replace("RUN", run) for line in says],
                                 number)
                self.assertEqual(result.returncode, 1 if says else 0, number)
            self.ends(call("export", run, *TABLES, "--out", out), run, tables, number)
            self.ends(call("export", run, *FRAMES, "--out", out), run, frames, number)
            self.assertEqual(sorted(os.listdir(run)), names, number)

    def test_unfinished(self):
        run = self.copy()
        partial = run + ".partial"
        os.rename(run, partial)
        os.remove(partial + "/manifest.json")
        with open(partial + "/lock", "wb"):
            pass
        os.truncate(partial + "/frames.fits", os.path.getsize(partial + "/frames.fits") - 4000)
        result = call("info", partial)
        self.assertEqual((result.returncode, result.stderr), (0, ""))
        self.assertEqual(result.stdout.splitlines()[0], f"{partial}: left over from a killed run")
        out = runs.scratch() + "/out"
        self.ends(call("export", partial, *FRAMES, "--out", out), partial, None, "partial")
        self.assertEqual(os.listdir(out + "/frames"), ["frame_000000.png"])

    def test_locked(self):
        # another program holds the database; the command does not wait
        run = self.copy()
        database = sqlite3.connect(run + "/run.sqlite", isolation_level=None)
        database.execute("BEGIN EXCLUSIVE")
        try:
            result = call("info", run)
            self.assertEqual((result.returncode, result.stderr), (0, ""))
            self.ends(call("export", run, *TABLES, "--out", runs.scratch() + "/out"), run, None,
                      "locked")
        finally:
            database.close()

    def test_output(self):
        run, folder = self.copy(), runs.scratch()
        # what is there is replaced, and other things stay
        with open(folder + "/frames.csv", "w", encoding="ascii") as file:
            file.write("old")
        with open(folder + "/thesis.tex", "w", encoding="ascii") as file:
            file.write("x")
        self.ends(call("export", run, *TABLES, "--out", folder), run, None, "there")
        self.assertEqual(sorted(os.listdir(folder)), ["frames.csv", "thesis.tex"])
        with open(folder + "/frames.csv", encoding="ascii") as file:
            self.assertEqual(len(file.read().splitlines()), 3)  # names and two frames
        os.mkdir(folder + "/tables")
        os.mkdir(folder + "/tables/frames.csv")
        result = call("export", run, *TABLES, "--out", folder + "/tables")
        self.ends(result, run,
                  f"{folder}/tables/frames.csv: is not a regular file; give another path",
                  "folder in the place of a file")
        loop(folder + "/loop")
        self.ends(call("export", run, *TABLES, "--out", folder + "/loop"), run,
                  f"{folder}/loop: cannot make the folder: {os.strerror(errno.ELOOP)}", "loop")

    def test_no_rights(self):
        if os.geteuid() != 0:
            options = {}
        else:  # root may read and write everywhere: run as another user
            options = {"user": 65534, "group": 65534}
            try:
                call("--version", **options)
            except PermissionError:
                self.skipTest("the program is out of reach for the user nobody")
        run = self.copy()
        out = os.path.dirname(run) + "/out"
        os.mkdir(out)
        os.chmod(out, 0o555)
        os.chmod(os.path.dirname(run), 0o755)
        result = call("export", run, *TABLES, "--out", out, **options)
        self.assertEqual(result.returncode, 2)
        self.assertIn(f"--out {out}: {out} cannot be written to: Permission denied", result.stderr)
        os.chmod(out, 0o777)
        for name in os.listdir(run):
            os.chmod(f"{run}/{name}", 0)
        denied = "Permission denied"
        result = call("info", run, **options)
        self.assertEqual(result.returncode, 1)
        self.assertEqual(result.stderr.splitlines(), [
            f"boresight: {run}/manifest.json: cannot be opened: {denied}; give a JSON file",
            f"boresight: {run}/scenario.json: cannot be opened: {denied}; give a JSON file",
            f"boresight: {run}/run.sqlite: cannot be read: unable to open database file"])
        os.chmod(run, 0)
        for words in (("info", run), ("export", run, *TABLES, "--out", out)):
            self.ends(call(*words, **options), run, f"RUN: cannot be read: {denied}", "no rights")
        os.chmod(run, 0o755)


def tearDownModule():
    runs.clean()


if __name__ == "__main__":
    unittest.main()
