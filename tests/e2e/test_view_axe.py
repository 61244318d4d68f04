#!/usr/bin/env python3
"""Accessibility of every page of `boresight view`, light and dark, by axe-core: no violation of any of its rules.

axe-core comes from npm into a scratch folder, or from the file that the environment variable BORESIGHT_AXE names; the test is
skipped without both, and without Debian's chromium.

Usage, from the repository root: /usr/bin/python3 tests/e2e/test_view_axe.py BORESIGHT
"""
import os
import shutil
import subprocess
import unittest

import chromium
import runs
import test_view
import test_view_compare

# Rules, the first elements that break them and why.
LOOK = """axe.run(document, { resultTypes: ['violations'] }).then((found) => found.violations.map((one) =>
    [one.id, ...one.nodes.slice(0, 5).map((node) => `${node.target.join(' ')}: ${node.failureSummary}`)]))"""


def axe_core():
    """Text of axe-core; None: not to be had."""
    path = os.environ.get("BORESIGHT_AXE")
    if not path and shutil.which("npm"):
        folder = runs.scratch()
        path = os.path.join(folder, "node_modules/axe-core/axe.min.js")
        subprocess.run(["npm", "install", "--no-audit", "--no-fund", "--prefix", folder, "axe-core@4"], capture_output=True, timeout=300, check=False)
    if not path or not os.path.exists(path):
        return None
    with open(path, encoding="utf-8") as file:
        return file.read()


@unittest.skipUnless(chromium.PROGRAM, "there is no chromium")
class Accessible(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.axe = axe_core()
        if not cls.axe:
            raise unittest.SkipTest("there is no axe-core")
        test_view_compare.Compared.setUpClass()
        cls.study, (cls.first, cls.second) = test_view_compare.Compared.study, test_view_compare.Compared.pair
        cls.made = os.path.join(runs.scratch(), "run")
        runs.run(runs.STARE, cls.made, duration=3)

    def look(self, page, what):
        page.evaluate(self.axe + "; 1")
        with self.subTest(what):
            self.assertEqual(page.evaluate(LOOK), [])

    def go(self, page, viewer, condition):
        page.command("Page.navigate", url=viewer.url)
        page.wait_for(f"!!document.boresight && !!({condition})")

    def look_at_all(self, scheme):
        with chromium.Chromium(1280, 720) as page:
            page.command("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": scheme}])
            viewer = test_view.Viewer(None)
            self.go(page, viewer, "!document.getElementById('start').hidden")
            self.look(page, scheme + " start page")
            viewer.end()
            viewer = test_view.Viewer(self.made, self.second)
            self.go(page, viewer, "document.boresight.current === 0 && document.boresight.plots.panels.every((one) => one.lines.length)")
            self.look(page, scheme + " run")
            page.evaluate("document.getElementById('keys').showModal()")
            self.look(page, scheme + " list of keys")
            page.evaluate("document.getElementById('keys').close()")
            for tab, condition in (("space", "document.space && document.space.after"), ("why", "document.querySelector('.why-list li')"),
                                   ("compare", "document.comparison && document.comparison.panels"),
                                   ("editor", "document.editor && document.querySelector('.editor-figures').textContent")):
                page.evaluate(f"document.getElementById('tab-{tab}').click()")
                page.wait_for(f"!!({condition})")
                self.look(page, f"{scheme} {tab}")
            page.evaluate("document.editor.drop.take(new File([new Uint8Array(3)], 'a.bin'))")
            page.wait_for("document.getElementById('editor-message').textContent.includes('no known kind')")
            page.evaluate("""(() => { document.editor.drop.found = { kind: 'frame', offers: [{ text: 'Exposure time 1 s', from: 'EXPTIME', changes: [] }] };
                document.editor.drop.show('a.fits'); })()""")
            self.look(page, scheme + " dropped file")
            page.evaluate("document.editor.drop.dialog.close()")
            viewer.end()
            viewer = test_view.Viewer(self.study)
            self.go(page, viewer, "document.study")
            self.look(page, scheme + " study")
            viewer.end()
            self.look_live(page, scheme)

    def look_live(self, page, scheme):
        viewer = test_view.Viewer(runs.STARE, "--out", os.path.join(runs.scratch(), "live"), "--duration", "4", "--set", runs.GENERATOR)
        live = "document.boresight.live"
        self.go(page, viewer, f"{live} && {live}.state && {live}.state.run === 0 && document.boresight.run")
        page.key("n")
        page.wait_for(f"{live}.shown === 1")
        self.look(page, scheme + " live run")
        page.evaluate("document.getElementById('live-change').click()")
        page.wait_for("document.querySelectorAll('#change-fields input').length > 0")
        self.look(page, scheme + " changes of a live run")
        viewer.end()

    def look_at_reports(self, scheme):
        """Reports of a run and of a study, with a part enlarged, a cursor and a line that is hidden."""
        with chromium.Chromium(1280, 720) as page:
            page.command("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": scheme}])
            page.command("Page.setBypassCSP", enabled=True)  # for axe-core itself
            for folder in (self.made, self.study):
                runs.call_well("report", folder)
                page.command("Page.navigate", url=f"file://{folder}/report.html")
                page.wait_for("!!document.report")
                page.evaluate("""(() => { const one = document.report.charts.find((chart) => !chart.scatter), { low, high } = one.group.all;
                    one.canvas.scrollIntoView(); one.group.setRange(low, (low + high) / 2); one.group.setCursor(low + (high - low) / 3);
                    const button = document.querySelector('.legend button'); if (button) button.click(); })()""")
                page.wait_for("document.report.charts.every((chart) => !chart.visible || !chart.dirty)")
                self.look(page, f"{scheme} report of {folder}")

    def test_light(self):
        self.look_at_reports("light")
        self.look_at_all("light")

    def test_dark(self):
        self.look_at_reports("dark")
        self.look_at_all("dark")

    def test_keyboard(self):
        """Tab reaches every control that is shown on the page of a run, in the order of the page, and none holds it."""
        viewer = test_view.Viewer(self.made)
        with chromium.Chromium(1280, 720) as page:
            self.go(page, viewer, "document.boresight.current === 0")
            wanted = page.evaluate("""[...document.querySelectorAll('a[href], button, input, select, textarea, [tabindex="0"]')].filter((one) =>
                !one.disabled && one.offsetParent !== null && getComputedStyle(one).visibility === 'visible' && !one.closest('dialog')).length""")
            seen = []
            for _ in range(wanted + 5):
                page.key("Tab")
                seen.append(page.evaluate("[...document.querySelectorAll('*')].indexOf(document.activeElement)"))
                if len(set(seen)) < len(seen):
                    break
            reached = sorted(set(seen) - {page.evaluate("[...document.querySelectorAll('*')].indexOf(document.body)")})
            self.assertGreaterEqual(len(reached), wanted)
            self.assertEqual(seen[:len(reached)], reached)
        viewer.end()


def load_tests(loader, _, __):
    """Not the tests of the modules that are imported."""
    return loader.loadTestsFromTestCase(Accessible)


def tearDownModule():
    test_view.end_all()


if __name__ == "__main__":
    unittest.main()
