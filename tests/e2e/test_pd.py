"""`boresight pd` from outside: its figures agree with one another and with formulae worked out here,
the detector is near its bounds, results repeat, wrong calls are explained.

Usage, from the repository root: /usr/bin/python3 tests/e2e/test_pd.py BORESIGHT [--full]
"""
import json
import math
import os
import statistics
import sys
import unittest

import numpy as np

import runs

FULL = "--full" in sys.argv
if FULL:
    sys.argv.remove("--full")
NORMAL = statistics.NormalDist()


def pd(*words, scenario=runs.STARE):
    return runs.call("pd", scenario, *words, timeout=600)


class Measured(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = runs.scratch()
        cls.path = os.path.join(cls.folder, "pd.json")
        cls.plot = os.path.join(cls.folder, "pd.png")
        cls.words = ["--snr", "3:9:1", "--trials", "300", "--false-alarms", "4", "--empty-frames",
                     "60", "--threads", "1", "--json", cls.path,
                     # a quarter of the pixels, with as many false alarms
                     "--set", runs.SENSOR + "/camera/width_px=512", "--set", runs.SENSOR + "/camera/height_px=512",
                     # charge outside the exposure counts in full: without it the SNR would be 1 dB off
                     "--set", runs.SENSOR + '/camera/detector={"clock_induced_e": 300}']
        cls.result = pd(*cls.words, "--plot", cls.plot)
        with open(cls.path) as file:
            cls.out = json.load(file)

    def test_points(self):
        self.assertEqual(self.result.returncode, 0, self.result.stderr)
        self.assertEqual([p["snr"] for p in self.out["points"]], [3, 4, 5, 6, 7, 8, 9])
        pixels = self.out["width_px"] * self.out["height_px"]
        threshold = -NORMAL.inv_cdf(self.out["false_alarms_per_frame"] / pixels)
        z = NORMAL.inv_cdf(0.975)
        for p in self.out["points"]:
            self.assertEqual(p["trials"], 300)
            raw = p["detected"] / p["trials"]
            self.assertAlmostEqual(p["pd"], (raw - self.out["chance"]) / (1 - self.out["chance"]),
                                   delta=1e-12)
            self.assertTrue(0 <= p["pd_low"] <= p["pd"] <= p["pd_high"] <= 1)
            centre = (raw + z * z / 600) / (1 + z * z / 300)
            self.assertAlmostEqual((p["pd_low"] + p["pd_high"]) / 2, centre,
                                   delta=2 * self.out["chance"] + 1e-12)
            self.assertTrue(min(p["ideal_pd"], 0.5) - 0.03 < p["matched_filter_pd"]
                            < max(p["ideal_pd"], 0.5) + 0.03)
            self.assertAlmostEqual(p["ideal_pd"], 1 - NORMAL.cdf(threshold - p["snr"]), delta=1e-9)

    def test_light_is_what_the_snr_says(self):
        """White noise, Gaussian PSF blurred by the jitter, integrated over pixels: the noise-
        equivalent area is 4 pi (sigma^2 + 1/12) to half a per cent."""
        sigma2 = (2 / 2.35482)**2 + self.out["jitter_px"]**2 + 1 / 12
        self.assertAlmostEqual(self.out["jitter_px"], 0.14)
        for p in self.out["points"]:
            snr = p["flux_e"] / self.out["noise_e"] / np.sqrt(4 * np.pi * sigma2)
            self.assertAlmostEqual(snr / p["snr"], 1, delta=0.005)
        self.assertGreater(self.out["background_e"], 300)
        noise2 = self.out["background_e"] + 64  # read noise 8
        self.assertAlmostEqual(self.out["noise_e"]**2, noise2, delta=1e-6)

    def test_the_detector_is_near_its_bounds(self):
        self.assertAlmostEqual(self.out["false_alarms_per_frame"], 4, delta=4 * np.sqrt(4 / 60) + 1)
        self.assertLess(abs(self.out["loss_db_pd50"]), 0.8)
        self.assertLess(abs(self.out["loss_db_pd90"]), 1.0)
        bright = self.out["points"][-1]
        self.assertGreater(bright["pd"], 0.97)
        # RMS of 300: 4 %; a detector may be worse than the bound, not better
        self.assertTrue(0.88 < bright["centroid_rms_over_bound"] < 1.3)
        self.assertTrue(0.85 < bright["flux_rms_over_bound"] < 1.3)

    def test_plot(self):
        if os.path.exists(self.plot):  # gnuplot may be missing: a warning then
            with open(self.plot, "rb") as file:
                self.assertEqual(file.read(8), b"\x89PNG\r\n\x1a\n")
        else:
            self.assertIn("gnuplot", self.result.stderr)

    def test_the_same_seed_gives_the_same(self):
        other = {"--threads": "2", "--json": self.path + ".2"}
        again = pd(*[other.get(before, word) for before, word in zip(("", *self.words), self.words)])
        self.assertEqual(again.returncode, 0, again.stderr)
        with open(self.path + ".2") as file:
            out = json.load(file)
        self.assertEqual(out["points"], self.out["points"])
        self.assertEqual(out["false_alarms_per_frame"], self.out["false_alarms_per_frame"])

    def test_a_module_is_stepped_to_the_same_end(self):
        """The path of detectors that users plug in, taken with the one whose function was called."""
        words = ["--snr", "5:7:1", "--trials", "60", "--empty-frames", "4", "--streak", "5",
                 "--known-rate"]
        out = []
        for extra in ([], ["--module"]):
            path = os.path.join(self.folder, "module.json")
            result = pd(*words, "--json", path, *extra)
            self.assertEqual(result.returncode, 0, result.stderr)
            with open(path) as file:
                out.append(json.load(file))
        self.assertEqual(out[0]["false_alarms_per_frame"], out[1]["false_alarms_per_frame"])
        for a, b in zip(out[0]["points"], out[1]["points"]):
            self.assertEqual(a["detected"], b["detected"])
            # the camera's motion by telemetry differs in the last places
            self.assertAlmostEqual(a["centroid_rms_across_px"], b["centroid_rms_across_px"],
                                   delta=1e-6)

    def test_stars_are_no_false_alarms(self):
        path = os.path.join(self.folder, "stars.json")
        for extra in ([], ["--star-streak", "12"]):
            result = pd("--snr", "5:20:15", "--trials", "60", "--empty-frames", "15", "--stars",
                        "--json", path, *extra)
            self.assertEqual(result.returncode, 0, result.stderr)
            with open(path) as file:
                out = json.load(file)
            # V 16 in 0.73 square degrees of which the embedded catalogue has those to V 12
            self.assertGreater(out["star_detections_per_frame"], 5)
            self.assertLess(out["false_alarms_per_frame"], 3)  # 1 is asked for; 15: 0.26, 1 sigma
            self.assertGreater(out["points"][1]["pd"], 0.9)

    def test_streaks_of_known_rate(self):
        path = os.path.join(self.folder, "streak.json")
        result = pd("--snr", "10:30:20", "--trials", "40", "--empty-frames", "2", "--streak", "20",
                    "--known-rate", "--json", path)
        self.assertEqual(result.returncode, 0, result.stderr)
        with open(path) as file:
            out = json.load(file)
        for p in out["points"]:
            self.assertGreater(p["pd"], 0.9)
            self.assertLess(p["centroid_rms_across_px"], 0.5)
        self.assertIsNone(out["loss_db_pd50"])  # Pd is above a half all over

    @unittest.skipUnless(FULL, "slow")
    def test_a_psf_that_is_known_is_used(self):
        """A telescope's PSF, with aberrations that differ over the field: what is reported of positions
        and light is true, and a Gaussian of the same noise-equivalent area is not."""
        path = os.path.join(self.folder, "diffraction.json")
        scenario = os.path.join(os.path.dirname(runs.STARE), "diffraction.json")
        outs = []
        for extra in ([], ["--set", runs.SENSOR + "/knowledge/camera/psf_fwhm_px=3.09"]):
            result = pd("--snr", "5:30:25", "--trials", "250", "--empty-frames", "10",
                        "--background", "20", "--json", path, *extra, "--set",
                        runs.SENSOR + "/camera/optics/wavelengths=2", "--set", runs.SENSOR + "/camera/width_px=512",
                        "--set", runs.SENSOR + "/camera/height_px=512", scenario=scenario)
            self.assertEqual(result.returncode, 0, result.stderr)
            with open(path) as file:
                outs.append(json.load(file)["points"])
        known, gaussian = outs
        # the mean of 250 fluxes at SNR 30 is known to 0.2 %, an RMS of as many to 4.5 %
        self.assertAlmostEqual(known[1]["flux_bias"], 0, delta=0.01)
        self.assertLess(known[1]["centroid_rms_over_bound"], 1.05 * 1.08)
        # a mean of 250 of deviation 2: 1 sigma is 0.13
        self.assertAlmostEqual(known[1]["centroid_chi_square"], 2, delta=0.4)
        self.assertLess(gaussian[1]["flux_bias"], -0.08)
        # at SNR 5 they find 0.55 and 0.46; 250 trials each: 1 sigma of the difference is 0.04, less as
        # both see the same frames
        self.assertGreater(known[0]["pd"], gaussian[0]["pd"] + 0.02)


class Pairs(unittest.TestCase):
    """`--pair`: half a megapixel has 392 cells with 79 pairs a frame."""
    SMALL = ["--threads", "1", "--set", runs.SENSOR + "/camera/width_px=1024", "--set",
             runs.SENSOR + "/camera/height_px=512"]

    @classmethod
    def setUpClass(cls):
        cls.folder = runs.scratch()
        cls.plot = os.path.join(cls.folder, "pair.png")
        cls.path = os.path.join(cls.folder, "pair.json")
        cls.words = ["--pair", "--snr", "50", "--ratio", "1,4", "--streak", "8", "--trials", "60",
                     "--false-splits", "0.01", "--json", cls.path, *cls.SMALL]
        cls.result = pd(*cls.words, "--plot", cls.plot)
        assert cls.result.returncode == 0, cls.result.stderr
        with open(cls.path) as file:
            cls.out = json.load(file)

    def test_curves(self):
        self.assertEqual([(c["ratio"], c["streak_px"]) for c in self.out["curves"]],
                         [(1, 0), (4, 0), (1, 8), (4, 8)])
        self.assertEqual(self.out["bound_false_splits"], 0.01)
        for curve in self.out["curves"]:
            point, = curve["points"]
            self.assertEqual([s["pairs"] for s in point["separations"]], [60] * 9)
            # 4 of 5 targets are single
            self.assertGreaterEqual(point["singles"], 4 * 9 * 60)
            # 1 % asked for; six standard deviations of 2,160 more
            self.assertLess(point["false_splits"], 0.01 + 6 * 0.0021)
            self.assertLess(point["separations"][0]["pd"], 0.85)
            self.assertGreater(point["separations"][-1]["pd"], 0.9)
            self.assertLess(point["bound_known_px"], point["bound_unknown_px"])

    def pd_of_known_pair(self, separation):
        """Q(Q^-1(0.01) - D) as a mean over directions and phases: equal points of SNR 50, the Gaussian
        in pixels by erf, own light as noise, the nearest single source by Gauss-Newton."""
        sigma, noise = self.out["fwhm_px"] / 2.354820045, self.out["noise_e"]
        edges = np.arange(-12, 13) - 0.5
        erf = np.vectorize(math.erf)

        def image(x, y):
            u, v = (np.diff(erf((edges - at) / sigma / math.sqrt(2))) / 2 for at in (x, y))
            return np.outer(v, u).ravel()

        flux = 50 * noise / np.sqrt(np.sum(image(0, 0)**2))
        found = []
        for k in range(6):
            x, y, angle = k / 6, (0.4 * k) % 1, 0.3 + k * math.pi / 6
            dx, dy = separation / 2 * math.cos(angle), separation / 2 * math.sin(angle)
            pair = flux / 2 * (image(x - dx, y - dy) + image(x + dx, y + dy))
            weight = 1 / np.sqrt(noise**2 + pair)
            p = np.array([flux, x, y])
            for _ in range(6):
                rest = pair - p[0] * image(p[1], p[2])
                slopes = [image(p[1], p[2])] + [
                    p[0] * (image(p[1] + h, p[2] + g) - image(p[1] - h, p[2] - g)) / 2e-3
                    for h, g in ((1e-3, 0), (0, 1e-3))]
                p = p + np.linalg.lstsq(np.array(slopes).T * weight[:, None], rest * weight, rcond=None)[0]
            found.append(1 - NORMAL.cdf(2.3263479 - np.linalg.norm(rest * weight)))
        return np.mean(found)

    def test_points_are_near_the_bound(self):
        point = self.out["curves"][0]["points"][0]
        # Pd rises by 0.02 for 1 % of separation; phases and directions differ
        self.assertAlmostEqual(self.pd_of_known_pair(point["bound_known_px"]), 0.9, delta=0.01)
        # six standard deviations below the bound would be an error of the bound
        sigma = point["separation_pd90_sigma_px"]
        self.assertTrue(0 < sigma < 0.15)
        self.assertGreater(point["separation_pd90_px"], point["bound_known_px"] - 6 * sigma)
        self.assertLess(point["separation_pd90_px"], 1.3 * point["bound_known_px"])

    def test_plot(self):
        if os.path.exists(self.plot):  # gnuplot may be missing: a warning then
            with open(self.plot, "rb") as file:
                self.assertEqual(file.read(8), b"\x89PNG\r\n\x1a\n")
        else:
            self.assertIn("gnuplot", self.result.stderr)

    def test_threads_and_module_do_not_matter(self):
        short = ["--pair", "--snr", "60", "--ratio", "1", "--trials", "30", "--separation", "0.8,1.1,1.5",
                 *self.SMALL]
        outs = []
        for extra in (["--false-splits", "0.02"],
                      ["--module", "--set", runs.SENSOR + "/modules/imgproc/false_splits=0.02"]):
            path = os.path.join(self.folder, "same.json")
            result = pd(*short, "--json", path, *extra)
            self.assertEqual(result.returncode, 0, result.stderr)
            with open(path) as file:
                outs.append(json.load(file)["curves"][0]["points"][0])
        self.assertEqual(outs[0]["separations"], outs[1]["separations"])
        self.assertEqual(outs[0]["singles_split"], outs[1]["singles_split"])

    def test_without_pair_test(self):
        path = os.path.join(self.folder, "without.json")
        result = pd("--pair", "--snr", "50", "--ratio", "1", "--trials", "30", "--separation", "1.3,6",
                    "--json", path, *self.SMALL)
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertIn("no test for pairs", result.stdout)
        with open(path) as file:
            point = json.load(file)["curves"][0]["points"][0]
        self.assertEqual([s["found"] for s in point["separations"]], [0, 30])
        self.assertIsNone(point["separation_pd90_px"])  # not enclosed by two separations
        self.assertLess(point["singles_split"], 3)


class WrongCalls(unittest.TestCase):
    def test_messages(self):
        for words, code, hint in ((["--snr", "2:12"], 2, "FIRST:LAST:STEP"),
                                  (["--snr", "9:3:1"], 2, "the first not above the last"),
                                  (["--snr", "1:9:0.001"], 2, "more than 200 steps"),
                                  (["--snr", "2:9:1", "--magnitude", "12:15:1"], 2, "not both"),
                                  (["--known-rate"], 2, "--streak"),
                                  (["--trials", "0"], 2, "trials"),
                                  (["--sensor", "nobody"], 1, "(allowed: neossat/telescope)"),
                                  (["--stars", "--background", "9"], 2, "give one"),
                                  (["--star-streak", "9", "--streak", "9", "--known-rate"], 2,
                                   "leave out --star-streak"),
                                  (["--module", "--false-alarms", "2"], 1, "--set"),
                                  (["--cell", "10"], 1, "--cell"),
                                  (["--streak", "990"], 1, "no room"),
                                  (["--ratio", "1"], 2, "--ratio has no effect without --pair"),
                                  (["--pair", "--ratio", "0.5"], 2, "numbers from 1 to 1000"),
                                  (["--pair", "--ratio", "1,2,3,4,5"], 2, "more than 4"),
                                  (["--pair", "--separation", "2,1"], 2, "above the one before"),
                                  (["--pair", "--separation", "1,,2"], 2, "not a list"),
                                  (["--pair", "--separation", "1000"], 1, "no room"),
                                  (["--pair", "--snr", "20;50"], 2, "for example 20,50,100"),
                                  (["--pair", "--snr", "20:50"], 2, "for example 20:100:20"),
                                  (["--pair", "--ratio", "x"], 2, "for example 1,4"),
                                  (["--pair", "--snr", "10:100:1"], 2, "at most 24"),
                                  (["--pair", "--magnitude", "9:12:1"], 2, "leave out --magnitude"),
                                  (["--pair", "--stars"], 2, "leave out --stars"),
                                  (["--pair", "--stack", "8"], 2, "leave out --stack"),
                                  (["--pair", "--known-rate", "--streak", "9"], 2, "leave out --known-rate"),
                                  (["--pair", "--apart", "1", "--cell", "16"], 1, "--cell 16: at least 23."),
                                  (["--pair", "--false-splits", "0.5"], 2, "0 to 0.1"),
                                  (["--pair", "--module", "--false-splits", "0.01"], 1, "--set")):
            result = pd(*words)
            self.assertEqual(result.returncode, code, (words, result.stderr))
            self.assertIn(hint, result.stderr)


def tearDownModule():
    runs.clean()


if __name__ == "__main__":
    unittest.main(verbosity=2)
