#!/usr/bin/env python3
"""`boresight view` of a day's run: 86,400 exposures, tables of 2 GB. The run is one of 300 s whose rows are repeated, 300 s later
each time. Times are printed (`ctest -V`), with those that were asked for; memory and values are checked.

Usage, from the repository root: /usr/bin/python3 tests/e2e/test_view_day.py BORESIGHT
"""
import os
import sqlite3
import time
import unittest

import numpy

import chromium
import runs
import test_view

COPIES, LENGTH_S = 288, 300
# rows of these tables are repeated within an exposure, so that the file has 2 GB
WIDE = {"detections": 3, "truth": 3}
MEMORY_MB = 300
# all plots of the page, also those that are out of view
SHOWN = ("document.boresight && document.boresight.plots.panels.length"
         " && document.boresight.plots.panels.every((panel) => panel.lines.length > 0)")


def repeat(database, table, exposures):
    """Rows of a table again and again, each time LENGTH_S later."""
    columns = [row[1] for row in database.execute(f'PRAGMA table_info("{table}")')]
    if not {"exposure_id", "tick", "time_s", "mid_s"} & set(columns) or table in ("passes", "sightings"):
        return
    rate = database.execute("SELECT tick_rate_hz FROM run").fetchone()[0]
    steps = {"exposure_id": exposures, **{name: LENGTH_S * rate for name in ("tick", "start_tick", "end_tick", "written_tick")},
             **{name: LENGTH_S for name in ("time_s", "mid_s", "start_s")}}
    values = ", ".join(f't."{name}" + :k * {steps[name]}' if name in steps else f't."{name}"' for name in columns)
    key = "exposure_id" if "exposure_id" in columns else "rowid"
    copies = " UNION ALL ".join(f"SELECT {copy} AS copy" for copy in range(WIDE.get(table, 1)))
    once = "WHERE copy = 0 OR kind <> 'object'" if table == "truth" else ""  # an object has one row an exposure
    database.execute(f'CREATE TEMP TABLE t AS SELECT "{table}".* FROM "{table}", ({copies}) {once} ORDER BY "{table}".{key}, "{table}".rowid')
    database.execute(f'DELETE FROM "{table}"')
    for k in range(COPIES):
        database.execute(f'INSERT INTO "{table}" SELECT {values} FROM t', {"k": k})
    database.execute("DROP TABLE t")


def memory_mb(process):
    """Largest memory that the process has had."""
    with open(f"/proc/{process.pid}/status", encoding="ascii") as file:
        return next(int(line.split()[1]) / 1024 for line in file if line.startswith("VmHWM"))


def processor_s(process):
    with open(f"/proc/{process.pid}/stat", encoding="ascii") as file:
        words = file.read().rsplit(")", 1)[1].split()
    return (int(words[11]) + int(words[12])) / os.sysconf("SC_CLK_TCK")


