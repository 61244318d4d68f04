#!/usr/bin/env python3
"""`boresight new`: scenarios for random pairs of the shipped element sets, whose loop holds.

Usage, from the repository root: /usr/bin/python3 tests/e2e/test_new.py BORESIGHT [PAIRS [FIRST]]
With PAIRS so many pairs with the runs as they are written, else a few short ones. Each pair is reported when it
is done, by its place in the draw; FIRST goes on from there.
"""
import json
import os
import random
import shutil
import sys
import subprocess
import unittest
from concurrent.futures import ThreadPoolExecutor

import numpy

PAIRS = int(sys.argv.pop(2)) if len(sys.argv) > 2 and sys.argv[2].isdigit() else 0
FIRST = int(sys.argv.pop(2)) if PAIRS and len(sys.argv) > 2 and sys.argv[2].isdigit() else 0

import runs  # noqa: E402

SETS = ["scenarios/catalogue_2022-06.tle", "scenarios/objects_2022-06.tle"]
SEED = 20220616
EMPTY = runs.scratch()
# what `new` says of pairs of which one never sees the other for a whole run
UNSEEN = ("never sees", "too faint", "days apart", "with the Earth in the field", "too few of the stars")


def numbers():
    found = set()
    for path in SETS:
        with open(path, encoding="ascii") as file:
            found |= {line[2:7] for line in file if line.startswith("2 ")}
    return sorted(found)


def call(*words):
    # without the full star catalogue, whether or not it is there: the harder case
    return runs.call(*words, env=dict(os.environ, XDG_DATA_HOME=EMPTY))


def follow(folder, index, pair, *options):
    """What becomes of a pair: (kind, words), kind "unseen", "held" or "failed"."""
    path = os.path.join(folder, f"{index}.json")
    made = call("new", path, "--observer-tle", pair[0], "--target-tle", pair[1], *options)
    if made.returncode != 0:
        unseen = made.returncode == 1 and any(word in made.stderr for word in UNSEEN)
        return ("unseen" if unseen else "failed"), made.stderr.strip()
    said = call("check", "--quiet", path)
    if said.returncode != 0 or said.stderr:
        return "failed", "check: " + said.stderr.strip()
    summary = runs.run(path, os.path.join(folder, str(index)), runs.NO_FRAMES)["summary"]
    figures = summary["sensors"][0] if "sensors" in summary else summary
    text = " ".join(made.stdout.split("\n")[i].strip() for i in (1, 2))
    text += f"; RMS {figures['pointing_rms_px']} px, ends in {figures['final_mode']}"
    held = figures["final_mode"] == "track" and (figures["pointing_rms_px"] or 1e9) < 1.0
    return ("held" if held else "failed"), text


def sample(count, first, *options):
    """From the pair `first` of the draw: `count` pairs that see each other, and the others met on the way."""
    draw, folder, pool = random.Random(SEED), runs.scratch(), numbers()
    for _ in range(first):
        draw.sample(pool, 2)
    results = []

    def followed(index, pair):
        kind, words = follow(folder, index, pair, *options)
        shutil.rmtree(os.path.join(folder, str(index)), ignore_errors=True)
        print(index, kind, *pair, words, flush=True)
        return kind

    with ThreadPoolExecutor(2) as workers:
        while sum(kind != "unseen" for kind in results) < count:
            missing = count - sum(kind != "unseen" for kind in results)
            jobs = [workers.submit(followed, first + len(results) + i, draw.sample(pool, 2)) for i in range(missing)]
            results += [job.result() for job in jobs]
    return results


