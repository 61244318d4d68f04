#!/usr/bin/env python3
"""Writes astropy_reference.h: what astropy makes of times, frames, stars and bodies.

Usage, from the repository root, with Debian's python3-astropy (no network is used):
    /usr/bin/python3 tests/astro/make_astropy_reference.py > tests/astro/astropy_reference.h

Earth orientation comes from sim/astro/eop_table.c, handed to astropy as a C04 file, so that both
sides work with the same values.
"""
import re
import tempfile

import astropy
import astropy.units as u
import erfa
import numpy as np
from astropy.coordinates import (GCRS, ICRS, ITRS, TEME, CartesianRepresentation, SkyCoord,
                                 UnitSphericalRepresentation,
                                 get_body_barycentric, get_body_barycentric_posvel,
                                 solar_system_ephemeris)
from astropy.time import Time
from astropy.utils import iers

iers.conf.auto_download = False
iers.conf.iers_degraded_accuracy = "error"
solar_system_ephemeris.set("builtin")


def use_our_earth_orientation():
    text = open("sim/astro/eop_table.c", encoding="ascii").read()
    first = int(re.search(r"first_mjd = (\d+)", text).group(1))
    rows = re.findall(r"\{(-?\d+),(-?\d+),(-?\d+)\}", text)
    with tempfile.NamedTemporaryFile("w", suffix=".txt") as file:
        file.write("\n" * 14)
        for i, (x, y, ut1) in enumerate(rows):
            year, month, day = Time(first + i, format="mjd").ymdhms.tolist()[:3]
            file.write(f"{year:4d}{month:4d}{day:4d}{first + i:7d}{int(x) * 1e-6:11.6f}"
                       f"{int(y) * 1e-6:11.6f}{int(ut1) * 1e-7:12.7f}{0:12.7f}"
                       + "   0.000000" * 4 + "  0.0000000" * 2 + "    0.000000" * 2 + "\n")
        file.flush()
        table = iers.IERS_B.open(file.name, data_start=14)
    iers.earth_orientation_table.set(table)


def numbers(*values):
    flat = np.concatenate([np.atleast_1d(np.asarray(v, dtype=float)).ravel() for v in values])
    return ", ".join(f"{x:.17g}" for x in flat)


def metres(frame):
    return frame.cartesian.xyz.to_value(u.m)


def frames():
    print("/* A geostationary position in TEME, and what it is in GCRS and ITRS. */")
    print("static const struct {\n    const char *utc;\n    double teme_m[3], gcrf_m[3], itrf_m[3];"
          "\n} reference_frames[] = {")
    for i, utc in enumerate(["2020-01-01T12:00:00Z", "2021-03-20T09:37:00Z",
                             "2022-06-16T22:10:00Z", "2022-06-16T22:15:00Z",
                             "2024-02-29T23:59:59Z", "2025-12-31T18:30:00.25Z"]):
        t = Time(utc[:-1], scale="utc")
        angle = 1.1 * i
        teme = 42164e3 * np.array([np.cos(angle) * 0.995, np.sin(angle) * 0.995, 0.0998749218])
        teme_frame = TEME(CartesianRepresentation(teme * u.m), obstime=t)
        itrs = teme_frame.transform_to(ITRS(obstime=t))
        gcrs = itrs.transform_to(GCRS(obstime=t))
        print(f'    {{"{utc}", {{{numbers(teme)}}}, {{{numbers(metres(gcrs))}}}, '
              f'{{{numbers(metres(itrs))}}}}},')
    print("};\n")


def bodies():
    print("/* Sun and Moon from the Earth's centre; the Earth from the barycentre. */")
    print("static const struct {\n    const char *utc;\n    double sun_m[3], moon_m[3], "
          "earth_m[3], earth_mps[3];\n} reference_bodies[] = {")
    for utc in ["2020-03-20T03:50:00Z", "2022-06-16T22:10:00Z", "2025-09-07T18:12:00Z"]:
        t = Time(utc[:-1], scale="utc")
        earth, velocity = get_body_barycentric_posvel("earth", t)
        sun = get_body_barycentric("sun", t) - earth
        moon = get_body_barycentric("moon", t) - earth
        print(f'    {{"{utc}", '
              + ", ".join("{" + numbers(v) + "}" for v in
                          (sun.xyz.to_value(u.m), moon.xyz.to_value(u.m),
                           earth.xyz.to_value(u.m), velocity.xyz.to_value(u.m / u.s)))
              + "},")
    print("};\n")


