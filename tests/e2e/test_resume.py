#!/usr/bin/env python3
"""boresight run --until, --save-every and --restore: a run that was killed or interrupted and then
resumed leaves what the uninterrupted one leaves: every row, every byte of the frames and pictures,
every figure of the manifest.

Usage, from the repository root:
  /usr/bin/python3 tests/e2e/test_resume.py BORESIGHT SAVE_STATE [number of random kills, default 0]
"""
import os
import random
import shutil
import signal
import subprocess
import sys
import time
import unittest

from astropy.io import fits

import runs

SAVE_STATE = os.path.abspath(sys.argv.pop(1))
KILLS = int(sys.argv.pop(1)) if len(sys.argv) > 1 and sys.argv[1].isdigit() else 0
# a small field with the target in it: acquired after some seconds
SMALL = [runs.SENSOR + "/camera/width_px=256", runs.SENSOR + "/camera/height_px=256",
         runs.SENSOR + "/cue/offset_deg=0.02", runs.SENSOR + "/cue/sigma_deg=0.05"]
RICE = ["/record/compression=rice"]
RAW = ["/record/compression=none"]
CUBE = ["/record/frames=cube"]
PLANES = RAW + ['/record/planes=["saturation"]']
QUICK = "scenarios/constellation_quick.json"
TRACK_S = 18


def content(out):
    """All that a run left: rows, bytes of frames and pictures, manifest without wall times."""
    found = {}
    for name in sorted(os.listdir(out)):
        if name.endswith((".fits", ".png")) or name == "scenario.json":
            with open(os.path.join(out, name), "rb") as file:
                found[name] = file.read()
        else:
            found[name] = None
    db = runs.database(out)
    for (table,) in db.execute("SELECT name FROM sqlite_master WHERE type = 'table'").fetchall():
        found["table " + table] = [tuple(row) for row in
                                   db.execute(f'SELECT rowid, * FROM "{table}" ORDER BY rowid')]
    db.close()
    manifest = runs.manifest(out)
    for key in [k for k in manifest if k == "wall_time_s"]:
        del manifest[key]
    for sums in [manifest["summary"], *manifest.get("sensors", {}).values()]:
        del sums["real_time_factor"]
    # the number of threads is part of the device
    manifest["device"] = manifest["device"].split(",")[0]
    found["manifest"] = manifest
    return found


def with_pictures(sets):
    """The pictures of one form of the runs are enough."""
    return RICE[0] in sets


class Interruption:
    """A run of a scenario that is interrupted and resumed."""

    def __init__(self, scenario, out, *sets, duration, every):
        self.scenario, self.out, self.sets, self.duration = scenario, out, sets, duration
        self.every = every
        self.state = os.path.join(out + ".partial", "state")

    def words(self, *more, every=None, **options):
        return runs.command(self.scenario, self.out, *self.sets, duration=self.duration,
                            pictures=with_pictures(self.sets), **options) + ["--save-every", str(every or self.every), *more]

    def stop(self, number, saves, *more, **options):
        """Starts the run and sends a signal after a number of saved states; what it said. A run
        that has ended by then, as this process had to wait for a processor, is tried again."""
        partial, copy = self.out + ".partial", self.out + ".copy"
        if more:
            shutil.copytree(partial, copy)
        for _ in range(9):
            code, said = self.stopped(number, saves, *more, **options)
            if code != 0:
                break
            shutil.rmtree(self.out)
            if more:
                shutil.copytree(copy, partial)
        shutil.rmtree(copy, ignore_errors=True)
        if code != (-signal.SIGKILL if number == signal.SIGKILL else 130):
            raise AssertionError(f"exit code {code}: {said}")
        return said

    def stopped(self, number, saves, *more, **options):
        """One try of stop(): exit code and what it said."""
        seen = set()
        with subprocess.Popen(self.words(*more, **options), stdout=subprocess.DEVNULL,
                              stderr=subprocess.PIPE, text=True) as process:
            before = self.inode()
            while len(seen) < saves and process.poll() is None:
                seen |= {self.inode()} - {None, before}
                time.sleep(0.001)
            process.send_signal(number)
            return process.wait(timeout=120), process.stderr.read()

    def inode(self):
        try:
            return os.stat(self.state).st_ino, os.stat(self.state).st_mtime_ns
        except FileNotFoundError:
            return None

    def resume(self, *more, **options):
        result = subprocess.run(self.words("--restore", self.state, *more, **options),
                                capture_output=True, text=True, timeout=600)
        if result.returncode != 0:
            raise AssertionError(f"exit code {result.returncode}: {result.stderr}")
        return content(self.out)


