#!/usr/bin/env python3
"""The charts of report.html that answer, in a headless Chromium (Debian's package; skipped where there is none): values against the
run's tables, zoom, keyboard, legend; the page without scripts, in print, and with hostile names.

Usage, from the repository root: /usr/bin/python3 tests/e2e/test_report_charts.py BORESIGHT [--full]

Without --full only hostile names and the policy.
"""
import json
import os
import sys
import time
import unittest

import chromium
import runs

FULL = "--full" in sys.argv and not sys.argv.remove("--full")
HOSTILE = "<img src=x onerror=window.hacked=1>\"'&\u202egnp"  # the name of a scenario has no slash
HOSTILE_DEVICE = "</script><script>window.hacked=1</script>"
FRAMES = 52


def chart(name):
    """Expression of the chart whose name begins so."""
    return f"document.report.charts.find((one) => one.name.startsWith({name!r}))"


DETECTIONS, POINTING, SKY = (chart(name) for name in ("Detections per frame", "Distance from the boresight", "Paths of the boresight"))
RANGE = chart("Distance of the target")
DRAWN = "document.report.charts.every((one) => !one.visible || !one.dirty)"


@unittest.skipUnless(chromium.PROGRAM, "there is no chromium")
class Charts(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.made = os.path.join(runs.scratch(), "run")
        cls.file = cls.made + "/report.html"
        runs.run(runs.TRACK, cls.made, runs.NO_FRAMES, runs.GENERATOR, "/name=" + json.dumps(HOSTILE), duration=FRAMES, seed=1)
        manifest = runs.manifest(cls.made)
        with open(cls.made + "/manifest.json", "w", encoding="utf-8") as file:
            json.dump({**manifest, "device": HOSTILE_DEVICE}, file)
        runs.call_well("report", cls.made)
        cls.page = chromium.Chromium(1280, 720)

    @classmethod
    def tearDownClass(cls):
        cls.page.__exit__()

    def setUp(self):
        self.page.messages.clear()
        if not self.page.evaluate(f"location.href === {json.dumps('file://' + self.file)} && !!document.report"):
            self.open(self.file)
            self.page.wait_for("!!document.report")
        self.page.evaluate("document.report.charts.forEach((one) => { one.dot = -1; one.group.cursor = NaN; one.group.reset(); })")

    def open(self, path):
        self.page.command("Page.navigate", url="file://" + path)

    def show(self, one):
        self.page.evaluate(f"{one}.canvas.scrollIntoView()")
        self.page.wait_for(f"{one}.visible && !{one}.dirty")

    def mouse(self, kind, x, y, **more):
        self.page.command("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left" if kind != "mouseMoved" or more else "none", **more)

    def place(self, one, value):
        """Pixels of the window at a value of the horizontal axis, half way up."""
        return self.page.evaluate(f"(() => {{ const box = {one}.canvas.getBoundingClientRect(); return [box.left + {one}.toX({value}), box.top + 60]; }})()")

    def legend(self, one):
        return self.page.evaluate(f"Object.fromEntries({one}.entries.map((entry) => [entry.name, entry.value.textContent]))")

    def test_values_under_cursor(self):
        """Each sample, and what pointer and arrow keys show, against run.sqlite."""
        with runs.database(self.made) as tables:
            rows = tables.execute("SELECT mid_s, detections, stars_identified FROM detection_frames ORDER BY mid_s").fetchall()
            ranges = tables.execute("SELECT mid_s, range_m FROM truth WHERE kind = 'object' ORDER BY mid_s").fetchall()
        self.assertGreater(len(rows), FRAMES - 5)
        shown = self.page.evaluate(f"{DETECTIONS}.items.filter((item) => item.kind === 'line').map((item) => item.points.map((p) => [p.time, p.low, p.high]))")
        found = {round(time, 6): low for time, low, _ in shown[0]}
        for mid, all_of_them, stars in rows:
            self.assertEqual(found[round(mid, 6)], all_of_them)
        self.show(DETECTIONS)
        mid, all_of_them, stars = rows[len(rows) // 2]
        x, y = self.place(DETECTIONS, mid)
        self.mouse("mouseMoved", x, y)
        self.page.wait_for(DRAWN)
        self.assertEqual(self.legend(DETECTIONS), {"all": str(all_of_them), "identified as stars": str(stars), "others": str(all_of_them - stars)})
        # the keyboard: on to the next sample, and ten on
        self.page.evaluate(f"{DETECTIONS}.canvas.focus()")
        self.page.evaluate(f"{DETECTIONS}.group.setCursor({mid})")
        for key, shift, on in (("ArrowRight", False, 1), ("ArrowRight", True, 11), ("ArrowLeft", False, 10)):
            self.page.key(key, shift=shift)
            self.page.wait_for(DRAWN)
            there = rows[len(rows) // 2 + on]
            self.assertEqual(self.legend(DETECTIONS)["all"], str(there[1]))
            self.assertAlmostEqual(float(self.page.evaluate(f"{DETECTIONS}.canvas.getAttribute('aria-valuenow')")), there[0], places=6)
        self.assertIn(f"all {there[1]}", self.page.evaluate(f"{DETECTIONS}.canvas.getAttribute('aria-valuetext')"))
        # the cursor of the charts over time is one; the range has 5 digits
        self.show(RANGE)
        said = self.page.evaluate(f"{RANGE}.words.textContent")
        at = min(ranges, key=lambda row: abs(row[0] - there[0]))
        self.assertAlmostEqual(float(said.split("range ")[1].split(" km")[0]) / (at[1] * 1e-3), 1, delta=1e-4)
        self.assertEqual(self.page.messages, [])

    def test_zoom(self):
        """Dragging enlarges all charts over time; a double click, Escape and the button show all."""
        limits, heights = f"(() => {{ const {{ low, high }} = {POINTING}.range(); return [low, high]; }})()", f"{POINTING}.heights()"
        whole, tall = self.page.evaluate(limits), self.page.evaluate(heights)
        for back in ("double", "Escape", "button"):
            self.show(POINTING)
            (x0, y), (x1, _) = self.place(POINTING, 30), self.place(POINTING, 45)
            self.mouse("mousePressed", x0, y, clickCount=1)
            self.mouse("mouseMoved", (x0 + x1) / 2, y, buttons=1)
            self.mouse("mouseMoved", x1, y, buttons=1)
            self.mouse("mouseReleased", x1, y, clickCount=1)
            low, high = self.page.evaluate(limits)
            self.assertAlmostEqual(low, 30, delta=0.1)
            self.assertAlmostEqual(high, 45, delta=0.1)
            self.assertEqual(self.page.evaluate(f"{DETECTIONS}.range()"), {"low": low, "high": high})
            # in track the error is small: the vertical axis is that of what is in view
            self.assertLess(self.page.evaluate(heights)["high"], tall["high"] / 10)
            # the marks of the axis are in view, too
            self.page.wait_for(f"!{POINTING}.dirty && !{POINTING}.all.hidden")
            if back == "double":
                for count in (1, 2):
                    self.mouse("mousePressed", x0, y, clickCount=count)
                    self.mouse("mouseReleased", x0, y, clickCount=count)
            elif back == "Escape":
                self.page.evaluate(f"{POINTING}.canvas.focus()")
                self.page.key("Escape")
            else:
                self.page.evaluate(f"{POINTING}.all.click()")
            self.assertEqual(self.page.evaluate(limits), whole)
            self.page.wait_for(f"!{POINTING}.dirty && {POINTING}.all.hidden")
        self.assertEqual(self.page.evaluate(heights)["high"], tall["high"])

    def test_legend(self):
        """A button of the legend hides its line and shows it again."""
        self.show(DETECTIONS)
        ink = f"""(() => {{ const one = {DETECTIONS}, item = one.items.find((item) => item.kind === 'line' && item.entry.name === 'identified as stars');
            const wanted = item.colour.match(/[0-9a-f]{{2}}/gi).map((word) => parseInt(word, 16)), {{ data }} = one.canvas.getContext('2d').getImageData(0, 0, one.canvas.width, one.canvas.height);
            let count = 0;
            for (let i = 0; i < data.length; i += 4) count += Math.max(...wanted.map((part, k) => Math.abs(part - data[i + k]))) < 8;
            return count; }})()"""
        button = f"{DETECTIONS}.entries.find((entry) => entry.name === 'identified as stars').button"
        before = self.page.evaluate(ink)
        self.assertGreater(before, 100)
        self.page.evaluate(f"{button}.click()")
        self.page.wait_for(f"!{DETECTIONS}.dirty")
        self.assertEqual(self.page.evaluate(ink), 0)
        self.assertEqual(self.page.evaluate(f"{button}.getAttribute('aria-pressed')"), "false")
        self.page.evaluate(f"{button}.focus()")
        self.page.command("Input.dispatchKeyEvent", type="keyDown", key="Enter", code="Enter", text="\r", windowsVirtualKeyCode=13)
        self.page.command("Input.dispatchKeyEvent", type="keyUp", key="Enter", code="Enter", windowsVirtualKeyCode=13)
        self.page.wait_for(f"!{DETECTIONS}.dirty")
        self.assertGreater(self.page.evaluate(ink), 0.9 * before)  # a ring at the cursor hides some

    def test_dots(self):
        """Dots in no order: the nearest one, and its place on the sky."""
        self.show(SKY)
        dot = self.page.evaluate(f"""(() => {{ const one = {SKY}, dot = one.dots[3], box = one.canvas.getBoundingClientRect();
            return {{ x: box.left + one.toX(dot.time), y: box.top + one.toHeight()(dot.low), time: dot.time, low: dot.low }}; }})()""")
        self.mouse("mouseMoved", dot["x"] + 1, dot["y"] + 1)
        self.page.wait_for(DRAWN)
        said = self.page.evaluate(f"{SKY}.words.textContent")
        self.assertAlmostEqual(float(said.split("right ascension ")[1].split(" deg")[0]), dot["time"], delta=0.01)
        self.assertAlmostEqual(float(said.split("declination ")[1].split(" deg")[0].replace("−", "-")), dot["low"], delta=0.01)

    def test_without_scripts_and_in_print(self):
        """All charts are SVG then, as tall as with scripts."""
        seen = "[...document.querySelectorAll('svg.chart')].map((one) => one.getBoundingClientRect().height)"
        canvases = "[...document.querySelectorAll('canvas')].map((one) => one.clientHeight)"
        count = self.page.evaluate("document.report.charts.length")
        self.assertGreaterEqual(count, 12)
        self.assertEqual(self.page.evaluate(seen), [0] * count)
        drawn = self.page.evaluate(canvases)
        self.assertTrue(all(height > 150 for height in drawn), drawn)
        self.page.command("Emulation.setEmulatedMedia", media="print")
        self.assertTrue(all(height > 60 for height in self.page.evaluate(seen)))
        self.assertEqual(self.page.evaluate(canvases), [0] * count)
        self.page.command("Emulation.setEmulatedMedia", media="")
        self.page.command("Emulation.setScriptExecutionDisabled", value=True)
        try:
            self.open(self.file)
            end = time.monotonic() + 20
            while len(self.page.evaluate(seen)) != count and time.monotonic() < end:
                time.sleep(0.05)
            heights = self.page.evaluate(seen)
            self.assertEqual(self.page.evaluate(canvases), [])
            self.assertEqual(len(heights), count)
            for svg, canvas in zip(heights, drawn):
                self.assertAlmostEqual(svg, canvas, delta=3)
            self.assertEqual(self.page.evaluate("document.querySelectorAll('.legend button, .readout').length"), 0)
        finally:
            self.page.command("Emulation.setScriptExecutionDisabled", value=False)

    def test_hostile_names_and_policy(self):
        """Names are text; a script or a style that found its way into the page does not run."""
        self.assertEqual(self.page.evaluate("document.querySelector('h1').textContent"), "Run of " + HOSTILE)
        self.assertIn(HOSTILE_DEVICE, self.page.evaluate("document.body.textContent"))
        self.assertEqual(self.page.evaluate("String(window.hacked)"), "undefined")
        self.assertEqual(self.page.messages, [])
        with open(self.file, encoding="utf-8") as file:
            text = file.read()
        bad = os.path.join(runs.scratch(), "bad.html")
        with open(bad, "w", encoding="utf-8") as file:
            file.write(text.replace("</h1>", "</h1><script>window.hacked = 1</script><img src=\"x\" onerror=\"window.hacked = 2\"/>"
                                    "<style>h1{display:none}</style><p style=\"display:none\" id=\"bad\">x</p>", 1))
        self.open(bad)
        self.page.wait_for("!!document.report && !!document.getElementById('bad')")
        self.assertEqual(self.page.evaluate("[String(window.hacked), getComputedStyle(document.querySelector('h1')).display, "
                                            "getComputedStyle(document.getElementById('bad')).display]"), ["undefined", "block", "block"])
        self.assertGreaterEqual(len(self.page.messages), 3)


def load_tests(_, tests, __):
    return tests if FULL else unittest.TestSuite([Charts("test_hostile_names_and_policy")])


def tearDownModule():
    runs.clean()


if __name__ == "__main__":
    unittest.main()
