#!/usr/bin/env python3
"""What `export` and `orbit` write of a scene without symmetry, worked out here with numpy, ERFA and sgp4: CZML's orbits and
fields of view, measured directions with their covariances in three formats, marks in pictures, orbits.

Usage, from the repository root: /usr/bin/python3 tests/e2e/test_skewed_exports.py BORESIGHT
"""
import csv
import json
import os
import unittest

import numpy as np

import figures
import optics
import runs
from runs import call_well
from optics import ARCSEC, angle, columns, quaternion, rotate, unit
from readers import read_oem, read_png, read_tdm, seconds
from skewed_scene import (DURATION_S, ELEMENTS, EXPOSURE_S, NAV_GROWTH_MPS, NAV_RTN_M, NAV_RTN_MPS, NORAD, OBSERVER, WINDOW,
                          scenario)

SHARED_MOTION_M = 0.5  # what two SGP4s and two rotations to GCRF differ by


class SkewedExports(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = runs.scratch()
        cls.made, cls.out = os.path.join(cls.folder, "run"), os.path.join(cls.folder, "out")
        runs.run(scenario(cls.folder), cls.made, "/record/telemetry_hz=1", f"{runs.SENSOR}/exposure/binning=2")
        for words in (("--orbits", "czml", "--step", "4"), ("--orbits", "oem", "--step", "4"), ("--observations", "json"),
                      ("--observations", "csv"), ("--observations", "tdm"),
                      ("--frames", "png", "--annotate", "--first", "30", "--last", "30", "--size", "144")):
            call_well("export", cls.made, *words, "--out", cls.out)
        cls.db = runs.database(cls.made)
        cls.epoch = cls.db.execute("SELECT epoch_utc FROM run").fetchone()[0]
        with open(os.path.join(cls.made, "scenario.json"), encoding="utf-8") as file:
            scene = json.load(file)
        cls.camera = optics.Camera(scene["observers"][0]["sensors"][0]["camera"])
        cls.eye = figures.Orbit(ELEMENTS, OBSERVER, scene["epoch_utc"])
        cls.target = figures.Orbit(ELEMENTS, NORAD, scene["epoch_utc"])
        cls.exposures = {e["exposure_id"]: e for e in cls.db.execute("SELECT * FROM exposures")}

    def path(self, name):
        return os.path.join(self.out, name)

    @staticmethod
    def places(packet):
        """Seconds and positions of a packet of CZML."""
        numbers = np.array(packet["position"]["cartesian"]).reshape(-1, 4)
        return numbers[:, 0], numbers[:, 1:]

    def test_score_of_the_run(self):
        """Pairs of the target with what was found, in binned pixels of the window."""
        def places(table, columns, condition):
            rows = self.db.execute(f"SELECT exposure_id, {columns} FROM {table} WHERE {condition}").fetchall()
            return [(row[0], (np.array(row[1:3], float) - WINDOW[:2] + 0.5) / 2 - 0.5) for row in rows]
        truth = places("truth JOIN exposures USING (sensor, exposure_id)", "x_centroid_px, y_centroid_px",
                       "kind = 'object' AND in_field AND NOT occulted AND electrons > 0 AND NOT dropped")
        for what, found in (("tracks", places("tracks", "x_px, y_px", "status = 'confirmed' AND misses_in_row = 0")),
                            ("detections", places("detections", "x_px, y_px", "label = 'object'"))):
            scored = json.loads(call_well("score", self.made, "--truth", self.made, "--what", what, "--resamples", "0",
                                          "--json", "-"))
            near = sorted((np.hypot(*(at - place)), i, k) for i, (e, place) in enumerate(truth)
                          for k, (f, at) in enumerate(found) if e == f)
            pairs, used = [], set()
            for d, i, k in near:  # the two objects are far from each other: the nearest are the pairs
                if d <= 5 and not {("truth", i), ("found", k)} & used:
                    used |= {("truth", i), ("found", k)}
                    pairs.append(d)
            pairs = np.array(pairs)
            self.assertGreater(len(pairs), 10, what)
            self.assertEqual([scored[k] for k in ("truths", "found", "true_positives", "false_positives", "false_negatives")],
                             [len(truth), len(found), len(pairs), len(found) - len(pairs), len(truth) - len(pairs)], what)
            self.assertAlmostEqual(scored["figures"]["rms_px"]["value"], np.sqrt(np.mean(pairs**2)), delta=1e-6)
            self.assertAlmostEqual(scored["figures"]["recall"]["value"], len(pairs) / len(truth), delta=1e-9)

    def test_orbits(self):
        with open(self.path("orbits.czml"), encoding="utf-8") as file:
            packets = {p["id"]: p for p in json.load(file)}
        interval = packets["document"]["clock"]["interval"].split("/")
        self.assertEqual([seconds(utc, self.epoch) for utc in interval], [0, DURATION_S])
        segments = {meta["OBJECT_NAME"]: (meta, rows) for meta, rows in read_oem(self.path("orbits.oem"))}
        for name, key, orbit in (("neossat", "observer/neossat", self.eye), ("INMARSAT GX5", "object/INMARSAT GX5", self.target)):
            times, places = self.places(packets[key])
            self.assertEqual([seconds(utc, self.epoch) for utc in packets[key]["availability"].split("/")], [0, DURATION_S])
            np.testing.assert_allclose(times, [*range(0, DURATION_S, 4), DURATION_S], atol=1e-9)
            self.assertEqual(seconds(packets[key]["position"]["epoch"], self.epoch), 0)
            meta, rows = segments[name]
            self.assertEqual(seconds(meta["START_TIME"], self.epoch), 0)
            self.assertEqual(seconds(meta["STOP_TIME"], self.epoch), DURATION_S)
            for t, place, (utc, state) in zip(times, places, rows, strict=True):
                self.assertEqual(seconds(utc, self.epoch), t)
                true = orbit.position(t)
                speed = (orbit.position(t + 0.1) - orbit.position(t - 0.1)) / 0.2
                self.assertLess(np.linalg.norm(place - true), SHARED_MOTION_M)
                self.assertLess(np.linalg.norm(1e3 * np.array(state[:3]) - true), SHARED_MOTION_M)
                # SGP4's velocity is not quite that of its places
                self.assertLess(np.linalg.norm(1e3 * np.array(state[3:]) - speed), 0.1)
        self.assertEqual(segments["INMARSAT GX5"][0]["OBJECT_ID"], f"NORAD-{NORAD}")
        self.assertEqual(segments["NEIGHBOUR"][0]["OBJECT_ID"], "NEIGHBOUR")

    def test_fields_of_view(self):
        """Each corner of the frustum, in order round the sensor, of a sensor where no two are alike."""
        with open(self.path("orbits.czml"), encoding="utf-8") as file:
            packets = {p["id"]: p for p in json.load(file)}
        name = "view/neossat/telescope"
        corners = self.camera.directions([[-0.5, -0.5], [639.5, -0.5], [639.5, 479.5], [-0.5, 479.5]])
        times, eye = self.places(packets[name + "/eye"])
        np.testing.assert_allclose(times + seconds(packets[name + "/eye"]["position"]["epoch"], self.epoch),
                                   [e["mid_s"] for e in self.exposures.values()], atol=1e-6)
        for k, corner in enumerate(corners, 1):
            _, places = self.places(packets[f"{name}/{k}"])
            for e, here, there in zip(self.exposures.values(), eye, places, strict=True):
                self.assertLess(np.linalg.norm(here - columns(e, "observer_gcrf", tail="_m")), 1e-3)
                ray = rotate(optics.conjugate(quaternion(e, "q_cam_from_gcrf_mid")), corner)
                self.assertLess(angle((there - here) / np.linalg.norm(there - here), ray), 1e-9, (k, e["exposure_id"]))
        ends = [end.split("#")[0][len(name) + 1:] for end in packets[name]["polyline"]["positions"]["references"]]
        edges = {frozenset(pair) for pair in zip(ends, ends[1:])}
        self.assertEqual(edges, {frozenset(("eye", k)) for k in "1234"} | {frozenset(("12", "23", "34", "41")[k]) for k in range(4)})

    def believed(self, t):
        """The observer's state as it is known on board."""
        r, v = self.eye.position(t), (self.eye.position(t + 0.1) - self.eye.position(t - 0.1)) / 0.2
        radial, normal = r / np.linalg.norm(r), np.cross(r, v)
        normal = normal / np.linalg.norm(normal)
        axes = np.array([radial, np.cross(normal, radial), normal])
        return r + (NAV_RTN_M + [0, NAV_GROWTH_MPS * t, 0]) @ axes, v + NAV_RTN_MPS @ axes

    def measured(self, row, fix, cov_px):
        """Direction and covariance (east, north, rad^2) of a detection, by differences over pixels and attitude."""
        e = self.exposures[row["exposure_id"]]
        q = optics.conjugate(quaternion(fix, "attitude_q_cam_from_gcrf"))

        def direction(x, y, turn=(0, 0, 0)):
            v = self.camera.directions([x, y])
            v = v + np.cross(turn, v)
            return optics.geometric(e, rotate(q, v / np.linalg.norm(v)))
        x, y = row["x_px"], row["y_px"]
        d, sigma = direction(x, y), columns(fix, "attitude_sigma", tail="_arcsec") * ARCSEC
        ra, dec = np.arctan2(d[1], d[0]), np.arcsin(d[2])
        axes = np.array([[-np.sin(ra), np.cos(ra), 0],
                         [-np.sin(dec) * np.cos(ra), -np.sin(dec) * np.sin(ra), np.cos(dec)]])
        small = 1e-4
        slopes = [direction(x + 0.5, y) - direction(x - 0.5, y), direction(x, y + 0.5) - direction(x, y - 0.5)]
        slopes += [(direction(x, y, small * axis) - direction(x, y, -small * axis)) / (2 * small) for axis in np.eye(3)]
        j = axes @ np.array(slopes).T
        own = np.zeros((5, 5))
        xy, xz, yz = (fix[f"attitude_correlation_{k}"] for k in ("xy", "xz", "yz"))
        own[:2, :2] = cov_px
        own[2:, 2:] = np.outer(sigma, sigma) * [[1, xy, xz], [xy, 1, yz], [xz, yz, 1]]
        return d, j @ own @ j.T

    def test_measured_directions(self):
        with open(self.path("observations.json"), encoding="utf-8") as file:
            items = json.load(file)
        with open(self.path("observations.csv"), newline="", encoding="utf-8") as file:
            lines = list(csv.DictReader(file, strict=True))
        tdm = [(meta, k) for meta, data in read_tdm(self.path("observations.tdm")) for k in range(len(data["ANGLE_1"]))]
        self.assertGreater(len(items), 40)
        self.assertEqual((len(items), len(items)), (len(lines), len(tdm)))
        rows = {(row["track_id"], round(row["time_s"] * 1e6)): row for row in self.db.execute("SELECT * FROM tracks")}
        fixes = {row["exposure_id"]: row for row in self.db.execute("SELECT * FROM track_frames")}
        detections = {(row["exposure_id"], row["x_px"], row["y_px"]): row for row in self.db.execute("SELECT * FROM detections")}
        correlations, steep = [], []
        for item, line in zip(items, lines, strict=True):
            t = seconds(item["obTime"], self.epoch)
            row = rows[int(item["trackId"]), round(t * 1e6)]
            fix, found = fixes[row["exposure_id"]], detections[row["exposure_id"], row["x_px"], row["y_px"]]
            xx, xy, yy = (found[f"cov_{k}_px2"] for k in ("xx", "xy", "yy"))
            d, covariance = self.measured(row, fix, [[xx, xy], [xy, yy]])
            # aberration by the velocity that is believed: 0.04 m/s are 3e-5 arcsec
            self.assertLess(angle(d, unit(item["ra"], item["declination"])), 1e-4 * ARCSEC)
            self.assertLess(angle(d, unit(float(line["ra_deg"]), float(line["dec_deg"]))), 1e-4 * ARCSEC)
            east, north = np.sqrt(np.diag(covariance))
            correlation = covariance[0, 1] / east / north
            self.assertAlmostEqual(item["raUnc"] * 3600, east / ARCSEC, delta=1e-4 * east / ARCSEC)
            self.assertAlmostEqual(item["declinationUnc"] * 3600, north / ARCSEC, delta=1e-4 * north / ARCSEC)
            self.assertAlmostEqual(float(line["ra_sigma_arcsec"]), east / ARCSEC, delta=1e-4 * east / ARCSEC)
            self.assertAlmostEqual(float(line["dec_sigma_arcsec"]), north / ARCSEC, delta=1e-4 * north / ARCSEC)
            self.assertAlmostEqual(float(line["correlation"]), correlation, delta=1e-3)
            correlations.append(correlation)
            steep.append(east / north)
            self.assertAlmostEqual(item["mag"], row["v_mag"], delta=1e-12)
            self.assertAlmostEqual(item["snrEst"], row["snr"], delta=1e-12)
            self.assertEqual((float(line["v_mag"]), float(line["snr"])), (row["v_mag"], row["snr"]))
            self.assertAlmostEqual(item["expDuration"], EXPOSURE_S, delta=1e-12)
            known = row["track_id"] == fixes[44]["target_id"]
            self.assertEqual((item["uct"], item.get("satNo")), (not known, NORAD if known else None))
            self.assertEqual((item["idSensor"], line["sensor"]), ("neossat/telescope", "neossat/telescope"))
            place, velocity = self.believed(t)
            # SGP4's velocity is not quite that of its places
            for axis, key in enumerate("xyz"):
                self.assertAlmostEqual(item[f"sen{key}"] * 1e3, place[axis], delta=SHARED_MOTION_M)
                self.assertAlmostEqual(item[f"senvel{key}"] * 1e3, velocity[axis], delta=0.1)
                self.assertAlmostEqual(float(line[f"observer_gcrf_{key}_m"]), place[axis], delta=SHARED_MOTION_M)
                self.assertAlmostEqual(float(line[f"observer_gcrf_{key}_mps"]), velocity[axis], delta=0.1)
        # the check means something
        self.assertGreater(np.abs(correlations).max(), 0.1)
        self.assertGreater(np.abs(np.log(steep)).max(), 0.05)

    def test_tdm(self):
        own = {}
        for meta, data in read_tdm(self.path("observations.tdm")):
            number = int(" ".join(meta["COMMENT"]).split("track ")[1].split()[0].rstrip(","))
            own[number] = [(seconds(utc, self.epoch), ra, dec, mag) for (utc, ra), (_, dec), (_, mag) in
                           zip(data["ANGLE_1"], data["ANGLE_2"], data["MAG"], strict=True)]
            self.assertEqual(float(meta["INTEGRATION_INTERVAL"]), EXPOSURE_S)
            self.assertEqual(meta["INTEGRATION_REF"], "MIDDLE")
        with open(self.path("observations.json"), encoding="utf-8") as file:
            for item in json.load(file):
                t, ra, dec, mag = own[int(item["trackId"])].pop(0)
                self.assertEqual(t, seconds(item["obTime"], self.epoch))
                self.assertLess(max(abs(ra - item["ra"]), abs(dec - item["declination"])), 1e-9)
                self.assertAlmostEqual(mag, item["mag"], delta=1e-4)
        self.assertEqual([rest for rest in own.values() if rest], [])
        # the observer's states, as the angles' reader needs them: those that are believed
        (_, rows), = read_oem(self.path("observers.oem"))
        for utc, state in rows[::4]:
            place, velocity = self.believed(seconds(utc, self.epoch))
            self.assertLess(np.linalg.norm(1e3 * np.array(state[:3]) - place), SHARED_MOTION_M)
            self.assertLess(np.linalg.norm(1e3 * np.array(state[3:]) - velocity), 0.1)

    def test_marks(self):
        """The red square stands about the target in a picture of half the binned window's size."""
        width, height, picture = read_png(self.path("frames/frame_000030.png"))
        self.assertEqual((width, height), (WINDOW[2] // 4, WINDOW[3] // 4))
        image = np.array([list(row) for row in picture]).reshape(height, width, 3)
        red = (image[:, :, 0] > 200) & (image[:, :, 1] < 130) & (image[:, :, 2] < 130)
        row = self.db.execute("SELECT x_chief_px, y_chief_px FROM truth WHERE kind = 'object' AND id = 0 AND exposure_id = 30"
                              ).fetchone()
        x, y = ((row[k] - WINDOW[k] + 0.5) / 4 - 0.5 for k in range(2))
        rows, cols = np.nonzero(red)
        near = (np.abs(rows - y) < 13) & (np.abs(cols - x) < 13)
        self.assertGreater(near.sum(), 20)
        self.assertAlmostEqual(cols[near].min() + cols[near].max(), 2 * x, delta=2)
        self.assertAlmostEqual(rows[near].min() + rows[near].max(), 2 * y, delta=2)


def tearDownModule():
    runs.clean()


if __name__ == "__main__":
    unittest.main()
