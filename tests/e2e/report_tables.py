"""What the page of a run draws and says, against numbers of our own: each curve of each chart at each frame, histograms,
captions and marks of the pictures, the figures of all tracks. For a SkewedRun."""
import itertools
import re

import erfa
import numpy as np

import figures
import optics
import runs
from optics import ARCSEC, angle, columns, unit
from skewed_scene import DURATION_S, NORAD, SUN_V_MAG, TICKS, WINDOW
from test_report import Page

EARTH_RADIUS_M, CUTOFF_PX, HISTORY = 6378137.0, 5.0, 10


class Chart:
    """An SVG chart read back: its axes by their ticks, its lines and bars by colour."""

    def __init__(self, svg):
        self.ticks, self.lines, self.bars, self.log = {"x": [], "y": []}, {}, [], False
        parts = list(svg)
        for path, text in zip(parts, parts[1:]):
            if path.get("class") == "g":
                x, y, way = re.match(r"M([\d.]+) ([\d.]+)([VH])", path.get("d")).groups()
                self.ticks["x" if way == "V" else "y"].append((float(x if way == "V" else y), float(text.text)))
        values = [v for _, v in self.ticks["y"]]
        self.log = len(values) > 2 and not np.allclose(np.diff(values), values[1] - values[0])
        for part in parts:
            if part.tag == "rect" and part.get("class", "").startswith("h "):
                self.bars.append([float(part.get(k)) for k in ("x", "width", "height")])
            if part.tag == "svg":
                for path in part.iter("path"):
                    origin = float(part.get("x")), float(part.get("y"))
                    colour = re.search(r"\bc\d+\b", path.get("class")).group()
                    self.lines.setdefault(colour, []).extend(self.points(path.get("d"), *origin))

    @staticmethod
    def points(d, x0, y0):
        found, at = [], np.zeros(2)
        for start, rest in re.findall(r"M([^lhM]*)([lh]?[^M]*)", d):
            at = np.array(start.split(), float)
            found.append(at)
            if rest.startswith("l"):
                for step in np.array(rest[1:].split(), float).reshape(-1, 2)[1:]:
                    at = at + step
                    found.append(at)
        return [(x0 + p[0] / 10, y0 + p[1] / 10) for p in found]

    def place(self, axis, values):
        """Where a value belongs, px, by the line through the first and the last tick."""
        (a, first), (b, last) = self.ticks[axis][0], self.ticks[axis][-1]
        scale = np.log10 if self.log and axis == "y" else np.asarray
        return a + (b - a) * (scale(values) - scale(first)) / (scale(last) - scale(first))

    def value(self, axis, px):
        (a, first), (b, last) = self.ticks[axis][0], self.ticks[axis][-1]
        return first + (last - first) * (px - a) / (b - a)


