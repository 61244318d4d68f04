#!/usr/bin/env python3
"""A day of the closed loop with images of 2048 x 2048 pixels that are not recorded: the target is
found and kept, nothing is lost, memory stays flat.

Half a minute of it, or with --full the day with the user's whole star catalogue and on all
processors; --full SECONDS: so much of it.

Usage, from the repository root:
  /usr/bin/python3 tests/e2e/test_day_images.py BORESIGHT [--full [SECONDS]]
"""
import os
import subprocess
import sys
import time
import unittest

import runs

SCENARIO = "scenarios/day_images.json"
FULL = "--full" in sys.argv
LENGTH_S = 30
if FULL:
    at = sys.argv.index("--full")
    sys.argv.pop(at)
    LENGTH_S = 86400
    if at < len(sys.argv) and sys.argv[at].isdigit():
        LENGTH_S = int(sys.argv.pop(at))
PERIOD_S = 2
EVERY_S = 2.0  # of wall time between two looks at the memory


def resident(pid):
    """Resident memory of a process: all of it and what is no mapped file, KiB; None: it is over."""
    try:
        with open(f"/proc/{pid}/status", encoding="utf-8") as file:
            values = dict(line.split(":", 1) for line in file)
        all_kib = int(values["VmRSS"].split()[0])
        return all_kib, all_kib - int(values["RssFile"].split()[0])
    except (OSError, KeyError):
        return None


def play(out):
    """Runs the scenario; its memory over wall time, [(s, (VmRSS, VmRSS - RssFile))], KiB."""
    if FULL:
        words = [runs.BORESIGHT, "run", SCENARIO, "--quiet", "--out", out,
                 "--duration", str(LENGTH_S)]
    else:
        words = runs.command(SCENARIO, out, duration=LENGTH_S)
    memory, start = [], time.monotonic()
    with open(out + ".log", "w+", encoding="utf-8") as log:
        with subprocess.Popen(words, stdout=log, stderr=log) as process:
            while FULL and process.poll() is None:
                time.sleep(EVERY_S)
                memory.append((time.monotonic() - start, resident(process.pid)))
            status = process.wait()
        if status != 0:
            log.seek(0)
            raise AssertionError(log.read())
    return [(at, m) for at, m in memory if m]


class DayOfImages(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.out = os.path.join(runs.scratch(), "run")
        before = os.times()
        cls.memory = play(cls.out)
        after = os.times()
        cls.manifest = runs.manifest(cls.out)
        cls.summary = cls.manifest["summary"]
        cls.db = runs.database(cls.out)
        cls.frames = cls.db.execute("SELECT count(*) FROM exposures").fetchone()[0]
        wall_s = cls.manifest["wall_time_s"]
        cpu_s = sum(after[2:4]) - sum(before[2:4])
        print(f"{cls.frames} frames in {wall_s:.1f} s: {1e3 * wall_s / cls.frames:.2f} ms each, "
              f"{1e3 * cpu_s / cls.frames:.2f} ms of processor time; track fraction "
              f"{cls.summary['track_fraction']:.4f}, RMS {cls.summary['pointing_rms_px']:.3f} px")

    def test_every_frame_is_rendered_and_processed(self):
        self.assertTrue(self.manifest["complete"])
        self.assertEqual(self.frames, LENGTH_S // PERIOD_S)
        rows = self.db.execute("SELECT count(*), sum(stars_identified > 0) FROM detection_frames "
                               "WHERE end_tick + 6000 < (SELECT max(end_tick) FROM exposures)"
                               ).fetchone()
        self.assertGreaterEqual(rows[0], self.frames - 2)
        # 1.7 degrees: the stars that come with the program are some tens; for a quarter of the day
        # the Earth is in the way
        self.assertGreater(rows[1], (0.65 if FULL else 0.5) * rows[0])

    def test_the_target_is_kept(self):
        self.assertLess(self.summary["time_to_confirm_s"], 20.0)
        self.assertEqual(self.summary["wrong_target_frames"], 0)
        self.assertGreater(self.summary["track_fraction"], 0.95)
        self.assertLess(self.summary["pointing_rms_px"], 1.0)

    def test_no_frame_is_kept(self):
        self.assertFalse([name for name in os.listdir(self.out) if name.endswith(".fits")])

    @unittest.skipUnless(FULL, "needs a run of some minutes")
    def test_memory_is_flat(self):
        # from a tenth of the run on, when caches are full, and before pictures are drawn; pages of
        # the star catalogue's file become resident as the boresight moves on
        part = [m for at, m in self.memory if at < self.manifest["wall_time_s"]]
        part = part[len(part) // 10:]
        growth = [max(m[i] for m in part[len(part) // 2:]) / part[0][i] - 1.0 for i in range(2)]
        print(f"resident memory {part[0][0]} KiB, grew by {100 * growth[0]:.2f} %; without mapped "
              f"files {part[0][1]} KiB, grew by {100 * growth[1]:.2f} %")
        self.assertLess(growth[1], 0.01)


def tearDownModule():
    runs.clean()


if __name__ == "__main__":
    unittest.main()
