#!/usr/bin/env python3
"""A run that is killed or interrupted: its folder is never taken for a whole run, and what it had
recorded can be read.

Usage, from the repository root:
  /usr/bin/python3 tests/e2e/test_interrupted.py BORESIGHT [number of kills, default 9]
"""
import os
import random
import shutil
import signal
import subprocess
import sys
import time
import unittest
from collections import Counter

from astropy.io import fits

import leftovers
import runs

KILLS = int(sys.argv.pop(1)) if len(sys.argv) > 1 and sys.argv[1].isdigit() else 6
FULL = KILLS > 6
signal.signal(signal.SIGHUP, signal.SIG_DFL)  # runs take it over: under nohup they would ignore it
# a quarter of the pixels leaves the time of frames to be that of files
SMALL = [] if FULL else [f"{runs.SENSOR}/camera/{side}_px=512" for side in ("width", "height")]
FORMS = {
    "extensions": ["/record/frames=extensions", "/record/compression=none", *SMALL],
    "rice": ["/record/frames=extensions", "/record/compression=rice", *SMALL],
    "cube": ["/record/frames=cube", *SMALL],
}
REFERENCE_S = 60 if FULL else 25
SHORT_S = 6
LONGEST_WAIT_S = 1.5 if FULL else 0.4


def start(out, form, duration, *words):
    return subprocess.Popen(runs.command(runs.TRACK, out, *FORMS[form], duration=duration, pictures=True) + [*words],
                            stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)


def wait_for_frames(process, out):
    while not os.path.exists(os.path.join(out + ".partial", "frames.fits")) and \
            process.poll() is None:
        time.sleep(0.01)


