#!/usr/bin/env python3
"""Editor and space in a headless Chromium (Debian's package; skipped where there is none).

Usage, from the repository root: /usr/bin/python3 tests/e2e/test_view_panels_page.py BORESIGHT
"""
import json
import math
import os
import sqlite3
import unittest

import chromium
import runs
import test_view
import test_view_panels
from test_view_panels import ROOT, resolved

CHECKED = "document.editor && document.editor.number > 0 && document.editor.checked === document.editor.number"

# Goes to each key by what the form offers, changes it by its control, and looks at the document.
EVERY_KEY = """(async () => {
    const schema = await import('./schema.js'), values = await import('./scenario_values.js'), { editor } = document;
    const wrong = [];
    let keys = 0;
    const other = (of, before) => [of.minimum ?? 0, of.maximum ?? 1, 1, 2, 0.5].find((v) => v !== before && v >= (of.minimum ?? v) && v <= (of.maximum ?? v));
    schema.everyKey(editor.form.schema, (way, of) => {
        if (['object', 'list'].includes(schema.kindOf(of)) || of.isBranch) return;
        if (['extends', 'set', 'boresight'].includes(way[0])) return; // not of the form: the text has them
        editor.root = {};
        let at = editor.form.schema, pointer = '';
        for (let k = 0; k < way.length; k++) {
            const step = way[k], value = values.valueAt(editor.root, pointer);
            if (step === '*') {
                values.putAt(editor.root, pointer, [schema.firstValue(at.items)]); // as "Add" does
                at = at.items;
                pointer += '/0';
            } else if (step[0] === ':') {
                const branch = at.oneOf.find((one) => schema.branchName(one) === step.slice(1));
                const first = schema.firstValue(branch);
                if (branch.properties.type?.maxLength === undefined) first.type = step.slice(1); // as the list of types does
                values.putAt(editor.root, pointer, first);
            } else {
                const inner = schema.keysOfObject(at, value);
                let found = inner.find(([key]) => key === step);
                if (!found && at.if) { // by "plugin", which the form offers
                    values.putAt(editor.root, `${pointer}/${at.if.required[0]}`, 'x.so');
                    found = schema.keysOfObject(at, values.valueAt(editor.root, pointer)).find(([key]) => key === step);
                }
                if (!found) { wrong.push(`${way.join('/')}: not offered`); return; }
                at = found[1];
                pointer += `/${step}`;
            }
        }
        keys += 1;
        if (of.const !== undefined || (way.at(-1) === 'type' && of.enum && way.at(-2)[0] === ':')) return; // the list of types sets it
        const row = editor.form.row(of, pointer, way.at(-1)), control = row.querySelector('input, select'), kind = schema.kindOf(of);
        if (!row.querySelector('label') || !control) { wrong.push(`${pointer}: no control or label`); return; }
        const before = values.valueAt(editor.root, pointer) ?? of.default;
        let expected;
        if (kind === 'boolean') { expected = !control.checked; control.checked = expected; }
        else if (kind === 'choice') { expected = of.enum.find((word) => word !== control.value) ?? of.enum[0]; control.value = expected; }
        else if (kind === 'choices') { expected = [...new Set([...(before || []), control.value])]; control.checked = true; }
        else if (kind === 'number') { expected = other(of, before); control.value = String(expected); }
        else if (kind === 'numbers') { expected = new Array(of.minItems).fill(other(of.items, undefined)); control.value = expected.join(' '); }
        else if (kind === 'text') { expected = 'x7'; control.value = expected; }
        else { expected = { x: 1 }; control.value = '{"x": 1}'; }
        control.dispatchEvent(new Event(['INPUT'].includes(control.tagName) && control.type === 'text' ? 'input' : 'change'));
        if (!values.same(values.valueAt(editor.root, pointer), expected)) wrong.push(`${pointer}: ${JSON.stringify(values.valueAt(editor.root, pointer))} for ${JSON.stringify(expected)}`);
    });
    return { keys, wrong };
})()"""


