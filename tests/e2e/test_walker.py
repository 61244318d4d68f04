#!/usr/bin/env python3
"""Walker constellations of a scenario against their definition, with python3-sgp4 and astropy.

Usage, from the repository root: /usr/bin/python3 tests/e2e/test_walker.py BORESIGHT
"""
import json
import math
import os
import subprocess
import unittest

import astropy.units as u
import numpy as np
from astropy.coordinates import GCRS, TEME, CartesianRepresentation
from astropy.time import Time
from astropy.utils import iers
from sgp4.api import WGS72, Satrec

import runs
from readers import read_oem

iers.conf.auto_download = False
iers.conf.iers_degraded_accuracy = "ignore"

EPOCH = "2022-06-16T22:10:00Z"
GALILEO = {"name": "GAL", "satellites": 24, "planes": 3, "phasing": 1, "inclination_deg": 56,
           "semi_major_axis_m": 29600e3, "raan_deg": 10, "mean_anomaly_deg": 5, "at_s": -600}
STAR = {"name": "POLAR", "pattern": "star", "satellites": 12, "planes": 4, "phasing": 2,
        "inclination_deg": 86.4, "semi_major_axis_m": 7158e3, "eccentricity": 0.01,
        "arg_perigee_deg": 90}


def constellations(*items):
    return "/world/constellations=" + json.dumps(items)


def check(*sets, quiet=True):
    words = [runs.BORESIGHT, "check", runs.TRACK, "--set", "/world/star_catalogue=embedded"]
    words += ["--quiet"] * quiet
    for one in sets:
        words += ["--set", one]
    return subprocess.run(words, capture_output=True, text=True, timeout=60)


def expected(config, plane, slot, seconds):
    """GCRF place (m): elements by the definition i: t/p/f, carried on by the reference SGP4."""
    t, p, f = config["satellites"], config["planes"], config["phasing"]
    spread = 180 if config.get("pattern") == "star" else 360
    raan = config.get("raan_deg", 0) + spread / p * plane
    anomaly = config.get("mean_anomaly_deg", 0) + 360 * p / t * slot + 360 * f / t * plane
    rate = 60 * math.sqrt(3.986008e14 / config["semi_major_axis_m"]**3)
    at = Time(EPOCH.rstrip("Z"), scale="utc") + config.get("at_s", 0) * u.s
    satellite = Satrec()
    satellite.sgp4init(WGS72, "i", 1, at.jd1 - 2433281.5 + at.jd2, 0, 0, 0,
                       config.get("eccentricity", 0), math.radians(config.get("arg_perigee_deg", 0)),
                       math.radians(config["inclination_deg"]), math.radians(anomaly) % (2 * np.pi),
                       rate, math.radians(raan) % (2 * np.pi))
    now = Time(EPOCH.rstrip("Z"), scale="utc") + seconds * u.s
    error, place, _ = satellite.sgp4(now.jd1, now.jd2)
    assert error == 0
    teme = TEME(CartesianRepresentation(np.array(place) * u.km), obstime=now)
    return teme.transform_to(GCRS(obstime=now)).cartesian.xyz.to_value(u.m)


class Walker(unittest.TestCase):
    def test_places_are_those_of_the_definition(self):
        made = os.path.join(runs.scratch(), "run")
        runs.run(runs.TRACK, made, runs.NO_FRAMES, constellations(GALILEO, STAR),
                 runs.SENSOR + '/observation_source="generator"', duration=2)
        out = made + "-orbits"
        subprocess.run([runs.BORESIGHT, "export", made, "--orbits", "oem", "--step", "2", "--out",
                        out], check=True, capture_output=True)
        found = {meta["OBJECT_NAME"]: rows for meta, rows in read_oem(out + "/orbits.oem")}
        for config in (GALILEO, STAR):
            slots = config["satellites"] // config["planes"]
            names = [f"{config['name']} {k + 1}-{j + 1}" for k in range(config["planes"])
                     for j in range(slots)]
            self.assertEqual([name for name in found if name.startswith(config["name"] + " ")],
                             names)
            for k in range(config["planes"]):
                for j in range(slots):
                    rows = found[f"{config['name']} {k + 1}-{j + 1}"]
                    for row, seconds in ((rows[0], 0), (rows[-1], 2)):
                        place = 1e3 * np.array(row[1][:3])
                        # 1 m: Earth orientation on both sides; a phase wrong by 0.001 degree: 100 m
                        self.assertLess(np.linalg.norm(place - expected(config, k, j, seconds)), 1)

    def test_an_observer_in_a_constellation(self):
        """It sees its neighbours and not itself."""
        orbit = {"source": "constellation", "constellation": "POLAR", "member": [2, 1]}
        made = os.path.join(runs.scratch(), "run")
        runs.run(runs.TRACK, made, runs.NO_FRAMES, constellations(STAR),
                 "/observers/0/orbit=" + json.dumps(orbit),
                 runs.SENSOR + '/cue={"object": "POLAR 3-1", "sigma_deg": 0.1}',
                 runs.SENSOR + '/observation_source="generator"', duration=3)
        seen = {name for name, in runs.database(made).execute(
            "SELECT DISTINCT o.name FROM truth t JOIN objects o ON o.id = t.id"
            " WHERE t.kind = 'object'")}
        self.assertEqual(seen, {"POLAR 3-1"})

    def test_mistakes(self):
        member = {"source": "constellation", "constellation": "GAL", "member": [4, 1]}
        for sets, said in (
                ((constellations(GALILEO | {"planes": 5}),),
                 "/world/constellations/0: satellites: 24 do not divide into 5 planes"),
                ((constellations(GALILEO | {"phasing": 3}),),
                 "/world/constellations/0: phasing: 3 is not below the number of planes, 3"),
                ((constellations(STAR | {"eccentricity": 0.2}),),
                 "/world/constellations/0: semi_major_axis_m: the perigee is at a height of -651.7 "
                 "km"),
                ((constellations(GALILEO, GALILEO),),
                 '/world/constellations/1: name: "GAL 1-1" is the name of another object'),
                ((constellations(GALILEO), "/observers/0/orbit=" + json.dumps(member)),
                 "/observers/0/orbit/member: GAL has no satellite 4-1 (allowed: planes 1 to 3, "
                 "slots 1 to 8"),
                ((constellations(), "/observers/0/orbit=" + json.dumps(member)),
                 '/observers/0/orbit/constellation: there is no "GAL" in /world/constellations'),
                ((constellations({"name": "X"}),), "/world/constellations/0/satellites: missing")):
            result = check(*sets)
            self.assertEqual(result.returncode, 1, sets)
            self.assertIn(said, result.stderr)

    def test_the_resolved_scenario_is_accepted(self):
        result = check(constellations(GALILEO), quiet=False)
        self.assertEqual(result.returncode, 0, result.stderr)
        path = os.path.abspath(os.path.join(runs.scratch(), "resolved.json"))
        with open(path, "w", encoding="utf-8") as file:
            file.write(result.stdout)
        again = subprocess.run([runs.BORESIGHT, "check", path], capture_output=True, text=True,
                               timeout=60)
        self.assertEqual((again.returncode, again.stdout), (0, result.stdout), again.stderr)


def tearDownModule():
    runs.clean()


if __name__ == "__main__":
    unittest.main()
