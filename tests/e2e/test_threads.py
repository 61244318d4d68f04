#!/usr/bin/env python3
"""An open loop, a closed loop and constellations without and with images give the same bytes on any number of threads.

Usage, from the repository root: /usr/bin/python3 tests/e2e/test_threads.py BORESIGHT [--full]
--full: longer runs on more numbers of threads; else on eight.
"""
import glob
import hashlib
import os
import sys
import unittest

from astropy.io import fits

import runs

WIDE = [f"/observers/{i}/sensors/0/camera/pixel_scale_arcsec=6" for i in range(5)]
SMALL = [f"/observers/{i}/sensors/0/camera/{side}_px=512" for i in range(5) for side in ("width", "height")]
FULL = "--full" in sys.argv and not sys.argv.remove("--full")
# the long form has the Earth's light too
DARK = [] if FULL else [runs.DARK]
# more than there are of sensors too
THREADS = (1, 2, 3, 8) if FULL else (8,)
JOBS = {  # name: scenario, seconds (in full), settings
    "open": (runs.RATE_OPEN, 3, 8, ["/record/frames=cube"]),
    "closed": (runs.TRACK, 5, 10, ["/record/frames=extensions"]),
    "generator": ("scenarios/constellation_quick.json", 25, 60, WIDE + DARK),
    "images": ("scenarios/constellation_images.json", 3, 6, WIDE + SMALL + DARK),
}


def content(out):
    """A digest of each table and of each file of frames, whose headers hold no wall time."""
    db = runs.database(out)
    names = [row[0] for row in db.execute("SELECT name FROM sqlite_master WHERE type = 'table' ORDER BY name")]
    found = {}
    for name in names:
        rows = [tuple(row) for row in db.execute(f'SELECT * FROM "{name}" ORDER BY rowid')]
        found[name] = (len(rows), hashlib.sha256(repr(rows).encode()).hexdigest())
    for path in sorted(glob.glob(out + "/**/*.fits", recursive=True)):
        with fits.open(path) as hdus:
            total = hashlib.sha256()
            for hdu in hdus:
                total.update(repr(hdu.header).encode())
                total.update(b"" if hdu.data is None else hdu.data.tobytes())
            found[os.path.relpath(path, out)] = (len(hdus), total.hexdigest())
    return found


class Threads(unittest.TestCase):
    def check(self, name):
        scenario, short, long, sets = JOBS[name]
        duration = long if FULL else short
        folder = runs.scratch()

        def one(threads):
            out = os.path.join(folder, str(threads))
            manifest = runs.run(scenario, out, *sets, duration=duration, threads=max(threads, 1), serial=threads == 0)
            return content(out), manifest["counters"], manifest["last_tick"]
        serial = one(0)
        self.assertGreater(sum(count for count, _ in serial[0].values()), 100)
        for threads in THREADS:
            with self.subTest(threads=threads):
                self.assertEqual(one(threads), serial)

    # else test_repeat.py has both on eight threads
    @unittest.skipUnless(FULL, "slow")
    def test_open_loop(self):
        self.check("open")

    @unittest.skipUnless(FULL, "slow")
    def test_closed_loop(self):
        self.check("closed")

    def test_constellation(self):
        self.check("generator")

    def test_constellation_with_images(self):
        self.check("images")


def tearDownModule():
    runs.clean()


if __name__ == "__main__":
    unittest.main()
