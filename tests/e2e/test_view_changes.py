#!/usr/bin/env python3
"""Every change that the form of a live run offers (view/page/changes.js) is made while a run goes on, is an event of the run, and
repeats: `boresight run` of its scenario.json gives equal tables.

Usage, from the repository root: /usr/bin/python3 tests/e2e/test_view_changes.py BORESIGHT
"""
import json
import os
import unittest

import live_page
import runs
import test_view
import test_view_live

SENSOR = runs.SENSOR
CHANGES = [f"{SENSOR}/modules/control/exposure_s=0.25", f"{SENSOR}/exposure/period_s=0.5", f"{SENSOR}/exposure/window_px=[128,128,768,768]", f"{SENSOR}/exposure/binning=2",
           f"{SENSOR}/camera/gain_e_per_dn=2.5", f"{SENSOR}/exposure/dropped_fraction=0.2", f"{SENSOR}/modules/scenegen/star_limit_v_mag=11", f"{SENSOR}/modules/gimbal/platform/jitter_low_px_rms=0.8",
           f"{SENSOR}/modules/gimbal/platform/jitter_high_px_rms=0.3", f"{SENSOR}/modules/control/compensator/gain_scale=0.8", f"{SENSOR}/modules/gimbal/natural_frequency_hz=7",
           f"{SENSOR}/modules/gimbal/platform/spacecraft/attitude/law=\"nadir\"", "/world/faint_limit_v_mag=12", '/world/objects/0/attitude=[{"from_s":1,"law":"sun"}]', f'{SENSOR}/cue/object="OTHER"']
SETS = [runs.GENERATOR, "/world/star_catalogue=embedded", '/world/faint_stars="statistical"', "/world/faint_limit_v_mag=13", f'{SENSOR}/modules/control/compensator={{"type": "pid", "bandwidth_hz": 0.1}}',
        f'{SENSOR}/modules/gimbal/platform/spacecraft={{"type": "rigid_body"}}',
        '/world/objects=[{"name": "INMARSAT GX5", "orbit": {"source": "sgp4", "elements_file": "catalogue_2022-06.tle", "norad": 44801}, "area_m2": 4, "albedo": 0.25,'
        ' "brightness": {"model": "shape"}, "shape": {"materials": [{"name": "gold", "library": "mli_gold"}], "parts": [{"name": "body", "kind": "box",'
        ' "size_m": [1, 1, 1], "position_m": [0, 0, 0], "material": "gold"}]}},'
        ' {"name": "OTHER", "orbit": {"source": "sgp4", "elements_file": "catalogue_2022-06.tle", "norad": 44801}, "area_m2": 2, "albedo": 0.25}]']


class Changes(test_view_live.Tables):
    def test_every_change_repeats(self):
        folder = runs.scratch()
        out, again = folder + "/run", folder + "/again"
        viewer = test_view.Viewer(runs.TRACK, "--out", out, "--duration", "6", "--threads", "1", *[word for one in SETS for word in ("--set", one)])
        page = live_page.Socket(viewer)
        self.assertEqual(page.status, 101)
        state = page.state(lambda now: now["run"] == 0)
        for count, change in enumerate(CHANGES, 1):
            if count % 4 == 1:
                state = page.state(lambda now: now["paused"] and not now["steps"] and now["time_s"] > state["time_s"], {"do": "step", "frames": 1})
            state = page.state(lambda now, count=count: now["changes"] == count or now["message"], {"do": "set", "set": change})
            self.assertEqual((state["message"], state["changes"]), ("", count), change)
        page.state(lambda now: now["ended"], {"do": "run", "rate": 0})
        page.close()
        self.assertEqual(viewer.end()[0], 0)
        events = [row[4] for row in test_view_live.tables(out)["events"] if row[3] == "change"]
        self.assertEqual(events, CHANGES)
        with open(os.path.join(out, "scenario.json"), encoding="utf-8") as file:
            self.assertEqual([one["set"] for one in json.load(file)["changes"]], CHANGES)
        runs.run(out + "/scenario.json", again)
        self.assert_equal(out, again)


def load_tests(loader, _, __):
    """Not the tests of the modules that are imported."""
    return loader.loadTestsFromTestCase(Changes)


def tearDownModule():
    test_view.end_all()


if __name__ == "__main__":
    unittest.main()
