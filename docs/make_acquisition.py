#!/usr/bin/env python3
"""Plots how soon targets are found, from what tests/e2e/test_acquisition.py --times wrote.

usage: docs/make_acquisition.py TIMES.json

Writes docs/images/acquisition_times.png: the share of the runs that have the target in track, over
time. Needs gnuplot.
"""
import json
import pathlib
import subprocess
import sys

PANELS = [("cue", "cue wrong by a degree", "time  [s]", 120),
          ("belt", "no cue, 20 by 4 degrees of the belt", "time  [s]", 1634),
          ("eclipse", "out of the shadow", "time after the SNR passes 8  [s]", 10)]


def main():
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    times = json.loads(pathlib.Path(sys.argv[1]).read_text(encoding="utf-8"))
    out = pathlib.Path(__file__).resolve().parent / "images" / "acquisition_times.png"
    script = [f"set terminal pngcairo size 1100,360 font 'sans,10'\nset output '{out}'\n"
              "set multiplot layout 1,3\nset yrange [0:105]\nset key off\nset grid\n"]
    for name, title, label, limit in PANELS:
        found = sorted(t for t in times[name] if t is not None)
        count = len(times[name])
        low = min(0.0, found[0])
        rows = [(low, 0.0)] + [(t, 100.0 * (i + 1) / count) for i, t in enumerate(found)]
        script.append(f"${name} << END\n" + "".join(f"{t} {share}\n" for t, share in rows) +
                      "END\n")
        mark = f"set xrange [{1.05 * low}:{1.05 * limit}]\n" \
               f"set arrow 1 from {limit}, 0 to {limit}, 105 nohead dashtype 2 " \
               "linecolor rgb '#c0392b'\n"
        script.append(f"{mark}set title '{title}'\nset xlabel '{label}'\n"
                      f"set ylabel '{'runs in track  [%]' if name == 'cue' else ''}'\n"
                      f"plot ${name} with steps linewidth 2 linecolor rgb '#1f4e9c'\n")
    script.append("unset multiplot\n")
    subprocess.run(["gnuplot"], input="".join(script), text=True, check=True)
    print(out.name)


if __name__ == "__main__":
    main()
