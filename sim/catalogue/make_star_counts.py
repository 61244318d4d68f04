#!/usr/bin/env python3
"""Makes sim/catalogue/star_counts_table.h: stars per square degree by galactic latitude, longitude and V.

    /usr/bin/python3 sim/catalogue/make_star_counts.py tycho2.stars > sim/catalogue/star_counts_table.h

From V 15 on the counts are those of Allen's Astrophysical Quantities by latitude, in
data/star_counts_allen.csv beside this script: the mean over longitude is theirs. Up to V 11 the level is
that of Tycho-2 (Hog et al. 2000, A&A 355, L27), counted between V 9.5 and 11, where it is complete: one
factor per node of the table. Between V 11 and 15 the logarithm of the one correction goes over
into that of the other, linearly in V. tycho2.stars is the file of `boresight stars fetch`.

What is corrected, so what the two sources leave open (the course with longitude, with latitude
between Allen's, with V below 15), is the Galaxy model of Bahcall and Soneira, integrated along
each line of sight:
  ApJS 44, 73 (1980): disc n*=4.03e-3 /pc3/mag, M*=1.28, alpha=0.74, beta=0.04, 1/delta=3.40 (Tremaine,
      Ostriker and Spitzer 1975), -6 <= Mv <= 19, constant beyond 15; scale length 3.5 kpc, Sun at 8 kpc;
      scale heights 90 pc (Mv <= 2.3) rising linearly to 325 pc (Mv >= 5.1), giants 250 pc;
      main-sequence fraction of the stars brighter than Mv 3.7: 0.44 exp(1.5e-4 (Mv + 8)^3.5);
      spheroid: de Vaucouleurs' law in Young's form, effective radius 8/3 kpc, axis ratio 0.8, 1/500 of
      the disc at the Sun.
  Dust: an exponential disc of the stars' scale length and 100 pc height with 1.0 mag/kpc at the Sun.
Both signs of latitude and longitude are averaged.
"""
import os
import struct
import sys

import numpy as np

B = np.array([0, 2, 5, 7.5, 10, 15, 20, 30, 45, 60, 75, 90.0])
L = np.arange(0, 181, 30.0)
V = np.arange(6, 27.0)
GALACTIC = np.array([[-0.0548755604162154, -0.8734370902348850, -0.4838350155487132],
                     [0.4941094278755837, -0.4448296299600112, 0.7469822444972189],
                     [-0.8676661490190047, -0.1980763734312015, 0.4559837761750669]])
DM = 0.1
M = np.arange(-6 + DM / 2, 19, DM)


def luminosity(m):
    m = np.minimum(m, 15.0)
    return 4.03e-3 * 10 ** (0.04 * (m - 1.28)) / (1 + 10 ** (-0.70 / 3.40 * (m - 1.28))) ** 3.40


def model(l_deg, b_deg):
    """N(<V) per square degree at the nodes of V."""
    l, b = np.radians(l_deg), np.radians(b_deg)
    grid = np.logspace(0.7, 5.0, 1200)
    r, dr = np.sqrt(grid[:-1] * grid[1:]), np.diff(grid)
    z = r * np.sin(b)
    x = np.sqrt(np.maximum(8000.0 ** 2 + (r * np.cos(b)) ** 2
                           - 2 * 8000.0 * r * np.cos(b) * np.cos(l), 1.0))
    opacity = 1.0e-3 * np.exp(-z / 100 - (x - 8000) / 3500)
    extinction = np.cumsum(opacity * dr) - 0.5 * opacity * dr
    shell = r * r * dr * np.radians(1) ** 2
    dwarfs = np.where(M < 3.7, np.minimum(1, 0.44 * np.exp(1.5e-4 * (M + 8) ** 3.5)), 1.0)[:, None]
    height = np.interp(M, [2.3, 5.1], [90.0, 325.0])[:, None]
    disc = (dwarfs * np.exp(-z / height) + (1 - dwarfs) * np.exp(-z / 250)) * np.exp((8000 - x) / 3500)

    def vaucouleurs(x, z):
        q = np.hypot(x, z / 0.8) / (8000 / 3)
        return np.exp(-7.669 * q ** 0.25) / q ** 0.875

    spheroid = vaucouleurs(x, z) / vaucouleurs(8000.0, 0.0) / 500
    number = luminosity(M)[:, None] * DM * shell * (disc + spheroid)
    magnitude = M[:, None] + 5 * np.log10(r / 10) + extinction
    edges = np.concatenate([[-99], V])
    return np.cumsum(np.histogram(magnitude, edges, weights=number)[0])


