#!/usr/bin/env python3
"""Plug-ins by path: the examples, built with one command against what was built, do their work in
a loop; what is wrong is said; and what was loaded is on record.

Usage, from the repository root:
/usr/bin/python3 tests/e2e/test_plugins.py BORESIGHT CC BUILD_FOLDER
"""
import hashlib
import json
import os
import shutil
import sqlite3
import struct
import subprocess
import sys
import unittest

import jsonschema
from astropy.io import fits

CC, BUILD = sys.argv[2:4]
del sys.argv[2:4]
import runs  # noqa: E402  (takes the program's path off the arguments)

ROOT = os.getcwd()
EXAMPLES = ("plugin_detector/box_detector.c", "plugin_compensator/leaky.c",
            "plugin_frame_stage/banding.c", "stare_at.c")
M = runs.SENSOR + "/modules"
# 0.2 s, so that stars are points while the camera follows the belt
SHORT = f"{M}/control/exposure_s=0.2"

# a stage of frames that writes what it is given into the first pixels
GIVEN = """    const int given[] = {f->width, f->height, f->binning, f->bits, f->window.x0, f->window.y0,
                         f->window.width, f->window.height, (int)(100 * f->start_s + 0.5),
                         (int)(100 * f->end_s + 0.5), (int)f->exposure_id};
    for (size_t i = 0; i < sizeof given / sizeof *given; i++) {
        pixels[i] = (uint16_t)given[i];
    }
    return BST_OK;
}

/* What a saved"""


