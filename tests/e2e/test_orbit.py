#!/usr/bin/env python3
"""boresight orbit: from rendered frames to an orbit, judged by the truth that it does not use.

Usage, from the repository root: /usr/bin/python3 tests/e2e/test_orbit.py BORESIGHT
"""
import json
import math
import os
import unittest

import numpy as np

import optics
import runs
from runs import call
from readers import read_oem, read_tdm, seconds


class Orbit(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = runs.scratch()
        cls.made = os.path.join(cls.folder, "run")
        runs.run(runs.TRACK, cls.made, runs.NO_FRAMES, duration=140)
        cls.database = runs.database(cls.made)
        cls.epoch = cls.database.execute("SELECT epoch_utc FROM run").fetchone()[0]
        files = {key: os.path.join(cls.folder, name)
                 for key, name in (("oem", "o.oem"), ("omm", "o.json"), ("tdm", "o.tdm"),
                                   ("json", "obs.json"), ("report", "r.json"))}
        words = [word for key, path in files.items() for word in ("--" + key, path)]
        result = call("orbit", cls.made, "--predict", "3600", "--step", "5", *words)
        if result.returncode or result.stderr:
            raise AssertionError(result.stderr)
        cls.said, cls.files = result.stdout, files
        with open(files["report"], encoding="utf-8") as file:
            cls.report = json.load(file)

    def truth(self):
        """True states of the object every second."""
        out = os.path.join(self.folder, "true")
        result = call("export", self.made, "--orbits", "oem", "--step", "0.25", "--out", out)
        self.assertEqual(result.returncode, 0, result.stderr)
        return {round(4 * seconds(utc, self.epoch)): state
                for utc, state in read_oem(out + "/orbits.oem")[1][1]}

    def test_it_is_the_true_orbit(self):
        report = self.report
        self.assertEqual((report["object"], report["observer"]), ("INMARSAT GX5", "neossat"))
        self.assertGreater(report["used"], 100)
        self.assertEqual(report["rejected"], 0)
        # five sigma of chi-square over its degrees of freedom, with what the model of errors lacks
        self.assertAlmostEqual(report["chi2_stated"] / report["dof"], 1,
                               delta=5 * math.sqrt(2 / report["dof"]) + 0.1)
        self.assertAlmostEqual(report["chi2"] * report["covariance_factor"], report["chi2_stated"],
                               delta=1e-9 * report["chi2"])
        # the stated covariances count as 20 degrees of freedom
        self.assertAlmostEqual(report["covariance_factor"], (20 + report["chi2_stated"])
                               / (20 + report["dof"]), delta=1e-12)
        self.assertEqual(report["motion"], "SGP4")
        state = self.truth()[round(4 * report["epoch_s"])]
        sigma = [math.sqrt(report["covariance_gcrf"][i][i]) for i in range(6)]
        found = report["position_gcrf_m"] + report["velocity_gcrf_mps"]
        for i in range(6):
            # four sigma, and SGP4's velocity, which is 0.1 m/s from its positions' derivative
            self.assertAlmostEqual(found[i], 1e3 * state[i], delta=4 * sigma[i] + 0.2 * (i > 2))
        # two minutes of a LEO's own motion tell the range of a GEO to some 10 km
        self.assertLess(math.hypot(*sigma[:3]), 100e3)
        self.assertAlmostEqual(report["osculating"]["semi_major_axis_m"], 42.165e6, delta=1e6)

    def test_report_agrees_with_itself(self):
        """Osculating elements, arc, sums and sigmas, from the report's state, covariance and observations."""
        report, gm = self.report, 3.986004415e14
        r, v = np.array(report["position_gcrf_m"]), np.array(report["velocity_gcrf_mps"])
        h, found = np.cross(r, v), report["osculating"]
        e = np.cross(v, h) / gm - r / np.linalg.norm(r)
        node = np.cross([0, 0, 1], h)
        a = 1 / (2 / np.linalg.norm(r) - v @ v / gm)
        turned = lambda x, y: np.degrees(np.arctan2(np.cross(x, y) @ h / np.linalg.norm(h), x @ y)) % 360  # noqa: E731
        anomaly = np.arctan2(np.sqrt(1 - e @ e) * np.sin(np.radians(turned(e, r))),
                             np.linalg.norm(e) + np.cos(np.radians(turned(e, r))))
        expected = {"semi_major_axis_m": a, "eccentricity": np.linalg.norm(e), "arg_perigee_deg": turned(node, e),
                    "inclination_deg": np.degrees(np.arccos(h[2] / np.linalg.norm(h))),
                    "raan_deg": np.degrees(np.arctan2(node[1], node[0])) % 360,
                    "mean_anomaly_deg": np.degrees(anomaly - np.linalg.norm(e) * np.sin(anomaly)) % 360}
        for key, value in expected.items():
            # gm of the forces is known to 1e-9
            self.assertAlmostEqual(found[key] % 360 if key.endswith("deg") else found[key], value, delta=1e-6 * abs(value), msg=key)
        rows = self.database.execute(
            "SELECT time_s FROM tracks WHERE track_id = ? AND misses_in_row = 0 ORDER BY tick", (report["track"],)).fetchall()
        times = [seconds(item["utc"], self.epoch) for item in report["observations"]]
        self.assertEqual(len(times), report["used"] + report["rejected"])
        self.assertLessEqual(set(np.round(times, 6)), {round(row[0], 6) for row in rows})
        self.assertAlmostEqual(report["arc_s"], times[-1] - times[0], delta=1e-6)
        self.assertEqual(report["used"] + report["rejected"] + report["without_attitude"], len(rows))
        self.assertEqual(report["dof"], 2 * report["used"] - 6)
        self.assertAlmostEqual(seconds(report["epoch_utc"], self.epoch), report["epoch_s"], delta=1e-6)
        covariance = np.array(report["covariance_gcrf"])
        np.testing.assert_allclose(covariance, covariance.T, rtol=1e-12)
        scale = np.sqrt(np.diag(covariance))
        self.assertGreater(np.linalg.eigvalsh(covariance / np.outer(scale, scale)).min(), 0)
        # the range and its sigma, from the observer's place at that time
        here = np.array(self.database.execute(
            "SELECT observer_gcrf_x_m, observer_gcrf_y_m, observer_gcrf_z_m FROM exposures ORDER BY abs(mid_s - ?)",
            (report["epoch_s"],)).fetchone())
        sight = (r - here) / np.linalg.norm(r - here)
        self.assertAlmostEqual(report["range_m"] / np.linalg.norm(r - here), 1, delta=2e-3)
        self.assertAlmostEqual(report["range_sigma_m"] / np.sqrt(sight @ covariance[:3, :3] @ sight), 1, delta=2e-2)
        # the OEM's covariance is the report's, in km, lower triangle
        with open(self.files["oem"], encoding="ascii") as file:
            text = file.read()
        lines = [[float(w) for w in line.split()] for line in text[text.index("COVARIANCE_START"):].splitlines()[3:9]]
        for i, line in enumerate(lines):
            for k, value in enumerate(line):
                self.assertAlmostEqual(value * 1e6 / covariance[i, k], 1, delta=1e-9, msg=(i, k))

    def test_what_it_says(self):
        self.assertRegex(self.said, r"^neossat/telescope, track \d+ \(INMARSAT GX5\)\n")
        self.assertIn(f"{self.report['used']} used, 0 left out", self.said)

    def test_oem_and_omm(self):
        (meta, rows), = read_oem(self.files["oem"])
        self.assertEqual((meta["OBJECT_NAME"], meta["REF_FRAME"]), ("INMARSAT GX5", "GCRF"))
        start, stop = (seconds(rows[i][0], self.epoch) for i in (0, -1))
        self.assertAlmostEqual(stop - start, self.report["arc_s"] + 3600, delta=1e-6)
        with open(self.files["oem"], encoding="ascii") as file:
            text = file.read()
        block = text[text.index("COVARIANCE_START"):].splitlines()
        self.assertEqual([len(line.split()) for line in block[3:9]], [1, 2, 3, 4, 5, 6])
        self.assertAlmostEqual(float(block[3]) * 1e6 / self.report["covariance_gcrf"][0][0], 1,
                               delta=1e-10)
        # our own reader takes it: an object of a scenario moves along it
        target = "/world/objects=" + json.dumps([{"name": "INMARSAT GX5", "orbit": {
            "source": "oem", "oem_file": self.files["oem"]}}])
        epoch = '/epoch_utc="2022-06-16T22:11:00Z"'
        checked = call("check", runs.TRACK, "--quiet", "--set", target, "--set", epoch,
                       "--duration", "60", "--set", "/world/star_catalogue=embedded")
        self.assertEqual(checked.returncode, 0, checked.stderr)
        # mean elements: SGP4 goes along the orbit as far as it says
        with open(self.files["omm"], encoding="utf-8") as file:
            omm, = json.load(file)
        self.assertEqual((omm["MEAN_ELEMENT_THEORY"], omm["REF_FRAME"]), ("SGP4", "TEME"))
        self.assertAlmostEqual(omm["MEAN_MOTION"], 1.0027, delta=0.03)
        table = call("propagate", "--elements", self.files["omm"], "--frame", "gcrf", "--start",
                     "2022-06-16T22:12:00Z", "--stop", "2022-06-16T22:12:00Z", "--step", "1")
        self.assertEqual(table.returncode, 0, table.stderr)
        place = [float(word) for word in table.stdout.splitlines()[-1].split(",")[2:5]]
        near = min(rows, key=lambda row: abs(seconds(row[0], self.epoch) - 120))
        away = seconds(near[0], self.epoch) - 120
        expected = [near[1][i] - away * near[1][3 + i] for i in range(3)]
        self.assertLess(math.dist(place, expected) * 1e3,
                        5 * self.report["mean_elements_rms_m"] + 1)

    def test_observations(self):
        (meta, data), = read_tdm(self.files["tdm"])
        self.assertEqual((meta["PARTICIPANT_1"], meta["PARTICIPANT_2"], meta["ANGLE_TYPE"]),
                         ("neossat", "INMARSAT GX5", "RADEC"))
        with open(self.files["json"], encoding="utf-8") as file:
            items = json.load(file)
        truth = {round(row["mid_s"] * 1e6): row for row in self.database.execute(
            "SELECT t.mid_s, ra_deg, dec_deg, observer_gcrf_x_m FROM truth t JOIN exposures e"
            " USING (sensor, exposure_id) WHERE kind = 'object'")}
        self.assertEqual(len(items), len(data["ANGLE_1"]))
        worst = 0
        for item, (utc, ra), (_, dec) in zip(items, data["ANGLE_1"], data["ANGLE_2"], strict=True):
            self.assertAlmostEqual(item["ra"], ra, delta=1e-9)
            row = truth[round(seconds(utc, self.epoch) * 1e6)]
            self.assertEqual(seconds(item["obTime"], self.epoch), seconds(utc, self.epoch))
            self.assertEqual((item["type"], item["satNo"], item["uct"]), ("OPTICAL", 44801, False))
            self.assertAlmostEqual(item["senx"], row["observer_gcrf_x_m"] * 1e-3, delta=1e-6)
            self.assertAlmostEqual(item["expDuration"], 0.5, delta=1e-9)
            off = math.hypot((ra - row["ra_deg"]) * math.cos(math.radians(dec)),
                             dec - row["dec_deg"])
            worst = max(worst, off / math.hypot(item["raUnc"], item["declinationUnc"]))
        self.assertLess(worst, 5)  # of hundreds

    def with_aberration(self, path):
        """A TDM with the apparent directions of those in this one; its path."""
        exposures = {round(1e6 * row["mid_s"]): row for row in self.database.execute("SELECT * FROM exposures")}
        with open(path, encoding="utf-8") as file:
            lines = file.read().split("\n")
        angles, segment = {}, 0
        for line in lines:
            segment += line == "META_START"
            word = line.split()
            if word and word[0] in ("ANGLE_1", "ANGLE_2"):
                angles.setdefault((segment, word[2]), {})[word[0]] = float(word[3])
        made, segment = os.path.join(self.folder, "apparent.tdm"), 0
        with open(made, "w", encoding="utf-8") as file:
            for line in lines:
                segment += line == "META_START"
                word = line.split()
                if word and word[0] in ("ANGLE_1", "ANGLE_2"):
                    both = angles[segment, word[2]]
                    row = exposures[round(1e6 * seconds(word[2], self.epoch))]
                    d = optics.apparent(row, optics.unit(both["ANGLE_1"], both["ANGLE_2"]))
                    value = math.degrees(math.atan2(d[1], d[0])) % 360 if word[0] == "ANGLE_1" else math.degrees(math.asin(d[2]))
                    line = f"{word[0]} = {word[2]} {value:.10f}"
                file.write(line + "\n")
        return made

    def test_from_a_tdm(self):
        """What is exported and read again gives the same orbit."""
        out = os.path.join(self.folder, "out")
        self.assertEqual(call("export", self.made, "--observations", "tdm", "--out",
                              out).returncode, 0)
        report = os.path.join(self.folder, "again.json")
        words = [out + "/observations.tdm", "--observer", out + "/observers.oem"]
        result = call("orbit", *words, "--sigma", "0.16", "--report", report)
        self.assertEqual(result.returncode, 0, result.stderr)
        with open(report, encoding="utf-8") as file:
            again = json.load(file)
        self.assertEqual((again["object"], again["observer"]), ("INMARSAT GX5", "neossat"))
        self.assertEqual(again["used"], self.report["used"])
        # other weights, the same angles: well within what they leave open
        self.assertLess(math.dist(again["position_gcrf_m"], self.report["position_gcrf_m"]),
                        0.5 * self.report["range_sigma_m"])
        # apparent directions, by ERFA's aberration, whose aberration is to be removed, give it too
        seen = self.with_aberration(out + "/observations.tdm")
        result = call("orbit", seen, *words[1:], "--sigma", "0.16", "--aberration", "contained", "--report", report)
        self.assertEqual(result.returncode, 0, result.stderr)
        with open(report, encoding="utf-8") as file:
            removed = json.load(file)
        self.assertLess(math.dist(removed["position_gcrf_m"], again["position_gcrf_m"]), 1)  # 3 km if it is not removed
        for extra, message in (((words[0],), "add --observer FILE.oem"),
                               ((*words, "--object", "X"), 'has no angles of "X"'),
                               ((*words, "--observer-name", "X"), "observers.oem"),
                               ((words[2], "--observer", words[2]), "does not begin as a TDM")):
            result = call("orbit", *extra)
            self.assertEqual(result.returncode, 1)
            self.assertIn(message, result.stderr)

    def test_radius(self):
        """By the scenario's area, or as given: what a larger one adds grows as its square."""
        def covariance(*words):
            report = os.path.join(self.folder, "radius.json")
            result = call("orbit", self.made, *words, "--report", report)
            self.assertEqual(result.returncode, 0, result.stderr)
            with open(report, encoding="utf-8") as file:
                found = json.load(file)
            return found["radius_m"], np.array(found["covariance_gcrf"])
        with open(runs.TRACK, encoding="utf-8") as file:
            area_m2 = json.load(file)["world"]["objects"][0]["area_m2"]
        self.assertAlmostEqual(self.report["radius_m"], math.sqrt(area_m2 / math.pi), delta=1e-9)
        none, small, large = (covariance("--radius", words)[1] for words in ("0", "500", "1000"))
        self.assertAlmostEqual(covariance("--radius", "0")[0], 0, delta=0)
        scale = np.sqrt(np.outer(np.diag(large), np.diag(large)))
        # of numbers written to 17 digits
        np.testing.assert_allclose((large - none) / scale, 4 * (small - none) / scale, atol=1e-8)
        self.assertGreater(np.trace((large - none) / scale), 1e-6)

    def test_mistakes(self):
        for words, code, message in (
                ((self.made, "--track", "77"), 1, "holds no confirmed track 77"),
                ((self.made, "--sensor", "x"), 1, 'has no sensor "x"; it has neossat/telescope'),
                ((), 2, "one folder of a run, or a TDM, is expected"),
                ((self.folder + "/none",), 1, "none"),
                ((self.made, "--track", "0"), 2, "--track"),
                ((self.made, "--oem", self.folder), 2, self.folder),
                ((self.made, "--radius", "-1"), 2, "--radius"),
                # a run has observer, errors and aberration of its own
                *(((self.made, "--" + name, value), 2, f"--{name} is for angles of a TDM, and {self.made} is a run")
                  for name, value in (("observer", self.files["oem"]), ("observer-name", "neossat"), ("object", "X"),
                                      ("sigma", "1"), ("aberration", "removed"), ("aberration", "contained")))):
            result = call("orbit", *words)
            self.assertEqual(result.returncode, code, result.stderr)
            self.assertIn(message, result.stderr)
        self.assertEqual(call("orbit", "--help").returncode, 0)


if __name__ == "__main__":
    unittest.main()
