#!/usr/bin/env python3
"""Writes eop_table.c from an IERS EOP 20 C04 file.

Usage: make_eop_table.py C04_FILE FIRST_YEAR LAST_YEAR > eop_table.c

The IERS publishes the series as eopc04.1962-now; the Python package astropy-iers-data carries it
as astropy_iers_data/data/eopc04.1962-now. The table runs from January 1 of FIRST_YEAR to
January 1 after LAST_YEAR, so that both years are covered whole.
"""
import sys


def main():
    path, first_year, last_year = sys.argv[1], int(sys.argv[2]), int(sys.argv[3])
    rows = []
    with open(path, encoding="ascii") as file:
        for line in file:
            if line.startswith("#"):
                continue
            f = line.split()
            year, month, day = int(f[0]), int(f[1]), int(f[2])
            if not (year, month, day) <= (last_year + 1, 1, 1) or year < first_year:
                continue
            rows.append((int(float(f[4])), round(float(f[5]) * 1e6), round(float(f[6]) * 1e6),
                         round(float(f[7]) * 1e7)))
    days = [row[0] for row in rows]
    if days != list(range(days[0], days[0] + len(days))):
        sys.exit("the rows are not daily")
    print("/* Made by make_eop_table.py from the IERS EOP 20 C04 series (International Earth")
    print(" * Rotation and Reference Systems Service, Paris Observatory), file eopc04.1962-now of")
    print(" * the Python package astropy-iers-data. Do not edit. */")
    print('#include "sim/astro/eop_table.h"\n')
    print(f"const int bst_eop_table_first_mjd = {days[0]};")
    print(f"const int bst_eop_table_rows = {len(rows)};\n")
    print("/* clang-format off */")
    print("const bst_eop_table_row bst_eop_table[] = {")
    for i in range(0, len(rows), 4):
        print("".join("{%d,%d,%d}," % row[1:] for row in rows[i:i + 4]))
    print("};")
    print("/* clang-format on */")


main()