class New(unittest.TestCase):
    def test_random_pairs(self):
        results = sample(PAIRS, FIRST) if PAIRS else sample(2, 0, "--duration", "30")
        counts = {kind: results.count(kind) for kind in ("held", "failed", "unseen")}
        print(f"seed {SEED}: {counts}")
        self.assertEqual(counts["failed"], 0)
        # most pairs of low satellites see each other within two days
        self.assertGreater(counts["held"], counts["unseen"])

    def test_without_options(self):
        path = os.path.join(runs.scratch(), "first.json")
        self.assertEqual(call("new", path).returncode, 0)
        with open(path, encoding="utf-8") as file:
            scenario = json.load(file)
        self.assertEqual(scenario["name"], "neossat_inmarsat_gx5")
        self.assertIn("INMARSAT GX5", scenario["description"])
        said = call("new", path)
        self.assertEqual(said.returncode, 1)
        self.assertIn("the file is there already", said.stderr)
        self.assertEqual(call("new", "--out", path, "--overwrite").returncode, 0)

    def test_options_are_in_the_scenario(self):
        path = os.path.join(runs.scratch(), "first.json")
        sets = os.path.abspath(SETS[0])
        made = call("new", path, "--observer-tle", sets + ":39089", "--target-tle", "inmarsat gx5",
                    "--aperture", "0.2", "--focal-length", "0.9", "--period", "5")
        self.assertEqual(made.returncode, 0, made.stderr)
        said = call("check", path)
        self.assertEqual(said.stderr, "")
        scenario = json.loads(said.stdout)
        sensor = scenario["observers"][0]["sensors"][0]
        self.assertEqual(sensor["camera"]["aperture_m"], 0.2)
        self.assertEqual(sensor["camera"]["focal_length_m"], 0.9)
        self.assertEqual(sensor["exposure"]["period_s"], 5)
        self.assertEqual(scenario["duration_s"], 300)

    def test_jitter_is_stated(self):
        """Image processing knows what the platform's fast jitter, flat between two frequencies, leaves about its mean in an
        exposure: the variance of sums of waves of random phase over the exposure."""
        draw = numpy.random.default_rng(1)
        for more in (), ("--target-tle", "25544"), ("--target-tle", "25544", "--period", "0.05"):
            path = os.path.join(runs.scratch(), "first.json")
            made = call("new", path, *more)
            self.assertEqual(made.returncode, 0, made.stderr)
            with open(path, encoding="utf-8") as file:
                sensor = json.load(file)["observers"][0]["sensors"][0]
            platform, exposure = sensor["modules"]["gimbal"]["platform"], sensor["exposure"]["exposure_s"]
            # per axis: half of the power; 4,000 waves, each with its own phase
            waves = draw.uniform(*platform["jitter_high_band_hz"], 4000)[:, None]
            times = numpy.linspace(0, exposure, 401)
            values = numpy.cos(2 * numpy.pi * (waves * times + draw.uniform(0, 1, waves.shape)))
            left = platform["jitter_high_px_rms"] * numpy.sqrt(0.5 * values.var(axis=1).mean() / 0.5)
            # two digits, and 2 % of the mean over the waves
            self.assertAlmostEqual(sensor["modules"]["imgproc"]["jitter_px"], left, delta=0.0005 + 0.02 * left)

    def test_errors_say_why(self):
        path = os.path.join(runs.scratch(), "first.json")
        for words, code, text in (
                (["--target-tle", "INMARSAT GX6"], 1, 'did you mean "INMARSAT GX5"?'),
                (["--target-tle", "SL-3 R/B"], 1, "several satellites are called so"),
                (["--target-tle", "39089"], 1, "is the observer itself"),
                (["--target-tle", SETS[0]], 1, "more than one satellite; say which"),
                (["--aperture", "0.002"], 1, "an --aperture of 0.0"),
                (["--observer-tle", "46290", "--target-tle", "44772"], 1, "behind the Earth 100.0 %"),
                (["--start", "yesterday"], 2, "yesterday"),
                (["--pixel-scale", "3", "--focal-length", "1"], 2, "give one of them"),
                (["--out", path], 2, "one FILE.json is written, 2 were named")):
            said = call("new", path, *words)
            self.assertEqual(said.returncode, code, (words, said.stderr))
            self.assertIn(text, said.stderr)
            self.assertFalse(os.path.exists(path))

    def test_stands_alone(self):
        """The element sets are in the scenario: it needs no file beside it, wherever it goes."""
        folder, away = runs.scratch(), runs.scratch()
        sets = os.path.join(folder, "sets.tle")
        shutil.copy(SETS[0], sets)
        made = call("new", os.path.join(folder, "first.json"), "--observer-tle", sets + ":39089",
                    "--target-tle", sets + ":44801")
        self.assertEqual(made.returncode, 0, made.stderr)
        with open(sets, encoding="ascii") as file:
            lines = file.read().split("\n")
        os.remove(sets)
        path = shutil.move(os.path.join(folder, "first.json"), away)
        said = subprocess.run([os.path.abspath(runs.BORESIGHT), "check", path], capture_output=True,
                              text=True, check=False, cwd="/", env=dict(os.environ, XDG_DATA_HOME=EMPTY))
        self.assertEqual((said.returncode, said.stderr), (0, ""))
        scenario = json.loads(said.stdout)
        for owner, number in ((scenario["observers"][0], "39089"), (scenario["world"]["objects"][0], "44801")):
            self.assertEqual(owner["orbit"]["elements_file"], "")
            for key, first in (("tle_line1", "1 "), ("tle_line2", "2 ")):
                source = next(line for line in lines if line.startswith(first + number))
                self.assertEqual(owner["orbit"][key][:61], source[:61])

    def test_stars_in_every_frame(self):
        """Of this pair the first time that is good otherwise has 8 stars in some frames."""
        path = os.path.join(runs.scratch(), "pair.json")
        made = call("new", path, "--observer-tle", "40906", "--target-tle", "46561")
        self.assertEqual(made.returncode, 0, made.stderr)
        sensor, out = "/observers/0/sensors/0", os.path.join(runs.scratch(), "run")
        modules = {"gimbal": {"type": "ideal", "object": "STARLINK-1709"}, "scenegen": {"type": "opencl"}}
        result = call("run", path, "--quiet", "--no-pictures", "--out", out, "--set", runs.NO_FRAMES,
                      "--set", f"{sensor}/modules={json.dumps(modules)}",
                      "--set", sensor + '/exposure={"exposure_s": 0.1, "period_s": 5}',
                      # the same field of few pixels: light of the Earth takes time in each
                      *(word for key, value in (("width_px", 256), ("height_px", 256), ("pixel_scale_arcsec", 40))
                        for word in ("--set", f"{sensor}/camera/{key}={value}")))
        self.assertEqual(result.returncode, 0, result.stderr)
        with runs.database(out) as database:
            counts = database.execute("SELECT sum(kind = 'star' AND v_mag < 9) FROM truth"
                                      " GROUP BY exposure_id").fetchall()
        self.assertEqual(len(counts), 24)
        self.assertGreaterEqual(min(count for count, in counts), 12)

    def test_few_stars_are_stated(self):
        """No time of this slow pair has the stars for an attitude in a field free of the Earth."""
        path = os.path.join(runs.scratch(), "pair.json")
        made = call("new", path, "--observer-tle", "33595", "--target-tle", "47747")
        self.assertEqual(made.returncode, 0, made.stderr)
        self.assertIn("too few stars in the field for an attitude", made.stdout)
        with open(path, encoding="utf-8") as file:
            self.assertIn("The field holds too few stars for an attitude", json.load(file)["description"])

    def test_element_sets_are_not_written_over(self):
        sets = os.path.join(runs.scratch(), "sets.tle")
        shutil.copy(SETS[0], sets)
        for link in (sets, sets + ".link"):
            if link != sets:
                os.symlink(sets, link)
            said = call("new", link, "--overwrite", "--observer-tle", sets + ":39089")
            self.assertEqual(said.returncode, 1)
            self.assertIn("which is read: --observer-tle names it", said.stderr)
        with open(sets, encoding="ascii") as made, open(SETS[0], encoding="ascii") as before:
            self.assertEqual(made.read(), before.read())


def tearDownModule():
    runs.clean()


if __name__ == "__main__":
    unittest.main()