def stars():
    print("/* Directions that a satellite sees (GCRS with obsgeoloc, obsgeovel) of catalogue"
          " places, with the\n * angle from the Sun in degrees. */")
    print("static const struct {\n    const char *utc;\n    double position_m[3], velocity_mps[3],"
          " sun_deg, icrs[3], apparent[3];\n} reference_stars[] = {")
    rng = np.random.default_rng(20220616)
    for utc, position, velocity in [
            ("2022-06-16T22:10:00Z", [7.1e6, 4.0e5, 5.0e5], [-4.0e2, 1.2e3, 7.3e3]),
            ("2024-12-01T03:04:05.678Z", [-2.0e7, 3.7e7, 1.0e6], [-2.7e3, -1.46e3, 30.0])]:
        t = Time(utc[:-1], scale="utc")
        frame = GCRS(obstime=t, obsgeoloc=position * u.m, obsgeovel=velocity * u.m / u.s)
        earth = get_body_barycentric("earth", t)
        sun = (get_body_barycentric("sun", t) - earth).xyz.to_value(u.m) - np.array(position)
        sun /= np.linalg.norm(sun)
        side = np.cross(sun, [0.3, -0.2, 0.9])
        side /= np.linalg.norm(side)
        for degrees in [0.4, 2.0, 30.0, 60.0, 90.0, 135.0, 178.0]:
            a = np.radians(degrees)
            icrs = np.cos(a) * sun + np.sin(a) * side
            apparent(utc, frame, position, velocity, degrees, icrs)
        for _ in range(3):
            icrs = rng.normal(size=3)
            icrs /= np.linalg.norm(icrs)
            degrees = np.degrees(np.arccos(icrs @ sun))
            apparent(utc, frame, position, velocity, degrees, icrs)
    print("};\n")


def apparent(utc, frame, position, velocity, degrees, icrs):
    direction = CartesianRepresentation(icrs).represent_as(UnitSphericalRepresentation)
    place = SkyCoord(ICRS(direction))
    seen = place.transform_to(frame).cartesian.xyz.value
    print(f'    {{"{utc}", {{{numbers(position)}}}, {{{numbers(velocity)}}}, {degrees:.6f}, '
          f'{{{numbers(icrs)}}}, {{{numbers(seen)}}}}},')


def times():
    print("/* UTC and the same instant in TAI, as a midnight and the seconds after it. */")
    print("static const struct {\n    const char *utc;\n    double tai_jd1, tai_s;\n"
          "} reference_times[] = {")
    for utc in ["1965-07-01T12:00:00Z", "1972-01-01T00:00:00Z", "2016-12-31T23:59:59Z",
                "2016-12-31T23:59:60Z", "2016-12-31T23:59:60.75Z", "2017-01-01T00:00:00Z",
                "2022-06-16T22:10:00.123456Z", "2025-12-31T23:59:59.999999999Z"]:
        tai = Time(utc[:-1], scale="utc").tai
        midnight = np.floor(tai.jd1 - 0.5) + 0.5
        seconds = ((tai.jd1 - midnight) + tai.jd2) * 86400
        if seconds < 0:
            midnight, seconds = midnight - 1, seconds + 86400
        elif seconds >= 86400:
            midnight, seconds = midnight + 1, seconds - 86400
        print(f'    {{"{utc}", {midnight:.1f}, {seconds:.9f}}},')
    print("};\n")


use_our_earth_orientation()
print("/* Made by make_astropy_reference.py with astropy %s, ERFA %s. Do not edit. */"
      % (astropy.__version__, erfa.__version__))
print("/* clang-format off */")
print("#ifndef BST_TESTS_ASTRO_ASTROPY_REFERENCE_H")
print("#define BST_TESTS_ASTRO_ASTROPY_REFERENCE_H\n")
times()
frames()
bodies()
stars()
print("#endif")