def tycho(path):
    """|l|, |b| in degrees and V of all stars of a catalogue file."""
    data = open(path, "rb").read()
    count, = struct.unpack_from("<Q", data, 32)
    cells, patches = struct.unpack_from("<II", data, 40)
    r = np.frombuffer(data, "<u4", offset=96 + patches * 32 + cells * 28).reshape(count, 5)
    ra = r[:, 0] * (2 * np.pi / 2 ** 32)
    dec = r[:, 1].astype(np.int32) * (2 * np.pi / 2 ** 32)
    v = (r[:, 2] >> 16) / 1000.0 - 3 - 0.09 * ((r[:, 3] & 0x3FFF) / 1000.0 - 4)
    g = GALACTIC @ np.stack([np.cos(dec) * np.cos(ra), np.cos(dec) * np.sin(ra), np.sin(dec)])
    return np.degrees(np.abs(np.arctan2(g[1], g[0]))), np.degrees(np.abs(np.arcsin(g[2]))), v


def weights(nodes, x):
    k = np.clip(np.searchsorted(nodes, x, "right") - 1, 0, len(nodes) - 2)
    return k, (x - nodes[k]) / (nodes[k + 1] - nodes[k])


def column(table, l, b):
    i, s = weights(B, b)
    j, t = weights(L, l)
    return ((1 - s) * ((1 - t) * table[i, j] + t * table[i, j + 1])
            + s * ((1 - t) * table[i + 1, j] + t * table[i + 1, j + 1]))


def anchor(log_n, path):
    """Factors that bring the table to Tycho-2's counts in the zone around each node."""
    l, b, v = tycho(path)
    use = (v > 9.5) & (v <= 11.0)
    b_edges = np.concatenate([[0], (B[:-1] + B[1:]) / 2, [90]])
    l_edges = np.concatenate([[0], (L[:-1] + L[1:]) / 2, [180]])
    seen = np.histogram2d(b[use], l[use], [b_edges, l_edges])[0]
    log_c = np.zeros((len(B), len(L)))
    for _ in range(4):
        for i in range(len(B)):
            for j in range(len(L)):
                s = np.linspace(np.sin(np.radians(b_edges[i])), np.sin(np.radians(b_edges[i + 1])), 17)
                bs = np.degrees(np.arcsin((s[1:] + s[:-1]) / 2))
                ls = np.linspace(l_edges[j], l_edges[j + 1], 9)
                ls = (ls[1:] + ls[:-1]) / 2
                bb, ll = np.meshgrid(bs, ls)
                at = lambda k: column(log_n[:, :, k], ll, bb)
                # log-linear in V between the nodes 9, 10 and 11, as the table is read
                n = 10 ** at(5) - 10 ** (0.5 * (at(3) + at(4)))
                mean = np.mean(n * 10 ** column(log_c, ll, bb))
                area = 4 * (s[-1] - s[0]) * (l_edges[j + 1] - l_edges[j]) * 180 / np.pi
                log_c[i, j] += np.log10(seen[i, j] / (mean * area))
    log_c[-1, :] = np.mean(log_c[-1, :])
    return log_c


def allen(log_n):
    """Corrections [b][V] that bring the table's mean over longitude to Allen's counts, at V >= 15."""
    path = os.path.join(os.path.dirname(os.path.abspath(__file__)), "data", "star_counts_allen.csv")
    lines = [line.split(",") for line in open(path) if line[0] != "#"]
    v = np.array(lines[0][1:], float)
    table = np.array(lines[1:], float)
    b, counts = table[:, 0], table[:, 1:]
    fine = np.linspace(0, 180, 1801)
    fine = (fine[1:] + fine[:-1]) / 2
    out = np.zeros((len(B), len(V)))
    for k in range(len(V)):
        j = np.clip(np.searchsorted(v, V[k]), 0, len(v) - 1)  # outside of Allen's range: its ends
        at = np.where(V == v[j])[0][0]
        mean = [np.mean(10 ** np.interp(fine, L, log_n[B == x, :, at][0])) for x in b]
        out[:, k] = np.interp(B, b, counts[:, j] - np.log10(mean))
    return out


def main():
    log_n = np.log10(np.array([[model(l, b) for l in L] for b in B]))
    faint = np.clip((V - 11) / 4, 0, 1)
    log_n += ((1 - faint) * anchor(log_n, sys.argv[1])[:, :, None]
              + (faint * allen(log_n))[:, None, :])
    print("/* Made by make_star_counts.py, which names the sources: 1000 log10 of the stars per square\n"
          " * degree brighter than V, at [|b|][|l|][V]. */\n#ifndef BST_WORLD_STAR_COUNTS_TABLE_H\n"
          "#define BST_WORLD_STAR_COUNTS_TABLE_H\n\n#include <stdint.h>\n\n"
          f"enum {{ COUNT_B = {len(B)}, COUNT_L = {len(L)}, COUNT_V = {len(V)}, COUNT_V_FIRST = 6 }};\n")
    print("static const double count_b_deg[COUNT_B] = {" + ", ".join(f"{b:g}" for b in B) + "};")
    print(f"static const double count_l_step_deg = {L[1]:g};\n")
    print("static const int16_t count_table[COUNT_B][COUNT_L][COUNT_V] = {")
    for i in range(len(B)):
        print("    {")
        for j in range(len(L)):
            print("        {" + ", ".join(str(int(round(1000 * x))) for x in log_n[i, j]) + "},")
        print("    },")
    print("};\n\n#endif")


if __name__ == "__main__":
    main()
