#!/usr/bin/python3
"""Writes tests/world/data/sight_reference.txt: how NEOSSat sees INMARSAT GX5, by astropy and sgp4.

Independent of Boresight: element sets by the Python package sgp4, TEME to GCRS by astropy, the light
time between barycentric places, aberration by special relativity's formula. Light deflection is left
out: the satellite is on our side of the Sun's field. Run with Debian's python3-astropy and
python3-sgp4:  /usr/bin/python3 tests/world/make_sight_reference.py
"""
import pathlib
import numpy as np
from astropy import units as u
from astropy.coordinates import (GCRS, TEME, CartesianDifferential, CartesianRepresentation,
                                 get_body_barycentric, get_body_barycentric_posvel)
from astropy.time import Time, TimeDelta
from astropy.utils import iers
from sgp4.api import Satrec

iers.conf.auto_download = False
iers.earth_orientation_table.set(iers.IERS_B.open())

HERE = pathlib.Path(__file__).resolve().parent
EPOCH = Time("2022-06-16T22:10:00", scale="utc")
C_KMS = 299792.458
SECONDS = [0.0, 0.25, 100.0, 300.0, 1800.0, 6000.0, -5000.0]


def satellite(number):
    lines = (HERE.parent.parent / "scenarios" / "catalogue_2022-06.tle").read_text().splitlines()
    best = min((i for i, line in enumerate(lines) if line.startswith(f"1 {number}")),
               key=lambda i: abs(Satrec.twoline2rv(lines[i], lines[i + 1]).jdsatepoch +
                                 Satrec.twoline2rv(lines[i], lines[i + 1]).jdsatepochF -
                                 EPOCH.utc.jd))
    return Satrec.twoline2rv(lines[best], lines[best + 1])


def state(sat, t):
    error, r, v = sat.sgp4(t.utc.jd1, t.utc.jd2)
    assert error == 0
    teme = TEME(CartesianRepresentation(r * u.km, differentials=CartesianDifferential(
        v * u.km / u.s)), obstime=t)
    g = teme.transform_to(GCRS(obstime=t)).cartesian
    return g.xyz.to_value(u.km), g.differentials["s"].d_xyz.to_value(u.km / u.s)


def earth(t):
    p, v = get_body_barycentric_posvel("earth", t, ephemeris="builtin")
    return p.xyz.to_value(u.km), v.xyz.to_value(u.km / u.s)


def unit(a):
    return a / np.linalg.norm(a)


def angle(a, b):
    return np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b)


def look(seconds):
    t = EPOCH + TimeDelta(seconds, format="sec")
    eye_r, eye_v = state(NEOSSAT, t)
    earth_r, earth_v = earth(t)
    tau = 0.0
    for _ in range(6):
        te = t - TimeDelta(tau, format="sec")
        target_r, _ = state(GX5, te)
        # the Earth's way in tau by its velocity: positions of 1e8 km in doubles, and the light time
        # in a Time, would leave more noise than this leaves error
        path = target_r - eye_r - tau * earth_v
        tau = np.linalg.norm(path) / C_KMS
    p = unit(path)
    beta = (earth_v + eye_v) / C_KMS
    root = np.sqrt(1.0 - beta @ beta)
    apparent = unit((root * p + beta + (p @ beta) * beta / (1.0 + root)) / (1.0 + p @ beta))
    sun = get_body_barycentric("sun", t, ephemeris="builtin").xyz.to_value(u.km) - earth_r
    phase = angle(eye_r - target_r, sun - target_r)
    return eye_r, target_r, p, apparent, tau, phase


NEOSSAT, GX5 = satellite(39089), satellite(44801)
with open(HERE / "data" / "sight_reference.txt", "w") as out:
    out.write("# seconds after 2022-06-16T22:10:00Z; NEOSSat at reception (m, GCRS x y z); GX5 at "
              "emission (m, GCRS x y z);\n# geometric direction (x y z); apparent direction "
              "(x y z); light time (s); phase angle (rad)\n# made by make_sight_reference.py\n")
    for seconds in SECONDS:
        eye_r, target_r, p, apparent, tau, phase = look(seconds)
        row = [seconds, *(1e3 * eye_r), *(1e3 * target_r), *p, *apparent, tau, phase]
        out.write(" ".join(f"{x:.16g}" for x in row) + "\n")
