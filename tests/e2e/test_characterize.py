#!/usr/bin/env python3
"""boresight characterize: sensors that were simulated are found again, within their intervals.

Usage, from the repository root:
    /usr/bin/python3 tests/e2e/test_characterize.py BORESIGHT          two random sensors
    /usr/bin/python3 tests/e2e/test_characterize.py BORESIGHT --full   20 larger ones, and what they gave

Frames of NEOSSat are no part of the project. Where the environment variable BORESIGHT_NEOSSAT names a folder
with NEOSSAT_240__30_2020214095318.fits, a raw dark with overscan, it is characterized too.
"""
import collections
import json
import math
import os
import random
import sys
import unittest

import numpy as np
from astropy.io import fits

import runs
from runs import call, call_well

FULL = "--full" in sys.argv
if FULL:
    sys.argv.remove("--full")
LIMIT_S = 3600 if FULL else 120
CAMERA = runs.SENSOR + "/camera/"
NEOSSAT = os.path.join(os.environ.get("BORESIGHT_NEOSSAT", ""), "NEOSSAT_240__30_2020214095318.fits")


def tearDownModule():
    runs.clean()


def draw(seed):
    """Values of a camera, of its detector, and the names of the figures that other names stand for."""
    u = random.Random(seed).uniform
    camera = {"gain_e_per_dn": u(0.8, 4), "read_noise_e": u(4, 15), "offset_dn": u(200, 1500),
              "dark_current_e_per_s": u(1, 8), "full_well_e": u(3e4, 5e4)}  # below the converter's 65,535 DN
    detector = {"dsnu_rms": u(0.05, 0.4), "hot_fraction": u(0.003, 0.01),
                "hot_median_e_per_s": u(300, 1000), "hot_spread_dex": u(0.2, 0.4), "prnu_rms": u(0.004, 0.02),
                "dead_fraction": u(0.001, 0.004), "bad_columns": random.Random(seed).randint(0, 3),
                "column_offset_rms_e": u(2, 5), "row_offset_rms_e": u(2, 5), "row_noise_e": u(1, 4),
                "nonlinearity": [u(-0.04, 0.02), u(-0.02, 0.02), u(-0.01, 0.01)],
                "cosmic_rays": {"rate_per_cm2_s": u(4, 12), "readout_s": u(1, 4), "depth_um": u(8, 25),
                                "e_per_um": u(60, 120), "straggling": u(0.1, 0.3)},
                "fixed_pattern_seed": hex(seed + 1)}
    return camera, detector


def figures_of(camera, detector):
    """The values by the names of the report's figures."""
    truth = {**camera, **detector}
    hits = truth.pop("cosmic_rays")
    truth.update({f"nonlinearity_{i + 1}": value for i, value in enumerate(truth.pop("nonlinearity"))})
    truth.update({"hit_" + key: value for key, value in hits.items()})
    truth["hit_length_px"] = hits["depth_um"] / 13
    del truth["fixed_pattern_seed"]
    return truth


