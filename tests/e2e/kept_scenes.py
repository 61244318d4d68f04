"""The scenes of test_figures_kept.py: small, short, and odd in as many ways at a time as they bear. Nothing is square,
centred, aligned, or equal to its neighbour."""
import copy
import json
import os

import numpy as np
from astropy.io import fits

ELEMENTS = os.path.abspath("scenarios/catalogue_2022-06.tle")
SHAPES = os.path.abspath("scenarios/satellites")
TARGET, EYE = 44801, 39089


# two tetrahedra, one without a material
MESH = """mtllib none.mtl
v 0 0 0
v 1.2 0 0
v 0 0.7 0
v 0 0 0.4
f 1 3 2
f 1 2 4
usemtl white_paint
f 2 3 4
f 3 1 4
"""


def sgp4(norad):
    return {"source": "sgp4", "elements_file": ELEMENTS, "norad": norad}


def shipped(name):
    """A scenario that comes with the program, with those that it extends, and paths from anywhere."""
    with open(f"scenarios/{name}.json", encoding="utf-8") as file:
        scene = json.load(file)
    scene.pop("$schema")
    if "extends" in scene:
        base = shipped(scene.pop("extends")[:-len(".json")])
        changes = scene.pop("set", {})
        base.update(scene)
        scene = base
        for pointer, value in changes.items():
            put(scene, pointer, value)
    return absolute(scene)


def absolute(node):
    if isinstance(node, dict):
        return {k: os.path.abspath(os.path.join("scenarios", v)) if k.endswith("_file") and isinstance(v, str) and v != "theory"
                else absolute(v) for k, v in node.items()}
    return [absolute(v) for v in node] if isinstance(node, list) else node


def put(scene, pointer, value):
    *path, last = pointer.strip("/").split("/")
    for key in path:
        if isinstance(scene, list):
            scene = scene[int(key)]
        else:
            scene = scene.setdefault(key, {})
    scene[int(last) if isinstance(scene, list) else last] = value


def changed(scene, changes):
    scene = copy.deepcopy(scene)
    for pointer, value in changes.items():
        put(scene, pointer, value)
    return scene


def track(**changes):
    """The closed loop of neossat_geo_track with a small, odd field."""
    scene = shipped("neossat_geo_track")
    scene["world"]["star_catalogue"] = "embedded"
    return changed(scene, {k.replace("__", "/"): v for k, v in changes.items()})


SENSOR = "/observers/0/sensors/0"
SMALL = {SENSOR + "/camera/width_px": 300, SENSOR + "/camera/height_px": 232, SENSOR + "/cue/offset_deg": 0.03,
         SENSOR + "/cue/sigma_deg": 0.05, SENSOR + "/cue/offset_axis": "-y", SENSOR + "/cue/offset_angle_deg": 25}
KNOWLEDGE = {"stars": {"missing_fraction": 0.1, "position_error_fraction": 0.1, "position_error_sigma_arcsec": 2, "seed": "0x7"},
             "camera": {"scale_error_ppm": 60, "rotation_error_deg": 0.01, "throughput_error": -0.04, "psf_fwhm_px": 2.1,
                        "override_distortion": True, "distortion": {"k1": -150, "p1": 0.2}},
             "clock_offset_s": 0.004,
             "orbit": {"position_rtn_m": [80, -140, 60], "velocity_rtn_mps": [0.05, -0.02, 0.04], "along_track_drift_mps": 0.3}}


