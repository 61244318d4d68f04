#!/usr/bin/env python3
"""Passes of a low satellite by another at 100 km and up to 2 deg/s: tracked through, away from the
mount's pole and with a third axis through it; without one, lost and found when guidance said.

Usage, from the repository root: /usr/bin/python3 tests/e2e/test_passes.py BORESIGHT [SEEDS]
With one seed, only the middle of each pass is run.
"""
import math
import re
import subprocess
import sys
import unittest

import numpy as np

import runs

SEEDS = int(sys.argv.pop(1)) if len(sys.argv) > 1 and sys.argv[1].isdigit() else 1
GENERATOR = runs.SENSOR + "/observation_source=generator"
# the quarter of the images' area: most of the time of a run goes with it
SMALL = [f"{runs.SENSOR}/camera/{side}_px=512" for side in ("width", "height")] if SEEDS == 1 else []
# of a pass of 300 s with its culmination at 150 s: the line of sight turns by 0.35 deg/s or more in the first, by 0.18
# in the others, which leave guidance the time to see what comes: the keyhole at 154 s
BRISK_S, POLE_S, KEYHOLE_S = ((85, 215), (60, 240), (30, 240)) if SEEDS == 1 else 3 * ((0, 300),)
SETTLED_S = 5.0  # the cue's 0.3 degree are searched and centred by then
LOST_PX = 2.0    # guidance's loss_tolerance_px


def errors(out):
    """Middle of each frame and distance of the target from the boresight, px; infinite outside."""
    rows = runs.database(out).execute(
        "SELECT e.mid_s, t.x_chief_px - e.boresight_x_px, t.y_chief_px - e.boresight_y_px"
        " FROM exposures e LEFT JOIN truth t ON t.exposure_id = e.exposure_id AND t.kind = 'object'"
        " WHERE e.mid_s > ? ORDER BY e.mid_s", (SETTLED_S,)).fetchall()
    return (np.array([r[0] for r in rows]),
            np.array([math.inf if r[1] is None else math.hypot(r[1], r[2]) for r in rows]))


def part(begin_s, end_s):
    """Overrides that leave this part of a pass, and its duration."""
    return [f"{orbit}/state/at_s={150 - begin_s}" for orbit in ("/world/objects/0/orbit", "/observers/0/orbit")] + [
        f"/duration_s={end_s - begin_s}"]


def predicted_losses(scenario, *sets):
    """What `boresight check` warns of."""
    words = [word for one in sets for word in ("--set", one)]
    result = subprocess.run([runs.BORESIGHT, "check", "scenarios/" + scenario, "--quiet", "--set",
                             "/world/star_catalogue=embedded", *words], capture_output=True,
                            text=True, timeout=120)
    if result.returncode != 0:
        raise AssertionError(result.stderr)
    return result.stderr


