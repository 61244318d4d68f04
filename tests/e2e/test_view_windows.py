#!/usr/bin/env python3
"""Windows that image processing searched, wheels and the real-time factor in the viewer; changes of the stack and of the windows in a
live run, which repeat. The page in a headless Chromium (Debian's package; skipped where there is none): edges of windows on the
screen are where table regions_of_interest says.

Usage, from the repository root: /usr/bin/python3 tests/e2e/test_view_windows.py BORESIGHT [--full]
--full: also binned frames on the screen, the exported page, and live changes.
"""
import csv
import json
import os
import sqlite3
import unittest

import numpy

import chromium
import live_page
import overlay
import runs
import test_view
import test_view_live

FULL = test_view_live.FULL  # which takes the option
IMGPROC = runs.SENSOR + "/modules/imgproc"
SMALL = [f"{runs.SENSOR}/camera/{side}_px=512" for side in ("width", "height")] + [runs.SENSOR + "/cue/offset_deg=0.01", runs.SENSOR + "/cue/sigma_deg=0.01"]
WINDOWS = [IMGPROC + "/track_windows=true", IMGPROC + "/window_px=48", IMGPROC + "/window_stars=5", IMGPROC + "/full_frame_period=100", IMGPROC + "/full_frame_count=4"]
# the second: binned by 2, and a window of the sensor whose corner is odd
READ_OUT = [runs.SENSOR + "/exposure/binning=2", runs.SENSOR + "/exposure/window_px=[31, 45, 442, 420]"]

# Middle of the line at each edge of the windows, over the whole edge. Dots of the page: [left, top, right, bottom, and where they should be]
EDGES = overlay.script("windows", """
    // the middle across an edge near `at`, between two ends along it
    const middle = (at, from, to, turned) => {
        const across = [Math.round(at * ratio) - 4, Math.round(at * ratio) + 5], along = [Math.ceil(from * ratio) + 6, Math.floor(to * ratio) - 6];
        const found = turned ? centre(along[0], across[0], along[1], across[1]) : centre(across[0], along[0], across[1], along[1]);
        return found && found[turned ? 1 : 0];
    };
    const { scale, x, y } = view.view, { width, height } = view.size();
    const { originX, originY } = view.drawing(); // of the pixels of the picture
    return { scale, x, y, width, height, originX, originY, windows: view.sorted.windows.map((one) => {
        const a = view.toScreen(one.left, one.top), b = view.toScreen(one.right, one.bottom);
        return [one.said, middle(a.x, a.y, b.y, false), middle(a.y, a.x, b.x, true), middle(b.x, a.y, b.y, false), middle(b.y, a.x, b.x, true)];
    }) };
""")


def rows_of(folder, query):
    with sqlite3.connect(f"file:{folder}/run.sqlite?mode=ro", uri=True) as database:
        return database.execute(query).fetchall()


