#!/usr/bin/env python3
"""Search, acquisition and reacquisition over many seeds.

cue      the cue is wrong by a degree in a random direction, the field of view is 0.85 degrees wide:
         in track within 120 s
belt     no cue: an object of V 13 anywhere within 2 degrees of 20 degrees of the geostationary
         belt, inclined by up to 2 degrees: in track within twice the time of one sweep, which a run
         without an object measures
eclipse  a target of an SNR of 10 to 38 goes through the Earth's shadow on the night of the equinox,
         beside another object of a quarter of its light 0.03 to 0.1 degrees away: in track again
         within 10 s of the end of the first exposure in which its ideal SNR is 8

In track means that control is in mode `track` and the track of interest lies within 5 px of the
target. A case is a few runs, or with --full 100 with the observation generator and some with images
(belt and eclipse: none).

Usage, from the repository root:
  /usr/bin/python3 tests/e2e/test_acquisition.py BORESIGHT [--full] [--cases a,b] [--seeds N]
      [--images N] [--catalogue FILE] [--times FILE]
"""
import argparse
import json
import os
import random
import shutil
import unittest

import numpy as np

import runs

options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
options.add_argument("--full", action="store_true")
options.add_argument("--cases", default="cue,belt,eclipse")
options.add_argument("--seeds", type=int)
options.add_argument("--images", type=int)
options.add_argument("--catalogue", help="of stars, for all cases; default: with --full yours, else "
                     "stars that come with the program")
options.add_argument("--times", help="JSON file for the times, by case")
options = options.parse_args(runs.sys.argv[1:])
del runs.sys.argv[1:]

SCENARIO = {"cue": "scenarios/cue_one_degree.json", "belt": "scenarios/belt_search.json",
            "eclipse": "scenarios/equinox_eclipse.json"}
STARS = {"cue": "embedded", "belt": "embedded", "eclipse": "stars/equinox_eclipse.stars"}
SHORT = {"cue": 2, "belt": 2, "eclipse": 1}
IMAGES = {"cue": 10, "belt": 0, "eclipse": 0}
OBJECT = "/world/objects/0"
CUE = runs.SENSOR + "/cue"
PIXEL_RAD = np.radians(3 / 3600)
FULL_SNR, FULL_AREA_M2, FULL_V = 38.0, 4.0, 13.0  # of the eclipse's target in full light

EARTH_RADPS = 7.2921150e-5
MU = 3.986004418e14
BELT_M = (MU / EARTH_RADPS**2) ** (1 / 3)
LONGITUDE_DEG, HALF_WIDTH_DEG, BELT_S = (17.0, 37.0), 2.0, 1800.0
# the two seeds of the short belt are found by 760 s; the eclipse's mount is stepped half as often
BELT_RUN_S = BELT_S if options.full else 900.0
GIMBAL = runs.SENSOR + "/modules/gimbal"
ECLIPSE = [] if options.full else [GIMBAL + "/rate_hz=100", GIMBAL + "/platform/telemetry_rate_hz=20"]
# Earth rotation angle at 2022-06-16T22:10:00 UTC (IERS Conventions 2010, eq. 5.15; UT1 - UTC below
# 0.1 s is 1.5 arcsec). The GCRF's pole is 0.12 degrees from that of date: the margin below.
DAYS = 2459747.4236111 - 2451545.0
EARTH_ANGLE = 2 * np.pi * ((0.7790572732640 + 1.00273781191135448 * DAYS) % 1.0)
MARGIN_DEG = 0.15


def unit(v):
    return v / np.linalg.norm(v)


def belt_state(rng):
    """GCRF position and velocity of an object that stays in the region for BELT_S seconds."""
    while True:
        longitude = np.radians(rng.uniform(LONGITUDE_DEG[0] + MARGIN_DEG,
                                           LONGITUDE_DEG[1] - MARGIN_DEG))
        latitude = np.radians(rng.uniform(-HALF_WIDTH_DEG, HALF_WIDTH_DEG))
        heading = np.radians(rng.uniform(-2, 2))  # of the velocity from the east
        ra = EARTH_ANGLE + longitude
        up = np.array([np.cos(latitude) * np.cos(ra), np.cos(latitude) * np.sin(ra),
                       np.sin(latitude)])
        east = np.array([-np.sin(ra), np.cos(ra), 0.0])
        north = np.cross(up, east)
        speed = np.sqrt(MU / BELT_M)
        position = BELT_M * up
        velocity = speed * (np.cos(heading) * east + np.sin(heading) * north)
        n = EARTH_RADPS
        times = np.linspace(0, BELT_S, 50)
        z = (position[2] * np.cos(n * times) + velocity[2] / n * np.sin(n * times)) / BELT_M
        if np.all(np.abs(np.degrees(np.arcsin(z))) <= HALF_WIDTH_DEG - MARGIN_DEG):
            return position, velocity


