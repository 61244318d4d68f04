#!/usr/bin/env python3
"""`boresight export --frames mp4`: how the encoder is fed, how large a film is, and what goes wrong.

Usage, from the repository root: /usr/bin/python3 tests/e2e/test_film.py BORESIGHT
"""
import os
import shutil
import struct
import sys
import unittest

import runs
from runs import call, export
from readers import read_boxes


class Film(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = runs.scratch()
        cls.made = os.path.join(cls.folder, "run")
        runs.run(runs.TRACK, cls.made, duration=28)
        cls.database = runs.database(cls.made)

    def out(self):
        return os.path.join(runs.scratch(), "out")

    FAKE = """#!{python}
import os, sys
words = sys.argv[1:]
if "-encoders" in words:
    print(" V....D {encoder}              some encoder")
    sys.exit(0)
if {broken}:
    sys.stdin.buffer.read(1000)
    sys.stderr.write("no room on the moon\\n")
    sys.exit(1)
data = sys.stdin.buffer.read()
assert words[-1].startswith("file:"), words
with open(words[-1][5:], "wb") as file:
    file.write(repr((words, len(data), data[:3])).encode())
"""

    def with_fake(self, out, encoder="libx264", broken=False, rate="12.5"):
        """Exports a film with a program in ffmpeg's place."""
        folder = runs.scratch()
        path = os.path.join(folder, "ffmpeg")
        with open(path, "w", encoding="ascii") as file:
            file.write(self.FAKE.format(python=sys.executable, encoder=encoder, broken=broken))
        os.chmod(path, 0o755)
        return call("export", self.made, "--frames", "mp4", "--size", "101", "--fps", rate,
                    "--last", "6", "--out", out, env={**os.environ, "PATH": folder})

    def test_film_is_fed_rightly(self):
        for encoder, expected in (("libx264", "libx264"), ("libfoo", "mpeg4")):
            out = self.out()
            result = self.with_fake(out, encoder)
            self.assertEqual((result.returncode, result.stderr), (0, ""))
            self.assertEqual(os.listdir(out), ["frames.mp4"])
            with open(out + "/frames.mp4", encoding="ascii") as file:
                words, size, first = eval(file.read())  # what the program above wrote
            self.assertEqual(size, 7 * 3 * 101 * 101)
            self.assertEqual(len(set(first)), 1)  # grey
            after = dict(zip(words, words[1:]))
            self.assertEqual((after["-video_size"], after["-framerate"], after["-c:v"],
                              after["-pixel_format"]), ("101x101", "12.5", expected, "bgr24"))

    def test_film_is_bounded(self):
        """By the encoder's buffer model: the rate times the film's length, and the buffer once."""
        for encoder in ("libx264", "libfoo"):
            for rate in ("0.5", "12.5", "240"):
                out = self.out()
                result = self.with_fake(out, encoder, rate=rate)
                self.assertEqual((result.returncode, result.stderr), (0, ""))
                with open(out + "/frames.mp4", encoding="ascii") as file:
                    words = eval(file.read())[0]
                after = dict(zip(words, words[1:]))
                longest = max(1.0, 1.0 / float(rate))  # of a second and a frame
                bits = float(after["-maxrate"]) * longest + float(after["-bufsize"])
                self.assertLessEqual(bits, 8e6 * longest)

    @unittest.skipUnless(shutil.which("ffmpeg"), "needs ffmpeg")
    def test_film_of_noise_is_small(self):
        out = self.out()
        export(self.made, "--frames", "mp4", "--annotate", "--stretch", "frame", "--out", out)
        frames = len(list(self.database.execute("SELECT 1 FROM frames")))
        self.assertLess(os.path.getsize(out + "/frames.mp4"), 1e6 * frames / 10)

    def test_film_that_fails(self):
        out = self.out()
        result = self.with_fake(out, broken=True)
        self.assertEqual((result.returncode, result.stderr),
                         (1, f"boresight: {out}/frames.mp4: ffmpeg failed (exit code 1): no room on "
                             "the moon\n"))
        self.assertEqual(os.listdir(out), [])

    def test_no_ffmpeg(self):
        out, empty = self.out(), runs.scratch()
        result = call("export", self.made, "--frames", "mp4", "--out", out,
                      env={**os.environ, "PATH": empty})
        self.assertEqual((result.returncode, result.stderr),
                         (1, "boresight: mp4 needs the program ffmpeg, which cannot be run; install "
                             "it (Debian: apt-get install ffmpeg) or export png\n"))
        self.assertEqual(os.listdir(out), [])

    @unittest.skipUnless(shutil.which("ffmpeg"), "needs ffmpeg")
    def test_film(self):
        out = self.out()
        export(self.made, "--frames", "mp4", "--size", "101", "--last", "6", "--out", out)
        with open(out + "/frames.mp4", "rb") as file:
            boxes = read_boxes(file.read())
        self.assertEqual(list(boxes)[:2], ["ftyp", "moov"])  # plays while it loads
        self.assertGreater(len(boxes["mdat"]), 1000)
        moov = boxes["moov"]
        at = moov.index(b"tkhd") + 4
        width, height = struct.unpack(">II", moov[at + 76:at + 84])
        self.assertEqual((width >> 16, height >> 16), (102, 102))  # made even
        at = moov.index(b"stsz") + 4
        self.assertEqual(struct.unpack(">I", moov[at + 8:at + 12])[0], 7)  # frames


def tearDownModule():
    runs.clean()


if __name__ == "__main__":
    unittest.main()
