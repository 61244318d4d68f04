#!/usr/bin/env python3
"""A target that flashes, fades, burns or is dark for most of the time is acquired, never lost for good, and
followed while it is visible.

Usage, from the repository root: /usr/bin/python3 tests/e2e/changing_target.py BORESIGHT [SEEDS] [KEY=VALUE ...]
SEEDS: 20. KEY=VALUE: overrides of the scenario. Prints a line for each case and tracker; fails if a target is not in
track in the last visible frame, or if the pointing of a run is above 0.4 px RMS over the frames in which it is visible.

Cases, in the main scenario by the observation generator; the target has SNR 35:
  flash   brightness 10:1 and back, as a sawtooth of its logarithm of 5 s
  fade    from 120 to 180 s the target has SNR 3
  thrust  10 m/s^2 along the orbit from 100 to 300 s, unknown to the cue
  dark    20 s of every 30 s without light
"""
import json
import math
import os
import sys

import runs

SENSOR = runs.SENSOR
MODULES = SENSOR + "/modules"
# after 540 s too few stars of the embedded catalogue are in the field
DURATION_S, DARK_DURATION_S = 330, 500
VISIBLE_SNR = 5.0
MOST_PX = 0.4
# as in test_manoeuvre.py: a geostationary orbit in sight of the observer, integrated so that a burn may last
ORBIT = {"source": "numerical",
         "state": {"position_gcrf_m": [-15348589.2, -39280031.2, -44163.1],
                   "velocity_gcrf_mps": [2863.24853, -1118.97675, -0.49126]}}


def flash(t):
    """1 at the ends and 0.1 in the middle of 5 s."""
    return 10.0 ** -(1.0 - abs(2.0 * (t / 5.0 % 1.0) - 1.0))


def fade(t):
    return 3.0 / 35.0 if 120.0 <= t < 180.0 else 1.0


def dark(t):
    return 1.0 if t % 30.0 < 10.0 else 0.0


CURVES = {"flash": flash, "fade": fade, "dark": dark}
CASES = ("flash", "fade", "thrust", "dark")


def overrides(case, folder, seed):
    """Values of the scenario for a case; writes its light curve into `folder`. The period begins at another time with
    each seed."""
    if case == "thrust":
        return {"/world/objects/0/orbit": ORBIT,
                "/world/objects/0/burns": [{"time_s": 100, "duration_s": 200, "dv_rtn_mps": [0, 2000, 0]}]}
    path = os.path.join(folder, "curve.csv")
    with open(path, "w", encoding="utf-8") as file:
        file.write("time_s,factor\n")
        later = 0.0 if case == "fade" else 0.618 * seed % 1.0 * 30.0
        # the light left 0.14 s before; steps take 0.01 s
        for k in range(-100, 100 * (DARK_DURATION_S + 1)):
            file.write(f"{k / 100:.2f},{CURVES[case](k / 100 + later):.6f}\n")
    return {"/world/objects/0/brightness": {"model": "light_curve", "light_curve_file": path}}


def judge(out):
    """(time of acquisition, share of visible frames since then with the target, RMS of the pointing there
    and its 99th percentile in px, whether the target is tracked in the last visible frame, times it was lost)."""
    db = runs.database(out)
    rows = db.execute(
        "SELECT t.mid_s, t.snr, e.boresight_x_px - t.x_mid_px, e.boresight_y_px - t.y_mid_px, f.target_id > 0, t.ra_deg,"
        " t.dec_deg, k.ra_deg, k.dec_deg FROM truth t JOIN exposures e USING (exposure_id) LEFT JOIN track_frames f"
        " USING (exposure_id) LEFT JOIN tracks k ON k.exposure_id = t.exposure_id AND k.target_of_interest = 1"
        " WHERE t.kind = 'object' ORDER BY t.exposure_id").fetchall()
    first = db.execute("SELECT min(time_s) FROM events WHERE kind = 'mode' AND text LIKE '%-> track:%'").fetchone()[0]
    lost = db.execute("SELECT count(*) FROM events WHERE kind = 'target_lost'").fetchone()[0]
    if first is None:
        return None, 0.0, math.inf, math.inf, False, lost
    seen = [r for r in rows if r[0] > first and r[1] >= VISIBLE_SNR]

    def right(r):
        return bool(r[4]) and r[7] is not None and math.hypot(
            (r[7] - r[5]) * math.cos(math.radians(r[6])), r[8] - r[6]) * 1200.0 < 3.0
    off = sorted(math.hypot(r[2], r[3]) for r in seen)
    rms = math.sqrt(sum(x * x for x in off) / len(off))
    return (first, sum(map(right, seen)) / len(seen), rms, off[int(0.99 * len(off))],
            right(seen[-1]), lost)


def main():
    seeds = int(sys.argv[1]) if len(sys.argv) > 1 and sys.argv[1].isdigit() else 20
    more = [word for word in sys.argv[1:] if "=" in word]
    bad = 0
    for tracker in ("ekf", "imm"):
        for case in CASES:
            results = []
            for seed in range(seeds):
                folder = runs.scratch()
                out = os.path.join(folder, "run")
                values = {SENSOR + "/observation_source": "generator", "/record/frames": "none",
                          "/record/truth_stars": False, MODULES + "/tracker/type": tracker,
                          **overrides(case, folder, seed)}
                runs.run(runs.TRACK, out, *(f"{key}={json.dumps(value)}" for key, value in values.items()), *more,
                         seed=7000 + seed,
                         duration=DARK_DURATION_S if case == "dark" else DURATION_S)
                results.append(judge(out))
                print(tracker, case, seed, *results[-1], file=sys.stderr)
                runs.clean()
            got = [r for r in results if r[0] is not None]
            failed = sum(r[0] is None or not r[4] or r[2] > MOST_PX for r in results)
            bad += failed
            print(f"{tracker} {case}: acquired {len(got)} of {seeds}, at {min((r[0] for r in got), default=0):.1f} to "
                  f"{max((r[0] for r in got), default=0):.1f} s; target in {min(r[1] for r in results):.4f} of the visible frames"
                  f" at least; pointing RMS {max(r[2] for r in results):.3f} px at most, 99 % {max(r[3] for r in results):.3f}"
                  f" px; lost {sum(r[5] for r in results)} times; at the end without it {sum(not r[4] for r in results)};"
                  f" failed {failed}", flush=True)
    return bad > 0


if __name__ == "__main__":
    sys.exit(main())
