#!/usr/bin/env python3
"""A day with search, acquisition, track, occultations and an eclipse, without images: nothing
diverges, no number is lost, memory stays flat.

Two hours of it, or with --full the day with the user's whole star catalogue.

Usage, from the repository root:
  /usr/bin/python3 tests/e2e/test_day_modes.py BORESIGHT [--full]
"""
import os
import re
import sys
import time
import unittest

import runs

FULL = "--full" in sys.argv
if FULL:
    sys.argv.remove("--full")
SCENARIO = "scenarios/day_eclipse.json"
LENGTH_S = 86400 if FULL else 7200
# of the processor's time, after the first occultation: all that a run allocates has been used
EARLY = 0.1 if FULL else 0.75


def memory(pid):
    """Processor time that a running process has used, s, and its greatest resident memory, KiB."""
    with open(f"/proc/{pid}/stat", encoding="ascii") as file:
        ticks = file.read().rsplit(")", 1)[1].split()[11:13]
    with open(f"/proc/{pid}/status", encoding="ascii") as file:
        most = re.search(r"VmHWM:\s+(\d+) kB", file.read())
    return sum(map(int, ticks)) / os.sysconf("SC_CLK_TCK"), int(most[1]) if most else 0


def play(out, duration_s):
    """Greatest resident memory of a run, KiB: until EARLY, and in all."""
    words = runs.command(SCENARIO, out, duration=duration_s)
    if FULL:
        words += ["--set", "/world/star_catalogue=default"]
    with open(out + ".log", "w+", encoding="utf-8") as log:
        pid = os.posix_spawn(words[0], words, os.environ, file_actions=[
            (os.POSIX_SPAWN_DUP2, log.fileno(), 1), (os.POSIX_SPAWN_DUP2, log.fileno(), 2)])
        seen = []
        while True:
            ended, status, usage = os.wait4(pid, os.WNOHANG)
            if ended:
                break
            seen.append(memory(pid))
            time.sleep(0.05)
        if status != 0:
            log.seek(0)
            raise AssertionError(log.read())
    early_s = EARLY * (usage.ru_utime + usage.ru_stime)
    return next(most for used, most in seen if used >= early_s and most), usage.ru_maxrss


class DayOfModes(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        if FULL:
            runs.need_full_catalogue()
        folder = runs.scratch()
        cls.out = os.path.join(folder, "whole")
        cls.first, cls.most = play(cls.out, LENGTH_S)
        cls.db = runs.database(cls.out)
        cls.modes = [row[0].split(" -> ")[1].split(":")[0] for row in cls.db.execute(
            "SELECT text FROM events WHERE kind = 'mode' ORDER BY time_s")]
        cls.summary = runs.manifest(cls.out)["summary"]
        print(f"resident memory {cls.first} KiB at {EARLY} of the processor time, {cls.most} KiB at most; modes "
              f"{ {m: cls.modes.count(m) for m in sorted(set(cls.modes))} }; track fraction "
              f"{cls.summary['track_fraction']:.4f}, RMS {cls.summary['pointing_rms_px']:.3f} px")

    def test_memory_is_flat(self):
        # 2 %, and a MiB for caches that its beginning did not fill; half of both where only the last
        # quarter of a short run is left to grow in. The file of the whole catalogue is mapped, and
        # its pages become resident as the boresight moves on
        share, more = (0.02, 1024 + 8192) if FULL else (0.01, 512)
        self.assertLess(self.most, (1 + share) * self.first + more)

    def test_no_number_is_lost(self):
        # SQLite has NULL for what is no number
        for table in ("pointing", "control", "tracks", "nav"):
            columns = [row[1] for row in self.db.execute(f"PRAGMA table_info({table})")
                       if row[2].upper() == "REAL"]
            for column in columns:
                lost = self.db.execute(
                    f"SELECT count(*) FROM {table} WHERE {column} IS NULL OR abs({column}) > 1e300")
                self.assertEqual(lost.fetchone()[0], 0, f"{table}.{column}")

    def test_nothing_diverges(self):
        for mode in ("search", "acquire", "track", "coast"):
            self.assertIn(mode, self.modes)
        self.assertEqual(self.summary["wrong_target_frames"], 0)
        # of the frames in which the target is bright enough to be seen, after it was confirmed
        rows = self.db.execute(
            "SELECT count(*), sum(EXISTS(SELECT 1 FROM tracks t WHERE t.sensor = o.sensor AND "
            "t.exposure_id = o.exposure_id AND t.target_of_interest AND t.status = 'confirmed')) "
            "FROM truth o WHERE kind = 'object' AND id = 0 AND in_field AND NOT occulted AND "
            "snr >= 10 AND mid_s > ?", (self.summary["time_to_confirm_s"],)).fetchone()
        print(f"in track in {rows[1]} of {rows[0]} frames with an SNR of 10 or more")
        # the stars that come with the program give an attitude in every other frame only
        self.assertGreater(rows[1], (0.97 if FULL else 0.4) * rows[0])


def tearDownModule():
    runs.clean()


if __name__ == "__main__":
    unittest.main()
