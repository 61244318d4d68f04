#!/usr/bin/env python3
"""Every column of run.sqlite, the manifest's sums, the keys of frames.fits and the curves of the report against numbers that
are worked out here with numpy, ERFA, sgp4 and astropy from the scenario alone, or from columns that another part of the program filled.

The scene (skewed_scene.py) has no symmetry; its frames are a window off the corner, binned by 2.

Usage, from the repository root: /usr/bin/python3 tests/e2e/test_tables.py BORESIGHT
"""
import re
import unittest

import numpy as np
from astropy.time import Time

import figures
import optics
import runs
from loop_tables import LoopTables
from optics import ARCSEC, angle, columns, multiply, quaternion, rotate, turn_between, unit
from report_tables import ReportTables
from skewed_run import SkewedRun
from skewed_scene import CAMERA, DURATION_S, NAV_GROWTH_MPS, NAV_RTN_M, NAV_RTN_MPS, NORAD, TELEMETRY_HZ, TICKS
from truth_tables import TruthTables


class Tables(SkewedRun, TruthTables, LoopTables, ReportTables):
    # ---------------------------------------------------------------- the run and its sensors

    def test_run_and_sensors(self):
        (run,), (sensor,) = self.tables["run"], self.tables["sensors"]
        self.assertTrue(run["program"].startswith("boresight "))
        self.assertEqual(Time(run["epoch_utc"]), Time(self.scene["epoch_utc"]))
        self.assertEqual(run["tick_rate_hz"], TICKS)
        self.assertEqual(tuple(sensor), (0, "neossat", "telescope", "INMARSAT GX5", "frames.fits", 640, 480, 3.0))
        self.assertEqual([tuple(row) for row in self.tables["objects"]],
                         [(0, "INMARSAT GX5", NORAD, 4.0, 0.25), (1, "NEIGHBOUR", 0, 1.0, 0.3)])

    def test_units_are_those_of_the_names(self):
        """The unit that `columns` states is the one that the column's name ends with."""
        units = {"px": "px", "px2": "px^2", "deg": "deg", "s": "s", "m": "m", "mps": "m/s", "arcsec": "arcsec", "mag": "mag",
                 "rad2": "rad^2", "rad2ps": "rad^2/s", "rad2ps2": "rad^2/s^2", "radps": "rad/s", "radps2": "rad/s^2",
                 "tick": "tick", "degps": "deg/s", "m2": "m^2", "pxps": "px/s", "hz": "Hz"}
        for row in self.tables_columns():
            tail = row["column"].rsplit("_", 1)[-1]
            if "_" in row["column"] and tail in units and not row["column"].endswith("_per_s"):
                if row["column"] == "pixel_scale_arcsec":
                    self.assertEqual(row["unit"], "arcsec/px")
                elif re.match(r"cd\d", row["column"]):
                    self.assertEqual(row["unit"], "deg/px")
                else:
                    self.assertEqual(row["unit"], units[tail], tuple(row))

    def tables_columns(self):
        return self.db.execute("SELECT * FROM columns").fetchall()

    # ---------------------------------------------------------------- telemetry

    def test_mount_and_pointing(self):
        pointing, mount = self.by_tick("pointing"), self.by_tick("mount")
        # the grid starts with the first sample
        self.assertGreaterEqual(len(pointing), TELEMETRY_HZ * DURATION_S - 1)
        self.assertEqual(len(pointing), len(mount))
        ticks = sorted(pointing)
        axes = np.array([[0, 1, 0], [1, 0, 0], [0, 1, 0]])  # cross_elevation with a third axis (conventions.md)
        rates = np.array([[mount[t][f"axis{k}_rate_degps"] for k in range(3)] for t in ticks])
        angles = np.array([[mount[t][f"axis{k}_deg"] for k in range(3)] for t in ticks])
        bodies = [quaternion(pointing[t], "q_body_from_gcrf") for t in ticks]
        off = []
        for tick, body, angle_deg in zip(ticks, bodies, angles):
            p, m = pointing[tick], mount[tick]
            self.assertEqual((p["time_s"], m["time_s"]), (tick / TICKS, tick / TICKS))
            self.assertEqual((m["axes"], m["wheels_saturated"]), (3, 0))
            self.close([p["axis_outer_deg"], p["axis_inner_deg"]], angle_deg[:2], 1e-9)
            q = body
            for axis, degrees in zip(axes, angle_deg):
                q = multiply(optics.conjugate(optics.about(axis, np.radians(degrees))), q)
            self.close(turn_between(quaternion(p, "q_cam_from_gcrf"), q), 0, 1e-9)
            off.append(turn_between(q, quaternion(self.los[tick], "q_cam_from_gcrf")) / ARCSEC)
        off = np.array(off)
        # what star trackers and gyro know: 3 arcsec to 10 an axis
        print("telemetry against truth, RMS about x, y, z:", np.sqrt(np.mean(off ** 2, axis=0)).round(2), "arcsec")
        self.assertLess(np.sqrt(np.mean(off ** 2, axis=0)).max(), 15)
        self.assertGreater(np.abs(off).max(), 0.1)  # it is not the truth itself
        self.assertGreater(angles[-1, :2].min(), 20)
        # rates from angles over 0.4 s; a rate is the mean of the last 0.01 s, of 70 deg/s^2 in slews
        step = 20
        slope = (angles[2 * step:] - angles[:-2 * step]) / (2 * step / TELEMETRY_HZ)
        weights = np.ones(2 * step + 1)
        weights[0] = weights[-1] = 0.5
        weights /= weights.sum()
        means = np.array([weights @ rates[i:i + 2 * step + 1] for i in range(len(slope))])
        self.close(means, slope, 0.3)
        self.close(np.median(np.abs(means - slope), axis=0), 0, 0.001)
        self.assertGreater(np.abs(slope[:, :2]).max(axis=0).min(), 1.0)
        body_rates = np.array([columns(mount[t], "body_rate", tail="_degps") for t in ticks])
        turned = np.array([turn_between(bodies[i], bodies[i + 2 * step]) for i in range(len(slope))])  # frames turn by -r
        turned = np.degrees(turned) / (2 * step / TELEMETRY_HZ)
        means = np.array([weights @ body_rates[i:i + 2 * step + 1] for i in range(len(slope))])
        self.close(np.sqrt(np.mean((means - turned) ** 2, axis=0)), 0, 0.002)
        # about three axes by different amounts, from recoil of the slewing mount and the orbit
        print("body rates, RMS", np.sqrt(np.mean(turned ** 2, axis=0)).round(4), "deg/s, misfit",
              np.sqrt(np.mean((means - turned) ** 2, axis=0)).round(5))
        settled = [pointing[t]["settled"] for t in ticks]
        self.assertEqual((settled[TELEMETRY_HZ * 3], settled[-1]), (0, 1))
        # at a limit in some of the slew, never while it tracks
        limited = np.array([pointing[t]["limited"] for t in ticks])
        flags = np.array([max(mount[t][f"axis{k}_flags"] for k in range(3)) for t in ticks])
        late = np.array(ticks) > self.tracking()[0]["start_tick"]
        self.assertEqual((limited[late].max(), flags[late].max()), (0, 0))

    def test_navigation(self):
        rows = self.tables["nav"]
        self.assertGreaterEqual(len(rows), 10 * DURATION_S - 1)
        for row in rows[::5]:
            t = row["time_s"]
            self.assertEqual(t, row["tick"] / TICKS)
            place, velocity = self.eye.position(t), self.velocity(self.eye, t, 0.1)
            axes = self.rtn(place, velocity)
            self.close(columns(row, "position_gcrf", tail="_m"), place + (NAV_RTN_M + [0, NAV_GROWTH_MPS * t, 0]) @ axes, 1.0, t)
            # SGP4's own velocity is off by centimetres a second from that of its places
            self.close(columns(row, "velocity_gcrf", tail="_mps"), velocity + NAV_RTN_MPS @ axes, 0.05, t)

    # ---------------------------------------------------------------- who saw what

    def sightings_of(self, number):
        """Passes of an object without a break: what docs/how-to/several_observers.md says, from truth, detections and tracks."""
        pass_ = dict(frames=0, lit=0, detected=0, tracked=0, target=0, seen=[], snr=0.0, v_mag=None, range_m=np.inf,
                     place=[], track=[], start_s=None, end_s=None)
        others = 1 - number
        for e in self.exposures:
            k = e["exposure_id"]
            rows = {row["id"]: row for row in self.in_frame["truth"][k] if row["kind"] == "object"}
            row = rows.get(number)
            if row is None or not row["in_field"] or row["occulted"]:
                continue
            pass_["frames"] += 1
            pass_["lit"] += row["electrons"] > 0
            pass_["start_s"] = e["mid_s"] if pass_["start_s"] is None else pass_["start_s"]
            pass_["end_s"] = e["mid_s"]
            pass_["range_m"] = min(pass_["range_m"], row["range_m"])
            if row["snr"] > pass_["snr"]:
                pass_["snr"], pass_["v_mag"] = row["snr"], row["v_mag"]

            def reaches(d, x):
                """Within one FWHM of the place, or across of a longer path and half of it along."""
                off = np.array([d["x_px"] - x["x_centroid_px"], d["y_px"] - x["y_centroid_px"]])
                way = np.array([x["x_end_px"] - x["x_start_px"], x["y_end_px"] - x["y_start_px"]])
                length = np.hypot(*way)
                if length <= 4.0:
                    return np.hypot(*off) <= 2.0
                return abs(off @ way) / length <= length / 2 and abs(off[1] * way[0] - off[0] * way[1]) / length <= 2.0

            def distance(d, x):
                return np.hypot(d["x_px"] - x["x_centroid_px"], d["y_px"] - x["y_centroid_px"])
            mine = [d for d in self.in_frame["detections"][k] if reaches(d, row) and not (
                others in rows and reaches(d, rows[others]) and distance(d, rows[others]) < distance(d, row))]
            best = min(mine, key=lambda d: distance(d, row), default=None)
            true = unit(row["ra_deg"], row["dec_deg"])
            if best is not None and not (best["label"] == "star" and best["star_id"]) and best["label"] not in ("hit", "hot_pixel"):
                pass_["detected"] += 1
                pass_["seen"].append(e["mid_s"])
                fix = self.tables["track_frames"][k]
                if fix["attitude_valid"]:
                    v = self.camera.directions([best["x_px"], best["y_px"]])
                    v = rotate(optics.conjugate(quaternion(fix, "attitude_q_cam_from_gcrf")), v)
                    pass_["place"].append(angle(optics.geometric(e, v), true) / ARCSEC)
            near = [(angle(unit(t["ra_deg"], t["dec_deg"]), true) / ARCSEC, t["target_of_interest"])
                    for t in self.in_frame["tracks"][k] if t["status"] == "confirmed" and t["misses_in_row"] == 0]
            near = [n for n in near if n[0] <= 5 * 3.0]
            if near:
                pass_["tracked"] += 1
                pass_["target"] += min(near)[1]
                pass_["track"].append(min(near)[0])
        return pass_

    def test_passes_and_sightings(self):
        rms = lambda x: np.sqrt(np.mean(np.square(x)))  # noqa: E731
        end_s = max(e["end_tick"] for e in self.exposures) / TICKS
        length_s = (self.manifest["last_tick"] + 1) / TICKS
        custody = []
        for number, row in enumerate(self.tables["passes"]):
            p = self.sightings_of(number)
            self.assertEqual([row[c] for c in ("sensor", "object", "name", "norad")],
                             [0, number, *(("INMARSAT GX5", NORAD), ("NEIGHBOUR", 0))[number]])
            self.assertEqual([row[c] for c in ("start_s", "end_s", "frames", "lit", "detected", "tracked", "target", "first_s",
                                               "last_s")],
                             [p["start_s"], p["end_s"], p["frames"], p["lit"], p["detected"], p["tracked"], p["target"],
                              p["seen"][0], p["seen"][-1]])
            self.assertEqual([row[c] for c in ("snr", "v_mag", "range_m")], [p["snr"], p["v_mag"], p["range_m"]])
            sums = [s for s in self.tables["sightings"] if s["object"] == number]
            self.assertEqual([s["sensor"] for s in sums], [None, 0])
            custody.append(length_s - p["seen"][0])
            gaps = np.diff([0.0] + p["seen"] + [length_s])
            for s in sums + [row]:
                for kind, values in (("place", p["place"]), ("track", p["track"])):
                    self.assertAlmostEqual(s[f"{kind}_rms_arcsec"], rms(values), delta=1e-4)
                    self.assertAlmostEqual(s[f"{kind}_most_arcsec"], max(values), delta=2e-4)
            for s in sums:
                self.assertEqual([s[c] for c in ("name", "norad", "passes", "passes_seen", "frames", "lit", "detected", "tracked",
                                                 "first_s", "last_s", "revisits", "revisit_mean_s", "revisit_most_s", "snr")],
                                 [row["name"], row["norad"], 1, 1, p["frames"], p["lit"], p["detected"], p["tracked"],
                                  p["seen"][0], p["seen"][-1], 0, None, None, p["snr"]])
                self.assertAlmostEqual(s["longest_gap_s"], gaps.max(), delta=1e-9)
                self.assertAlmostEqual(s["custody_s"], custody[-1], delta=1e-9)
                self.assertAlmostEqual(s["custody_fraction"], custody[-1] / length_s, delta=1e-12)
        self.assertLess(end_s, length_s)
        rows, s = self.tables["passes"], self.manifest["sightings"]
        self.assertEqual([s[c] for c in ("objects", "objects_in_field", "objects_seen", "passes", "passes_seen", "detections",
                                         "revisits", "tasks", "tasks_done", "tasks_not_found", "tasks_lost")],
                         [2, 2, 2, 2, 2, sum(row["detected"] for row in rows), 0, 0, 0, 0, 0])
        self.assertAlmostEqual(s["custody_fraction_seen"], np.mean(custody) / length_s, delta=1e-12)
        self.assertAlmostEqual(s["custody_fraction_all"], np.mean(custody) / length_s, delta=1e-12)

    def test_manifest(self):
        """The summary by figures.py, the losses, the counters."""
        frames = figures.Frames(self.db, self.target, NORAD, rotation_deg=CAMERA["rotation_deg"])
        self.assertLess(frames.disagreement, 0.01 * ARCSEC)
        mine, unclear = figures.judge(frames)
        self.assertEqual(unclear, 0)
        for key, value in mine.items():
            found = self.manifest["summary"][key]
            if "median" in key or "p95" in key or "p99" in key:
                self.assertAlmostEqual(found / value, 1, delta=1e-3, msg=key)
            else:
                self.assertAlmostEqual(found, value, delta=1e-7 * max(1.0, abs(value)), msg=key)
        summary = self.manifest["summary"]
        self.assertEqual(summary["detections"], len(self.tables["detections"]))
        self.assertEqual(summary["earth_frames"], sum(e["earth_fraction"] > 0 for e in self.exposures))
        self.assertEqual((summary["moon_frames"], summary["sun_frames"], summary["bad_pixels"]), (0, 0, 0))
        self.assertEqual(summary["final_mode"], self.mode_at(1 << 62))
        confirmed = {t["track_id"]: [] for t in self.tables["tracks"] if t["status"] == "confirmed"}
        self.assertEqual(summary["tracks"], len(confirmed))
        blind = sum(f["stars_identified"] == 0 for f in self.tables["detection_frames"])
        lame = sum(not f["attitude_valid"] for f in self.tables["track_frames"])
        self.assertEqual(self.manifest["losses"]["neossat/telescope"],
                         {"frames": len(self.exposures), "no_stars_frames": blind, "no_attitude_frames": lame,
                          "earth_frames": summary["earth_frames"]})
        self.assertGreater(min(blind, lame, summary["earth_frames"]), 0)


class Generated(Tables):
    """What differs where the observation generator takes the place of images."""
    SOURCE = "generator"
    test_frames_and_headers = test_pixels = test_mount_and_pointing = test_navigation = test_line_of_sight = None
    test_places_of_sources = test_light_of_sources = test_units_are_those_of_the_names = test_page_frames = None


def tearDownModule():
    runs.clean()


if __name__ == "__main__":
    unittest.main()