def unlike():
    """Two observers, three sensors, unlike in everything: windows, binning, overscan, mounts, filters, knowledge."""
    scene = track()
    scene["world"].update(objects=scene["world"]["objects"] + [
        {"name": "NEIGHBOUR", "area_m2": 9, "albedo": 0.15,
         "orbit": {"source": "relative", "reference": "INMARSAT GX5", "offset_rtn_m": [9000, -6000, 4000],
                   "rate_rtn_mps": [0.4, -0.8, 0.6]}}])
    first = scene["observers"][0]["sensors"][0]
    second, third = copy.deepcopy(first), copy.deepcopy(first)
    first["name"] = "skewed"
    first["x_axis_gcrf"] = [0.3, -0.5, 0.8]
    first["camera"].update(
        width_px=336, height_px=270, rotation_deg=33, boresight_offset_px=[14, -9], obscuration=0.2, aperture_m=0.2,
        distortion={"k1": -200, "k2": 900, "p1": 0.3, "p2": -0.2}, dark_current_e_per_s=5,
        detector={"overscan": {"left": 8, "right": 14, "bottom": 6, "top": 10}, "shielded": {"left": 2, "right": 4, "bottom": 6, "top": 2},
                  "column_offset_rms_e": 6, "row_offset_rms_e": 4, "dsnu_rms": 0.3, "prnu_rms": 0.01, "hot_fraction": 0.0008,
                  "output": {"right": True, "top": False}, "readout_s": 0.2, "bad_columns": 1})
    first["exposure"].update(window_px=[24, 16, 288, 228], binning=2, dropped_fraction=0.1, first_s=0.3)
    first["cue"].update(offset_deg=0.02, offset_axis="y", offset_angle_deg=20, sigma_deg=0.05)
    first["knowledge"] = KNOWLEDGE
    first["modules"]["imgproc"].update(column_correction="on", bad_pixels=[{"x": 40, "y": 77}], reference_pixels={"enabled": True})
    first["modules"]["control"]["guidance"] = {"acceleration_feed_forward": True, "slews": "planned", "min_planned_slew_deg": 0.005}
    second.update(name="turned", x_axis_gcrf=[-0.8, 0.1, 0.2], observation_source="generator")
    second["camera"].update(width_px=520, height_px=400, pixel_scale_arcsec=7, rotation_deg=-71, aperture_m=0.11, psf_fwhm_px=1.7,
                            background_mag_arcsec2=21, read_noise_e=11, gain_e_per_dn=2.3, offset_dn=300, bits=14)
    second["exposure"].update(exposure_s=0.7, period_s=1.2, binning=1, window_px=[0, 0, 480, 360])
    second["cue"].update(offset_deg=0.05, sigma_deg=0.08, v_mag=12)
    with open("scenarios/rigid_spacecraft.json", encoding="utf-8") as file:
        rigid = json.load(file)["set"]
    second["modules"]["gimbal"] = {
        "type": "cross_elevation", "third_axis": True, "rate_hz": 1000, "start_deg": [3, -4, 2], "delay_s": {"los_command": 0.03},
        "flexible": {"frequency_hz": [60, 45, 0], "inertia_fraction": [0.15, 0.1, 0.2]},
        "platform": {"attitude_bias_arcsec": [4, -7, 3], "attitude_noise_arcsec": 1,
                     "jitter_psd": {"unit": "arcsec", "y_scale": 0.6,
                                    "low": [{"frequency_hz": 0.005, "psd": 20}, {"frequency_hz": 0.5, "psd": 0.02}],
                                    "high": [{"frequency_hz": 5, "psd": 0.0009}, {"frequency_hz": 80, "psd": 0.0002}],
                                    "lines": [{"frequency_hz": 62, "amplitude": 0.2, "axis": "y", "random_phase": False, "phase_deg": 40}]},
                     "spacecraft": dict(rigid[SENSOR + "/modules/gimbal/platform/spacecraft"], filter_warm_up_s=60,
                                        initial_attitude_error_deg=[0.2, -0.1, 0.3],
                                        star_trackers=[{"axis": [0.2, 1, -0.3], "noise_arcsec": 4},
                                                       {"axis": [1, -0.4, 0.5], "noise_arcsec": 2, "latency_s": 0.2}])}}
    second["modules"]["tracker"] = {"type": "ukf", "association": "pda", "assumed_range_km": 36000, "clock_sigma_s": 0.2,
                                    "catalogue_sigma_m": 700, "catalogue_sigma_mps": 0.3, "navigation_sigma_m": 90}
    second["modules"]["control"].update(delay_s={"tracks": 0.1}, command_latency_s=0.08, exposure_s=0.7)
    second["modules"].pop("scenegen")
    scene["observers"][0]["sensors"].append(second)
    third.update(name="far", observation_source="image")
    third["camera"].update(width_px=200, height_px=264, pixel_scale_arcsec=12, rotation_deg=140, aperture_m=0.09)
    third["exposure"].update(exposure_s=0.3, period_s=1.5, first_s=0.2)
    third["cue"].update(offset_deg=0.03, offset_axis="-x", sigma_deg=0.06)
    third["modules"].update(
        gimbal={"type": "azimuth_elevation", "rate_hz": 400, "friction": {"coulomb_nm": [0.025, 0.013, 0.006]}, "cable": {"zero_deg": [5, -3, 1]},
                "encoder": {"resolution_arcsec": 0.2}, "servo": {"compensator": {"crossover_hz": 5, "phase_margin_deg": 45}}},
        tracker={"type": "imm", "association": "mixture"})
    third["modules"]["control"].update(exposure_s=0.3, search_pattern="spiral", compensate_attitude=False)
    third["modules"]["obsgen"]["calibration_file"] = "theory"
    scene["observers"].append({
        "name": "follower", "sensors": [third],
        "orbit": {"source": "relative", "reference": "INMARSAT GX5", "offset_rtn_m": [-200000, -300000, 50000]}})
    scene.update(name="unlike", duration_s=24, seed="0x2a", record={
        "frames": "extensions", "compression": "none", "telemetry_hz": 4, "planes": ["stars", "targets", "saturation", "segmentation"]})
    return scene


