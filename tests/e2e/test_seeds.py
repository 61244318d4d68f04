#!/usr/bin/env python3
"""It really tracks what it sees: the main job made hard, over many seeds.

dark       the target reflects nothing: no track may be taken for it
burn       a manoeuvre of 10 m/s at 100 s (short: 50 s), in a random direction, that the cue does not know
drop       20 % of the frames are lost
snr6       the target is so faint that its true signal-to-noise ratio is 6 in a frame
neighbour  an object of the same brightness crosses at 2 to 20 px with 1 to 4 px/s, between 60 s and
           250 s (short: 45 s and 60 s), from a random direction

The right target is in track when it was confirmed, at least 90 % of the later frames in which it is
visible have the confirmed track of interest on it (within 5 px, as sim/eval defines it), and so has
the last frame. A case is one short run (neighbour: two that pass nearer than 13 px),
or 100 long ones with --long.

Usage, from the repository root:
  /usr/bin/python3 tests/e2e/test_seeds.py BORESIGHT [--long] [--cases a,b] [--seeds N]
"""
import argparse
import json
import os
import random
import shutil
import subprocess
import sys
import unittest

import numpy as np

import runs

MAIN = {"name": "INMARSAT GX5", "area_m2": 4, "albedo": 0.25,
        "orbit": {"source": "sgp4", "elements_file": "catalogue_2022-06.tle", "norad": 44801}}
# the true SNR, which is proportional to the area, is 6.00 on average over the seeds
SNR6_AREA_M2 = 0.675
PIXEL_RAD = np.radians(3 / 3600)

options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
options.add_argument("--long", action="store_true")
options.add_argument("--cases", default="dark,burn,drop,snr6,neighbour")
options.add_argument("--seeds", type=int)
options = options.parse_args(sys.argv[1:])
del sys.argv[1:]


def seeds_of(case):
    if options.seeds or options.long:
        return range(1, 1 + (options.seeds or 100))
    return {"neighbour": (2, 4)}.get(case, (1,))


def direction(rng):
    v = np.array([rng.gauss(0, 1) for _ in range(3)])
    return v / np.linalg.norm(v)


def states(time_s):
    """GCRF position and velocity (m, m/s) of target and observer."""
    start = f"2022-06-16T22:{10 + int(time_s) // 60:02d}:{int(time_s) % 60:02d}Z"
    result = []
    for norad in (44801, 39089):
        text = subprocess.run(
            [runs.BORESIGHT, "propagate", "--tle", "scenarios/catalogue_2022-06.tle", "--norad",
             str(norad), "--start", start, "--stop", start, "--step", "1", "--frame", "gcrf"],
            capture_output=True, text=True, check=True).stdout
        result.append(np.array([float(x) for x in text.splitlines()[1].split(",")[2:]]) * 1e3)
    return result


def neighbour(rng, at_s):
    """An object that passes the target at its range, in the plane of the sky."""
    target, observer = states(at_s)
    sight = target[:3] - observer[:3]
    metres_per_px = np.linalg.norm(sight) * PIXEL_RAD
    sight = sight / np.linalg.norm(sight)
    along = np.cross(sight, direction(rng))
    along = along / np.linalg.norm(along)
    across = np.cross(sight, along)
    offset = across * rng.uniform(2, 20) * metres_per_px
    rate = along * rng.uniform(1, 4) * metres_per_px
    radial = target[:3] / np.linalg.norm(target[:3])
    normal = np.cross(target[:3], target[3:])
    normal = normal / np.linalg.norm(normal)
    rtn = np.array([radial, np.cross(normal, radial), normal])
    return {**MAIN, "name": "NEIGHBOUR",
            "orbit": {"source": "relative", "reference": MAIN["name"], "at_s": at_s,
                      "offset_rtn_m": list(rtn @ offset), "rate_rtn_mps": list(rtn @ rate)}}


def scene(case, seed):
    """Overrides of the main job and duration of one run."""
    rng = random.Random(f"{case} {seed}")
    if case == "dark":
        return ["/world/objects/0/albedo=0"], 180 if options.long else 60
    if case == "burn":
        dv, at_s = list(10 * direction(rng)), 100 if options.long else 50
        return ['/world/objects/0/burns=' + json.dumps([{"time_s": at_s, "dv_rtn_mps": dv}])], \
            300 if options.long else 90
    if case == "drop":
        return [runs.SENSOR + "/exposure/dropped_fraction=0.2"], 300 if options.long else 60
    if case == "snr6":
        v_mag = 13 + 2.5 * np.log10(4 / SNR6_AREA_M2)
        return [f"/world/objects/0/area_m2={SNR6_AREA_M2}",
                runs.SENSOR + f"/cue/v_mag={v_mag:.2f}"], 300 if options.long else 100
    at_s = int(rng.uniform(60, 250) if options.long else rng.uniform(45, 60))
    return ["/world/objects=" + json.dumps([MAIN, neighbour(rng, at_s)])], \
        300 if options.long else at_s + 30


def unit(ra_deg, dec_deg):
    ra, dec = np.radians(ra_deg), np.radians(dec_deg)
    return np.array([np.cos(dec) * np.cos(ra), np.cos(dec) * np.sin(ra), np.sin(dec)])


