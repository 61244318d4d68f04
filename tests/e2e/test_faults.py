#!/usr/bin/env python3
"""What goes wrong around a run: disks that are full, folders that are in the way, inputs that
vanish. Every fault is an error that names file and reason; nothing that was recorded is lost.

Usage, from the repository root:
  /usr/bin/python3 tests/e2e/test_faults.py BORESIGHT [number of full disks, default 4]
"""
import errno
import json
import os
import re
import random
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import unittest
from collections import Counter

import leftovers
import runs

FAULTS = int(sys.argv.pop(1)) if len(sys.argv) > 1 and sys.argv[1].isdigit() else 4
SIDE = 1024 if FAULTS > 4 else 512  # px
SMALL = [f"{runs.SENSOR}/camera/{side}_px={SIDE}" for side in ("width", "height")]
FORMS = {
    "extensions": ["/record/frames=extensions", "/record/compression=none", *SMALL],
    "rice": ["/record/frames=extensions", "/record/compression=rice", *SMALL],
    "cube": ["/record/frames=cube", *SMALL],
    "none": ["/record/frames=none", "/record/telemetry_hz=500", *SMALL],
}
DURATION_S = 12
# of runs that go on until something ends them: the processor is left to others
PACED = ["--pacing", "realtime", "--set", "/pacing/speed=4"]
FRAME_BYTES = 2 * SIDE ** 2
TOO_LARGE, NO_SPACE = os.strerror(errno.EFBIG), os.strerror(errno.ENOSPC)


def call(scenario, out, form="extensions", duration=DURATION_S, sets=(), **options):
    return subprocess.run(runs.command(scenario, out, *FORMS[form], *sets, duration=duration),
                          capture_output=True, text=True, timeout=300, **options)


def on_a_small_disk(size, words):
    """Runs the program in a name space of its own where the folder `disk` is a disk of `size`
    bytes, and copies what is left to the folder `left` once the disk is read there."""
    disk, left = tempfile.mkdtemp(dir=Faults.folder), tempfile.mkdtemp(dir=Faults.folder)
    script = ('mount -t tmpfs -o size=$SIZE none "$DISK" && "$@"; code=$?; '
              # a disk that is full is read where it is, too
              'for f in "$DISK"/*/run.sqlite; do [ -e "$f" ] && '
              '{ /usr/bin/python3 -c "import sqlite3, sys; '
              'print(sqlite3.connect(sys.argv[1]).execute(\'PRAGMA integrity_check\').fetchall())" '
              '"$f" || code=99; }; done; cp -r "$DISK"/. "$LEFT"; exit $code')
    result = subprocess.run(
        ["unshare", "-rm", "sh", "-c", script, "sh",
         *[word.replace("@DISK@", disk) for word in words]],
        env={**os.environ, "SIZE": str(size), "DISK": disk, "LEFT": left}, capture_output=True,
        text=True, timeout=300)
    return result, disk, left


def small_disks_work():
    try:
        with tempfile.TemporaryDirectory() as folder:
            return subprocess.run(["unshare", "-rm", "mount", "-t", "tmpfs", "none", folder],
                                  capture_output=True, timeout=20).returncode == 0
    except OSError:
        return False


def drawing(pid):
    """Whether a program has loaded the kernel that draws frames."""
    try:
        with open(f"/proc/{pid}/maps", encoding="utf-8") as file:
            return "bst_scene_frame" in file.read()
    except OSError:
        return False