class Resume(unittest.TestCase):
    maxDiff = 2000

    @classmethod
    def setUpClass(cls):
        cls.folder = runs.scratch()
        cls.references = {}

    def reference(self, name, scenario, *sets, duration):
        """What the uninterrupted run leaves; one run for each name."""
        if name not in self.references:
            out = os.path.join(self.folder, "reference " + name)
            runs.run(scenario, out, *sets, duration=duration, pictures=with_pictures(sets))
            self.references[name] = content(out)
        return self.references[name]

    def run_of(self, name, scenario, *sets, duration, every):
        return Interruption(scenario, os.path.join(self.folder, name), *sets, duration=duration,
                            every=every)

    def assert_same(self, found, expected):
        self.assertEqual(sorted(found), sorted(expected))
        for key in expected:
            if isinstance(expected[key], bytes):
                self.assertTrue(found[key] == expected[key], f"{key} differs")
            else:
                self.assertEqual(found[key], expected[key], key)

    def test_killed(self):
        reference = self.reference("rice", runs.TRACK, *SMALL, *RICE, duration=TRACK_S)
        self.assertGreater(len(reference["table detections"]), 50)
        self.assertLess(reference["manifest"]["summary"]["time_to_settle_s"], 10)
        # one state, between a frame (ends at 15.5 s) and its tracks, off the grid of telemetry
        run = self.run_of("killed", runs.TRACK, *SMALL, *RICE, duration=TRACK_S, every=15.57)
        run.stop(signal.SIGKILL, 1)
        self.assertTrue(os.path.exists(run.state))
        self.assert_same(run.resume(), reference)

    def test_interrupted_cube(self):
        reference = self.reference("cube", runs.TRACK, *SMALL, *CUBE, duration=TRACK_S)
        run = self.run_of("cube", runs.TRACK, *SMALL, *CUBE, duration=TRACK_S, every=7.31)
        said = run.stop(signal.SIGINT, 1, threads=2)
        self.assertRegex(said, r"boresight: interrupted at \d+\.\d+ s; --restore .*/state goes on")
        # it has completed its cube; the resumed run appends to it all the same
        with fits.open(run.out + ".partial/frames.fits") as hdus:
            self.assertIn("FRAMES", hdus)
        self.assert_same(run.resume(serial=True), reference)
        with fits.open(run.out + "/frames.fits", checksum=True) as hdus:
            self.assertEqual(len(hdus["FRAMES"].data), hdus[0].data.shape[0])

    def test_killed_and_interrupted_again_with_planes(self):
        reference = self.reference("planes", runs.TRACK, *SMALL, *PLANES, duration=TRACK_S)
        run = self.run_of("planes", runs.TRACK, *SMALL, *PLANES, duration=TRACK_S, every=2.13)
        run.stop(signal.SIGKILL, 3, serial=True)
        run.stop(signal.SIGTERM, 2, "--restore", run.state, threads=2)
        self.assertFalse(runs.manifest(run.out + ".partial")["complete"])
        self.assert_same(run.resume(), reference)

    def test_killed_before_the_first_frame(self):
        """The saved state has no file of frames; the killed run may have begun one."""
        reference = self.reference("rice", runs.TRACK, *SMALL, *RICE, duration=TRACK_S)
        run = self.run_of("early", runs.TRACK, *SMALL, *RICE, duration=TRACK_S, every=0.05)
        run.stop(signal.SIGKILL, 1)
        with open(run.state, "rb") as file:
            first = file.read()
        # goes on far beyond that state, which is put back
        run.stop(signal.SIGKILL, 1, "--restore", run.state, every=14)
        with open(run.state, "wb") as file:
            file.write(first)
        self.assertTrue(os.path.exists(run.out + ".partial/frames.fits"))
        with open(run.state + ".tmp.123456", "wb") as file:  # as a run leaves it that is killed while it saves
            file.write(first[:100])
        self.assert_same(run.resume(every=40), reference)

    def constellation(self, threads):
        sets, duration = [runs.NO_FRAMES] + ([] if KILLS else [runs.DARK]), 30
        reference = self.reference("constellation", QUICK, *sets, duration=duration)
        self.assertGreater(len(reference["table truth"]), 30)
        run = self.run_of(f"constellation {threads}", QUICK, *sets, duration=duration, every=5.35)
        run.stop(signal.SIGKILL if threads == 1 else signal.SIGINT, 2, threads=threads)
        self.assert_same(run.resume(threads=threads), reference)

    def test_constellation(self):
        self.constellation(1)

    def test_constellation_with_threads(self):
        self.constellation(2)

    @unittest.skipUnless(KILLS, "slow")
    def test_random_kills(self):
        for k in range(KILLS):
            rng = random.Random(k)
            name, sets = rng.choice([("rice", RICE), ("cube", CUBE), ("planes", PLANES)])
            reference = self.reference(name, runs.TRACK, *SMALL, *sets, duration=TRACK_S)
            run = self.run_of(f"random {k}", runs.TRACK, *SMALL, *sets, duration=TRACK_S,
                              every=rng.choice([1, 2.5, 5.95]))
            with self.subTest(k=k, form=name, every=run.every):
                run.stop(rng.choice([signal.SIGKILL, signal.SIGINT]), rng.randint(1, min(5, int(TRACK_S / run.every) - 1)),
                         threads=rng.choice([1, 2]), serial=rng.random() < 0.3)
                self.assert_same(run.resume(threads=rng.choice([1, 2]),
                                            serial=rng.random() < 0.3), reference)
            shutil.rmtree(run.out, ignore_errors=True)