def charge():
    """All that a detector does to charge, open loop; a diffraction image in colour; ghosts; a sky of many lights."""
    scene = shipped("diffraction")
    scene["world"]["star_catalogue"] = "embedded"
    sensor = scene["observers"][0]["sensors"][0]
    camera = sensor["camera"]
    camera.update(
        width_px=216, height_px=168, rotation_deg=-22, boresight_offset_px=[-11, 6], full_well_e=30000, pixel_scale_arcsec=9,
        detector={"temperature_c": 12, "prnu_rms": 0.02, "dsnu_rms": 0.4, "hot_fraction": 0.001, "dead_fraction": 0.0005,
                  "row_noise_e": 3, "telegraph_noise_fraction": 0.01, "telegraph_noise_rms_e": 20, "nonlinearity": [-0.02, 0.005, 0],
                  "saturation": "bloom", "frame_transfer_s": 0.02, "output": {"right": False, "top": True}, "clock_induced_e": 0.3,
                  "offset_noise_e": 1.5, "offset_drift_dn_per_frame": 0.4, "flicker_noise_e": 2, "readout_s": 0.15,
                  "shielded": {"left": 4, "right": 2, "bottom": 2, "top": 3},
                  "overscan": {"left": 3, "right": 9, "bottom": 5, "top": 2}, "pick_up": {"amplitude_e": 6, "cycles_per_px": 0.11, "cycles_per_row": 0.03, "phase_deg": 30},
                  "glow": {"peak_e": 40, "scale_px": 30, "x_px": 4, "y_px": 160}, "parallel_traps": {"traps_per_px": [0.02, 0.01, 0]},
                  "persistence": {"trapped_share": [0.01, 0.005, 0, 0, 0]},
                  "interpixel_coupling": 0.01, "brighter_fatter_per_e": 1e-7, "crosstalk": {"outputs": 2, "coupling": 0.002},
                  "cosmic_rays": {"rate_per_cm2_s": 30, "readout_s": 0.2}})
    camera["ghosts"] = [{"intensity": 0.002, "factor": -0.8, "centre_px": [4, -6], "radius_px": 9, "inner_radius_px": 3}]
    sensor["exposure"].update(exposure_s=0.4, period_s=0.9, binning=3, window_px=[0, 12, 198, 150])
    sensor["cue"]["direction_radec_deg"] = [263.3, -37.1]
    camera["optics"].update(wavelengths=3)
    sensor["modules"]["scenegen"].update(star_limit_v_mag=10, fidelity={"tolerance_sigma": 0.3})
    scene.update(name="charge", duration_s=3.5, record={"frames": "extensions", "compression": "rice", "planes": ["background", "parts", "segmentation"]})
    return scene


def rolling():
    """A rolling shutter on a turning camera with a sky of stray light, and non-destructive reads."""
    scene = shipped("datacube")
    scene["world"].update(star_catalogue="embedded", faint_stars="statistical", faint_limit_v_mag=13)
    sensor = scene["observers"][0]["sensors"][0]
    sensor["camera"].update(
        width_px=280, height_px=212, rotation_deg=48, boresight_offset_px=[21, 13], pixel_scale_arcsec=5,
        optics={"psf": "moffat", "moffat_beta": 3, "diffusion_px": 0.2, "vignetting": {"model": "cos4"}, "fill_factor": [0.9, 0.8]},
        background={"model": "sky", "pixel_pitch_um": 13, "diffuse_galactic_fraction": 0.2, "stray_e_per_s": 20, "gradient_e_per_s": [8, -14], "curvature_e_per_s": [5, 3, -7],
                    "pst": [{"angle_deg": 1, "pst": 1e-3}, {"angle_deg": 30, "pst": 1e-6}, {"angle_deg": 180, "pst": 1e-8}]},
        detector={"row_time_s": 0.0008, "double_sampling_s": 0.03, "reset_noise_e": 9, "em_gain": 3, "quantisation": {"model": "square_root", "bits": 12}})
    sensor["camera"].pop("obscuration", None)
    sensor["exposure"]["first_s"] = 0.1
    sensor["modules"]["gimbal"]["platform"].update(drift_arcsec_per_s=[23, -31, 40], jitter_high_px_rms=0.6)
    sensor["modules"]["imgproc"] = {"type": "standard", "stack": {"frames": 4}}
    sensor["modules"]["tracker"] = {"type": "ekf", "association": "gnn"}
    sensor["modules"]["scenegen"].update(star_limit_v_mag=13, fidelity={"tolerance_sigma": 0.3})
    scene.update(name="rolling", duration_s=5, record={"frames": "cube", "planes": ["background", "stars"]})
    return scene


