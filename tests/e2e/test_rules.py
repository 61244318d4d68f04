#!/usr/bin/env python3
"""What `boresight check` and `boresight run` say of scenarios that hardly mean what they say.

Usage, from the repository root: /usr/bin/python3 tests/e2e/test_rules.py BORESIGHT
"""
import json
import os
import re
import subprocess
import unittest

import erfa
import numpy as np

import figures
import runs
from optics import AU_M, angle

MODULES = runs.SENSOR + "/modules"
# rule, override, words of the warning
CASES = [("duration", "/duration_s=0", "/duration_s: the run lasts 0 s"),
         ("element_age", '/epoch_utc="2022-08-16T22:10:00Z"', "2 of 2 element sets of observers and listed objects are more than 14 days"),
         ("earth_orientation", '/epoch_utc="2030-06-16T22:10:00Z"', "/world/earth_orientation"),
         ("burns", '/world/objects/0/burns=[{"time_s": 300, "dv_rtn_mps": [0, 1, 0]}]',
          "/world/objects/0/burns/0/time_s: the burn at 300 s is after the run's end at 300 s"),
         ("lost_frames", runs.SENSOR + "/exposure/dropped_fraction=1", "1 loses every frame"),
         ("lost_frames", runs.SENSOR + "/exposure/first_s=299.9", "/exposure/first_s: the first exposure, from 299.9 s, ends at 300.4 s"),
         ("modules", MODULES + "={}", "nothing is seen or recorded"),
         ("modules", MODULES + '={"gimbal": {"type": "second_order"}, "scenegen": {"type": "opencl"}, "imgproc": '
          '{"type": "standard"}, "control": {"type": "standard"}}', "modules/tracker: there is none"),
         ("exposure_period", runs.SENSOR + "/exposure/exposure_s=2", "longer than the period_s of 1 s"),
         ("wide_field", runs.SENSOR + "/camera/pixel_scale_arcsec=300", "diagonal is 93 degrees"),
         ("replaced", runs.SENSOR + "/camera/ensquared_energy=0.4",
          "/observers/0/sensors/0/camera/psf_fwhm_px: 2 is not used: /observers/0/sensors/0/camera/ensquared_energy gives 1.30666"),
         ("replaced", runs.SENSOR + "/camera/zero_point_mag=20",
          "/camera/photon_flux_v0_per_s_m2: 3.6e+10 is not used: /observers/0/sensors/0/camera/zero_point_mag gives"),
         ("no_effect", runs.SENSOR + "/knowledge/camera/distortion/k1=0.1",
          "/observers/0/sensors/0/knowledge/camera/distortion has no effect: override_distortion is false"),
         ("no_effect", MODULES + "/tracker/rate_hz=5",
          '/observers/0/sensors/0/modules/tracker/rate_hz has no effect: tracker "ekf" steps when its inputs come'),
         ("short_times", MODULES + "/tracker/initiation_gap_s=0.5", "no track can begin"),
         ("short_times", MODULES + "/tracker/max_coast_s=0.5", "every track ends"),
         ("short_times", MODULES + "/control/dwell_timeout_s=4", "(5 s here)"),
         ("short_times", MODULES + "/control/acquire_timeout_s=1", "before it can be confirmed"),
         ("loops", MODULES + '/control/compensator={"type": "pi", "crossover_hz": 0.07, '
          '"phase_margin_deg": 45, "gain_scale": 3}', "has thin margins"),
         ("burn_rates", '/world/objects/0/burns=[{"time_s": 100, "dv_rtn_mps": [0, 0, 2000]}]',
          "/world/objects/0/burns/0: at "),
         ("reach", "/duration_s=86400", "the cue is out of reach from"),
         ("reach", MODULES + "/gimbal/accel_limit_degps2=0.001", "for a step of the search"),
         ("bodies", "/duration_s=86400", "the Earth is in the field from")]


def check(*words):
    return runs.call("check", *words)


