#!/usr/bin/env python3
"""Writes gravity_table.c, the Earth's gravity field that is part of the program, from the ICGEM
file of EGM2008 (tide-free): python3 sim/astro/make_gravity_table.py EGM2008.gfc > gravity_table.c"""

import sys

DEGREE = 20


def main(path):
    head, rows = {}, {}
    with open(path, encoding="utf-8") as f:
        for line in f:
            words = line.split()
            if len(words) >= 5 and words[0] == "gfc":
                n, m = int(words[1]), int(words[2])
                if n <= DEGREE:
                    rows[n, m] = [float(w.lower().replace("d", "e")) for w in words[3:5]]
            elif len(words) == 2:
                head[words[0]] = words[1]
    assert head["modelname"] == "EGM2008" and head["tide_system"] == "tide_free"
    assert head["norm"] == "fully_normalized"
    rows.setdefault((1, 0), [0.0, 0.0])
    rows.setdefault((1, 1), [0.0, 0.0])
    print("""/* Made by make_gravity_table.py from EGM2008 (Pavlis, Holmes, Kenyon and Factor, J. Geophys. Res. 117,
 * B04406, 2012; National Geospatial-Intelligence Agency, public domain), tide-free, fully
 * normalised: C and S by degree, then order. Do not edit. */
#include "sim/astro/gravity_internal.h"
""")
    print(f'const double bst_gravity_table_gm_m3ps2 = {float(head["earth_gravity_constant"])!r};')
    print(f'const double bst_gravity_table_radius_m = {float(head["radius"])!r};')
    print("\n/* clang-format off */")
    print("const double bst_gravity_table[][2] = {")
    for n in range(DEGREE + 1):
        for m in range(n + 1):
            c, s = rows[n, m]
            print(f"    {{{c!r}, {s!r}}}, /* {n} {m} */")
    print("};")


if __name__ == "__main__":
    main(*sys.argv[1:])
