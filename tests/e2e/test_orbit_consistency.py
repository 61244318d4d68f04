#!/usr/bin/env python3
"""boresight orbit over many seeds: is the covariance that it states true?

Usage, from the repository root:
    /usr/bin/python3 tests/e2e/test_orbit_consistency.py BORESIGHT [--full]

The true state's error in units of the stated covariance, summed over seeds, is chi-square with 6
degrees of freedom a seed, and the residuals' sum has the degrees of freedom that the reports state:
both must be within the central 95 %, of ten seeds the central 99 %. True states are the places that `export` writes, velocities
their derivatives: what SGP4 itself states as velocity in deep space is 0.1 m/s from that. With
--full (needs the full star catalogue): 20 seeds of targets in GEO, GPS and low orbits, as element
sets and as integrated orbits, by the generator and by images.
"""
import json
import os
import shutil
import sys
import unittest

import numpy as np

FULL = "--full" in sys.argv and not sys.argv.remove("--full")

import runs  # noqa: E402  takes the program's path from sys.argv
from readers import read_oem, seconds  # noqa: E402

CATALOGUE = os.path.abspath("scenarios/catalogue_2022-06.tle")
OBJECTS = os.path.abspath("scenarios/objects_2022-06.tle")
GENERATOR = runs.SENSOR + '/observation_source="generator"'
EXPOSURE = (runs.SENSOR + '/exposure={"exposure_s": 0.2, "period_s": 0.5}',
            runs.SENSOR + "/modules/control/exposure_s=0.2")
# name, file, number, epoch, magnitude, seconds by the generator and by images, other settings
TARGETS = {"GEO": (CATALOGUE, 44801, "2022-06-16T22:10:00Z", 13, 2400, 900, ()),
           "GPS": (CATALOGUE, 26360, "2022-06-16T22:16:00Z", 12, 600, 600, ()),
           "LEO": (OBJECTS, 25478, "2022-06-16T22:08:00Z", 10, 300, 300, EXPOSURE)}


def settings(name, integrated):
    path, norad, epoch, magnitude, _, _, more = TARGETS[name]
    orbit = {"source": "sgp4", "elements_file": path, "norad": norad}
    if integrated:
        orbit |= {"source": "numerical", "state": {"source": "element_set"}}
    cue = {"object": name, "offset_deg": 0.05, "offset_axis": "x", "sigma_deg": 0.05,
           "rate_sigma_arcsec_per_s": 0.5, "v_mag": magnitude, "v_mag_sigma": 2}
    objects = [{"name": name, "orbit": orbit, "area_m2": 4, "albedo": 0.25}]
    return ("/world/objects=" + json.dumps(objects), f'/epoch_utc="{epoch}"',
            runs.SENSOR + "/cue=" + json.dumps(cue), *more)


def call(*words):
    result = runs.call(*words, timeout=600)
    if result.returncode:
        raise AssertionError(result.stderr)
    return result.stdout


def truth(made, epoch, name, at):
    """Place and its derivative, from the nine rows about `at` by a polynomial of degree 8."""
    out = made + "-orbits"
    call("export", made, "--orbits", "oem", "--step", "1", "--out", out)
    for meta, rows in read_oem(out + "/orbits.oem"):
        if meta["OBJECT_NAME"] == name:
            times = np.array([seconds(utc, epoch) for utc, _ in rows]) - at
            places = 1e3 * np.array([state[:3] for _, state in rows])
            near = np.sort(np.argsort(abs(times))[:9])
            fits = [np.polyfit(times[near] / 4, places[near, k], 8) for k in range(3)]
            return np.array([fit[-1] for fit in fits] + [fit[-2] / 4 for fit in fits])
    raise AssertionError(f"no orbit of {name}")