class Rules(unittest.TestCase):
    def test_each_rule_speaks_and_is_listed(self):
        listed = [line.split()[0] for line in check("--rules").stdout.splitlines()]
        self.assertEqual(sorted(listed), sorted({rule for rule, _, _ in CASES}))
        for rule, override, words in CASES:
            source = [] if rule == "modules" else ["--set", runs.GENERATOR]
            said = check(runs.TRACK, "--quiet", *source, "--set", override)
            self.assertEqual(said.returncode, 0, said.stderr)
            self.assertIn(words, said.stderr, rule)
            self.assertIn("warning", said.stderr, rule)

    def test_limits_have_two_sides(self):
        """What is just allowed is not warned of; what is just beyond is, with its numbers. The period is 1 s, or as long as the exposure."""
        exposure, tracker, control = runs.SENSOR + "/exposure/", MODULES + "/tracker/", MODULES + "/control/"
        # key, just allowed, just beyond, words
        limits = [("/world/objects/0/burns", '[{"time_s": 99.9, "dv_rtn_mps": [0, 0.01, 0]}]', '[{"time_s": 100, "dv_rtn_mps": [0, 0.01, 0]}]',
                   "/world/objects/0/burns/0/time_s: the burn at 100 s is after the run's end at 100 s"),
                  (exposure + "first_s", 98.9, 99.6, "first exposure, from 99.6 s, ends at 100.7 s, after the run's end at 100 s"),
                  (exposure + "dropped_fraction", 0.999, 1, "1 loses every frame"),
                  (exposure + "exposure_s", 1, 1.1, "an exposure_s of 1.1 s is longer than the period_s of 1 s"),
                  (control + "exposure_s", 1, 1.1, ""),
                  (tracker + "initiation_gap_s", 1, 1.09, "initiation_gap_s: 1.09 s is shorter than frames allow (1.1 s here): no track can begin"),
                  (tracker + "max_coast_s", 1, 1.09, "max_coast_s: 1.09 s is shorter than frames allow (1.1 s here): every track ends"),
                  (control + "dwell_frames", 4, 4, ""),
                  (control + "dwell_timeout_s", 5, 5.49, "dwell_timeout_s: 5.49 s is shorter than frames allow (5.5 s here)"),
                  (tracker + "confirm_hits", 3, 3, ""),
                  (control + "acquire_timeout_s", 3, 3.29, "acquire_timeout_s: 3.29 s is shorter than frames allow (3.3 s here)"),
                  # half a diagonal of 724.08 px is 37.5 degrees at 218.6 arcsec
                  (runs.SENSOR + "/camera/pixel_scale_arcsec", 218, 219, "the field's diagonal is 75 degrees")]
        for side in (1, 2):
            sets = [w for limit in limits for w in ("--set", f"{limit[0]}={limit[side]}")]
            said = check(runs.TRACK, "--quiet", "--set", runs.GENERATOR, "--set", "/duration_s=100", *sets)
            self.assertEqual(said.returncode, 0, said.stderr)
            for _, _, _, words in limits:
                if words and side == 2:
                    self.assertIn(words, said.stderr)
                elif words:
                    self.assertNotIn(re.split(r"[\d.]+ s|1 loses|\d+ degrees", words.split(": ")[-1])[0].strip() or words, said.stderr)

    def test_thin_margins_are_those_of_the_loop(self):
        override = MODULES + '/control/compensator={"type": "pi", "crossover_hz": 0.07, "phase_margin_deg": 45, "gain_scale": 3}'
        said = check(runs.TRACK, "--quiet", "--set", runs.GENERATOR, "--set", override).stderr
        warned = re.findall(r"the (\S+) axis (?:is unstable|has thin margins).*?: gain margin ([-\d.einf]+) dB, phase margin ([-\d.einf]+) deg, "
                            r"sensitivity peak ([-\d.einf]+)", said)
        self.assertTrue(warned, said)
        axes = {axis["axis"]: axis for axis in
                json.loads(runs.call("loop", runs.TRACK, "--set", override, "--json", "-").stdout)["sensors"][0]["axes"]}
        for axis, *numbers in warned:
            for number, key in zip(numbers, ("gain_margin_db", "phase_margin_deg", "sensitivity_peak")):
                self.assertAlmostEqual(float(number), axes[axis][key], delta=0.006 * abs(axes[axis][key]))  # three digits

    def test_times_out_of_reach(self):
        """When the cue enters and leaves the cones about Sun and Moon and goes behind the Earth, by SGP4 and ERFA: 0.02 degrees
        of aberration, 0.2 of the Earth's figure. The Moon's parallax is a degree."""
        guidance = MODULES + "/control/guidance"
        said = check(runs.TRACK, "--quiet", "--set", runs.GENERATOR, "--set", "/duration_s=86400", "--set", guidance + "/moon_keep_out_deg=60", "--set",
                     guidance + "/sun_keep_out_deg=60", "--set", runs.SENSOR + "/cue/offset_deg=0").stderr
        spans = {why: (float(a), float(b)) for a, b, why in re.findall(
            r"out of reach from ([\d.]+) s until ([\d.]+) s: ([\w -]+?)(?: \(|$)", said, re.M)}
        with open(runs.TRACK, encoding="utf-8") as file:
            epoch = json.load(file)["epoch_utc"]
        eye, target = (figures.Orbit("scenarios/catalogue_2022-06.tle", norad, epoch) for norad in (39089, 44801))

        def angles(t):
            here = eye.position(t)
            tt = erfa.taitt(*erfa.utctai(eye.utc[0], eye.utc[1] + t / 86400))
            sun = -np.array(erfa.epv00(*tt)[0]["p"]) * AU_M - here
            moon = np.array(erfa.moon98(*tt)["p"]) * AU_M - here
            line = target.position(t) - here
            degrees = [np.degrees(angle(line, body)) for body in (sun, moon, -here)]
            return degrees[0], degrees[1], degrees[2] - np.degrees(np.arcsin(6371e3 / np.linalg.norm(here)))
        # it leaves the Sun's cone behind the Earth
        self.assertAlmostEqual(angles(spans["in the keep-out cone of the Sun"][0])[0], 60, delta=0.03)
        begin, end = spans["in the keep-out cone of the Moon"]
        self.assertEqual(begin, 0)
        self.assertLess(angles(0)[1], 60)
        self.assertAlmostEqual(angles(end)[1], 60, delta=0.03)
        for t in spans["behind the Earth"]:
            self.assertAlmostEqual(angles(t)[2], 0, delta=0.2)

    def test_the_shipped_scenario_is_not_warned_of(self):
        self.assertEqual(check(runs.TRACK, "--quiet").stderr, "")

    def test_a_field_beyond_the_projection_is_an_error(self):
        said = check(runs.TRACK, "--quiet", "--set", runs.SENSOR + "/camera/width_px=16384", "--set",
                     runs.SENSOR + "/camera/height_px=16384", "--set",
                     runs.SENSOR + "/camera/pixel_scale_arcsec=600")
        self.assertEqual(said.returncode, 1)
        self.assertIn("/observers/0/sensors/0/camera: the field's diagonal is", said.stderr)

    def test_run_says_it_too(self):
        out = os.path.join(runs.scratch(), "run")
        said = subprocess.run(runs.command(runs.TRACK, out, runs.NO_FRAMES, MODULES + "/tracker/initiation_gap_s=0.5",
                                           duration=2), capture_output=True, text=True, check=True)
        self.assertIn("no track can begin", said.stderr)

    def test_a_run_that_does_not_fit_is_refused_before_it_starts(self):
        out = os.path.join(runs.scratch(), "run")
        # 33 TB of frames: more than is free anywhere
        said = subprocess.run(runs.command(runs.STARE, out, runs.SENSOR + "/camera/width_px=8192",
                                           runs.SENSOR + "/camera/height_px=8192", duration=250000),
                              capture_output=True, text=True, check=False)
        self.assertEqual(said.returncode, 1)
        self.assertIn("--force", said.stderr)
        self.assertFalse(os.path.exists(out + ".partial"))

    def test_a_window_is_read_out(self):
        out = os.path.join(runs.scratch(), "run")
        runs.run(runs.STARE, out, runs.SENSOR + "/exposure/window_px=[128, 64, 512, 384]", runs.NO_FRAMES, duration=3)
        for row in runs.database(out).execute("SELECT x0_px, y0_px, width_px, height_px FROM frames"):
            self.assertEqual(tuple(row), (128, 64, 512, 384))
        said = check(runs.STARE, "--quiet", "--set", runs.SENSOR + "/exposure/window_px=[1000, 0, 512, 10]")
        self.assertEqual(said.returncode, 1)
        self.assertIn("is no window of the sensor", said.stderr)


def tearDownModule():
    runs.clean()


if __name__ == "__main__":
    unittest.main()