def infrared():
    """A satellite with a shape, warm and resolved, from 400 m in the mid infrared; its attitude from a CCSDS AEM."""
    scene = shipped("inspection")
    scene["world"]["star_catalogue"] = "embedded"
    target = scene["world"]["objects"][0]
    target["brightness"].update(heat_balance="transient", earthshine=True, interreflection=False)
    target["shape"]["joints"] = [{"name": "north", "follows": "sun", "axis": [0, 1, 0], "normal": [0, 0, 1]},
                                 {"name": "dish", "follows": "spin", "axis": [0.2, 0, 1], "rate_deg_per_s": 11, "position_m": [0.2, 0.1, 0.7]}]
    parts = target["shape"]["parts"]
    parts[3]["joint"] = "north"
    parts[2]["joint"] = "dish"
    parts.append({"name": "can", "kind": "cylinder", "radius_m": 0.2, "length_m": 0.5, "position_m": [0.6, -0.1, -0.2], "rotation_deg": [30, 50, 0], "material": "white"})
    observer = scene["observers"][0]
    observer["orbit"]["offset_rtn_m"] = [70, -420, 110]
    observer["burns"] = [{"time_s": 6, "duration_s": 5, "dv_rtn_mps": [0.2, 0.9, -0.3]}]
    sensor = observer["sensors"][0]
    sensor["camera"].update(width_px=156, height_px=120, rotation_deg=70, boresight_offset_px=[5, -8], pixel_scale_arcsec=70,
                            aperture_m=0.02, band={"preset": "mwir"})
    sensor["camera"].pop("photon_flux_v0_per_s_m2")
    sensor["exposure"].update(exposure_s=0.02, period_s=1.5)
    sensor["modules"]["control"]["exposure_schedule"] = [{"time_s": 0, "exposure_s": 0.02}, {"time_s": 9, "exposure_s": 0.015}]
    sensor["cue"].update(offset_deg=0.1, sigma_deg=0.2)
    sensor["modules"]["obsgen"] = {"type": "statistical"}
    scene.update(name="infrared", duration_s=18, record={"frames": "extensions", "planes": ["background", "parts", "segmentation"], "compression": "none"})
    return scene


def visible():
    """The same satellite in the visible, a body without heat, and a second object with a light curve."""
    scene = infrared()
    sensor = scene["observers"][0]["sensors"][0]
    sensor["camera"].pop("band")
    sensor["camera"].update(photon_flux_v0_per_s_m2=3.6e10, aperture_m=0.003)
    target = scene["world"]["objects"][0]
    target["brightness"]["heat_balance"] = "none"
    target["orbit"]["forces"] = {"shape": True}
    scene["world"]["objects"].append({"name": "companion", "area_m2": 0.01, "albedo": 0.3,
                                      "orbit": {"source": "relative", "reference": "target", "offset_rtn_m": [30, 20, -15]}})
    scene.update(name="visible", duration_s=12)
    return scene


def wide():
    """The same satellite from 60 m, far off the axis of a wide, distorted field with the Earth in it."""
    scene = visible()
    observer = scene["observers"][0]
    observer["orbit"]["offset_rtn_m"] = [38, -52, 17]
    observer["burns"] = []
    sensor = observer["sensors"][0]
    sensor["camera"].update(width_px=104, height_px=78, pixel_scale_arcsec=500, boresight_offset_px=[34, -26], distortion={"k1": 0.4, "p1": -0.05}, aperture_m=0.001,
                            optics={"psf": "moffat", "moffat_beta": 3}, psf_fwhm_px=1.6,
                            background={"model": "sky", "pixel_pitch_um": 9, "pst": [{"angle_deg": 1, "pst": 1e-3}, {"angle_deg": 180, "pst": 1e-8}]})
    sensor["modules"] = {"gimbal": {"type": "ideal", "object": "target", "platform": {"drift_arcsec_per_s": [90, -140, 3000]}},
                         "scenegen": {"type": "opencl", "star_limit_v_mag": 6, "fidelity": {"tolerance_sigma": 1}}, "imgproc": sensor["modules"]["imgproc"]}
    sensor["exposure"].update(exposure_s=0.002)
    scene.update(name="wide", duration_s=3)
    return scene


def files():
    """Orbits from an OEM and from frames' states, an attitude that a file gives, a gyroscope's telemetry, a mirror of masses."""
    scene = shipped("frame_by_frame")
    scene["world"]["star_catalogue"] = "embedded"
    sensor = scene["observers"][0]["sensors"][0]
    sensor["camera"].update(width_px=512, height_px=512, rotation_deg=19, boresight_offset_px=[-9, 15], pixel_scale_arcsec=12)
    sensor["modules"]["imgproc"] = {"type": "standard"}
    sensor["modules"]["tracker"] = {"type": "ekf"}
    scene["name"] = "files"
    return scene


def oem():
    """Orbits from OEM, generator, control on board with a strategy of its own, compensator in loop."""
    scene = shipped("oem_orbits")
    scene["world"]["star_catalogue"] = "embedded"
    scene = changed(scene, {**SMALL, SENSOR + "/observation_source": "generator", SENSOR + "/camera/rotation_deg": -63,
                            SENSOR + "/modules/tracker": {"type": "imm", "smoothing_lag_frames": 3, "association": "nearest"},
                            SENSOR + "/modules/control/search_pattern": "raster", SENSOR + "/exposure/binning": 2,
                            SENSOR + "/exposure/window_px": [20, 8, 264, 212], SENSOR + "/knowledge": KNOWLEDGE})
    scene.update(name="oem", duration_s=200, record={"frames": "none", "telemetry_hz": 2})
    return scene


