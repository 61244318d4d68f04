#!/usr/bin/env python3
"""boresight lightcurve and turntable from outside: tables, pictures, GLB that reads back, and errors.

Usage, from the repository root: /usr/bin/python3 tests/e2e/test_shapes.py BORESIGHT
"""
import csv
import io
import json
import os
import struct
import subprocess
import tempfile
import unittest

import runs

SATELLITE = "scenarios/satellites/gps_iif.json"
ORBIT = ["--elements", "scenarios/catalogue_2022-06.tle", "--norad", "39089", "--start", "2022-06-16T02:00:00Z"]


def boresight(*words):
    return subprocess.run([runs.BORESIGHT, *words], capture_output=True, text=True)


class Shapes(unittest.TestCase):
    def test_light_curve_from_a_site(self):
        shown = boresight("lightcurve", "--satellite", SATELLITE, *ORBIT, "--duration", "1200", "--step", "10",
                          "--site", "32.44,-110.79,2790", "--extinction", "0.2")
        self.assertEqual(shown.returncode, 0, shown.stderr)
        rows = list(csv.DictReader(io.StringIO(shown.stdout)))
        self.assertEqual(len(rows), 121)
        up = [row for row in rows if float(row["elevation_deg"]) > 0]
        self.assertTrue(10 < len(up) < 121)
        self.assertTrue(all(0 < float(row["v_mag"]) < 20 for row in up if float(row["sunlit_fraction"]) == 1))
        self.assertTrue(all(row["v_mag"] == "" for row in rows if float(row["elevation_deg"]) < 0))
        # without extinction it is brighter, by 0.2 mag per air mass: at least 0.2
        clear = boresight("lightcurve", "--satellite", SATELLITE, *ORBIT, "--duration", "1200", "--step", "10",
                          "--site", "32.44,-110.79,2790")
        for one, other in zip(rows, csv.DictReader(io.StringIO(clear.stdout))):
            if one["v_mag"]:
                self.assertGreaterEqual(float(one["v_mag"]) - float(other["v_mag"]), 0.1999)

    def test_light_curve_from_another_orbit(self):
        """From one processor and from all: the same rows, in blocks of 512."""
        words = ["lightcurve", "--satellite", SATELLITE, *ORBIT, "--observer-norad", "44801", "--duration", "1100",
                 "--step", "1"]
        shown = boresight(*words)
        self.assertEqual(shown.returncode, 0, shown.stderr)
        rows = list(csv.DictReader(io.StringIO(shown.stdout)))
        self.assertEqual(len(rows), 1101)
        self.assertTrue(all(30000 < float(row["range_km"]) < 50000 for row in rows))
        self.assertTrue(any(row["v_mag"] for row in rows))
        one = min(os.sched_getaffinity(0))
        alone = subprocess.run([runs.BORESIGHT, *words], capture_output=True, text=True,
                               preexec_fn=lambda: os.sched_setaffinity(0, {one}))
        self.assertEqual(alone.stdout, shown.stdout)

    def test_light_curve_of_a_body_that_spins(self):
        """A phase as JSON, alone or in a list: a box that turns by 45 degrees/s comes back after 4 s."""
        with tempfile.TemporaryDirectory() as folder:
            box, plot = os.path.join(folder, "box.json"), os.path.join(folder, "curve.svg")
            with open(box, "w", encoding="utf-8") as file:
                file.write('{"materials": [{"name": "a", "diffuse": 0.8}],'
                           ' "parts": [{"name": "p", "kind": "box", "size_m": [1, 2, 3], "material": "a"}]}')
            words = ["lightcurve", "--satellite", box, *ORBIT, "--observer-norad", "44801", "--duration", "8",
                     "--step", "1"]
            phase = '{"law": "spin", "rate_body_deg_per_s": [45, 0, 0], "quaternion": [0, 0, 0, 1]}'
            one = boresight(*words, "--attitude", phase, "--plot", plot)
            self.assertEqual(one.returncode, 0, one.stderr)
            self.assertEqual(one.stdout, boresight(*words, "--attitude", f"[{phase}]").stdout)
            v = [row["v_mag"] for row in csv.DictReader(io.StringIO(one.stdout))]
            for k in range(4):
                self.assertLess(abs(float(v[k]) - float(v[k + 4])), 0.01)
            self.assertGreater(len(set(v[:4])), 2)
            if os.path.exists(plot):  # gnuplot may be missing: a warning then
                with open(plot, encoding="utf-8") as file:
                    self.assertIn("<svg", file.read())
            else:
                self.assertIn("gnuplot", one.stderr)

    def test_light_curve_of_a_scenario(self):
        shown = boresight("lightcurve", "scenarios/neossat_geo_track.json", "--duration", "60", "--step", "20")
        self.assertEqual(shown.returncode, 0, shown.stderr)
        self.assertEqual(len(shown.stdout.splitlines()), 5)

    def test_light_curve_of_the_observer_itself(self):
        """An object on the orbit of its observer has no magnitude; from a site it has one."""
        with open("scenarios/neossat_geo_track.json", encoding="utf-8") as file:
            scenario = json.load(file)
        for body in (*scenario["world"]["objects"], *scenario["observers"]):
            body["orbit"]["elements_file"] = os.path.abspath("scenarios/catalogue_2022-06.tle")
        del scenario["observers"][0]["sensors"][0]["modules"]["obsgen"]
        scenario["world"]["objects"].append({"name": "SELF", "area_m2": 1, "albedo": 0.2,
                                             "orbit": scenario["observers"][0]["orbit"]})
        with tempfile.TemporaryDirectory() as folder:
            path = os.path.join(folder, "scenario.json")
            with open(path, "w", encoding="utf-8") as file:
                json.dump(scenario, file)
            words = ["lightcurve", path, "--object", "SELF", "--duration", "60"]
            shown = boresight(*words)
            self.assertEqual(shown.returncode, 1, shown.stderr)
            self.assertEqual(shown.stdout, "")
            self.assertIn("object SELF: the observer neossat is at its place after 0 s; give another --object or "
                          "--observer, or --site", shown.stderr)
            shown = boresight(*words, "--site", "32.44,-110.79,2790")
            self.assertEqual(shown.returncode, 0, shown.stderr)

    def test_scenes_without_shapes(self):
        """A shape that is out of the field, and the files of its model, change no byte of the frames."""
        elements = {"source": "keplerian", "semi_major_axis_m": 42164170, "eccentricity": 0, "inclination_deg": 0,
                    "raan_deg": 0, "arg_perigee_deg": 0}
        other = {"name": "other", "area_m2": 4, "albedo": 0.25}
        shape = {"brightness": {"model": "shape"}, "shape": {"file": os.path.abspath(SATELLITE)},
                 "attitude": [{"law": "nadir"}]}
        with open("scenarios/neossat_geo_track.json", encoding="utf-8") as file:
            scenario = json.load(file)
        scenario["world"]["objects"][0]["orbit"]["elements_file"] = os.path.abspath("scenarios/catalogue_2022-06.tle")
        scenario["observers"][0]["orbit"]["elements_file"] = os.path.abspath("scenarios/catalogue_2022-06.tle")
        del scenario["observers"][0]["sensors"][0]["modules"]["obsgen"]
        frames = {}
        with tempfile.TemporaryDirectory() as folder:
            path = os.path.join(folder, "scenario.json")
            for anomaly in (0, 90, 180, 270):
                other["orbit"] = {"source": "numerical", "state": {**elements, "true_anomaly_deg": anomaly}}
                for name, objects in (("sphere", [other]), ("shape", [{**other, **shape}])):
                    with open(path, "w", encoding="utf-8") as file:
                        json.dump({**scenario, "world": {**scenario["world"],
                                                         "objects": scenario["world"]["objects"] + objects}}, file)
                    out = os.path.join(folder, name)
                    runs.run(path, out, duration=3)
                    with open(os.path.join(out, "frames.fits"), "rb") as file:
                        frames[name] = file.read()
                    subprocess.run(["rm", "-r", out], check=True)
                self.assertGreater(len(frames["sphere"]), 1024 * 1024)
                self.assertEqual(frames["sphere"], frames["shape"])

    def test_turntable_reads_its_own_glb(self):
        with tempfile.TemporaryDirectory() as folder:
            png, glb = os.path.join(folder, "a.png"), os.path.join(folder, "a.glb")
            first = boresight("turntable", SATELLITE, "--png", png, "--glb", glb, "--size-px", "64")
            self.assertEqual(first.returncode, 0, first.stderr)
            with open(png, "rb") as file:
                self.assertEqual(struct.unpack(">II", file.read(24)[16:]), (4 * 64, 2 * 64))
            again = boresight("turntable", glb)
            self.assertEqual(again.returncode, 0, again.stderr)
            self.assertEqual(first.stdout.split("radius")[1], again.stdout.split("radius")[1])

    def test_errors(self):
        for words, code, reason in (
                (["lightcurve"], 2, "give either one scenario file or --satellite"),
                (["lightcurve", "--satellite", SATELLITE], 1, "--elements"),
                (["lightcurve", "--satellite", SATELLITE, *ORBIT], 1, "give --site or --observer-norad"),
                (["lightcurve", "--satellite", SATELLITE, *ORBIT, "--site", "95,0,0"], 1, "--site 95,0,0"),
                (["lightcurve", "--satellite", SATELLITE, *ORBIT[:3], "99999", *ORBIT[4:], "--site", "1,1,1"], 1,
                 "lightcurve: --norad 99999: scenarios/catalogue_2022-06.tle: no element set"),
                (["lightcurve", "--satellite", SATELLITE, *ORBIT, "--observer-norad", "99998"], 1,
                 "lightcurve: --observer-norad 99998: "),
                (["lightcurve", "scenarios/neossat_geo_track.json", "--object", "none"], 1, "--object none"),
                (["lightcurve", "--satellite", SATELLITE, *ORBIT, "--site", "1,1,1", "--attitude", "{1"], 1, "--attitude:1:2"),
                (["lightcurve", "--satellite", SATELLITE, *ORBIT, "--site", "1,1,1", "--attitude", '{"law": "up"}'], 1,
                 "/world/objects/0/attitude/0/law"),
                (["lightcurve", "--satellite", SATELLITE, *ORBIT, "--observer-norad", "39089"], 1,
                 "--observer-norad 39089: is at the place of the satellite itself"),
                (["turntable"], 2, "one satellite is expected"),
                (["turntable", "no.json"], 1, "no.json")):
            shown = boresight(*words)
            self.assertEqual(shown.returncode, code, (words, shown.stderr))
            self.assertIn(reason, shown.stderr)


if __name__ == "__main__":
    unittest.main()
