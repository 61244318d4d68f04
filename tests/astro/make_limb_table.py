#!/usr/bin/env python3
"""Makes sim/astro/limb_table.inc: what the atmosphere does to a ray that grazes the Earth.

Density: U.S. Standard Atmosphere 1976, equations 33 to 42, to 86 km; above, exponential with the
last scale height. Ozone: 300 Dobson units as a Gaussian layer at 22 km, 5 km wide (1 sigma).
Rays keep n r sin(angle) = p (Bouguer's rule): the path's element is n r / sqrt(n^2 r^2 - p^2) dr, the
bending -dn/dr p / (n^2 r) of it (Link, Eclipse Phenomena in Astronomy, 1969, chapter 2).

Use: make_limb_table.py [FILE]; with --check FILE it says whether the file is what it would write.
"""
import sys

import numpy as np

EARTH_KM = 6371.0
FIRST_KM, LAST_KM, STEP_KM = 8, 80, 2
BASES = [(0, 288.15, -6.5), (11, 216.65, 0.0), (20, 216.65, 1.0), (32, 228.65, 2.8),
         (47, 270.65, 0.0), (51, 270.65, -2.8), (71, 214.65, -2.0)]
REFRACTIVITY = 2.778e-4  # at sea level, 15 C, 550 nm (Ciddor, Applied Optics 35, 1566, 1996)
HYDROSTATIC = 34.163195  # g0 M / R*, K/km


def density(z):
    """Over that at sea level; z: geometric height in km."""
    z = np.atleast_1d(np.asarray(z, float))
    h = np.minimum(6356.766 * z / (6356.766 + z), 84.852)
    out = np.zeros_like(h)
    pressure = 1.0
    for i, (base, t0, lapse) in enumerate(BASES):
        top = BASES[i + 1][0] if i + 1 < len(BASES) else 84.852

        def at(x):
            t = t0 + lapse * (x - base)
            p = (t0 / t) ** (HYDROSTATIC / lapse) if lapse else np.exp(-HYDROSTATIC * (x - base) / t0)
            return pressure * p, t

        inside = (h >= base) & (h <= top)
        p, t = at(h[inside])
        out[inside] = p * 288.15 / t
        pressure = at(top)[0]
    return out * np.exp(-np.maximum(z - 86.0, 0.0) / 5.6)


def ozone(z):
    return 300.0 / (5.0 * np.sqrt(2.0 * np.pi)) * np.exp(-0.5 * ((z - 22.0) / 5.0) ** 2)


def rows():
    for h in range(FIRST_KM, LAST_KM + 1, STEP_KM):
        # r = r0 cosh(s): the path's element is n r^2 / sqrt(n^2 r^2 - p^2) tanh(s) ds, finite at s = 0
        r0 = EARTH_KM + h
        s = np.linspace(0.0, np.arccosh((EARTH_KM + 200.0) / r0), 40001)
        r = r0 * np.cosh(0.5 * (s[1:] + s[:-1]))
        z, ds = r - EARTH_KM, s[1] - s[0]
        n = 1.0 + REFRACTIVITY * density(z)
        p = r0 * (1.0 + REFRACTIVITY * density(h)[0])
        path = 2.0 * ds * np.sqrt(r ** 2 - r0 ** 2) * n * r / np.sqrt((n * r) ** 2 - p ** 2)
        e = 1e-3
        slope = REFRACTIVITY * (density(z + e) - density(z - e)) / (2.0 * e)
        yield (h, p - r0, np.sum(-slope / n * p / (n * r) * path), np.sum(density(z) * path),
               np.sum(ozone(z) * path) if h <= 60 else 0.0)


def text():
    lines = ["/* Made by tests/astro/make_limb_table.py. */",
             f"enum {{ LIMB_ROWS = {(LAST_KM - FIRST_KM) // STEP_KM + 1} }};", "",
             "/* Rays at 550 nm by the least height above the surface: impact parameter less that height",
             " * and the Earth's radius; bending; air along the ray as km at the density of sea level;",
             " * ozone in Dobson units. */",
             "static const struct {", "    double height_km, impact_km, bending_rad, air_km, ozone_du;",
             "} limb_rows[LIMB_ROWS] = {"]
    lines += ["    {%.1f, %.6e, %.6e, %.6e, %.6e}," % row for row in rows()]
    return "\n".join(lines + ["};", ""])


if __name__ == "__main__":
    if len(sys.argv) > 2 and sys.argv[1] == "--check":
        sys.exit(0 if open(sys.argv[2], encoding="ascii").read() == text() else
                 f"{sys.argv[2]} is not what make_limb_table.py writes")
    (open(sys.argv[1], "w", encoding="ascii") if len(sys.argv) > 1 else sys.stdout).write(text())