def lost():
    """Lost in space: no attitude from telemetry, then a turn; columns corrected; the camera learns itself."""
    scene = track(**{"duration_s": 14})
    scene = changed(scene, {**SMALL, SENSOR + "/camera/pixel_scale_arcsec": 9, SENSOR + "/camera/rotation_deg": 111,
                            SENSOR + "/camera/width_px": 400, SENSOR + "/camera/height_px": 330, SENSOR + "/camera/aperture_m": 0.2,
                            SENSOR + "/modules/imgproc/attitude": "unknown", SENSOR + "/modules/control/attitude": "unknown",
                            SENSOR + "/modules/imgproc/camera_calibration": {"enabled": True},
                            SENSOR + "/modules/gimbal/platform/attitude_bias_arcsec": [900, -1400, 2500],
                            SENSOR + "/knowledge/camera/scale_error_ppm": 3000})
    scene.update(name="lost", record={"frames": "none", "telemetry_hz": 1})
    return scene


def tasking():
    """Four hundred seconds of tasks of two unlike observers among a Walker constellation, with custody."""
    scene = shipped("day_constellation")
    scene["world"].update(star_catalogue="embedded", objects=[{"name": "INMARSAT GX5", "orbit": sgp4(TARGET)}],
                          catalogues=[{"elements_file": ELEMENTS, "area_m2": 6, "albedo": 0.2}],
                          constellations=[{"name": "shell", "satellites": 24, "planes": 6, "phasing": 2, "inclination_deg": 55,
                                           "semi_major_axis_m": 26560000, "raan_deg": 20, "mean_anomaly_deg": 40, "area_m2": 12}])
    scene["observers"] = scene["observers"][:2]
    scene["observers"][1]["orbit"] = {"source": "constellation", "constellation": "shell", "member": [2, 3]}
    for k, observer in enumerate(scene["observers"]):
        if "elements_file" in observer["orbit"]:
            observer["orbit"]["elements_file"] = ELEMENTS
        sensor = observer["sensors"][0]
        sensor["camera"].update(rotation_deg=[27, -130][k], boresight_offset_px=[[17, -5], [0, 40]][k], width_px=[640, 500][k],
                                height_px=[500, 760][k], aperture_m=[0.15, 0.25][k])
    scene.update(name="tasking", duration_s=420)
    scene["record"] = dict(scene.get("record", {}), custody=True, telemetry_hz=0.2, custody_timeout_s=200)
    for target in scene["tasking"]["targets"]:
        target.update(revisit_s=150, frames=6)
    return scene


def search():
    """A belt searched without a cue, with keep-outs; then coast behind the Earth's limb."""
    scene = shipped("belt_search")
    scene["world"]["star_catalogue"] = "embedded"
    scene = changed(scene, {SENSOR + "/modules/control/guidance": {"sun_keep_out_deg": 30, "moon_keep_out_deg": 10, "earth_keep_out": True,
                                                                   "earth_limb_keep_out_deg": 3, "prediction_horizon_s": 60},
                            SENSOR + "/cue/region/longitude_deg": [24, 30], SENSOR + "/cue/region/half_width_deg": 1,
                            SENSOR + "/modules/gimbal/rate_hz": 100, SENSOR + "/modules/control/rate_hz": 100})
    scene.update(name="search", duration_s=500)
    return scene


def rate():
    """Other strategies of control: scan, with long streaks; the spacecraft itself turns to its target."""
    scene = shipped("neossat_geo_rate_open")
    scene["world"]["star_catalogue"] = "embedded"
    scene = changed(scene, {SENSOR + "/camera/width_px": 360, SENSOR + "/camera/height_px": 280, SENSOR + "/camera/rotation_deg": 15})
    scene.update(name="rate", duration_s=9)
    scene["record"] = {"frames": "none", "telemetry_hz": 3}
    sensor = scene["observers"][0]["sensors"][0]
    sensor["modules"]["control"] = {"type": "standard", "strategy": "rate", "exposure_s": 0.5}
    sensor["modules"]["gimbal"] = {"type": "second_order", "platform": {"drift_arcsec_per_s": [2, -3, 1]}}
    sensor["modules"]["imgproc"] = {"type": "standard", "long_streaks": True}
    sensor["modules"]["tracker"] = {"type": "ekf"}
    return scene


def passing():
    """Two satellites that pass each other, numerical orbits, body roll, a third axis, orbit as motion."""
    scene = shipped("leo_leo_body_roll")
    scene["world"]["star_catalogue"] = "embedded"
    scene = changed(scene, {SENSOR + "/observation_source": "generator", SENSOR + "/camera/rotation_deg": 12,
                            SENSOR + "/camera/width_px": 640, SENSOR + "/camera/height_px": 480, SENSOR + "/modules/obsgen": {"type": "statistical"}})
    scene["world"]["objects"][0]["burns"] = [{"time_s": 9, "duration_s": 3, "dv_rtn_mps": [2, -5, 3]}]
    scene["world"]["objects"][0]["brightness"] = {"model": "sphere", "specular_fraction": 0.3, "earthshine": True}
    scene.update(name="passing", duration_s=16, record={"frames": "none", "telemetry_hz": 2})
    return scene