class Recorded(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = runs.scratch()
        cls.out = {name: os.path.join(cls.folder, name) for name in ("whole", "windows", "binned")}
        more = {"whole": [], "windows": WINDOWS, "binned": WINDOWS + READ_OUT}
        runs.parallel(lambda name: runs.run(runs.TRACK, cls.out[name], *SMALL, *more[name], duration=24), cls.out)

    def test_table(self):
        """Only where windows are used; each frame has its windows, apart, in its read-out, around what was expected."""
        names = {name: {row[0] for row in rows_of(out, "SELECT name FROM sqlite_master")} for name, out in self.out.items()}
        self.assertNotIn("regions_of_interest", names["whole"])
        self.assertEqual(names["windows"] - names["whole"], {"regions_of_interest"})
        self.assertNotIn("wheels", names["windows"])
        for name in ("windows", "binned"):
            counts = dict(rows_of(self.out[name], "SELECT exposure_id, windows FROM detection_frames WHERE windows > 0"))
            self.assertGreater(len(counts), 8, name)
            found = {}
            for row in rows_of(self.out[name], "SELECT exposure_id, \"window\", x0_px, y0_px, width_px, height_px, reason, track_id, star_id, x_px, y_px FROM regions_of_interest"):
                found.setdefault(row[0], {}).setdefault(row[1], []).append(row[2:])
            self.assertEqual({exposure: len(windows) for exposure, windows in found.items()}, counts)
            frames = {row[0]: row[1:] for row in rows_of(self.out[name], "SELECT exposure_id, x0_px, y0_px, width_px, height_px, binning FROM frames")}
            for exposure, windows in found.items():
                x0, y0, width, height, binning = frames[exposure]
                self.assertEqual(set(windows), set(range(len(windows))))
                targets = [reason for rows in windows.values() for reason in rows if reason[4] == "target"]
                self.assertEqual(len(targets), 1)
                self.assertGreater(targets[0][5], 0)
                for rows in windows.values():
                    self.assertEqual(len({row[:4] for row in rows}), 1)
                    x, y, w, h = rows[0][:4]
                    self.assertTrue(x >= x0 and y >= y0 and x + w <= x0 + width and y + h <= y0 + height)
                    self.assertEqual(((x - x0) % binning, (y - y0) % binning, w % binning, h % binning), (0, 0, 0, 0))
                    for row in rows:
                        self.assertTrue(x - 24 <= row[7] <= x + w + 24 and y - 24 <= row[8] <= y + h + 24, row)
                        self.assertEqual((row[4] == "star", row[6] > 0), (row[5] == 0, row[5] == 0))
            # the target was where its window is
            misses = rows_of(self.out[name], "SELECT count(*) FROM regions_of_interest r JOIN truth t ON t.exposure_id = r.exposure_id AND t.sensor = r.sensor WHERE reason = 'target' "
                             "AND t.kind = 'object' AND t.in_field = 1 AND NOT (t.x_mid_px BETWEEN x0_px AND x0_px + width_px - 1 AND t.y_mid_px BETWEEN y0_px AND y0_px + height_px - 1)")
            self.assertEqual(misses, [(0,)])

    def test_wall_clock(self):
        """Rows grow; the last one is the end of the run, and its slope the real-time factor."""
        with open(os.path.join(self.out["whole"], "wall_clock.csv"), encoding="utf-8", newline="") as file:
            rows = list(csv.DictReader(file))
        times, walls = [numpy.array([float(row[name]) for row in rows]) for name in ("time_s", "wall_s")]
        self.assertEqual((times[0], walls[0]), (0, 0))
        self.assertTrue(numpy.all(numpy.diff(times) > 0) and numpy.all(numpy.diff(walls) >= 0))
        self.assertAlmostEqual(times[-1], 24, delta=0.01)
        # what is outside of stepping: a few ms, or what the machine takes
        self.assertAlmostEqual(walls[-1], runs.manifest(self.out["whole"])["wall_time_s"], delta=0.5)
        viewer = test_view.Viewer(self.out["whole"])
        panels = viewer.json("api/run")["sensors"][0]["panels"]
        self.assertIn("real_time_factor", [panel["name"] for panel in panels])
        self.assertNotIn("wheels", [panel["name"] for panel in panels])
        numbers = viewer.numbers("api/plot?panel=real_time_factor&from=0&to=25&columns=500")
        shown = numbers[1:].reshape(-1, 3)
        self.assertEqual(len(shown), numbers[0])
        wide = numpy.diff(walls) >= 0.05  # narrower ones are joined
        numpy.testing.assert_allclose(shown[:wide.sum(), 1][:-1], (numpy.diff(times) / numpy.diff(walls))[wide][:-1], rtol=1e-4)
        self.assertEqual(numpy.all(shown[:, 1] > 0), True)
        self.assertEqual(viewer.end()[0], 0)

    @unittest.skipUnless(chromium.PROGRAM, "there is no chromium")
    def test_overlay(self):
        """Edges on the screen, in pixels of the browser, at two zooms; legend, M and names at the cursor; none without the table."""
        for name in ("windows", "binned") if FULL else ("binned",):
            viewer = test_view.Viewer(self.out[name])
            rows = rows_of(self.out[name], "SELECT exposure_id, \"window\", x0_px, y0_px, width_px, height_px FROM regions_of_interest GROUP BY exposure_id, \"window\"")
            exposure = rows[-1][0]
            boxes = [row[2:] for row in rows if row[0] == exposure]
            x0, y0, binning, index = rows_of(self.out[name], f"SELECT x0_px, y0_px, binning, rowid - 1 FROM frames WHERE exposure_id = {exposure}")[0]
            with chromium.Chromium(1280, 720) as page:
                page.command("Page.navigate", url=f"{viewer.url}#frame={index}")
                page.wait_for(f"document.boresight && document.boresight.current === {index}")
                self.assertFalse(page.evaluate("document.getElementById('show-windows').hidden"))
                self.assertEqual(page.evaluate("document.getElementById('count-windows').textContent"), str(len(boxes)))
                for zoom in (None, 3):
                    if zoom:
                        page.evaluate(f"document.boresight.frameView.zoomTo({zoom})")
                    seen = page.evaluate(EDGES)
                    checked = 0
                    for (said, *edges), (x, y, w, h) in zip(seen["windows"], boxes):
                        self.assertTrue(said.startswith("window: "), said)
                        # pixel p of a binned frame begins at (sensor - corner) / binning - 0.5
                        places = [((at - corner) / binning - 0.5 - seen[axis]) * seen["scale"] + seen[size] / 2
                                  for at, corner, axis, size in ((x, x0, "x", "width"), (y, y0, "y", "height"), (x + w, x0, "x", "width"), (y + h, y0, "y", "height"))]
                        # the picture begins at a whole pixel of the screen, so that it may be half of one away; its windows are not away from it
                        drawn = [seen[origin] + (at - corner) / binning * seen["scale"]
                                 for at, corner, origin in ((x, x0, "originX"), (y, y0, "originY"), (x + w, x0, "originX"), (y + h, y0, "originY"))]
                        for found, place, there, size in zip(edges, places, drawn, ("width", "height") * 2, strict=True):
                            if found is not None and 1 < there < seen[size] - 1:  # in view
                                self.assertAlmostEqual(found, there, delta=0.2)  # the browser's own placing of lines: at most 0.16 measured
                                self.assertAlmostEqual(there, place, delta=0.5 + 1e-9)
                                checked += 1
                    self.assertGreaterEqual(checked, 4 if zoom else 3 * len(boxes), (name, zoom))
                page.evaluate("document.boresight.frameView.setShown('windows', false)")
                self.assertEqual(page.evaluate("document.getElementById('show-windows').getAttribute('aria-pressed')"), "false")
                page.key("m")  # none was shown: those that are at first
                self.assertEqual(page.evaluate("document.getElementById('show-windows').getAttribute('aria-pressed')"), "true")
                said = page.evaluate("(() => { const view = document.boresight.frameView, [one] = view.sorted.windows; for (const name of Object.keys(view.shown)) view.setShown(name, name === 'windows'); return view.nearest({ x: one.x, y: one.y }); })()")
                self.assertRegex(said, r"^window: (target \(track \d+\)|track \d+|star \d+)")
                self.assertEqual(page.messages, [])
            self.assertEqual(viewer.end()[0], 0)
        if not FULL:
            return
        viewer = test_view.Viewer(self.out["whole"])
        with chromium.Chromium(1280, 720) as page:
            page.command("Page.navigate", url=f"{viewer.url}#frame=20")
            page.wait_for("document.boresight && document.boresight.current === 20")
            self.assertTrue(page.evaluate("document.getElementById('show-windows').hidden"))
        self.assertEqual(viewer.end()[0], 0)

    @unittest.skipUnless(chromium.PROGRAM and FULL, "needs --full, and chromium")
    def test_exported_page(self):
        page_file = os.path.join(self.folder, "page.html")
        runs.call_well("export", self.out["windows"], "--page", page_file)
        count = rows_of(self.out["windows"], "SELECT windows FROM detection_frames ORDER BY exposure_id DESC LIMIT 1")[0][0]
        with chromium.Chromium(1280, 720) as page:
            page.command("Page.navigate", url="file://" + page_file)
            page.wait_for("document.boresight && document.boresight.current >= 0")
            page.key("End")
            page.wait_for(f"document.boresight.frameView.sorted.windows.length === {count}")
            self.assertIn("Real-time factor", page.evaluate("document.getElementById('panels').textContent"))


class Wheels(unittest.TestCase):
    def test_wheels(self):
        """The speeds of the table are those of the plot, each with its limit; the report has a chart."""
        out = os.path.join(runs.scratch(), "craft")
        runs.run("scenarios/rigid_spacecraft.json", out, runs.NO_FRAMES, duration=6)
        rows = rows_of(out, "SELECT wheel, time_s, speed_rpm, speed_limit_rpm, motor_nm, motor_limit_nm FROM wheels ORDER BY rowid")
        self.assertEqual({row[0] for row in rows}, {0, 1, 2, 3})
        self.assertTrue(all(abs(row[2]) <= row[3] and abs(row[4]) <= row[5] for row in rows))
        self.assertGreater(numpy.ptp([row[2] for row in rows if row[0] == 0]), 0)
        viewer = test_view.Viewer(out)
        panel, = [one for one in viewer.json("api/run")["sensors"][0]["panels"] if one["name"] == "wheels"]
        self.assertEqual(panel["lines"], [f"wheel {k}" for k in range(4)])
        for stop, row in zip(panel["stops"], rows[:4], strict=True):
            self.assertEqual(stop["line"], row[0])
            numpy.testing.assert_allclose((stop["low"], stop["high"]), (-row[3], row[3]), rtol=1e-9)  # numbers are sent in 15 digits
        numbers, at = viewer.numbers("api/plot?panel=wheels&from=0&to=6&columns=400"), 0
        for k in range(4):
            count = int(numbers[at])
            shown = [(numbers[at + 1 + 3 * i], numbers[at + 3 + 3 * i]) for i in range(count)]
            at += 1 + 3 * count
            self.assertEqual(shown, [(row[1], row[2]) for row in rows if row[0] == k])
        self.assertEqual(at, len(numbers))
        self.assertEqual(viewer.end()[0], 0)
        result = runs.call("report", out, "--out", out + ".html")
        self.assertEqual(result.returncode, 0, result.stderr)
        with open(out + ".html", encoding="utf-8") as file:
            text = file.read()
        self.assertIn("Speed of the reaction wheels over time", text)
        self.assertIn(f"Limit: {rows[0][3]:.6g} rpm", text)


@unittest.skipUnless(FULL, "needs --full")
class Changes(test_view_live.Tables):
    def test_stack_and_windows(self):
        """A stack begins, becomes longer and ends, and windows begin while a run goes on: each is an event, and `boresight run` of its
        scenario.json gives equal tables."""
        changes = [IMGPROC + "/stack/frames=4", IMGPROC + "/stack/frames=8", IMGPROC + "/stack/frames=4", IMGPROC + "/stack/frames=0", *WINDOWS[::-1]]
        folder = runs.scratch()
        out, again = folder + "/run", folder + "/again"
        words = [one for one in SMALL if "width" in one or "height" in one]
        words = [one.replace("512", "384") for one in words] + SMALL[2:]
        viewer = test_view.Viewer(runs.TRACK, "--out", out, "--duration", "42", "--threads", "1", *[word for one in ["/world/star_catalogue=embedded", *words] for word in ("--set", one)])
        page = live_page.Socket(viewer)
        self.assertEqual(page.status, 101)
        state = page.state(lambda now: now["run"] == 0)
        for count, change in enumerate(changes, 1):
            if count <= 5: # 6 frames: stacks of 4 and 8 are not full
                state = page.state(lambda now, then=state["time_s"]: now["paused"] and not now["steps"] and now["time_s"] > then, {"do": "step", "frames": 6})
            state = page.state(lambda now, count=count: now["changes"] == count or now["message"], {"do": "set", "set": change})
            self.assertEqual((state["message"], state["changes"]), ("", count), change)
        page.state(lambda now: now["ended"], {"do": "run", "rate": 0})
        page.close()
        self.assertEqual(viewer.end()[0], 0)
        self.assertEqual([row[4] for row in test_view_live.tables(out)["events"] if row[3] == "change"], changes)
        with open(os.path.join(out, "scenario.json"), encoding="utf-8") as file:
            self.assertEqual([one["set"] for one in json.load(file)["changes"]], changes)
        runs.run(out + "/scenario.json", again)
        self.assert_equal(out, again)
        self.assertGreater(len(test_view_live.tables(out)["regions_of_interest"]), 10)
        stacked = {row[0] for row in rows_of(out, "SELECT exposure_id FROM detections WHERE stack = 1")}
        self.assertGreater(len(stacked), 0, "no stack found anything: the test needs other stars")


@unittest.skipUnless(FULL and chromium.PROGRAM, "needs --full, and chromium")
class LivePage(unittest.TestCase):
    def test_pause(self):
        """A page that could not take frames while the run went on shows the last one with tracks at the pause; objects have their names
        without the look at the tables that comes every few seconds."""
        viewer = test_view.Viewer(runs.TRACK, "--out", runs.scratch() + "/run", "--duration", "300", "--threads", "1", "--set", "/world/star_catalogue=embedded", "--set", runs.GENERATOR)
        app = "document.boresight"
        with chromium.Chromium(1280, 720) as page:
            page.command("Page.navigate", url=viewer.url)
            page.wait_for(f"{app} && {app}.live && {app}.live.state && {app}.live.state.run === 0")
            page.key("n")
            page.wait_for(f"{app}.live.trail.exposures.length > 0 && {app}.live.state.paused")
            page.evaluate(f"{app}.take = {app}.live.takeFrame, {app}.live.takeFrame = () => {{}}, document.getElementById('live-rate').value = '10', document.getElementById('live-rate').dispatchEvent(new Event('change'))")
            page.key("r")
            page.wait_for(f"{app}.live.state.time_s > 25")
            page.key("r")
            page.wait_for(f"{app}.live.state.paused")
            page.wait_for(f"{app}.count > 20 && {app}.frameView.details.exposure_id === {app}.frames[({app}.count - 2) * 5]")
            self.assertEqual(page.evaluate(f"[{app}.live.newest, {app}.live.shownExposure() === {app}.frameView.details.exposure_id]"), [True, True])
            page.evaluate(f"{app}.refreshWait = () => 1e9, {app}.live.takeFrame = {app}.take, {app}.names = {{}}, 0")
            page.key("n")
            page.wait_for(f"{app}.live.state.paused && Object.values({app}.names).includes('INMARSAT GX5')")
            self.assertEqual(page.messages, [])
        self.assertEqual(viewer.end()[0], 0)


def load_tests(loader, _, __):
    """Not the tests of the modules that are imported."""
    return unittest.TestSuite(loader.loadTestsFromTestCase(one) for one in (Recorded, Wheels, Changes, LivePage))


def tearDownModule():
    test_view.end_all()


if __name__ == "__main__":
    unittest.main()
