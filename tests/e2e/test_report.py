#!/usr/bin/env python3
"""boresight report: pages of complete, killed and damaged runs, against the runs' own tables.

Usage, from the repository root: /usr/bin/python3 tests/e2e/test_report.py BORESIGHT
"""
import base64
import json
import math
import os
import re
import shutil
import signal
import sqlite3
import struct
import subprocess
import time
import unittest
import xml.etree.ElementTree as tree
import zlib
from html.parser import HTMLParser

import numpy as np

import runs

VOID = {"meta", "br", "hr", "img", "input", "link", "col", "path", "rect", "circle", "image"}
CHARTS = ["Timeline of the mode of control", "Distance from the boresight to the true target",
          "Pointing error along the sensor's columns and rows",
          "Error of the track of interest and its own sigma",
          "Normalised error squared of the track of interest",
          "Signal-to-noise ratio of the target over time", "Detections per frame",
          "pointing error in x, px", "pointing error in y, px",
          "Paths of the boresight and of the target", "Path of the observer's sub-satellite point",
          "Distance of the target from the observer.", "Angle Sun - target - observer.",
          "Brightness of the target", "Angle from the boresight to the Sun.",
          "Angle from the boresight to the Earth's limb"]


def report(run, *words):
    return runs.call("report", run, *words)


class Page(HTMLParser):
    """A page as a browser's parser reads it: every element is closed where it has to be."""

    def __init__(self, path):
        super().__init__(convert_charrefs=True)
        with open(path, "rb") as file:
            self.bytes = file.read()
        self.source = self.bytes.decode("utf-8")
        self.stack, self.elements, self.words = [], [], []
        self.feed(self.source)
        self.close()
        assert not self.stack, f"not closed: {self.stack}"
        # the page is well-formed XML as well: a stricter check of the same
        self.root = tree.fromstring(self.source.replace("<!DOCTYPE html>", ""))
        self.text = " ".join("".join(self.root.find("body").itertext()).split())

    def handle_starttag(self, tag, attrs):
        self.elements.append((tag, dict(attrs)))
        if tag not in VOID or not self.get_starttag_text().endswith("/>"):
            if tag not in ("meta",):
                self.stack.append(tag)

    def handle_startendtag(self, tag, attrs):
        self.elements.append((tag, dict(attrs)))

    def handle_endtag(self, tag):
        assert self.stack and self.stack[-1] == tag, f"</{tag}> after {self.stack[-3:]}"
        self.stack.pop()

    def charts(self):
        return [a["aria-label"] for tag, a in self.elements
                if tag == "svg" and a.get("role") == "img"]

    def cards(self):
        """Name of each card to its figure."""
        out = {}
        for card in self.root.iter("div"):
            if card.get("class") == "card":
                out.setdefault(card.find("small").text, card.find("b").text)
        return out

    def notes(self):
        """Name of each card to the numbers in its note."""
        out = {}
        for card in self.root.iter("div"):
            if card.get("class") == "card" and len(card.findall("small")) == 2:
                first, note = card.findall("small")
                out.setdefault(first.text, [float(word) for word in re.findall(r"[\d.]*\d", note.text)])
        return out

    def pictures(self):
        return [base64.b64decode(a["href"].split(",", 1)[1], validate=True)
                for tag, a in self.elements if tag == "image"]

    def warnings(self):
        return ["".join(item.itertext()) for part in self.root.iter("ul")
                if part.get("class") == "warnings" for item in part]


class OnePage(unittest.TestCase):
    def check_alone(self, page):
        """Nothing is fetched; nothing runs but the modules of the charts, which fetch nothing."""
        policy = [a["content"] for tag, a in page.elements if a.get("http-equiv")]
        nonce = re.search("script-src 'nonce-([0-9a-f]{64})' 'strict-dynamic';", policy[0]).group(1)
        self.assertTrue(len(policy) == 1 and policy[0].startswith("default-src 'none'; "))
        self.assertEqual([a for tag, a in page.elements if tag in ("script", "style")],
                         [{"nonce": nonce}, {"type": "importmap", "nonce": nonce}, {"type": "module", "nonce": nonce}])
        imports = json.loads(next(part.text for part in page.root.iter("script")))["imports"]
        self.assertEqual(sorted(imports), ["boresight/chart.js", "boresight/report_charts.js"])
        for name, address in imports.items():
            with open("view/page/" + name.split("/")[1], "rb") as file:
                module = file.read().replace(b"'./", b"'boresight/")
            self.assertEqual(base64.b64decode(address.split("base64,")[1], validate=True), module)
            self.assertNotRegex(module, rb"https?://(?!www\.w3\.org)|\b(fetch|eval|XMLHttpRequest|WebSocket|innerHTML)\b")
        for tag, attributes in page.elements:
            self.assertNotIn(tag, ("link", "iframe", "object", "embed", "base", "form"))
            self.assertNotIn("style", attributes)
            for key, value in attributes.items():
                self.assertFalse(key.startswith("on"), key)
                if key in ("src", "href", "xlink:href", "data", "action"):
                    self.assertTrue(value.startswith("data:image/png;base64,"), value[:80])
        self.assertNotRegex(page.source, r"https?://|@import|url\(")
        self.assertTrue(all(label.strip() for label in page.charts()))
        self.assertNotRegex(re.sub(r"base64,[^\"]*", "", page.source), r"[\"> ,-](nan|inf)\b")


