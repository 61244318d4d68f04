#!/usr/bin/env python3
"""boresight report of studies: a real one, and tables made by hand with known content.

Usage, from the repository root: /usr/bin/python3 tests/e2e/test_report_study.py BORESIGHT
"""
import json
import math
import os
import re
import sqlite3
import subprocess
import unittest

import runs
from test_report import OnePage, Page, report

STUDY = {
    "boresight_study": 1, "name": "two&<b>", "kind": "loop",
    "scenarios": [{"file": os.path.abspath("scenarios/day_generator.json")}],
    "set": {"/duration_s": 60, "/world/star_catalogue": "embedded"},
    "sweeps": [{"axes": [
        {"path": "/observers/0/sensors/0/camera/read_noise_e", "values": [5, 40]},
        {"path": "/observers/0/sensors/0/camera/aperture_m", "values": [0.05, 0.15]}]}],
    "dispersions": [{"path": "/observers/0/sensors/0/camera/throughput", "distribution": "normal",
                     "mean": 1, "sigma": 0.05, "apply": "multiply"}],
    "replicates": 6, "seed": "0x1"}


def close(shown, value, digits):
    """Whether a number is what `digits` significant digits show."""
    if value == 0:
        return float(shown) == 0
    return abs(float(shown) - value) <= 0.51 * 10 ** (math.floor(math.log10(abs(value))) + 1 - digits)


