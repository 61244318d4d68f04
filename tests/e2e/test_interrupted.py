#!/usr/bin/env python3
"""A run that is killed or interrupted: its folder is never taken for a whole run, and what it had
recorded can be read.

Usage, from the repository root:
  /usr/bin/python3 tests/e2e/test_interrupted.py BORESIGHT [number of kills, default 4]
"""
import os
import random
import signal
import sqlite3
import subprocess
import sys
import time
import unittest
import warnings

import numpy as np
from astropy.io import fits

import runs

KILLS = int(sys.argv.pop(1)) if len(sys.argv) > 1 and sys.argv[1].isdigit() else 4
REFERENCE_S = 60
LONGEST_WAIT_S = 1.5


def stop(out, number, wait_s, form):
    """Starts the main job and sends a signal some time after its frames begin; the exit code and
    what it said."""
    with subprocess.Popen(runs.command(runs.TRACK, out, f"/record/frames={form}", duration=3000),
                          stderr=subprocess.PIPE, text=True) as process:
        frames = os.path.join(out + ".partial", "frames.fits")
        while not os.path.exists(frames) and process.poll() is None:
            time.sleep(0.01)
        time.sleep(wait_s)
        process.send_signal(number)
        return process.wait(timeout=60), process.stderr.read()


def whole_frames(path):
    """Images of the frames that a file holds completely, in order."""
    if os.path.getsize(path) < 2880:
        return []  # killed before the first header
    with warnings.catch_warnings():
        # astropy says that the last extension is torn
        warnings.simplefilter("ignore")
        with fits.open(path, memmap=False) as hdus:
            if hdus[0].header["NAXIS"] == 3:
                return list(hdus[0].data)
            size = os.path.getsize(path)
            return [hdu.data for hdu in hdus[1:]
                    if hdu.fileinfo()["datLoc"] + hdu.fileinfo()["datSpan"] <= size]


class Interrupted(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = runs.scratch()
        reference = os.path.join(cls.folder, "reference")
        runs.run(runs.TRACK, reference, "/record/frames=cube", duration=REFERENCE_S)
        cls.reference = whole_frames(os.path.join(reference, "frames.fits"))

    def assert_start_of_reference(self, frames):
        for k, (mine, expected) in enumerate(zip(frames, self.reference)):
            self.assertTrue(np.array_equal(mine, expected), k)

    def check_killed(self, k):
        rng = random.Random(k)
        out = os.path.join(self.folder, f"killed{k}")
        form = "cube" if k % 3 == 2 else "extensions"
        code, _ = stop(out, signal.SIGKILL, rng.uniform(0, LONGEST_WAIT_S), form)
        self.assertEqual(code, -signal.SIGKILL)
        self.assertFalse(os.path.exists(out))
        left = out + ".partial"
        self.assertFalse(os.path.exists(os.path.join(left, "manifest.json")))
        frames = whole_frames(os.path.join(left, "frames.fits"))
        self.assert_start_of_reference(frames)
        # the tables' last commit tells of no frame that the file does not hold
        with sqlite3.connect(os.path.join(left, "run.sqlite")) as db:
            self.assertEqual(db.execute("PRAGMA integrity_check").fetchall(), [("ok",)])
            rows = db.execute("SELECT count(*) FROM frames").fetchone()[0]
        db.close()
        self.assertLessEqual(rows, len(frames))
        # the same command again replaces what is there and completes
        runs.run(runs.TRACK, out, f"/record/frames={form}", duration=3)
        self.assertFalse(os.path.exists(left))
        self.assertTrue(runs.manifest(out)["complete"])
        self.assertEqual(len(whole_frames(os.path.join(out, "frames.fits"))), 3)
        for name in os.listdir(out):
            os.remove(os.path.join(out, name))
        return len(frames)

    def test_killed(self):
        counts = runs.parallel(self.check_killed, range(KILLS))
        print(f"{KILLS} runs killed; whole frames left: {counts}")
        self.assertGreater(max(counts), 0)

    def check_interrupted(self, number, form):
        out = os.path.join(self.folder, f"interrupted {number} {form}")
        code, said = stop(out, number, 0.7, form)
        self.assertEqual(code, 130, said)
        self.assertRegex(said, "interrupt")
        self.assertFalse(os.path.exists(out))
        left = out + ".partial"
        # closed properly: no journal beside the tables, a manifest that says what it is
        self.assertEqual(sorted(name for name in os.listdir(left) if name != "lock"),
                         ["frames.fits", "manifest.json", "pointing.png", "quicklook.png",
                          "run.sqlite", "scenario.json"])
        manifest = runs.manifest(left)
        self.assertFalse(manifest["complete"])
        with fits.open(os.path.join(left, "frames.fits")) as hdus:
            hdus.verify("exception")
            count = len(hdus["FRAMES"].data) if form == "cube" else len(hdus) - 1
        frames = whole_frames(os.path.join(left, "frames.fits"))
        self.assertEqual(len(frames), count)
        self.assertGreater(count, 0)
        self.assert_start_of_reference(frames)
        rows = runs.database(left).execute("SELECT count(*) FROM frames").fetchone()[0]
        self.assertEqual(rows, count)
        self.assertEqual(manifest["summary"]["frames"], count)

    def test_interrupted(self):
        runs.parallel(lambda job: self.check_interrupted(*job),
                      [(signal.SIGINT, "extensions"), (signal.SIGINT, "cube"),
                       (signal.SIGTERM, "extensions")])


def tearDownModule():
    runs.clean()


if __name__ == "__main__":
    unittest.main()