class Faults(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = runs.scratch()
        cls.reference, cls.size, cls.largest = {}, {}, {}

        def reference(form):
            out = os.path.join(cls.folder, f"reference {form}")
            runs.run(runs.TRACK, out, *FORMS[form], duration=DURATION_S, pictures=True)
            path = os.path.join(out, "frames.fits")
            cls.reference[form] = leftovers.frames_in(path) if os.path.exists(path) else []
            sizes = [os.path.getsize(os.path.join(out, name)) for name in os.listdir(out)]
            cls.size[form], cls.largest[form] = sum(sizes), max(sizes)
        runs.parallel(reference, FORMS)

    def out(self, name):
        return os.path.join(self.folder, name)

    def call_limited(self, out, form, limit, duration=DURATION_S):
        """Runs the program; the limit holds from when its first frames are on their way, because
        OpenCL compiles to files until then."""
        words = runs.command(runs.TRACK, out, *FORMS[form], duration=duration, pictures=True)
        first = out + (".partial/run.sqlite" if form == "none" else ".partial/frames.fits")
        with subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                              text=True) as process:
            while not (os.path.exists(first) and drawing(process.pid)) and process.poll() is None:
                time.sleep(0.01)
            time.sleep(0.1)
            if process.poll() is None:
                resource.prlimit(process.pid, resource.RLIMIT_FSIZE, (limit, limit))
            said = process.communicate(timeout=120)
            return subprocess.CompletedProcess(words, process.returncode, *said)

    def limited(self, k):
        """A limit on the size of any file: every write beyond it fails."""
        rng = random.Random(k)
        form = list(FORMS)[k % 4]
        limit = int(rng.uniform(0, 1.02) * self.largest[form])
        out = self.out(f"limited {k}")
        result = self.call_limited(out, form, limit)
        where, frames, _ = leftovers.check(out, self.reference[form], DURATION_S) \
            if form != "none" else self.without_frames(out)
        if result.returncode == 0:
            self.assertEqual(where, "complete")
        else:
            self.assertEqual(result.returncode, 1, result.stderr)
            self.assertNotEqual(where, "complete")
            self.assertIn(out + ".partial", result.stderr)
            self.assertIn(TOO_LARGE, result.stderr)
            if "frames.fits" in result.stderr and form != "rice":
                # every frame that there was room for is kept
                self.assertLess(limit - os.path.getsize(
                    os.path.join(out + ".partial", "frames.fits")) if frames else 0,
                    FRAME_BYTES + 30000)
        for left in (out, out + ".partial"):
            shutil.rmtree(left, ignore_errors=True)
        return where, result.stderr.split(": ")[1].split("/")[-1] if result.stderr else "-"

    def without_frames(self, out):
        for where, left in (("complete", out), ("partial", out + ".partial")):
            path = os.path.join(left, "run.sqlite")
            if os.path.exists(path):
                leftovers.rows_in(path)
                return where, 0, 0
        return ("partial" if os.path.exists(out + ".partial") else "nothing"), 0, 0

    def test_limited_files(self):
        said = runs.parallel(self.limited, range(FAULTS))
        print(f"{FAULTS} limits on the size of files; left and file named: {dict(Counter(said))}")
        self.assertTrue(any(where == "partial" for where, _ in said))

    def full(self, k):
        rng = random.Random(1000 + k)
        form = list(FORMS)[k % 4]
        size = int(rng.uniform(0, 1.02) * self.size[form]) // 4096 * 4096 + 4096 \
            if k % 8 else 4096 * (k + 1)
        words = runs.command(runs.TRACK, "@DISK@/run", *FORMS[form], duration=DURATION_S, pictures=True)
        result, disk, left = on_a_small_disk(size, words)
        out = os.path.join(left, "run")
        where, frames, _ = leftovers.check(out, self.reference[form], DURATION_S) \
            if form != "none" else self.without_frames(out)
        if result.returncode == 0:
            self.assertEqual(where, "complete")
        else:
            self.assertEqual(result.returncode, 1, result.stderr)
            self.assertNotEqual(where, "complete")
            self.assertIn(disk + "/run.partial", result.stderr)
            self.assertRegex(result.stderr, f"{NO_SPACE}|database or disk is full")
        shutil.rmtree(left)
        named = [word for word in result.stderr.split(": ") if disk in word]
        return where, named[0].split("/")[-1] if named else "-"

    @unittest.skipUnless(small_disks_work(), "no right to mount a file system here")
    def test_full_disks(self):
        said = runs.parallel(self.full, range(FAULTS))
        print(f"{FAULTS} small disks; left and file named: {dict(Counter(said))}")
        self.assertTrue(any(where == "partial" for where, _ in said))

    def fails(self, result, message):
        self.assertEqual(result.returncode, 1, result.stderr)
        self.assertEqual(result.stderr, f"boresight: {message}\n")
        self.assertEqual(result.stdout, "")

    def tree(self, folder):
        return {os.path.join(at, name): os.lstat(os.path.join(at, name)).st_mtime_ns
                for at, _, names in os.walk(folder) for name in names}

    def called_wrongly(self, result, message):
        self.assertEqual(result.returncode, 2, result.stderr)
        self.assertIn(message, result.stderr)

    def test_folder_in_the_way(self):
        out = self.out("taken")
        runs.run(runs.TRACK, out, duration=1)
        before = self.tree(out)
        exists = (f"{out}: exists already; choose another output folder, remove it, or overwrite "
                  "it (--overwrite)")
        self.fails(call(runs.TRACK, out, duration=1), exists)
        self.assertEqual(self.tree(out), before)
        with open(self.out("file"), "w", encoding="ascii"):
            pass
        self.called_wrongly(call(runs.TRACK, self.out("file"), duration=1),
                            "Not a directory; give the name of a folder")
        # a link that leads round in a circle, a folder of someone else's
        for name, make in (("loop", lambda p: os.symlink(p, p)),
                           ("photos", lambda p: (os.mkdir(p), open(p + "/a.jpg", "w").close()))):
            path = self.out(name)
            make(path)
            self.fails(call(runs.TRACK, path, duration=1), exists.replace(out, path))
            words = runs.command(runs.TRACK, path, duration=1) + ["--overwrite"]
            self.fails(subprocess.run(words, capture_output=True, text=True, timeout=60),
                       f"{path}: is not the folder of a run, so it is not overwritten; choose "
                       "another output folder")
            self.assertTrue(os.path.lexists(path))
        self.assertTrue(os.path.exists(self.out("photos/a.jpg")))
        self.called_wrongly(call(runs.TRACK, self.out("file/run"), duration=1),
                            f"{self.out('file')}: {os.strerror(errno.ENOTDIR)}")
        self.called_wrongly(call(runs.TRACK, self.out("loop/run"), duration=1),
                            f"{self.out('loop')}: {os.strerror(errno.ELOOP)}")
        # what is not a run's is not removed from the place of an unfinished one either
        os.mkdir(self.out("mine.partial"))
        open(self.out("mine.partial/notes.txt"), "w").close()
        self.fails(call(runs.TRACK, self.out("mine"), duration=1),
                   f"{self.out('mine.partial')}: is in the way and does not look like an "
                   "unfinished run; move it or choose another output folder")
        self.assertEqual(os.listdir(self.out("mine.partial")), ["notes.txt"])

    def test_living_run_is_left_alone(self):
        out = self.out("living")
        with subprocess.Popen(runs.command(runs.TRACK, out, *FORMS["extensions"], duration=3000) + PACED,
                              stderr=subprocess.DEVNULL) as process:
            while not os.path.exists(out + ".partial/frames.fits"):
                time.sleep(0.01)
            self.fails(call(runs.TRACK, out, duration=1),
                       f"{out}.partial: another run is writing it; choose another output folder "
                       "or wait")
            process.send_signal(signal.SIGINT)
            self.assertEqual(process.wait(timeout=60), 130)
        self.assertEqual(leftovers.check(out, self.reference["extensions"], 3000)[0], "partial")
        # the same place again: what was left is replaced, and that is said
        result = call(runs.TRACK, out, duration=1)
        self.assertEqual((result.returncode, result.stderr),
                         (0, f"boresight: warning: {out}.partial: replacing what an unfinished "
                             "run left\n"))

    def test_folder_goes_while_the_run_writes(self):
        for form in FORMS if FAULTS > 4 else ("rice", "none"):
            out = self.out(f"going {form}")
            with subprocess.Popen(runs.command(runs.TRACK, out, *FORMS[form], duration=3000) + PACED,
                                  stderr=subprocess.PIPE, text=True) as process:
                while not os.path.exists(out + ".partial/run.sqlite"):
                    time.sleep(0.01)
                time.sleep(0.5)
                os.rename(out + ".partial", out + " moved")
                # noticed with the next commit, 2 s later
                self.assertEqual(process.wait(timeout=60), 1)
                self.assertEqual(process.stderr.read(),
                                 f"boresight: {out}.partial: the folder was removed, moved or "
                                 "replaced while the run was writing it\n")
            self.assertFalse(os.path.exists(out))
            os.rename(out + " moved", out + ".partial")
            if form != "none":
                leftovers.check(out, self.reference[form], 3000)

    @unittest.skipIf(os.geteuid() == 0 and not small_disks_work(), "root may write everywhere")
    def test_folder_that_may_not_be_written(self):
        place = self.out("locked")
        os.mkdir(place)
        words = runs.command(runs.TRACK, place + "/run", duration=1)
        if os.geteuid() != 0:
            os.chmod(place, 0o500)
            result = subprocess.run(words, capture_output=True, text=True, timeout=60)
            reason = os.strerror(errno.EACCES)
        else:
            result = subprocess.run(
                ["unshare", "-rm", "sh", "-c", 'mount -t tmpfs -o ro none "$0" && "$@"', place,
                 *words], capture_output=True, text=True, timeout=60)
            reason = os.strerror(errno.EROFS)
        self.called_wrongly(result, f"{place} cannot be written to: {reason}")
        os.chmod(place, 0o700)
        self.assertEqual(os.listdir(place), [])

    def test_input_that_vanished(self):
        """Each file of a scenario is there when it is checked and gone when it is run."""
        place = self.out("inputs")
        os.mkdir(place)
        scenario = os.path.join(place, "scenario.json")
        shutil.copy(runs.TRACK, scenario)
        tle = shutil.copy("scenarios/catalogue_2022-06.tle", place)
        shutil.copytree("scenarios/calibration", place + "/calibration")
        out = self.out("inputs run")
        check = [runs.BORESIGHT, "check", scenario, "--quiet", "--set",
                 "/world/star_catalogue=embedded"]
        self.assertEqual(subprocess.run(check, timeout=60).returncode, 0)
        os.remove(tle)
        result = call(scenario, out, duration=1)
        self.assertEqual(result.returncode, 1)
        self.assertRegex(result.stderr, rf"^boresight: {scenario}: /world/objects/0/orbit/elements_file:"
                         rf" .*catalogue_2022-06\.tle: .*{os.strerror(errno.ENOENT)}")
        shutil.copy("scenarios/catalogue_2022-06.tle", place)
        stars = os.path.join(place, "none.stars")
        result = subprocess.run(
            runs.command(scenario, out, duration=1) + ["--set", f"/world/star_catalogue={stars}"],
            capture_output=True, text=True, timeout=60)
        self.assertEqual(result.returncode, 1)
        self.assertRegex(result.stderr, rf"^boresight: .*{stars}: .*{os.strerror(errno.ENOENT)}")
        os.remove(scenario)
        result = call(scenario, out, duration=1)
        self.assertEqual(result.returncode, 1)
        self.assertRegex(result.stderr, rf"^boresight: {scenario}: .*{os.strerror(errno.ENOENT)}")
        self.assertFalse(os.path.exists(out) or os.path.exists(out + ".partial"))

    def test_disk_that_looks_too_small(self):
        out = self.out("large")
        # a stare has no passes to predict, which would take most of the time
        command = runs.command(runs.STARE, out, duration=150_000_000)
        words = (rf"{out}: the frames will take about 314572\.8 GB and "
                 r"[0-9.]+ GB are free there; shorten the run")
        refused = subprocess.run(command, capture_output=True, text=True, timeout=600)
        self.assertEqual(refused.returncode, 1)
        self.assertRegex(refused.stderr, words)
        self.assertFalse(os.path.exists(out + ".partial"))
        with subprocess.Popen(command + ["--force"], stderr=subprocess.PIPE, text=True) as process:
            while not os.path.exists(out + ".partial/frames.fits") and process.poll() is None:
                time.sleep(0.01)
            process.send_signal(signal.SIGINT)
            said = process.stderr.read()
        free = shutil.disk_usage(self.folder).free
        self.assertRegex(said, "warning: " + words)
        # other programs write here too
        reported = float(re.search(r"and ([0-9.]+) GB are free", said)[1])
        self.assertAlmostEqual(reported, free / 1e9, delta=max(5.0, 0.2 * reported))

    def test_manifest_tells_why(self):
        out = self.out("why")
        result = self.call_limited(out, "extensions", 8 * FRAME_BYTES, duration=3000)
        self.assertEqual(result.returncode, 1)
        manifest = runs.manifest(out + ".partial")
        self.assertEqual((manifest["complete"], manifest["ended"]), (False, "failed"))
        self.assertEqual(f"boresight: {manifest['error']}\n", result.stderr)
        self.assertEqual(manifest["error"],
                         f"{out}.partial/frames.fits: cannot be written: {TOO_LARGE}")
        with open(os.path.join(out + ".partial", "scenario.json"), encoding="utf-8") as file:
            self.assertEqual(json.load(file)["name"], "neossat_geo_track")


def tearDownModule():
    runs.clean()


if __name__ == "__main__":
    unittest.main()
