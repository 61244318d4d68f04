"""boresight calibrate-camera: the camera of a run comes back from its own frames, and makes a scenario."""
import csv
import json
import os
import shutil
import unittest

import numpy as np
from astropy.io import fits

import runs

SENSOR = runs.SENSOR + "/camera"
TRUE = {"pixel_scale_arcsec": 3.01, "k1": -3.0, "k2": 0.0, "p1": 0.01, "p2": -0.02}


class Camera(unittest.TestCase):
    def test_run(self):
        out = runs.scratch()
        run, made = os.path.join(out, "run"), os.path.join(out, "camera")
        words = [f"{SENSOR}/{'' if key.startswith('pixel') else 'distortion/'}{key}={value}" for key, value in TRUE.items()]
        runs.run(runs.STARE, run, *words, duration=15)
        said = runs.call_well("calibrate-camera", run, "--out", made, "--extends", runs.STARE, "--psf-rows", "1",
                              "--psf-radius", "8")
        self.assertIn("zero point", said)
        self.assertIn("PSF              1 x 1 nodes", said)
        with open(os.path.join(made, "report.json"), encoding="utf-8") as file:
            report = json.load(file)
        for key, value in TRUE.items():
            found = report["geometry"][key]
            self.assertLess(abs(found["value"] - value), 4.5 * found["standard_error"], key)
        self.assertLess(report["geometry"]["corner_sigma_px"], 0.1)
        # the frames are smeared a little, which the width contains
        self.assertAlmostEqual(report["psf"]["fwhm_px"]["value"], 2.02, delta=0.05)
        # a Gaussian of 2 px, jitter and smear; the light beyond 5 px is 1e-8, what the noise makes of it 1 %
        psf = report["psf_file"]["nodes"][0]
        for key in ("xx_px2", "yy_px2"):
            self.assertAlmostEqual(psf[key]["value"], (2.02 / 2.3548)**2, delta=0.04)
        self.assertAlmostEqual(psf["encircled_1_px"]["value"], 1 - np.exp(-0.5 / (2.02 / 2.3548)**2), delta=0.015)
        with fits.open(made + "/psf.fits") as file, fits.open(made + "/psf_sigma.fits") as errors:
            self.assertEqual((file[0].data.shape, file[0].header["OVERSAMP"], errors[0].data.shape), ((65, 65), 4, (65, 65)))
            self.assertAlmostEqual(file[0].data.sum(), 1, delta=1e-5)
            self.assertGreater(errors[0].data.min(), 0)
        # electrons/s of V 0: flux of the band, aperture, optics and detector; the same for all colours
        light = report["photometry"]
        scene = json.loads(runs.call("check", runs.STARE).stdout)["observers"][0]["sensors"][0]["camera"]
        rate = (scene["photon_flux_v0_per_s_m2"] * np.pi / 4 * scene["aperture_m"]**2 * (1 - scene["obscuration"])
                * scene["throughput"] * scene["quantum_efficiency"])
        self.assertLess(abs(light["zero_point_mag"]["value"] - 2.5 * np.log10(rate)),
                        4.5 * light["zero_point_mag"]["standard_error"])
        self.assertLess(abs(light["colour_term"]["value"]), 4.5 * light["colour_term"]["standard_error"])
        with open(os.path.join(made, "stars.csv"), encoding="utf-8", newline="") as file:
            rows = [row for row in csv.DictReader(file) if row["residual_x_px"]]
        self.assertEqual(len(rows), report["geometry"]["stars"])
        left = np.array([[float(row["residual_x_px"]), float(row["residual_y_px"])] for row in rows])
        self.assertAlmostEqual(np.sqrt(np.mean(left**2)), report["geometry"]["rms_px"], delta=1e-4)
        # without a PSF none of an earlier run is left
        runs.call_well("calibrate-camera", run, "--out", made + "_again", "--extends", runs.STARE)
        for name in ("psf.fits", "psf_sigma.fits"):
            shutil.copy(os.path.join(made, name), made + "_again")
        runs.call_well("calibrate-camera", run, "--out", made + "_again", "--extends", runs.STARE, "--overwrite")
        self.assertEqual(sorted(os.listdir(made + "_again")), ["camera.json", "plot.png", "report.json", "stars.csv"])
        # camera.json is a scenario
        result = runs.call("check", os.path.join(made, "camera.json"))
        self.assertEqual(result.returncode, 0, result.stderr)
        camera = json.loads(result.stdout)["observers"][0]["sensors"][0]["camera"]
        self.assertEqual(camera["pixel_scale_arcsec"], report["geometry"]["pixel_scale_arcsec"]["value"])
        self.assertEqual([camera["optics"][key] for key in ("psf", "file_centre", "field_rows")], ["file", "array", 1])
        self.assertTrue(os.path.samefile(camera["optics"]["psf_file"], made + "/psf.fits"))
        self.assertEqual(camera["distortion"]["k2"], report["geometry"]["k2"]["value"])
        for width in report["psf"]["fwhm_px_by_ninth"]:
            self.assertAlmostEqual(width, 2.02, delta=0.1)
        # frames in extensions, not a cube, of a window off the corner: the middle and the right of the middle row
        runs.run(runs.STARE, run + "2", "/record/frames=extensions",
                 f"{runs.SENSOR}/exposure/window_px=[345,345,660,330]", duration=3)
        self.assertIn("FWHM", runs.call_well("calibrate-camera", run + "2", "--out", made + "2"))
        with open(os.path.join(made + "2", "report.json"), encoding="utf-8") as file:
            widths = json.load(file)["psf"]["fwhm_px_by_ninth"]
        self.assertEqual([i for i, width in enumerate(widths) if width is not None], [4, 5])
        self.assertAlmostEqual(widths[4], 2.02, delta=0.1)
        runs.run(runs.STARE, run + "3", f"{SENSOR}/aperture_m=0.001", duration=1)
        result = runs.call("calibrate-camera", run + "3", "--out", made + "3")
        self.assertEqual((result.returncode, os.path.exists(made + "3")), (1, False))
        self.assertIn("0 identified stars in 0 frames do not determine", result.stderr)
        result = runs.call("calibrate-camera", run, "--out", made + "4", "--camera", "/nonsense")
        self.assertIn("/nonsense: no place of a camera", result.stderr)
        result = runs.call("calibrate-camera", run, "--out", made)
        self.assertEqual(result.returncode, 1)
        self.assertIn("--overwrite", result.stderr)


def tearDownModule():
    runs.clean()


if __name__ == "__main__":
    unittest.main()
