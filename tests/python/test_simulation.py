"""Simulations in Python: stepping, messages, frames without copies, commands, observers."""
import ctypes
import gc
import os
import pickle
import signal
import threading
import unittest

import numpy as np

from support import SMALL, bst, main
from boresight import _structs
from boresight._native import LIBRARY, Context


def c_pixels(sim):
    """Address of the newest frame's pixels as C lends them."""
    view = _structs.SimFrame()
    with sim._guard.use() as handle:
        context = Context()
        context.check(LIBRARY.bst_sim_view_frame(context.pointer, handle.pointer, None,
                                                 ctypes.byref(view)))
    return view.pixels


class Stepping(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.model = bst.Model(SMALL).prepare()

    def setUp(self):
        self.sim = bst.Simulation(self.model)

    def tearDown(self):
        self.sim.close()

    def test_frames_come_in_order_with_their_times(self):
        frames = list(self.sim.frames(until_s=4))
        self.assertEqual([f.exposure_id for f in frames], [0, 1, 2, 3])
        self.assertEqual([f.start_s for f in frames], [0, 1, 2, 3])
        self.assertEqual(frames[0].exposure_s, 0.5)
        self.assertEqual(frames[0].data.shape, (256, 256))
        self.assertEqual(frames[0].scope, "neossat/telescope")
        self.assertEqual(self.sim.time_s, 4.0)

    def test_step_stops_at_each_channel(self):
        sim = self.sim
        self.assertIsInstance(sim.step("exposure"), bst.Exposure)
        self.assertIsInstance(sim.step("truth"), bst.Truth)
        detections = sim.step("detections")
        self.assertEqual(detections, sim.detections)
        self.assertEqual(detections.written_tick, sim.tick)
        self.assertIs(sim.step(), True)
        self.assertIsNone(sim.step("frame", until_s=sim.time_s))

    def test_run_until_goes_to_the_time(self):
        self.sim.run_until(1.25)
        self.assertEqual((self.sim.time_s, self.sim.tick), (1.25, 7500))
        self.sim.run_until(1.0)  # reached already
        self.assertEqual(self.sim.tick, 7500)

    def test_messages_have_the_members_of_C(self):
        self.sim.run_until(3)
        truth, status = self.sim.truth, self.sim.mount_status
        # the quaternion is of length 1 within rounding, the camera is the scenario's
        self.assertAlmostEqual(float(np.linalg.norm(truth.q_cam_from_gcrf_mid)), 1.0, delta=1e-12)
        self.assertEqual(len(truth.items), len(truth))
        self.assertIn(1, truth.items["kind"])  # the object of the scenario
        self.assertEqual(status.axes, 2)
        self.assertEqual(len(status.axis), 3)
        self.assertAlmostEqual(float(np.linalg.norm(status.axis[0].axis_body)), 1.0, delta=1e-12)
        self.assertEqual(self.sim.exposure.window.width, 256)
        self.assertTrue(self.sim.exposure)  # though it has no items

    def test_rings_are_in_order_of_time(self):
        self.sim.run_until(12)  # longer than the ring
        ticks = self.sim.pointing_telemetry.items["tick"]
        self.assertTrue(np.all(np.diff(ticks) > 0))
        self.assertGreaterEqual(ticks[-1], self.sim.tick - 120)
        self.assertGreater(self.sim.pointing_telemetry.written, len(ticks))

    def test_messages_stay_as_they_are(self):
        self.sim.run_until(3)
        kept = self.sim.truth
        data = kept.array.tobytes(), kept.items.tobytes()
        self.sim.run_until(6)
        self.assertNotEqual(kept, self.sim.truth)
        self.assertEqual((kept.array.tobytes(), kept.items.tobytes()), data)
        self.assertEqual(pickle.loads(pickle.dumps(kept)), kept)

    def test_frames_are_not_copied(self):
        frame = self.sim.step("frame")
        address = frame.data.__array_interface__["data"][0]
        self.assertEqual(address, c_pixels(self.sim))
        self.assertFalse(frame.data.flags.writeable)
        self.assertEqual(np.asarray(frame).__array_interface__["data"][0], address)

    def test_kept_frames_do_not_change(self):
        frames, sums = [], []
        for frame in self.sim.frames(until_s=20):  # more than the renderer's pool has
            frames.append(frame)
            sums.append(int(frame.data.sum()))
        addresses = {f.data.__array_interface__["data"][0] for f in frames}
        self.assertEqual(len(addresses), len(frames))
        self.sim.close()
        gc.collect()
        self.assertEqual([int(f.data.sum()) for f in frames], sums)

    def test_released_frames_are_lent_again(self):
        for frame in self.sim.frames(until_s=12):
            self.assertEqual(frame.data.__array_interface__["data"][0], c_pixels(self.sim))

    def test_slices_keep_their_frame(self):
        part = self.sim.step("frame").data[10:20, 30:40]
        before = part.copy()
        self.sim.run_until(20)
        self.sim.close()
        gc.collect()
        np.testing.assert_array_equal(part, before)

    def test_runs_have_other_noise_and_repeat(self):
        def pixels(run):
            with bst.Simulation(self.model, run=run) as sim:
                return sim.step("frame").data.tobytes()
        self.assertEqual(pixels(1), pixels(1))
        self.assertNotEqual(pixels(1), pixels(2))

    def test_sensor_is_the_same_by_name(self):
        sensor = self.sim.sensor("neossat/telescope")
        self.sim.run_until(2)
        self.assertEqual(sensor.tracks, self.sim.tracks)
        self.assertEqual(next(sensor.frames()).exposure_id, 2)

    def test_observers_get_every_message_and_event(self):
        seen, events = [], []
        self.sim.observe(message=seen.append, event=lambda *e: events.append(e),
                         channels=["exposure", "tracks"])
        self.sim.run_until(5)
        self.assertEqual([m.id for m in seen if m.channel == "exposure"], [0, 1, 2, 3, 4])
        self.assertEqual(seen[-1].scope, "neossat/telescope")
        self.assertTrue(any(isinstance(m, bst.Tracks) for m in seen))
        self.assertTrue(all(len(e) == 4 for e in events))
        count = len(seen)
        self.sim.observe()
        self.sim.run_until(7)
        self.assertEqual(len(seen), count)

    def test_an_exception_in_a_callback_is_raised(self):
        def fail(message):
            raise ZeroDivisionError("mine")
        self.sim.observe(message=fail)
        with self.assertRaisesRegex(ZeroDivisionError, "mine"):
            self.sim.run_until(2)
        with self.assertRaises(bst.StateError):  # it stopped in the middle of a step
            self.sim.run_until(3)

    def test_a_callback_cannot_use_the_simulation(self):
        self.sim.observe(message=lambda m: self.sim.tracks, channels=["exposure"])
        with self.assertRaises(bst.BusyError):
            self.sim.run_until(2)

    def test_interrupt_stops_between_steps(self):
        threading.Timer(0.3, os.kill, (os.getpid(), signal.SIGINT)).start()
        with self.assertRaises(KeyboardInterrupt):
            self.sim.run_until(100000)
        stopped = self.sim.tick
        self.assertGreater(stopped, 0)
        self.sim.run_until(self.sim.time_s + 2)  # it goes on
        self.assertEqual(self.sim.tick, stopped + 2 * self.sim.tick_rate_hz)

    def test_an_interrupted_run_is_the_uninterrupted_one(self):
        threading.Timer(0.2, os.kill, (os.getpid(), signal.SIGINT)).start()
        try:
            self.sim.run_until(100000)
        except KeyboardInterrupt:
            pass
        frame = self.sim.step("frame", until_s=1e6)
        with bst.Simulation(self.model) as other:
            other.run_until(frame.start_s)
            again = other.step("frame", until_s=1e6)
            while again.exposure_id < frame.exposure_id:
                again = other.step("frame", until_s=1e6)
        np.testing.assert_array_equal(frame.data, again.data)

    def test_simulations_in_threads_are_those_in_one(self):
        results = {}

        def work(run):
            with bst.Simulation(self.model, run=run) as sim:
                sim.run_until(6)
                results[run] = sim.tracks, sim.truth
        threads = [threading.Thread(target=work, args=(run,)) for run in range(4)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        together = dict(results)
        for run in range(4):
            work(run)
        self.assertEqual(together, results)

    def test_html_shows_the_frame(self):
        self.sim.run_until(2)
        self.assertIn("data:image/png;base64,", self.sim._repr_html_())
        self.assertIn("exposure_id", self.sim.detections._repr_html_())
        self.assertIn("run 0 at 2.000 s", repr(self.sim))


class Commands(unittest.TestCase):
    def test_replayed_detections_give_the_same_tracks(self):
        # what imgproc publishes, given by Python at the same place in the loop
        found, tracks = [], []
        with bst.Simulation(SMALL) as sim:
            sim.observe(message=lambda m: (found if m.channel == "detections" else tracks).append(m),
                        channels=["detections", "tracks"])
            sim.run_until(20)
        self.assertTrue(any(len(t) for t in tracks) or any(t.attitude.valid for t in tracks))
        again = []
        with bst.Simulation(SMALL, external=["imgproc"]) as sim:
            sim.observe(message=again.append, channels=["tracks"])
            for frame in sim.frames(until_s=20):
                if frame.exposure_id < len(found):
                    sim.detections = found[frame.exposure_id]
        self.assertEqual(len(again), len(tracks))
        self.assertEqual(again, tracks)

    def test_columns_become_detections_of_the_frame(self):
        with bst.Simulation(SMALL, external="imgproc") as sim:
            frame = sim.step("frame")
            sim.detections = {"x_px": [3.5, 7], "y_px": np.array([1, 2]), "flux_e": 1e4}
            got = sim.step("detections")
            self.assertEqual(list(got.items["x_px"]), [3.5, 7.0])
            self.assertEqual(list(got.items["flux_e"]), [1e4, 1e4])
            self.assertEqual(list(got.items["cov_xx"]), [0.01, 0.01])
            self.assertEqual((got.exposure_id, got.start_tick, got.end_tick),
                             (frame.exposure_id, frame.start_tick, frame.end_tick))
            # the attitude of the telemetry, mid-exposure: of length 1 within rounding
            self.assertAlmostEqual(float(np.linalg.norm(got.q_cam_from_gcrf)), 1.0, delta=1e-12)

    def test_what_is_out_of_range_is_refused_by_name(self):
        with bst.Simulation(SMALL, external="imgproc") as sim:
            sim.step("frame")
            with self.assertRaisesRegex(bst.ArgumentError, "cov_xx of item 0 is -1"):
                sim.detections = {"x_px": [1.0], "y_px": [1.0], "cov_xx": -1.0}
            with self.assertRaisesRegex(bst.ArgumentError, "has no member 'x'"):
                sim.detections = {"x": [1.0]}
            with self.assertRaisesRegex(bst.NotFoundError, "external"):
                sim.tracks = []

    def test_a_direction_commands_the_line_of_sight(self):
        with bst.Simulation(SMALL, external="control") as sim:
            sim.step("exposure")
            q = sim.los_history.items["q_cam_from_gcrf"][-1]
            x, y, zz, w = q
            # boresight in GCRF: the third row of the rotation matrix of q_cam_from_gcrf
            before = np.array([2 * (x * zz - w * y), 2 * (y * zz + w * x), 1 - 2 * (x * x + y * y)])
            wanted = before + np.array([0.0, 0.0, 0.02])
            wanted /= np.linalg.norm(wanted)
            self.assertGreater(np.linalg.norm(np.cross(before, wanted)), 0.01)
            sim.los_command = wanted
            sim.run_until(sim.time_s + 10)
            x, y, zz, w = sim.los_history.items["q_cam_from_gcrf"][-1]
            after = np.array([2 * (x * zz - w * y), 2 * (y * zz + w * x), 1 - 2 * (x * x + y * y)])
            # rad: the platform drifts by 5 arcsec/s, which nothing corrects here
            self.assertLess(np.linalg.norm(np.cross(after, wanted)), 5e-4)


if __name__ == "__main__":
    main()