class Plugins(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.work = runs.scratch()
        cls.text = {}
        jobs = []
        for path in EXAMPLES:
            name = os.path.basename(path)
            with open(os.path.join("docs/examples", path), encoding="utf-8") as file:
                cls.text[name] = file.read()
            jobs.append(cls.start(name, cls.text[name]))
        detector = cls.text["box_detector.c"]
        jobs.append(cls.start("old.c", detector.replace("BST_STAGE_ABI", "99")))
        jobs.append(cls.start("other.c", detector.replace("BST_STAGE_DETECTOR", '"telescope"')))
        jobs.append(cls.start("aged.c", cls.text["stare_at.c"].replace("BST_MODULE_ABI", "2")))
        jobs.append(cls.start("empty.c", "extern int a;\nint a;\n"))
        jobs.append(cls.start("given.c", cls.text["banding.c"].replace("    return BST_OK;\n}\n\n/* What a saved", GIVEN)))
        jobs.append(cls.start("mad.c", detector.replace("d->snr =", "d->x_px = NAN; d->snr =")))
        jobs.append(cls.start("mad_law.c", cls.text["leaky.c"].replace("return s->kp * error", "return NAN * error")))
        jobs.append(cls.start("mad_aim.c", cls.text["stare_at.c"].replace(
            "bst_light_apparent_star(&light, m->icrs)}", "bst_vec3_scale(bst_light_apparent_star(&light, m->icrs), 2)}")))
        for job in jobs:
            _, errors = job.communicate(timeout=300)
            assert job.returncode == 0, errors
        cls.scenario = os.path.join(cls.work, "mine.json")
        with open(cls.scenario, "w", encoding="utf-8") as file:
            json.dump({"extends": os.path.join(ROOT, runs.TRACK)}, file)

    @classmethod
    def start(cls, name, text):
        """Builds a plug-in as its own first lines say, the build folder in the package's place."""
        path = os.path.join(cls.work, name)
        with open(path, "w", encoding="utf-8") as file:
            file.write(text)
        return subprocess.Popen(
            [CC, "-std=c17", "-Wall", "-Wextra", "-Werror", "-O2", "-shared", "-fPIC", path,
             f"-I{ROOT}/include", f"-L{BUILD}", "-lboresight", f"-Wl,-rpath,{os.path.abspath(BUILD)}", "-lm",
             "-o", path[:-1] + "so"], stderr=subprocess.PIPE, text=True)

    def call(self, *words, code=0, **options):
        result = runs.call(*words, cwd=self.work, **options)
        self.assertEqual(result.returncode, code, result.stderr)
        return result.stdout if code == 0 else result.stderr

    def check(self, *sets, code=0):
        return self.call("check", self.scenario, "--set", "/world/star_catalogue=embedded",
                         *(word for one in sets for word in ("--set", one)), code=code)

    @staticmethod
    def segments(elf):
        """End of the last segment of an ELF of 64 bits that the dynamic linker maps (PT_LOAD)."""
        at, size, count = (struct.unpack_from(f"<{kind}", elf, offset)[0]
                           for kind, offset in (("Q", 32), ("H", 54), ("H", 56)))
        parts = [struct.unpack_from("<IIQQQQ", elf, at + k * size) for k in range(count)]
        return max(offset + length for kind, _, offset, _, _, length in parts if kind == 1)

    def digest(self, name):
        with open(os.path.join(self.work, name), "rb") as file:
            return hashlib.sha256(file.read()).hexdigest()

    def test_loop(self):
        """Detector, compensator and frame stage at once; the target gets into track."""
        out = os.path.join(self.work, "run")
        manifest = runs.run(self.scenario, out, runs.NO_FRAMES, SHORT,
                            M + '/imgproc/detector={"plugin": "box_detector.so"}',
                            M + '/control/compensator={"plugin": "./leaky.so"}',
                            M + '/scenegen/frame_stage={"plugin": "banding.so"}', duration=40)
        self.assertEqual(manifest["summary"]["final_mode"], "track")
        # the observer that they replace leaves 0.2 px
        self.assertLess(manifest["summary"]["pointing_rms_px"], 1.5)
        self.assertEqual([(p["where"], p["type"], p["file"], p["sha256"])
                          for p in manifest["plugins"]],
                         [(f"{M}/{key}", name[:-3] if name != "box_detector.so" else "box",
                           os.path.join(os.path.realpath(self.work), name), self.digest(name))
                          for key, name in (("scenegen/frame_stage", "banding.so"),
                                            ("imgproc/detector", "box_detector.so"),
                                            ("control/compensator", "leaky.so"))])
        self.assertIn(self.digest("banding.so"), self.call("info", "run"))
        # what is recorded is run again, and read by those who run nothing of it
        again = os.path.join(self.work, "again")
        runs.run(out + "/scenario.json", again, duration=3)
        with sqlite3.connect(again + "/run.sqlite") as one, \
                sqlite3.connect(out + "/run.sqlite") as two:
            query = "SELECT * FROM detections WHERE exposure_id < 2 ORDER BY exposure_id, item"
            rows = one.execute(query).fetchall()
            self.assertGreater(len(rows), 20)
            self.assertEqual(rows, two.execute(query).fetchall())
        os.rename(os.path.join(self.work, "banding.so"), os.path.join(self.work, "gone.so"))
        try:
            self.call("export", "run", "--observations", "tdm", "--out", "angles")
        finally:
            os.rename(os.path.join(self.work, "gone.so"), os.path.join(self.work, "banding.so"))

    def test_given_to_a_frame_stage(self):
        """A frame that is not square, binned and in a window."""
        out = os.path.join(self.work, "given")
        runs.run(self.scenario, out, SHORT, runs.SENSOR + "/exposure/window_px=[24, 40, 300, 228]", runs.SENSOR + "/exposure/binning=2",
                 "/record/compression=none", M + '/scenegen/frame_stage={"plugin": "given.so"}', duration=4)
        with fits.open(out + "/frames.fits") as hdus:
            images = [h for h in hdus if h.data is not None and h.data.ndim == 2]
            self.assertGreater(len(images), 2)
            for k, image in enumerate(images):
                start, end = image.data[0, 8:10]
                self.assertEqual(list(image.data[0, :8]), [150, 114, 2, 16, 24, 40, 300, 228])
                self.assertEqual(image.data[0, 10], k)
                self.assertAlmostEqual(end - start, 100 * image.header["EXPTIME"], delta=1)

    def test_whole_module(self):
        control = '{"plugin": "stare_at.so", "ra_deg": 252.36, "dec_deg": -8.82}'
        echo = json.loads(self.check(f"{M}/control={control}"))
        block = echo["observers"][0]["sensors"][0]["modules"]["control"]
        self.assertEqual(block["plugin"], os.path.join(os.path.realpath(self.work), "stare_at.so"))
        self.assertEqual((block["type"], block["ra_deg"]), ("stare_at", 252.36))
        # the same by the command line
        self.call("--plugin", "stare_at.so", "check", self.scenario, "--quiet", "--set",
                  f'{M}/control={{"type": "stare_at", "ra_deg": 252.36, "dec_deg": -8.82}}')
        self.assertIn("/control/dec_deg: missing; it is required: Declination (ICRS).", self.check(
            f'{M}/control={{"plugin": "stare_at.so", "ra_deg": 1}}', code=1))

    def test_margins(self):
        """As the compensator says its response, its loop has margins."""
        reported = self.call("loop", self.scenario, "--set",
                         M + '/control/compensator={"plugin": "leaky.so"}')
        self.assertIn("tracking loop: leaky", reported)
        self.assertRegex(reported, r"gain margin +1[0-9]\.")

    def test_wrong(self):
        block, control = f"{M}/imgproc/detector", f"{M}/control"
        for setting, message in (
                (f'{block}={{"plugin": "none.so"}}',
                 "detector/plugin: plug-in .*none.so: there is no such file; build it"),
                (f'{block}={{"plugin": "mine.json"}}', "plugin: plug-in .* cannot be loaded .* is "
                                                       "it a shared library"),
                (f'{block}={{"plugin": "empty.so"}}',
                 "empty.so is no plug-in: it defines neither the list bst_plugin_modules"),
                (f'{block}={{"plugin": "old.so"}}',
                 "old.so has a stage of interface 99, this program takes 2: build it with"),
                (f'{control}={{"plugin": "aged.so"}}',
                 "aged.so has a module of interface 2, this program takes 7: build it with"),
                (f'{block}={{"plugin": "other.so"}}',
                 'of kind "telescope" .allowed: "detector", "compensator", "frame_stage"'),
                (f'{block}={{"plugin": "leaky.so"}}',
                 'no stage of kind "detector" .it has: stage "leaky" of kind "compensator"'),
                (f'{M}/tracker={{"plugin": "stare_at.so"}}',
                 'no module of role "tracker" .it has: module "stare_at" of role "control"'),
                (f'{block}={{"plugin": "box_detector.so", "type": "bax"}}',
                 'no stage of kind "detector" of type "bax"'),
                (f'{block}={{"plugin": "box_detector.so", "threshhold_sigma": 5}}',
                 'detector/threshhold_sigma: unknown key; did you mean "threshold_sigma"'),
                (f'{block}={{"plugin": "box_detector.so", "threshold_sigma": "5"}}',
                 'detector/threshold_sigma: wrong type .found "5"; allowed: a number from 1 to'),
                (f'{block}={{"plugin": 7}}', "detector/plugin: wrong type .found 7; allowed: the "
                                             "path of a shared library"),
                (f'{M}/imgproc/stack={{"plugin": "x.so"}}', "stack/plugin: unknown key"),
                (f'{control}/compensator={{"plugin": "leaky.so", "gain_per_s": 50}}',
                 "gain_per_s: 50/s cannot be stable at a frame every 1 s; give less than 2"),
                (f'{M}/imgproc={{"type": "standard", "track_windows": true, "detector": '
                 f'{{"plugin": "box_detector.so"}}}}', "turn track_windows, stack and extended off")):
            self.assertRegex(self.check(setting, code=1), message)
        # the dynamic linker would map what a file that is cut short lacks, and the process end
        with open(os.path.join(self.work, "stare_at.so"), "rb") as file:
            whole = file.read()
        segments = self.segments(whole)
        for size, message in ((3, "cannot be loaded"), (4, "has 4 bytes, its headers need 64;"),
                              (63, "cut short: it has 63 bytes, its headers need 64;"),
                              (100, "cut short: it has 100 bytes, its headers need"),
                              (4000, f"it has 4000 bytes, its headers need {segments}; build"),
                              (segments - 1, f"{segments - 1} bytes, its headers need {segments}")):
            with open(os.path.join(self.work, "cut.so"), "wb") as file:
                file.write(whole[:size])
            self.assertRegex(self.check(f'{control}={{"plugin": "cut.so"}}', code=1), message)
        # a detector that gives nonsense ends the run, and is named
        self.assertRegex(self.call(
            "run", self.scenario, "--out", "mad", "--quiet", "--duration", "2", "--set",
            runs.NO_FRAMES, "--set", f'{block}={{"plugin": "mad.so"}}', code=1),
            r"plug-in .*mad.so gave a detection at \(nan,")
        for plugin, keys, message in (
                ("mad_law.so", '/compensator={"plugin": "mad_law.so"}',
                 "plug-in .*mad_law.so: its compensator gave an output that is not finite"),
                ("mad_aim.so", '={"plugin": "mad_aim.so", "ra_deg": 1, "dec_deg": 2}',
                 "neossat/telescope/control: its plug-in wrote a wrong message: los_command: direction.* is 2 "
                 ".allowed: finite, of length 1 within 5e-7")):
            self.assertRegex(self.call(
                "run", self.scenario, "--out", plugin + ".run", "--quiet", "--duration", "40", "--set",
                runs.NO_FRAMES, "--set", control + keys, code=1), message)

    def test_schema(self):
        scenario = json.loads(self.check(M + '/imgproc/detector={"plugin": "box_detector.so"}',
                                         f'{M}/control={{"plugin": "stare_at.so", "ra_deg": 1,'
                                         f' "dec_deg": 2}}'))
        modules = scenario["observers"][0]["sensors"][0]["modules"]
        plain = json.loads(self.call("schema"))
        known = json.loads(self.call("schema", "--plugin", "box_detector.so", "--plugin",
                                     "stare_at.so"))
        with open(os.path.join(self.work, "named.json"), "w", encoding="utf-8") as file:
            json.dump(scenario, file)
        self.assertEqual(json.loads(self.call("schema", "named.json")), known)
        jsonschema.Draft202012Validator.check_schema(known)  # once: it takes most of the time
        by_plain, by_known = (jsonschema.Draft202012Validator(schema) for schema in (plain, known))
        for validator in (by_plain, by_known):
            validator.validate(scenario)
        self.assertIn("Sums above so many of their sigmas.", json.dumps(known))
        for block, key in ((modules["imgproc"]["detector"], "treshold"),
                           (modules["control"], "ra")):
            block[key] = 1
            by_plain.validate(scenario)
            with self.assertRaises(jsonschema.ValidationError):
                by_known.validate(scenario)
            del block[key]
        # without a plug-in all is as strict as ever
        del modules["imgproc"]["detector"]["plugin"]
        with self.assertRaises(jsonschema.ValidationError):
            by_plain.validate(scenario)

    def test_study(self):
        """A study's tables say what was loaded, and a library that changes is noticed."""
        shutil.copy(os.path.join(self.work, "leaky.so"), os.path.join(self.work, "changing.so"))
        with open(os.path.join(self.work, "study.json"), "w", encoding="utf-8") as file:
            json.dump({"boresight_study": 1, "name": "gains", "kind": "loop",
                       "scenarios": [{"file": os.path.join(ROOT, "scenarios/day_generator.json")}],
                       "set": {"/duration_s": 30, "/world/star_catalogue": "embedded",
                               M + "/control/compensator":
                                   {"plugin": os.path.join(self.work, "changing.so")}},
                       "sweeps": [{"axes": [{"path": M + "/control/compensator/gain_per_s",
                                             "values": [0.1, 0.3]}]}]}, file)
        self.call("study", "study.json", "--out", "study", "--quiet", "--workers", "1")
        file = os.path.join(os.path.realpath(self.work), "changing.so")
        with sqlite3.connect(self.work + "/study/study.sqlite") as tables:
            self.assertEqual(tables.execute("SELECT value FROM about WHERE key = 'plugin'")
                             .fetchall(), [(f"{file} sha256 {self.digest('changing.so')}",)])
            self.assertEqual(tables.execute("SELECT count(*), count(DISTINCT gain_per_s) FROM runs"
                                            " WHERE status = 'done'").fetchone(), (2, 2))
        job = self.start("changing.c", self.text["leaky.c"].replace('"1/s"', '"Hz"'))
        self.assertEqual(job.wait(timeout=60), 0, job.communicate())
        self.assertIn("has been changed since the study began",
                      self.call("study", "study", "--resume", "--quiet", code=1))


def tearDownModule():
    runs.clean()


if __name__ == "__main__":
    unittest.main()
