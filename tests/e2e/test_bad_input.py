#!/usr/bin/env python3
"""Bad input at the command line: exit code 1, one line that names the file, and soon.

What each reader says by content is tested in tests/bad_input; this is about what reaches the user.

Usage, from the repository root: /usr/bin/python3 tests/e2e/test_bad_input.py BORESIGHT [--full]
"""
import glob
import os
import subprocess
import sys
import tempfile
import unittest

import runs

FULL = "--full" in sys.argv and not sys.argv.remove("--full")
# where PoCL keeps the kernels that other tests compiled (its own rule)
KERNELS = os.environ.get("POCL_CACHE_DIR") or os.path.join(
    os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache"), "pocl", "kcache")
SECONDS = 30  # a reader that waits for a pipe or reads a device to its end would take for ever
GOES = ("1 10061U 77048A   22166.94040701  .00000081  00000+0  00000+0 0  9993\n"
        "2 10061   9.8539 307.1213 0011382  31.5637 332.0402  0.99393421 31740\n")
SPAN = ("--start", "2022-06-16T00:00:00Z", "--stop", "2022-06-16T00:01:00Z", "--step", "60")


def set_to(path, key):
    return "check", runs.STARE, "--quiet", "--set", f"{key}={path}"


# an output that nothing is ever written to: every reader refuses its file before
NEVER = os.path.join(tempfile.gettempdir(), f"boresight-never-{os.getpid()}")

# how to hand each reader a file
READERS = {
    "scenario of check": lambda path: ("check", path),
    "scenario of run": lambda path: ("run", path, "--out", NEVER),
    "element sets": lambda path: ("propagate", "--tle", path, *SPAN),
    "element sets in a scenario":
        lambda path: set_to(path, "/world/objects/0/orbit/elements_file"),
    "Earth orientation":
        lambda path: ("propagate", "--tle", "scenarios/catalogue_2022-06.tle", "--frame", "gcrf",
                      "--eop", path, *SPAN),
    "Earth orientation in a scenario": lambda path: set_to(path, "/world/earth_orientation"),
    "star catalogue": lambda path: ("stars", "info", path),
    "star catalogue in a scenario": lambda path: set_to(path, "/world/star_catalogue"),
    "star import": lambda path: ("stars", "import", path, "--out", NEVER),
    "star subset": lambda path: ("stars", "import", "none.tar.xz", "--out", NEVER,
                                 "--subset", path),
    "calibration map":
        lambda path: set_to(path, runs.SENSOR + "/modules/imgproc/dark_file"),
}


class BadInput(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        folder = cls.folder = runs.scratch()

        def write(name, content):
            with open(os.path.join(folder, name), "wb") as file:
                file.write(content)

        write("empty", b"")
        write("garbage", b"\x00\x01\xfe\xff" * 1000)
        write("html", b"<!DOCTYPE html>\n<html><body>404</body></html>\n")
        write("utf16", "\ufeff{\"boresight\": 1}\n".encode("utf-16-le"))
        write("text_after_zero", b"\0" + GOES.encode())
        write("deep", b"[" * 10000)
        with open(os.path.join(folder, "hole"), "wb") as file:
            file.truncate(5 << 30)
        os.mkdir(os.path.join(folder, "folder"))
        os.mkfifo(os.path.join(folder, "pipe"))
        os.symlink("loop", os.path.join(folder, "loop"))
        os.symlink("nowhere", os.path.join(folder, "dangling"))

    def call(self, *words, **environment):
        return runs.call(*words, timeout=SECONDS, stdin=subprocess.DEVNULL,
                         env={**os.environ, **environment})

    def refused(self, result, name):
        self.assertEqual(result.returncode, 1, result.stderr)
        self.assertEqual(result.stdout, "")
        self.assertRegex(result.stderr, r"\Aboresight[ a-z]*: [^\n]+\n\Z")
        self.assertIn(name, result.stderr)

    def test_every_reader(self):
        names = ["missing", "hole", "folder", "pipe", "loop", "dangling"]
        contents = ["empty", "garbage", "html", "utf16", "text_after_zero", "deep"]
        jobs = []
        for k, reader in enumerate(READERS):  # of contents two each, in turn; with --full all of them
            mine = names + (contents if FULL else [contents[k % 6], contents[(k + 3) % 6]])
            jobs += [(reader, path) for path in [os.path.join(self.folder, name) for name in mine] + ["/dev/zero", "/dev/null"]]
        results = runs.parallel(lambda job: self.call(*READERS[job[0]](job[1])), jobs)
        for (reader, path), result in zip(jobs, results):
            with self.subTest(reader=reader, path=path):
                self.refused(result, path)
                if reader == "star import" and path.endswith("hole"):  # read to its end, it takes ten seconds
                    self.assertIn("a zero byte: the file is not text", result.stderr)
        self.assertFalse(os.path.exists(NEVER))

    def test_output_that_cannot_be_written(self):
        result = self.call("propagate", "--tle", "scenarios/catalogue_2022-06.tle", *SPAN,
                           "--output", os.path.join(self.folder, "folder"))
        self.assertEqual((result.returncode, result.stdout), (2, ""))
        self.assertIn("folder: is a folder; give the name of a file in it", result.stderr)

    def test_kernel_cache_that_cannot_be_written(self):
        result = self.call("run", runs.STARE, "--quiet", "--duration", "1", "--out",
                           os.path.join(self.folder, "run"), "--set",
                           "/world/star_catalogue=embedded", POCL_CACHE_DIR="/dev/null/kcache")
        if result.returncode == 0:
            self.skipTest("there is another OpenCL device than PoCL's")
        self.refused(result, "/dev/null/kcache")
        self.assertIn("set POCL_CACHE_DIR to a folder that can be written", result.stderr)

    def test_damaged_kernels_are_built_anew(self):
        """PoCL aborts for a cached kernel that is cut; and what others may write is not loaded. A
        small stack (ulimit -s) is enough, also for the compiler of OpenCL, which takes the most: with
        --full for all kernels, else for those of nodes."""
        cache = os.path.join(runs.scratch(), "kcache")
        os.mkdir(cache, 0o700)
        if not FULL:  # what is being written there may be gone before it is copied
            subprocess.run(["cp", "-r", *glob.glob(KERNELS + "/[A-Z]*"), cache], check=False, stderr=subprocess.DEVNULL)

        def run():
            words = [runs.BORESIGHT, "run", runs.STARE, "--quiet", "--no-pictures", "--duration", "1", "--out",
                     os.path.join(runs.scratch(), "run"), "--set", runs.NO_FRAMES, "--set",
                     "/world/star_catalogue=embedded"]
            return subprocess.run(["sh", "-c", 'ulimit -s 64; exec "$@"', "sh", *words],
                                  capture_output=True, text=True, timeout=4 * SECONDS,
                                  stdin=subprocess.DEVNULL,
                                  env={**os.environ, "POCL_CACHE_DIR": cache})
        self.assertEqual(run().returncode, 0)
        cut = 0
        for folder, _, names in os.walk(cache):
            for name in names:
                if name == "bst_scene_nodes.so":  # one that takes a second to build, not the frame's
                    os.truncate(os.path.join(folder, name), 1000)
                    cut += 1
        if cut == 0:
            self.skipTest("there is another OpenCL device than PoCL's")
        result = run()
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertIn("removed, to be built anew", result.stderr)
        os.chmod(cache, 0o777)
        self.refused(run(), "can be written to by others")


def tearDownModule():
    runs.clean()


if __name__ == "__main__":
    unittest.main()
