#!/usr/bin/env python3
"""Measures what closing the loop brings, and draws docs/images/closed_loop.png.

usage: docs/make_loop_figures.py BORESIGHT [SEEDS]

Prints the tables of docs/results/control_loops.md: pointing of the main scenario beyond the jitter that no loop
rejects, and the same target under closed loop, open-loop rate track and stare: SNR of a frame, the
magnitude at which it is 6, and the share of frames in which the target is detected by magnitude.
Run from the repository root; needs gnuplot.
"""
import json
import math
import os
import sqlite3
import subprocess
import sys
import tempfile

SCENARIO = "scenarios/neossat_geo_track.json"
SENSOR = "/observers/0/sensors/0"
CONTROL = SENSOR + "/modules/control"
NORAD = 44801
DURATION_S, SETTLED_S = 56, 26
DETECTED_PX = 3.0
BASE = {SENSOR + "/observation_source": "generator", "/record/frames": "none"}
STRATEGIES = {
    "closed loop": {CONTROL + "/strategy": "track"},
    "open loop, rate track": {CONTROL + "/strategy": "rate",
                              CONTROL + "/compensate_attitude": False},
    "open loop, stare": {CONTROL + "/strategy": "stare", CONTROL + "/stare_time_s": 41,
                         CONTROL + "/compensate_attitude": False},
}
ALBEDO = 0.25  # of the scenario's target
STEPS = [0.5 * k for k in range(-2, 9)]  # magnitudes fainter


def words(sets):
    return [w for path, value in sets.items() for w in ("--set", f"{path}={json.dumps(value)}")]


def run(program, folder, sets, duration, seed):
    out = os.path.join(folder, "run")
    subprocess.run([program, "run", SCENARIO, "--quiet", "--overwrite", "--out", out, "--seed",
                    hex(seed), "--duration", str(duration), *words(sets)], check=True,
                   stdout=subprocess.DEVNULL)
    with open(os.path.join(out, "manifest.json")) as file:
        summary = json.load(file)["summary"]
    return sqlite3.connect(os.path.join(out, "run.sqlite")), summary


def beyond(program, folder, seeds):
    """RMS pointing, and its part beyond the jitter above half the frame rate, px, radial."""
    result = subprocess.run([program, "loop", SCENARIO, "--json", "-", *words(BASE)], check=True,
                            capture_output=True, text=True)
    sensor = json.loads(result.stdout)["sensors"][0]
    above = math.sqrt(sum(axis["jitter_above_half_frame_rate_rms_px"]**2
                          for axis in sensor["axes"]))
    square = 0
    for seed in range(1, seeds + 1):
        db, _ = run(program, folder, BASE, 300, seed)
        rows = db.execute("select x_mid_px - 511.5, y_mid_px - 511.5 from truth where norad = ? "
                          "and mid_s > 40", (NORAD,)).fetchall()
        square += sum(x * x + y * y for x, y in rows) / len(rows) / seeds
    print("| pointing RMS | predicted | jitter above half the frame rate | beyond it |\n"
          "|---|---|---|---|")
    print(f"| {math.sqrt(square):.3f} px | {sensor['predicted_rms_radial_px']:.3f} px | "
          f"{above:.3f} px | {math.sqrt(square - above**2):.3f} px |\n")


def frames(program, folder, sets, fainter, seeds):
    """Of the settled frames in which the target is in the field: V, SNR, whether detected, and how
    far from the boresight, px."""
    sets = dict(BASE, **sets, **{"/world/objects/0/albedo": ALBEDO * 10**(-0.4 * fainter),
                                 SENSOR + "/cue/offset_deg": 0.1})
    out = []
    for seed in range(1, seeds + 1):
        db, _ = run(program, folder, sets, DURATION_S, seed)
        seen = {}
        for exposure, x, y in db.execute("select exposure_id, x_px, y_px from detections"):
            seen.setdefault(exposure, []).append((x, y))
        for exposure, v, snr, x, y, x0, y0 in db.execute(
                "select exposure_id, v_mag, snr, x_chief_px, y_chief_px, x_start_px, y_start_px "
                "from truth where norad = ? and in_field = 1 and mid_s > ?", (NORAD, SETTLED_S)):
            half = math.hypot(x - x0, y - y0)
            out.append((v, snr, any(math.hypot(a - x, b - y) < DETECTED_PX + half
                                    for a, b in seen.get(exposure, [])),
                        math.hypot(x - 511.5, y - 511.5)))
    return out


def main():
    program = os.path.abspath(sys.argv[1])
    seeds = int(sys.argv[2]) if len(sys.argv) > 2 else 4
    curves, rows = {}, {}
    with tempfile.TemporaryDirectory() as folder:
        beyond(program, folder, seeds)
        for name, sets in STRATEGIES.items():
            curves[name] = []
            for fainter in STEPS:
                got = frames(program, folder, sets, fainter, seeds)
                if not got:
                    continue
                v = sum(g[0] for g in got) / len(got)
                snr = sum(g[1] for g in got) / len(got)
                curves[name].append((v, snr, sum(g[2] for g in got) / len(got)))
                if fainter == 0:
                    rows[name] = (v, snr, max(g[3] for g in got))
        print("| same target, V %.2f | SNR of a frame | gain of the closed loop | V at SNR 6 | "
              "faintest step detected in half of the frames | farthest from the boresight |\n"
              "|---|---|---|---|---|---|" %
              rows["closed loop"][0])
        for name, (v, snr, far) in rows.items():
            half = [c[0] for c in curves[name] if c[2] >= 0.5]
            print(f"| {name} | {snr:.1f} | {rows['closed loop'][1] / snr:.2f} | "
                  f"{v + 2.5 * math.log10(snr / 6):.2f} | {max(half):.1f} | {far:.3g} px |")
        data = os.path.join(folder, "data")
        with open(data, "w") as file:
            for name in curves:
                file.write("\n".join("%.4f %.4f %.4f" % c for c in curves[name]) + "\n\n\n")
        colours = ["#1f4e9c", "#2a8c6e", "#c0392b"]
        lines = [f"'{data}' index {i} using 1:{{}} with linespoints pointtype 7 pointsize {0.7 if i else 1.1} "
                 f"linewidth {1.4 if i else 3.2} linecolor rgb '{colours[i]}' title '{name}'"
                 for i, name in enumerate(curves)]
        script = ("set terminal pngcairo size 1000,420 font 'DejaVu Sans,11' background '#ffffff'\n"
                  "set output 'docs/images/closed_loop.png'\nset encoding utf8\n"
                  "set multiplot layout 1,2\nset grid linecolor rgb '#d8dde4'\nset xlabel 'V'\n"
                  "set ylabel 'SNR of a frame'\nset logscale y\nset key bottom left\n"
                  "plot " + ", ".join(line.format(2) for line in lines) +
                  ", 6 with lines dashtype 2 linecolor rgb '#8a97a8' notitle\n"
                  "unset logscale y\nset ylabel 'share of frames with the target detected'\n"
                  "set yrange [0:1.05]\nunset key\n"
                  "plot " + ", ".join(line.format(3) for line in lines) + "\nunset multiplot\n")
        subprocess.run(["gnuplot"], input=script, text=True, check=True)


main()
