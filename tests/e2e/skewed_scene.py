"""A scene without symmetry, whose tables and exports the tests work out again: a sensor that is not square, turned,
distorted, its boresight off the centre, read in a window off its corner; a mount with three axes at large angles on a
turning spacecraft with sensors of its own; two targets; an observer that is wrong about its orbit."""
import json
import os

import numpy as np

import runs

NORAD, OBSERVER = 44801, 39089
ELEMENTS = "scenarios/catalogue_2022-06.tle"
OFFSET_RTN_M = np.array([9000.0, -50000.0, 30000.0])  # of the second target from the first
CAMERA = dict(width_px=640, height_px=480, rotation_deg=33, boresight_offset_px=[24, -17],
              distortion={"k1": -200, "p1": 0.3, "p2": -0.2}, dark_current_e_per_s=5, obscuration=0.2, aperture_m=0.2)
WINDOW = [32, 24, 576, 440]  # that is read: first column and row, width and height
NAV_RTN_M, NAV_RTN_MPS, NAV_GROWTH_MPS = np.array([30, -40, 25.0]), np.array([0.02, -0.01, 0.03]), 0.4
THROUGHPUT_ERROR = 0.05  # of the onboard side
TELEMETRY_HZ, TICKS, EXPOSURE_S, PERIOD_S = 100, 6000, 0.5, 1.0
FRAME_DELAY_S, TRACKS_DELAY_S, LATENCY_S = 0.15, 0.2, 0.05
SUN_V_MAG = -26.74  # docs/explanation/equations/brightness.md
DURATION_S = 45


def scenario(folder):
    """Writes the scene; the path of its file."""
    with open(runs.TRACK, encoding="utf-8") as file:
        scene = json.load(file)
    with open("scenarios/rigid_spacecraft.json", encoding="utf-8") as file:
        rigid = json.load(file)["set"]
    scene.pop("$schema")
    for owner in scene["world"]["objects"] + scene["observers"]:
        owner["orbit"]["elements_file"] = os.path.abspath(ELEMENTS)
    scene["world"]["objects"].append({"name": "NEIGHBOUR", "area_m2": 1, "albedo": 0.3, "orbit": {
        "source": "relative", "reference": "INMARSAT GX5", "offset_rtn_m": OFFSET_RTN_M.tolist()}})
    sensor = scene["observers"][0]["sensors"][0]
    sensor["camera"].update(CAMERA)
    sensor["exposure"]["window_px"] = WINDOW
    sensor["cue"].update(offset_deg=0.1, offset_axis="y", offset_angle_deg=20, sigma_deg=0.1)
    sensor["knowledge"] = {"camera": {"throughput_error": THROUGHPUT_ERROR},
                           "orbit": {"position_rtn_m": NAV_RTN_M.tolist(), "velocity_rtn_mps": NAV_RTN_MPS.tolist(),
                                     "along_track_drift_mps": NAV_GROWTH_MPS}}
    gimbal = sensor["modules"]["gimbal"]
    gimbal["type"], gimbal["third_axis"] = "cross_elevation", True
    gimbal["platform"]["drift_arcsec_per_s"] = [0, 0, 0]
    gimbal["platform"]["spacecraft"] = rigid[runs.SENSOR + "/modules/gimbal/platform/spacecraft"]
    sensor["modules"]["obsgen"]["calibration_file"] = os.path.abspath("scenarios/calibration/neossat.obsgen")
    sensor["modules"]["control"]["guidance"] = {"acceleration_feed_forward": True}
    scene["duration_s"] = DURATION_S
    scene["record"] = {"frames": "extensions", "compression": "none", "telemetry_hz": TELEMETRY_HZ}
    path = os.path.join(folder, "skewed.json")
    with open(path, "w", encoding="utf-8") as file:
        json.dump(scene, file)
    return path