class Real(OnePage):
    @classmethod
    def setUpClass(cls):
        cls.folder = runs.scratch()
        file = os.path.join(cls.folder, "study.json")
        with open(file, "w", encoding="utf-8") as stream:
            json.dump(STUDY, stream)
        cls.made = os.path.join(cls.folder, "made")
        result = subprocess.run([runs.BORESIGHT, "study", file, "--out", cls.made, "--workers", "1"],
                                capture_output=True, text=True, timeout=600)
        assert result.returncode == 0, result.stderr
        result = report(cls.made)
        assert (result.returncode, result.stderr) == (0, ""), result.stderr
        cls.page = Page(cls.made + "/report.html")

    def test_page(self):
        self.check_alone(self.page)
        self.assertEqual(self.page.root.find("head/title").text, "Study two&<b>")
        for name in ("acquired", "custody"):
            for axis in ("read_noise_e", "aperture_m"):
                self.assertIn(f"{name} against {axis}", self.page.charts())
        self.assertIn("Histogram of custody", self.page.charts())
        self.assertIn("24 of 24, 6 a setting", self.page.text)

    def test_figures(self):
        """Settings and cards tell what the table statistics does."""
        with sqlite3.connect(self.made + "/study.sqlite") as tables:
            rows = dict(((setting, metric), value) for setting, metric, *value in tables.execute(
                "SELECT setting, metric, mean, low, high FROM statistics"))
        cards = self.page.cards()
        # from the least to the greatest mean of a setting, under the name that tables have
        means = [rows[k, "custody"][0] for k in range(4)]
        low, _, high = cards["custody"].strip().partition(" to ")
        self.assertTrue(close(low, min(means), 3) and close(high, max(means), 3))
        for heading in self.page.root.iter("h3"):
            self.assertNotIn("pointing rms", heading.text)
        self.assertIn("time_to_confirm_s", self.page.text)
        self.assertEqual(cards["runs done"], "24")
        table = [part for part in self.page.root.iter("table")
                 if part.find("thead/tr/th") is not None
                 and part.find("thead/tr/th").text == "setting"][0]
        heads = [head.text for head in table.iter("th")]
        column = heads.index("custody")
        checked = 0
        for row in table.find("tbody"):
            cells = [cell.text for cell in row]
            shown = re.fullmatch(r"(\S+) \[(\S+), (\S+)\]", cells[column])
            for k, value in enumerate(rows[int(cells[0]), "custody"]):
                if value == 0:
                    self.assertEqual(float(shown[k + 1]), 0)
                else:
                    self.assertTrue(close(shown[k + 1], value, 3))
                checked += 1
        self.assertEqual(checked, 12)

    def test_same_bytes(self):
        again = os.path.join(self.folder, "again.html")
        self.assertEqual(report(self.made + "/", "--out", again).returncode, 0)
        with open(again, "rb") as file:
            self.assertEqual(file.read(), self.page.bytes)

    def test_errors(self):
        folder = runs.scratch()
        with open(folder + "/study.json", "w", encoding="utf-8") as file:
            file.write("{}")
        result = report(folder)
        self.assertEqual(result.returncode, 1)
        self.assertIn("has no study.sqlite yet", result.stderr)
        with open(self.made + "/study.sqlite", "rb") as file:
            tables = file.read()
        for damaged in (b"no database", tables[:len(tables) // 2],
                        tables[:8192] + b"\xA5" * 40000 + tables[48192:]):
            with open(folder + "/study.sqlite", "wb") as file:
                file.write(damaged)
            result = report(folder)
            self.assertEqual(result.returncode, 1, result.stderr)
            self.assertIn("study.sqlite", result.stderr)
            self.assertEqual(sorted(os.listdir(folder)), ["study.json", "study.sqlite"])


TABLES = """
CREATE TABLE columns(tab, name, unit, doc);
CREATE TABLE about(key, value);
CREATE TABLE scenarios(scenario, name);
CREATE TABLE axes(axis, name, path, role, design, sweep);
CREATE TABLE metrics(metric, unit, doc, kind);
CREATE TABLE settings(setting INTEGER, scenario INTEGER, a REAL, b REAL, c TEXT);
CREATE TABLE runs(run INTEGER, setting INTEGER, replicate, run_number, scenario, status TEXT, error
 TEXT, a REAL, b REAL, c TEXT, loss_db_pd50 REAL);
CREATE TABLE speed(run, wall_s);
CREATE TABLE statistics(setting, metric, method, runs, missing, mean, low, high, std, minimum, p05,
 p25, median, p75, p95, maximum);
CREATE TABLE curve_statistics(setting, runs, snr, v_mag, trials, detected, rate, rate_low,
 rate_high, ideal_pd);
CREATE TABLE sensitivity(sweep, design, metric, rank, axis, effect, effect_error, mean_effect,
 spread, effects);
CREATE TABLE speed_sensitivity AS SELECT * FROM sensitivity;
INSERT INTO scenarios VALUES(0, 'one');
INSERT INTO metrics VALUES('loss_db_pd50', 'dB', 'Loss.', 'value');
"""


def tables(folder, design, settings, failed=()):
    """A study of three axes, one run a setting, whose metric is 10 a + b."""
    with sqlite3.connect(folder + "/study.sqlite") as out:
        out.executescript(TABLES)
        out.executemany("INSERT INTO about VALUES(?, ?)",
                        [("name", "made"), ("kind", "pd"), ("runs", str(len(settings))),
                         ("replicates", "1"), ("seed", "0x1"), ("version", "0")])
        out.executemany("INSERT INTO axes VALUES(?, ?, ?, 'sweep', ?, 0)",
                        [(i, name, "/" + name, design) for i, name in enumerate("abc")])
        for i, (a, b, c) in enumerate(settings):
            bad = i in failed
            out.execute("INSERT INTO settings VALUES(?, 0, ?, ?, ?)", (i, a, b, c))
            out.execute("INSERT INTO runs VALUES(?, ?, 0, ?, 0, ?, ?, ?, ?, ?, ?)",
                        (i, i, i, "failed" if bad else "done", "no <light>" if bad else None, a, b,
                         c, None if bad else 10 * a + b))
            out.execute("INSERT INTO speed VALUES(?, ?)", (i, 1 + b))
        return out


def ranked(out, table, design, metric, *effects):
    """Rows of an axes' table: (axis, effect, error, spread), the greatest first."""
    out.executemany(f"INSERT INTO {table} VALUES(0, ?, ?, ?, ?, ?, ?, 0, ?, 3)",
                    [(design, metric, rank, axis, effect, error, spread)
                     for rank, (axis, effect, error, spread) in enumerate(effects, 1)])
    out.commit()


class Made(OnePage):
    def test_curves(self):
        folder = runs.scratch()
        settings = [(a, b, c) for a in (1, 2) for b in (0.1, 1, 10) for c in ("low", "<high>")]
        out = tables(folder, "grid", settings, failed=(3, 4))
        out.executemany("INSERT INTO columns VALUES('curve_statistics', ?, '', '')",
                        [(name,) for name in ("setting", "runs", "snr", "v_mag", "trials", "rate",
                                              "rate_low", "rate_high", "ideal_pd")])
        for i in range(len(settings)):
            out.executemany("INSERT INTO curve_statistics VALUES(?, 1, ?, ?, 100, 50, ?, ?, ?, ?)",
                            [(i, k, 20 - k, k / 10, k / 10 - 0.05, k / 10 + 0.05, k / 10)
                             for k in range(1, 10)])
        out.commit()
        self.assertEqual(report(folder).returncode, 0)
        page = Page(folder + "/report.html")
        self.check_alone(page)
        # a line for each b; a chart for each a and c, over SNR and over magnitude
        self.assertEqual(sum(label.startswith("Rate of detection") for label in page.charts()), 8)
        self.assertEqual(page.text.count("ideal, place and shape known"), 8)
        self.assertIn("a 1, c <high>. Of all trials", page.text)
        self.assertEqual(page.warnings()[0], "Problem:2 of 12 runs failed.")
        self.assertIn("no <light>", page.text)
        self.assertLess(page.source.index("Failed runs</h2>"), page.source.index("Curves</h2>"))
        self.assertEqual(page.cards()["runs done"], "10")
        self.assertIn("loss_db_pd50 against c", page.charts())

    def test_one_at_a_time(self):
        folder = runs.scratch()
        out = tables(folder, "one_at_a_time",
                     [(1, 1, None), (0, 1, None), (2, 1, None), (1, 0, None), (1, 4, None),
                      (1, 1, "y")])  # the scenario says nothing of c
        # 10 a + b: a changes it by 20, b by 4, c by nothing; the wall time is 1 + b
        ranked(out, "sensitivity", "one_at_a_time", "loss_db_pd50", ("a", 20, None, None),
               ("b", 4, None, None), ("c", 0, None, None))
        ranked(out, "speed_sensitivity", "one_at_a_time", "wall_s", ("b", 4, None, None),
               ("a", 0, None, None), ("c", 0, None, None))
        self.assertEqual(report(folder).returncode, 0)
        page = Page(folder + "/report.html")
        self.check_alone(page)
        charts = [part for part in page.root.iter("svg")
                  if part.get("aria-label", "").startswith("Change of ")]
        self.assertEqual([part.get("aria-label") for part in charts],
                         ["Change of loss_db_pd50 with one axis at a time",
                          "Change of wall_s with one axis at a time"])
        ranks = [[text.text for text in part.iter("text") if re.match(r"\d  ", text.text)]
                 for part in charts]
        self.assertEqual(ranks[0], ["1  a", "2  b", "3  c"])
        self.assertEqual(ranks[1][0], "1  b")
        # from the scenario's 11 to 1 and 21, and to 10 and 14: bars on both sides
        wide = [float(part.get("width")) for part in charts[0].iter("rect")
                if part.get("class").startswith("h ")]
        self.assertEqual(len(wide), 5)
        for bar, size in zip(wide, (10, 10, 1, 3, 0)):
            self.assertAlmostEqual(bar / wide[0], size / 10, delta=0.01)

    def test_morris(self):
        folder = runs.scratch()
        # three paths of single steps; ranges 0..3 of a and 0..30 of b: both change it by 30
        out = tables(folder, "morris",
                     [(0, 0, "x"), (2, 0, "x"), (2, 20, "x"), (1, 30, "x"), (3, 30, "x"),
                      (3, 10, "x"), (3, 0, "x"), (1, 0, "x"), (1, 20, "x")])
        ranked(out, "sensitivity", "morris", "loss_db_pd50", ("a", 30, 0, 0), ("b", 30, 0, 0))
        ranked(out, "speed_sensitivity", "morris", "wall_s", ("b", 30, 2, 4))
        self.assertEqual(report(folder).returncode, 0)
        page = Page(folder + "/report.html")
        self.check_alone(page)
        chart = [part for part in page.root.iter("svg")
                 if part.get("aria-label", "") == "Ranked effects on loss_db_pd50"][0]
        # equal bars, to their very ends
        bars = [part for part in chart.iter("rect") if "h c0" in part.get("class")]
        self.assertEqual(len(bars), 2)
        self.assertEqual(bars[0].get("width"), bars[1].get("width"))
        frame = [part for part in chart.iter("rect") if part.get("class") == "f"][0]
        # the axis ends at 1.05 of the greatest
        self.assertAlmostEqual(float(bars[0].get("width")) / float(frame.get("width")), 1 / 1.05,
                               delta=2e-4)  # written to a tenth
        spread = [part for part in page.root.iter("svg")
                  if part.get("aria-label", "") == "Spread against size of the effects on "
                                                   "loss_db_pd50"]
        self.assertEqual(len(spread), 1)
        # of the wall time: the interval's ends are 1.96 standard errors away
        chart = [part for part in page.root.iter("svg")
                 if part.get("aria-label", "") == "Ranked effects on wall_s"][0]
        wide = {part.get("class"): float(part.get("width")) for part in chart.iter("rect")}
        bar = [wide[name] for name in wide if "c0" in name][0]
        interval = [wide[name] for name in wide if "c1" in name][0]
        self.assertAlmostEqual(interval / bar, 2 * 1.96 * 2 / 30, delta=1e-3)

    def test_without_effects(self):
        """A study whose tables lack the effects is damaged."""
        folder = runs.scratch()
        out = tables(folder, "morris", [(0, 0, "x"), (2, 0, "x")])
        out.execute("DROP TABLE sensitivity")
        out.commit()
        result = report(folder)
        self.assertEqual(result.returncode, 1)
        self.assertIn("sensitivity", result.stderr)


def tearDownModule():
    runs.clean()


if __name__ == "__main__":
    unittest.main()
