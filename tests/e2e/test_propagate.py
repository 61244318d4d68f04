#!/usr/bin/env python3
"""boresight propagate against python3-sgp4 and astropy, and its behaviour at the command line.

Usage, from the repository root: /usr/bin/python3 tests/e2e/test_propagate.py BORESIGHT
No network is used.
"""
import csv
import io
import json
import os
import subprocess
import sys
import tempfile
import unittest

import astropy.units as u
import numpy as np
from astropy.coordinates import (GCRS, TEME, CartesianDifferential, CartesianRepresentation)
from astropy.time import Time
from astropy.utils import iers
from sgp4.api import WGS72, WGS84, Satrec
from sgp4.exporter import export_omm

iers.conf.auto_download = False
iers.conf.iers_degraded_accuracy = "ignore"

BORESIGHT = sys.argv.pop(1)
CATALOGUE = "scenarios/catalogue_2022-06.tle"
START, STOP = "2022-06-16T22:10:00Z", "2022-06-17T22:10:00Z"
DECAYING = """DECAYING
1 28350U 04020A   06167.21788666  .16154492  76267-5  18678-3 0  8894
2 28350  64.9977 345.6130 0024870 260.7578  99.9590 16.47856722116490
"""


def run(*arguments, **options):
    return subprocess.run([BORESIGHT, "propagate", *arguments], capture_output=True, text=True,
                          timeout=60, **options)


def element_sets(path):
    with open(path, encoding="ascii") as file:
        lines = file.read().splitlines()
    sets = {}
    for i, line in enumerate(lines):
        if line.startswith("1 "):
            sets[int(line[2:7])] = (lines[i - 1], line, lines[i + 1])
    return sets


def rows_of(text):
    lines = text.splitlines()
    assert lines[0] == "utc,norad,x_km,y_km,z_km,vx_kmps,vy_kmps,vz_kmps", lines[0]
    return [line.split(",") for line in lines[1:]]


def state(row):
    return np.array([float(x) for x in row[2:]])


def reference(lines, utc, gravity=WGS72, mode="i"):
    """Position and velocity in TEME by python3-sgp4."""
    satellite = Satrec.twoline2rv(lines[1], lines[2], gravity)
    t = Time(utc.rstrip("Z"), scale="utc")
    minutes = (t.jd1 - satellite.jdsatepoch) * 1440 + (t.jd2 - satellite.jdsatepochF) * 1440
    if mode == "a":
        satellite.sgp4init(gravity, "a", satellite.satnum,
                           satellite.jdsatepoch - 2433281.5 + satellite.jdsatepochF,
                           satellite.bstar, satellite.ndot, satellite.nddot, satellite.ecco,
                           satellite.argpo, satellite.inclo, satellite.mo, satellite.no_kozai,
                           satellite.nodeo)
    error, r, v = satellite.sgp4_tsince(minutes)
    assert error == 0
    return np.array(r + v)