class Outcome:
    """What a run's manifest and tables say."""

    def __init__(self, case, seed, out, summary):
        self.case, self.seed, self.summary = case, seed, summary
        db = runs.database(out)
        one = lambda query: db.execute(query).fetchone()
        tracked = "target_of_interest AND status IN ('confirmed', 'coasting')"
        frames = one("SELECT count(*) FROM exposures")[0]
        self.dropped = one("SELECT avg(dropped) FROM exposures")[0]
        self.tracked_fraction = one(f"SELECT count(*) FROM tracks WHERE {tracked}")[0] / frames
        self.true_snr = np.median([row[0] for row in db.execute(
            "SELECT snr FROM truth WHERE kind = 'object' AND id = 0 AND in_field AND "
            "abs(x_start_px - x_end_px) + abs(y_start_px - y_end_px) < 2")] or [np.nan])
        last = one(f"SELECT t.ra_deg, t.dec_deg, o.ra_deg, o.dec_deg FROM tracks t JOIN truth o "
                   f"USING (sensor, exposure_id) WHERE {tracked} AND o.kind = 'object' AND "
                   f"o.id = 0 AND exposure_id = (SELECT max(exposure_id) FROM track_frames)")
        self.ends_on_target = bool(last) and \
            np.linalg.norm(unit(*tuple(last)[:2]) - unit(*tuple(last)[2:])) <= 5 * PIXEL_RAD
        self.closest_px = min([np.hypot(*row) for row in db.execute(
            "SELECT a.x_mid_px - b.x_mid_px, a.y_mid_px - b.y_mid_px FROM truth a JOIN truth b "
            "USING (sensor, exposure_id) WHERE a.kind = 'object' AND b.kind = 'object' AND "
            "a.id = 0 AND b.id = 1")] or [np.nan])
        self.right = (summary["time_to_confirm_s"] is not None and
                      summary["track_fraction"] >= 0.9 and self.ends_on_target)

    def __str__(self):
        s = self.summary
        number = lambda x: "-" if x is None else f"{x:.3f}"
        return (f"{self.case} {self.seed}: {'right' if self.right else 'NOT RIGHT'}, "
                f"{s['final_mode']}, confirmed {number(s['time_to_confirm_s'])} s, fraction "
                f"{number(s['track_fraction'])}, RMS {number(s['pointing_rms_px'])} px, wrong "
                f"{s['wrong_target_frames']}, any target {self.tracked_fraction:.3f}, SNR "
                f"{self.true_snr:.2f}, dropped {self.dropped:.3f}, closest {self.closest_px:.1f} px")


def play(job):
    case, seed = job
    sets, duration = scene(case, seed)
    out = os.path.join(play.folder, f"{case}_{seed}")
    manifest = runs.run(runs.TRACK, out, runs.NO_FRAMES, "/record/telemetry_hz=0.1",
                        *sets, seed=seed, duration=duration)
    outcome = Outcome(case, seed, out, manifest["summary"])
    shutil.rmtree(out)
    print(outcome, flush=True)
    return outcome


class Seeds(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        play.folder = runs.scratch()
        cls.cases = options.cases.split(",")
        jobs = sorted(((case, seed) for case in cls.cases for seed in seeds_of(case)),
                      key=lambda job: job[1])
        cls.outcomes = runs.parallel(play, jobs)

    def of(self, case):
        outcomes = [o for o in self.outcomes if o.case == case]
        if not outcomes:
            self.skipTest("not among --cases")
        return outcomes

    def assert_right(self, case):
        outcomes = self.of(case)
        right = [o.right for o in outcomes]
        rms = [o.summary["pointing_rms_px"] for o in outcomes if o.right]
        print(f"{case}: the right target in {sum(right)} of {len(right)}, RMS of those from "
              f"{min(rms):.3f} to {max(rms):.3f} px")
        # 95 of 100 (the figure of issue and README); all of a few
        self.assertGreaterEqual(sum(right), 0.95 * len(right) if len(right) >= 20 else len(right),
                                "\n".join(str(o) for o in outcomes if not o.right))

    def test_dark(self):
        for outcome in self.of("dark"):
            self.assertLess(outcome.summary["track_fraction"], 0.05, str(outcome))
            # an invisible target makes that fraction 0 by its definition; so: hardly a frame in
            # which anything is taken for the target
            self.assertLess(outcome.tracked_fraction, 0.05, str(outcome))

    def test_burn(self):
        for outcome in self.of("burn"):
            self.assertTrue(outcome.right, str(outcome))
            self.assertLessEqual(outcome.summary["pointing_rms_px"], 0.5, str(outcome))

    def test_drop(self):
        self.assert_right("drop")
        fraction = np.mean([o.dropped for o in self.of("drop")])
        # binomial: 3 sigma of the frames of all runs
        frames = sum(scene("drop", o.seed)[1] for o in self.of("drop"))
        self.assertAlmostEqual(fraction, 0.2, delta=3 * np.sqrt(0.2 * 0.8 / frames))

    def test_snr6(self):
        for outcome in self.of("snr6"):
            if outcome.right:
                self.assertAlmostEqual(outcome.true_snr, 6.0, delta=0.1, msg=str(outcome))
        self.assert_right("snr6")

    def test_neighbour(self):
        for outcome in self.of("neighbour"):
            # sampled once a second at up to 4 px/s
            self.assertLess(outcome.closest_px, 20.5, str(outcome))
        self.assert_right("neighbour")


def tearDownModule():
    runs.clean()


if __name__ == "__main__":
    unittest.main()