def measured():
    """A small field for `pd`, turned and distorted, with charge that is multiplied."""
    scene = shipped("neossat_geo_stare")
    return changed(scene, {"/world/star_catalogue": "embedded", SENSOR + "/camera/width_px": 292, SENSOR + "/camera/height_px": 220,
                           SENSOR + "/camera/rotation_deg": 31, SENSOR + "/camera/boresight_offset_px": [6, -9],
                           SENSOR + "/camera/distortion": {"k1": -150, "p1": 0.3}, SENSOR + "/camera/detector": {"em_gain": 3, "clock_induced_e": 20}})


def tabulated_psf(path):
    """Writes a PSF that is longer than it is wide, with a wing at one side, and says how a camera takes it."""
    y, x = np.mgrid[:49, :41]
    image = np.exp(-((x - 18) / 4.2)**2 - ((y - 26) / 5.5)**2) + 0.2 * np.exp(-((x - 23) / 6)**2 - ((y - 20) / 6)**2)
    fits.writeto(path, image.astype(np.float32))
    return {SENSOR + "/camera/optics": {"psf": "file", "psf_file": path, "psf_oversampling": 5, "file_centre": "array"}}


def bent_path(length_px, scale_arcsec):
    """Attitudes during an exposure beside Orion, and a camera for them."""
    import test_twin
    ra, dec = np.radians((84.0, -2.0))
    middle = test_twin.product(test_twin.rotation(np.array([dec - np.pi / 2, 0, 0])), test_twin.rotation(np.array([0, 0, -ra - np.pi / 2])))
    path = test_twin.attitudes(np.random.default_rng(5), middle, length_px, np.radians(scale_arcsec / 3600))
    return path, {"width_px": 84, "height_px": 70, "pixel_scale_arcsec": scale_arcsec, "aperture_m": 0.04, "psf_fwhm_px": 2.2, "full_well_e": 1e6,
                  "gain_e_per_dn": 4, "dark_current_e_per_s": 30, "detector": {"hot_fraction": 0.002, "dsnu_rms": 0.2}}


def sensor():
    """A sensor with all that darks and bias frames tell: a slow read-out, hot pixels, traps, radiation."""
    scene = changed(track(), {**SMALL, SENSOR + "/camera/width_px": 236, SENSOR + "/camera/height_px": 172, SENSOR + "/camera/dark_current_e_per_s": 15,
                              SENSOR + "/exposure/period_s": 1.6})
    scene["observers"][0]["sensors"][0]["camera"]["detector"] = {
        "dsnu_rms": 0.3, "hot_fraction": 0.004, "readout_s": 3, "output": {"right": True, "top": True}, "row_noise_e": 2, "column_offset_rms_e": 4,
        "parallel_traps": {"traps_per_px": [0.05, 0.02, 0]}, "serial_traps": {"traps_per_px": [0.03, 0.02, 0]}, "prnu_rms": 0.012, "dead_fraction": 0.002,
        "cosmic_rays": {"rate_per_cm2_s": 40, "readout_s": 1}, "pick_up": {"amplitude_e": 6, "cycles_per_px": 0.17, "cycles_per_row": -0.06, "phase_deg": 50}}
    return scene


def starry():
    """Some hundred stars for a camera's calibration."""
    scene = changed(track(), {**SMALL, "/duration_s": 6, SENSOR + "/camera/aperture_m": 0.3, SENSOR + "/camera/rotation_deg": -37,
                              SENSOR + "/camera/pixel_scale_arcsec": 14, "/world/faint_stars": "statistical", "/world/faint_limit_v_mag": 14,
                              SENSOR + "/knowledge/star_catalogue": "embedded", "/record/compression": "none",
                              SENSOR + "/camera/distortion": {"k1": -40, "p1": 0.2}, SENSOR + "/exposure/window_px": [16, 8, 276, 216]})
    scene["name"] = "stars"
    scene["world"]["objects"][0]["burns"] = [{"time_s": 2.33, "dv_rtn_mps": [0.2, -0.1, 0.3]}]
    return scene