class Characterize(unittest.TestCase):
    def made(self, seed, side, frames, more=None):
        """Report of a sensor that was simulated, and the values that it was made with; `more`: keys of its detector."""
        folder = runs.scratch()
        camera, detector = draw(seed)
        detector.update(more or {})
        scenario, out = os.path.join(folder, "sensor.json"), os.path.join(folder, "out")
        values = {CAMERA + key: value for key, value in
                  {**camera, "width_px": side, "height_px": side, "detector": detector}.items()}
        with open(scenario, "w", encoding="utf-8") as file:
            json.dump({"extends": os.path.abspath(runs.STARE), "seed": hex(seed), "set": values}, file)
        cal = os.path.join(folder, "cal")
        kinds, given = ("bias", "dark", "flat"), ("bias", "dark", "flat") + (() if more else ("linearity",))
        result = call("calframes", scenario, "--out", cal, "--exposure", "8", "--threads", "1", "--linearity", "0" if more else "20",
                      *(word for kind in kinds for word in ("--" + kind, str(frames))),
                      "--set", "/world/star_catalogue=embedded", timeout=LIMIT_S)
        self.assertEqual(result.returncode, 0, result.stderr)
        result = call("characterize", "--map", "boresight", "--out", out, "--extends", scenario,
                      *(word for kind in given for word in ("--" + kind, f"{cal}/neossat_telescope_{kind}.fits")), timeout=LIMIT_S)
        self.assertEqual((result.returncode, result.stderr), (0, ""))
        with open(out + "/report.json", encoding="utf-8") as file:
            report = json.load(file)
        return out, figures_of(camera, detector), report["figures"]

    def test_simulated_sensors_are_found_again(self):
        inside, of, unknown, wrong = collections.Counter(), collections.Counter(), collections.Counter(), []
        for seed in range(100, 120) if FULL else range(2):
            out, truth, figures = self.made(seed, 256 if FULL else 160, 8 if FULL else 4)
            for key, value in truth.items():
                found = figures[key]
                if found["low_95"] is None:  # the report says why; of hits fewer than 30
                    unknown[key] += 1
                    continue
                of[key] += 1
                good = found["low_95"] - 1e-12 <= value <= found["high_95"] + 1e-12
                inside[key] += good
                if not good:
                    wrong.append((seed, key, value, found["value"], found["standard_error"]))
        if FULL:
            print("inside their 95 % interval:", {key: f"{inside[key]} of {of[key]}" for key in of},
                  "not determined:", dict(unknown), "outside:", *wrong, sep="\n")
        # the flats' signal is without the offset: nearly a line through 0 at short exposures; 0.6 % here, as the sensor bends
        with open(out + "/report.json", encoding="utf-8") as file:
            points = json.load(file)["linearity"]["exposures"][:4]
        start = np.polyfit([p["exposure_s"] for p in points], [p["signal_dn"] for p in points], 1)[1]
        self.assertLess(abs(start), 0.05 * truth["offset_dn"])
        # detector.json is a scenario's change of its camera
        result = call("check", out + "/detector.json")
        self.assertEqual(result.returncode, 0, result.stderr)
        resolved = json.loads(result.stdout)["observers"][0]["sensors"][0]["camera"]
        self.assertAlmostEqual(resolved["read_noise_e"], figures["read_noise_e"]["value"], delta=1e-9)
        self.assertAlmostEqual(resolved["detector"]["prnu_rms"], figures["prnu_rms"]["value"], delta=1e-9)
        self.assertLessEqual({key for key in unknown if not key.startswith("hit_")}, set(), unknown)
        # of intervals of 95 %; two sensors: some 40 values, of which 7 or more lie outside once in 300
        self.assertGreaterEqual(sum(inside.values()), 0.9 * sum(of.values()) if FULL else sum(of.values()) - 6, wrong)
        for key in of if FULL else ():
            self.assertGreaterEqual(inside[key], of[key] - 4, wrong)  # fewer of 20 once in 400 if 95 % are inside

    def test_readout_pick_up_and_traps_are_found_again(self):
        """Dark signal gathered during read-out, a coherent line and charge-transfer inefficiency, from bias frames and darks."""
        traps = {"traps_per_px": [12, 0, 0], "release_px": [0.8, 1, 1], "fill_exponent": 0.5}
        more = {"readout_s": 12, "pick_up": {"amplitude_e": 12, "cycles_per_px": 0.17, "cycles_per_row": -0.31},
                "parallel_traps": traps, "output": {"top": True}, "hot_fraction": 0.006, "hot_median_e_per_s": 600,
                "hot_spread_dex": 0.3, "row_offset_rms_e": 0, "dsnu_rms": 0.1, "bad_columns": 0,
                "nonlinearity": [0, 0, 0],  # the gain of flats of one exposure has its bend
                "cosmic_rays": {"rate_per_cm2_s": 0, "depth_um": 15}}
        for seed in range(6 if FULL else 1):
            out, sensor, figures = self.made(seed, 256 if FULL else 192, 4, more)
            with open(out + "/detector.json", encoding="utf-8") as file:
                given = {key[len(CAMERA):]: value for key, value in json.load(file)["set"].items()}
            truth = {"readout_s": 12, "pick_up_cycles_per_px": 0.17, "pick_up_cycles_per_row": -0.31, "pick_up_amplitude_e": 12}
            for key, value in truth.items():
                found = figures[key]
                # twice the interval of 95 %: four standard errors
                self.assertAlmostEqual(found["value"], value, delta=found["high_95"] - found["low_95"], msg=(seed, key))
                self.assertLess(found["high_95"] - found["low_95"], (0.05 if key == "readout_s" else 0.2) * abs(value), (seed, key))
            # traps take 3 % of the shot noise out of the flats: without the covariance of neighbours too large by 5 to 8 errors
            gain = figures["gain_e_per_dn"]
            self.assertAlmostEqual(gain["value"], sensor["gain_e_per_dn"], delta=gain["high_95"] - gain["low_95"], msg=seed)
            self.assertIs(given["detector/output/top"], True)
            # density and time of fast traps cannot be separated: the charge that they defer by a pixel or more, of a
            # packet of 10,000 e-. Some 150 hot pixels, whose charges differ threefold: 20 %; the exponent is hardly determined
            found = given["detector/parallel_traps"]
            deferred = sum(n * math.exp(-1 / t) for n, t in zip(found["traps_per_px"], found["release_px"]))
            self.assertAlmostEqual(deferred / (12 * math.exp(-1 / 0.8)), 1, delta=0.2, msg=(seed, found))
            self.assertAlmostEqual(found["fill_exponent"], 0.5, delta=0.4, msg=(seed, found))
            # without pick-up and the shot noise of the ramp: 5 %
            self.assertAlmostEqual(given["read_noise_e"] / draw(seed)[0]["read_noise_e"], 1, delta=0.08, msg=seed)

    def test_read_noise_beside_pick_up(self):
        """A line of one phase cancels in the differences of pairs, others do not: 8 e- of read noise in both."""
        for phase in ("40", "null"):
            folder = runs.scratch()
            line = {"amplitude_e": "8", "cycles_per_px": "0.17", "cycles_per_row": "-0.31", "phase_deg": phase}
            sets = {"width_px": "160", "height_px": "128", **{"detector/pick_up/" + key: value for key, value in line.items()}}
            call_well("calframes", runs.STARE, "--out", folder + "/cal", "--bias", "4", "--dark", "0", "--flat", "0",
                      "--set", "/world/star_catalogue=embedded",
                      *(word for key, value in sets.items() for word in ("--set", f"{CAMERA}{key}={value}")))
            call_well("characterize", "--map", "boresight", "--bias", folder + "/cal/neossat_telescope_bias.fits",
                      "--out", folder + "/out", "--camera", "/camera")
            with open(folder + "/out/detector.json", encoding="utf-8") as file:
                given = json.load(file)["set"]
            # 20,480 pixels in two pairs: 0.35 % of the noise and as much of the line's power; five standard errors
            self.assertAlmostEqual(given["/camera/read_noise_e"], 8, delta=0.2, msg=phase)
            self.assertAlmostEqual(given["/camera/detector/pick_up/amplitude_e"], 8, delta=0.6, msg=phase)
            self.assertEqual("/camera/detector/pick_up/phase_deg" in given, phase != "null")
            if phase != "null":
                # the phase at the first pixel, by frequencies that are right to 1e-3 of a bin
                self.assertAlmostEqual(given["/camera/detector/pick_up/phase_deg"], 40, delta=4)

    def test_dark_current_by_temperature(self):
        """Darks at -20 and at -10 degrees of a sensor whose dark current doubles every 6 K."""
        folder = runs.scratch()
        for name, temperature in (("cold", -20), ("warm", -10)):
            sets = {"width_px": 128, "height_px": 128, "dark_current_e_per_s": 40,
                    "detector": json.dumps({"temperature_c": temperature, "reference_temperature_c": -20, "dark_doubling_k": 6})}
            call_well("calframes", runs.STARE, "--out", f"{folder}/{name}", "--bias", "2", "--dark", "2", "--flat", "0",
                      "--exposure", "10", "--set", "/world/star_catalogue=embedded",
                      *(word for key, value in sets.items() for word in ("--set", f"{CAMERA}{key}={value}")))
        call_well("characterize", "--map", "boresight", "--bias", folder + "/cold/neossat_telescope_bias.fits", "--dark",
                  folder + "/cold/neossat_telescope_dark.fits", "--warm", folder + "/warm/neossat_telescope_dark.fits",
                  "--warmer", "10", "--out", folder + "/out")
        with open(folder + "/out/report.json", encoding="utf-8") as file:
            found = json.load(file)["figures"]["dark_doubling_k"]
        # 16,384 pixels of 400 e- twice: 0.04 % of the ratio, four standard errors
        self.assertAlmostEqual(found["value"], 6, delta=4 * found["standard_error"])
        self.assertLess(found["standard_error"], 0.02)

    def test_what_frames_do_not_say_is_not_written(self):
        """Bias frames alone: no dark current, no response, and the gain of the header."""
        folder = runs.scratch()
        result = call("calframes", runs.STARE, "--out", folder + "/cal", "--bias", "2", "--dark", "0", "--flat", "0",
                      "--set", CAMERA + "width_px=96", "--set", CAMERA + "height_px=80",
                      "--set", "/world/star_catalogue=embedded")
        self.assertEqual(result.returncode, 0, result.stderr)
        bias = folder + "/cal/neossat_telescope_bias.fits"
        words = ("characterize", "--map", "boresight", "--bias", bias, "--out", folder + "/out")
        result = call(*words, "--camera", "/camera")
        self.assertEqual((result.returncode, result.stderr), (0, ""))
        with open(folder + "/out/detector.json", encoding="utf-8") as file:
            given = json.load(file)
        self.assertNotIn("extends", given)
        self.assertLessEqual({"/camera/gain_e_per_dn", "/camera/read_noise_e", "/camera/offset_dn"}, set(given["set"]))
        self.assertEqual([key for key in given["set"] if "dark" in key or "prnu" in key], [])
        self.assertEqual(given["set"]["/camera/gain_e_per_dn"], 1.6)
        # 7,680 pixels: 0.8 %; the interval of 5 standard errors
        self.assertAlmostEqual(given["set"]["/camera/read_noise_e"], 8, delta=0.33)
        # frames against themselves, and against those of another size
        call_well(*words, "--overwrite", "--simulated", bias)
        with open(folder + "/out/report.json", encoding="utf-8") as file:
            both = json.load(file)["reproduction"]
        self.assertEqual(both["kind"], "bias")
        for key in ("percentiles_over_median_dn", "power_along_rows_dn2_px", "correlation_along_rows", "correlation_along_columns"):
            self.assertTrue(both[key], key)
            for item in both[key]:
                self.assertEqual(item["real"], item["simulated"], key)
        with fits.open(bias) as hdus:
            noise = hdus[2].data.astype(float)
        # RMS by numpy; the median is a whole number, of which noise of 5 DN has 7 % of the pixels
        power = np.mean([item["real"] for item in both["power_along_rows_dn2_px"][1:-1]])
        self.assertAlmostEqual(power / np.var(noise), 1, delta=0.05)
        self.assertEqual(both["median_dn"]["real"], np.median(noise))
        again = call(*words)
        self.assertEqual(again.returncode, 1)
        self.assertIn("report.json: is there already; give another folder or --overwrite", again.stderr)
        wrong = call("characterize", "--map", "boresight", "--bias", bias, "--dark", runs.TRACK, "--out", folder + "/b")
        self.assertEqual(wrong.returncode, 1)
        self.assertIn("track.json: does not begin as a FITS file", wrong.stderr)

    def test_flats_and_darks_of_other_exposures(self):
        """A sensor made here, with a level near 0, dark signal and dead pixels: darks of 20 s, flats of 4 s."""
        folder, rng, gain, side, dead = runs.scratch(), np.random.default_rng(5), 2.0, 128, 32
        response = 1 + 0.01 * rng.standard_normal((side, side))
        response.flat[rng.choice(side * side, dead, replace=False)] = 0
        header = {"GAIN": 1.5, "RDNOISE": 6, "OFFSET": 2, "PIXSCALE": 3, "FRAMEID": 1,
                  "DATE-OBS": "2026-01-01T00:00:00", **{f"OBS{kind}{axis}": size for kind, size in (("POS", 7e6), ("VEL", 7e3)) for axis in "XYZ"}}

        def frames(name, exposure, light, bad=()):
            hdus = [fits.PrimaryHDU()]
            for _ in range(4):
                signal = rng.poisson(light * response + 120 * exposure) / gain
                pixels = 2 + signal + 3 * rng.standard_normal(signal.shape)
                pixels[bad, :] = np.nan
                hdus.append(fits.ImageHDU(pixels.astype(np.float32)))
                hdus[-1].header.update({**header, "EXPTIME": exposure})
            fits.HDUList(hdus).writeto(f"{folder}/{name}.fits")

        def figures(out, *kinds, more=()):
            words = [word for kind, name in kinds for word in ("--" + kind, f"{folder}/{name}.fits")]
            runs.call_well("characterize", "--map", "boresight", "--out", f"{folder}/{out}", *words, *more)
            with open(f"{folder}/{out}/report.json", encoding="utf-8") as file:
                return json.load(file)["figures"]

        frames("bias", 0, 0)
        frames("other", 0, 0)
        frames("dark", 20, 0)
        frames("flat", 4, 20000)
        found = figures("a", ("bias", "bias"), ("dark", "dark"), ("flat", "flat"), more=("--extends", runs.STARE))
        self.assertAlmostEqual(found["prnu_rms"]["value"], 0.01, delta=0.0003)
        self.assertAlmostEqual(found["dead_fraction"]["value"], dead / side**2, delta=1e-9)
        self.assertAlmostEqual(found["gain_e_per_dn"]["value"], gain, delta=0.05)
        with open(folder + "/a/detector.json", encoding="utf-8") as file:
            self.assertEqual(json.load(file)["set"][CAMERA + "detector/bad_columns"], 0)
        # darks of another exposure alone are no level of the flats
        found = figures("b", ("dark", "dark"), ("flat", "flat"))
        self.assertIsNone(found["prnu_rms"]["value"])
        self.assertIn("darks of the flats' exposure", found["prnu_rms"]["method"])
        self.assertAlmostEqual(found["gain_e_per_dn"]["value"], gain, delta=0.05)
        # flats without light: the header's gain; nothing of the earlier run stays
        self.assertTrue(os.path.exists(folder + "/a/dark_map.fits"))
        found = figures("a", ("bias", "bias"), ("flat", "other"), more=("--overwrite",))
        self.assertEqual(found["gain_e_per_dn"]["value"], 1.5)
        self.assertFalse(os.path.exists(folder + "/a/dark_map.fits"))
        # rows of BLANK pixels leave the ramp of the read-out and the dark current as they are
        frames("gaps", 20, np.linspace(0, 200, side)[:, None], range(60, 70))
        found = figures("c", ("bias", "bias"), ("dark", "gaps"))
        self.assertAlmostEqual(found["dark_current_e_per_s"]["value"], 90, delta=1)  # 120 by the header's gain
        self.assertAlmostEqual(found["readout_ramp_dn"]["value"], 100, delta=3)

    @unittest.skipUnless(os.path.exists(NEOSSAT), "BORESIGHT_NEOSSAT names no folder with the dark")
    def test_neossat(self):
        """The raw dark of 28 s against figures of another program (numpy), and the header's gain."""
        out = runs.scratch() + "/out"
        result = call("characterize", "--map", "neossat", "--dark", NEOSSAT, "--out", out)
        self.assertEqual(result.returncode, 0, result.stderr)
        with open(out + "/report.json", encoding="utf-8") as file:
            report = json.load(file)
        value = {key: figure["value"] for key, figure in report["figures"].items()}
        self.assertAlmostEqual(value["read_noise_e"], 18.4, delta=0.05 * 18.4)
        self.assertAlmostEqual(value["dark_current_median_e_per_s"], 10, delta=0.5)
        self.assertAlmostEqual(value["readout_ramp_dn"], 269, delta=0.02 * 269)
        self.assertAlmostEqual(value["pick_up_cycles_per_px"], 0.170, delta=0.0005)
        self.assertTrue(0.10 <= value["cti_parallel_trail_fraction"] <= 0.13)
        self.assertEqual(report["charge_trail"]["parallel_direction"], "rows_above")
        self.assertIsNone(value["prnu_rms"])
        # a frame made with the keys: what characterize says of both
        with open(out + "/detector.json", encoding="utf-8") as file:
            scenario = json.load(file)
        scenario["extends"] = os.path.abspath(runs.STARE)
        scenario["set"].update({CAMERA + "width_px": 1072, CAMERA + "height_px": 1030})
        with open(out + "/scene.json", "w", encoding="utf-8") as file:
            json.dump(scenario, file)
        call_well("calframes", out + "/scene.json", "--out", out + "/sim", "--bias", "0", "--dark", "1", "--flat", "0",
                  "--exposure", "28", "--threads", "1", "--set", "/world/star_catalogue=embedded")
        call_well("characterize", "--map", "neossat", "--dark", NEOSSAT, "--out", out, "--overwrite",
                  "--simulated", out + "/sim/neossat_telescope_dark.fits")
        with open(out + "/report.json", encoding="utf-8") as file:
            both = json.load(file)["reproduction"]
        self.assertAlmostEqual(both["median_dn"]["simulated"] / both["median_dn"]["real"], 1, delta=0.1)
        for item in both["percentiles_over_median_dn"]:
            if item["percentile"] != 50:
                self.assertAlmostEqual(item["simulated"] / item["real"], 1, delta=0.1 if item["percentile"] <= 95 else 0.3, msg=item)


if __name__ == "__main__":
    unittest.main()
