"""Reads the files that test_sip.c wrote with astropy: its pixels and places of the distorted WCS,
from header cards and from a cube's table, against the camera's own.

Usage: check_sip.py FOLDER
"""

import os
import sys
import warnings

import numpy as np
from astropy.io import fits
from astropy.wcs import WCS

LIMIT_PX = 1e-3 / 2  # 1e-3 px of the sensor, pixels of the file are two of them wide
TERMS = [(n - q, q) for n in range(10) for q in range(n + 1)]


def header_of_row(table, row):
    """The WCS keys that a row of the cube's table stands for."""
    header = fits.Header()
    for key in ("CTYPE1", "CTYPE2"):
        header[key] = table.header[key]
    for key in ("CRPIX1", "CRPIX2", "CRVAL1", "CRVAL2", "CD1_1", "CD1_2", "CD2_1", "CD2_2"):
        header[key] = row[key]
    for name, order, lowest in (("A", "A_ORDER", 2), ("B", "A_ORDER", 2), ("AP", "AP_ORDER", 0),
                                ("BP", "AP_ORDER", 0)):
        header[name + "_ORDER"] = int(row[order])
        for (p, q), value in zip(TERMS, row[name]):
            if lowest <= p + q <= row[order]:
                header[f"{name}_{p}_{q}"] = value
    return header


def check(wcs, places, what):
    sky, pixels = places[:, 1:3], places[:, 3:5]
    forward = wcs.all_pix2world(pixels, 0)
    # on the sky: small angles, right ascension scaled to the declination
    off = (forward - sky + 180.0) % 360.0 - 180.0
    off[:, 0] *= np.cos(np.radians(sky[:, 1]))
    scale = np.sqrt(np.abs(np.linalg.det(wcs.pixel_scale_matrix)))
    worst = [np.max(np.hypot(*off.T)) / scale]
    back = wcs.all_world2pix(sky, 0, tolerance=1e-6, maxiter=60, quiet=False)
    worst.append(np.max(np.hypot(*(back - pixels).T)))
    # readers that do not iterate use the inverse polynomials
    u, v = (wcs.wcs_world2pix(sky, 1) - wcs.wcs.crpix).T
    order = wcs.sip.ap_order + 1
    powers = [(p, q) for p in range(order) for q in range(order - p)]
    near = np.array([sum(c[p, q] * u ** p * v ** q for p, q in powers)
                     for c in (wcs.sip.ap, wcs.sip.bp)]).T
    near += np.array([u, v]).T + wcs.wcs.crpix - 1
    worst.append(np.max(np.hypot(*(near - pixels).T)))
    print(f"{what}: pix2world {worst[0]:.1e}, world2pix {worst[1]:.1e}, inverse {worst[2]:.1e} px")
    # scale changes by up to 30 % (3 x 10 %) against the boresight's
    assert worst[0] < LIMIT_PX and worst[1] < LIMIT_PX and worst[2] < LIMIT_PX, what


def main():
    folder = sys.argv[1]
    table = np.loadtxt(os.path.join(folder, "places.txt"))
    warnings.simplefilter("error")
    warnings.filterwarnings("ignore", message=".*datfix.*")
    for case in range(6):
        places = table[table[:, 0] == case]
        with fits.open(os.path.join(folder, f"ext_{case}.fits")) as f:
            f.verify("exception")
            header = f[1].header
            assert header["CTYPE1"] == "RA---TAN-SIP" and header["CTYPE2"] == "DEC--TAN-SIP"
            assert header["ROTATION"] == [30, -37, 90, 180, 12, -75][case]
            assert "DISTK1" in header and header["DISTP1"] == (0 if case != 2 else header["DISTP1"])
            assert header["WCSRESID"] < LIMIT_PX
            check(WCS(header), places, f"extension {case}")
        with fits.open(os.path.join(folder, f"cube_{case}.fits")) as f:
            f.verify("exception")
            rows = f["FRAMES"]
            check(WCS(header_of_row(rows, rows.data[0])), places, f"cube {case}")


if __name__ == "__main__":
    main()