class ReportTables:
    @classmethod
    def drawn(cls):
        """The page, and its charts by the beginning of their names."""
        if "page" not in cls.__dict__:
            assert runs.call("report", cls.out).returncode == 0
            cls.page = Page(cls.out + "/report.html")
            cls.svg = {svg.get("aria-label"): svg for svg in cls.page.root.iter("svg") if svg.get("aria-label")}
            cls.frames = figures.Frames(cls.db, cls.target, NORAD, cls.scene["observers"][0]["sensors"][0]["camera"]["rotation_deg"])
            cls.judged, _ = figures.judge(cls.frames)
        return cls.page

    def chart(self, name):
        self.drawn()
        return Chart(next(svg for label, svg in self.svg.items() if label.startswith(name)))

    def check_line(self, chart, colour, x, y, tolerance=0.4):
        """All points of a line, in px of the page; the ticks are rounded to 0.1 px. Points beyond the chart are cut off."""
        x, y = np.asarray(x, float), np.asarray(y, float)
        points = np.array(chart.lines.get(colour, [])).reshape(-1, 2)
        self.assertEqual(len(points), len(x), colour)
        self.close(points[:, 0], chart.place("x", x), tolerance, colour)
        self.close(points[:, 1], chart.place("y", y), tolerance, colour)

    def geometry(self, e):
        """Range, phase and brightness of the target, its apparent direction."""
        direction, there, _ = self.seen_from(e, self.target.position, e["mid_s"])
        here = columns(e, "observer_gcrf", tail="_m")
        sun = columns(e, "sun", tail="_m") + here - there
        phase, au, far = angle(sun, here - there), np.linalg.norm(sun) / optics.AU_M, np.linalg.norm(there - here)
        ratio = 2 * 4 * 0.25 * ((np.pi - phase) * np.cos(phase) + np.sin(phase)) / (3 * np.pi ** 2 * far ** 2 * au ** 2)
        return far, np.degrees(phase), SUN_V_MAG - 2.5 * np.log10(ratio), optics.apparent(e, direction)

    def pointing(self):
        """Time and error of the frames that count."""
        settled = self.judged["time_to_settle_s"]
        kept = [f for f in self.frames.list if f["visible"] and f["start"] >= settled and f["mode"] == "track"]
        self.assertEqual(len(kept), self.judged["pointing_frames"])
        return [f["mid"] for f in kept], np.array([f["error"] for f in kept])

    def of_interest(self):
        """(frame, its track of interest)"""
        return [(f, t) for f in self.frames.list for t in f["tracks"] if t["target_of_interest"]]

    def test_page_pointing_and_track(self):
        chart = self.chart("Distance from the boresight to the true target")
        self.assertTrue(chart.log)
        self.check_line(chart, "c0", [f["mid"] for f in self.frames.list], [f["size"] for f in self.frames.list])
        times, errors = self.pointing()
        # errors beyond 4 times the 95th percentile would be cut off: there are none here
        chart = self.chart("Pointing error along")
        self.check_line(chart, "c0", times, errors[:, 0])
        self.check_line(chart, "c1", times, errors[:, 1])
        for k, name in enumerate("xy"):
            bars = self.chart(f"pointing error in {name}")
            counted = 0
            for x, width, height in bars.bars:
                low, high = bars.value("x", x), bars.value("x", x + width)
                number = round(abs(bars.value("y", 190 - height) - bars.value("y", 190)))
                inside = np.sum((errors[:, k] > low + 0.002) & (errors[:, k] < high - 0.002))
                about = np.sum((errors[:, k] > low - 0.002) & (errors[:, k] < high + 0.002))
                self.assertTrue(inside <= number <= about, (low, high, number))
                counted += number
            self.assertEqual(counted, len(errors))
            # the curve: as many frames as there are, about the median, as wide as the inner 68 %
            curve = np.array(bars.lines["c3"])
            at = np.array([bars.value("x", x) for x in curve[:, 0]])
            high = np.array([bars.value("y", y) for y in curve[:, 1]])
            area = np.sum((high[1:] + high[:-1]) / 2 * np.diff(at))
            self.assertAlmostEqual(area / (len(errors) * (bars.value("x", width) - bars.value("x", 0))), 1, delta=0.03)
            mean = np.sum(high * at) / np.sum(high)
            self.assertAlmostEqual(mean, np.median(errors[:, k]), delta=0.02)
            # percentiles of a few dozen frames: between those of the ranks on both sides
            low, high_rank = (np.percentile(errors[:, k], [15.87, 84.13], method=way) for way in ("lower", "higher"))
            width = np.sqrt(np.sum(high * (at - mean) ** 2) / np.sum(high))
            self.assertGreater(width, 0.95 * (low[1] - high_rank[0]) / 2)
            self.assertLess(width, 1.05 * (high_rank[1] - low[0]) / 2)
            mean, rms = errors[:, k].mean(), np.sqrt(np.mean(errors[:, k] ** 2))
            found = re.findall(r"Mean (-?[\d.]+) px, RMS ([\d.]+) px; the curve is normal", self.page.text)[k]
            self.close(np.array(found, float), [mean, rms], 0.00051)
        pairs = self.of_interest()
        times, off, sigma, nees = [], [], [], []
        for f, t in pairs:
            axes = self.tangent(t)
            error = axes @ (figures.track_direction(t, f["mid"]) - f["direction"])
            own = self.covariance(t)[:2, :2]
            times.append(f["mid"])
            off.append(np.linalg.norm(error) / ARCSEC)
            sigma.append(np.sqrt(np.trace(own)) / ARCSEC)
            nees.append(error @ np.linalg.solve(own, error))
        chart = self.chart("Error of the track of interest")
        self.check_line(chart, "c0", times, off)
        self.check_line(chart, "c3", times, sigma)
        self.check_line(self.chart("Normalised error squared"), "c0", times, nees)
        # of those with a detection, the curve is chi-square with 2 degrees of freedom
        bars, own = self.chart("NEES of the track"), sum(t["last_update_tick"] == t["tick"] for _, t in pairs)
        curve, width = np.array(bars.lines["c3"]), bars.value("x", bars.bars[0][1]) - bars.value("x", 0)
        self.check_line(bars, "c3", [bars.value("x", x) for x in curve[:, 0]],
                        [own * width * 0.5 * np.exp(-0.5 * bars.value("x", x)) for x in curve[:, 0]], 1.5)

    def test_page_light_and_sky(self):
        frames, in_field = self.frames.list, [f for f in self.frames.list if f["field"]]
        chart = self.chart("Signal-to-noise ratio")
        self.check_line(chart, "c0", [f["mid"] for f in in_field], [f["field"]["snr"] for f in in_field])
        seen = [(f["mid"], t["snr"]) for f, t in self.of_interest() if t["last_update_tick"] == t["tick"]]
        self.check_line(chart, "c1", *zip(*seen))
        chart, rows = self.chart("Detections per frame"), self.tables["detection_frames"]
        times = [row["mid_s"] for row in rows]
        found, stars = (np.array([row[c] for row in rows]) for c in ("detections", "stars_identified"))
        for colour, values in (("c0", found), ("c2", stars), ("c1", found - stars)):
            self.check_line(chart, colour, times, values)
        said = re.search(r"Detections per frame: ([\d.]+) on average, of which ([\d.]+) are identified as stars and ([\d.]+) are",
                         self.page.text).groups()
        for word, value in zip(said, (found.mean(), stars.mean(), (found - stars).mean())):
            self.assertAlmostEqual(float(word) / value, 1, delta=0.0051)
        times = [f["mid"] for f in frames]
        seen = [self.geometry(e) for e in self.exposures]
        look = [unit(e["boresight_ra_deg"], e["boresight_dec_deg"]) for e in self.exposures]
        here = [columns(e, "observer_gcrf", tail="_m") for e in self.exposures]
        limb = [np.degrees(angle(a, -b) - np.arcsin(EARTH_RADIUS_M / np.linalg.norm(b))) for a, b in zip(look, here)]
        sun = [np.degrees(angle(a, columns(e, "sun", tail="_m"))) for a, e in zip(look, self.exposures)]
        for name, values in (("Distance of the target", [s[0] / 1e3 for s in seen]), ("Angle Sun - target", [s[1] for s in seen]),
                             ("Angle from the boresight to the Sun", sun), ("Angle from the boresight to the Earth", limb)):
            self.check_line(self.chart(name), "c0", times, values, 0.6)
        # 0.001 mag is some px
        chart = self.chart("Brightness of the target")
        (a, first), (b, last) = chart.ticks["y"][0], chart.ticks["y"][-1]
        self.check_line(chart, "c0", times, [s[2] for s in seen], 0.002 * abs((b - a) / (last - first)))
        chart = self.chart("Paths of the boresight")
        for colour, path in (("c1", look), ("c0", [s[3] for s in seen])):
            found = np.array(chart.lines[colour])
            for v in path:
                ra, dec = np.degrees(np.arctan2(v[1], v[0])), np.degrees(np.arcsin(v[2]))
                places = [np.hypot(found[:, 0] - chart.place("x", ra + turn), found[:, 1] - chart.place("y", dec))
                          for turn in (-360, 0, 360)]
                # neighbours that are closer than a dot are drawn once
                self.assertLess(np.min(places), 2.5, colour)
        chart = self.chart("Path of the observer")
        found = np.array(chart.lines["c2"])
        for e, place in zip(self.exposures, here):
            utc = self.eye.utc[0], self.eye.utc[1] + e["mid_s"] / 86400
            to_itrf = erfa.c2t06a(*erfa.taitt(*erfa.utctai(*utc)), *utc, 0.0, 0.0)  # UT1 is within 0.004 degrees of UTC
            longitude, latitude, _ = erfa.gc2gd(1, to_itrf @ place)
            self.assertLess(np.min(np.hypot(found[:, 0] - chart.place("x", np.degrees(longitude)),
                                            found[:, 1] - chart.place("y", np.degrees(latitude)))), 2.5)

    def test_page_frames(self):
        """Captions and marks of the pictures."""
        self.drawn()
        checked = insets = 0
        for figure in self.page.root.iter("figure"):
            svg = next((s for s in figure.iter("svg") if (s.get("aria-label") or "").startswith("Picture of the frame")), None)
            if svg is None:
                continue
            k = int(re.match(r"Picture of the frame (\d+)", svg.get("aria-label"))[1])
            f, e = self.frames.list[k], self.exposures[k]
            words = [t.text for t in svg.iter("text") if t.get("class") is None]
            off, light, counts, state = words[0], next((w for w in words if w.startswith("SNR")), None), words[-2], words[-1]
            self.assertAlmostEqual(float(off.split()[0]) / f["size"], 1, delta=0.0051)
            own = [t for t in f["tracks"] if t["target_of_interest"]]
            if f["field"]:
                said = [float(x) for x in re.findall(r"[\d.]+", light)]
                self.assertAlmostEqual(said[0] / f["field"]["snr"], 1, delta=0.0051)
                if own and own[0]["last_update_tick"] == own[0]["tick"]:
                    self.assertAlmostEqual(said[1] / own[0]["snr"], 1, delta=0.0051)
            row = self.tables["detection_frames"][k]
            self.assertEqual([int(x) for x in re.findall(r"\d+", counts)], [row["detections"], row["stars_identified"]])
            self.assertEqual(state, "in track" if own else "not in track")
            self.assertIn(f"mode: {f['mode']}", svg.get("aria-label"))
            # marks: pixel (0, 0) has its centre at (0.5, 0.5) of the picture
            whole = next(s for s in svg.iter("svg") if s.get("x") == "0.0")
            scale = float(whole.get("width")) / WINDOW[2]
            self.assertAlmostEqual(float(whole.get("height")), scale * WINDOW[3], delta=0.11)
            drawn = np.array([(float(c.get("cx")), float(c.get("cy"))) for c in whole.iter("circle")]).reshape(-1, 2)
            places = np.array([((d["x_px"] - WINDOW[0] + 0.5) * scale, (d["y_px"] - WINDOW[1] + 0.5) * scale)
                               for d in self.in_frame["detections"][k]]).reshape(-1, 2)
            self.assertEqual(len(drawn), len(places))
            for place in places:
                self.assertLess(np.min(np.hypot(*(drawn - place).T)), 0.08)
                checked += 1
            squares = [np.array(re.match(r"M([\d.-]+) ([\d.-]+)h", p.get("d")).groups(), float) + 7 for p in whole.iter("path")
                       if re.match(r"M[\d.-]+ [\d.-]+h", p.get("d"))]
            objects = [r for r in self.in_frame["truth"][k] if r["kind"] == "object" and r["in_field"]]
            self.assertEqual(len(squares), len(objects))
            for r in objects:
                place = [(r["x_centroid_px"] - WINDOW[0] + 0.5) * scale, (r["y_centroid_px"] - WINDOW[1] + 0.5) * scale]
                self.assertLess(min(np.hypot(*(s - place)) for s in squares), 0.12)
            # the cross of the boresight, by the ends of its four arms
            arms = next(p.get("d") for p in whole.iter("path") if p.get("stroke") == "#ec80ff")
            x0, y0, x1, x2, x3, x4, y1, y2, y3, y4 = (float(v) for v in re.match(
                r"M([\d.-]+) ([\d.-]+)H([\d.-]+)M([\d.-]+) [\d.-]+H([\d.-]+)M([\d.-]+) ([\d.-]+)V([\d.-]+)M[\d.-]+ ([\d.-]+)V([\d.-]+)",
                arms).groups())
            middle = [(e["boresight_x_px"] - WINDOW[0] + 0.5) * scale, (e["boresight_y_px"] - WINDOW[1] + 0.5) * scale]
            self.close([(x0 + x3) / 2, y0, (x1 + x2) / 2, x4, (y1 + y4) / 2, (y2 + y3) / 2],
                       [middle[0], middle[1], middle[0], middle[0], middle[1], middle[1]], 0.11)
            # the part about the target that is drawn larger, and where it is of the whole
            frame = next(r for r in svg.iter("rect") if r.get("stroke-dasharray"))
            x, y, side = (float(frame.get(name)) for name in ("x", "y", "width"))
            inset = next(s for s in svg.iter("svg") if s.get("x") == "360.0")
            for p in inset.iter("path"):
                if p.get("stroke") == "#ff5c5c":
                    corner, edge = re.match(r"M([\d.-]+) ([\d.-]+)h([\d.]+)", p.get("d")).groups()[:2], float(p.get("d").split("h")[1].split("v")[0])
                    found = np.array(corner, float) + edge / 2
                    target = next(r for r in objects if r["norad"] == NORAD)
                    place = np.array([target["x_centroid_px"] - WINDOW[0], target["y_centroid_px"] - WINDOW[1]]) + 0.5
                    self.close(found, (place * scale - [x, y]) * float(inset.get("width")) / side, 0.7)
                    # within a pixel of 48 of the middle
                    self.close(found, float(inset.get("width")) / 2, 1.1 * float(inset.get("width")) / 48)
                    insets += 1
        self.assertGreater(checked, 30)
        self.assertGreater(insets, 2)

    def test_page_sightings(self):
        """The rows of objects, against the table, which test_passes_and_sightings works out again."""
        self.drawn()
        table = next(t for t in self.page.root.iter("table") if "NORAD" in "".join(t.itertext()))
        rows = [["".join(cell.itertext()).strip() for cell in row] for row in table.iter("tr")]
        for s in [s for s in self.tables["sightings"] if s["sensor"] is None]:
            row = next(r for r in rows if r[0] == s["name"])
            self.assertEqual(row[1:5], [str(s[c]) for c in ("norad", "passes_seen", "detected", "tracked")])
            for cell, value in zip((row[5], row[7], row[8], row[9]),
                                   (100 * s["custody_fraction"], s["longest_gap_s"], s["place_rms_arcsec"], s["track_rms_arcsec"])):
                self.assertAlmostEqual(float(cell) / value, 1, delta=0.0051)

    def bars(self, name):
        """Title of each bar of a timeline, and the times of its ends by the axis."""
        svg = next(svg for label, svg in self.svg.items() if label.startswith(name))
        chart = Chart(svg)
        return {r.find("title").text: [chart.value("x", float(r.get("x")) + k * float(r.get("width"))) for k in (0, 1)]
                for r in svg.iter("rect") if r.find("title") is not None}

    def test_page_timelines(self):
        self.drawn()
        bars, frames, last = self.bars("Timeline of the mode"), self.frames.list, float(DURATION_S)
        changes = [(row["time_s"], row["text"].split(" -> ")[1].split(":")[0]) for row in self.tables["events"]
                   if row["kind"] == "mode"] + [(last, None)]
        spans = [(mode, a, b) for (a, mode), (b, _) in zip(changes, changes[1:])]
        fixes = {row["exposure_id"]: row["attitude_valid"] for row in self.tables["track_frames"]}
        lanes = (("visible", lambda f: f["visible"]), ("in the field", lambda f: f["field"]),
                 ("in track", lambda f: any(t["target_of_interest"] for t in f["tracks"])),
                 ("attitude", lambda f: fixes.get(f["number"])))
        for word, holds in lanes:  # each from one frame on to the end, in this scene
            first = next(f for f in frames if holds(f))
            self.assertTrue(all(holds(f) for f in frames[first["number"]:]), word)
            spans.append((word, first["mid"], last))
        self.assertEqual(len(bars), len(spans))
        for word, start, end in spans:
            self.close(bars[f"{word}: {start:.6g} s to {end:.6g} s"], [start, end], 0.01, word)
        bars = self.bars("Timeline of the objects' passes")
        for row in self.tables["passes"]:
            title = (f"neossat/telescope: {row['start_s']:.6g} s to {row['end_s']:.6g} s, "
                     f"detected in {row['detected']} of {row['frames']} frames")
            self.close(bars[title], [row["start_s"], row["end_s"]], 0.01)
        # steps where an object is first seen
        chart, firsts = self.chart("Number of objects seen so far"), sorted(s["first_s"] for s in self.tables["sightings"]
                                                                            if s["sensor"] is None)
        points = np.array(chart.lines["c0"])
        for k, first in enumerate(firsts):
            self.assertLess(np.min(np.hypot(points[:, 0] - chart.place("x", first), points[:, 1] - chart.place("y", k + 1))),
                            0.3 if firsts.count(first) == 1 or k + 1 == len(firsts) else 1e9)
        self.close(points[-1], [chart.place("x", last), chart.place("y", len(firsts))], 0.3)

    # ---------------------------------------------------------------- columns that nothing else compares

    def test_identities(self):
        """Of each track, the object that it follows in truth; probabilities of one track sum to 1 or less."""
        rows, sums = self.tables["track_identities"], {}
        for row in rows:
            k, e = row["exposure_id"], self.exposures[row["exposure_id"]]
            self.assertEqual((row["tick"], row["time_s"]), (round(e["mid_s"] * TICKS), e["mid_s"]))
            track = next(t for t in self.in_frame["tracks"][k] if t["track_id"] == row["track_id"])
            self.assertNotEqual(track["status"], "tentative")
            objects = [r for r in self.in_frame["truth"][k] if r["kind"] == "object"]
            near = min(objects, key=lambda r: angle(unit(r["ra_deg"], r["dec_deg"]), unit(track["ra_deg"], track["dec_deg"])))
            # NEIGHBOUR's second place is in the streak of a star (chi-square 13), of which a track of three places has a third
            if row["probability"] > 0.5 and track["hits"] > 3:
                self.assertEqual((row["object"], row["name"], row["norad"]),
                                 (near["id"], ("INMARSAT GX5", "NEIGHBOUR")[near["id"]], near["norad"]))
            sums.setdefault((k, row["track_id"]), []).append(row["probability"])
        self.assertTrue(sums)
        for of_track in sums.values():
            self.assertTrue(0.99 < sum(of_track) <= 1 + 1e-9, of_track)
            self.assertGreater(max(of_track), 0.5)

    def test_attitude_error(self):
        """Telemetry's error about the camera's axes: from the attitude that it gave to the one by stars."""
        checked = 0
        for row, fix in zip(self.tables["detection_frames"], self.tables["track_frames"]):
            if fix["attitude_valid"]:
                turn = optics.turn_between(optics.quaternion(fix, "attitude_q_cam_from_gcrf"),
                                           optics.quaternion(row, "q_telemetry_from_gcrf")) / ARCSEC
                found = columns(fix, "attitude_error", tail="_arcsec")
                self.close(found, turn, 1e-3 + 1e-4 * np.abs(turn).max(), row["exposure_id"])
                self.assertTrue(0 <= fix["attitude_shared"] <= 1)
                checked += np.abs(turn).min() > 0.05
        self.assertGreater(checked, 10)

    # ---------------------------------------------------------------- all tracks against all objects

    def test_all_tracks(self):
        """GOSPA, OSPA(2), purity and changes of identity by trying all assignments: docs/reference/summary.md."""
        self.drawn()
        histories, gospa, ospa, pairs = [], [], [], []
        for f, e in zip(self.frames.list, self.exposures):
            if f["done"] is None:
                continue
            k, px = e["exposure_id"], e["pixel_scale_arcsec"] * ARCSEC
            threshold = self.tables["detection_frames"][k]["threshold_snr"]
            objects = {r["id"]: unit(r["ra_deg"], r["dec_deg"]) for r in self.in_frame["truth"][k]
                       if r["kind"] == "object" and r["in_field"] and not r["occulted"] and r["snr"] >= threshold}
            tracks = {t["track_id"]: figures.track_direction(t, f["mid"]) for t in f["tracks"]}
            if not objects and not tracks:
                continue

            def apart(a, b):
                return min(angle(a, b) / px, CUTOFF_PX)
            best, chosen = min(((sum(apart(objects[o], tracks[t]) ** 2 - CUTOFF_PX ** 2 for o, t in one), one)
                                for one in self.assignments(list(objects), list(tracks))), key=lambda x: x[0])
            gospa.append(np.sqrt(best + CUTOFF_PX ** 2 / 2 * (len(objects) + len(tracks))))
            pairs.append([(o, t) for o, t in chosen if apart(objects[o], tracks[t]) < CUTOFF_PX])
            histories = (histories + [(objects, tracks, px)])[-HISTORY:]
            every_o, every_t = (sorted(set().union(*(h[i] for h in histories))) for i in (0, 1))

            def between(o, t):
                parts = [min(angle(h[0][o], h[1][t]) / h[2], CUTOFF_PX) if o in h[0] and t in h[1] else CUTOFF_PX
                         for h in histories if o in h[0] or t in h[1]]
                return np.mean(parts)
            base = {(o, t): between(o, t) for o in every_o for t in every_t}
            most = max(len(every_o), len(every_t))
            least = min(sum(base[p] ** 2 - CUTOFF_PX ** 2 for p in one) for one in self.assignments(every_o, every_t))
            ospa.append(np.sqrt((least + CUTOFF_PX ** 2 * most) / most))
        summary = self.manifest["summary"]
        self.assertEqual(summary["scored_frames"], len(gospa))
        print("GOSPA", np.mean(gospa), "of", summary["gospa_px"], "OSPA(2)", np.mean(ospa), "of", summary["ospa2_px"])
        self.assertAlmostEqual(summary["gospa_px"], np.mean(gospa), delta=1e-6)
        self.assertAlmostEqual(summary["ospa2_px"], np.mean(ospa), delta=1e-6)
        every = [p for frame in pairs for p in frame]
        own = {t: max({o for o, x in every if x == t}, key=lambda o, t=t: every.count((o, t))) for _, t in every}
        self.assertAlmostEqual(summary["track_purity"], np.mean([own[t] == o for o, t in every]), delta=1e-12)
        switches, latest = 0, {}
        for o, t in every:
            switches += latest.get(o, t) != t
            latest[o] = t
        self.assertEqual(summary["id_switches"], switches)

    @staticmethod
    def assignments(a, b):
        """All sets of pairs, each of a and of b at most once, of the largest size."""
        if len(a) > len(b):
            return [[(x, y) for y, x in one] for one in ReportTables.assignments(b, a)]
        return [list(zip(a, order)) for order in itertools.permutations(b, len(a))]