class Numbers(unittest.TestCase):
    def compare_teme(self, gravity, mode):
        result = run("--elements", CATALOGUE, "--start", START, "--stop", STOP, "--step", "3600",
                     "--gravity", {WGS72: "wgs72", WGS84: "wgs84"}[gravity], "--opsmode", mode)
        self.assertEqual((result.returncode, result.stderr), (0, ""))
        sets = element_sets(CATALOGUE)
        rows = rows_of(result.stdout)
        self.assertEqual(len(rows), 25 * len(sets))
        for row in rows:
            difference = state(row) - reference(sets[int(row[1])], row[0], gravity, mode)
            # 2e-7 km and 1e-9 km/s is what SGP4 itself is held to; a Julian date in two parts
            # places the instant to 5e-11 s; printing rounds to 5e-10
            self.assertLess(np.abs(difference[:3]).max(), 3e-7, row)
            self.assertLess(np.abs(difference[3:]).max(), 2e-9, row)

    def test_teme(self):
        self.compare_teme(WGS72, "i")

    def test_teme_other_constants(self):
        self.compare_teme(WGS84, "i")

    def test_teme_operational_mode(self):
        self.compare_teme(WGS72, "a")

    def test_gcrf(self):
        result = run("--elements", CATALOGUE, "--start", START, "--stop", STOP, "--step", "14400",
                     "--frame", "gcrf")
        self.assertEqual((result.returncode, result.stderr), (0, ""))
        sets = element_sets(CATALOGUE)
        for row in rows_of(result.stdout):
            t = Time(row[0].rstrip("Z"), scale="utc")
            teme = reference(sets[int(row[1])], row[0])
            gcrs = TEME(CartesianRepresentation(teme[:3] * u.km, differentials=CartesianDifferential(
                teme[3:] * u.km / u.s)), obstime=t).transform_to(GCRS(obstime=t))
            expected = gcrs.cartesian.xyz.to_value(u.km)
            velocity = gcrs.velocity.d_xyz.to_value(u.km / u.s)
            # 1 m: the tables of Earth orientation on both sides differ by less
            self.assertLess(np.linalg.norm(state(row)[:3] - expected), 1e-3, row)
            # turning of TEME against GCRF: 8e-12 rad/s, 0.4 mm/s at 45,000 km; with the
            # numerical differences that astropy takes, 1 mm/s
            self.assertLess(np.linalg.norm(state(row)[3:] - velocity), 1e-6, row)

    def test_gcrf_of_2030(self):
        """After the Earth-orientation table: with a warning that states the uncertainty."""
        result = run("--elements", CATALOGUE, "--norad", "44801", "--frame", "gcrf", "--start",
                     "2030-06-16T22:10:00Z", "--stop", "2030-06-16T22:10:00Z", "--step", "60")
        self.assertEqual(result.returncode, 0, result.stderr)
        # 2.5 times the rms error of predictions of 4.5 years, 0.675 s and 0.047 arcsec
        self.assertIn("ends on 2026-01-01, 1628 days earlier: UT1 is predicted to within 1688 ms (25 "
                      "arcsec of the Earth's rotation), the pole to within 0.12 arcsec", result.stderr)
        row, = rows_of(result.stdout)
        t = Time(row[0].rstrip("Z"), scale="utc")
        teme = reference(element_sets(CATALOGUE)[44801], row[0])
        gcrs = TEME(CartesianRepresentation(teme[:3] * u.km), obstime=t).transform_to(GCRS(obstime=t))
        # astropy has no pole there: 0.4 arcsec of it, of which the way from TEME by ITRF keeps none;
        # UT1 moves the equation of the equinoxes by 1e-11 rad/s. 2 m as above, at 42,000 km
        self.assertLess(np.linalg.norm(state(row)[:3] - gcrs.cartesian.xyz.to_value(u.km)), 2e-3)

    def test_scenario_in_2030(self):
        """A mission in 2030 runs, and says how well the Earth's orientation is known at its end."""
        with tempfile.TemporaryDirectory() as folder:
            result = subprocess.run(
                [BORESIGHT, "run", "scenarios/neossat_geo_track.json", "--quiet", "--duration", "3",
                 "--out", folder + "/run", "--set", '/epoch_utc="2030-06-16T22:10:00Z"', "--set",
                 "/world/star_catalogue=embedded", "--set", "/record/frames=none", "--set",
                 '/observers/0/sensors/0/observation_source="generator"'],
                capture_output=True, text=True, timeout=60)
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertRegex(result.stderr, r"/world/earth_orientation: .* 1628 days earlier: UT1 is "
                                        r"predicted to within 1688 ms .* 0.12 arcsec")

    def test_leap_second_is_a_row(self):
        sets = element_sets(CATALOGUE)
        result = run("--elements", CATALOGUE, "--norad", "44801", "--start", "2016-12-31T23:59:58Z",
                     "--stop", "2017-01-01T00:00:01Z", "--step", "1")
        rows = rows_of(result.stdout)
        self.assertEqual([row[0] for row in rows],
                         ["2016-12-31T23:59:58.000Z", "2016-12-31T23:59:59.000Z",
                          "2016-12-31T23:59:60.000Z", "2017-01-01T00:00:00.000Z",
                          "2017-01-01T00:00:01.000Z"])
        for row in (rows[0], rows[3], rows[4]):
            difference = state(row) - reference(sets[44801], row[0])
            # rounding of 4,000 steps of the resonance's integrator on both sides, 5.5 years back;
            # a wrong second would be 3 km
            self.assertLess(np.abs(difference[:3]).max(), 1e-5, row)

    def test_step_does_not_accumulate(self):
        # 0.1 is no binary number: a summed clock would be 1e-7 s off after a day
        result = run("--elements", CATALOGUE, "--norad", "39089", "--start", START, "--stop",
                     "2022-06-17T01:10:00Z", "--step", "0.1")
        rows = rows_of(result.stdout)
        self.assertEqual(len(rows), 108001)
        self.assertEqual(rows[-1][0], "2022-06-17T01:10:00.000Z")
        self.assertEqual(rows[77777][0], "2022-06-17T00:19:37.700Z")