@unittest.skipUnless(chromium.PROGRAM, "there is no chromium")
class Page(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.made, cls.folder = os.path.join(runs.scratch(), "run"), os.path.realpath(runs.scratch())
        runs.run(runs.STARE, cls.made, runs.NO_FRAMES, runs.GENERATOR, duration=3)
        cls.viewer = test_view_panels.Editor(cls.made, cls.folder)

    @classmethod
    def tearDownClass(cls):
        assert cls.viewer.end()[0] == 0

    def open(self, page):
        page.command("Page.navigate", url=self.viewer.url)
        page.wait_for("document.boresight && document.boresight.run")
        page.evaluate("document.getElementById('tab-editor').click()")
        page.wait_for(CHECKED)

    def type_into(self, page, element, text):
        """As a user: all that is there is replaced."""
        page.evaluate(f"(() => {{ const one = document.getElementById({json.dumps(element)}); one.focus(); one.select(); }})()")
        page.command("Input.insertText", text=text)

    def click(self, page, element):
        page.evaluate(f"document.getElementById({json.dumps(element)}).click()")

    def open_file(self, page, path):
        self.type_into(page, "editor-file", path)
        page.evaluate("document.editor.baseFile = null")  # it may be this file already
        self.click(page, "editor-open")
        page.wait_for(f"document.editor.baseFile === {json.dumps(path)}")

    def save(self, page, name):
        self.type_into(page, "editor-name", name)
        self.click(page, "editor-save")
        page.wait_for(f"document.getElementById('editor-message').textContent.startsWith('Saved: ') && document.getElementById('editor-message').textContent.includes({json.dumps(name)})")

    def test_every_key_is_editable(self):
        with chromium.Chromium(1280, 800) as page:
            self.open(page)
            found = page.evaluate(EVERY_KEY)
            self.assertEqual(found["wrong"], [])
            self.assertGreater(found["keys"], 1500)

    def test_every_shipped_scenario(self):
        """Opened, one value changed by its control, saved, reloaded: equal to --set."""
        files = [one["file"] for one in self.viewer.json("api/editor/list")["files"] if one["shipped"]]
        self.assertGreater(len(files), 25)
        with chromium.Chromium(1280, 800) as page:
            self.open(page)
            for k, path in enumerate(files):
                with self.subTest(path):
                    self.open_file(page, path)
                    pointer = "/duration_s" if k % 2 else "/observers/0/sensors/0/exposure/exposure_s"
                    value = 1.5 if k % 2 else 0.0625
                    page.evaluate(f"document.editor.form.goTo({json.dumps(pointer)})")
                    self.type_into(page, "value" + pointer, str(value))
                    name = f"made_{k}.json"
                    self.save(page, name)
                    with open(os.path.join(self.folder, name), encoding="utf-8") as file:
                        self.assertLess(len(file.read()), 300)
                    # reloaded by the page: the same values
                    page.evaluate("window.before = structuredClone(document.editor.root)")
                    self.open_file(page, name)
                    self.assertTrue(page.evaluate("import('./scenario_values.js').then((values) => values.same(window.before, document.editor.root))"))
                    # read by the program
                    mine = runs.call("check", name, cwd=self.folder)
                    asked = runs.call("check", path, "--set", f"{pointer}={value}")
                    self.assertEqual((mine.returncode, mine.stdout), (asked.returncode, asked.stdout))
            self.assertEqual(page.messages, [])

    def test_run_equals_set(self):
        with chromium.Chromium(1280, 800) as page:
            self.open(page)
            self.open_file(page, os.path.join(ROOT, "scenarios/day_generator.json"))
            page.evaluate("document.editor.form.goTo('/observers/0/sensors/0/camera/read_noise_e')")
            self.type_into(page, "value/observers/0/sensors/0/camera/read_noise_e", "12.5")
            self.save(page, "noisy.json")
        one, two = os.path.join(runs.scratch(), "one"), os.path.join(runs.scratch(), "two")
        runs.run(os.path.join(self.folder, "noisy.json"), one, duration=20)
        runs.run("scenarios/day_generator.json", two, "/observers/0/sensors/0/camera/read_noise_e=12.5", duration=20)
        tables = [runs.call_well("export", made, "--table", "csv", "--out", made + ".csv") for made in (one, two)]
        self.assertEqual(len(tables), 2)
        self.assertEqual(test_view.digests(one + ".csv"), test_view.digests(two + ".csv"))

    def test_text_and_form_follow_each_other(self):
        with chromium.Chromium(1280, 800) as page:
            self.open(page)
            base = os.path.join(ROOT, "scenarios/neossat_geo_stare.json")
            text = json.dumps({"boresight": 1, "extends": base, "set": {"/observers/0/sensors/0/camera/bits": 12}})
            self.type_into(page, "editor-text", text)
            page.wait_for(f"document.editor.baseFile === {json.dumps(base)} && {CHECKED}")
            page.evaluate("document.editor.form.goTo('/observers/0/sensors/0/camera/bits')")
            self.assertEqual(page.evaluate("document.getElementById('value/observers/0/sensors/0/camera/bits').value"), "12")
            # wrong: marked in the row, in the list, and by sections; the first wrong line is found in broken text
            self.type_into(page, "value/observers/0/sensors/0/camera/bits", "77")
            page.wait_for(CHECKED)
            self.assertIn("out of range", page.evaluate("document.querySelector('.row.wrong .problem').textContent"))
            self.assertIn('"/observers/0/sensors/0/camera/bits": 77', page.evaluate("document.getElementById('editor-text').value"))
            self.type_into(page, "editor-text", '{\n"a" 3}')
            page.wait_for(CHECKED)
            self.assertIn("line 2, column 5", page.evaluate("document.getElementById('editor-problems').textContent"))
            # search, and what was changed only
            self.open_file(page, base)
            self.type_into(page, "editor-search", "read noise")
            self.assertTrue(page.evaluate("!!document.getElementById('value/observers/0/sensors/0/camera/read_noise_e')"))
            self.assertEqual(page.messages, [])

    def test_hostile_names_and_labels(self):
        hostile = test_view.HOSTILE
        with chromium.Chromium(1280, 800) as page:
            self.open(page)
            page.evaluate(f"document.editor.set('/world/objects/0/name', {json.dumps(hostile)}, true)")
            page.wait_for(CHECKED)
            page.evaluate("document.editor.form.goTo('/world/objects/0/name')")
            self.assertEqual(page.evaluate("document.querySelectorAll('script').length"), 1)
            self.assertEqual(page.evaluate("document.getElementById('value/world/objects/0/name').value"), hostile.replace("\n", ""))
            nameless = page.evaluate("""[...document.querySelectorAll('#panel-editor :is(button, input, select, textarea), dialog.satellites :is(button, input, textarea)')]
                .filter((one) => !(one.getAttribute('aria-label') || one.getAttribute('aria-labelledby') || one.textContent.trim() || (one.labels && one.labels.length))).map((one) => one.outerHTML)""")
            self.assertEqual(nameless, [])
            self.assertEqual(page.messages, [])

    def test_dropped_file(self):
        """A TLE that is dropped becomes the orbit of the target, under its name; a file of no known kind is named."""
        with open("scenarios/objects_2022-06.tle", encoding="utf-8") as file:
            lines = file.read().splitlines()
        first = next(k for k, line in enumerate(lines) if line.startswith("1 "))
        drop = """((name, text) => { const transfer = new DataTransfer(); transfer.items.add(new File([text], name));
            document.getElementById('panel-editor').dispatchEvent(new DragEvent('drop', { dataTransfer: transfer, bubbles: true, cancelable: true })); })"""
        with chromium.Chromium(1280, 800) as page:
            self.open(page)
            # beside the editor a file is neither taken nor opened by the browser
            left = """(where => ['dragover', 'drop'].map((name) => { const transfer = new DataTransfer(); transfer.items.add(new File(['x'], 'left.tle'));
                const event = new DragEvent(name, { dataTransfer: transfer, bubbles: true, cancelable: true }); document.querySelector(where).dispatchEvent(event); return event.defaultPrevented; }))"""
            for where in ("header", "#tabs", "footer"):
                self.assertEqual(page.evaluate(f"{left}('{where}')"), [True, True], where)
            self.assertNotIn("left.tle", page.evaluate("document.getElementById('editor-message').textContent"))
            page.evaluate(f"{drop}('my sat.tle', {json.dumps(chr(10).join(['MINE', *lines[first:first + 2]]))})")
            page.wait_for("document.querySelector('dialog.drop').open")
            self.assertEqual(page.evaluate(f"{left}('dialog.drop')"), [True, True])
            self.assertEqual(page.evaluate("document.getElementById('drop-title').textContent"), "my sat.tle")
            self.assertEqual(page.evaluate("[document.getElementById('drop-for').value, document.getElementById('drop-set-label').hidden]"), ["/world/objects/0", True])
            page.evaluate("document.getElementById('drop-use').click()")
            orbit = page.evaluate("[document.editor.root.world.objects[0].orbit, document.editor.root.world.objects[0].name]")
            self.assertEqual(orbit, [{"source": "sgp4", "tle_line1": lines[first], "tle_line2": lines[first + 1]}, "MINE"])
            page.evaluate(f"{drop}('x.bin', '\\u0000')")
            page.wait_for("document.getElementById('editor-message').textContent.startsWith('x.bin: is of no known kind')")
            page.evaluate("document.editor.drop.take({ name: 'big.fits', size: 1e9 })")
            self.assertEqual(page.evaluate("document.getElementById('editor-message').textContent"), "big.fits: has 953.7 MiB (allowed: 40 MiB).")
            self.assertEqual([text for text in page.messages if "400" not in text], [])  # of the refused file

    def test_shape_and_keep_out(self):
        """Close to an object with a shape its facets are drawn, lit by the Sun; cones are drawn for what the scenario keeps out."""
        made = os.path.join(runs.scratch(), "shape")
        runs.run("scenarios/inspection.json", made, runs.NO_FRAMES, runs.SENSOR + "/modules/control/guidance/sun_keep_out_deg=30", duration=4)
        viewer = test_view_panels.Editor(made, self.folder)
        bright = """(() => { const { painter } = document.space, { width, height } = painter.canvas, data = new Uint8Array(4 * width * height);
            document.space.draw(); painter.gl.readPixels(0, 0, width, height, painter.gl.RGBA, painter.gl.UNSIGNED_BYTE, data);
            let count = 0; for (let k = 0; k < data.length; k += 4) if (data[k] > 70 && data[k + 1] > 50) count++; return count; })()"""
        with chromium.Chromium(1280, 800) as page:
            page.command("Page.navigate", url=viewer.url)
            page.wait_for("document.boresight && document.boresight.run && document.boresight.count > 0")
            self.click(page, "tab-space")
            page.wait_for("document.space && document.space.after && document.getElementById('space-readout').textContent.includes('keep-out of 30.0')")
            cones = page.evaluate(bright)
            page.evaluate("document.getElementById('space-keep-out').checked = false")
            self.assertGreater(cones, page.evaluate(bright) + 100)  # lines of the cone
            self.click(page, "space-close")
            page.wait_for("[...document.space.shapes.shapes.values()][0].buffer && document.getElementById('space-readout').textContent.includes('Sunlight')")
            self.assertGreater(page.evaluate(bright), 3000)  # 4.7 m across in 14 m: some 100 px
            self.assertIn("as recorded in this frame", page.evaluate("document.getElementById('space-readout').textContent"))
            self.click(page, "space-close")
            self.assertEqual(page.evaluate("document.space.camera.distance"), 4)
            self.assertEqual(page.messages, [])
        self.assertEqual(viewer.end()[0], 0)

    def test_space(self):
        """Pixels of the picture are what the geometry says; time, camera and frames go together; 5,000 bodies."""
        made = os.path.join(runs.scratch(), "many")
        # the target is 180 px away from the middle in the first frame, along neither axis
        runs.run("scenarios/constellation_quick.json", made, runs.NO_FRAMES, runs.DARK, runs.SENSOR + "/cue/offset_deg=0.15",
                 runs.SENSOR + "/camera/rotation_deg=30", duration=4)
        viewer = test_view_panels.Editor(made, self.folder)
        with chromium.Chromium(1280, 800) as page:
            page.command("Performance.enable", timeDomain="threadTicks")
            page.command("Page.navigate", url=viewer.url)
            page.wait_for("document.boresight && document.boresight.run && document.boresight.count > 0")
            self.click(page, "tab-space")
            page.wait_for("document.space && document.space.before")
            self.assertGreater(page.evaluate("document.space.names.length"), 5000)
            # the middle of the picture is the Earth at the sub-camera point: by day if the Sun is up there
            look = """((azimuth, elevation) => { const view = document.space, gl = view.painter.gl, pixel = new Uint8Array(4);
                view.camera = { azimuth, elevation, distance: 9 };
                for (const id of ['space-orbits', 'space-fields']) document.getElementById(id).checked = false;
                view.painter.setBodies(new Float32Array(0));
                view.draw();
                gl.readPixels(view.painter.canvas.width / 2, view.painter.canvas.height / 2, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, pixel);
                return [...pixel]; })"""
            sun = page.evaluate("[...document.space.before.slice(0, 3)]")
            azimuth, elevation = math.atan2(sun[1], sun[0]), math.asin(sun[2] / math.hypot(*sun))
            day, night = page.evaluate(f"{look}({azimuth}, {elevation})"), page.evaluate(f"{look}({azimuth + math.pi}, {-elevation})")
            self.assertGreater(day[2], 3 * night[2])
            self.assertGreater(night[2], 0)  # the Earth, not the sky
            corner = page.evaluate("(() => { const gl = document.space.painter.gl, pixel = new Uint8Array(4); gl.readPixels(2, 2, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, pixel); return [...pixel]; })()")
            self.assertLess(max(corner[:3]), 20)
            # the telescope's own view has the target where its pixel is
            page.evaluate("document.space.setThrough(true)")
            place = page.evaluate("""(() => { const view = document.space, stage = document.getElementById('space-stage'), math = import('./space_math.js');
                return math.then((m) => { const { eye, matrix } = view.view(stage.clientWidth, stage.clientHeight), sensor = view.scene.sensors[0];
                    const at = m.onScreen(matrix, m.add(view.placeOf(sensor.object + view.scene.observers.length), eye, -1), stage.clientWidth, stage.clientHeight);
                    return [(at.x - stage.clientWidth / 2) / stage.clientHeight, (at.y - stage.clientHeight / 2) / stage.clientHeight, 3 * m.length(m.add(sensor.corners[0], sensor.corners[3], -1))]; }); })()""")
            with sqlite3.connect(os.path.join(made, "run.sqlite")) as tables:
                x, y, width, height, scale = tables.execute("""SELECT x_mid_px, y_mid_px, width_px, height_px, sensors.pixel_scale_arcsec FROM truth
                    JOIN sensors USING (sensor) WHERE sensor = 0 AND kind != 'star' AND truth.id = (SELECT id FROM objects WHERE name = target)""").fetchone()
            self.assertGreater(min(abs(x - (width - 1) / 2), abs(y - (height - 1) / 2)), 40)
            # 9 px: light time and aberration (26 arcsec) are not drawn
            self.assertAlmostEqual(place[0] * place[2] / math.radians(scale / 3600), x - (width - 1) / 2, delta=9)
            self.assertAlmostEqual(place[1] * place[2] / math.radians(scale / 3600), y - (height - 1) / 2, delta=9)
            page.evaluate("document.space.setThrough(false)")
            # the slider moves the frames, and the frames the slider
            page.evaluate("document.space.goTo(3, true)")
            page.wait_for("Math.abs(document.boresight.timeOf(document.boresight.current) - 3) < 1.1")
            page.evaluate("document.boresight.goTo(0)")
            page.wait_for("document.space.time === document.boresight.timeOf(0)")
            # why: at the end of the second frame it is detected
            self.click(page, "tab-why")
            page.evaluate("document.boresight.goTo(1)")
            page.wait_for("document.querySelector('.why-text')?.textContent.startsWith('Detected ')")
            self.assertEqual(page.evaluate("document.querySelectorAll('.why-list li.now').length"), 1)
            self.click(page, "tab-space")
            # 30 pictures a second leave 33 ms of the page's thread for each
            task = lambda: {one["name"]: one["value"] for one in page.command("Performance.getMetrics")["metrics"]}["TaskDuration"]
            page.evaluate("document.space.step = -1; document.space.goTo(1, false)")
            before = task()
            page.evaluate("(() => { for (let k = 0; k < 50; k++) document.space.turn(0.01, 0); })()")
            self.assertLess((task() - before) / 50, 0.033)
            self.assertEqual(page.messages, [])
        self.assertEqual(viewer.end()[0], 0)

    def test_new_scenario_by_clicks(self):
        """Own TLEs, own telescope, from opening the editor to the saved file in at most 25 actions; its run has the target in track."""
        with open("scenarios/catalogue_2022-06.tle", encoding="utf-8") as file:
            lines = [line.rstrip() for line in file]
        eye = lines.index(next(line for line in lines if line.startswith("1 39089")))
        with chromium.Chromium(1280, 800) as page:
            actions = []

            def act(what, *words):
                actions.append(what)
                what(page, *words)

            page.command("Page.navigate", url=self.viewer.url)
            page.wait_for("document.boresight && document.boresight.run")
            act(self.click, "tab-editor")
            page.wait_for(CHECKED)
            # the observer's TLE is pasted; the target is chosen by its name
            for pointer, find in (("/observers/0/orbit", None), ("/world/objects/0/orbit", "INMARSAT GX5")):
                actions.append("open the section")
                page.evaluate(f"document.editor.form.goTo({json.dumps(pointer)})")
                actions.append("Satellite or TLE")
                page.evaluate(f"[...document.querySelectorAll('details')].find((one) => one.dataset.pointer === {json.dumps(pointer)}).querySelector('.tools button').click()")
                if find:
                    act(self.type_into, "satellite-find", find)
                    page.wait_for("document.querySelectorAll('#satellite-list button').length === 1")
                    actions.append("choose")
                    page.evaluate("document.querySelector('#satellite-list button').click()")
                else:
                    act(self.type_into, "satellite-tle", "\n".join(lines[eye:eye + 2]))
                    act(self.click, "satellite-use")
            for key, value in (("aperture_m", "0.2"), ("pixel_scale_arcsec", "4"), ("read_noise_e", "6")):
                actions.append("find the key")
                page.evaluate(f"document.editor.form.goTo('/observers/0/sensors/0/camera/{key}')")
                act(self.type_into, f"value/observers/0/sensors/0/camera/{key}", value)
            page.wait_for(CHECKED)
            self.assertIn("The scenario is right", page.evaluate("document.getElementById('editor-problems').textContent"))
            act(self.type_into, "editor-name", "by_clicks.json")
            act(self.click, "editor-save")
            page.wait_for("document.getElementById('editor-message').textContent.startsWith('Saved: ')")
            self.assertLessEqual(len(actions), 25)
            self.assertEqual(page.messages, [])
        made = resolved("by_clicks.json", folder=self.folder)
        self.assertEqual(made["observers"][0]["orbit"]["tle_line1"], lines[eye])
        self.assertEqual(made["observers"][0]["sensors"][0]["camera"]["aperture_m"], 0.2)
        out = os.path.join(runs.scratch(), "clicks")
        manifest = runs.run(os.path.join(self.folder, "by_clicks.json"), out, "/record/frames=none", duration=60)
        self.assertEqual(manifest["summary"]["final_mode"], "track")


def tearDownModule():
    test_view.end_all()


if __name__ == "__main__":
    unittest.main()
