#!/usr/bin/env python3
"""boresight export: what it writes, read back by small readers that share no code with it.

Usage, from the repository root: /usr/bin/python3 tests/e2e/test_export.py BORESIGHT
"""
import csv
import datetime
import hashlib
import json
import math
import os
import shutil
import signal
import sqlite3
import struct
import subprocess
import unittest

import runs
from runs import call, export
from readers import read_oem, read_png, read_tdm, seconds

UTC_COLUMNS = {"mid_s", "time_s", "start_s"}


def lagrange(times, states, t, degree):
    """Position at t by the polynomial through the degree + 1 rows about it."""
    first = min(range(len(times) - degree), key=lambda i: abs(times[i] + times[i + degree] - 2 * t))
    out = [0.0, 0.0, 0.0]
    for i in range(first, first + degree + 1):
        weight = math.prod((t - times[j]) / (times[i] - times[j]) for j in range(first, first + degree + 1) if j != i)
        out = [o + weight * p for o, p in zip(out, states[i])]
    return out


class Exported(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = runs.scratch()
        cls.made = os.path.join(cls.folder, "run")
        runs.run(runs.TRACK, cls.made, duration=28)
        cls.database = runs.database(cls.made)
        cls.epoch = cls.database.execute("SELECT epoch_utc FROM run").fetchone()[0]

    def out(self):
        return os.path.join(runs.scratch(), "out")

    # -------------------------------------------------------------- tables

    def check_csv(self, database, out, name):
        columns = [c[1] for c in database.execute(f'PRAGMA table_info("{name}")')]
        extra = (["utc"] if UTC_COLUMNS & set(columns) else []) + \
            (["source"] if name == "truth" else [])
        with open(f"{out}/{name}.csv", newline="", encoding="utf-8") as file:
            text = file.read()
        rows = list(csv.reader(text.splitlines(keepends=True), strict=True))
        self.assertEqual(rows[0], extra + columns, name)
        self.assertEqual(text.count("\r\n"), len(rows), name)
        for found, row in zip(rows[1:], database.execute(f'SELECT * FROM "{name}"'), strict=True):
            for cell, value in zip(found[len(extra):], row, strict=True):
                if value is None:
                    self.assertEqual(cell, "")
                elif isinstance(value, float):
                    # to the last bit
                    self.assertEqual(struct.pack("d", float(cell)), struct.pack("d", value))
                else:
                    self.assertEqual(type(value)(cell), value)
            if "utc" in extra:
                named = dict(zip(columns, row, strict=True))
                time = next(named[c] for c in ("mid_s", "time_s", "start_s") if c in named)
                self.assertRegex(found[0], r"^\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\.\d{6}Z$")
                # microseconds are written
                self.assertAlmostEqual(seconds(found[0], self.epoch), time, delta=1.1e-6)
        return len(rows) - 1

    def test_tables(self):
        out = self.out()
        said = export(self.made, "--table", "csv", "--out", out)
        names = [row[0] for row in self.database.execute('SELECT "table" FROM tables')]
        self.assertEqual(sorted(os.listdir(out)), sorted(f"{name}.csv" for name in names))
        for name in names:
            rows = self.check_csv(self.database, out, name)
            self.assertIn(f"{out}/{name}.csv: {rows} row{'' if rows == 1 else 's'}\n",
                          said)

    def test_some_tables_and_hard_text(self):
        made = os.path.join(runs.scratch(), "run")
        shutil.copytree(self.made, made)
        with sqlite3.connect(made + "/run.sqlite") as database:
            for text in ('a "quoted" word, and more', "two\nlines", "two\r\nlines", "", "ünicode",
                         None, " blank "):
                database.execute("INSERT INTO events VALUES (1, 0.1, 'x', 'kind', ?)", (text,))
            database.execute("INSERT INTO events VALUES (2, 5e-324, '', '1.5', '-0')")
            database.execute("INSERT INTO events VALUES (9007199254740993, 1e308, 'x', 'y', 'z')")
        database.row_factory = sqlite3.Row
        out = self.out()
        export(made, "--table", "csv", "--tables", "events,run", "--out", out)
        self.assertEqual(sorted(os.listdir(out)), ["events.csv", "run.csv"])
        with open(out + "/events.csv", newline="", encoding="utf-8") as file:
            rows = list(csv.reader(file, strict=True))
        expected = list(database.execute("SELECT * FROM events"))
        self.assertEqual([row[3:6] for row in rows[1:]],
                         [["" if v is None else v for v in tuple(row)[2:5]] for row in expected])
        self.assertEqual([(int(row[1]), float(row[2])) for row in rows[1:]],
                         [tuple(row)[:2] for row in expected])
        # NULL and an empty text differ
        with open(out + "/events.csv", newline="", encoding="utf-8") as file:
            lines = file.read()
        self.assertIn(',kind,""\r\n', lines)
        self.assertIn(",kind,\r\n", lines)

    def test_time_state_and_identity_columns(self):
        # what Stone Soup's readers ask of a file: see the user guide
        out = self.out()
        export(self.made, "--table", "csv", "--tables", "truth,detections", "--out", out)
        with open(out + "/truth.csv", newline="", encoding="utf-8") as file:
            rows = list(csv.DictReader(file))
        sources = {row["source"] for row in rows}
        self.assertIn("object-0", sources)
        self.assertTrue(any(source.startswith("star-") for source in sources))
        with open(out + "/detections.csv", newline="", encoding="utf-8") as file:
            for row in csv.DictReader(file):
                datetime.datetime.fromisoformat(row["utc"].rstrip("Z"))
                float(row["x_px"]), float(row["y_px"])

    # -------------------------------------------------------------- orbits

    def test_oem_is_the_truth(self):
        out = self.out()
        export(self.made, "--orbits", "oem", "--step", "0.25", "--out", out)
        segments = read_oem(out + "/orbits.oem")
        self.assertEqual([meta["OBJECT_NAME"] for meta, _ in segments], ["neossat", "INMARSAT GX5"])
        for meta, rows in segments:
            self.assertEqual((meta["REF_FRAME"], meta["TIME_SYSTEM"], meta["CENTER_NAME"]),
                             ("GCRF", "UTC", "EARTH"))
            self.assertEqual(len(rows), 28 * 4 + 1)
            self.assertEqual((seconds(rows[0][0], self.epoch), seconds(rows[-1][0], self.epoch)),
                             (0, 28))
        states = {round(seconds(utc, self.epoch) * 4): state for utc, state in segments[0][1]}
        exposures = self.database.execute("SELECT * FROM exposures").fetchall()
        self.assertEqual(len(exposures), 28)
        for row in exposures:
            state = states[round(row["mid_s"] * 4)]
            for k, axis in enumerate("xyz"):
                # two ways of one computation; 1e-9 km are written
                self.assertAlmostEqual(state[k] * 1e3, row[f"observer_gcrf_{axis}_m"], delta=1e-3)
                self.assertAlmostEqual(state[3 + k] * 1e3, row[f"observer_gcrf_{axis}_mps"],
                                       delta=1e-6)
        # the object's range is the truth's: light time moves it by less than 0.1 s of 3 km/s
        target = {round(seconds(utc, self.epoch) * 4): state for utc, state in segments[1][1]}
        rows = self.database.execute("SELECT mid_s, range_m FROM truth WHERE kind = 'object'")
        for mid_s, range_m in rows:
            a, b = states[round(mid_s * 4)], target[round(mid_s * 4)]
            apart = sum((a[k] - b[k]) ** 2 for k in range(3)) ** 0.5 * 1e3
            self.assertAlmostEqual(apart, range_m, delta=600)

    def test_czml(self):
        out = self.out()
        export(self.made, "--orbits", "oem", "--step", "7", "--out", out)
        export(self.made, "--orbits", "czml", "--step", "7", "--out", out)
        with open(out + "/orbits.czml", encoding="utf-8") as file:
            packets = json.load(file)
        self.assertEqual((packets[0]["id"], packets[0]["version"]), ("document", "1.0"))
        segments = read_oem(out + "/orbits.oem")
        self.assertEqual([p["name"] for p in packets[1:3]], ["neossat", "INMARSAT GX5"])
        self.assertEqual(len({p["id"] for p in packets}), len(packets))
        self.check_view({p["id"]: p for p in packets[3:]})
        for packet, (_, rows) in zip(packets[1:3], segments, strict=True):
            position = packet["position"]
            self.assertEqual(position["referenceFrame"], "INERTIAL")
            numbers = position["cartesian"]
            self.assertEqual(len(numbers), 4 * len(rows))
            for i, (utc, state) in enumerate(rows):
                time, *place = numbers[4 * i:4 * i + 4]
                self.assertAlmostEqual(seconds(position["epoch"], self.epoch) + time,
                                       seconds(utc, self.epoch), delta=1e-6)
                for k in range(3):
                    self.assertAlmostEqual(place[k], state[k] * 1e3, delta=1e-4)  # 0.1 mm written

    def check_view(self, packets):
        """The frustum's lines meet the corners of the field, in the attitudes of the exposures."""
        name = "view/neossat/telescope"
        points = {}
        for key in ("eye", "1", "2", "3", "4"):
            numbers = packets[f"{name}/{key}"]["position"]["cartesian"]
            points[key] = [numbers[i + 1:i + 4] for i in range(0, len(numbers), 4)]
        self.assertEqual(set(packets), {name} | {f"{name}/{key}" for key in points})
        ends = packets[name]["polyline"]["positions"]["references"]
        self.assertEqual({end.split("#")[0] for end in ends}, set(packets) - {name})
        rows = self.database.execute("SELECT * FROM exposures ORDER BY exposure_id").fetchall()
        self.assertEqual(len(rows), len(points["eye"]))
        for i, row in enumerate(rows):
            rays = []
            for key in "1234":
                ray = [a - b for a, b in zip(points[key][i], points["eye"][i], strict=True)]
                length = math.hypot(*ray)
                rays.append([r / length for r in ray])
            middle = [sum(r[k] for r in rays) for k in range(3)]
            middle = [m / math.hypot(*middle) for m in middle]
            x, y, z, w = (row[f"q_cam_from_gcrf_mid_{c}"] for c in "xyzw")
            look = [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]
            # places are written to 0.1 mm of 1000 km or more
            self.assertLess(math.dist(middle, look), 1e-9)
            # across the corners: 1024 px of 3 arcsec, tangent plane
            half = 512 * math.radians(3 / 3600) * math.sqrt(2)
            self.assertAlmostEqual(math.dist(rays[0], rays[2]) / 2, math.sin(math.atan(half)),
                                   delta=1e-7)

    def test_orbits_of_what_was_seen(self):
        """Of a large catalogue only what came into a field, and what is asked for."""
        made, out = os.path.join(runs.scratch(), "many"), self.out()
        runs.run("scenarios/constellation_quick.json", made, runs.DARK, duration=20)
        rows = runs.database(made).execute
        seen = {row[0] for row in rows(
            "SELECT o.name FROM truth t JOIN objects o ON o.id = t.id"
            " WHERE t.kind = 'object' AND t.in_field = 1"
            " UNION SELECT name FROM sightings UNION SELECT target FROM sensors")} - {"", None}
        observers = ["neossat", "stss1", "stss2", "geo1", "geo2"]
        self.assertGreater(len(seen), 3)

        def objects(*words):
            said = export(made, "--orbits", "oem", "--step", "10", "--out", out, *words)
            names = [meta["OBJECT_NAME"] for meta, _ in read_oem(out + "/orbits.oem")]
            self.assertEqual(names[:5], observers)
            return names[5:], said

        names, said = objects()
        self.assertEqual(set(names), seen)
        self.assertIn(f"{5018 - len(seen)} objects that came into no field are left out", said)
        self.assertEqual(objects("--objects", "seen")[0], names)
        # by name or number, in the scenario's order, each once
        number = rows("SELECT norad FROM objects WHERE name = ?", (names[1],)).fetchone()[0]
        self.assertEqual(objects("--objects", f"{names[2]}, {number},{names[1]}")[0], names[1:3])
        failed = call("export", made, "--orbits", "czml", "--objects", f"{number},NOBODY", "--out",
                      out)
        self.assertEqual(failed.returncode, 1)
        self.assertIn('no object "NOBODY" among its 5018', failed.stderr)
        export(made, "--orbits", "czml", "--out", out)
        with open(out + "/orbits.czml", encoding="utf-8") as file:
            packets = json.load(file)
        self.assertEqual({p["name"] for p in packets if p["id"].startswith("object/")}, seen)
        failed = call("export", made, "--table", "csv", "--objects", "all", "--out", out)
        self.assertEqual(failed.returncode, 2)
        # a small scenario is written whole, seen or not
        self.assertEqual(len(read_oem(self.all_orbits())), 2)

    def all_orbits(self):
        out = self.out()
        self.assertNotIn("left out", export(self.made, "--orbits", "oem", "--out", out))
        return out + "/orbits.oem"

    def test_segments_meet_at_burns(self):
        """An OEM's reader must not interpolate over a jump of velocity."""
        folder = runs.scratch()
        made = os.path.join(folder, "burnt")
        runs.run(runs.TRACK, made, runs.NO_FRAMES, "/world/faint_stars=statistical",
                 '/world/objects/0/burns=[{"time_s": 10.5, "dv_rtn_mps": [0, 3, 4]}]',
                 f"{runs.SENSOR}/modules=" + json.dumps(
                     {"gimbal": {"type": "ideal", "object": "INMARSAT GX5"}}), duration=20)
        out = self.out()
        export(made, "--orbits", "oem", "--step", "4", "--out", out)
        segments = read_oem(out + "/orbits.oem")
        self.assertEqual([meta["OBJECT_NAME"] for meta, _ in segments],
                         ["neossat", "INMARSAT GX5", "INMARSAT GX5"])
        epoch = runs.database(made).execute("SELECT epoch_utc FROM run").fetchone()[0]
        before, after = segments[1][1], segments[2][1]
        for rows, first, last in ((before, 0, 10.5), (after, 10.5, 20)):
            times = [seconds(utc, epoch) for utc, _ in rows]
            self.assertEqual((times[0], times[-1]), (first, last))
            self.assertLess(max(b - a for a, b in zip(times, times[1:])), (last - first) / 9 + 1e-6)
        a, b = before[-1][1], after[0][1]
        # written to 1e-9 km and 1e-12 km/s; the state before is that of 1 us earlier, moved on
        self.assertLess(math.dist(a[:3], b[:3]), 2e-8)
        self.assertAlmostEqual(math.dist(a[3:], b[3:]), 5e-3, delta=1e-8)
        # and it moves as its velocity says on both sides; SGP4's is off by 0.06 m/s at most
        for rows in (before[-2:], after[:2]):
            (t0, s0), (t1, s1) = ((seconds(utc, epoch), state) for utc, state in rows)
            for k in range(3):
                mean = 0.5 * (s0[3 + k] + s1[3 + k])
                self.assertAlmostEqual((s1[k] - s0[k]) / (t1 - t0), mean, delta=1e-4)

        # read as the file says, a step longer than the segments loses nothing: 1 mm where the chord of
        # 10.5 s would be 3 m off in a geosynchronous and 110 m in a low orbit; a position is written to 1 um
        export(made, "--orbits", "oem", "--step", "60", "--out", out + "/60")
        export(made, "--orbits", "oem", "--step", "0.5", "--out", out + "/fine")
        for (meta, rows), (_, fine) in zip(read_oem(out + "/60/orbits.oem"), read_oem(out + "/fine/orbits.oem")):
            self.assertEqual((meta["INTERPOLATION"], meta["INTERPOLATION_DEGREE"]), ("LAGRANGE", "9"))
            nodes = [seconds(utc, epoch) for utc, _ in rows]
            for utc, state in fine:
                self.assertLess(math.dist(lagrange(nodes, [r[1] for r in rows], seconds(utc, epoch), 9), state[:3]), 1e-6)

    def test_default_step(self):
        out = self.out()
        export(self.made, "--orbits", "oem", "--out", out)
        self.assertEqual([len(rows) for _, rows in read_oem(out + "/orbits.oem")], [21, 21])

    def test_orbits_that_end(self):
        """What decays, or comes from a file with a gap, is written where it has an orbit."""
        folder = runs.scratch()
        rows = {0: "", 10: "", 30: "", 40: ""}
        for t in rows:
            rows[t] = f"2022-06-16T22:10:{t:02d} 42164 {3.07 * t} 0 0 3.07 0\n"
        head = ("META_START\nOBJECT_NAME = G\nOBJECT_ID = G\nCENTER_NAME = EARTH\nREF_FRAME = GCRF\n"
                "TIME_SYSTEM = UTC\nSTART_TIME = 2022-06-16T22:10:{}\n"
                "STOP_TIME = 2022-06-16T22:10:{}\nMETA_STOP\n")
        with open(folder + "/gap.oem", "w", encoding="ascii") as file:
            file.write("CCSDS_OEM_VERS = 2.0\n" + head.format("00", "10") + rows[0] + rows[10]
                       + head.format("30", "40") + rows[30] + rows[40])
        falling = {"name": "D", "orbit": {"source": "numerical", "state": {
            "position_gcrf_m": [6459137, 0, 0], "velocity_gcrf_mps": [-300, 7500, 0]}}}
        gone = {"name": "L", "orbit": {"source": "numerical", "state": {
            "at_s": 100, "position_gcrf_m": [6459137, 0, 0], "velocity_gcrf_mps": [9000, 0, 0]}}}
        gap = {"name": "G", "orbit": {"source": "oem", "oem_file": folder + "/gap.oem"}}
        sets = "/world/objects=" + json.dumps([
            {"name": "INMARSAT GX5", "orbit": {
                "elements_file": os.path.abspath("scenarios/catalogue_2022-06.tle"),
                "norad": 44801}}, falling, gap, gone])
        runs.run(runs.TRACK, folder + "/run", runs.NO_FRAMES, sets, duration=40)
        result = call("export", folder + "/run", "--orbits", "oem", "--step", "1", "--out",
                      folder + "/out")
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertEqual(result.stdout, folder + "/out/orbits.oem: 4 orbits\n")
        self.assertIn("warning: D is left out where it has no orbit: ", result.stderr)
        self.assertIn("warning: G is left out where it has no orbit: ", result.stderr)
        self.assertIn("warning: L is left out: ", result.stderr)
        # a file is continued by 5 s, but not into its gap
        self.assertEqual([(meta["OBJECT_NAME"], states[0][0][17:19], states[-1][0][17:19])
                          for meta, states in read_oem(folder + "/out/orbits.oem")],
                         [("neossat", "00", "40"), ("INMARSAT GX5", "00", "40"),
                          ("D", "00", "03"), ("G", "00", "10"), ("G", "30", "40")])
        call("export", folder + "/run", "--orbits", "czml", "--step", "1", "--out", folder + "/out")
        with open(folder + "/out/orbits.czml", encoding="utf-8") as file:
            ids = [packet["id"] for packet in json.load(file)]
        self.assertEqual(ids, ["document", "observer/neossat", "object/INMARSAT GX5", "object/D",
                               "object/G", "object/G/2"] + [
                                   "view/neossat/telescope" + tail
                                   for tail in ("/eye", "/1", "/2", "/3", "/4", "")])

    # -------------------------------------------------------------- observations

    def test_tdm(self):
        out = self.out()
        export(self.made, "--observations", "tdm", "--angles", "filtered", "--out", out)
        rows = self.database.execute(
            "SELECT time_s, ra_deg, dec_deg, v_mag FROM tracks WHERE misses_in_row = 0 AND"
            " target_of_interest = 1 ORDER BY tick").fetchall()
        self.assertGreater(len(rows), 3)
        segments = [s for s in read_tdm(out + "/observations.tdm")
                    if s[0]["PARTICIPANT_2"] == "INMARSAT GX5"]
        self.assertEqual(len(segments), 1)
        meta, data = segments[0]
        self.assertEqual((meta["PARTICIPANT_1"], meta["TIME_SYSTEM"], meta["ANGLE_TYPE"],
                          meta["EPHEMERIS_NAME_1"]), ("neossat", "UTC", "RADEC", "observers.oem"))
        words = " ".join(meta["COMMENT"]).lower()
        self.assertIn("aberration", words)
        self.assertIn("light time contained", words)
        for key in ("ANGLE_1", "ANGLE_2", "MAG"):
            self.assertGreaterEqual(len(data[key]), len(rows))
        found = {round(seconds(utc, self.epoch) * 1e6): i
                 for i, (utc, _) in enumerate(data["ANGLE_1"])}
        for time_s, ra, dec, mag in rows:
            i = found[round(time_s * 1e6)]
            # 1e-9 deg and 1e-4 mag are written
            self.assertAlmostEqual(data["ANGLE_1"][i][1], ra % 360, delta=1e-9)
            self.assertAlmostEqual(data["ANGLE_2"][i][1], dec, delta=1e-9)
            self.assertAlmostEqual(data["MAG"][i][1], mag, delta=1e-4)
        # and they are where the object truly is, as geometric directions with light time: an
        # aberrated direction would be 25 arcsec off. The track is good to some arcsec.
        truth = {round(row["mid_s"] * 1e6): row for row in self.database.execute(
            "SELECT mid_s, ra_deg, dec_deg FROM truth WHERE kind = 'object'")}
        time_s, ra, dec, _ = rows[-1]
        row = truth[round(time_s * 1e6)]
        self.assertAlmostEqual(dec, row["dec_deg"], delta=5 / 3600)
        self.assertAlmostEqual(ra, row["ra_deg"], delta=5 / 3600)

    def test_measured_directions(self):
        """TDM, JSON and CSV say one thing: what frames measured, with the observer's states."""
        out = self.out()
        for form in ("tdm", "json", "csv"):
            export(self.made, "--observations", form, "--out", out)
        self.assertEqual(sorted(os.listdir(out)),
                         ["observations.csv", "observations.json", "observations.tdm",
                          "observers.oem"])
        (_, states), = read_oem(out + "/observers.oem")
        self.assertEqual((seconds(states[0][0], self.epoch), seconds(states[-1][0], self.epoch)),
                         (0, 28))
        for i, (utc, _) in enumerate(states):  # without --step: twenty steps, at most a minute each
            self.assertAlmostEqual(seconds(utc, self.epoch), 1.4 * i, delta=1e-6)
        with open(out + "/observations.json", encoding="utf-8") as file:
            items = json.load(file)
        with open(out + "/observations.csv", newline="", encoding="utf-8") as file:
            rows = list(csv.DictReader(file, strict=True))
        angles = [(utc, ra, dec, meta["PARTICIPANT_2"])
                  for meta, data in read_tdm(out + "/observations.tdm")
                  for (utc, ra), (_, dec) in zip(data["ANGLE_1"], data["ANGLE_2"], strict=True)]
        self.assertGreater(len(angles), 3)
        self.assertIn("INMARSAT GX5", {name for *_, name in angles})
        exposures = {round(row["mid_s"] * 1e6): row
                     for row in self.database.execute("SELECT * FROM exposures")}
        for (utc, ra, dec, name), item, row in zip(angles, items, rows, strict=True):
            mid_s = seconds(utc, self.epoch)
            self.assertEqual(mid_s, seconds(item["obTime"], self.epoch))
            self.assertEqual(mid_s, seconds(row["utc"], self.epoch))
            self.assertEqual((item["origObjectId"], row["object"]), (name, name))
            self.assertEqual(row["track"], f"neossat/telescope/{item['trackId']}")
            for found in (item["ra"], float(row["ra_deg"])):
                self.assertAlmostEqual(found, ra, delta=1e-9)  # as written in the TDM
            for found in (item["declination"], float(row["dec_deg"])):
                self.assertAlmostEqual(found, dec, delta=1e-9)
            # nominally known on board: the truth, computed twice
            true = exposures[round(mid_s * 1e6)]
            for axis in "xyz":
                self.assertAlmostEqual(item[f"sen{axis}"] * 1e3, true[f"observer_gcrf_{axis}_m"],
                                       delta=1e-3)
                self.assertAlmostEqual(float(row[f"observer_gcrf_{axis}_mps"]),
                                       true[f"observer_gcrf_{axis}_mps"], delta=1e-6)

    # -------------------------------------------------------------- frames

    def test_png(self):
        out = self.out()
        export(self.made, "--frames", "png", "--first", "3", "--last", "20", "--every", "8", "--out",
               out)
        self.assertEqual(sorted(os.listdir(out + "/frames")),
                         ["frame_000003.png", "frame_000011.png", "frame_000019.png"])
        width, height, rows = read_png(out + "/frames/frame_000011.png")
        self.assertEqual((width, height), (1024, 1024))
        # the brightest detection that is not cut off is bright in the picture, its row and column
        # as they are; and the ground is dark
        star = self.database.execute(
            "SELECT x_px, y_px FROM detections WHERE exposure_id = 11 AND edge = 0"
            " ORDER BY flux_e DESC LIMIT 1").fetchone()
        step = len(rows[0]) // width
        x, y = round(star[0]), round(star[1])
        self.assertGreater(max(rows[v][u * step] for v in range(y - 2, y + 3)
                               for u in range(x - 2, x + 3)), 200)
        values = sorted(v for row in rows[::16] for v in row[::16 * step])
        self.assertLess(values[len(values) // 2], 80)
        # without marks there is no colour
        if step == 3:
            self.assertEqual(sum(row[0::3] != row[1::3] for row in rows), 0)

    def test_annotate(self):
        plain, marked = self.out(), self.out()
        words = ("--frames", "png", "--first", "27", "--size", "512")
        export(self.made, *words, "--out", plain)
        export(self.made, *words, "--annotate", "--out", marked)
        width, height, a = read_png(plain + "/frames/frame_000027.png")
        _, _, b = read_png(marked + "/frames/frame_000027.png")
        self.assertEqual((width, height), (512, 512))
        pixel = lambda rows, x, y: tuple(rows[y][3 * x:3 * x + 3])  # noqa: E731
        changed = [(x, y) for y in range(512) for x in range(512) if pixel(a, x, y) != pixel(b, x, y)]
        self.assertGreater(len(changed), 1000)
        # the red square around the true place of the target, 11 px away at half the scale
        x, y = self.database.execute(
            "SELECT x_chief_px, y_chief_px FROM truth WHERE kind = 'object' AND exposure_id = 27"
            ).fetchone()
        x, y = (x + 0.5) / 2 - 0.5, (y + 0.5) / 2 - 0.5
        red = [(u, v) for u, v in changed if pixel(b, u, v)[0] > 200 and pixel(b, u, v)[1] < 130 and
               pixel(b, u, v)[2] < 130]
        near = [p for p in red if abs(p[0] - x) < 13 and abs(p[1] - y) < 13]
        self.assertGreater(len(near), 20)
        # its four sides lie even about it
        self.assertAlmostEqual(min(p[0] for p in near) + max(p[0] for p in near), 2 * x, delta=2)
        self.assertAlmostEqual(min(p[1] for p in near) + max(p[1] for p in near), 2 * y, delta=2)

    def test_layouts_give_the_same_pictures(self):
        folder = runs.scratch()
        schema = json.loads(call("schema").stdout)
        extensions = "/record/frames=extensions"
        kinds = {"raw": (extensions, "/record/compression=none"), "cube": ("/record/frames=cube",)}
        if "compression" in schema["properties"]["record"]["properties"]:
            kinds["rice"] = (extensions, "/record/compression=rice")
        pictures = {}
        for name, sets in kinds.items():
            made = os.path.join(folder, name)
            runs.run(runs.STARE, made, *sets, duration=3)
            out = os.path.join(folder, name + ".out")
            export(made, "--frames", "png", "--annotate", "--size", "256", "--out", out)
            pictures[name] = {}
            for file_name in sorted(os.listdir(out + "/frames")):
                with open(f"{out}/frames/{file_name}", "rb") as file:
                    pictures[name][file_name] = hashlib.sha256(file.read()).hexdigest()
        self.assertEqual(len(pictures["raw"]), 3)
        for name in kinds:
            self.assertEqual(pictures[name], pictures["raw"], name)

    # -------------------------------------------------------------- misuse and trouble

    def fails(self, code, message, *words):
        result = call("export", *words)
        self.assertEqual((result.returncode, result.stdout), (code, ""))
        self.assertIn(message, result.stderr)

    def test_misuse(self):
        self.fails(2, "one folder of a run is expected, 0 were given")
        self.fails(2, "nothing to export: add --frames, --table, --orbits, --observations, "
                      "--satnet, --coco, --yolo or --page", self.made)
        self.fails(2, "--frames gif: give one of png|mp4", self.made, "--frames", "gif")
        self.fails(2, "--every 0: give an integer from 1", self.made, "--every", "0")
        out = self.out()
        names = ", ".join(row[0] for row in self.database.execute(
            'SELECT "table" FROM tables ORDER BY rowid'))
        self.fails(1, f'{self.made}: has no table "stars"; it has {names}\n', self.made, "--table",
                   "csv", "--tables", "truth,stars", "--out", out)
        self.fails(1, f'{self.made}: has no sensor "nose"; it has neossat/telescope\n', self.made,
                   "--frames", "png", "--sensor", "nose", "--out", out)
        self.fails(2, f"--out {self.made}: is the folder {self.made}, which is read", self.made, "--table",
                   "csv", "--out", self.made)
        self.assertEqual(os.listdir(out), [])
        export(self.made, "--frames", "png", "--sensor", "neossat/telescope", "--last", "0", "--out",
               out)
        self.assertEqual(os.listdir(out + "/frames"), ["frame_000000.png"])

    def test_out_that_is_a_file(self):
        path = os.path.join(runs.scratch(), "file")
        with open(path, "w", encoding="ascii"):
            pass
        self.fails(2, f"--out {path}: Not a directory; give the name of a folder\n", self.made,
                   "--table", "csv", "--out", path)

    @unittest.skipUnless(os.path.exists("/dev/full"), "needs /dev/full")
    def test_nothing_half_written(self):
        # a limit on the size of files stands for a full disk
        out = self.out()
        script = 'trap "" XFSZ; ulimit -f 64; exec "$0" "$@"'
        result = subprocess.run(["sh", "-c", script, runs.BORESIGHT, "export", self.made, "--table",
                                 "csv", "--tables", "detections", "--out", out],
                                capture_output=True, text=True, timeout=60)
        self.assertEqual((result.returncode, result.stderr),
                         (1, f"boresight: {out}/detections.csv: cannot be written: File too large\n"))
        self.assertEqual(os.listdir(out), [])

    def test_interrupt(self):
        out = self.out()
        process = subprocess.Popen([runs.BORESIGHT, "export", self.made, "--frames", "png",
                                    "--out", out], stdout=subprocess.DEVNULL,
                                   stderr=subprocess.PIPE, text=True)
        while not os.path.isdir(out + "/frames") or not os.listdir(out + "/frames"):
            if process.poll() is not None:
                break
        process.send_signal(signal.SIGINT)
        _, errors = process.communicate(timeout=60)
        self.assertEqual((process.returncode, errors), (130, "boresight: interrupted\n"))
        names = os.listdir(out + "/frames")
        self.assertTrue(names)
        for name in names:
            self.assertRegex(name, r"^frame_\d{6}\.png$")
            self.assertEqual(read_png(os.path.join(out, "frames", name))[:2], (1024, 1024))

    def test_run_stays_as_it_is(self):
        before = {name: os.stat(os.path.join(self.made, name)).st_mtime_ns
                  for name in os.listdir(self.made)}
        export(self.made, "--table", "csv", "--tables", "run", "--orbits", "czml")
        self.assertEqual(sorted(os.listdir(self.made + ".export")), ["orbits.czml", "run.csv"])
        after = {name: os.stat(os.path.join(self.made, name)).st_mtime_ns
                 for name in os.listdir(self.made)}
        self.assertEqual(after, before)


def tearDownModule():
    runs.clean()


if __name__ == "__main__":
    unittest.main()
