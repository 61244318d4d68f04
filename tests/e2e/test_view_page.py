#!/usr/bin/env python3
"""The page of `boresight view` in a headless Chromium (Debian's package; skipped where there is none), and the data of a
cube with a window.

Usage, from the repository root: /usr/bin/python3 tests/e2e/test_view_page.py BORESIGHT
"""
import base64
import json
import os
import subprocess
import time
import unittest

import numpy
from astropy.io import fits
from astropy.wcs import WCS

import chromium
import overlay
import runs
import test_view

SHOWN = "document.boresight && document.boresight.current"


class Cube(test_view.Checks):
    def test_cube_in_a_window(self):
        out = os.path.join(runs.scratch(), "cube")
        runs.run(runs.STARE, out, "/record/frames=cube", runs.SENSOR + '/exposure/window_px=[100, 60, 200, 160]', duration=2)
        viewer = test_view.Viewer(out)
        with fits.open(os.path.join(out, "frames.fits")) as file:
            self.check_pixels(viewer, list(next(hdu.data for hdu in file if numpy.ndim(hdu.data) == 3)))
        self.check_marks(viewer, out, 1)
        self.check_slow_uploads(viewer, 4, whole=True)
        self.assertEqual(viewer.end()[0], 0)


@unittest.skipUnless(chromium.PROGRAM, "there is no chromium")
class Large(unittest.TestCase):
    """A frame of 3000 x 2600 pixels, compressed."""
    @classmethod
    def setUpClass(cls):
        cls.made = os.path.join(runs.scratch(), "large")
        camera = runs.SENSOR + "/camera/"
        runs.run(runs.STARE, cls.made, camera + "width_px=3000", camera + "height_px=2600", camera + "pixel_scale_arcsec=1",
                 "/record/frames=extensions", "/record/compression=rice", duration=2)

    def read_back(self, page, place):
        found = page.evaluate("""(() => {
            const view = document.boresight.frameView, image = %s;
            view.painter.draw(view.image, view.drawing(), view.part, view.part && view.drawing(view.part));
            const bytes = new Uint8Array(view.painter.readBack(%d).buffer);
            let text = '';
            for (let i = 0; i < bytes.length; i += 8192) text += String.fromCharCode(...bytes.subarray(i, i + 8192));
            return [image.x, image.y, image.width, image.height, image.binning, btoa(text)];
        })()""" % ("view.part" if place else "view.image", place))
        pixels = numpy.frombuffer(base64.b64decode(found[5]), "<u2").reshape(found[3], found[2])
        return found[:2], found[4], pixels

    def test_zoom(self):
        """Means of bins that fit the stage, and every pixel of the shown part: panned over the whole frame, all of them; also
        in the next frame."""
        viewer = test_view.Viewer(self.made)
        part = "(() => { const v = document.boresight.frameView; return v.part && !v.loadingPart && !v.wantedPart(v.part); })()"
        with chromium.Chromium(1280, 720) as page, fits.open(self.made + "/frames.fits") as file:
            for painter in ("?webgl", "?plain"):
                page.command("Page.navigate", url="about:blank")
                page.command("Page.navigate", url=f"{viewer.url}{painter}#frame=0")
                page.wait_for(SHOWN + " === 0")
                image = file[1].data
                _, n, pixels = self.read_back(page, 0)
                self.assertGreater(n, 3)
                self.assertLessEqual(max(pixels.shape), 768)
                whole = image[:2600 // n * n, :3000 // n * n].astype(int)
                sums = whole.reshape(2600 // n, n, 3000 // n, n).sum(axis=(1, 3))
                self.assertTrue(numpy.array_equal(pixels[:2600 // n, :3000 // n], (2 * sums + n * n) // (2 * n * n)))
                seen = numpy.zeros(image.shape, bool)
                for y in range(250, 2800, 500):
                    for x in range(300, 3200, 600):
                        page.evaluate("(() => { const v = document.boresight.frameView; Object.assign(v.view, "
                                      f"{{ x: {x}.3, y: {y}.1, scale: 1.25, fitted: false }}); v.redraw(); }})()")
                        page.wait_for(part)
                        (x0, y0), n, pixels = self.read_back(page, 1)
                        height, width = pixels.shape
                        self.assertEqual(n, 1)
                        self.assertTrue(numpy.array_equal(pixels, image[y0:y0 + height, x0:x0 + width]), (x, y))
                        seen[y0:y0 + height, x0:x0 + width] = True
                self.assertTrue(seen.all())
                # the value below the cursor, and the same place in the next frame
                page.key("ArrowRight")
                page.wait_for(SHOWN + " === 1")
                (x0, y0), n, pixels = self.read_back(page, 1)
                height, width = pixels.shape
                self.assertTrue(numpy.array_equal(pixels, file[2].data[y0:y0 + height, x0:x0 + width]))
                page.evaluate("(() => { const v = document.boresight.frameView; v.cursor = { x: 2990, y: 2590 }; v.redraw(); })()")
                page.wait_for(f"document.getElementById('readout').textContent.includes('{file[2].data[2590, 2990]} DN')")
            self.assertEqual(page.messages, [])
        self.assertEqual(viewer.end()[0], 0)


class Running(unittest.TestCase):
    def test_run_in_progress(self):
        """A later look finds what was recorded since, and in the end the folder under its final name."""
        out = os.path.join(runs.scratch(), "run")
        process = subprocess.Popen(runs.command(runs.STARE, out, "/pacing/mode=realtime", duration=12), stdout=subprocess.DEVNULL)
        while not os.path.exists(out + ".partial/run.sqlite"):
            self.assertIsNone(process.poll())
            time.sleep(0.05)
        viewer = test_view.Viewer(out + ".partial/")
        counts, states = [0], set()
        while "complete" not in states:
            described = viewer.json("api/refresh")
            states.add(described["state"])
            self.assertLessEqual(states, {"still running", "left over from a killed run", "complete"})
            counts.append(described["sensors"][0]["frames"])
            self.assertGreaterEqual(counts[-1], counts[-2])
            time.sleep(0.5)
        self.assertGreater(len(set(counts)), 3)
        self.assertEqual((process.wait(60), counts[-1], described["name"]), (0, 12, "run"))
        self.assertEqual(viewer.json("api/refresh")["sensors"][0]["frames"], 12)
        self.assertEqual(len(viewer.get("api/pixels?frame=11")[0]), 2 * 1024 * 1024)
        self.assertEqual(viewer.end()[0], 0)


    @unittest.skipUnless(chromium.PROGRAM, "there is no chromium")
    def test_exported_while_in_progress(self):
        """The page says that the run was in progress, and asks nobody for more."""
        out, page_file = (os.path.join(runs.scratch(), name) for name in ("run", "run.html"))
        process = subprocess.Popen(runs.command(runs.STARE, out, "/pacing/mode=realtime", duration=8), stdout=subprocess.DEVNULL)
        while not os.path.exists(out + ".partial/frames.fits"):
            self.assertIsNone(process.poll())
            time.sleep(0.05)
        result = runs.call("export", out + ".partial", "--page", page_file)
        self.assertEqual((result.returncode, process.wait(60)), (0, 0), result.stderr)
        with chromium.Chromium(1280, 720) as page:
            page.command("Page.navigate", url="file://" + page_file)
            page.wait_for("document.boresight && document.getElementById('run-state').textContent")
            time.sleep(2.5)  # looks at a folder are 2 s apart
            self.assertEqual(page.evaluate("[document.getElementById('run-state').textContent, document.getElementById('problems').textContent]"),
                             ["still running when exported", ""])
            self.assertEqual(page.messages, [])


@unittest.skipUnless(chromium.PROGRAM, "there is no chromium")
class Page(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.made = os.path.join(runs.scratch(), "<b>run")
        target = json.dumps(test_view.HOSTILE)
        runs.run(runs.TRACK, cls.made, f"/world/objects/0/name={target}", f"{runs.SENSOR}/cue/object={target}",
                 runs.SENSOR + '/camera/distortion={"k1": -200}', duration=24)
        cls.viewer = test_view.Viewer(cls.made)
        cls.files = fits.open(os.path.join(cls.made, "frames.fits"))

    @classmethod
    def tearDownClass(cls):
        cls.files.close()
        assert cls.viewer.end()[0] == 0

    def open(self, page, frame, more=""):
        page.command("Page.navigate", url="about:blank")
        page.command("Page.navigate", url=f"{self.viewer.url}{more}#frame={frame}")
        page.wait_for(f"{SHOWN} === {frame} && document.boresight.plots.panels.length > 0")

    def shown_pixels(self, page):
        text = page.evaluate("""(() => {
            const view = document.boresight.frameView;
            view.painter.draw(view.image, view.drawing());
            const bytes = new Uint8Array(view.painter.readBack().buffer);
            let text = '';
            for (let i = 0; i < bytes.length; i += 8192) text += String.fromCharCode(...bytes.subarray(i, i + 8192));
            return btoa(text);
        })()""")
        return numpy.frombuffer(base64.b64decode(text), "<u2").reshape(1024, 1024)

    def test_every_pixel_and_overlay(self):
        """Read back from the graphics processor: all 16 bits. Marks are where the tables say, on the screen."""
        with chromium.Chromium(1280, 720) as page:
            self.open(page, 20, "?webgl")
            self.assertEqual(page.evaluate("document.boresight.frameView.painter.constructor.name"), "WebglPainter")
            self.assertTrue(numpy.array_equal(self.shown_pixels(page), self.files[21].data))
            page.key("ArrowRight")
            page.wait_for(SHOWN + " === 21")
            self.assertTrue(numpy.array_equal(self.shown_pixels(page), self.files[22].data))
            page.key("Home")
            page.wait_for(SHOWN + " === 0")
            page.key("End")
            page.wait_for(SHOWN + " === 23")
            found = page.evaluate("""(() => {
                const view = document.boresight.frameView, target = view.sorted.target[0], at = view.toScreen(target.x, target.y);
                return [target.x, target.y, at.x, at.y, view.view.scale, view.stage.clientWidth, view.stage.clientHeight];
            })()""")
            x, y, left, top, scale, width, height = found
            # the frame is centred: pixel 511.5 in the middle of the stage; exact but for rounding
            self.assertAlmostEqual(left, width / 2 + (x - 511.5) * scale, delta=1e-6)
            self.assertAlmostEqual(top, height / 2 + (y - 511.5) * scale, delta=1e-6)
            self.assertEqual(page.messages, [])

    def test_screen_shows_the_stretch(self):
        """Colours on the screen are those of the stretch at every pixel of a zoomed part: WebGL and the 2D canvas alike."""
        look = """(() => {
            const app = document.boresight, view = app.frameView, law = document.getElementById('law');
            view.toggleMarks(); law.value = 'manual'; view.limits = { black: 480, white: 620 };
            Object.assign(view.view, { x: 500, y: 500, scale: 8, fitted: false });
            view.painter.draw(view.image, view.drawing());
            const copy = document.createElement('canvas'), w = copy.width = view.canvas.width, h = copy.height = view.canvas.height;
            const context = copy.getContext('2d');
            context.drawImage(view.canvas, 0, 0);
            const data = context.getImageData(0, 0, w, h).data, grey = [];
            for (let y = 490; y < 510; y++) for (let x = 490; x < 510; x++) {
                const at = view.toScreen(x, y);
                grey.push(data[4 * (Math.floor(at.y) * w + Math.floor(at.x))]);
            }
            return grey;
        })()"""
        with chromium.Chromium(1280, 720) as page:
            # Chromium's WebGL is software here, for which the page would choose the 2D canvas
            for more, painter in (("?webgl", "WebglPainter"), ("?plain", "CanvasPainter"), ("", "CanvasPainter")):
                self.open(page, 20, more)
                self.assertEqual(page.evaluate("document.boresight.frameView.painter.constructor.name"), painter)
                part = self.files[21].data[490:510, 490:510].astype(float)
                expected = 255 * numpy.clip((part - 480) / 140, 0, 1)
                # 1: rounding of the graphics processor to 8 bits
                numpy.testing.assert_allclose(page.evaluate(look), expected.ravel(), rtol=0, atol=1)

    def test_directions(self):
        """RA and Dec of pixels, with distortion, and back, against astropy."""
        with chromium.Chromium(800, 600) as page:
            self.open(page, 20)
            wcs = WCS(self.files[21].header)
            self.assertIsNotNone(wcs.sip)
            pixels = [[0, 0], [1023, 0], [0, 1023], [1023, 1023], [511.5, 511.5], [123.25, 871.75]]
            found = page.evaluate(f"""import('./wcs.js').then((wcs) => {json.dumps(pixels)}.map(([x, y]) => {{
                const header = document.boresight.frameView.details.wcs, sky = wcs.pixelToSky(header, x, y);
                const back = wcs.skyToPixel(header, sky.ra, sky.dec);
                return [sky.ra, sky.dec, back.x, back.y];
            }}))""")
            expected = wcs.all_pix2world(numpy.array(pixels), 0)
            # 1e-9 deg: 4 microarcsec, rounding of the trigonometry; 1e-6 px: the iteration's end
            numpy.testing.assert_allclose(numpy.array(found)[:, :2], expected, rtol=0, atol=1e-9)
            numpy.testing.assert_allclose(numpy.array(found)[:, 2:], pixels, rtol=0, atol=1e-6)

    def test_hostile_names_and_labels(self):
        """Names are text, nothing is blocked by the policy, every control has a name."""
        with chromium.Chromium(1280, 720) as page:
            self.open(page, 20)
            self.assertEqual(page.evaluate("document.getElementById('run-name').textContent"), "<b>run")
            self.assertEqual(page.evaluate("document.boresight.frameView.sorted.target[0].text"), test_view.HOSTILE)
            self.assertEqual(page.evaluate("document.querySelectorAll('script').length"), 1)
            self.assertEqual(page.evaluate("document.querySelectorAll('b:not(.value b)').length"), 0)
            nameless = page.evaluate("""[...document.querySelectorAll('button, input, select, canvas:not([aria-hidden])')].filter((one) =>
                !(one.getAttribute('aria-label') || one.textContent.trim() || (one.labels && one.labels.length))).map((one) => one.outerHTML)""")
            self.assertEqual(nameless, [])
            self.assertEqual(page.messages, [])

    def test_exported_page(self):
        """One file from file://, without a server: binned pixels, marks in their places, plots of all exposures, names as text;
        frames are left out until it fits."""
        page_file, small = (os.path.join(runs.scratch(), name) for name in ("run.html", "small.html"))
        self.assertIn("24 of 24 frames, 2 x 2", runs.call_well("export", self.made, "--page", page_file))
        runs.call_well("export", self.made, "--page", small, "--page-limit", "2")
        self.assertLess(os.path.getsize(small), 2e6)
        self.assertLess(os.path.getsize(page_file), 20e6)
        with chromium.Chromium(1280, 720) as page:
            page.command("Page.navigate", url="file://" + page_file.replace("<", "%3C"))
            page.wait_for(SHOWN + " === 0 && document.boresight.plots.panels.every((panel) => panel.lines.length > 0)")
            self.assertEqual(page.evaluate("document.boresight.count"), 24)
            page.key("End")
            page.wait_for(SHOWN + " === 23")
            shown = page.evaluate("(() => { const i = document.boresight.frameView.image; return [i.width, i.height, i.frameWidth, ...i.data]; })()")
            blocks = self.files[24].data.astype(int).reshape(512, 2, 512, 2).sum(axis=(1, 3))
            self.assertEqual(shown, [512, 512, 1024, *((blocks + 2) // 4).ravel().tolist()])
            at = page.evaluate("""(() => {
                const view = document.boresight.frameView, target = view.sorted.target[0], at = view.toScreen(target.x, target.y);
                return [target.text, at.x - view.stage.clientWidth / 2 - (target.x - 511.5) * view.view.scale];
            })()""")
            self.assertEqual(at[0], test_view.HOSTILE)
            self.assertAlmostEqual(at[1], 0, delta=1e-6)
            page.wait_for("document.boresight.strip.kept.size > 5")
            page.wait_for("document.boresight.plots.panels.every((panel) => panel.lines.length > 0)")
            samples = page.evaluate("document.boresight.plots.panels.find((p) => p.info.name === 'detections').lines[0].map((p) => p.high)")
            numbers = self.viewer.numbers("api/plot?sensor=0&panel=detections&from=0&to=100&columns=2000")
            self.assertEqual(samples, numbers[1:1 + 3 * int(numbers[0])].reshape(-1, 3)[:, 2].tolist())
            page.evaluate("document.getElementById('tab-why').click()")
            page.wait_for("document.querySelectorAll('.why-list li').length > 1")
            page.evaluate("document.getElementById('tab-space').click()")
            page.wait_for("document.space && document.space.after && document.getElementById('space-readout').textContent.includes('km')")
            self.assertEqual(page.evaluate("document.space.overlay.clientHeight > 400"), True)
            self.assertEqual(page.evaluate("document.querySelectorAll('b:not(.value b), a[href]').length"), 0)
            self.assertEqual(page.messages, [])
            page.command("Page.navigate", url="file://" + small)
            page.wait_for(SHOWN + " === 0")
            self.assertIn("of 24 frames", page.evaluate("document.getElementById('exported').textContent"))
            self.assertLess(page.evaluate("document.boresight.count"), 24)

    def test_film_strip(self):
        """As many pictures as fit, of the time that the plots show; a click and the arrow keys go to their frames."""
        frames = "document.boresight.strip.frames"
        with chromium.Chromium(1280, 720) as page:
            self.open(page, 0)
            page.wait_for(f"{frames}.length > 5 && document.boresight.strip.kept.size === {frames}.length")
            shown = page.evaluate(frames)
            self.assertEqual((shown[0], shown[-1]), (0, 23))
            width = page.evaluate("[document.getElementById('strip').scrollWidth, document.getElementById('strip').clientWidth]")
            self.assertLessEqual(width[0], width[1])
            # fields of the stretch show the longest level of 16 bits whole
            for name, value in (("black", "-65536"), ("white", "131072")):
                wide = page.evaluate(f"(() => {{ const field = document.getElementById('{name}'), was = field.value; field.value = '{value}'; const found = [field.scrollWidth, field.clientWidth]; field.value = was; return found; }})()")
                self.assertLessEqual(wide[0], wide[1], name)
            sky = """(() => { const { kept, canvas } = document.boresight.strip, [one] = kept.values(), bright = (c, x, y, side) => Math.max(...c.getContext('2d').getImageData(x, y, side, side).data.filter((_, k) => k % 4 === 0));
                return [one.width, bright(one, 0, 0, one.width), ...[...document.querySelectorAll('#strip [data-frame]')].map((cell) => bright(canvas, cell.offsetLeft + 3, cell.offsetTop + 3, 52) > 200)]; })()"""
            self.assertEqual(page.evaluate(sky), [79, 255, *[True] * len(shown)])
            page.evaluate(f"document.querySelector('[data-frame=\"{shown[3]}\"]').click()")
            page.wait_for(f"{SHOWN} === {shown[3]} && document.querySelector('#strip [aria-selected=true]').dataset.frame === '{shown[3]}'")
            page.evaluate("document.getElementById('strip').focus()")
            for key, frame in (("ArrowRight", shown[4]), ("End", 23), ("ArrowLeft", shown[-2])):
                page.key(key)
                page.wait_for(f"{SHOWN} === {frame}")
            page.evaluate("document.boresight.plots.setRange(4.9, 8.1)")
            page.wait_for("document.boresight.strip.frames.length < 6")
            times = self.viewer.numbers("api/frames?sensor=0").reshape(-1, 5)[:, 1]
            self.assertEqual(page.evaluate(frames), numpy.flatnonzero((times >= 4.9) & (times <= 8.1)).tolist())
            page.evaluate("document.getElementById('strip-shown').click()")
            self.assertEqual(page.evaluate("document.getElementById('strip').hidden"), True)
            self.assertEqual(page.messages, [])

    def test_events_and_plots_move_the_frame(self):
        with chromium.Chromium(1280, 720) as page:
            self.open(page, 0)
            page.evaluate("[...document.querySelectorAll('#events button')].at(-1).click()")
            page.wait_for(SHOWN + " > 15")
            events = self.viewer.json("api/events")["events"]
            rows = self.viewer.numbers("api/frames?sensor=0").reshape(-1, 5)
            nearest = int(numpy.argmin(abs(rows[:, 1] - events[-1]["time_s"])))
            page.wait_for(f"{SHOWN} === {nearest}")
            self.assertEqual(page.evaluate("document.boresight.plots.cursor"), rows[nearest, 1])
            # a click in a plot goes to its time, dragging shows a range, a double click all of it
            plots = "document.boresight.plots"
            whole = page.evaluate(plots + ".range")
            place = lambda time_s: page.evaluate(f"""(() => {{ const {{ canvas }} = {plots}.panels[0], box = canvas.getBoundingClientRect();
                return {{ x: box.left + {plots}.toX({time_s}), y: box.top + box.height / 2 }}; }})()""")
            def mouse(kind, time_s, **more):
                page.command("Input.dispatchMouseEvent", type=kind, button="left", **place(time_s), **more)
            for kind in ("mousePressed", "mouseReleased"):
                mouse(kind, rows[8, 1], clickCount=1)
            page.wait_for(SHOWN + " === 8")
            start, end = place(rows[4, 1]), place(rows[12, 1])
            for kind, at in (("mousePressed", start), ("mouseMoved", end), ("mouseReleased", end)):
                page.command("Input.dispatchMouseEvent", type=kind, button="left", buttons=1, clickCount=1, **at)
            shown = page.evaluate(plots + ".range")
            self.assertAlmostEqual(shown["from"], rows[4, 1], delta=0.1)
            self.assertAlmostEqual(shown["to"], rows[12, 1], delta=0.1)
            for count in (1, 2):
                for kind in ("mousePressed", "mouseReleased"):
                    page.command("Input.dispatchMouseEvent", type=kind, button="left", clickCount=count, **start)
            self.assertEqual(page.evaluate(plots + ".range"), whole)
            self.assertEqual(page.messages, [])


@unittest.skipUnless(chromium.PROGRAM, "there is no chromium")
class LongRun(unittest.TestCase):
    # the true target's mark alone
    MARK = overlay.script("target", """
        return [...centre(0, 0, overlay.width, overlay.height), view.view.scale, view.stage.clientWidth, view.stage.clientHeight];
    """, prepare="view.sorted.target[0].text = '';")

    def test_truth_at_frame_200(self):
        """With the mouse on the slider and with keys: the mark that is drawn is where the table of the truth says."""
        out = os.path.join(runs.scratch(), "long")
        runs.run(runs.TRACK, out, duration=240)
        database = runs.database(out)
        rows = database.execute("SELECT x_mid_px, y_mid_px FROM truth WHERE kind = 'object' AND in_field = 1 AND exposure_id ="
                                " (SELECT exposure_id FROM exposures ORDER BY start_tick LIMIT 1 OFFSET 200)").fetchall()
        database.close()
        viewer = test_view.Viewer(out)
        with chromium.Chromium(1280, 720) as page:
            page.command("Page.navigate", url=viewer.url + "#frame=0")
            page.wait_for(SHOWN + " === 0")
            count = page.evaluate("document.boresight.count")
            left, top, width, height = page.evaluate("(() => { const box = document.getElementById('slider').getBoundingClientRect(); return [box.x, box.y, box.width, box.height]; })()")
            for kind in ("mousePressed", "mouseReleased"):
                page.command("Input.dispatchMouseEvent", type=kind, x=left + 8 + (width - 16) * 200 / (count - 1), y=top + height / 2, button="left", clickCount=1)
            page.wait_for(f"{SHOWN} >= 190 && {SHOWN} <= 210")
            for _ in range(20):
                before = page.evaluate(SHOWN)
                if before == 200:
                    break
                page.key("ArrowRight" if before < 200 else "ArrowLeft")
                page.wait_for(f"{SHOWN} === {before + (1 if before < 200 else -1)}")
            page.wait_for("document.boresight.frameView.sorted && document.boresight.frameView.sorted.target.length === 1")
            at_x, at_y, scale, wide, high = page.evaluate(self.MARK)
            self.assertEqual(len(rows), 1)
            x, y = rows[0][0], rows[0][1]
            self.assertAlmostEqual(at_x, wide / 2 + (x - 511.5) * scale, delta=0.5)
            self.assertAlmostEqual(at_y, high / 2 + (y - 511.5) * scale, delta=0.5)
            print(f"truth at frame 200: mark {at_x - wide / 2 - (x - 511.5) * scale:.3f}, {at_y - high / 2 - (y - 511.5) * scale:.3f} px of the screen from its place")
        self.assertEqual(viewer.end()[0], 0)


class LivePage(unittest.TestCase):
    def test_live(self):
        """Keys step and run it, the form changes it, the page shows the newest frame and then plays the run back."""
        out = os.path.join(runs.scratch(), "live")
        viewer = test_view.Viewer(runs.TRACK, "--out", out, "--duration", "12", "--set", "/world/star_catalogue=embedded")
        live = "document.boresight.live"
        with chromium.Chromium(1280, 720) as page:
            page.command("Page.navigate", url=viewer.url)
            page.wait_for(f"document.boresight && {live} && {live}.state && {live}.state.run === 0 && document.boresight.run")
            page.key("n")
            page.wait_for(f"{live}.shown === 1 && {live}.state.paused")
            first = page.evaluate("Array.from(document.boresight.frameView.image.data.subarray(0, 5000))")
            page.evaluate("document.getElementById('live-change').click()")
            page.wait_for("document.getElementById('change-burn-along') !== null")
            page.evaluate("""(() => {
                document.querySelector('[data-pointer$="control/exposure_s"]').value = '0.25';
                document.getElementById('change-burn-along').value = '30';
                document.getElementById('change-apply').click();
            })()""")
            page.wait_for(f"{live}.state.changes === 2 && {live}.state.paused")
            page.evaluate("document.getElementById('changes').close()")
            page.evaluate("document.getElementById('live-rate').value = '0'")
            page.key("r")
            page.wait_for(f"{live}.state.ended && document.boresight.run.state === 'complete'")
            page.key("Home")
            page.wait_for(SHOWN + " === 0")
            self.assertEqual(page.messages, [])
        self.assertEqual(viewer.end()[0], 0)
        with fits.open(out + "/frames.fits") as file:
            self.assertEqual(first, file[1].data.ravel()[:5000].tolist())
        with open(out + "/scenario.json", encoding="utf-8") as file:
            changes = [change["set"] for change in json.load(file)["changes"]]
        self.assertEqual([changes[0], changes[1].split("=")[0]],
                         [runs.SENSOR + "/modules/control/exposure_s=0.25", "/world/objects/0/burns"])


def tearDownModule():
    test_view.end_all()


if __name__ == "__main__":
    unittest.main()