def crowded():
    """Many blends before the Milky Way: pairs closer than the filter separates, hits, telegraph pixels that move with no star, streaks
    of unknown rate, windows about tracks; and a twin whose detections are drawn."""
    scene = track(**{"epoch_utc": "2022-06-16T23:40:00Z"})
    scene["world"].update(faint_stars="statistical", faint_limit_v_mag=9.5, objects=scene["world"]["objects"] + [
        {"name": f"NEAR{k}", "area_m2": area, "albedo": 0.2,
         "orbit": {"source": "relative", "reference": "INMARSAT GX5", "offset_rtn_m": offset, "rate_rtn_mps": rate}}
        for k, (area, offset, rate) in enumerate([(3, [500, -900, 600], [0, 0, 0]), (6, [8000, -9000, 3000], [4, -60, 70]),
                                                  (1.5, [-7000, 4000, -6000], [-2, 5, -3])])])
    scene["world"]["objects"][0]["area_m2"] = 300
    sensor = scene["observers"][0]["sensors"][0]
    sensor["camera"].update(width_px=312, height_px=246, pixel_scale_arcsec=40, rotation_deg=64, aperture_m=0.15, full_well_e=26000,
                            distortion={"k1": -12, "p1": 0.1, "p2": -0.05}, boresight_offset_px=[-12, 9],
                            detector={"hot_fraction": 0.0006, "telegraph_noise_fraction": 0.0008, "telegraph_noise_rms_e": 90, "saturation": "bloom",
                                      "cosmic_rays": {"rate_per_cm2_s": 60, "readout_s": 0.3}})
    sensor["exposure"].update(exposure_s=0.15, period_s=1.1, window_px=[10, 4, 296, 238])
    sensor["modules"]["control"]["exposure_s"] = 0.15
    sensor["cue"].update(offset_deg=0.02, offset_axis="-y", offset_angle_deg=70, sigma_deg=0.04, v_mag=9)
    sensor["knowledge"] = changed(KNOWLEDGE, {"/camera/distortion": {"k1": -11, "p1": 0.1}})
    sensor["modules"]["imgproc"].update(false_splits=0.02, jitter_px=0.2, motion_bend_px=0.06, streak_search_px=26, track_windows=True,
                                        full_frame_period=4, full_frame_count=2, window_px=60, mesh_px=40, column_correction="on")
    sensor["modules"]["scenegen"]["star_limit_v_mag"] = 13
    scene.update(name="crowded", duration_s=20, seed="0x61", record={"frames": "none"})
    twin = copy.deepcopy(sensor)
    twin.update(name="drawn", observation_source="generator")
    twin["modules"]["tracker"] = {"type": "ukf", "motion": "orbit", "association": "pmb", "size_range_correlation_s": 60}
    scene["observers"][0]["sensors"].append(twin)
    return scene


def streaked():
    """Stars as streaks along a path that bends and changes its speed, a tabulated PSF, pixels of 2 x 2; and a twin whose detections are
    drawn."""
    scene = shipped("leo_leo_pass")
    scene["world"].update(star_catalogue="embedded", faint_stars="statistical", faint_limit_v_mag=11)
    sensor = scene["observers"][0]["sensors"][0]
    sensor["camera"].update(width_px=470, height_px=382, rotation_deg=-41, boresight_offset_px=[13, -7], aperture_m=0.3, psf_fwhm_px=2.6,
                            optics={"psf": "moffat", "moffat_beta": 3}, full_well_e=60000)
    sensor["exposure"].update(exposure_s=0.06, period_s=0.5, binning=2, window_px=[8, 20, 450, 352])
    sensor["cue"].update(offset_deg=0.05, offset_axis="y", sigma_deg=0.1)
    sensor["modules"]["gimbal"]["platform"].update(jitter_low_px_rms=1.2, jitter_low_cutoff_hz=8, jitter_high_px_rms=0.4)
    sensor["modules"]["imgproc"].update(motion_bend_px=0.1, jitter_px=0.4, false_splits=0.01, long_streaks=True)
    sensor["modules"]["scenegen"]["star_limit_v_mag"] = 11
    for body in (scene["world"]["objects"][0], scene["observers"][0]):
        body["orbit"]["state"]["at_s"] = 38
    scene.update(name="streaked", duration_s=2.4, seed="0x62", record={"frames": "none"})
    twin = copy.deepcopy(sensor)
    twin.update(name="drawn", observation_source="generator", x_axis_gcrf=[0.2, -0.9, 0.1])
    twin["modules"]["obsgen"] = {"type": "statistical"}
    scene["observers"][0]["sensors"].append(twin)
    return scene