class Interrupted(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = runs.scratch()
        reference = os.path.join(cls.folder, "reference")
        runs.run(runs.TRACK, reference, *FORMS["rice"], duration=REFERENCE_S)
        cls.reference = leftovers.frames_in(os.path.join(reference, "frames.fits"))
        began = time.monotonic()
        runs.run(runs.TRACK, os.path.join(cls.folder, "short"), *FORMS["rice"], duration=SHORT_S)
        cls.short_wall_s = time.monotonic() - began

    def killed(self, k):
        """One kill at a random time: two of three among the frames of a long run, the third
        anywhere in the life of a short one, from its start until after its end."""
        rng = random.Random(k)
        out = os.path.join(self.folder, f"killed{k}")
        form = list(FORMS)[k // 3 % 3]
        short = k % 3 == 2
        with start(out, form, SHORT_S if short else 3000) as process:
            if short:
                time.sleep(rng.uniform(0, 1.05 * self.short_wall_s))
            else:
                wait_for_frames(process, out)
                time.sleep(rng.uniform(0, LONGEST_WAIT_S))
            process.kill()
            code = process.wait(timeout=60)
            said = process.stderr.read()
        self.assertIn(code, (0, -signal.SIGKILL) if short else (-signal.SIGKILL,), said)
        where, frames, rows = leftovers.check(out, self.reference, SHORT_S if short else 3000)
        if code == 0:
            self.assertEqual(where, "complete")
        if not short:
            self.assertEqual(where, "partial")
            self.assertFalse(os.path.exists(os.path.join(out + ".partial", "manifest.json")))
        if k % 3 == 0 and k < 9 and where == "partial":
            # the same command again replaces what is there and completes
            runs.run(runs.TRACK, out, *FORMS[form], duration=2)
            self.assertEqual(leftovers.check(out, self.reference, 2), ("complete", 2, 2))
        for left in (out, out + ".partial"):
            shutil.rmtree(left, ignore_errors=True)
        return where, frames

    def test_killed(self):
        left = runs.parallel(self.killed, range(KILLS))
        print(f"{KILLS} runs killed; left: {dict(Counter(where for where, _ in left))}, whole "
              f"frames {[frames for _, frames in left]}")
        self.assertGreater(max(frames for _, frames in left), 0)

    def lost(self, form):
        """Kills a run some seconds into its frames; frames seen 4 s before, and what is left. At
        four times real time, so that it leaves the processor to others."""
        out = os.path.join(self.folder, f"lost {form}")
        path = os.path.join(out + ".partial", "frames.fits")
        with start(out, form, 3000, "--pacing", "realtime", "--set", "/pacing/speed=4") as process:
            wait_for_frames(process, out)
            time.sleep(1)
            seen = os.path.getsize(path)
            time.sleep(4)
            process.kill()
            process.wait(timeout=60)
        _, frames, rows = leftovers.check(out, self.reference, 3000)
        # frames are alike, also compressed, so that their number follows from the file's size
        return int(0.99 * frames * seen / os.path.getsize(path)), frames, rows

    def test_what_may_be_lost_is_bounded(self):
        for form, (seen, frames, rows) in zip(FORMS, runs.parallel(self.lost, FORMS)):
            print(f"{form}: {seen} frames 4 s before the kill, {frames} frames and {rows} rows "
                  "after it")
            self.assertGreater(seen, 0)
            # rows are committed every 2 s; 2 s more for a machine with other things to do
            self.assertGreaterEqual(rows, seen)
            self.assertGreater(frames, seen)

    def interrupted(self, number, form):
        out = os.path.join(self.folder, f"interrupted {number} {form}")
        with start(out, form, 3000) as process:
            wait_for_frames(process, out)
            time.sleep(0.7 if FULL else 0.3)
            process.send_signal(number)
            code, said = process.wait(timeout=60), process.stderr.read()
        self.assertEqual(code, 130, said)
        self.assertRegex(said, r"boresight: interrupted at \d+\.\d+ s\n")
        where, frames, rows = leftovers.check(out, self.reference, 3000)
        self.assertEqual((where, rows), ("partial", frames))
        self.assertGreater(frames, 0)
        left = out + ".partial"
        # closed properly: no journal beside the tables, a manifest that says what it is
        self.assertEqual(sorted(name for name in os.listdir(left) if name != "lock"),
                         ["frames.fits", "manifest.json", "pointing.png", "quicklook.png",
                          "run.sqlite", "scenario.json", "wall_clock.csv"])
        manifest = runs.manifest(left)
        self.assertEqual((manifest["complete"], manifest["ended"]), (False, "interrupted"))
        self.assertEqual(manifest["summary"]["frames"], frames)
        newest = runs.database(left).execute("SELECT max(end_tick) FROM frames").fetchone()[0]
        self.assertGreaterEqual(manifest["last_tick"], newest)
        with fits.open(os.path.join(left, "frames.fits")) as hdus:
            count = len(hdus["FRAMES"].data) if form == "cube" else len(hdus) - 1
        self.assertEqual(count, frames)

    def test_interrupted(self):
        runs.parallel(lambda job: self.interrupted(*job),
                      [(signal.SIGINT, "extensions"), (signal.SIGINT, "cube"),
                       (signal.SIGTERM, "extensions"), (signal.SIGHUP, "rice")])

    def test_second_signal_ends_at_once(self):
        out = os.path.join(self.folder, "twice")
        with start(out, "extensions", 3000) as process:
            wait_for_frames(process, out)
            # both wait while the process is stopped, so that none is handled between them
            process.send_signal(signal.SIGSTOP)
            process.send_signal(signal.SIGINT)
            process.send_signal(signal.SIGTERM)
            process.send_signal(signal.SIGCONT)
            code = process.wait(timeout=60)
        self.assertIn(code, (-signal.SIGINT, -signal.SIGTERM))
        self.assertEqual(leftovers.check(out, self.reference, 3000)[0], "partial")
        self.assertFalse(os.path.exists(os.path.join(out + ".partial", "manifest.json")))


def tearDownModule():
    runs.clean()


if __name__ == "__main__":
    unittest.main()