class Passes(unittest.TestCase):
    def follow(self, scenario, seed, *sets):
        out = runs.scratch() + "/run"
        runs.run("scenarios/" + scenario, out, runs.NO_FRAMES, "/record/truth_stars=false", *sets,
                 seed=seed)
        mid_s, error = errors(out)
        self.assertEqual(len(mid_s), 10 * (runs.manifest(out)["last_tick"] // 6000 + 1 - SETTLED_S))
        return out, mid_s, error

    def tracked(self, scenario, *sets, seeds=SEEDS):
        for seed in range(1, seeds + 1):
            _, _, error = self.follow(scenario, seed, *sets)
            p99 = np.percentile(error, 99)
            print(f"{scenario} {' '.join(sets)} seed {seed}: p99 {p99:.2f}, "
                  f"greatest {error.max():.2f} px")
            # the figure asked for; 20 seeds had 0.4 to 0.6
            self.assertLess(p99, 2.0)

    @unittest.skipUnless(SEEDS > 1, "slow")
    def test_away_from_the_pole_by_images(self):
        self.tracked("leo_leo_pass.json", *SMALL, *part(*BRISK_S))

    def test_away_from_the_pole_by_the_generator(self):
        self.tracked("leo_leo_pass.json", GENERATOR, *part(*BRISK_S))

    def test_past_the_pole_with_a_third_axis(self):
        self.tracked("leo_leo_third_axis.json", GENERATOR, *part(*POLE_S))

    def test_past_the_pole_by_rolling_the_body(self):
        self.tracked("leo_leo_body_roll.json", GENERATOR, *part(*POLE_S))

    @unittest.skipUnless(SEEDS > 1, "slow")
    def test_past_the_pole_by_rolling_the_body_by_images(self):
        self.tracked("leo_leo_body_roll.json", seeds=3)

    @unittest.skipUnless(SEEDS > 1, "slow")
    def test_past_the_pole_with_a_third_axis_by_images(self):
        self.tracked("leo_leo_third_axis.json", seeds=3)

    def test_keyhole(self):
        self.lost_as_told(GENERATOR, *part(*KEYHOLE_S))

    @unittest.skipUnless(SEEDS > 1, "slow")
    def test_keyhole_by_images(self):
        self.lost_as_told(seeds=3)

    def lost_as_told(self, *sets, seeds=SEEDS):
        for seed in range(1, seeds + 1):
            out, mid_s, error = self.follow("leo_leo_keyhole.json", seed, *sets)
            reported = [re.match(r"will be lost from ([\d.]+) s until ([\d.]+) s: in the keyhole", text)
                    for text, in runs.database(out).execute(
                        "SELECT text FROM events WHERE kind = 'guidance' ORDER BY tick")]
            reported = [match for match in reported if match]
            self.assertGreater(len(reported), 0)
            first, last = float(reported[-1].group(1)), float(reported[-1].group(2))
            off = mid_s[error > LOST_PX]
            lost = off.max() - off.min()
            print(f"keyhole seed {seed}: event {first} to {last} s, lost {off.min():.2f} to "
                  f"{off.max():.2f} s")
            # one loss, and its ends to a tenth of its length
            self.assertLess(lost, 0.1 * (len(off) + 5))
            self.assertAlmostEqual(first, off.min(), delta=0.1 * lost)
            self.assertAlmostEqual(last, off.max(), delta=0.1 * lost)
            match = re.search(r"out of reach from ([\d.]+) s until ([\d.]+) s: in the keyhole",
                              predicted_losses("leo_leo_keyhole.json", *sets))
            self.assertAlmostEqual(float(match.group(1)), off.min(), delta=0.1 * lost)
            self.assertAlmostEqual(float(match.group(2)), off.max(), delta=0.1 * lost)
            # announced well before, and tracked to both sides of it
            when, = runs.database(out).execute(
                "SELECT max(time_s) FROM events WHERE kind = 'guidance'"
                " AND text LIKE 'will be lost%'").fetchone()
            self.assertLess(when, first - 30.0)
            self.assertLess(np.percentile(error[error <= LOST_PX], 99), 1.0)


class KeepOut(unittest.TestCase):
    """The same pass with a cone round the Earth that the target rises out of after a minute."""

    def test_the_earth(self):
        out = runs.scratch() + "/run"
        guidance = runs.SENSOR + "/modules/control/guidance/"
        cone = (guidance + "earth_keep_out=true", guidance + "earth_limb_keep_out_deg=40")
        self.assertRegex(predicted_losses("leo_leo_pass.json", *cone),
                         r"out of reach from 0.0 s until 6[67]\.\d s: in the keep-out cone of the Earth's")
        self.assertEqual(predicted_losses("leo_leo_pass.json"), "")
        runs.run("scenarios/leo_leo_pass.json", out, runs.NO_FRAMES, "/record/truth_stars=false",
                 GENERATOR, *cone, guidance + "prediction_horizon_s=200", seed=1, duration=120)
        rows = runs.database(out).execute(
            "SELECT mid_s, radians(boresight_ra_deg), radians(boresight_dec_deg), observer_gcrf_x_m,"
            " observer_gcrf_y_m, observer_gcrf_z_m FROM exposures WHERE mid_s > 5").fetchall()
        margin = []
        for _, ra, dec, x, y, z in rows:
            r = math.sqrt(x * x + y * y + z * z)
            up = (x * math.cos(ra) + y * math.sin(ra)) * math.cos(dec) + z * math.sin(dec)
            # the limb of a sphere of 6378.137 km and 100 km of air
            margin.append(math.degrees(math.acos(-up / r) - math.asin(6478137.0 / r)) - 40.0)
        print(f"nearest to the cone: {min(margin):.3f} degrees outside")
        self.assertGreater(min(margin), 0.0)  # the true boresight; it starts 9 degrees inside
        self.assertLess(margin[0], 0.2)       # and waits at the edge
        reported = [text for text, in runs.database(out).execute(
            "SELECT text FROM events WHERE kind = 'guidance' ORDER BY tick")]
        # the target rises out of it then, by the margins above of a target that is followed
        self.assertIn("unreachable until 67.0 s: in the keep-out cone of the Earth's limb", reported)
        mid_s, error = errors(out)
        self.assertLess(np.percentile(error[mid_s > 80.0], 99), 2.0)


class Faults(unittest.TestCase):
    def test_a_stuck_axis_is_reported(self):
        out = runs.scratch() + "/run"
        fault = runs.SENSOR + "/modules/gimbal/fault/"
        runs.run("scenarios/full_plant.json", out, runs.NO_FRAMES, GENERATOR,
                 fault + "stuck_axis=outer", fault + "stuck_from_s=0.2", duration=3)
        reported = runs.database(out).execute(
            "SELECT time_s, text FROM events WHERE kind = 'axis' ORDER BY tick").fetchall()
        self.assertEqual(reported[0][1], "the outer axis is stuck: its motor pushes in vain")
        self.assertGreater(reported[0][0], 0.4)  # 0.25 s of pushing
        self.assertLess(reported[0][0], 1.5)
        self.assertGreaterEqual(runs.manifest(out)["counters"]["axis_stuck"], 1)
        lost = runs.database(out).execute(
            "SELECT count(*) FROM pointing WHERE axis_outer_deg IS NULL OR axis_inner_deg IS NULL")
        self.assertEqual(lost.fetchone()[0], 0)


def tearDownModule():
    runs.clean()


if __name__ == "__main__":
    unittest.main(verbosity=2)
