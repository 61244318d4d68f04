#!/usr/bin/env python3
"""Makes sim/optics/solar_table.h: the Sun's spectral irradiance at 1 au, coarse.

    /usr/bin/python3 sim/optics/make_solar_table.py ASTMG173.csv > sim/optics/solar_table.h

The input is the table of ASTM G173-03 (wavelength in nm; extraterrestrial, global and direct
irradiance in W/m2/nm), of which the extraterrestrial column is used: Gueymard, Myers and Emery, Solar
Energy 73, 443 (2002). The value at a node is the mean over the hat function that rises from one neighbour and falls to the other,
so that the line through the nodes keeps the integral over bands wider than the nodes' distance.
From 1000 nm on, where there are few lines, it is the mean over 20 nm.
"""
import csv
import sys

import numpy as np

rows = [r for r in csv.reader(open(sys.argv[1])) if r and r[0].replace(".", "").isdigit()]
wavelength = np.array([float(r[0]) for r in rows])
irradiance = np.array([float(r[1]) for r in rows])
nodes = np.concatenate([np.arange(280, 1000, 10), np.arange(1000, 2500, 50), np.arange(2500, 4001, 250)]).astype(float)
fine = np.arange(280, 4000.01, 0.1)
value = np.interp(fine, wavelength, irradiance)
matrix = np.zeros((len(nodes), len(nodes)))
right = np.zeros(len(nodes))
for i in range(len(nodes)):
    hat = np.interp(fine, nodes, np.eye(len(nodes))[i])
    right[i] = np.trapz(hat * value, fine)
    for j in range(max(i - 1, 0), min(i + 2, len(nodes))):
        matrix[i, j] = np.trapz(hat * np.interp(fine, nodes, np.eye(len(nodes))[j]), fine)
# lumped: a consistent projection would ring at the lines of the ultraviolet
smooth = right / matrix.sum(axis=1)
for i in np.flatnonzero(nodes >= 1000):
    near = np.abs(fine - nodes[i]) <= 10
    smooth[i] = np.mean(value[near])

print("/* Made by make_solar_table.py from the extraterrestrial spectrum of ASTM G173-03 (Gueymard, Myers and")
print(" * Emery, Solar Energy 73, 443, 2002): wavelength in nm, irradiance at 1 au in W/m2/nm. */")
print("#ifndef BST_WORLD_SOLAR_TABLE_H\n#define BST_WORLD_SOLAR_TABLE_H\n")
print("enum { SOLAR_NODES = %d };" % len(nodes))
print("static const float solar_table[SOLAR_NODES][2] = {")
for a, b in zip(nodes, smooth):
    print("    {%gf, %.4gf}," % (a, b) if a != int(a) else "    {%d.0f, %.4gf}," % (a, b))
print("};\n\n#endif")