def checks():
    """{name: scene} that the rules of `check` speak of, with numbers that differ from sensor to sensor."""
    unlike_ = unlike()
    unlike_.pop("record")
    unlike_["duration_s"] = 12000
    first, second = unlike_["observers"][0]["sensors"]
    third = unlike_["observers"][1]["sensors"][0]
    for k, sensor in enumerate((first, second, third)):
        sensor["observation_source"] = "generator"
        sensor["modules"]["control"]["guidance"] = {"sun_keep_out_deg": 61 - 13 * k, "moon_keep_out_deg": 20 + 9 * k, "earth_keep_out": True,
                                                    "earth_limb_keep_out_deg": 9 - 2 * k, "earth_limb_altitude_km": 140}
        sensor["camera"]["background"] = {"model": "sky", "stray_e_per_s": 5}
    first["camera"].update(ensquared_energy=0.43, full_well_e=20000)
    first["exposure"].update(exposure_s=1.7)
    first["modules"]["tracker"].update(initiation_gap_s=0.6, max_coast_s=0.9)
    second["camera"].update(zero_point_mag=19.5)
    second["exposure"].update(dropped_fraction=1.0)
    second["modules"]["control"].update(dwell_timeout_s=1.5, acquire_timeout_s=0.8)
    third["camera"].update(pixel_scale_arcsec=600, width_px=350, height_px=440)
    third["exposure"].update(first_s=11999.9)
    unlike_["world"]["objects"][0]["burns"] = [{"time_s": 900, "dv_rtn_mps": [300, -700, 900]}, {"time_s": 12500, "dv_rtn_mps": [1, 2, 3]}]
    unlike_["observers"][0]["burns"] = [{"time_s": 30000, "dv_rtn_mps": [3, 1, 2]}]
    gimbal, control = SENSOR + "/modules/gimbal", SENSOR + "/modules/control"
    slow = changed(search(), {gimbal + "/rate_limit_degps": 0.011, gimbal + "/accel_limit_degps2": 0.0004})
    scan = changed(slow, {control + "/strategy": "scan", control + "/scan_rate_arcsec_per_s": 37, gimbal + "/accel_limit_degps2": 3e-5})
    ideal = changed(track(), {gimbal: {"type": "ideal", "target": "direction", "ra_deg": 306, "dec_deg": -24.3}, "/duration_s": 9000,
                              SENSOR + "/camera/background": {"model": "sky"}})
    return {"unlike": unlike_, "slow": slow, "scan": scan, "ideal": ideal,
            "old": changed(tasking(), {"/epoch_utc": "2022-07-09T03:00:00Z", "/duration_s": 4000}),
            "fast": changed(scan, {control + "/scan_rate_arcsec_per_s": 70}),
            "passing": changed(passing(), {"/duration_s": 7000, gimbal + "/rate_limit_degps": 0.6, gimbal + "/accel_limit_degps2": 0.2}),
            "sun": changed(ideal, {gimbal + "/ra_deg": 85.1, gimbal + "/dec_deg": 23.36, "/duration_s": 3000}),
            "late": changed(rate(), {"/duration_s": 25000})}


def drawn():
    """Detections that are drawn, for four cameras: a diffraction image with bright stars at rest, as streaks along an uneven path, binned
    by three with ghosts, and a Gaussian that is lost in space."""
    scene = track(**{"epoch_utc": "2022-06-16T23:40:00Z"})
    scene["world"].update(faint_stars="statistical", faint_limit_v_mag=10, objects=scene["world"]["objects"] + [
        {"name": "NEAR", "area_m2": 40, "albedo": 0.2,
         "orbit": {"source": "relative", "reference": "INMARSAT GX5", "offset_rtn_m": [9000, -14000, 7000], "rate_rtn_mps": [3, -20, 30]}}])
    scene["world"]["objects"][0]["area_m2"] = 300
    first = scene["observers"][0]["sensors"][0]
    first.update(name="sharp", observation_source="generator")
    first["camera"].update(width_px=420, height_px=330, pixel_scale_arcsec=40, rotation_deg=-117, aperture_m=0.2, full_well_e=22000,
                           optics={"psf": "diffraction", "q": 2.0, "diffusion_px": 0.25})
    first["camera"].pop("psf_fwhm_px")
    first["exposure"].update(exposure_s=0.2, period_s=1.1, window_px=[12, 6, 400, 320])
    first["cue"].update(offset_deg=0.1, offset_axis="y", sigma_deg=0.1, v_mag=9)
    first["modules"].pop("scenegen")
    first["modules"]["control"]["exposure_s"] = 0.2
    first["modules"]["obsgen"]["star_limit_v_mag"] = 10.5
    first["modules"]["imgproc"].update(false_splits=0.02, false_alarms_per_frame=3, jitter_px=0.3, motion_bend_px=0.05, mesh_px=48)
    second, third, fourth = (copy.deepcopy(first) for _ in range(3))
    second["name"] = "smeared"
    second["modules"]["gimbal"]["platform"].update(drift_arcsec_per_s=[260, -190, 0], jitter_low_px_rms=3, jitter_low_cutoff_hz=2)
    second["exposure"]["exposure_s"] = second["modules"]["control"]["exposure_s"] = 0.9
    third["name"] = "coarse"
    third["modules"]["obsgen"]["calibration_file"] = "theory"
    third["camera"].update(width_px=630, height_px=480, rotation_deg=29, pixel_scale_arcsec=15,
                           ghosts=[{"intensity": 0.004, "factor": -0.7, "centre_px": [14, -8], "radius_px": 12, "inner_radius_px": 4}])
    third["exposure"].update(binning=3, window_px=[9, 15, 600, 450])
    fourth["name"] = "lost"
    fourth["camera"].pop("optics")
    fourth["camera"].update(width_px=380, height_px=470, psf_fwhm_px=1.9, rotation_deg=73, aperture_m=0.1)
    fourth["exposure"]["window_px"] = [0, 0, 380, 470]
    fourth["modules"]["imgproc"].update(attitude="unknown", lost_after_frames=3)
    fourth["modules"]["control"]["attitude"] = "unknown"
    fourth["modules"]["gimbal"]["platform"]["attitude_bias_arcsec"] = [700, -900, 2500]
    scene["observers"][0]["sensors"] += [second, third, fourth]
    scene.update(name="drawn", duration_s=4.6, seed="0x64", record={"frames": "none"})
    return scene