def sphere_area_m2(position, observer, sun, v_mag, albedo=0.25):
    """Cross-section of a diffuse sphere that has a V seen from the observer."""
    to_sun, to_eye = unit(sun - position), observer - position
    phase = np.arccos(to_sun @ unit(to_eye))
    law = 2 / (3 * np.pi**2) * (np.sin(phase) + (np.pi - phase) * np.cos(phase))
    v_of_one = -26.74 - 2.5 * np.log10(albedo * law / (to_eye @ to_eye))
    return 10 ** (0.4 * (v_of_one - v_mag))


def belt_area_m2(position):
    """For V 13 in mid-search: from the observer, whose own place matters by 0.3 mag, to the Sun."""
    sun = 1.52e11 * np.array([np.cos(np.radians(23.4)) * np.cos(np.radians(85.0)),
                              np.cos(np.radians(23.4)) * np.sin(np.radians(85.0)),
                              np.sin(np.radians(23.4))])
    return sphere_area_m2(position, np.zeros(3), sun, 13.0)


def scene(case, seed):
    """Overrides of the scenario for one seed."""
    rng = random.Random(f"{case} {seed}")
    if case == "cue":
        return [f"{CUE}/offset_angle_deg={rng.uniform(0, 360)}"]
    if case == "belt":
        position, velocity = belt_state(rng)
        return [f"{OBJECT}/orbit/state/position_gcrf_m={json.dumps(list(position))}",
                f"{OBJECT}/orbit/state/velocity_gcrf_mps={json.dumps(list(velocity))}",
                f"{OBJECT}/area_m2={belt_area_m2(position)}", f"/duration_s={BELT_RUN_S}"]
    snr = rng.uniform(10, FULL_SNR)
    area = FULL_AREA_M2 * snr / FULL_SNR
    main = {"name": "INMARSAT GX5", "area_m2": area, "albedo": 0.25,
            "orbit": {"source": "sgp4", "elements_file": "catalogue_2022-06.tle", "norad": 44801}}
    offset = 42e6 * np.radians(rng.uniform(0.03, 0.1)) * \
        unit(np.array([0.3 * rng.gauss(0, 1), rng.gauss(0, 1), rng.gauss(0, 1)]))
    neighbour = {**main, "name": "NEIGHBOUR", "area_m2": area / 4,
                 "orbit": {"source": "relative", "reference": main["name"],
                           "offset_rtn_m": list(offset),
                           "rate_rtn_mps": [rng.uniform(-0.3, 0.3) for _ in range(3)]}}
    return [*ECLIPSE, f"/world/objects={json.dumps([main, neighbour])}",
            f"{CUE}/offset_deg={rng.uniform(0, 0.6)}",
            f"{CUE}/offset_angle_deg={rng.uniform(0, 360)}", f"{CUE}/v_mag_sigma=0.3",
            f"{CUE}/v_mag={FULL_V - 2.5 * np.log10(area / FULL_AREA_M2):.2f}"]


def direction(ra_deg, dec_deg):
    ra, dec = np.radians(ra_deg), np.radians(dec_deg)
    return np.array([np.cos(dec) * np.cos(ra), np.cos(dec) * np.sin(ra), np.sin(dec)])


class Outcome:
    """When a run had the target in track."""

    def __init__(self, case, seed, images, out):
        self.case, self.seed, self.images = case, seed, images
        db = runs.database(out)
        self.events = [tuple(row) for row in
                       db.execute("SELECT time_s, kind, text FROM events ORDER BY time_s")]
        rows = db.execute(
            "SELECT t.time_s, t.ra_deg, t.dec_deg, o.ra_deg, o.dec_deg FROM tracks t JOIN truth o "
            "USING (sensor, exposure_id) WHERE target_of_interest AND status = 'confirmed' AND "
            "o.kind = 'object' AND o.id = 0 ORDER BY t.time_s").fetchall()
        self.times = np.array([row[0] for row in rows])
        self.right = np.array([np.linalg.norm(direction(row[1], row[2]) - direction(row[3], row[4]))
                               <= 5 * PIXEL_RAD for row in rows], dtype=bool)
        self.truth = [tuple(row) for row in db.execute(
            "SELECT mid_s, snr, v_mag, sunlit_fraction FROM truth WHERE kind = 'object' AND id = 0 "
            "ORDER BY mid_s")]
        self.seconds = self.reference_s = None
        if case == "eclipse":
            self.after_eclipse()
        else:
            self.seconds = self.in_track_from(0.0)

    def in_track_from(self, start_s):
        """The first time from then on at which control tracks the right target; None: never."""
        mode = [(t, text.split(" -> ")[1].split(":")[0]) for t, kind, text in self.events
                if kind == "mode"]
        for i, (begin, name) in enumerate(mode):
            end = mode[i + 1][0] if i + 1 < len(mode) else np.inf
            if name != "track" or end <= start_s:
                continue
            frames = (self.times > max(begin, start_s) - 2.0) & (self.times < end)
            if np.any(frames) and np.all(self.right[frames]):
                return max(begin, start_s)
        return None

    def after_eclipse(self):
        dark = [t for t, _, _, lit in self.truth if lit == 0.0]
        self.dark_s = dark[-1] - dark[0] if dark else 0.0
        bright = [t for t, snr, _, _ in self.truth if dark and t > dark[-1] and snr >= 8.0]
        if bright:
            self.reference_s = bright[0] + 0.25
            found = self.in_track_from(dark[-1])
            self.seconds = None if found is None else found - self.reference_s

    @property
    def v_mag(self):
        seen = [v for _, _, v, lit in self.truth if lit == 1.0]
        return float(np.median(seen)) if seen else np.nan

    def __str__(self):
        time = "never" if self.seconds is None else f"{self.seconds:.2f} s"
        more = f", dark for {self.dark_s / 60:.1f} min" if self.case == "eclipse" else ""
        lost = [e for e in self.events if e[1] == "target_lost"]
        return (f"{self.case} {self.seed}{' (images)' if self.images else ''}: {time}, V "
                f"{self.v_mag:.2f}{more}, wrong in {np.sum(~self.right)} frames, lost {len(lost)}")


