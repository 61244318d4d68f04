#!/usr/bin/env python3
"""The kernels under Oclgrind, an interpreter that checks each access of each work-item: no access out of bounds, no
data race, and the same frames as by PoCL, for each kernel and each effect of the detector: all pixels but one of a
thousand, and these to 1 DN, since compilers fuse products and sums each in its own way and a value may be at the border
of two codes.

Usage, from the repository root: /usr/bin/python3 tests/e2e/test_oclgrind.py BORESIGHT CXX

Needs the Debian packages oclgrind (21.10, which uses LLVM 14) and g++; ends with 77 (skipped) without Oclgrind.
"""
import glob
import json
import shutil
import subprocess
import sys
import unittest

CXX = sys.argv.pop(2)
import runs  # noqa: E402  (takes the program's path off the arguments)

from astropy.io import fits  # noqa: E402

SENSOR = runs.SENSOR + "/"
CAMERA = SENSOR + "camera/"
FRAMES = 2  # the second one has what stays of the first
SMALL = {CAMERA + "width_px": 48, CAMERA + "height_px": 40}
DETECTOR = {"prnu_rms": 0.01, "dsnu_rms": 0.2, "hot_fraction": 0.01, "dead_fraction": 0.005, "bad_columns": 2,
            "column_offset_rms_e": 1, "row_offset_rms_e": 1, "row_noise_e": 0.5, "telegraph_noise_fraction": 0.1,
            "telegraph_noise_rms_e": 12, "nonlinearity": [0.01, 0, 0],
            "cosmic_rays": {"rate_per_cm2_s": 500}}
CASES = {
    "plain": {},
    "detector": {CAMERA + "detector": DETECTOR},
    "bloom": {CAMERA + "detector": {"saturation": "bloom"}, CAMERA + "full_well_e": 20000},
    "frame transfer": {CAMERA + "detector": {"frame_transfer_s": 0.01}},
    "rolling shutter": {CAMERA + "detector": {"row_time_s": 0.001}, SENSOR + "exposure/first_s": 0.1},
    "binning": {SENSOR + "exposure/binning": 2},
    "Moffat": {CAMERA + "optics": {"psf": "moffat", "moffat_beta": 3}},
    "diffraction": {CAMERA + "optics": {"psf": "diffraction", "q": 2, "central_obstruction": 0.3, "wavelengths": 1}},
    "vignetting": {CAMERA + "optics": {"vignetting": {"model": "cos4"}}},
    "planes": {"/record/planes": ["targets", "stars", "background"]},
    "traps": {CAMERA + "detector": {
        "parallel_traps": {"traps_per_px": [4, 2, 1]}, "serial_traps": {"traps_per_px": [2, 1, 0]},
        "output": {"right": True, "top": True}, "overscan": {"left": 3, "right": 5, "bottom": 1, "top": 2},
        "shielded": {"left": 2, "right": 1, "bottom": 3, "top": 1}, "pick_up": {"amplitude_e": 5, "cycles_per_px": 0.1},
        "glow": {"peak_e": 40, "scale_px": 20, "x_px": 4, "y_px": 50}}},
    "crosstalk": {CAMERA + "detector": {"crosstalk": {"outputs": 4, "coupling": 0.01, "mirrored": True}}},
    "neighbours": {CAMERA + "detector": {
        "interpixel_coupling": 0.02, "brighter_fatter_per_e": 1e-6, "em_gain": 30, "clock_induced_e": 0.1,
        "persistence": {"trapped_share": [0.01, 0.005, 0, 0, 0]}, "pixel_flicker_noise": {"rms_e": 5},
        "reset_noise_e": 9, "flicker_noise_e": 3, "quantisation": {"model": "square_root", "bits": 10}}},
    "ramp": {CAMERA + "detector": {"ramp": {"reads": 5, "flicker_noise_e": 3}, "cosmic_rays": {"rate_per_cm2_s": 500},
                                   "reset_noise_e": 9}},
    "last minus first": {CAMERA + "detector": {"ramp": {"reads": 4, "fit": "last_minus_first"},
                                               "persistence": {"trapped_share": [0.01, 0.005, 0, 0, 0]}}},
}


def frame(folder):
    with fits.open(folder + "/frames.fits") as file:
        return file[0].data.copy()


class Oclgrind(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = runs.scratch()
        cls.options = cls.folder + "/options.so"
        library = glob.glob("/usr/lib/*/libLLVM-14.so.1")[0]
        subprocess.run([CXX, "-shared", "-fPIC", "-o", cls.options, "tests/e2e/oclgrind_options.cpp", library],
                       check=True)
        cls.interpreter = (glob.glob("/usr/lib/oclgrind/liboclgrind-rt.so")
                           + glob.glob("/usr/lib/*/oclgrind/liboclgrind-rt.so"))[0]

    def words(self, name, values):
        words = [runs.BORESIGHT, "run", "scenarios/datacube.json", "--duration", str(FRAMES), "--quiet", "--out",
                 f"{self.folder}/{name}"]
        for path, value in values.items():
            words += ["--set", f"{path}={json.dumps(value)}"]
        return words

    def test_kernels(self):
        for name, values in CASES.items():
            values = {**SMALL, **values}
            subprocess.run(self.words(name, values), check=True, capture_output=True)
            checked = subprocess.run(
                ["oclgrind", "--data-races", "env", f"LD_PRELOAD={self.options}:{self.interpreter}"]
                + self.words(name + " checked", values) + ["--device", "Oclgrind"],
                capture_output=True, text=True, timeout=600)
            with self.subTest(name):
                said = checked.stdout + checked.stderr
                self.assertEqual(checked.returncode, 0, said)
                for word in ("OCLGRIND", "Invalid", "race"):
                    self.assertNotIn(word, checked.stderr)
                difference = (frame(f"{self.folder}/{name} checked").astype(int)
                              - frame(f"{self.folder}/{name}").astype(int))
                self.assertLessEqual(int((difference != 0).sum()), difference.size // 1000)
                self.assertLessEqual(int(abs(difference).max()), 1)


def tearDownModule():
    runs.clean()


if __name__ == "__main__":
    if not shutil.which("oclgrind"):
        print("skipped: needs oclgrind")
        sys.exit(77)
    unittest.main()