class Oem(unittest.TestCase):
    def test_segments(self):
        result = run("--elements", CATALOGUE, "--start", START, "--stop", "2022-06-16T22:12:00.0005Z",
                     "--step", "60", "--format", "oem", "--frame", "gcrf")
        self.assertEqual((result.returncode, result.stderr), (0, ""))
        lines = result.stdout.splitlines()
        self.assertEqual(lines[0], "CCSDS_OEM_VERS = 2.0")
        self.assertRegex(lines[1], r"^CREATION_DATE = \d{4}-\d\d-\d\dT\d\d:\d\d:\d\d$")
        self.assertEqual(lines[2], "ORIGINATOR = BORESIGHT")
        self.assertEqual(lines.count("META_START"), 5)
        first = lines.index("META_START")
        self.assertEqual(lines[first:first + 11], [
            "META_START", "OBJECT_NAME = NEOSSAT", "OBJECT_ID = 2013-009D",
            "CENTER_NAME = EARTH", "REF_FRAME = GCRF", "TIME_SYSTEM = UTC",
            "START_TIME = 2022-06-16T22:10:00.000", "STOP_TIME = 2022-06-16T22:12:00.000",
            "INTERPOLATION = LAGRANGE", "INTERPOLATION_DEGREE = 2", "META_STOP"])
        rows = rows_of(run("--elements", CATALOGUE, "--start", START, "--stop", "2022-06-16T22:12:00Z",
                           "--step", "60", "--frame", "gcrf").stdout)
        data = [line.split() for line in lines if line.startswith("2022-06-16T")]
        self.assertEqual([row[0].rstrip("Z") for row in rows], [row[0] for row in data])
        numbers = np.array([row[1:] for row in data], dtype=float)
        # the digits that CSV prints, rounded
        self.assertLess(np.abs(numbers - [state(row) for row in rows]).max(), 0.6e-9)

    def test_stop_time_is_the_last_row_written(self):
        with tempfile.TemporaryDirectory() as folder:
            path = os.path.join(folder, "decaying.tle")
            with open(path, "w", encoding="ascii") as file:
                file.write(DECAYING)
            result = run("--tle", path, "--start", "2006-06-16T05:13:45Z", "--stop",
                         "2006-06-18T05:13:45Z", "--step", "600", "--format", "oem")
        self.assertEqual(result.returncode, 1)
        lines = result.stdout.splitlines()
        stop = [line for line in lines if line.startswith("STOP_TIME")][0].split(" = ")[1]
        self.assertEqual(lines[-1].split()[0], stop)
        self.assertRegex(result.stderr,
                         r"^boresight propagate: DECAYING \(28350\) at 2006-06-1\S+Z: "
                         r"SGP4 error \d: .+\n$")


class Forms(unittest.TestCase):
    """Element sets as OMM give the states that the same sets as TLE give."""
    window = ("--start", START, "--stop", "2022-06-17T22:10:00Z", "--step", "7200")

    def fields(self):
        """OMM fields of the catalogue by python3-sgp4."""
        out = []
        for name, line1, line2 in element_sets(CATALOGUE).values():
            fields = export_omm(Satrec.twoline2rv(line1, line2), name.removeprefix("0 "))
            fields["EPOCH"] = fields["EPOCH"][:26]
            out.append(fields)
        return out

    def states(self, name, text):
        with tempfile.TemporaryDirectory() as folder:
            path = os.path.join(folder, name)
            with open(path, "w", encoding="ascii") as file:
                file.write(text)
            result = run("--elements", path, *self.window)
        self.assertEqual((result.returncode, result.stderr), (0, ""))
        return rows_of(result.stdout)

    def test_json_and_csv(self):
        wanted = rows_of(run("--elements", CATALOGUE, *self.window).stdout)
        fields = self.fields()
        table = io.StringIO()
        writer = csv.DictWriter(table, fields[0].keys())
        writer.writeheader()
        writer.writerows(fields)
        texts = [{key: str(value) for key, value in f.items()} for f in fields]
        for name, text in (("a.json", json.dumps(fields)), ("b.json", json.dumps(texts, indent=1)),
                           ("c.csv", table.getvalue())):
            rows = self.states(name, text)
            self.assertEqual([row[:2] for row in rows], [row[:2] for row in wanted])
            difference = [state(a) - state(b) for a, b in zip(rows, wanted)]
            # export_omm turns radians back to degrees and rounds epochs to 1 us: 8 mm at LEO
            self.assertLess(np.abs(difference).max(), 1e-5, name)

    def test_nine_digits(self):
        fields = self.fields()[0]
        for number in (100000, 339999, 340000, 799501234, 999999999):
            fields["NORAD_CAT_ID"] = number
            rows = self.states("one.json", json.dumps(fields))
            self.assertEqual({row[1] for row in rows}, {str(number)})

    def test_czml(self):
        result = run("--elements", CATALOGUE, *self.window, "--format", "czml")
        self.assertEqual((result.returncode, result.stderr), (0, ""))
        document, *packets = json.loads(result.stdout)
        self.assertEqual((document["id"], document["version"]), ("document", "1.0"))
        self.assertEqual(document["clock"]["interval"],
                         "2022-06-16T22:10:00.000Z/2022-06-17T22:10:00.000Z")
        gcrf = rows_of(run("--elements", CATALOGUE, *self.window, "--frame", "gcrf").stdout)
        self.assertEqual([p["id"] for p in packets], list(dict.fromkeys(row[1] for row in gcrf)))
        for packet in packets:
            position = packet["position"]
            self.assertEqual((position["referenceFrame"], position["interpolationAlgorithm"],
                              position["interpolationDegree"], position["epoch"]),
                             ("INERTIAL", "LAGRANGE", 5, "2022-06-16T22:10:00.000Z"))
            table = np.array(position["cartesian"]).reshape(-1, 4)
            self.assertEqual(table[:, 0].tolist(), [7200.0 * k for k in range(13)])
            wanted = [state(row)[:3] * 1000 for row in gcrf if row[1] == packet["id"]]
            # printed to 0.1 mm
            self.assertLess(np.abs(table[:, 1:] - wanted).max(), 0.6e-4)