def catalogue_of(case):
    return options.catalogue or ("default" if options.full else STARS[case])


def play(job):
    case, seed, images = job
    out = os.path.join(play.folder, f"{case}_{seed}_{images}")
    sets = scene(case, seed)
    sets.append(f"/world/star_catalogue={catalogue_of(case)}")
    if images:
        sets.append(runs.SENSOR + "/observation_source=image")
    runs.run(SCENARIO[case], out, *sets, seed=seed)
    outcome = Outcome(case, seed, images, out)
    shutil.rmtree(out)
    print(outcome, flush=True)
    return outcome


def sweep_seconds():
    """Time of one sweep of the belt, with nothing there to be found."""
    out = os.path.join(play.folder, "sweep")
    runs.run(SCENARIO["belt"], out, OBJECT + "/albedo=0",
             f"/world/star_catalogue={catalogue_of('belt')}", duration=1200)
    rows = runs.database(out).execute("SELECT time_s FROM events WHERE kind = 'mode' AND "
                                      "text LIKE 'search -> search%'").fetchall()
    return rows[0][0]


class Acquisition(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        play.folder = runs.scratch()
        if options.full and not options.catalogue:
            runs.need_full_catalogue()
        cls.cases = options.cases.split(",")
        jobs = []
        for case in cls.cases:
            count = options.seeds or (100 if options.full else SHORT[case])
            jobs += [(case, seed, False) for seed in range(1, count + 1)]
            count = options.images if options.images is not None else \
                IMAGES[case] if options.full else 0
            jobs += [(case, seed, True) for seed in range(1, count + 1)]
        cls.outcomes = runs.parallel(play, jobs)
        if options.times:
            with open(options.times, "w", encoding="utf-8") as file:
                json.dump({case: [o.seconds for o in cls.outcomes if o.case == case and not o.images]
                           for case in cls.cases}, file)

    def of(self, case):
        outcomes = [o for o in self.outcomes if o.case == case]
        if not outcomes:
            self.skipTest("not among --cases")
        return outcomes

    def within(self, case, limit_s):
        """Share of the runs in track within the limit, and those that are not."""
        outcomes = self.of(case)
        late = [o for o in outcomes if o.seconds is None or o.seconds > limit_s]
        times = sorted(o.seconds for o in outcomes if o.seconds is not None)
        if times:
            print(f"{case}: {len(outcomes) - len(late)} of {len(outcomes)} within {limit_s:.0f} s; "
                  f"median {np.median(times):.1f} s, 95 % {np.quantile(times, 0.95):.1f} s, "
                  f"longest {times[-1]:.1f} s")
        return 1 - len(late) / len(outcomes), "\n".join(map(str, late))

    def test_cue(self):
        share, late = self.within("cue", 120.0)
        self.assertEqual(share, 1.0, late)  # 100 of 100: the figure of the issue

    def test_belt(self):
        for o in self.of("belt"):
            self.assertAlmostEqual(o.v_mag, 13.0, delta=0.35, msg=str(o))
        sweep_s = sweep_seconds()
        print(f"belt: one sweep takes {sweep_s:.0f} s")
        share, late = self.within("belt", 2 * sweep_s)
        self.assertGreaterEqual(share, 0.95, late)  # 95 of 100: the figure of the issue

    def test_eclipse(self):
        for o in self.of("eclipse"):
            self.assertGreater(o.dark_s, 60 * 60, str(o))
            self.assertIsNotNone(o.reference_s, str(o))
        share, late = self.within("eclipse", 10.0)
        self.assertEqual(share, 1.0, late)  # 100 of 100: the figure of the issue


def tearDownModule():
    runs.clean()


if __name__ == "__main__":
    unittest.main()