class Day(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.made = os.path.join(runs.scratch(), "day")
        runs.run(runs.TRACK, cls.made, runs.GENERATOR, duration=LENGTH_S)
        with sqlite3.connect(cls.made + "/run.sqlite") as database:
            for words in ("synchronous = OFF", "journal_mode = OFF", "temp_store = MEMORY"):
                database.execute(f"PRAGMA {words}")
            exposures = database.execute("SELECT count(*) FROM exposures").fetchone()[0]
            # an exposure says how many rows of the truth it has
            database.execute(f"UPDATE exposures SET sources = (SELECT sum(CASE kind WHEN 'object' THEN 1 ELSE {WIDE['truth']} END)"
                             " FROM truth WHERE truth.exposure_id = exposures.exposure_id)")
            for table, in database.execute("SELECT name FROM sqlite_master WHERE type = 'table'").fetchall():
                repeat(database, table, exposures)
        database.close()

    def timed(self, what, act):
        """What it takes: by the clock and of the program's processor time."""
        wall, processor = time.monotonic(), processor_s(self.viewer.process)
        result = act()
        print(f"  {what:34} {time.monotonic() - wall:6.2f} s by the clock, {processor_s(self.viewer.process) - processor:.2f} s of the program's"
              f" processor time; memory {memory_mb(self.viewer.process):.0f} MB", flush=True)
        return result

    def open_page(self, page, note):
        """A program that has just started, and its page in a browser that is open: from the navigation to the plots."""
        began = time.monotonic()
        self.viewer = test_view.Viewer(self.made)
        self.timed(f"page: all plots, {note}", lambda: (page.command("Page.navigate", url=self.viewer.url), page.wait_for(SHOWN)))
        print(f"    from the start of the program: {time.monotonic() - began:.2f} s", flush=True)

    def test_day(self):
        size = os.path.getsize(self.made + "/run.sqlite")
        self.assertGreater(size, 1.9e9)
        print(f"\na day's run, 86,400 exposures, tables of {size / 1e9:.2f} GB, load {os.getloadavg()[0]:.1f} (asked: plots within 2 s, zoom within "
              f"0.2 s, memory {MEMORY_MB} MB):")
        if chromium.PROGRAM:
            with chromium.Chromium(1280, 720) as page:
                # the browser is open: its graphics, which start with the first canvas, are not the page's
                page.evaluate("document.createElement('canvas').getContext('2d') && document.createElement('canvas').getContext('webgl2') && 1")
                for note in ("first", "second program"):
                    self.open_page(page, note)
                    self.assertIsNone(page.evaluate("document.boresight.frameView.made"))  # a run without pixels does not wait for WebGL
                    zoom = "(async () => { const { plots } = document.boresight; plots.setRange(%d, %d); await plots.reloading; })()"
                    self.timed("page: zoom", lambda: page.evaluate(zoom % (30000, 33600)))
                    page.wait_for("document.getElementById('events').children.length === document.boresight.events.length")
                    self.assertLess(memory_mb(self.viewer.process), MEMORY_MB)
                    page.command("Page.navigate", url="about:blank")
                    self.assertEqual(self.viewer.end()[0], 0)
                self.assertEqual(page.messages, [])
        begin = time.monotonic()
        self.viewer = test_view.Viewer(self.made)
        print(f"  {'address':34} {time.monotonic() - begin:6.2f} s by the clock", flush=True)
        rows = self.timed("list of exposures", lambda: self.viewer.numbers("api/frames?sensor=0").reshape(-1, 5))
        self.assertEqual(len(rows), COPIES * LENGTH_S)
        self.timed("a frame's marks", lambda: self.viewer.json("api/frame?sensor=0&frame=50000"))
        panels = [panel["name"] for panel in self.viewer.json("api/run")["sensors"][0]["panels"]]

        def plots(low, high):
            return [self.viewer.numbers(f"api/plot?sensor=0&panel={name}&from={low}&to={high}&columns=500") for name in panels]
        self.timed(f"{len(panels)} plots of the day, at first", lambda: plots(0, 86400))
        print(f"    from the start of the program: {time.monotonic() - begin:.2f} s, {processor_s(self.viewer.process):.2f} s of its processor time", flush=True)
        self.timed("the same again", lambda: plots(0, 86400))
        self.timed("zoom to an hour", lambda: plots(40000, 43600))
        self.timed("zoom to a minute", lambda: plots(40000, 40060))
        # no extreme is lost in the columns
        numbers = self.viewer.numbers("api/plot?sensor=0&panel=detections&from=0&to=86400&columns=500")
        points = numbers[1:1 + 3 * int(numbers[0])].reshape(-1, 3)
        with sqlite3.connect(self.made + "/run.sqlite") as database:
            low, high = database.execute("SELECT min(detections), max(detections) FROM detection_frames").fetchone()
        database.close()
        self.assertEqual((numpy.min(points[:, 1]), numpy.max(points[:, 2])), (low, high))
        self.assertLess(memory_mb(self.viewer.process), MEMORY_MB)
        self.assertEqual(self.viewer.end()[0], 0)


def tearDownModule():
    test_view.end_all()


if __name__ == "__main__":
    unittest.main()
