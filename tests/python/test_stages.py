"""Detectors and frame stages in Python, inside the process."""
import gc
import pickle
import unittest

import numpy as np

from support import SMALL, bst, main
from boresight import errors


def brightest(frame):
    """The brightest pixel of a frame."""
    y, x = np.unravel_index(int(np.argmax(frame.data)), frame.data.shape)
    return {"x_px": [float(x)], "y_px": [float(y)], "snr": 50.0, "flux_e": 1e4,
            "flux_sigma_e": 10.0, "length_px": 2.0, "width_px": 2.0}


class Detectors(unittest.TestCase):
    def test_its_detections_are_those_of_the_run(self):
        name = bst.register(detector=brightest)
        self.assertEqual(name, "python:brightest")
        with bst.Simulation(SMALL.with_plugin(detector=name)) as sim:
            for frame in sim.frames(until_s=4):
                found = sim.step("detections")
                y, x = np.unravel_index(int(np.argmax(frame.data)), frame.data.shape)
                self.assertEqual((found.items["x_px"][0], found.items["y_px"][0]), (x, y))
                self.assertEqual(found.exposure_id, frame.exposure_id)

    def test_its_frame_is_not_copied(self):
        addresses = []

        def look(frame):
            addresses.append(frame.data.__array_interface__["data"][0])
            with self.assertRaises(ValueError):
                frame.data[0, 0] = 1
            return []
        scenario = SMALL.with_plugin(detector=bst.register("look", detector=look))
        with bst.Simulation(scenario) as sim:
            for frame in sim.frames(until_s=4):
                sim.step("detections")
                self.assertEqual(addresses[-1], frame.data.__array_interface__["data"][0])

    def test_a_class_gets_the_camera(self):
        made = []

        class Mine:
            def __init__(self, camera):
                made.append(camera)

            def __call__(self, frame):
                return []
        scenario = SMALL.with_plugin(detector=bst.register(detector=Mine))
        with bst.Simulation(scenario) as one, bst.Simulation(scenario) as two:
            one.run_until(2)
            two.run_until(2)
        self.assertEqual(len(made), 2)
        self.assertEqual((made[0].width_px, made[0].gain_e_per_dn), (256, 1.6))
        self.assertEqual(bst.Model(SMALL).camera().width_px, 256)

    def test_exceptions_are_raised_by_the_step(self):
        def fail(frame):
            raise ZeroDivisionError("mine")
        scenario = SMALL.with_plugin(detector=bst.register("fail", detector=fail))
        with bst.Simulation(scenario) as sim:
            with self.assertRaisesRegex(ZeroDivisionError, "mine"):
                sim.run_until(5)
            with self.assertRaises(bst.StateError):
                sim.run_until(6)

    def test_wrong_results_are_refused(self):
        for wrong in (5, "text", {"x": [1]}, {"x_px": ["a"]}, [None], {"x_px": [np.nan]},
                      np.zeros((2, 2)), {"x_px": [1, 2], "y_px": [1, 2, 3]}):
            scenario = SMALL.with_plugin(
                detector=bst.register("wrong", detector=lambda frame, w=wrong: w))
            with bst.Simulation(scenario) as sim, self.subTest(wrong=wrong):
                with self.assertRaises(errors.ArgumentError):
                    sim.run_until(2)

    def test_a_kept_frame_is_an_error_and_harms_nothing(self):
        kept = []

        def keep(frame):
            kept.append(frame.data[10:20])
            return []
        scenario = SMALL.with_plugin(detector=bst.register("keep", detector=keep))
        sim = bst.Simulation(scenario)
        with self.assertRaisesRegex(bst.StateError, "keep a copy"):
            sim.run_until(5)
        sim.close()
        del sim
        gc.collect()
        self.assertEqual(kept[0].shape, (10, 256))
        self.assertGreater(int(kept[0].sum()), 0)

    def test_more_than_there_is_room_for_are_counted(self):
        def many(frame):
            return {"x_px": np.arange(100.0), "y_px": np.full(100, 5.0), "snr": 9.0,
                    "flux_e": 1000.0, "flux_sigma_e": 10.0, "length_px": 2.0, "width_px": 2.0}
        scenario = SMALL.with_plugin(detector=bst.register("many", detector=many)).with_(
            {"/observers/0/sensors/0/modules/imgproc/capacity": 16})
        with bst.Simulation(scenario) as sim:
            found = sim.step("detections")
            self.assertEqual((len(found), found.lost), (16, 84))

    def test_names(self):
        for wrong in ("a/b", "with blank", "x" * 200):
            with self.assertRaises(bst.ArgumentError):
                bst.register(wrong, detector=brightest)
        for wrong in ({}, {"detector": 5}):
            with self.assertRaises(bst.ArgumentError):
                bst.register(**wrong)
        with self.assertRaises(bst.ScenarioError):
            SMALL.with_plugin(detector="python:nobody").validate()


class FrameStages(unittest.TestCase):
    def test_pixels_are_changed_in_place_or_replaced(self):
        def in_place(data, frame):
            data[3, 4] = 999 + frame.exposure_id

        def replaced(data, frame):
            new = data.astype(np.int64)
            new[3, 4] = 999 + frame.exposure_id
            return new
        frames = []
        for function in (in_place, replaced):
            name = bst.register(frame_stage=function)
            with bst.Simulation(SMALL.with_plugin(frame_stage=name)) as sim:
                frames.append([f.data.copy() for f in sim.frames(until_s=3)])
        with bst.Simulation(SMALL) as sim:
            plain = [f.data.copy() for f in sim.frames(until_s=3)]
        for number, image in enumerate(plain):
            self.assertEqual(frames[0][number][3, 4], 999 + number)
            image[3, 4] = 999 + number
            np.testing.assert_array_equal(frames[0][number], image)
            np.testing.assert_array_equal(frames[1][number], image)

    def test_pixels_beyond_the_bits_are_refused(self):
        def bright(data, frame):
            data[0, 0] = 5000
        scenario = SMALL.with_plugin(frame_stage=bst.register(frame_stage=bright)).with_(
            {"/observers/0/sensors/0/camera/bits": 12})
        with bst.Simulation(scenario) as sim:
            with self.assertRaisesRegex(bst.ArgumentError, "a pixel of 5000 DN"):
                sim.run_until(2)


class Counting:
    """A detector with a state: the number of its frames is where it finds something."""

    def __init__(self, camera):
        self.count = 0

    def __call__(self, frame):
        self.count += 1
        return {"x_px": [float(self.count)], "y_px": [7.0], "snr": 9.0, "flux_e": 1000.0,
                "flux_sigma_e": 10.0, "length_px": 2.0, "width_px": 2.0}

    def get_state(self):
        return pickle.dumps(self.count)

    def set_state(self, state):
        self.count = pickle.loads(state)


class States(unittest.TestCase):
    def test_the_state_is_saved_and_restored(self):
        scenario = SMALL.with_plugin(detector=bst.register(detector=Counting))
        with bst.Simulation(scenario) as sim:
            sim.run_until(3.2)
            snapshot = sim.save()
            after = [m.items["x_px"][0] for m in (sim.step("detections") for _ in range(3))]
            sim.restore(snapshot)
            again = [m.items["x_px"][0] for m in (sim.step("detections") for _ in range(3))]
            with bst.Simulation(scenario) as other:
                other.restore(snapshot)
                third = [m.items["x_px"][0] for m in (other.step("detections") for _ in range(3))]
        self.assertEqual(after, [4, 5, 6])
        self.assertEqual(again, after)
        self.assertEqual(third, after)


if __name__ == "__main__":
    main()
