#!/usr/bin/env python3
"""The figures of summary and report against a recomputation from run.sqlite (figures.py),
on scenes that are not shipped: a turned camera with its boresight off the centre, and one that
loses the stars, the target behind the Earth and the track again and again.

Usage, from the repository root: /usr/bin/python3 tests/e2e/test_figures.py BORESIGHT
"""
import json
import math
import os
import re
import subprocess
import unittest

import figures
import runs
from figure_checks import FigureChecks
from report_tables import Chart
from test_report import Page

CATALOGUE, GX5, EPOCH = "scenarios/catalogue_2022-06.tle", 44801, "2022-06-16T22:10:00Z"
CAMERA = runs.SENSOR + "/camera"
# with the stars in the program alone the attitude is lost after 8 minutes
ROUGH = (CAMERA + "/rotation_deg=37", CAMERA + "/boresight_offset_px=[40,-25]",
         CAMERA + "/pixel_scale_arcsec=2.5", "/record/detections_of=all")
CLEAN = (CAMERA + "/rotation_deg=-110", CAMERA + "/pixel_scale_arcsec=4",
         runs.SENSOR + "/cue/offset_deg=0.3", "/record/detections_of=all")


class Figures(FigureChecks, unittest.TestCase):
    def play(self, rotation_deg, duration, seed, *sets):
        out = os.path.join(runs.scratch(), "run")
        summary = runs.run("scenarios/day_generator.json", out, *sets, duration=duration,
                           seed=seed)["summary"]
        frames = figures.Frames(runs.database(out), figures.Orbit(CATALOGUE, GX5, EPOCH), GX5,
                                rotation_deg)
        # 10 m at the distance of the belt: precession and nutation of another model
        self.assertLess(frames.disagreement, 0.1 * figures.ARCSEC)
        mine, unclear = figures.judge(frames)
        self.assertEqual(unclear, 0)
        self.nees = figures.nees(frames)
        return out, summary, mine

    def test_rough(self):
        out, summary, mine = self.play(37, 3200, 7, *ROUGH)
        print("rough:", mine)
        # the scene is worth it: lost more than once, the axes far apart
        self.assertGreater(mine["breaks"], 2)
        self.assertLess(mine["custody"], 0.8)
        self.assertGreater(mine["pointing_max_px"], 5)
        self.compare(mine, summary)
        page = self.read_page(out)
        self.check_page(page, mine, summary)
        # shares per interval, not solid bars: in most of the time there is an attitude in some
        # frames and none in others
        line = [part for part in page.root.iter("svg")
                if part.get("aria-label", "").startswith("Timeline of the mode")][0]
        shares = [re.search(r"attitude: ([\d.]+) % of (\d+) frames", title.text)
                  for title in line.iter("title") if title.text.startswith("attitude: ")]
        shares = [(float(m[1]) / 100, int(m[2])) for m in shares if m]
        self.assertGreater(len(shares), 3)
        self.assertTrue(all(0 < share < 1 for share, _ in shares))
        self.check_minutes(out, page)
        # without its summary, as of a run that was killed, the page comes to the same
        os.remove(out + "/report.html")
        with open(out + "/manifest.json", encoding="utf-8") as file:
            manifest = json.load(file)
        del manifest["summary"]
        with open(out + "/manifest.json", "w", encoding="utf-8") as file:
            json.dump(manifest, file)
        cards = self.read_page(out).cards()
        self.near(cards["custody"], 100 * mine["custody"], 4)
        self.near(cards["time to acquire"], mine["time_to_acquire_s"], 4)
        self.near(cards["pointing RMS"], mine["pointing_rms_px"])

    def check_minutes(self, out, page):
        """Bars and curves of a page whose axis is in minutes: where they are, and what their titles say in seconds."""
        svg = {part.get("aria-label"): part for part in page.root.iter("svg") if part.get("aria-label")}
        modes = next(part for label, part in svg.items() if label.startswith("Timeline of the mode"))
        axis, seen = Chart(modes), []
        for bar in modes.iter("rect"):
            found = bar.find("title") is not None and re.match(
                r"([a-z]+): (?:[\d.]+ % of \d+ frames from )?([\d.e+]+) s to ([\d.e+]+) s$", bar.find("title").text)
            if found:
                seen.append((found[1], float(found[2]), float(found[3])))
                for k in (0, 1):
                    end = 60 * axis.value("x", float(bar.get("x")) + k * float(bar.get("width")))
                    self.assertLess(abs(end - seen[-1][1 + k]), 1.0, found[0])
        with runs.database(out) as tables:
            changes = [(row["time_s"], row["text"].split(" -> ")[1].split(":")[0]) for row in
                       tables.execute("SELECT time_s, text FROM events WHERE kind = 'mode' ORDER BY time_s")]
            first, last = tables.execute("SELECT min(mid_s), max(mid_s) FROM exposures").fetchone()
        checked = 0
        for (start, mode), (end, _) in zip(changes, changes[1:]):
            if end - start > 15:  # shorter ones are less than a few px wide
                checked += 1
                self.assertTrue(any(word == mode and abs(a - start) < 0.2 and abs(b - end) < 0.2 for word, a, b in seen),
                                (mode, start, end, seen))
        self.assertGreater(checked, 2)
        axis = Chart(next(part for label, part in svg.items() if label.startswith("Detections per frame")))
        places = [60 * axis.value("x", x) for x, _ in axis.lines["c0"]]
        self.assertLess(abs(places[0] - first), 2.0)
        self.assertLess(abs(places[-1] - last), 5.0)

    def test_clean(self):
        out, summary, mine = self.play(-110, 240, 3, *CLEAN)
        print("clean:", mine)
        self.assertEqual(mine["breaks"], 0)
        self.assertLess(mine["time_to_confirm_s"], mine["time_to_acquire_s"])
        self.compare(mine, summary)
        page = self.read_page(out)
        self.check_page(page, mine, summary)
        found = re.search(r"In the (\d+) frames that gave it a detection: mean ([\d.]+), median "
                          r"([\d.]+) \(1.39\), (\d+) % between", page.text)
        self.assertEqual(int(found[1]), len(self.nees))
        self.near(found[2], self.nees.mean())
        self.near(found[3], sorted(self.nees)[math.ceil(0.5 * len(self.nees)) - 1])
        inside = ((self.nees >= -2 * math.log(0.975)) & (self.nees <= -2 * math.log(0.025))).mean()
        self.assertLessEqual(abs(int(found[4]) - 100 * inside), 0.51)