def errors(made, name, *words):
    """Error of the state that orbit finds, and its covariance, in units of the standard deviations; the report."""
    report = made + ".json"
    call("orbit", made, "--report", report, *words)
    with open(report, encoding="utf-8") as file:
        found = json.load(file)
    epoch = runs.database(made).execute("SELECT epoch_utc FROM run").fetchone()[0]
    error = np.array(found["position_gcrf_m"] + found["velocity_gcrf_mps"])
    error -= truth(made, epoch, name, found["epoch_s"])
    covariance = np.array(found["covariance_gcrf"])
    sigma = np.sqrt(np.diag(covariance))
    return error / sigma, covariance / np.outer(sigma, sigma), found


def judge(job):
    """Squared error of the state over its covariance, chi-square of the residuals, its dof."""
    folder, name, seed, duration, sets, catalogue = job
    made = os.path.join(folder, f"{seed}")
    runs.run(runs.TRACK, made, runs.NO_FRAMES, "/record/truth_stars=false", *sets,
             *([f'/world/star_catalogue="{catalogue}"']), seed=seed, duration=duration)
    scaled, correlation, found = errors(made, name)
    shutil.rmtree(made)
    shutil.rmtree(made + "-orbits")
    return scaled @ np.linalg.solve(correlation, scaled), found["chi2"], found["dof"]


def quantile(dof, sigma):
    """Wilson and Hilferty's of chi-square: to 0.1 % from 50 degrees of freedom on."""
    d = 2 / (9 * dof)
    return dof * (1 - d + sigma * d**0.5)**3


class Consistency(unittest.TestCase):
    def judge(self, name, integrated, images, seeds, duration, catalogue):
        sets = settings(name, integrated) + (() if images else (GENERATOR,))
        folder = runs.scratch()
        rows = runs.parallel(judge, [(folder, name, seed, duration, sets, catalogue)
                                     for seed in range(1, seeds + 1)])
        state, chi2, dof = (sum(column) for column in zip(*rows, strict=True))
        what = (f"{name}, {'integrated' if integrated else 'element set'}, "
                f"{'images' if images else 'generator'}: state {state:.1f} of {6 * seeds}, "
                f"residuals {chi2:.0f} of {dof}")
        print(what, flush=True)
        for sum_of, of in ((state, 6 * seeds), (chi2, dof)):
            self.assertGreater(sum_of, quantile(of, -1.96 if FULL else -2.576), what)
            self.assertLess(sum_of, quantile(of, 1.96 if FULL else 2.576), what)

    @unittest.skipIf(FULL, "part of --full")
    def test_near_object(self):
        """Of a sphere of 1.1 m at 3,460 km the centre of light is 0.02 arcsec from the centre of mass, ten times what
        the mean of all directions leaves open."""
        folder = runs.scratch()
        scene, made = os.path.join(folder, "near.json"), os.path.join(folder, "near")
        call("new", scene, "--observer-tle", "39089", "--target-tle", "ISS (ZARYA)")
        runs.run(scene, made, runs.NO_FRAMES)
        chi2 = []
        for words in ((), ("--radius", "0")):
            scaled, correlation, _ = errors(made, "ISS (ZARYA)", *words)
            chi2.append(scaled[:3] @ np.linalg.solve(correlation[:3, :3], scaled[:3]))
            shutil.rmtree(made + "-orbits")
        # of 3 degrees of freedom: more than 21.1 has a probability of 1e-4
        self.assertLess(chi2[0], 21.1)
        self.assertGreater(chi2[1], 50)

    @unittest.skipIf(FULL, "part of --full")
    def test_geo(self):
        self.judge("GEO", False, False, 10, 300, "embedded")

    @unittest.skipUnless(FULL, "needs --full")
    def test_all(self):
        runs.need_full_catalogue()
        for name in TARGETS:
            for integrated in (False, True):
                for images in (False, True):
                    with self.subTest(name=name, integrated=integrated, images=images):
                        self.judge(name, integrated, images, 20, TARGETS[name][4 + images],
                                   "default")


def tearDownModule():
    runs.clean()


if __name__ == "__main__":
    unittest.main()
