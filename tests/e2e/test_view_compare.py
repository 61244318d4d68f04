#!/usr/bin/env python3
"""`boresight view STUDY` and `boresight view RUN RUN`: over the network interface, and with --page in a headless Chromium.

Usage, from the repository root: /usr/bin/python3 tests/e2e/test_view_compare.py BORESIGHT [--page]
"""
import csv
import json
import os
import sys
import unittest
import urllib.error
import urllib.request

import chromium
import runs
import test_view

PAGE = "--page" in sys.argv[1:]
if PAGE:
    sys.argv.remove("--page")
NOISE = runs.SENSOR + "/camera/read_noise_e"


def post(viewer, route, **body):
    """Status and answer of a POST from the viewer's own page."""
    request = urllib.request.Request(viewer.url + route, json.dumps(body).encode(), {"Origin": viewer.url[:viewer.url.index("/", 7)]})
    try:
        with urllib.request.urlopen(request, timeout=60) as answer:
            return answer.status, json.load(answer)
    except urllib.error.HTTPError as error:
        return error.code, error.read().decode()


def column(table, name):
    """Cells of a column of the answer."""
    index = [one["name"] for one in table["columns"]].index(name)
    return [run["cells"][index] for run in table["runs"]]


class Compared(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = runs.scratch()
        study = {"boresight_study": 1, "name": "noise", "kind": "loop", "seed": "0x1",
                 "scenarios": [{"file": os.path.abspath(runs.STARE)}], "keep": "tables",
                 "set": {"/duration_s": 2, "/world/star_catalogue": "embedded", **dict([runs.GENERATOR.split("=")])},
                 "sweeps": [{"axes": [{"path": NOISE, "values": [5, 20]}]}]}
        path = os.path.join(cls.folder, "study.json")
        with open(path, "w", encoding="utf-8") as file:
            json.dump(study, file)
        cls.study = os.path.join(cls.folder, "out")
        runs.call_well("study", path, "--out", cls.study, "--quiet")
        cls.pair = [os.path.join(cls.study, "runs", f"{k:06}") for k in range(2)]

    def test_study(self):
        """Cells are those of runs.csv; runs whose folder was kept open, others say why not."""
        viewer = test_view.Viewer(self.study)
        self.assertTrue(viewer.json("api/session")["study"])
        table = viewer.json("api/study")
        with open(os.path.join(self.study, "runs.csv"), encoding="utf-8", newline="") as file:
            rows = list(csv.DictReader(file))
        self.assertEqual((table["name"], table["total"], len(table["runs"])), ("noise", 2, len(rows)))
        for one in table["columns"]:
            expected = [row[one["name"]] for row in rows]
            for cell, text in zip(column(table, one["name"]), expected):
                if isinstance(cell, (int, float)):
                    # 1e-14: cJSON writes 15 digits where they are within 2.2e-16 of the number
                    self.assertAlmostEqual(cell, float(text), delta=1e-14 * abs(cell), msg=one)
                else:
                    self.assertEqual("" if cell is None else cell, text, one)
        roles = {one["name"]: one["role"] for one in table["columns"]}
        self.assertEqual((roles["read_noise_e"], roles["detections"], roles["run"]), ("parameter", "figure", ""))
        self.assertEqual([run["folder"] for run in table["runs"]], [True, True])
        status, answer = post(viewer, "api/study/open", number=1)
        self.assertEqual((status, answer), (200, {"run": 0}))
        self.assertEqual(viewer.json("api/run?run=0")["name"], "000001")
        for number in (7, -1, 1e300, "1", None):
            status, answer = post(viewer, "api/study/open", number=number)
            self.assertEqual(status, 404)
            self.assertIn("was not kept", answer)
        self.assertEqual(viewer.status("/{token}/api/study/open", method="POST", more="Content-Length: 2\r\n"), 403)
        self.assertEqual(viewer.end()[0], 0)

    def test_many_runs(self):
        """More runs than a viewer keeps open: each one answers, also those whose files were closed meanwhile."""
        for k in range(2, 90):
            os.symlink("000000", os.path.join(self.study, "runs", f"{k:06}"))
        viewer = test_view.Viewer(self.study)
        asked = ("frames?run=0", "plot?run=0&panel=detections&to=10", "run?run=0", "space/states?run=0&from=1")
        self.assertEqual(post(viewer, "api/study/open", number=0)[0], 200)
        first = [viewer.get("api/" + one)[0] for one in asked]
        for k in range(2, 90):
            self.assertEqual(post(viewer, "api/study/open", number=k), (200, {"run": k - 1}))
            viewer.get(f"api/space/states?run={k - 1}&from=1")
        self.assertLess(len(os.listdir(f"/proc/{viewer.process.pid}/fd")), 60)
        self.assertEqual([viewer.get("api/" + one)[0] for one in asked], first)
        self.assertEqual(viewer.json("api/run?run=88")["name"], "000089")
        self.assertEqual(viewer.end()[0], 0)
        for k in range(2, 90):
            os.remove(os.path.join(self.study, "runs", f"{k:06}"))

    def test_two_runs(self):
        viewer = test_view.Viewer(self.pair[0], self.pair[1])
        listed = viewer.json("api/runs")["open"]
        self.assertEqual(listed, [{"number": k, "name": path} for k, path in enumerate(self.pair)])
        self.assertEqual([viewer.json(f"api/run?run={k}")["name"] for k in range(2)], ["000000", "000001"])
        self.assertEqual(viewer.status("/{token}/api/study"), 404)
        self.assertEqual(viewer.end()[0], 0)
        alone = " is the folder of a study, which is shown alone"
        for words, text in (((*self.pair, self.pair[0]), "one or two folders of runs"), ((self.pair[0], runs.STARE), runs.STARE + " is a scenario file"),
                            ((runs.STARE, self.pair[0]), runs.STARE + " is a scenario file"), ((self.pair[0], self.study), self.study + alone),
                            ((self.study, self.pair[0]), self.study + alone), ((self.study, self.study), self.study + alone)):
            result = runs.call("view", "--no-browser", *words)
            self.assertEqual(result.returncode, 2, words)
            self.assertIn(text, result.stderr)

    @unittest.skipUnless(PAGE and chromium.PROGRAM, "without --page, or there is no chromium")
    def test_page_of_a_study(self):
        """Columns sort, a figure is drawn over a parameter, a click opens the run, and the name leads back."""
        viewer = test_view.Viewer(self.study)
        with chromium.Chromium(1280, 720) as page:
            page.command("Page.navigate", url=viewer.url)
            page.wait_for("document.study && document.querySelectorAll('.study-plot circle').length === 2")
            cells = "[...document.querySelectorAll('.study-table tbody tr')].map((row) => row.cells[0].textContent)"
            self.assertEqual(page.evaluate(cells), ["0", "1"])
            for expected in (["0", "1"], ["1", "0"]):
                page.evaluate("[...document.querySelectorAll('.study-table thead button')].find((one) => one.textContent === 'read noise e').click()")
                self.assertEqual(page.evaluate(cells), expected)
            page.evaluate("document.querySelector('.study-plot circle').dispatchEvent(new MouseEvent('click'))")
            page.wait_for("document.boresight && document.boresight.run && document.boresight.run.name === '000000'")
            page.evaluate("document.getElementById('tab-compare').click()")
            page.wait_for("document.comparison && document.comparison.choice.options.length === 1 && document.comparison.panels")
            page.evaluate("document.querySelector('h1 a').click()")
            page.wait_for("document.study && document.querySelectorAll('.study-plot circle').length === 2")
            self.assertEqual(page.messages, [])
        self.assertEqual(viewer.end()[0], 0)

    @unittest.skipUnless(PAGE and chromium.PROGRAM, "without --page, or there is no chromium")
    def test_page_of_two_runs(self):
        """Figures and their difference are those of the manifests; both frames follow the slider."""
        viewer = test_view.Viewer(*self.pair)
        summaries = []
        for path in self.pair:
            with open(os.path.join(path, "manifest.json"), encoding="utf-8") as file:
                summaries.append(json.load(file)["summary"])
        with chromium.Chromium(1280, 720) as page:
            page.command("Page.navigate", url=viewer.url)
            page.wait_for("document.boresight && document.boresight.current === 0")
            page.evaluate("document.getElementById('tab-compare').click()")
            page.wait_for("document.comparison && document.comparison.panels && document.comparison.sides[1].details")
            found = page.evaluate("""import('./compare.js').then(({ differences }) => differences(document.boresight.run.manifest.summary,
                document.comparison.b.described.manifest.summary).map(({ name, a, b }) => [name, a, b]))""")
            found = {name: (a, b) for name, a, b in found}
            for key in ("detections", "pointing_rms_px", "frames"):
                if isinstance(summaries[0].get(key), (int, float)):
                    self.assertEqual(found[key], (summaries[0][key], summaries[1][key]))
            page.evaluate("document.boresight.goTo(1)")
            page.wait_for("document.comparison.sides.every((side) => side.details && side.details.exposure_id === 1)")
            page.evaluate("(() => { document.comparison.how.value = 'over'; document.comparison.arrange(); })()")
            self.assertEqual(page.evaluate("getComputedStyle(document.comparison.sides[1].stage).opacity"), "0.5")
            self.assertEqual(page.messages, [])
        self.assertEqual(viewer.end()[0], 0)


def tearDownModule():
    test_view.end_all()


if __name__ == "__main__":
    unittest.main()
