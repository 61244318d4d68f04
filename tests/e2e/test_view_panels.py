#!/usr/bin/env python3
"""Editor and space of `boresight view`: their side of the program, over the network interface.

Usage, from the repository root: /usr/bin/python3 tests/e2e/test_view_panels.py BORESIGHT
"""
import base64
import glob
import io
import json
import math
import os
import re
import shutil
import sqlite3
import unittest
import unittest.mock
import urllib.error
import urllib.request
import zlib

import numpy
from astropy.io import fits
from astropy.wcs import WCS

import runs
import test_view

ROOT = os.getcwd()
# the target moves by 0.7 px then: nearly a source at rest, of which the figures are
SHORT = runs.SENSOR + "/exposure/exposure_s=0.04"
PSF = runs.SENSOR + "/camera/psf_fwhm_px"


class Editor(test_view.Viewer):
    """A running `boresight view` in a folder of its own, asked as the page asks."""

    def __init__(self, run, folder):
        self.temporary = runs.scratch()  # dropped files and trial runs of other viewers are not in it
        os.chdir(folder)
        try:
            with unittest.mock.patch.dict(os.environ, {"TMPDIR": self.temporary}):
                super().__init__(run)
        finally:
            os.chdir(ROOT)

    def post(self, route, **body):
        """Status and answer: JSON, or the text of a refusal."""
        request = urllib.request.Request(f"{self.url}api/editor/{route}", json.dumps(body).encode(),
                                         {"Origin": self.url[:self.url.index("/", 7)]})
        try:
            with urllib.request.urlopen(request, timeout=test_view.PATIENCE_S) as answer:
                return answer.status, json.load(answer)
        except urllib.error.HTTPError as error:
            return error.code, error.read().decode()

    def well(self, route, **body):
        status, answer = self.post(route, **body)
        if status != 200:
            raise AssertionError((route, status, answer))
        return answer


def resolved(*words, folder="."):
    """The scenario as `boresight check` prints it."""
    return json.loads(runs.call("check", *words, cwd=folder).stdout)


def elements(page):
    """What the elements of an exported page hold, by their keys."""
    with open(page, encoding="utf-8") as file:
        return {key.replace("&amp;", "&"): zlib.decompress(base64.b64decode(data))
                for key, data in re.findall(r'<script type="text/plain" data-key="([^"]*)"[^>]*>([^<]*)</script>', file.read())}


