"""Runs and commands of the program from Python: summary, tables, frames, pd, loop, orbit, report."""
import gc
import os
import pathlib
import pickle
import signal
import tempfile
import threading
import time
import unittest

import numpy as np

from support import MAIN, SMALL, bst, main


class Runs(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.result = bst.run(SMALL, duration_s=12, seed=5)

    def test_the_run_is_that_of_the_simulation(self):
        with bst.Simulation(SMALL.with_(seed="5")) as sim:
            for number, frame in enumerate(sim.frames(until_s=12)):
                np.testing.assert_array_equal(self.result.frames[number].data, frame.data)
            sim.run_until(12)
            newest = sim.detections
        table = self.result.detections
        rows = table.where(table["exposure_id"] == newest.exposure_id)
        np.testing.assert_array_equal(rows["x_px"], newest.items["x_px"])
        np.testing.assert_array_equal(rows["flux_e"], newest.items["flux_e"])

    def test_summary_and_tables(self):
        self.assertEqual(self.result.summary["frames"], 12)
        self.assertTrue(self.result.complete)
        self.assertIn("tracks", self.result.tables)
        tracks = self.result.tracks
        self.assertEqual(tracks.units["ra_deg"], "deg")
        self.assertEqual(tracks.ra_deg.dtype, np.float64)
        self.assertEqual(tracks.rows, len(tracks["ra_deg"]))
        self.assertIn("ra_deg", tracks._repr_html_())
        with self.assertRaises(bst.NotFoundError):
            self.result.table("nothing")
        with self.assertRaises(AttributeError):
            self.result.nothing  # pylint: disable=pointless-statement

    def test_frames_and_their_wcs(self):
        frames = self.result.frames
        self.assertEqual(len(frames), 12)
        self.assertEqual([f.exposure_id for f in frames], list(range(12)))
        self.assertEqual(frames[-1].data.dtype, np.uint16)
        wcs = frames[3].wcs  # of astropy
        truth = self.result.truth
        row = truth.where((truth["exposure_id"] == 3) & (truth["kind"] == 0)) \
            if truth["kind"].dtype.kind == "i" else None
        if row is not None and row.rows:
            x, y = wcs.wcs_world2pix(row["ra_deg"][:1], row["dec_deg"][:1], 0)
            self.assertTrue(np.all(np.isfinite([x, y])))
        with self.assertRaises(IndexError):
            frames[12]  # pylint: disable=pointless-statement

    def test_a_run_can_be_pickled_and_opened_again(self):
        again = pickle.loads(pickle.dumps(self.result))
        self.assertEqual(again.manifest, self.result.manifest)
        self.assertEqual(again.scenario.to_dict()["duration_s"], 12)

    def test_a_temporary_run_goes_with_its_object(self):
        run = bst.run(SMALL, duration_s=1)
        folder = run.folder
        self.assertTrue(folder.is_dir())
        del run
        gc.collect()
        self.assertFalse(folder.exists())

    def test_interrupt_ends_the_program_properly(self):
        with tempfile.TemporaryDirectory() as folder:
            out = pathlib.Path(folder) / "run"
            frames = pathlib.Path(f"{out}.partial") / "frames.fits"

            def interrupt():  # when three frames are written
                while not frames.exists() or frames.stat().st_size < 3 * 2 * 256 * 256:
                    time.sleep(0.05)
                os.kill(os.getpid(), signal.SIGINT)
            threading.Thread(target=interrupt, daemon=True).start()
            with self.assertRaises(KeyboardInterrupt):
                bst.run(SMALL, out, duration_s=20000)
            partial = bst.read_run(f"{out}.partial")
            self.assertEqual(partial.manifest["ended"], "interrupted")
            self.assertGreater(len(partial.frames), 0)

    def test_errors_are_those_of_the_program(self):
        with self.assertRaisesRegex(bst.ProgramError, "area: unknown key") as caught:
            bst.run(SMALL.with_(objects__0__area=1))
        self.assertNotIn("boresight:", str(caught.exception))
        with self.assertRaises(bst.ProgramError) as caught:
            bst.loop(SMALL, nothing=1)
        self.assertEqual(caught.exception.code, 2)


class Commands(unittest.TestCase):
    def test_loop(self):
        self.assertIn("sensors", bst.loop(MAIN))

    def test_lightcurve(self):
        rows = bst.lightcurve(MAIN, duration=600, step=60)
        np.testing.assert_array_equal(rows["seconds"], np.arange(0, 601, 60))
        np.testing.assert_array_equal(np.diff(rows["time_utc"]), np.timedelta64(60000, "ms"))
        # the object is a sphere: between two rows only range and phase change
        phase = np.radians(rows["phase_deg"])
        lambert = (np.sin(phase) + (np.pi - phase) * np.cos(phase)) / np.pi
        expected = -2.5 * np.log10(lambert / rows["range_km"] ** 2)
        np.testing.assert_allclose(np.diff(rows["v_mag"]), np.diff(expected), atol=2e-3)
        shape = bst.lightcurve(satellite="scenarios/satellites/cubesat_3u.json", norad=44801,
                               elements="scenarios/catalogue_2022-06.tle", duration=60,
                               start="2022-06-16T04:00:00Z", site=[32.44, -110.79, 2790])
        self.assertEqual(len(shape), 7)
        self.assertTrue(np.all(np.isnan(shape["v_mag"]) == (shape["elevation_deg"] < 0)))
        with self.assertRaises(bst.ArgumentError):
            bst.lightcurve(MAIN, output="x.csv")
        with self.assertRaises(bst.ProgramError):
            bst.lightcurve(MAIN, object="nobody")

    def test_check(self):
        self.assertEqual(bst.check(SMALL), SMALL.to_dict())

    def test_pd(self):
        figures = bst.pd(SMALL, snr=(4, 12, 8), trials=60, empty_frames=5)
        points = figures["points"]
        self.assertEqual([p["snr"] for p in points], [4, 12])
        self.assertLess(points[0]["pd"], points[1]["pd"])
        self.assertGreater(points[1]["pd"], 0.95)

    def test_new(self):
        scenario = bst.new(aperture_m=0.2, duration_s=30)
        document = scenario.validate().to_dict()
        self.assertEqual(document["duration_s"], 30)
        self.assertEqual(document["observers"][0]["sensors"][0]["camera"]["aperture_m"], 0.2)

    def test_report(self):
        run = bst.run(SMALL, duration_s=3)
        page = bst.report(run)
        self.assertTrue(page.read_text(encoding="utf-8").lower().startswith("<!doctype html>"))


class Scenarios(unittest.TestCase):
    def test_values_are_replaced(self):
        scenario = SMALL.with_(objects__0__area_m2=1.5, duration_s=np.float64(7)).with_(
            {"/observers/0/name": "eye"})
        document = scenario.to_dict()
        self.assertEqual(document["world"]["objects"][0]["area_m2"], 1.5)
        self.assertEqual((document["duration_s"], document["observers"][0]["name"]), (7, "eye"))
        self.assertEqual(pickle.loads(pickle.dumps(scenario)), scenario)
        self.assertEqual(bst.Scenario.from_dict(document).to_dict(), document)

    def test_errors_name_key_and_values(self):
        with self.assertRaisesRegex(bst.ScenarioError, "/world/objects/0/area: unknown key; did "
                                                       "you mean \"area_m2\""):
            SMALL.with_(objects__0__area=1).validate()
        with self.assertRaisesRegex(bst.NotFoundError, "among the scenarios that come with"):
            bst.Scenario.load("nothing")

    def test_external_modules_keep_their_timing(self):
        modules = SMALL.with_external(["imgproc", "neossat/telescope/control"]).to_dict()[
            "observers"][0]["sensors"][0]["modules"]
        self.assertEqual(modules["imgproc"]["type"], "external")
        self.assertEqual(modules["imgproc"]["delay_s"], {"frame": 0.15})
        self.assertEqual(modules["control"]["exposure_s"], 0.5)


if __name__ == "__main__":
    main()
