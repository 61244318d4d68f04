#!/usr/bin/env python3
"""Makes neossat_inmarsat.oem and neossat_inmarsat_states.csv, beside this file, with `boresight
propagate` from the element sets of NEOSSat and INMARSAT GX5 in ../catalogue_2022-06.tle.

usage: scenarios/orbits/make_orbits.py build/boresight
"""
import csv
import io
import os
import subprocess
import sys
import tempfile

HERE = os.path.dirname(os.path.abspath(__file__))
NAMES = ["NEOSSAT", "INMARSAT GX5"]
SOURCE = ("SGP4 states by 'boresight propagate', from the element sets of 2022-06-15 (NEOSSAT, 39089) and",
          "2022-06-16 (INMARSAT GX5, 44801) in ../catalogue_2022-06.tle, public data of the US space catalogue")
EXPOSURE_S, PERIOD_S, FRAMES = 0.5, 1, 61


def propagate(program, elements, *words):
    return subprocess.run([program, "propagate", "--elements", elements, "--frame", "gcrf", *words],
                          capture_output=True, text=True, check=True).stdout


def write(name, text):
    with open(os.path.join(HERE, name), "w", encoding="ascii", newline="\n") as file:
        file.write(text)


def main():
    program = os.path.abspath(sys.argv[1])
    with open(os.path.join(HERE, "..", "catalogue_2022-06.tle"), encoding="ascii") as file:
        lines = [line for line in file if not line.startswith("#")]
    with tempfile.NamedTemporaryFile("w", suffix=".tle") as pair:
        for name in NAMES:
            at = lines.index(name + "\n")
            pair.write("".join(lines[at:at + 3]))
        pair.flush()
        oem = propagate(program, pair.name, "--start", "2022-06-16T22:05:00Z", "--stop",
                        "2022-06-16T22:20:00Z", "--step", "60", "--format", "oem")
        table = propagate(program, pair.name, "--start", "2022-06-16T22:10:00Z", "--stop",
                          "2022-06-16T22:11:01Z", "--step", str(EXPOSURE_S))
    head, rest = oem.split("\n", 1)
    write("neossat_inmarsat.oem", head + "\n" + "".join(f"COMMENT {s}\n" for s in SOURCE) + rest)

    rows = list(csv.DictReader(io.StringIO(table)))
    places = [c for c in rows[0] if c.endswith("_km")]
    speeds = [c for c in rows[0] if c.endswith(("_kmps", "_km_s"))]
    assert len(places) == 3 and len(speeds) == 3, rows[0].keys()
    out = [f"# {s}" for s in SOURCE]
    keys = ["x_m", "y_m", "z_m", "vx_mps", "vy_mps", "vz_mps"]
    out.append("object,start_s,end_s," + ",".join(f"{end}_{k}" for end in ("start", "end") for k in keys))
    steps = len(rows) // len(NAMES)
    for k, name in enumerate(NAMES):
        own = [[f"{1e3 * float(row[c]):.{6 if c in places else 9}f}" for c in places + speeds]
               for row in rows[k * steps:(k + 1) * steps]]
        for i in range(FRAMES):
            first = round(i * PERIOD_S / EXPOSURE_S)
            out.append(f"{name},{i * PERIOD_S},{i * PERIOD_S + EXPOSURE_S}," +
                       ",".join(own[first] + own[first + 1]))
    write("neossat_inmarsat_states.csv", "\n".join(out) + "\n")


if __name__ == "__main__":
    main()
