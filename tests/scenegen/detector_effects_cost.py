"""Processor time of the detector's effects per frame (docs/results/detector_effects.md).

    python3 tests/scenegen/detector_effects_cost.py build/boresight [more programs]
        [--rounds N] [--only NAME,NAME]

Flats of `boresight calframes`, 1024 x 1024 pixels, half of the full well, one thread, FITS written:
(time of 21 frames - time of 1) / 20, user and system time of the process, each the least of all
rounds; cases and programs take turns. A first run compiles kernels. The scenario is scenarios/neossat_geo_stare.json.
"""

import argparse
import json
import os
import shutil
import tempfile

SCENARIO = os.path.join(os.path.dirname(__file__), "../../scenarios/neossat_geo_stare.json")
BEFORE = {"prnu_rms": 0.01, "dsnu_rms": 0.2, "hot_fraction": 0.001, "hot_median_e_per_s": 500,
          "bad_columns": 2, "column_offset_rms_e": 2, "row_offset_rms_e": 1, "row_noise_e": 1,
          "telegraph_noise_fraction": 0.01, "telegraph_noise_rms_e": 20,
          "nonlinearity": [-0.02, 0.001, 0], "saturation": "bloom", "frame_transfer_s": 0.002,
          "cosmic_rays": {"rate_per_cm2_s": 5},
          "quantisation": {"model": "square_root", "bits": 8}}
READ_OUT = {"readout_s": 20, "clock_induced_e": 0.02, "glow": {"peak_e": 40, "scale_px": 60},
            "pick_up": {"amplitude_e": 22, "cycles_per_px": 0.17005, "cycles_per_row": -0.4447},
            "offset_noise_e": 2, "flicker_noise_e": 3, "offset_drift_dn_per_frame": 0.01,
            "overscan": {"left": 16}, "shielded": {"right": 8}}
COUPLING = {"interpixel_coupling": 0.01, "brighter_fatter_per_e": 1e-7}
MULTIPLY = {"em_gain": 100}
PERSISTENCE = {"persistence": {"trapped_share": [0.002, 0.001, 0.001, 0.0005, 0.001],
                               "time_constant_s": [1, 10, 100, 1000, 10000]}}
PARALLEL = {"parallel_traps": {"traps_per_px": [0.4, 0.2, 0], "release_px": [0.6, 20, 1]}}
SERIAL = {"serial_traps": {"traps_per_px": [0.1, 0, 0], "release_px": [2, 1, 1]}}
CROSSTALK = {"crosstalk": {"outputs": 2, "coupling": 1e-3}}
PIXEL_NOISE = {"reset_noise_e": 4, "pixel_flicker_noise": {"rms_e": 3}}
# several outputs and traps along rows exclude each other
BUT_MULTIPLY = {**BEFORE, **READ_OUT, **COUPLING, **PERSISTENCE, **PARALLEL, **SERIAL}
OUTPUTS = {**BEFORE, **READ_OUT, **COUPLING, **PERSISTENCE, **PARALLEL, **CROSSTALK, **MULTIPLY}
CASES = {
    "none": {},
    "before": BEFORE,
    "before and read-out": {**BEFORE, **READ_OUT},
    "before and coupling": {**BEFORE, **COUPLING},
    "before and multiplication": {**BEFORE, **MULTIPLY},
    "before and persistence": {**BEFORE, **PERSISTENCE},
    "before and traps": {**BEFORE, **PARALLEL, **SERIAL},
    "before and crosstalk": {**BEFORE, **CROSSTALK},
    "before and pixel noise": {**BEFORE, **PIXEL_NOISE},
    "before and level noise": {**BEFORE, "flicker_noise_e": 3},
    "all but multiplication": BUT_MULTIPLY,
    "all with multiplication": {**BUT_MULTIPLY, **MULTIPLY},
    "all with crosstalk": OUTPUTS,
    "all with pixel noise": {**BUT_MULTIPLY, **MULTIPLY, **PIXEL_NOISE},
    "ramp of 4 reads": {"ramp": {"reads": 4}},
    "ramp of 16 reads": {"ramp": {"reads": 16}},
    "ramp of 16 reads, slope": {"ramp": {"reads": 16, "flicker_noise_e": 4}},
}


def seconds(program, detector, frames, folder):
    """User and system time of a process, s."""
    out = os.path.join(folder, "cal")
    shutil.rmtree(out, ignore_errors=True)
    call = [program, "calframes", SCENARIO, "--out", out, "--bias", "0", "--dark", "0", "--flat",
            str(frames), "--threads", "1", "--set",
            "/observers/0/sensors/0/camera/detector=" + json.dumps(detector)]
    pid = os.fork()
    if pid == 0:
        null = os.open(os.devnull, os.O_WRONLY)
        os.dup2(null, 1)
        os.execv(program, call)
    _, status, usage = os.wait4(pid, 0)
    if status != 0:
        raise SystemExit(f"{' '.join(call)}: status {status}")
    return usage.ru_utime + usage.ru_stime


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("programs", nargs="+")
    parser.add_argument("--rounds", type=int, default=2)
    parser.add_argument("--only", default="")
    args = parser.parse_args()
    names = [n for n in CASES if not args.only or n in args.only.split(",")]
    least = {}
    with tempfile.TemporaryDirectory() as folder:
        for _ in range(args.rounds):
            for name in names:
                for program in args.programs:
                    for n in (1, 21):
                        key = name, program, n
                        found = seconds(os.path.abspath(program), CASES[name], n, folder)
                        least[key] = min(least.get(key, 1e9), found)
    for name in names:
        frame = [(least[name, p, 21] - least[name, p, 1]) / 20 for p in args.programs]
        print(f"{name:28s} " + " ".join(f"{1e3 * s:7.1f}" for s in frame) + " ms")


if __name__ == "__main__":
    main()
