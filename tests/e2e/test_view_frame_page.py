#!/usr/bin/env python3
"""What the page says about a frame, in a headless Chromium (Debian's package; skipped where there is none): the frame without
noise and both in turn, places that were expected of tracks, the detections that made a track, the reason of the frame, values
under the pointer in all plots, and a page that is as narrow as a tablet.

Usage, from the repository root: /usr/bin/python3 tests/e2e/test_view_frame_page.py BORESIGHT
"""
import os
import sqlite3
import unittest

import numpy
from astropy.io import fits

import chromium
import runs
import test_view
import test_view_page

SHOWN = test_view_page.SHOWN
VIEW = "document.boresight.frameView"
SMALL = [f"{runs.SENSOR}/camera/{side}_px=256" for side in ("width", "height")]


@unittest.skipUnless(chromium.PROGRAM, "there is no chromium")
class Frame(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.made = os.path.join(runs.scratch(), "run")
        # a faint target, that is missed now and then
        runs.run(runs.TRACK, cls.made, *SMALL, '/record/planes=["stars", "targets", "background"]', runs.SENSOR + "/cue/offset_deg=0.02",
                 runs.SENSOR + "/cue/sigma_deg=0.02", "/world/objects/0/area_m2=0.62", runs.SENSOR + "/cue/v_mag=15", duration=36)
        cls.viewer = test_view.Viewer(cls.made)

    @classmethod
    def tearDownClass(cls):
        assert cls.viewer.end()[0] == 0

    def tables(self, query):
        with sqlite3.connect(os.path.join(self.made, "run.sqlite")) as database:
            return database.execute(query).fetchall()

    def open(self, page, frame):
        page.command("Page.navigate", url="about:blank")
        page.command("Page.navigate", url=f"{self.viewer.url}#frame={frame}")
        page.wait_for(f"{SHOWN} === {frame} && document.boresight.plots.cursor > {frame} && document.boresight.plots.panels.length > 0 && document.boresight.plots.panels.every((one) => one.lines.length > 0)")

    def expected(self):
        """Frame 20 without noise, DN."""
        with fits.open(os.path.join(self.made, "frames.fits")) as file:
            gain, offset = file[21].header["GAIN"], file[21].header["OFFSET"]
        light = numpy.zeros((256, 256))
        for plane in ("stars", "targets", "background"):
            with fits.open(os.path.join(self.made, plane + ".fits")) as file:
                light += file[21].data
        return light / gain + offset

    def test_frame_without_noise(self):
        """The sum of the planes over the gain, plus the offset, at every pixel; B goes on to both in turn, and back."""
        expected = self.expected()
        with chromium.Chromium(1280, 720) as page:
            self.open(page, 20)
            page.key("b")
            page.wait_for(f"{VIEW}.clean && {VIEW}.cleanShown")
            clean = numpy.array(page.evaluate(f"[...{VIEW}.drawn.data]")).reshape(256, 256)
            # 0.501: rounding to whole numbers; planes are added in 32 bits
            numpy.testing.assert_allclose(clean, expected, rtol=0, atol=0.501)
            self.assertGreater(clean.max() - clean.min(), 30)
            self.assertFalse(page.evaluate("document.getElementById('clean-shown').hidden"))
            page.key("b")
            page.wait_for(f"{VIEW}.clean && !{VIEW}.cleanShown")
            page.wait_for(f"{VIEW}.clean && {VIEW}.cleanShown")
            page.key("ArrowRight")
            page.wait_for(f"{SHOWN} === 21 && {VIEW}.clean")
            page.key("b")
            page.wait_for(f"{VIEW}.clean === null && {VIEW}.drawn === {VIEW}.image")
            self.assertEqual(page.messages, [])

    def test_frame_without_noise_in_parts(self):
        """Of a frame that is sent binned: the same bins, and where the view is enlarged a part with all pixels."""
        expected, drawn = self.expected(), f"(() => {{ const {{ x, y, width, height, binning, data }} = {VIEW}.drawnPart || {VIEW}.drawn; return [x, y, width, height, binning, [...data]]; }})()"

        def check(binning):
            x, y, width, height, n, data = page.evaluate(drawn)
            self.assertEqual(n, binning)
            means = expected.reshape(256 // n, n, 256 // n, n).mean(axis=(1, 3))[y // n:y // n + height, x // n:x // n + width]
            # 1.001: rounding to whole numbers, twice
            numpy.testing.assert_allclose(numpy.array(data).reshape(height, width), means, rtol=0, atol=1.001)

        with chromium.Chromium(1280, 720) as page:
            self.open(page, 20)
            page.evaluate(f"(() => {{ const app = document.boresight; {VIEW}.longest = () => 64; app.cache.clear(); app.current = -1; return app.goTo(20); }})()")
            page.wait_for(f"{SHOWN} === 20 && {VIEW}.image.binning === 4")
            page.evaluate(f"{VIEW}.zoomTo(0.2)")
            page.key("b")
            page.wait_for(f"{VIEW}.cleanShown")
            check(4)
            page.evaluate(f"{VIEW}.zoomTo(40)")
            page.wait_for(f"{VIEW}.cleanPart && {VIEW}.cleanPart.binning === 1")
            check(1)
            page.key("ArrowRight")
            page.wait_for(f"{SHOWN} === 21 && {VIEW}.cleanShown && {VIEW}.cleanPart && document.getElementById('problems').hidden")
            self.assertEqual(page.messages, [])

    def test_tracks(self):
        """Expected places are those of the truth; a click on the track lists its detections as the tables have them; a line
        goes to its frame; the reason of the frame is over the picture."""
        rows = self.tables("SELECT exposure_id, misses_in_row, hits, x_px, y_px FROM tracks WHERE target_of_interest = 1")
        self.assertTrue(any(row[1] for row in rows), "no track coasts: the test needs another brightness")
        coasts, last = next(row[0] for row in rows if row[1]), rows[-1][0]
        place = f"(() => {{ const {{ tracks, predicted, target }} = {VIEW}.sorted; return [tracks[0].x, tracks[0].y, tracks[0].coasts, target[0].x, target[0].y, predicted.length]; }})()"
        with chromium.Chromium(1280, 720) as page:
            self.open(page, coasts)
            x, y, dashed, true_x, true_y, count = page.evaluate(place)
            # 1 px: some sigma of the prediction
            self.assertLess(numpy.hypot(x - true_x, y - true_y), 1)
            self.assertEqual((dashed, count), (True, 1))
            page.wait_for("!document.getElementById('reason').hidden")
            self.assertRegex(page.evaluate("document.getElementById('reason').textContent"), "too faint|not detected")
            page.evaluate(f"document.boresight.goTo({last})")
            page.wait_for(f"{SHOWN} === {last}")
            page.evaluate(f"{VIEW}.zoomTo(4); {VIEW}.centreTarget()")
            left, top = page.evaluate(f"""(() => {{ const at = {VIEW}.toScreen({VIEW}.sorted.tracks[0].x, {VIEW}.sorted.tracks[0].y), box = {VIEW}.overlay.getBoundingClientRect();
                return [at.x + box.left, at.y + box.top]; }})()""")
            for kind in ("mousePressed", "mouseReleased"):
                page.command("Input.dispatchMouseEvent", type=kind, x=left, y=top, button="left", clickCount=1)
            page.wait_for("document.querySelectorAll('.why-table tbody tr').length > 3")
            listed = page.evaluate("[...document.querySelectorAll('.why-table tbody tr')].filter((one) => one.cells[3].textContent !== 'none').map((one) => [one.cells[0].textContent, one.cells[4].textContent])")
            track = self.tables("SELECT track_id FROM tracks WHERE target_of_interest = 1 ORDER BY rowid DESC LIMIT 1")[0][0]
            made = self.tables(f"SELECT exposure_id, x_px, y_px FROM tracks WHERE track_id = {track} AND misses_in_row = 0 ORDER BY rowid DESC")
            self.assertEqual(listed, [[str(row[0] + 1), f"{row[1]:.2f}, {row[2]:.2f}"] for row in made])
            page.evaluate("document.querySelector('.why-table tbody tr:last-child button').click()")
            page.wait_for(f"{SHOWN} === {made[-1][0]}")
            self.assertEqual(page.messages, [])

    def test_values_under_the_pointer(self):
        """The pointer over one plot gives the values at its time in all of them; the frame stays."""
        values = "document.boresight.plots.panels.map((one) => one.values[0].number.textContent)"
        with chromium.Chromium(1280, 720) as page:
            self.open(page, 23)
            before = page.evaluate(values)
            self.assertTrue({"track_error", "innovation"} <= set(page.evaluate("document.boresight.plots.panels.map((one) => one.info.name)")))
            left, top = page.evaluate("(() => { const box = document.querySelector('#panels canvas').getBoundingClientRect(); return [box.left + 0.45 * box.width, box.top + 20]; })()")
            page.command("Input.dispatchMouseEvent", type="mouseMoved", x=left, y=top)
            page.wait_for(f"document.boresight.plots.pointed !== null && document.getElementById('range').textContent.startsWith('at ')")
            pointed = page.evaluate("document.boresight.plots.pointed")
            aim = [row for row in self.tables("SELECT time_s, aim_error_x_px, aim_error_y_px FROM control") if row[0] <= pointed][-1]
            shown = page.evaluate("Number(document.boresight.plots.panels[0].values[1].number.textContent)")
            self.assertAlmostEqual(shown, numpy.hypot(*aim[1:]), delta=0.006 * numpy.hypot(*aim[1:]) + 1e-3)  # three digits
            page.command("Input.dispatchMouseEvent", type="mouseMoved", x=10, y=10)
            page.wait_for(f"document.boresight.plots.pointed === null && JSON.stringify({values}) === JSON.stringify({before})")
            self.assertEqual(page.evaluate(SHOWN), 23)

    def test_narrow_pages(self):
        """Nothing reaches beyond the page, nor out of its panel: 1280 x 720, and a tablet upright."""
        cut = """[...document.querySelectorAll('.bar, .panel-head, .legend, .zoom, footer, header, .why-table, .space-bar, .editor-bar')].filter((one) => one.offsetParent
            && (one.scrollWidth > one.clientWidth + 1 || one.getBoundingClientRect().right > innerWidth + 1)).map((one) => `${one.className} ${one.id} ${one.textContent.slice(0, 40)}`)"""
        for size in ((1280, 720), (820, 1180), (768, 1024)):
            with chromium.Chromium(*size) as page:
                self.open(page, 20)
                for tab in ("frame", "space", "why", "editor"):
                    page.evaluate(f"document.getElementById('tab-{tab}').click()")
                    page.wait_for(f"document.boresight.panels.current === '{tab}' && (document.boresight.panels.boxes.get('{tab}').ready === undefined || document.boresight.panels.boxes.get('{tab}').box.children.length > 0)")
                    self.assertEqual(page.evaluate(cut), [], (size, tab))
                    self.assertLessEqual(page.evaluate("document.documentElement.scrollWidth"), size[0], (size, tab))


def load_tests(loader, _, __):
    """Not the tests of the modules that are imported."""
    return loader.loadTestsFromTestCase(Frame)


def tearDownModule():
    test_view.end_all()


if __name__ == "__main__":
    unittest.main()
