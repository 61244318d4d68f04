"""Commands of the program with plug-ins in Python: in this process, and in workers that import
modules."""
import os
import pathlib
import signal
import sys
import tempfile
import threading
import unittest

import numpy as np

from support import MAIN, ROOT, SMALL, bst, main

STARE = bst.Scenario.load("neossat_geo_stare").with_({
    "/observers/0/sensors/0/camera/width_px": 256, "/observers/0/sensors/0/camera/height_px": 256})
MODULE = '''
import boresight as bst

def peaks(frame, *, threshold_dn: float = 60.0):
    """Local maxima of sums of 2 x 2 pixels above a threshold."""
    import numpy as np
    image = frame.data.astype(float)
    image -= np.median(image)
    sums = image[:-1, :-1] + image[1:, :-1] + image[:-1, 1:] + image[1:, 1:]
    y, x = np.nonzero((sums[1:-1, 1:-1] > threshold_dn) & (sums[1:-1, 1:-1] > sums[:-2, 1:-1])
                      & (sums[1:-1, 1:-1] >= sums[2:, 1:-1]) & (sums[1:-1, 1:-1] > sums[1:-1, :-2])
                      & (sums[1:-1, 1:-1] >= sums[1:-1, 2:]))
    return {"x_px": x + 1.5, "y_px": y + 1.5, "snr": 9.0, "flux_e": 1000.0, "flux_sigma_e": 100.0,
            "cov_xx": 0.1, "cov_yy": 0.1, "length_px": 2.0, "width_px": 2.0}

bst.register("peaks", detector=peaks)
'''


def study_of(detector, kind="loop", **more):
    """A small study with a detector."""
    return {"boresight_study": 1, "name": "plugins", "kind": kind,
            "scenarios": [{"file": str(ROOT / "scenarios" / f"{MAIN}.json")}],
            "set": {"/duration_s": 4, "/observers/0/sensors/0/cue/offset_deg": 0.02,
                    "/observers/0/sensors/0/camera/width_px": 256,
                    "/observers/0/sensors/0/camera/height_px": 256,
                    "/observers/0/sensors/0/modules/imgproc/detector": {"plugin": detector}},
            **more}


