"""`boresight calframes` from outside: bias, dark and flat frames give back what the detector was given
to be, and the maps made of them serve the main job on a sensor with fixed patterns and hits.

Usage, from the repository root: /usr/bin/python3 tests/e2e/test_calframes.py BORESIGHT
"""
import os
import subprocess
import unittest

import numpy as np
from astropy.io import fits
from astropy.time import Time

import runs

CAMERA = runs.SENSOR + "/camera"
DETECTOR = CAMERA + "/detector"
PATTERNS = [DETECTOR + "/prnu_rms=0.02", DETECTOR + "/dsnu_rms=0.3",
            DETECTOR + "/hot_fraction=0.001", DETECTOR + "/hot_median_e_per_s=300",
            DETECTOR + "/column_offset_rms_e=3", CAMERA + "/dark_current_e_per_s=2"]
HITS = DETECTOR + "/cosmic_rays/rate_per_cm2_s="


class Calframes(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = runs.scratch()
        words = [runs.BORESIGHT, "calframes", runs.TRACK, "--out", cls.folder, "--bias", "12",
                 "--dark", "12", "--flat", "12", "--exposure", "20", "--level", "40000"]
        # hardly a hit in a year: the kernels of the main job below, compiled once
        for one in PATTERNS + [HITS + "1e-9"]:
            words += ["--set", one]
        cls.result = subprocess.run(words, capture_output=True, text=True, timeout=1800)
        cls.stacks, cls.headers = {}, {}
        for kind in ("bias", "dark", "flat"):
            with fits.open(os.path.join(cls.folder, f"neossat_telescope_{kind}.fits")) as hdus:
                cls.headers[kind] = hdus[1].header
                cls.gain = hdus[1].header["GAIN"]
                cls.stacks[kind] = np.stack([hdu.data.astype(float) for hdu in hdus[1:]])
        mean = {kind: stack.mean(0) for kind, stack in cls.stacks.items()}
        cls.bias = mean["bias"]
        cls.dark = (mean["dark"] - mean["bias"]) * cls.gain
        cls.flat = (mean["flat"] - mean["dark"]) * cls.gain

    def test_any_psf(self):
        """Even light needs no PSF: one from a file, or of the aperture, changes no pixel."""
        folder = runs.scratch()
        fits.PrimaryHDU(np.ones((15, 15), np.float32),
                        fits.Header({"OVERSAMP": 5})).writeto(folder + "/psf.fits")
        frames = {}
        for name, sets in (("gaussian", ()), ("diffraction", (CAMERA + '/optics/psf="diffraction"',)),
                           ("file", (CAMERA + '/optics/psf="file"',
                                     CAMERA + f'/optics/psf_file="{folder}/psf.fits"'))):
            words = [runs.BORESIGHT, "calframes", runs.TRACK, "--out", f"{folder}/{name}", "--bias",
                     "0", "--dark", "0", "--flat", "1"]
            for one in sets:
                words += ["--set", one]
            result = subprocess.run(words, capture_output=True, text=True, timeout=300)
            self.assertEqual((result.returncode, result.stderr), (0, ""), name)
            with fits.open(f"{folder}/{name}/neossat_telescope_flat.fits") as hdus:
                frames[name] = hdus[1].data.copy()
        for name in ("diffraction", "file"):
            self.assertTrue(np.array_equal(frames[name], frames["gaussian"]), name)

    def test_headers(self):
        self.assertEqual(self.result.returncode, 0)
        for kind, exposure in (("bias", 0), ("dark", 20), ("flat", 20)):
            self.assertEqual(self.headers[kind]["IMAGETYP"], kind.upper())
            self.assertEqual(self.headers[kind]["EXPTIME"], exposure)
            self.assertEqual(len(self.stacks[kind]), 12)
        # the series follow one another, each frame 1 s after the one before
        first = {kind: Time(header["DATE-OBS"]) for kind, header in self.headers.items()}
        self.assertAlmostEqual((first["dark"] - first["bias"]).sec, 12, places=3)
        self.assertAlmostEqual((first["flat"] - first["dark"]).sec, 12 * 21, places=3)

    def test_bias_has_read_noise_and_columns(self):
        noise = (self.stacks["bias"][0] - self.stacks["bias"][1]).std() / np.sqrt(2) * self.gain
        quantised = np.hypot(8, self.gain / np.sqrt(12))
        self.assertAlmostEqual(noise, quantised, delta=0.02)  # a million pixels: 0.006, 1 sigma
        columns = self.bias.mean(0).std() * self.gain
        self.assertAlmostEqual(columns, 3, delta=4 * 3 / np.sqrt(2 * 1024))

    def test_dark_has_its_spread_and_hot_pixels(self):
        hot = self.dark > 600  # 30 e/s: three standard deviations (dex) below the hot ones' median
        self.assertAlmostEqual(hot.mean() * 2**20, 1000, delta=150)
        rest = self.dark[~hot]
        self.assertAlmostEqual(rest.mean(), 40, delta=0.3)
        spread = rest.var() - (40 + 2 * 64 + 2 * self.gain**2 / 12) / 12
        self.assertAlmostEqual(np.sqrt(spread), 0.3 * 40, delta=0.3)

    def test_flat_has_the_response(self):
        cold = self.dark < 600
        shot = np.sqrt((40000 + 2 * 40 + 2 * 64) / 12)
        measured = self.flat[cold]
        self.assertAlmostEqual(measured.mean() / 40000, 1, delta=1e-3)
        self.assertAlmostEqual(np.sqrt(measured.var() - shot**2) / 40000, 0.02, delta=2e-4)

    def test_the_maps_serve_the_main_job(self):
        """Maps as image processing takes them; hits are left for the tracker."""
        maps = {"flat_file": self.flat / self.flat.mean(),
                "dark_file": (self.dark - np.median(self.dark)) / 20,
                "bad_pixel_file": self.dark > 600}
        sets = PATTERNS + [HITS + "2"]
        for key, image in maps.items():
            path = os.path.join(self.folder, key + ".fits")
            fits.PrimaryHDU(image.astype(np.float32)).writeto(path)
            sets.append(f"{runs.SENSOR}/modules/imgproc/{key}={path}")
        out = os.path.join(self.folder, "run")
        summary = runs.run(runs.TRACK, out, runs.NO_FRAMES, *sets, seed=1,
                           duration=35)["summary"]
        self.assertEqual(summary["final_mode"], "track")
        self.assertEqual(summary["wrong_target_frames"], 0)
        rows = runs.database(out).execute("SELECT hits, hits_e FROM exposures").fetchall()
        # 2 per cm2 and s on 1.77 cm2 (13 um pixels) in 0.5 s, and a rim
        self.assertAlmostEqual(sum(row["hits"] for row in rows) / len(rows), 1.8, delta=0.8)
        self.assertGreater(sum(row["hits_e"] for row in rows), 0)

    def test_full_disk_leaves_no_cut_file(self):
        """A limit on the size of files stands for the disk: 1024^2 pixels of 2 bytes do not fit, but what
        PoCL writes for itself (0.6 MB) does."""
        folder = runs.scratch()
        result = subprocess.run(
            ["sh", "-c", 'ulimit -f 3000; exec "$@"', "sh", runs.BORESIGHT, "calframes", runs.TRACK,
             "--out", folder, "--bias", "1", "--dark", "0", "--flat", "0"],
            capture_output=True, text=True, timeout=120)
        self.assertEqual(result.returncode, 1, result.stderr)
        self.assertRegex(result.stderr, r"boresight: .*fits.*: cannot be written: File too large")
        self.assertEqual(os.listdir(folder), [])


def tearDownModule():
    runs.clean()


if __name__ == "__main__":
    unittest.main()