class Server(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.made, cls.folder = os.path.join(runs.scratch(), "run"), os.path.realpath(runs.scratch())
        runs.run(runs.STARE, cls.made, runs.NO_FRAMES, runs.GENERATOR, SHORT, duration=3)
        cls.editor = Editor(cls.made, cls.folder)
        cls.base = os.path.join(ROOT, "scenarios")

    @classmethod
    def tearDownClass(cls):
        assert cls.editor.end()[0] == 0

    def check(self, text):
        return self.editor.well("check", text=text if isinstance(text, str) else json.dumps(text))

    def saved(self):
        with open(os.path.join(self.folder, "mine.json"), encoding="utf-8") as file:
            return file.read()

    def test_schema_and_list(self):
        self.assertEqual(self.editor.json("api/editor/schema"), json.loads(runs.call_well("schema")))
        listed = self.editor.json("api/editor/list")
        shipped = {name for name in os.listdir("scenarios") if name.endswith(".json") and "schema" not in name}
        self.assertEqual({os.path.basename(one["file"]) for one in listed["files"] if one["shipped"]}, shipped)
        self.assertEqual(listed["folder"], self.folder)

    def test_problems_are_where_they_are(self):
        """The program's own words, with pointer or line."""
        base = os.path.join(self.base, "day_generator.json")
        found = self.check({"extends": base, "set": {PSF: 60}})
        self.assertEqual((found["good"], found["figures"]), (False, None))
        self.assertEqual(found["problems"], [{"kind": "error", "pointer": PSF, "text": "out of range (found 60; allowed: a number from 0.3 to 50 px)"}])
        found = self.check('{"extends":\n 3,}')["problems"]
        self.assertEqual([(one["kind"], one["line"], one["column"]) for one in found], [("error", 2, 4)])
        found = self.check({"extends": base, "epoch_utc": "2022-10-01T00:00:00Z", "duration_s": 60})
        self.assertTrue(found["good"])
        self.assertEqual((found["problems"][0]["kind"], found["problems"][0]["pointer"]), ("warning", "/epoch_utc"))
        # text that is looked at loads no code
        found = self.check({"extends": base, "set": {runs.SENSOR + "/modules/tracker": {"plugin": "x.so"}}})["problems"]
        self.assertIn("--no-plugins", found[0]["text"])

    def test_figures(self):
        """SNR of the target as the run recorded it; loops as `boresight loop` has them."""
        base = os.path.join(self.base, "neossat_geo_stare.json")
        text = {"extends": base, "set": {runs.GENERATOR.split("=")[0]: "generator", SHORT.split("=")[0]: 0.04}}
        sensor = self.check(text)["figures"]["sensors"][0]
        with sqlite3.connect(os.path.join(self.made, "run.sqlite")) as tables:
            snr, magnitude, range_m = tables.execute("SELECT snr, v_mag, range_m FROM truth WHERE kind != 'star' ORDER BY mid_s").fetchone()
        state = sensor["target"]["states"][0]
        self.assertAlmostEqual(state["v_mag"], magnitude, delta=0.01)  # within 2 s
        self.assertAlmostEqual(state["range_m"] / range_m, 1, delta=1e-3)
        # the figure is averaged over the places in a pixel: for a PSF of 2 px at most 3 % off
        self.assertAlmostEqual(state["snr"] / snr, 1, delta=0.06)
        # a source at the limit has SNR 5 by the law of magnitudes
        self.assertAlmostEqual(sensor["v_mag_at_snr_5"], state["v_mag"] + 2.5 * math.log10(state["snr"] / 5), delta=1e-9)
        # charge of the read-out and the noise of multiplication count
        noisy = {"clock_induced_e": 5, "em_gain": 4}
        more = self.check({**text, "set": {**text["set"], runs.SENSOR + "/camera/detector": noisy}})["figures"]["sensors"][0]
        self.assertAlmostEqual(more["dark_e"], sensor["dark_e"] + 5, delta=1e-9)
        read2 = sensor["noise_e"]**2 - sensor["sky_e"] - sensor["dark_e"]
        self.assertAlmostEqual(more["noise_e"]**2, 1.75 * (more["sky_e"] + more["dark_e"]) + read2, delta=1e-6)
        loops = self.editor.well("loops", text=json.dumps(text))["loops"]
        self.assertEqual(loops, json.loads(runs.call_well("loop", base, "--json", "-", "--set", runs.GENERATOR, "--set", SHORT)))

    def test_preview(self):
        """Stars of the field are the catalogue's that the run has in its truth, in the tangent plane of the target; the day is
        what a check with a later epoch finds."""
        base = os.path.join(self.base, "neossat_geo_stare.json")
        text = {"extends": base, "set": {runs.GENERATOR.split("=")[0]: "generator", SHORT.split("=")[0]: 0.04}}
        sensor = self.check(text)["figures"]["sensors"][0]
        sky, day = sensor["sky"], sensor["day"]
        ra, dec = math.radians(sky["ra_deg"]), math.radians(sky["dec_deg"])
        with sqlite3.connect(os.path.join(self.made, "run.sqlite")) as tables:
            stars = tables.execute("SELECT DISTINCT ra_deg, dec_deg, v_mag FROM truth WHERE kind = 'star' AND in_field = 1").fetchall()
        self.assertEqual(len(sky["stars"]), sky["total"])
        listed, matched = numpy.array(sky["stars"]), 0
        for star_ra, star_dec, v in stars:
            a, d = math.radians(star_ra) - ra, math.radians(star_dec)
            depth = math.sin(d) * math.sin(dec) + math.cos(d) * math.cos(dec) * math.cos(a)
            east, north = (math.degrees(one / depth) for one in (math.cos(d) * math.sin(a), math.sin(d) * math.cos(dec) - math.cos(d) * math.sin(dec) * math.cos(a)))
            if math.hypot(east, north) < 0.6 and v < sky["v_limit"]:  # half a diagonal is 0.603 deg
                # 1e-8 deg: rounding; the catalogue's V has 32 bits
                self.assertLess(numpy.abs(listed - (east, north, v)).max(axis=1).min(), 1e-6)
                matched += 1
        self.assertGreater(matched, 10)
        self.assertEqual((len(day["v_mag"]), day["step_s"], day["v_mag"][0]), (145, 600, sensor["target"]["states"][0]["v_mag"]))
        with open(base, encoding="utf-8") as file:
            epoch = json.load(file)["epoch_utc"]
        hour = int(epoch[11:13])
        later = self.check({**text, "epoch_utc": f"{epoch[:11]}{hour - 6:02d}{epoch[13:]}"})["figures"]["sensors"][0]["day"]
        for key, within in (("v_mag", 1e-6), ("sunlit_fraction", 1e-6)):  # the same instants, by other numbers of seconds
            for one, other in zip(day[key][:100], later[key][36:136]):
                self.assertAlmostEqual(one or 0, other or 0, delta=within)
        self.assertEqual(day["occulted"][:100], later["occulted"][36:136])
        self.assertTrue(0 < sum(day["occulted"]) < 145)

    def test_speed(self):
        """A trial run's speed, or why there is none; nothing remains of it."""
        base = os.path.join(self.base, "neossat_geo_stare.json")
        text = json.dumps({"extends": base, "set": {runs.GENERATOR.split("=")[0]: "generator"}})
        found = self.editor.well("speed", text=text, duration_s=2)
        self.assertEqual(found["duration_s"], 2)
        self.assertGreater(found["real_time_factor"], 0)
        self.assertIn("out of range", self.editor.well("speed", text=json.dumps({"extends": base, "set": {PSF: 60}}), duration_s=2)["problem"])
        for wrong in (0, -1, 601, "2", None):
            self.assertEqual(self.editor.post("speed", text=text, duration_s=wrong)[0], 400, wrong)
        self.assertEqual(os.listdir(self.editor.temporary), [])

    def test_save(self):
        """Only into the folder, whole, and over nothing that is there unless asked."""
        base = os.path.join(self.base, "day_generator.json")
        text = json.dumps({"extends": base, "set": {PSF: 3}})
        for name in ("../x.json", "/tmp/x.json", "x.txt", ".json", "", "a/b.json", "a\nb.json", "--overwrite.json"):
            self.assertEqual(self.editor.post("save", file=name, text=text)[0], 400, name)
        for wrong in ("", "[]", "{", '{"extends": "mine.json"}'):
            self.assertEqual(self.editor.post("save", file="mine.json", text=wrong)[0], 400, wrong)
        self.assertEqual(os.listdir(self.folder), [])
        self.assertEqual(self.editor.post("save", file="mine.json", text=text), (200, {"file": "mine.json"}))
        self.assertEqual(self.editor.post("save", file="mine.json", text="{}")[0], 400)
        self.assertEqual(self.saved(), text)
        short = ("--duration", "60")
        # its own reading is that of --set
        self.assertEqual(resolved("mine.json", *short, folder=self.folder), resolved(base, "--set", f"{PSF}=3", *short))
        os.symlink(self.made + "/manifest.json", os.path.join(self.folder, "link.json"))
        before = test_view.digests(self.made)
        self.editor.post("save", file="link.json", text=text, overwrite=True)
        self.assertEqual(test_view.digests(self.made), before)
        opened = self.editor.well("open", file="mine.json")
        self.assertEqual((opened["file"], opened["text"], opened["document"]["observers"][0]["sensors"][0]["camera"]["psf_fwhm_px"]), ("mine.json", text, 3))
        self.assertEqual(self.editor.post("save", file="mine.json", text=text.replace("3}", "4}"), overwrite=True)[0], 200)
        self.assertIn("4}", self.saved())

    def drop(self, name, data):
        """Status and answer for a file."""
        request = urllib.request.Request(f"{self.editor.url}api/editor/file?name={name}", data, {"Origin": self.editor.url[:self.editor.url.index("/", 7)]})
        try:
            with urllib.request.urlopen(request, timeout=test_view.PATIENCE_S) as answer:
                return answer.status, json.load(answer)
        except urllib.error.HTTPError as error:
            return error.code, error.read().decode()

    def test_dropped_elements(self):
        with open("scenarios/objects_2022-06.tle", "rb") as file:
            lines = file.read().splitlines()
        first = next(k for k, line in enumerate(lines) if line.startswith(b"1 "))
        status, found = self.drop("one.txt", b"\n".join([b"0 MINE", *lines[first:first + 2]]))
        self.assertEqual((status, found["kind"], found["total"]), (200, "elements", 1))
        self.assertEqual(found["satellites"][0], {"name": "MINE", "norad": int(lines[first][2:7]), "line1": lines[first].decode(), "line2": lines[first + 1].decode()})
        omm = {"OBJECT_NAME": "OTHER", "NORAD_CAT_ID": 44801, "EPOCH": "2022-06-16T12:00:00", "MEAN_MOTION": 1.0027, "ECCENTRICITY": 0.0002, "INCLINATION": 0.03,
               "RA_OF_ASC_NODE": 80, "ARG_OF_PERICENTER": 170, "MEAN_ANOMALY": 5, "BSTAR": 0}
        status, found = self.drop("omm.json", json.dumps(omm).encode())
        self.assertEqual((status, found["satellites"][0]["name"]), (200, "OTHER"))
        self.assertIn("22167.5", found["satellites"][0]["line1"])
        # a number that no TLE holds is 0 in the lines; what they cannot hold otherwise is left out
        late = {**omm, "NORAD_CAT_ID": 799500002, "EPOCH": "2061-01-01T00:00:00"}
        status, found = self.drop("new.json", json.dumps([omm, {**omm, "NORAD_CAT_ID": 340000}, {**omm, "NORAD_CAT_ID": 799500001, "OBJECT_NAME": ""}, late]).encode())
        self.assertEqual((status, found["total"], found["left_out"], [one["name"] for one in found["satellites"]]), (200, 4, 1, ["OTHER", "OTHER", "799500001"]), found)
        self.assertEqual([(one["norad"], one["line1"][2:7], one["line2"][2:7]) for one in found["satellites"]],
                         [(44801, "44801", "44801"), (340000, "00000", "00000"), (799500001, "00000", "00000")])
        status, answer = self.drop("late.json", json.dumps(late).encode())
        self.assertEqual((status, answer[:10]), (400, "late.json:"), answer)
        with open("scenarios/catalogue_2022-06.tle", "rb") as file:
            text = file.read()
        status, found = self.drop("many.tle", text)
        sets = sum(line.startswith(b"1 ") for line in text.splitlines())
        self.assertEqual((found["total"], len(found["satellites"])), (sets, min(sets, 500)))
        for name, data, words in (("a.tle", b"hello\n", "a.tle"), ("b.json", json.dumps({**omm, "ECCENTRICITY": 3}).encode(), "b.json: /ECCENTRICITY"),
                                  ("c.txt", lines[first][:-1] + b"0\n" + lines[first + 1], "c.txt:1"), ("d.bin", b"\0\1\2", "d.bin: is of no known kind (allowed: element sets"),
                                  ("f.json", b" [" + b"0," * 2000001 + b"0]", "f.json: has more values than are read (allowed: 2000000)"),
                                  ("e.tle", b"", "e.tle: is empty"), ("omm.xml", b"<?xml version='1.0'?><omm/>", "omm.xml"), ("-x.tle", lines[first], "is no name for a file")):
            status, answer = self.drop(name, data)
            self.assertEqual(status, 400, (name, answer))
            self.assertIn(words, answer)
        status = self.editor.status("/{token}/api/editor/file?name=f.tle", "POST", more=f"Content-Length: {41 << 20}\r\nOrigin: http://127.0.0.1:{{port}}\r\n")
        self.assertEqual(status, 413)

    def test_dropped_shape(self):
        """A GLB becomes the shape of the target; it is kept in the folder, and replaces nothing."""
        glb = os.path.join(runs.scratch(), "sat.glb")
        runs.call_well("turntable", "scenarios/satellites/cubesat_3u.json", "--glb", glb)
        with open(glb, "rb") as file:
            data = file.read()
        self.addCleanup(lambda: os.path.exists(os.path.join(self.folder, "sat.glb")) and os.remove(os.path.join(self.folder, "sat.glb")))
        for bad, words in ((data[:200], "sat.glb"), (b"glTF" + b"\xff" * 100, "sat.glb"), (data[:len(data) // 2], "sat.glb")):
            status, answer = self.drop("sat.glb", bad)
            self.assertEqual(status, 400, answer)
            self.assertTrue(answer.startswith(words), answer)
            self.assertNotIn("/tmp", answer)
        self.assertEqual(self.drop("sat.bin", data)[0], 400)
        status, found = self.drop("OTHER.GLB", data)
        self.assertEqual((status, found["file"]), (200, "OTHER.GLB"), found)
        os.remove(os.path.join(self.folder, "OTHER.GLB"))
        self.assertFalse(os.path.exists(os.path.join(self.folder, "sat.glb")))
        for _ in range(2):
            status, found = self.drop("sat.glb", data)
            self.assertEqual((status, found["kind"], found["file"], found["facets"] > 6, 0.1 < found["radius_m"] < 1), (200, "shape", "sat.glb", True, True))
        with open(os.path.join(self.folder, "sat.glb"), "rb") as file:
            self.assertEqual(file.read(), data)
        target = "/world/objects/0"
        text = {"extends": os.path.join(self.base, "neossat_geo_stare.json"), "set": {target + "/shape": {"file": "sat.glb"}, target + "/brightness/model": "shape",
                runs.GENERATOR.split("=")[0]: "generator"}}
        self.assertEqual([one for one in self.check(text)["problems"] if one["kind"] == "error"], [])
        runs.call_well("turntable", "scenarios/satellites/cubesat_12u.json", "--glb", glb)
        with open(glb, "rb") as file:
            status, answer = self.drop("sat.glb", file.read())
        self.assertEqual(status, 400)
        self.assertIn("another file of this name is in the folder", answer)

    def test_dropped_frame(self):
        """Size, pointing of the middle, pixel scale, exposure and time of a FITS frame, as astropy has them."""
        header = fits.Header()
        header.update({"CTYPE1": "RA---TAN", "CTYPE2": "DEC--TAN", "CRPIX1": 11.0, "CRPIX2": 5.0, "CRVAL1": 359.99, "CRVAL2": -20.0, "CD1_1": -1e-3, "CD1_2": 2e-4,
                       "CD2_1": 2e-4, "CD2_2": 1e-3, "EXPTIME": 1.25, "DATE-OBS": "2022-06-16T22:10:00.5", "GAIN": 2.5, "RDNOISE": -3.0})
        buffer = io.BytesIO()
        fits.PrimaryHDU(numpy.zeros((40, 64), "u2"), header).writeto(buffer)
        status, found = self.drop("frame.fits", buffer.getvalue())
        self.assertEqual((status, found["kind"]), (200, "frame"), found)
        changes = {one["key"]: one["value"] for offer in found["offers"] for one in offer["changes"]}
        direction = changes.pop("cue/direction_radec_deg")
        expected = WCS(header).all_pix2world([[31.5, 19.5]], 0)[0]
        numpy.testing.assert_allclose(direction, expected, rtol=0, atol=1e-9)
        self.assertAlmostEqual(changes.pop("camera/pixel_scale_arcsec"), 3600 * math.sqrt(1e-6 + 4e-8), delta=1e-9)
        # a read noise below 0 is none
        self.assertEqual(changes, {"camera/width_px": 64, "camera/height_px": 40, "cue/object": "", "exposure/exposure_s": 1.25, "camera/gain_e_per_dn": 2.5,
                                   "/epoch_utc": "2022-06-16T22:10:00.5Z"})
        # GAIN can be a setting without a unit: no check mark, and not where EGAIN is
        self.assertEqual([offer["from"] for offer in found["offers"] if offer["unsure"]], ["GAIN"])
        header["EGAIN"] = 1.5
        buffer = io.BytesIO()
        fits.PrimaryHDU(numpy.zeros((40, 64), "u2"), header).writeto(buffer)
        offers = [(offer["from"], offer["unsure"], one["value"]) for offer in self.drop("both.fits", buffer.getvalue())[1]["offers"]
                  for one in offer["changes"] if one["key"] == "camera/gain_e_per_dn"]
        self.assertEqual(offers, [("EGAIN", False, 1.5)])
        # a header without WCS offers the size
        buffer = io.BytesIO()
        fits.PrimaryHDU(numpy.zeros((4, 6), "f4")).writeto(buffer)
        status, found = self.drop("plain.fits", buffer.getvalue())
        self.assertEqual([offer["from"] for offer in found["offers"]], ["NAXIS1, NAXIS2"])
        for bad in (buffer.getvalue()[:1000], buffer.getvalue()[:2880], b"SIMPLE  = " + b"x" * 5000):
            status, answer = self.drop("bad.fits", bad)
            self.assertEqual((status, answer[:8]), (400, "bad.fits"), answer)
            self.assertNotIn("/tmp", answer)
        self.assertEqual(os.listdir(self.editor.temporary), [])

    def test_run_starts_only_scenarios(self):
        """No option of the command, no folder, no other file; the reason of a scenario that cannot run comes back."""
        folder = runs.scratch()
        os.mkdir(folder + "/folder.json")
        with open(folder + "/bad.json", "w", encoding="utf-8") as file:
            json.dump({"extends": os.path.join(self.base, "day_generator.json"), "set": {PSF: 60}}, file)
        shutil.copy(folder + "/bad.json", folder + "/--help.json")
        editor = Editor(None, folder)
        for name in ("--help", "--port=99999", "--help.json", "folder.json", "nowhere.json", "../bad.json", "", "bad"):
            status, answer = editor.post("run", file=name)
            self.assertEqual(status, 400, name)
            self.assertIn("is no scenario of this folder", answer)
        status, answer = editor.post("run", file="bad.json")
        self.assertEqual(status, 500)
        self.assertIn(PSF + ": out of range (found 60", answer)
        for name in glob.glob(f"/proc/{editor.process.pid}/task/*/children"):
            with open(name, encoding="ascii") as children:
                self.assertEqual(children.read(), "")
        listed = [os.path.basename(one["file"]) for one in editor.json("api/editor/list")["files"]]
        self.assertEqual(listed[:2], ["bad.json", "neossat_geo_track.json"])
        start = editor.json("api/start")
        self.assertEqual(start["folder"], os.path.realpath(folder))
        scenarios = start["scenarios"]
        self.assertEqual(scenarios[0]["file"], "neossat_geo_track.json")
        self.assertEqual([one["file"] for one in scenarios if not one["description"]], [])
        self.assertEqual(editor.end()[0], 0)

    def test_paths_of_an_opened_file_hold_in_the_folder(self):
        """A list of the small file replaces that of a file of another folder, with files of its own."""
        opened = self.editor.well("open", file=os.path.join(self.base, "knowledge/clock.json"))
        found = self.check({"extends": opened["file"], "world": opened["document"]["world"], "observers": opened["document"]["observers"]})
        self.assertEqual((found["good"], found["problems"]), (True, []))
        self.assertEqual(self.editor.post("open", file="nowhere.json")[0], 404)

    def test_satellites(self):
        found = self.editor.well("satellites", find="inmarsat gx")
        self.assertTrue(found["total"] >= 1 and all("INMARSAT GX" in one["name"] for one in found["satellites"]))
        one, = self.editor.well("satellites", find="44801")["satellites"]  # though it is in both files
        with open("scenarios/catalogue_2022-06.tle", encoding="utf-8") as file:
            self.assertIn(one["line2"], file.read())
        self.assertEqual(self.editor.well("satellites", find="no such name")["total"], 0)

    def test_places_in_space(self):
        """States as the tables have them: observer, range to the target, Sun; attitudes."""
        scene = self.editor.json("api/space/scene")
        sensor, = scene["sensors"]
        self.assertEqual((scene["observers"], scene["objects"], sensor["observer"], sensor["object"]), (["neossat"], ["INMARSAT GX5"], 0, 0))
        half = math.tan(math.radians(512 * 3 / 3600))  # to the corner of the outermost pixel
        for (x, y, z), signs in zip(sensor["corners"], ((-1, -1), (1, -1), (1, 1), (-1, 1))):
            numpy.testing.assert_allclose((x / z, y / z), numpy.multiply(signs, half), rtol=1e-4)  # a tangent plane's scale
        with sqlite3.connect(os.path.join(self.made, "run.sqlite")) as tables:
            columns = ("mid_s, observer_gcrf_x_m, observer_gcrf_y_m, observer_gcrf_z_m, sun_x_m, sun_y_m, sun_z_m, q_cam_from_gcrf_mid_x, "
                       "q_cam_from_gcrf_mid_y, q_cam_from_gcrf_mid_z, q_cam_from_gcrf_mid_w, range_m")
            rows = numpy.array(tables.execute(f"SELECT {columns} FROM exposures JOIN truth USING (exposure_id, mid_s) WHERE kind != 'star'").fetchall())
        poses = self.editor.numbers("api/space/poses?sensor=0").reshape(-1, 5)
        self.assertTrue(numpy.array_equal(poses, rows[:, [0, 7, 8, 9, 10]]))
        for row in rows:
            states = self.editor.numbers(f"api/space/states?from={row[0]!r}")
            eye, target = states[15:18], states[21:24]
            # 1e-6 m: rounding; the range is to where the object was when its light left: 40,000 km are 0.14 s at 3 km/s
            numpy.testing.assert_allclose(eye, row[1:4], rtol=0, atol=1e-6)
            self.assertAlmostEqual(math.dist(eye, target), row[11], delta=1000)
            self.assertLess(math.degrees(math.acos(numpy.dot(states[:3], row[4:7]) / math.hypot(*states[:3]) / math.hypot(*row[4:7]))), 0.01)
            turn = states[6:15].reshape(3, 3)
            numpy.testing.assert_allclose(turn @ turn.T, numpy.eye(3), rtol=0, atol=1e-12)
        for refused, route in ((400, "states?from=-1"), (400, "states?from=1e300"), (404, "poses?sensor=7"), (404, "scene?run=9")):
            with self.assertRaises(urllib.error.HTTPError) as caught:
                self.editor.get("api/space/" + route)
            self.assertEqual(caught.exception.code, refused, route)

    def test_shapes_and_keep_out(self):
        """Attitudes are those of the tables; facets of joints lie within the body's sphere; keep-out angles of the scenario."""
        made = os.path.join(runs.scratch(), "shape")
        guidance = runs.SENSOR + "/modules/control/guidance"
        runs.run("scenarios/inspection.json", made, runs.NO_FRAMES, guidance + "/sun_keep_out_deg=30.5", guidance + "/earth_keep_out=true",
                 '/world/objects/0/shape={"file": "satellites/gps_iif.json"}', duration=4)
        viewer = Editor(made, self.folder)
        scene = viewer.json("api/space/scene")
        self.assertEqual(scene["sensors"][0]["keep_out"], {"sun_deg": 30.5, "moon_deg": 0, "earth": True, "earth_limb_deg": 0, "earth_limb_altitude_km": 100})
        self.assertNotIn("keep_out", self.editor.json("api/space/scene")["sensors"][0])
        shape, = scene["shapes"]
        numbers = viewer.numbers("api/space/shape?object=0")
        joints, count = int(numbers[0]), int(numbers[1])
        triangles = numbers[2:].reshape(-1, 13)
        self.assertEqual((shape["object"], shape["triangles"], len(triangles)), (0, count, count))
        self.assertGreater(joints, 0)
        self.assertEqual(set(triangles[:, 0]), set(range(-1, joints)) & set(triangles[:, 0]))
        self.assertTrue(((triangles[:, 1:4] >= 0) & (triangles[:, 1:4] <= 1)).all())
        with sqlite3.connect(os.path.join(made, "run.sqlite")) as tables:
            rows = tables.execute("SELECT mid_s, q_body_from_gcrf_x, q_body_from_gcrf_y, q_body_from_gcrf_z, q_body_from_gcrf_w FROM shapes WHERE id = 0").fetchall()
        self.assertGreater(len(rows), 0)
        for time, *attitude in rows:
            pose = viewer.numbers(f"api/space/pose?object=0&sensor=0&from={time!r}")
            self.assertEqual((list(pose[:4]), pose[4], pose[5]), (attitude, 1, 1))
            other = viewer.numbers(f"api/space/pose?object=0&sensor=0&from={time + 1e-5!r}")
            self.assertEqual(other[5], 0)
            # light time of 50 km is 0.2 ms, in which it turns by 6e-6 rad
            self.assertGreater(abs(numpy.dot(other[:4], attitude)), 1 - 1e-9)
            for joint, turn in enumerate(pose[6:].reshape(-1, 12)):
                numpy.testing.assert_allclose(turn[:9].reshape(3, 3) @ turn[:9].reshape(3, 3).T, numpy.eye(3), rtol=0, atol=1e-12)
                corners = triangles[triangles[:, 0] == joint][:, 4:].reshape(-1, 3) @ turn[:9].reshape(3, 3).T + turn[9:]
                self.assertLessEqual(numpy.linalg.norm(corners, axis=1).max(initial=0), shape["radius_m"] * (1 + 1e-12))
        for refused, route in ((404, "shape?object=1"), (404, "pose?object=7"), (400, "pose?object=0&from=-1"), (404, "pose?object=0&sensor=3"), (400, "shape?object=x")):
            with self.assertRaises(urllib.error.HTTPError) as caught:
                viewer.get("api/space/" + route)
            self.assertEqual(caught.exception.code, refused, route)
        self.assertEqual(viewer.end()[0], 0)

    def test_why(self):
        """The short exposures leave the target below the threshold, with the SNR of the tables."""
        found = self.editor.json("api/why?frame=1")
        with sqlite3.connect(os.path.join(self.made, "run.sqlite")) as tables:
            snr, threshold = tables.execute("""SELECT snr, threshold_snr FROM truth JOIN detection_frames USING (sensor, exposure_id)
                WHERE kind != 'star' AND exposure_id = 1""").fetchone()
        self.assertLess(snr, threshold)
        self.assertEqual((found["target"], found["frame"]), ("INMARSAT GX5", {"kind": "faint", "text": f"SNR {snr:.1f} is below the threshold of {threshold:.1f}"}))
        self.assertEqual([(one["first"], one["last"], one["kind"]) for one in found["spans"]], [(0, 2, "faint")])
        with self.assertRaises(urllib.error.HTTPError) as caught:
            self.editor.get("api/why?frame=99")
        self.assertEqual(caught.exception.code, 404)

    def test_exported_reasons(self):
        """A page has the reason of each frame, and the spans of all of them once; it is the same bytes when it is written again."""
        page, again = (os.path.join(runs.scratch(), name) for name in ("a.html", "b.html"))
        for file in (page, again):
            runs.call_well("export", self.made, "--page", file)
        with open(page, "rb") as one, open(again, "rb") as other:
            self.assertEqual(one.read(), other.read())
        found, asked = elements(page), self.editor.json("api/why?frame=1")
        self.assertEqual(json.loads(found["spans?sensor=0"]), {"around": 200, "spans": asked.pop("spans")})
        self.assertEqual(json.loads(found["why?frame=1&sensor=0"]), asked)

    def test_exported_paths(self):
        """What is wrong with a folder stands in its page, without the place of the folder."""
        folder = os.path.realpath(runs.scratch())
        left = os.path.join(folder, "left")
        shutil.copytree(self.made, left)
        for name in ("manifest.json", "frames.fits"):
            with open(os.path.join(left, name), "w", encoding="utf-8") as file:
                file.write("damaged")
        page = os.path.join(folder, "left.html")
        self.assertEqual(runs.call("export", left, "--page", page).returncode, 0)
        found = elements(page)
        self.assertTrue(any("left/" in problem for problem in json.loads(found["session"])["run"]["problems"]), found["session"])
        self.assertEqual([key for key, data in found.items() if folder.encode() in data], [])

    def test_export_refused(self):
        """No frame in the range, and a limit that the page exceeds without a frame."""
        page, full = (os.path.join(runs.scratch(), name) for name in ("refused.html", "full"))
        shutil.copytree(self.made, full)
        with sqlite3.connect(os.path.join(full, "run.sqlite")) as tables:
            row = tables.execute("SELECT * FROM events LIMIT 1")
            names, values = [one[0] for one in row.description], list(row.fetchone())
            texts = [values[:names.index("text")] + [os.urandom(500).hex()] + values[names.index("text") + 1:] for _ in range(1900)]
            tables.executemany(f"INSERT INTO events VALUES ({', '.join('?' * len(names))})", texts)
        for folder, words, text in ((self.made, ("--first", "7"), "no frame from --first 7 to the end with --every 1: exposures have the numbers 0 to 2"),
                                    (self.made, ("--first", "5", "--last", "6"), "no frame from --first 5 to --last 6"),
                                    (full, ("--page-limit", "1"), "page, plots and events take")):
            result = runs.call("export", folder, "--page", page, *words)
            self.assertEqual(result.returncode, 1, words)
            self.assertIn(text, result.stderr)
            self.assertFalse(os.path.exists(page))

    def test_refused(self):
        self.assertEqual(self.editor.post("check", file="x")[0], 400)
        path = "/{token}/api/editor/save"
        origin = "Origin: http://127.0.0.1:{port}\r\n"
        self.assertEqual(self.editor.status(path, "GET"), 405)
        self.assertEqual(self.editor.status(path, "POST", more=origin + "Content-Length: 99999999\r\n"), 413)
        self.assertEqual(self.editor.status(path, "POST", more="Origin: http://evil.example\r\nContent-Length: 0\r\n"), 403)
        self.assertEqual(self.editor.status(path, "POST", more=origin + "Content-Length: 0\r\n"), 400)


def tearDownModule():
    test_view.end_all()


if __name__ == "__main__":
    unittest.main()
