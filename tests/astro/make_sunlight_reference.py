#!/usr/bin/env python3
"""Makes the rows of test_sunlight.c: sunlight at the edge of the Earth's shadow by following rays
back from the place through the air to the Sun's disc.

Each ray is integrated through the refracting air layer by layer (Bouguer's rule), not by the
formula of grazing incidence that the program's table comes from; sunlight is summed over what the
place sees in the sky, so that thinning needs no formula. Density and ozone as in
make_limb_table.py. Spherical Earth of the equatorial radius.
"""
import numpy as np

from make_limb_table import density, ozone

R = 6378.137
SUN = 6.957e5 / 149597870.7
COLOURS = {  # nm: limb darkening u, v; n - 1; Rayleigh per km; ozone per Dobson unit
    400: (0.91, -0.05, 2.828e-4, 4.269e-2, 3.0e-7),
    550: (0.93, -0.23, 2.778e-4, 1.153e-2, 8.9e-5),
    1000: (0.64, -0.20, 2.742e-4, 1.028e-3, 1.0e-7),
}


def tables(n0):
    """Least height, impact parameter, bending, air and ozone columns of rays."""
    h = np.concatenate([np.arange(8.0, 60.0, 0.1), np.arange(60.0, 110.0, 0.5)])
    out = []
    for low in h:
        p = (1.0 + n0 * density(low)[0]) * (R + low)
        # Bouguer: -2 p times the integral of dn / (n sqrt(n^2 r^2 - p^2)); r = r0 cosh(s)
        s = np.linspace(0.0, np.arccosh((R + low + 150.0) / (R + low)), 6001)
        rm = (R + low) * np.cosh(0.5 * (s[1:] + s[:-1]))
        zm, ds = rm - R, s[1] - s[0]
        nm = 1.0 + n0 * density(zm)
        dn = n0 * (density(zm + 5e-4) - density(zm - 5e-4)) / 1e-3
        drds = np.sqrt(rm ** 2 - (R + low) ** 2)
        root = np.sqrt(np.maximum((nm * rm) ** 2 - p ** 2, 1e-9))
        bend = -2.0 * p * np.sum(dn / nm / root * drds * ds)
        path = nm * rm / root * drds * ds
        out.append((low, p, bend, 2.0 * np.sum(density(zm) * path), 2.0 * np.sum(ozone(zm) * path)))
    return np.array(out)


def light(distance, off, colour):
    """Of a place `distance` km from the centre, the Sun's middle `off` rad beyond the limb."""
    u, v, n0, rayleigh, o3 = COLOURS[colour]
    t = CACHE.setdefault(colour, tables(n0))
    centre = np.arcsin(R / distance) + off
    # apparent angles from the nadir, from the lowest ray to above the Sun
    low = np.arcsin(t[0, 1] / distance)
    beta = np.linspace(low, max(centre + 1.5 * SUN, low) + 0.01, 10001)
    beta = 0.5 * (beta[1:] + beta[:-1])
    p = distance * np.sin(beta)
    bend = np.where(p < t[-1, 1], np.interp(p, t[:, 1], t[:, 2]), 0.0)
    depth = np.where(p < t[-1, 1], rayleigh * np.interp(p, t[:, 1], t[:, 3]) +
                     o3 * np.interp(p, t[:, 1], t[:, 4]), 0.0)
    true = beta - bend
    psi = (np.arange(200) + 0.5) / 200 * 1.2 * SUN / np.sin(centre)
    half = np.sqrt(np.sin(0.5 * (true - centre))[:, None] ** 2 +
                   (np.sin(true) * np.sin(centre))[:, None] * np.sin(0.5 * psi)[None, :] ** 2)
    x = 2.0 * half / SUN
    mu = np.sqrt(np.maximum(1.0 - x ** 2, 0.0))
    bright = np.where(x < 1.0, 1.0 - u - v + u * mu + v * mu ** 2, 0.0)
    total = np.sum(bright * (np.exp(-depth) * np.sin(beta))[:, None]) * 2.0 * \
        (psi[1] - psi[0]) * (beta[1] - beta[0])
    return total / (np.pi * SUN ** 2 * (1.0 - u / 3.0 - v / 2.0))


CACHE = {}
if __name__ == "__main__":
    for distance in (6778.0, 26560.0, 42164.0):
        for off in (0.02, 0.008, 0.003, -0.001, -0.004, -0.006):
            print("    {%.1fe3, %g, {%s}}," % (distance, off, ", ".join(
                "%.5g" % light(distance, off, c) for c in COLOURS)))