class Plugins(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.temporary = tempfile.TemporaryDirectory()
        cls.folder = pathlib.Path(cls.temporary.name)
        (cls.folder / "peaks_module.py").write_text(MODULE)
        (cls.folder / "empty_module.py").write_text("import boresight\n")
        (cls.folder / "broken_module.py").write_text("\n1 / 0\n")
        sys.path.insert(0, str(cls.folder))
        import peaks_module
        cls.peaks = staticmethod(peaks_module.peaks)

    @classmethod
    def tearDownClass(cls):
        sys.path.remove(str(cls.folder))
        cls.temporary.cleanup()

    def test_pd_calls_a_detector_of_this_process(self):
        calls = []

        def counted(frame):
            calls.append(frame.data.shape)
            with self.assertRaises(ValueError):
                frame.data[0, 0] = 1
            return self.peaks(frame)
        figures = bst.pd(STARE.with_plugin(detector=bst.register("counted", detector=counted)),
                         snr=(3, 12, 3), trials=400, empty_frames=20)
        self.assertEqual(set(calls), {(256, 256)})
        self.assertGreaterEqual(len(calls), figures["frames"] + figures["empty_frames"])
        pd = [p["pd"] for p in figures["points"]]
        self.assertEqual(pd, sorted(pd))
        self.assertLess(pd[0], 0.4)
        self.assertGreater(pd[-1], 0.95)

    def test_keys_reach_the_detector(self):
        def false_alarms(**keys):
            return bst.pd(STARE.with_plugin(detector="python:peaks", **keys), snr=(9, 10, 1),
                          trials=100, empty_frames=20)["false_alarms_per_frame"]
        self.assertGreater(false_alarms(threshold_dn=40.0), 3 * false_alarms(threshold_dn=60.0))
        with self.assertRaisesRegex(bst.ScenarioError, "did you mean \"threshold_dn\""):
            STARE.with_plugin(detector="python:peaks", treshold_dn=40.0).validate()

    def test_another_process_finds_the_same(self):
        scenario = STARE.with_plugin(detector="python:peaks")
        here = bst.pd(scenario, snr=(6, 9, 3), trials=100, empty_frames=5)
        there = bst.pd(scenario, snr=(6, 9, 3), trials=100, empty_frames=5, plugins=["peaks_module"])
        for figures in (here, there):
            figures.pop("process_ms")
            figures.pop("wall_s")
        self.assertEqual(here, there)

    def test_run_check_and_loop(self):
        scenario = SMALL.with_plugin(detector="python:peaks")
        imgproc = bst.check(scenario)["observers"][0]["sensors"][0]["modules"]["imgproc"]
        self.assertEqual(imgproc["detector"], {"type": "peaks", "plugin": "python:peaks",
                                               "threshold_dn": 60})
        with bst.Simulation(scenario) as sim:
            sim.run_until(4)
            expected = sim.detections
        for run in (bst.run(scenario, duration_s=4),
                    bst.run(scenario, duration_s=4, plugins=["peaks_module"])):
            found = run.table("detections")
            newest = found.where(found.exposure_id == expected.exposure_id)
            np.testing.assert_array_equal(newest.x_px, expected.items["x_px"])
        self.assertTrue(bst.loop(scenario))

    def test_exceptions_say_where(self):
        def fails(frame):
            raise ZeroDivisionError("mine")
        scenario = STARE.with_plugin(detector=bst.register("fails", detector=fails))
        with self.assertRaisesRegex(bst.ProgramError, r"ZeroDivisionError: mine \(.*test_program_"
                                    r"plugins.py, line \d+\)") as caught:
            bst.pd(scenario, trials=100)
        self.assertIsInstance(caught.exception.__cause__, ZeroDivisionError)

    def test_interrupts_end_a_command(self):
        def slow(frame):
            os.kill(os.getpid(), signal.SIGINT)
            return self.peaks(frame)
        scenario = STARE.with_plugin(detector=bst.register("slow", detector=slow))
        with self.assertRaises(KeyboardInterrupt):
            bst.pd(scenario, trials=4000)
        with self.assertRaises(KeyboardInterrupt):  # Python's handler is back
            os.kill(os.getpid(), signal.SIGINT)
            for _ in range(1000):
                pass

    def test_one_command_at_a_time(self):
        raised = []

        def again(frame):
            try:
                bst.check(STARE.with_plugin(detector="python:again"))
            except bst.BusyError as error:
                raised.append(error)
            return self.peaks(frame)
        name = bst.register("again", detector=again)
        bst.pd(STARE.with_plugin(detector=name), snr=(6, 9, 3), trials=40, empty_frames=2)
        self.assertTrue(raised)
        bst.check(STARE.with_plugin(detector=name))

    def test_another_thread_may_run_a_command(self):
        found = []
        thread = threading.Thread(target=lambda: found.append(bst.pd(
            STARE.with_plugin(detector="python:peaks"), snr=(6, 9, 3), trials=40, empty_frames=2)))
        thread.start()
        thread.join()
        self.assertEqual(len(found), 1)

    def test_workers_of_a_study_import_modules(self):
        out = self.folder / "study"
        study = bst.study(study_of("python:peaks", replicates=3), out, plugins=["peaks_module"],
                          workers=2)
        self.assertEqual(list(study.runs.status), ["done"] * 3)
        self.assertTrue(all(n > 0 for n in study.runs.detections))
        # the same module in this process finds as much
        scenario = bst.Scenario.load(MAIN).with_(study_of("python:peaks")["set"])
        run = bst.run(scenario, run_number=int(study.runs.run_number[0]))
        self.assertEqual(run.summary["detections"], study.runs.detections[0])
        # a module that has changed since is refused
        (self.folder / "changed").mkdir()
        (self.folder / "changed" / "peaks_module.py").write_text(MODULE + "\n# changed\n")
        sys.path.insert(0, str(self.folder / "changed"))
        try:
            with self.assertRaisesRegex(bst.ProgramError, "python:peaks has been changed since"):
                bst.study(out, resume=True, plugins=["peaks_module"])
        finally:
            sys.path.remove(str(self.folder / "changed"))

    def test_pd_studies(self):
        document = study_of("python:peaks", "pd", sweeps=[{"axes": [
            {"path": "/observers/0/sensors/0/modules/imgproc/detector/threshold_dn",
             "values": [30, 45]}]}], pd={"snr_first": 6, "snr_last": 9, "snr_step": 3,
                                         "trials": 100, "empty_frames": 20})
        document["set"].pop("/duration_s")
        study = bst.study(document, self.folder / "pd", plugins=["peaks_module"], workers=2)
        low, high = study.runs.false_alarms_per_frame
        self.assertGreater(low, 3 * high)

    def test_wrong_calls_say_what_to_do(self):
        with self.assertRaisesRegex(bst.ProgramError, r"register it before.*plugins=\[MODULE\]"):
            bst.study(study_of("python:peaks"), self.folder / "none")
        for plugins, text in (("peaks_module", "a list of names"), ([5], "not int"),
                              (["__main__"], "another process can import"),
                              (["peaks_module.py"], 'plugins=\\["my_detector"\\]'),
                              (["no_such_module"], "sys.path"), (["no.such.module"], "sys.path"),
                              ({"peaks_module": 1}, "a list of names")):
            with self.subTest(plugins=plugins), self.assertRaisesRegex(bst.ArgumentError, text):
                bst.study(study_of("python:peaks"), self.folder / "none", plugins=plugins)
        for module, text in (("empty_module", "registers nothing"),
                             ("broken_module", "ZeroDivisionError.*broken_module.py, line 2")):
            with self.subTest(module=module), self.assertRaisesRegex(bst.ProgramError, text):
                bst.pd(STARE, plugins=[module])
        with self.assertRaisesRegex(bst.ArgumentError, "Slurm"):
            bst.study(study_of("python:peaks"), plugins=["peaks_module"], slurm=True)


if __name__ == "__main__":
    main()
