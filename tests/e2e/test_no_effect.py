#!/usr/bin/env python3
"""Keys that another key leaves without effect: `boresight check` warns of each, and runs are the same without them.

Usage, from the repository root: /usr/bin/python3 tests/e2e/test_no_effect.py BORESIGHT
"""
import glob
import json
import os
import unittest

from astropy.io import fits

import runs

SENSOR, CAMERA, MODULES = runs.SENSOR, runs.SENSOR + "/camera", runs.SENSOR + "/modules"
PLATFORM, CONTROL, TRACKER, IMGPROC = (MODULES + "/" + name for name in ("gimbal/platform", "control", "tracker", "imgproc"))
OBSERVER, OBJECT = "/observers/0", "/world/objects/0"
WORDS = " has no effect: "
STEPS = '"standard" steps when its inputs come'

# of scenes with images: the reason, where, values that are not the defaults
IMAGES = [
    ("override_distortion is false", SENSOR + "/knowledge/camera", {"distortion": {"k1": 50}}),
    ("position_error_fraction is 0", SENSOR + "/knowledge/stars", {"position_error_sigma_arcsec": 30}),
    ("missing_fraction is 0 and position_error_fraction is 0", SENSOR + "/knowledge/stars", {"seed": 7}),
    ("psf_file is \"\"", SENSOR + "/knowledge/camera", {"psf_oversampling": 3}),
    ("dropped_fraction is 0", SENSOR + "/exposure", {"dropped_burst_frames": 5}),
    ("object is \"INMARSAT GX5\"", SENSOR + "/cue", {"direction_radec_deg": [10, 20]}),
    ("kind is \"none\"", SENSOR + "/cue/region", {"arc_radec_deg": [1, 2, 3, 4], "longitude_deg": [1, 2], "half_width_deg": 4}),
    ("optics/psf is \"gaussian\"", CAMERA, {"optics/moffat_beta": 4}),
    ("psf is \"gaussian\"", CAMERA + "/optics",
     {"central_obstruction": 0.4, "q": 3, "band_nm": [500, 600], "spectrum": "solar", "wavelengths": 3, "spiders": {"count": 3},
      "zernike_nm": 600, "zernike_waves": {"z4": 0.2}, "psf_oversampling": 3, "file_centre": "array"}),
    ("model is \"none\"", CAMERA + "/optics/vignetting", {"coefficients": [0.1, 0, 0]}),
    ("preset is \"v\" and response is [] and response_file is \"\"", CAMERA + "/band",
     {"optics_temperature_k": 400, "optics_emissivity": 0.5, "optics_beam_factor": 3}),
    ("model is \"uniform\"", CAMERA + "/background", {"zodiacal": False, "starlight": False, "diffuse_galactic_fraction": 2}),
    ("stray_map_file is \"\"", CAMERA + "/background", {"stray_map": "share", "stray_map_scale": 3}),
    ("telegraph_noise_fraction is 0", CAMERA + "/detector", {"telegraph_noise_rms_e": 50}),
    ("hot_fraction is 0", CAMERA + "/detector", {"hot_median_e_per_s": 5e4, "hot_spread_dex": 1}),
    ("rate_per_cm2_s is 0", CAMERA + "/detector/cosmic_rays",
     {"pixel_pitch_um": 20, "depth_um": 50, "e_per_um": 200, "straggling": 0.5, "readout_s": 3}),
    ("model is \"uniform\"", CAMERA + "/detector/quantisation", {"bits": 5, "expand": False}),
    ("amplitude_e is 0", CAMERA + "/detector/pick_up", {"cycles_per_px": 0.1, "cycles_per_row": 0.2, "phase_deg": 4}),
    ("peak_e is 0", CAMERA + "/detector/glow", {"scale_px": 4, "x_px": 3, "y_px": 9}),
    ("traps_per_px is [0,0,0]", CAMERA + "/detector/parallel_traps", {"release_px": [2, 2, 2], "fill_exponent": 0.9, "reference_e": 10}),
    ("trapped_share is [0,0,0,0,0]", CAMERA + "/detector/persistence", {"time_constant_s": [2, 3, 4, 5, 6]}),
    ("reads is 0", CAMERA + "/detector/ramp", {"fit": "last_minus_first", "flicker_noise_e": 9}),
    ("rms_e is 0", CAMERA + "/detector/pixel_flicker_noise", {"lowest_hz": 0.01, "highest_hz": 5}),
    ("outputs is 1", CAMERA + "/detector/crosstalk", {"coupling": 0.05, "mirrored": False}),
    ("source is \"sgp4\"", OBSERVER + "/orbit",
     {"forces/degree": 4, "forces/sun": False, "state": {"position_gcrf_m": [7e6, 0, 0]}, "spacecraft/mass_kg": 3, "offset_rtn_m": [1, 2, 3],
      "at_s": 4, "oem_file": "x.oem", "states_frame": "teme", "member": [2, 3]}),
    ("model is \"sphere\"", OBJECT + "/brightness", {"standard_v_mag": 9, "light_curve_period_s": 4}),
    ("brightness/model is \"sphere\"", OBJECT, {"attitude": [{"law": "sun"}]}),
    ("faint_stars is \"none\"", "/world", {"faint_limit_v_mag": 12, "faint_seed": 5}),
    ("custody is false", "/record", {"custody_sigma_m": 20, "custody_within_m": 9}),
    ("planes is []", "/record", {"mask_threshold_sigma": 4}),
    ("mode is \"lockstep\"", "/pacing", {"overrun": "drop", "speed": 7}),
    ("track_windows is false", IMGPROC, {"window_px": 100, "window_stars": 5, "full_frame_period": 7}),
    ("enabled is false", IMGPROC + "/camera_calibration", {"scale_sigma": 0.04, "drift_px_per_sqrt_h": 3}),
    ("frames is 0", IMGPROC + "/stack", {"rate_px_per_frame": 9}),
    ("enabled is false", IMGPROC + "/extended", {"handover_fwhm": 9, "target_size_m": 4}),
    ("imgproc " + STEPS, IMGPROC, {"rate_hz": 10, "offset_s": 1}),
    ("scenegen \"opencl\" steps when its inputs come", MODULES + "/scenegen", {"rate_hz": 10, "offset_s": 1}),
    ("tracker \"ekf\" steps when its inputs come", TRACKER, {"rate_hz": 10, "offset_s": 1}),
]
# of the loop, with the generator
LOOP = [
    ("strategy is \"track\"", CONTROL, {"stare_time_s": 5, "fixed_frame": "body", "fixed_direction": [1, 0, 0], "scan_rate_arcsec_per_s": 5}),
    ("modules/control/strategy is \"track\" and cue/region/kind is \"none\"", SENSOR, {"modules/control/search_rate": "sidereal"}),
    ("earth_keep_out is false", CONTROL + "/guidance", {"earth_limb_keep_out_deg": 20, "earth_limb_altitude_km": 300}),
    ("prediction_horizon_s is 0", CONTROL + "/guidance", {"prediction_interval_s": 2, "loss_tolerance_px": 9}),
    ("type is \"observer\"", CONTROL + "/compensator",
     {"phase_margin_deg": 70, "bandwidth_hz": 0.1, "lead_zero_hz": 0.1, "low_pass_hz": 0.1, "feed_forward": 0.2, "output_limit": 1e-9}),
    ("motion is \"constant_rate\"", TRACKER,
     {"assumed_range_km": 4e4, "range_sigma": 0.5, "range_rate_sigma_mps": 9, "size_range_correlation_s": 4, "orbit_noise_mps15": 1}),
    ("clock_sigma_s is 0", TRACKER, {"navigation_sigma_m": 500}),
    ("type is \"inertial\"", PLATFORM + "/spacecraft",
     {"inertia_kgm2": [9, 9, 9, 0, 0, 0], "initial_rate_degps": [1, 1, 1], "attitude": {"law": "sun"}, "gyro": {"bias_degph": [9, 9, 9]},
      "disturbances": {"srp_area_m2": 9}, "modes": [{"frequency_hz": 1, "coupling": [1, 1, 1]}]}),
]
# with other variants: what chooses them, then as above
VARIANTS = [
    ([CONTROL + "/strategy=rate"], ("strategy is \"rate\"", CONTROL,
     {"search_pattern": "spiral", "search_step": 0.3, "dwell_frames": 9, "candidate_hits": 9, "track_handover_px": 1, "reacquire_coast_s": 1})),
    ([CONTROL + "/compensate_attitude=false"], ("compensate_attitude is false", CONTROL,
     {"robust_observer": False, "servo_lag_s": 1, "compensator": {"gain_scale": 2, "delay_s": 1}})),
    ([TRACKER + "/type=imm"], ("type is \"imm\"", TRACKER, {"steady_noise_share": 0.9})),
    ([TRACKER + "/max_dormant_tracks=0"], ("max_dormant_tracks is 0", TRACKER, {"max_dormant_s": 5, "dormant_gate_chi2": 3})),
    ([TRACKER + "/event_window=0"], ("event_window is 0", TRACKER, {"false_events_per_hour": 1000})),
    ([PLATFORM + "/spacecraft/type=rigid_body"], ("spacecraft/type is \"rigid_body\"", PLATFORM,
     {"drift_arcsec_per_s": [50, 50, 50], "attitude_bias_arcsec": [500, 500, 500], "attitude_noise_arcsec": 300})),
]