class Losses(unittest.TestCase):
    """What a run lost: in the tables, in the manifest, at the end of `run` and on the page."""

    def test_crowded(self):
        out = os.path.join(runs.scratch(), "run")
        done = subprocess.run(
            runs.command("scenarios/crowded_geo_track.json", out, runs.NO_FRAMES,
                         runs.SENSOR + "/modules/imgproc/capacity=200",
                         runs.SENSOR + "/modules/scenegen/truth_capacity=300", duration=12),
            capture_output=True, text=True, timeout=300)
        self.assertEqual(done.returncode, 0, done.stderr)
        with runs.database(out) as tables:
            def sums(what, table):
                return tuple(tables.execute(f"SELECT {what} FROM {table}").fetchone())
            frames, = sums("count(*)", "exposures")
            cut, cut_frames = sums("sum(lost), sum(lost > 0)", "detection_frames")
            truth, truth_frames = sums("sum(lost), sum(lost > 0)", "exposures")
            blind, = sums("sum(stars_identified = 0)", "detection_frames")
            lame, = sums("sum(attitude_valid = 0)", "track_frames")
        self.assertGreater(min(cut, truth, blind), 0)
        losses = runs.manifest(out)["losses"]["neossat/telescope"]
        self.assertEqual(losses, {"frames": frames, "detections": cut, "detection_frames": cut_frames,
                                  "truth": truth, "truth_frames": truth_frames,
                                  "no_attitude_frames": lame, "no_stars_frames": blind})
        lines = (f"cut to imgproc's capacity: {cut} detections in {cut_frames} of {frames} frames",
                 "cut to truth_capacity, labels are missing: "
                 f"{truth} sources of the truth in {truth_frames} of {frames} frames",
                 f"no star identified: {blind} of {frames} frames")
        self.assertEqual(subprocess.run([runs.BORESIGHT, "report", out],
                                        capture_output=True, timeout=120).returncode, 0)
        page = Page(out + "/report.html")
        for line in lines:
            self.assertIn(line + "\n", done.stdout)
            self.assertTrue(any(line + "." in warning for warning in page.warnings()), line)

    def test_nothing_lost(self):
        out = os.path.join(runs.scratch(), "run")
        done = subprocess.run(runs.command("scenarios/day_generator.json", out, duration=60),
                              capture_output=True, text=True, timeout=300)
        self.assertNotIn("losses", done.stdout)
        self.assertEqual(runs.manifest(out)["losses"], {"neossat/telescope": {"frames": 30}})


def tearDownModule():
    runs.clean()


if __name__ == "__main__":
    unittest.main()