class CommandLine(unittest.TestCase):
    window = ("--start", START, "--stop", "2022-06-16T22:11:00Z", "--step", "60")

    def fails(self, code, message, *arguments):
        result = run(*arguments)
        self.assertEqual(result.returncode, code, result.stderr)
        self.assertIn(message, result.stderr)
        self.assertEqual(result.stdout, "")

    def test_misuse(self):
        sets = ("--elements", CATALOGUE)
        self.fails(2, "--elements is missing: add --elements FILE", *self.window)
        self.fails(2, "did you mean --norad?", *sets, "--nrad", "3", *self.window)
        self.fails(2, "--frame j2000: give one of teme|gcrf", *sets, "--frame", "j2000",
                   *self.window)

        def but(option, value):
            words = list(self.window)
            words[words.index(option) + 1] = value
            return words
        self.fails(2, "--step 0: give a number from 1e-06", *sets, *but("--step", "0"))
        self.fails(2, "is before --start", *sets, *but("--stop", "2022-06-16T22:09:59Z"))
        self.fails(2, "--start: \"yesterday\" is not a UTC time", *sets, *but("--start", "yesterday"))
        self.fails(2, "give whole microseconds", *sets, *but("--step", "1.00000005"))

    def test_failures(self):
        self.fails(1, "no_such_file.tle", "--tle", "no_such_file.tle", *self.window)
        self.fails(1, "12345", "--elements", CATALOGUE, "--norad", "12345", *self.window)
        self.fails(1, "--frame gcrf needs --eop FILE here", "--elements", CATALOGUE, "--frame", "gcrf",
                   "--start", "2016-06-16T00:00:00Z", "--stop", "2016-06-16T00:00:00Z", "--step",
                   "1")
        self.fails(2, "there is no folder no_such_folder", "--elements", CATALOGUE, *self.window, "--output",
                   "no_such_folder/x.csv")

    def test_full_disk(self):
        if os.path.exists("/dev/full"):
            self.fails(1, "/dev/full: cannot be written: No space left on device", "--elements", CATALOGUE, *self.window, "--output",
                       "/dev/full")

    def test_output_file_is_what_is_printed(self):
        with tempfile.TemporaryDirectory() as folder:
            path = os.path.join(folder, "with space.csv")
            result = run("--elements", CATALOGUE, *self.window, "--output", path)
            self.assertEqual((result.returncode, result.stdout, result.stderr), (0, "", ""))
            with open(path, encoding="ascii") as file:
                self.assertEqual(file.read(), run("--elements", CATALOGUE, *self.window).stdout)

    def test_nearest_of_several_sets(self):
        sets = element_sets(CATALOGUE)
        name, line1, line2 = sets[44801]
        # the same set three days later, its checksum made right
        later = line1[:18] + "22170" + line1[23:68]
        later += str(sum(int(c) if c.isdigit() else c == "-" for c in later) % 10)
        with tempfile.TemporaryDirectory() as folder:
            path = os.path.join(folder, "two.tle")
            with open(path, "w", encoding="ascii") as file:
                file.write("\n".join([name, later, line2, name, line1, line2]) + "\n")
            result = run("--tle", path, *self.window)
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertEqual(result.stdout,
                         run("--elements", CATALOGUE, "--norad", "44801", *self.window).stdout)

    def test_help_teaches(self):
        result = run("--help")
        self.assertEqual((result.returncode, result.stderr), (0, ""))
        self.assertIn("Examples:", result.stdout)
        for option in ("--elements", "--norad", "--start", "--stop", "--step", "--frame", "--format"):
            self.assertIn(option, result.stdout)


if __name__ == "__main__":
    unittest.main()