def overrides(groups):
    return [f"{where}/{key}={json.dumps(value)}" for _, where, values in groups for key, value in values.items()]


def warnings(scenario, *sets):
    words = [word for one in sets for word in ("--set", one)]
    said = runs.call("check", scenario, "--quiet", *words)
    if said.returncode != 0:
        raise AssertionError(said.stderr)
    return [line.split(": ", 3)[3] for line in said.stderr.splitlines() if WORDS in line]


def content(out):
    """All rows of a run's tables, and the pixels of its frames."""
    base = runs.database(out)
    names = [row[0] for row in base.execute("SELECT name FROM sqlite_master WHERE type = 'table'")]
    result = {name: sorted(repr(tuple(row)) for row in base.execute(f"SELECT * FROM {name}")) for name in names}
    for path in sorted(glob.glob(out + "/**/*.fits", recursive=True)):
        with fits.open(path) as units:
            result[os.path.relpath(path, out)] = [b"" if unit.data is None else unit.data.tobytes() for unit in units]
    return result


class NoEffect(unittest.TestCase):
    def same(self, groups, *sets, duration):
        """Runs with and without the keys have the same rows and pixels."""
        folders = [os.path.join(runs.scratch(), name) for name in ("with", "without")]
        for out, more in zip(folders, (overrides(groups), [])):
            runs.run(runs.TRACK, out, *sets, *more, duration=duration)
        one, other = (content(out) for out in folders)
        self.assertGreater(sum(map(len, one.values())), 100)
        self.assertEqual([name for name in one if one[name] != other.get(name)], [])

    def warned(self, groups, *sets):
        """Each key is named, with the reason of its group, and nothing else."""
        said = warnings(runs.TRACK, *sets, *overrides(groups))
        for reason, where, values in groups:
            for key in values:
                own = [line for line in said if line.startswith(f"{where}/{key}{WORDS}")]
                self.assertEqual(len(own), 1, f"{where}/{key}: {own}")
                self.assertIn(reason, own[0])
        self.assertEqual(len(said), sum(len(values) for _, _, values in groups))

    def test_each_key_is_named_with_its_reason(self):
        self.warned(IMAGES)
        self.warned(LOOP, runs.GENERATOR)
        for sets, group in VARIANTS:
            self.warned([group], runs.GENERATOR, *sets)

    def test_images_are_the_same_without_them(self):
        self.same(IMAGES, CAMERA + "/width_px=256", CAMERA + "/height_px=256", duration=4)

    def test_loops_are_the_same_without_them(self):
        self.same(LOOP, runs.GENERATOR, runs.NO_FRAMES, duration=90)
        for sets, group in VARIANTS:
            self.same([group], runs.GENERATOR, runs.NO_FRAMES, *sets, duration=30)

    def test_a_key_that_has_an_effect_is_not_named(self):
        k1 = SENSOR + "/knowledge/camera/distortion/k1=1"
        self.assertEqual(warnings(runs.TRACK, runs.GENERATOR, SENSOR + "/knowledge/camera/override_distortion=true", k1), [])
        # nor one whose governing key a change sets
        later = '/changes=[{"time_s": 1, "set": "' + SENSOR + '/knowledge/camera/override_distortion=true"}]'
        self.assertEqual(warnings(runs.TRACK, runs.GENERATOR, k1, later), [])
        # nor a default that is written out
        self.assertEqual(warnings(runs.TRACK, runs.GENERATOR, SENSOR + "/exposure/dropped_burst_frames=0"), [])

    def test_keys_of_a_file_that_is_extended_count(self):
        folder = runs.scratch()
        base, own = os.path.join(folder, "base.json"), os.path.join(folder, "own.json")
        for path, document in ((base, {"extends": os.path.abspath(runs.TRACK), "set": {SENSOR + "/exposure/dropped_burst_frames": 4}}),
                               (own, {"extends": "base.json", "name": "own"})):
            with open(path, "w", encoding="utf-8") as file:
                json.dump(document, file)
        self.assertEqual(warnings(own, runs.GENERATOR), [SENSOR + "/exposure/dropped_burst_frames" + WORDS + "dropped_fraction is 0"])

    def test_many_places_are_counted(self):
        with open(runs.TRACK, encoding="utf-8") as file:
            first = json.load(file)["world"]["objects"][0]
        objects = [{**first, "brightness": {"standard_v_mag": 7}, "name": f"copy{i}" if i else first["name"]} for i in range(9)]
        said = runs.call("check", runs.TRACK, "--quiet", "--set", runs.GENERATOR, "--set", "/world/objects=" + json.dumps(objects)).stderr
        self.assertEqual(said.count(WORDS), 3)
        self.assertIn("standard_v_mag has no effect in 6 places more", said)

    def test_shipped_scenarios_have_none(self):
        scenes = [path for path in sorted(glob.glob("scenarios/*.json")) if not path.endswith("schema.json")]
        self.assertGreater(len(scenes), 20)
        for scene, said in zip(scenes, runs.parallel(lambda path: warnings(path, runs.GENERATOR), scenes)):
            self.assertEqual(said, [], scene)

    def test_a_resolved_scenario_has_none(self):
        path = os.path.join(runs.scratch(), "resolved.json")
        with open(path, "w", encoding="utf-8") as file:
            file.write(runs.call("check", runs.TRACK, "--set", runs.GENERATOR).stdout)
        self.assertEqual(warnings(path), [])


def tearDownModule():
    runs.clean()


if __name__ == "__main__":
    unittest.main()