class Until(unittest.TestCase):
    def test_until(self):
        folder = runs.scratch()
        until, short = os.path.join(folder, "until"), os.path.join(folder, "short")
        words = runs.command(runs.TRACK, until, *SMALL, *RAW, duration=TRACK_S)
        result = subprocess.run(words + ["--until", "12.5", "--save-every", "5"],
                                capture_output=True, text=True)
        self.assertEqual((result.returncode, result.stderr), (0, ""))
        runs.run(runs.TRACK, short, *SMALL, *RAW, duration=12.5)
        found, expected = content(until), content(short)
        self.assertEqual((found["manifest"]["complete"], found["manifest"].pop("until_s")),
                         (True, 12.5))
        del found["scenario.json"], expected["scenario.json"]  # durations
        self.assertEqual(sorted(found), sorted(expected))  # and no "state" is left
        for key in expected:
            self.assertTrue(found[key] == expected[key], key)


class State(unittest.TestCase):
    """--restore with a state that is not that of an interrupted run."""

    @classmethod
    def setUpClass(cls):
        cls.folder = runs.scratch()
        cls.state = os.path.join(cls.folder, "saved")
        cls.sets = [*SMALL, *RAW, "/record/planes=[\"saturation\"]"]
        subprocess.run([SAVE_STATE, runs.TRACK, "12.3", cls.state,
                        "/world/star_catalogue=embedded", *SMALL], check=True, timeout=120)

    def start(self, *more, scenario=runs.TRACK, sets=None, out="new", duration=20):
        return subprocess.run(runs.command(scenario, os.path.join(self.folder, out),
                                           *(self.sets if sets is None else sets),
                                           duration=duration) + list(more),
                              capture_output=True, text=True, timeout=120)

    def test_records_from_there_on(self):
        result = self.start("--restore", self.state)
        self.assertEqual((result.returncode, result.stderr), (0, ""))
        out, whole = os.path.join(self.folder, "new"), os.path.join(self.folder, "whole")
        runs.run(runs.TRACK, whole, *self.sets, duration=20)
        manifest = runs.manifest(out)
        self.assertEqual((manifest["complete"], manifest["begins_at_s"]), (True, 12.3))
        # its speed is that of the 7.7 s that it stepped
        self.assertAlmostEqual(manifest["summary"]["real_time_factor"] * manifest["wall_time_s"], 7.7, delta=1e-3)  # a tick
        self.assertEqual(manifest["last_tick"], runs.manifest(whole)["last_tick"])
        new, old = runs.database(out), runs.database(whole)
        for table, key in [("frames", "start_tick"), ("detections", "exposure_id"),
                           ("tracks", "exposure_id"), ("truth", "exposure_id"),
                           ("los_commands", "written_tick")]:
            rows = [tuple(r) for r in new.execute(f"SELECT * FROM {table}")]
            first = new.execute(f"SELECT min({key}) FROM {table}").fetchone()[0]
            again = [tuple(r) for r in old.execute(f"SELECT * FROM {table} WHERE {key} >= ?",
                                                   (first,))]
            if table == "frames":  # numbered from 1 in its own file; the first has no truth
                self.assertGreater(len(rows), 5)
                self.assertEqual(len(rows), len(again))
                rows, again = ([r[:13] for r in t] for t in (rows, again))
            self.assertEqual(rows, again, table)
        new.close()
        old.close()
        with fits.open(out + "/frames.fits") as part, fits.open(whole + "/frames.fits") as all_:
            for hdu, same in zip(part[1:], all_[1 + len(all_) - len(part):]):
                self.assertTrue((hdu.data == same.data).all())

    def refused(self, said, *more, **options):
        result = self.start(*more, out="refused", **options)
        self.assertNotEqual(result.returncode, 0)
        self.assertRegex(result.stderr, said)
        left = [n for n in os.listdir(self.folder) if n.startswith("refused")]
        self.assertEqual(left, [])

    def test_messages(self):
        with open(self.state, "rb") as file:
            whole = file.read()
        bad = os.path.join(self.folder, "bad")

        def spoiled(content_):
            with open(bad, "wb") as file:
                file.write(content_)
            return ("--restore", bad)

        restore = ("--restore", self.state)
        flipped = bytearray(whole)
        flipped[len(whole) // 2] ^= 4
        self.refused("bad: the saved state is damaged: its checksum", *spoiled(flipped))
        self.refused("bad: the saved state is cut", *spoiled(whole[:-100]))
        self.refused("bad: this is no saved state", *spoiled(b"no state"))
        self.refused("No such file", "--restore", bad + "?")
        self.refused("another scenario, or of other overrides", *restore, sets=[])
        self.refused("another scenario", *restore, scenario=runs.STARE)
        self.refused("is that of run 0 .* give --run-number 0", *restore, "--run-number", "3")
        self.refused("is at 12.3 s, the scenario ends at 10 s", *restore, duration=10)
        self.refused(r"--until 5: allowed is more than 12.3 s", *restore, "--until", "5")
        self.refused("--until 21: allowed is .* up to 20 s", "--until", "21")
        self.refused("--save-every: a time of 1e-05 s is no whole number", "--save-every",
                     "0.00001")
        self.refused("--save-every: a run that follows the clock is not saved", "--save-every",
                     "5", "--pacing", "realtime")
        self.refused("--restore: a replay begins at the start", *restore, "--replay", self.folder)
        self.refused("--save-every.*another program plays .*/control", "--save-every", "5",
                     "--external", "control", "--link", f"ipc://{self.folder}/peers")

    def test_state_of_a_recording_needs_its_folder(self):
        run = Interruption(runs.TRACK, os.path.join(self.folder, "recorded"), *SMALL, *RAW,
                           duration=TRACK_S, every=2)
        run.stop(signal.SIGKILL, 1)
        elsewhere = os.path.join(self.folder, "elsewhere")
        shutil.copy(run.state, elsewhere)
        for given in (elsewhere, run.state):
            self.refused(r"goes on in that run's own folder: .*refused\.partial/state",
                         "--restore", given, sets=[*SMALL, *RAW], duration=TRACK_S)
        for sets, said in [([*SMALL, *CUBE], "/record is not that of the interrupted run")]:
            result = self.start("--restore", run.state, sets=sets, out="recorded",
                                duration=TRACK_S)
            self.assertEqual(result.returncode, 1)
            self.assertIn(said, result.stderr)
        # tables of less than was saved
        db = runs.sqlite3.connect(run.out + ".partial/run.sqlite")
        db.execute("DELETE FROM control")
        db.commit()
        db.close()
        result = self.start("--restore", run.state, sets=[*SMALL, *RAW], out="recorded",
                            duration=TRACK_S)
        self.assertEqual(result.returncode, 1)
        self.assertRegex(result.stderr, "table control has 0 rows, the saved state needs [0-9]+")
        os.remove(run.out + ".partial/run.sqlite")
        result = self.start("--restore", run.state, sets=[*SMALL, *RAW], out="recorded",
                            duration=TRACK_S)
        self.assertEqual(result.returncode, 1)
        self.assertRegex(result.stderr, "run.sqlite: cannot be opened")


def tearDownModule():
    runs.clean()


if __name__ == "__main__":
    unittest.main()