class Complete(OnePage):
    @classmethod
    def setUpClass(cls):
        cls.folder = runs.scratch()
        cls.made = os.path.join(cls.folder, "run")
        # the target is confirmed after some 22 s
        cls.manifest = runs.run(runs.TRACK, cls.made, duration=52, seed=1)
        result = report(cls.made)
        assert (result.returncode, result.stderr) == (0, ""), result.stderr
        assert result.stdout == cls.made + "/report.html\n"
        cls.page = Page(cls.made + "/report.html")

    def test_alone(self):
        self.check_alone(self.page)
        self.assertLess(len(self.page.bytes), 800_000)
        self.assertTrue(self.page.source.startswith("<!DOCTYPE html>\n<html lang=\"en\">"))
        self.assertIn("@media print", self.page.source)

    def test_charts(self):
        labels = self.page.charts()
        for name in CHARTS:
            self.assertEqual(sum(label.startswith(name) for label in labels), 1, name)

    def test_figures(self):
        summary, cards = self.manifest["summary"], self.page.cards()
        # as many digits as the cards show
        for name, value, digits in (
                ("custody", 100 * summary["custody"], 4),
                ("time to acquire", summary["time_to_acquire_s"], 4),
                ("pointing RMS", summary["pointing_rms_px"], 3),
                ("speed", summary["real_time_factor"], 3)):
            self.assertLessEqual(abs(float(cards[name]) - value),
                                 0.51 * 10 ** (math.floor(math.log10(value)) + 1 - digits), name)
        self.assertEqual(cards["exposures"], str(summary["frames"]))
        self.assertEqual(cards["mode at the end"], summary["final_mode"])
        with runs.database(self.made) as tables:
            detections, = tables.execute("SELECT sum(detections) FROM detection_frames").fetchone()
            events, = tables.execute("SELECT count(*) FROM events").fetchone()
            frames, = tables.execute("SELECT count(*) FROM detection_frames").fetchone()
        self.assertEqual(cards["detections"], str(detections))
        notes = self.page.notes()
        for name, values, digits in (
                ("custody", [100 * summary["track_fraction"]], 4),
                ("time to acquire", [summary["time_to_confirm_s"], summary["time_to_settle_s"]], 4),
                ("pointing RMS", [99, summary["pointing_p99_px"], summary["pointing_bias_px"]], 2),
                ("detections", [detections / frames], 3)):
            self.assertEqual(len(notes[name]), len(values), name)
            for found, value in zip(notes[name], values):
                self.assertLessEqual(abs(found - value), 0.51 * 10 ** (math.floor(math.log10(value)) + 1 - digits), name)
        self.assertIn(f"{events} events", self.page.text)

    def test_pointing(self):
        """The caption's RMS is that of the truth's places, where all conditions hold."""
        with runs.database(self.made) as tables:
            rows = tables.execute(
                "SELECT e.mid_s, t.x_mid_px - e.boresight_x_px, t.y_mid_px - e.boresight_y_px"
                " FROM truth t JOIN exposures e USING (sensor, exposure_id)"
                " WHERE t.kind = 'object' AND t.in_field = 1 AND e.mid_s >= ?",
                (self.manifest["summary"]["time_to_settle_s"],)).fetchall()
        rms = math.sqrt(sum(x * x + y * y for _, x, y in rows) / len(rows))
        found = re.search(r"In the (\d+) frames in mode track with the visible target, from settling "
                          r"on: RMS ([0-9.]+)", self.page.text)
        self.assertEqual(int(found[1]), len(rows))
        # three digits
        self.assertAlmostEqual(float(found[2]), rms, delta=0.006 * rms)

    def test_identity(self):
        for text in (self.manifest["git_revision"], self.manifest["device"], "seed 0x1, run 0",
                     "2022-06-16T22:10:00.000Z", "2022-06-16T22:10:52.000Z", "neossat/telescope",
                     "INMARSAT GX5", "idle -> slew: there is a cue"):
            self.assertIn(text, self.page.text.replace("seed0x1", "seed 0x1"))
        self.assertLess(self.page.source.index("Warnings</h2>"),
                        self.page.source.index("What was run</h2>"))

    def test_frames(self):
        pictures = self.page.pictures()
        self.assertEqual(len(pictures), 12)  # six frames and their insets
        sizes = [struct.unpack(">II", png[16:24]) for png in pictures]
        self.assertTrue(all(png.startswith(b"\x89PNG\r\n\x1a\n") for png in pictures))
        self.assertEqual(set(sizes), {(352, 352), (48, 48)})
        self.assertIn("frame 0 2022-06-16T22:10:00.250Z", self.page.text)

    def test_same_bytes(self):
        again = os.path.join(runs.scratch(), "again.html")
        self.assertEqual(report(self.made + "/", "--out", again).returncode, 0)
        with open(again, "rb") as file:
            self.assertEqual(file.read(), self.page.bytes)
        moved = os.path.join(runs.scratch(), "run")
        shutil.copytree(self.made, moved)
        self.assertEqual(report(moved, "--out", again).returncode, 0)
        with open(again, "rb") as file:
            self.assertEqual(file.read(), self.page.bytes)

    def test_damaged(self):
        folder = os.path.join(runs.scratch(), "run")
        shutil.copytree(self.made, folder)
        os.remove(folder + "/report.html")
        with open(folder + "/run.sqlite", "r+b") as file:
            size = os.path.getsize(folder + "/run.sqlite")
            file.seek(size // 3)
            file.write(b"\xA5" * (size // 3))
        result = report(folder)
        self.assertEqual(result.returncode, 1)
        self.assertIn("run.sqlite", result.stderr)
        page = Page(folder + "/report.html")
        self.check_alone(page)
        self.assertTrue(any("run.sqlite" in text for text in page.warnings()))

    def test_errors(self):
        folder = runs.scratch()
        for run, words, code, message in (
                (folder, (), 1, "is not the folder of a run"),
                (folder + "/none", (), 1, "No such file or directory"),
                (self.made, ("--out", folder + "/none/page.html"), 2, "there is no folder"),
                (self.made, ("--uot", "x"), 2, "--out"),
                (self.made, ("more",), 2, "one folder")):
            result = report(run, *words)
            self.assertEqual(result.returncode, code, result.stderr)
            self.assertIn(message, result.stderr)
            self.assertEqual(result.stdout, "")
        self.assertEqual(os.listdir(folder), [])
        help_text = report("--help")
        self.assertEqual(help_text.returncode, 0)
        self.assertIn("boresight report runs/demo", help_text.stdout)


def read_png(path):
    """Pixels of a PNG of 8-bit RGB whose rows are not filtered, as OpenCV writes it."""
    with open(path, "rb") as file:
        data = file.read()
    at, packed = 8, b""
    while at < len(data):
        length, kind = struct.unpack(">I4s", data[at:at + 8])
        if kind == b"IHDR":
            width, height = struct.unpack(">II", data[at + 8:at + 16])
        elif kind == b"IDAT":
            packed += data[at + 8:at + 8 + length]
        at += 12 + length
    rows = np.frombuffer(zlib.decompress(packed), np.uint8).reshape(height, 1 + 3 * width)
    assert not rows[:, 0].any(), "a filtered row"
    return rows[:, 1:].reshape(height, width, 3)


class Crowded(OnePage):
    """A frame with more detections than marks: the target's and the brightest are drawn."""
    @classmethod
    def setUpClass(cls):
        cls.made = os.path.join(runs.scratch(), "run")
        runs.run("scenarios/crowded_geo_track.json", cls.made, "/record/frames=cube",
                 "/world/faint_limit_v_mag=17", runs.SENSOR + "/modules/scenegen/star_limit_v_mag=17",
                 duration=24, pictures=True)
        assert report(cls.made).returncode == 0
        cls.page = Page(cls.made + "/report.html")
        with runs.database(cls.made) as tables:
            cls.counts = dict(tables.execute(
                "SELECT exposure_id, count(*) FROM detections GROUP BY exposure_id").fetchall())
            cls.stars = dict(tables.execute(
                "SELECT exposure_id, sum(star_id != 0) FROM detections GROUP BY exposure_id"
            ).fetchall())

    def test_page(self):
        checked = 0
        for figure in self.page.root.iter("figure"):
            caption = figure.find("figcaption")
            found = re.match(r"frame (\d+) .* (\d+) of (\d+) detections drawn",
                             caption.text if caption is not None and caption.text else "")
            if not found:
                continue
            number, drawn, every = map(int, found.groups())
            whole = [part for part in figure.iter("svg") if part.get("x") is not None][0]
            circles = list(whole.iter("circle"))
            self.assertEqual((drawn, every), (400, self.counts[number]))
            self.assertEqual(len(circles), 400)
            # from the top of the frame to its bottom
            heights = sorted(float(circle.get("cy")) for circle in circles)
            self.assertLess(heights[0], 20)
            self.assertGreater(heights[-1], 332)
            # the colour of identified stars is theirs alone
            green = sum(circle.get("stroke") == "#6ebe78" for circle in circles)
            self.assertLessEqual(green, self.stars[number])
            squares = [path for path in whole.iter("path") if path.get("stroke") == "#ff5c5c"]
            if number >= 20:
                self.assertEqual(len(squares), 1)
                x, y = map(float, re.match(r"M([\d.]+) ([\d.]+)h", squares[0].get("d")).groups())
                self.assertTrue(any(abs(float(c.get("cx")) - x - 7) < 2 and
                                    abs(float(c.get("cy")) - y - 7) < 2 for c in circles))
                # on top: the last circle of all is the target's
                self.assertLess(abs(float(circles[-1].get("cx")) - x - 7), 2)
                checked += 1
        self.assertGreater(checked, 0)

    def test_quicklook(self):
        pixels = read_png(self.made + "/quicklook.png").astype(int)
        panel = pixels[116:757, 680:1321]
        # circles of stars at rest, down to the last rows
        marked = np.abs(panel - [84, 134, 140]).sum(axis=2) < 30
        rows = np.nonzero(marked[:, :400].any(axis=1))[0]
        self.assertLess(rows[0], 40)
        self.assertGreater(rows[-1], 600)


class Others(OnePage):
    def test_two_observers(self):
        made = os.path.join(runs.scratch(), "run")
        runs.run("scenarios/two_observers.json", made,
                 '/name="two&<b>"')
        with open(made + "/manifest.json", encoding="utf-8") as file:
            text = file.read()
        with open(made + "/manifest.json", "w", encoding="utf-8") as file:
            text = re.sub('"device":\t"[^"]*"', '"device": "<script>alert(1)</script>"', text)
            text = re.sub('"warnings":\t[0-9]+', '"warnings": 1', text)
            file.write(text.replace("{", '{"error": "it is 1.589e-05 <px> off",', 1))
        self.assertEqual(report(made).returncode, 0)
        page = Page(made + "/report.html")
        self.check_alone(page)
        headings = [part.text for part in page.root.iter("h2")]
        for name in ("neossat/narrow", "neossat/wide", "follower/narrow"):
            self.assertIn("Sensor " + name, headings)
        self.assertIn("<script>alert(1)</script>", page.text)
        self.assertIn("Warning:1 warning on its standard error while it ran.", page.warnings())
        # a number is in one piece for the browser, in text and in the cells of tables
        self.assertIn("it is <span class=\"w\">1.589e-05</span> &lt;px&gt; off", page.source)
        self.assertIn("td.n,.w{white-space:nowrap}", page.source)
        self.assertIn("two&<b>", page.root.find("head/title").text)
        self.assertEqual(len(page.pictures()), 2 * (6 + 3 + 6))

    def test_who_saw_what(self):
        """Passes and sightings of three objects: with names, in the order of detections."""
        made = os.path.join(runs.scratch(), "run")
        runs.run("scenarios/two_observers.json", made)
        with sqlite3.connect(made + "/run.sqlite") as tables:
            for name in ("passes", "sightings"):
                tables.execute(f"DROP TABLE IF EXISTS {name}")
            tables.execute("CREATE TABLE passes (sensor INTEGER, object INTEGER, name TEXT, start_s"
                           " REAL, end_s REAL, frames INTEGER, detected INTEGER, first_s REAL)")
            tables.execute("CREATE TABLE sightings (sensor INTEGER, object INTEGER, name TEXT, norad"
                           " INTEGER, passes_seen INTEGER, detected INTEGER, tracked INTEGER,"
                           " custody_fraction REAL, revisits INTEGER, revisit_mean_s REAL,"
                           " longest_gap_s REAL, place_rms_arcsec REAL, track_rms_arcsec REAL)")
            for i, (name, seen) in enumerate((("FEW", 1), ("MANY <b>", 3), ("NONE", 0))):
                tables.execute("INSERT INTO passes VALUES (?, ?, ?, 1, 4, 3, ?, ?)",
                               (i, i, name, seen, 1.5 if seen else None))
                tables.execute("INSERT INTO sightings VALUES (NULL, ?, ?, ?, 1, ?, 0, 0.5, 0, NULL,"
                               " 2, 0.25, NULL)", (i, name, i, seen))
        manifest = runs.manifest(made)
        manifest["sightings"] = {"objects": 3, "objects_seen": 2, "objects_in_field": 3,
                                 "passes": 3, "passes_seen": 2, "custody_fraction_all": 0.25,
                                 "custody_fraction_seen": 0.375, "revisit_mean_s": 12.5, "revisit_most_s": 34,
                                 "place_rms_arcsec": 0.75, "track_rms_arcsec": 0.125, "tasks": 7, "tasks_done": 4,
                                 "tasks_not_found": 2, "tasks_lost": 1}
        with open(made + "/manifest.json", "w", encoding="utf-8") as file:
            json.dump(manifest, file)
        result = report(made)
        self.assertEqual((result.returncode, result.stderr), (0, ""))
        page = Page(made + "/report.html")
        self.check_alone(page)
        cards = page.cards()
        self.assertEqual((cards["objects seen"], cards["passes seen"]), ("2", "2"))
        self.assertEqual(float(cards["object custody, mean of all"]), 25)
        self.assertEqual(float(cards["revisit, mean"]), 12.5)
        self.assertEqual(float(cards["detections from truth, RMS"]), 0.75)
        self.assertEqual(cards["tasks done"], "4")
        words = " ".join("".join(page.root.itertext()).split())
        for note in ("of 3, 3 of them in a field", "of 3 through a field", "at most 34.00 s", "37.5 % of those seen",
                     "tracks 0.125 arcsec", "of 7; 2 not found, 1 lost"):
            self.assertTrue(note in words, note)
        rows = [["".join(cell.itertext()) for cell in row.iter("td")] for row in page.root.iter("tr")]
        self.assertIn(["MANY <b>", "1", "1", "3", "0", "50.00"], [row[:6] for row in rows])
        self.assertIn(["FEW", "0", "1", "1", "0", "50.00"], [row[:6] for row in rows])
        line = [part for part in page.root.iter("svg")
                if part.get("aria-label", "").startswith("Timeline of the objects")][0]
        words = [text.text for text in line.iter("text") if text.get("text-anchor") == "end"]
        self.assertEqual(words, ["MANY <b>", "FEW"])
        titles = [title.text for title in line.iter("title")]
        self.assertIn("neossat/wide: 1 s to 4 s, detected in 3 of 3 frames", titles)

    def test_killed(self):
        folder = runs.scratch()
        process = subprocess.Popen(
            runs.command(runs.TRACK, folder + "/run", runs.NO_FRAMES, duration=30000),
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        partial = folder + "/run.partial"
        rows = 0
        for _ in range(600):
            time.sleep(0.1)
            try:
                with sqlite3.connect(f"file:{partial}/run.sqlite?mode=ro", uri=True) as tables:
                    rows, = tables.execute("SELECT count(*) FROM exposures").fetchone()
            except sqlite3.Error:
                rows = 0
            if rows >= 10:
                break
        process.send_signal(signal.SIGKILL)
        process.wait()
        self.assertGreaterEqual(rows, 10)
        result = report(partial, "--out", folder + "/page.html")
        self.assertEqual((result.returncode, result.stderr), (0, ""))
        page = Page(folder + "/page.html")
        self.check_alone(page)
        self.assertIn("The run was killed", page.warnings()[0])
        self.assertIn("left over from a killed run", page.text)
        self.assertGreaterEqual(int(page.cards()["exposures"]), rows)


def tearDownModule():
    runs.clean()


if __name__ == "__main__":
    unittest.main()
