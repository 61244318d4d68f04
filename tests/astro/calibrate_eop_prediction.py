#!/usr/bin/env python3
"""Prints the root mean square errors of Earth-orientation predictions: ERRORS in eop_predict.c.

Usage: calibrate_eop_prediction.py C04_FILE

C04_FILE is the IERS EOP C04 series (columns year month day MJD x y UT1-UTC, or with the hour), as
Debian's astropy carries it: astropy/utils/iers/data/eopc04_IAU2000.62-now. Predictions are made
every 150 days from the six years before, as sim/astro/eop_predict.c does, and compared with what
the series has 1 to 1825 days later. Written apart from the program, in numpy.
"""
import sys

import erfa
import numpy as np

DAYS = (1, 3, 10, 30, 90, 180, 365, 730, 1095, 1461, 1825)


def read(path):
    rows = []
    with open(path, encoding="ascii") as file:
        for line in file:
            f = line.split()
            if len(f) < 8 or not f[0].isdigit() or len(f[0]) != 4:
                continue
            f = f[:3] + f[4:] if float(f[3]) < 24 else f
            leap = erfa.dat(int(f[0]), int(f[1]), int(f[2]), 0.0)
            rows.append((float(f[3]), float(f[4]), float(f[5]), float(f[6]) - leap))
    return np.array(rows).T


def secular(mjd):
    years = (mjd - 51544.5) / 365.25
    return np.array([0.0550 + 0.001677 * years, 0.3205 + 0.003460 * years])


def terms(days):
    a, c = 2 * np.pi * days / 365.25, 2 * np.pi * days / 435.0
    return np.array([np.ones_like(days), np.cos(a), np.sin(a), np.cos(c), np.sin(c)]).T


def seasons(mjd):
    x = 2 * np.pi * (mjd - 51544.03) / 365.2422
    return -(0.022 * np.sin(x) - 0.012 * np.cos(x) - 0.006 * np.sin(2 * x) + 0.007 * np.cos(2 * x))


def predict(mjd, x, y, ut1, days):
    """Values `days` after the last of the rows."""
    t = mjd - mjd[-1]
    weight = np.exp(2 * t / 730.5) / 0.05**2
    a, out = terms(t), []
    normal = a.T @ (a * weight[:, None]) + np.diag(1 / np.array([.05, .1, .1, .2, .2])**2)
    for axis, pole in enumerate((x, y)):
        offset = pole - secular(mjd)[axis]
        c = np.linalg.solve(normal, a.T @ (weight * offset))
        rest = offset[-1] - a[-1] @ c
        out.append(secular(mjd[-1] + days)[axis] + terms(days) @ c + rest * np.exp(-days / 60))
    smooth = (ut1 - seasons(mjd))[-181:]
    rate = (np.polyfit(np.arange(181.0), smooth, 1)[0] * 180 - 0.0008 * 20) / 200
    out.append(smooth[-1] + rate * days + seasons(mjd[-1] + days))
    return out


def main():
    mjd, x, y, ut1 = read(sys.argv[1])
    days = np.array(DAYS)
    errors = [[] for _ in DAYS]
    for last in range(np.searchsorted(mjd, 45000), len(mjd) - 200, 150):
        rows = slice(last - 2189, last + 1)
        found = predict(mjd[rows], x[rows], y[rows], ut1[rows], days.astype(float))
        for k, later in enumerate(DAYS):
            if last + later < len(mjd):
                errors[k].append([found[0][k] - x[last + later], found[1][k] - y[last + later],
                                  found[2][k] - ut1[last + later]])
    for k, later in enumerate(DAYS):
        e = np.array(errors[k])
        print(f"{{{later}, {np.sqrt((e[:, 2]**2).mean()):.4f}, "
              f"{np.sqrt((e[:, :2]**2).mean()):.4f}}}  of {len(e)}, "
              f"98 %: {np.quantile(abs(e[:, 2]), .98):.4f}, {np.quantile(abs(e[:, :2]), .98):.4f}")


main()
