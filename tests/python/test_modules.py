"""Modules and compensators in Python, inside the process."""
import math
import multiprocessing
import os
import pickle
import signal
import unittest

import numpy as np

from support import SMALL, bst, main

MODULES = "/observers/0/sensors/0/modules"


def course(sim, until_s):
    """Frames by their bytes, and the messages of tracker and control."""
    seen = []
    sim.observe(message=seen.append, channels=["tracks", "los_command", "control_status"])
    frames = [(f.exposure_id, f.data.tobytes()) for f in sim.frames(until_s=until_s)]
    sim.observe()
    return frames, seen


class Follow:
    """A tracker with a state: the brightest detection that is no star, and how often it came."""

    def __init__(self, env, *, first_id: int = 1):
        self.env, self.hits, self.first_id = env, 0, first_id
        self.random = env.rng()

    def __call__(self, step):
        found = step.detections
        rest = np.flatnonzero(found.items["label"] != bst.Label.STAR)
        step.count("follow_steps")
        self.score = float(self.random.random())
        if not len(rest):
            return bst.Tracks()
        self.hits += 1
        k = rest[np.argmax(found.items["flux_e"][rest])]
        one = found.items[k:k + 1]
        direction = self.env.directions_gcrf(one["x_px"], one["y_px"], found.q_cam_from_gcrf)
        return bst.Tracks(
            {"id": [self.first_id], "status": [bst.TrackStatus.CONFIRMED], "hits": [self.hits],
             "target_of_interest": [True], "direction_gcrf": direction, "score": [self.score],
             "covariance": [np.diag([1e-10, 1e-10, 1e-12, 1e-12])], "x_px": one["x_px"],
             "y_px": one["y_px"], "snr": one["snr"]}, target_id=self.first_id)


def in_process(argument):
    """The course of a restored simulation in another process."""
    snapshot, until_s = argument
    name = bst.register(tracker=Follow)
    with bst.Simulation(SMALL.with_plugin(tracker=name)) as sim:
        sim.restore(snapshot)
        return course(sim, until_s)


class Trackers(unittest.TestCase):
    def test_its_tracks_are_those_of_the_run(self):
        scenario = SMALL.with_plugin(tracker=bst.register(tracker=Follow), first_id=7)
        with bst.Simulation(scenario) as sim:
            sim.run_until(12)
            tracks, found = sim.tracks, sim.detections
            self.assertEqual(tracks.target_id, 7)
            self.assertEqual(tracks.exposure_id, found.exposure_id)
            self.assertEqual(tracks.tick, (found.start_tick + found.end_tick) // 2)
            self.assertEqual(sim.counters["follow_steps"], found.exposure_id + 1)
            self.assertEqual(sim.control_status.target_id, 7)
            # the direction is that of the pixel: the target is the true one to within a pixel
            truth = sim.truth.items[sim.truth.items["kind"] == bst.SourceKind.OBJECT][0]
            self.assertLess(math.hypot(tracks.items["x_px"][0] - truth["x_centroid_px"],
                                       tracks.items["y_px"][0] - truth["y_centroid_px"]), 1)
            # apparent, by the measured attitude: within 20" aberration and 30" of telemetry
            seen = np.array([math.cos(truth["dec_rad"]) * math.cos(truth["ra_rad"]),
                             math.cos(truth["dec_rad"]) * math.sin(truth["ra_rad"]),
                             math.sin(truth["dec_rad"])])
            off = np.linalg.norm(tracks.items["direction_gcrf"][0] - seen)
            self.assertLess(math.degrees(off) * 3600, 60)

    def test_the_state_is_saved_and_restored(self):
        scenario = SMALL.with_plugin(tracker=bst.register(tracker=Follow))
        with bst.Simulation(scenario) as sim:
            sim.run_until(4.3)
            snapshot = sim.save()
            expected = course(sim, 8)
            self.assertGreater(expected[1][-1].written_tick, 0)
            sim.restore(snapshot)
            self.assertEqual(course(sim, 8), expected)
            sim.restore(snapshot)
            with sim.clone() as other:
                sim.run_until(6)
                self.assertEqual(course(other, 8), expected)
            again = pickle.loads(pickle.dumps(sim))
            self.assertEqual(again.tracks, sim.tracks)
        with multiprocessing.get_context("spawn").Pool(1) as pool:
            self.assertEqual(pool.apply(in_process, ((snapshot, 8),)), expected)

    def test_states_that_cannot_be_pickled_say_so(self):
        class Locked:
            def __init__(self, env):
                self.call = env.directions_cam

            def __call__(self, step):
                return None
        name = bst.register(tracker=Locked)
        with bst.Simulation(SMALL.with_plugin(tracker=name)) as sim:
            sim.run_until(2)
            with self.assertRaisesRegex(bst.StateError, "Locked cannot be saved.*get_state"):
                sim.save()
            sim.run_until(3)

    def test_objects_are_copied_for_each_simulation(self):
        class Counter:
            def __init__(self):
                self.count = 0

            def __call__(self, step):
                self.count += 1
                return bst.Tracks(target_id=self.count)
        mine = Counter()
        scenario = SMALL.with_plugin(tracker=bst.register("counter", tracker=mine))
        with bst.Simulation(scenario) as one, bst.Simulation(scenario) as two:
            one.run_until(3.8)
            two.run_until(2.8)
            snapshot = two.save()
            self.assertEqual((one.tracks.target_id, two.tracks.target_id, mine.count), (4, 3, 0))
            one.restore(snapshot)
            one.run_until(4)
            self.assertEqual(one.tracks.target_id, 4)

    def test_a_step_ends_with_its_call(self):
        kept = []
        name = bst.register("keep", tracker=lambda step: kept.append((step, step.detections)))
        with bst.Simulation(SMALL.with_plugin(tracker=name)) as sim:
            sim.run_until(2)
            step, found = kept[0]
            self.assertEqual(found.exposure_id, 0)
            for use in (lambda: step.detections, lambda: step.command("tracks", []),
                        lambda: step.unread("detections"), lambda: step.event("a", "b"),
                        lambda: step.count("a"), lambda: step.sensors):
                with self.assertRaisesRegex(bst.StateError, "valid during its call only"):
                    use()


class Controls(unittest.TestCase):
    def test_the_same_commands_give_the_same_run(self):
        # what the module of Boresight commands, once more from Python: every byte agrees
        with bst.Simulation(SMALL) as sim:
            frames, seen = course(sim, 6)
        commands = {}
        for message in seen:
            if message.channel in ("los_command", "control_status"):
                commands.setdefault(message.written_tick, []).append(message)
        self.assertGreater(len(commands), 100)

        def replay(step):
            return commands.get(step.tick, [])
        replay.rate_hz = 20
        with bst.Simulation(SMALL.with_plugin(control=bst.register(control=replay))) as sim:
            again, also = course(sim, 6)
        self.assertEqual(again, frames)
        self.assertEqual([m for m in also if m.channel != "tracks"],
                         [m for m in seen if m.channel != "tracks"])

    def test_outputs_are_assigned_or_returned(self):
        def by_assignment(step):
            step.los_command = [0.0, 0.6, 0.8]
            step.control_status = {"mode": bst.Mode.STARE}

        def by_mapping(step):
            return {"los_command": [0.0, 0.6, 0.8], "control_status": {"mode": bst.Mode.STARE}}
        results = []
        for function in (by_assignment, by_mapping):
            name = bst.register(control=function)
            with bst.Simulation(SMALL.with_plugin(control=name)) as sim:
                sim.run_until(0.12)
                results.append((sim.los_command, sim.control_status))
                self.assertEqual(sim.los_command.tick, sim.tick_rate_hz // 10)
        self.assertEqual(results[0], results[1])
        self.assertEqual(results[0][1].mode, bst.Mode.STARE)

    def test_ports_and_rate_are_the_modules_own(self):
        heard = []

        class Listener:
            ports = [bst.Port("detections", trigger=True), bst.Port("truth"),
                     bst.Port("los_command", output=True)]
            rate_hz = 0

            def __init__(self, env):
                heard.append(env.period_s)

            def __call__(self, step):
                heard.append(len(step.truth.items))
        name = bst.register(control=Listener)
        with bst.Simulation(SMALL.with_plugin(control=name)) as sim:
            sim.run_until(3.8)
            self.assertEqual(heard[0], 0)
            self.assertEqual(len(heard), 5)
            self.assertEqual(heard[-1], len(sim.truth.items))

    def test_stale_messages_are_none(self):
        seen = []

        def impatient(step):
            seen.append(step.tracks is None)
        impatient.ports = [bst.Port("tracks", max_age_s=0.5), bst.Port("los_command", output=True)]
        impatient.rate_hz = 10
        name = bst.register(control=impatient)
        with bst.Simulation(SMALL.with_plugin(control=name)) as sim:
            sim.run_until(4)
        self.assertIn(True, seen[20:])
        self.assertIn(False, seen[20:])


class ImageProcessing(unittest.TestCase):
    def test_its_frame_is_that_of_the_simulation(self):
        kept = []

        def find(step):
            frame = step.frame
            kept.append(frame)
            y, x = np.unravel_index(int(np.argmax(frame.data)), frame.data.shape)
            step.detections = {"x_px": [float(x)], "y_px": [float(y)], "flux_e": 1e4, "snr": 50.0}
        with bst.Simulation(SMALL.with_plugin(imgproc=bst.register(imgproc=find))) as sim:
            for frame in sim.frames(until_s=3):
                found = sim.step("detections")
                self.assertEqual(kept[-1].data.__array_interface__["data"][0],
                                 frame.data.__array_interface__["data"][0])
                self.assertEqual((kept[-1].exposure_id, found.exposure_id),
                                 (frame.exposure_id, frame.exposure_id))
                self.assertAlmostEqual(float(np.linalg.norm(found.q_cam_from_gcrf)), 1, delta=1e-9)
                y, x = int(found.items["y_px"][0]), int(found.items["x_px"][0])
                self.assertEqual(frame.data[y, x], frame.data.max())
        sums = [int(f.data.sum()) for f in kept]  # they stay valid after the simulation
        self.assertEqual(len(sums), len({f.exposure_id for f in kept}))


class Tasking(unittest.TestCase):
    def test_one_module_serves_all_sensors(self):
        seen = []

        def assign(step):
            seen.append(sorted(step.sensors))
            for number, sensor in enumerate(step.sensors.values()):
                if step.time_s >= 2:
                    self.assertIsNotNone(sensor.nav_telemetry)
                sensor.task = {"id": 1, "object": 3 + number}
        scenario = bst.Scenario.load("constellation_quick").with_plugin(
            tasking=bst.register(tasking=assign))
        with bst.Simulation(scenario) as sim:
            sim.run_until(4.5)
            self.assertEqual(seen[-1], sorted(sim.sensors))
            self.assertGreaterEqual(len(seen[-1]), 2)
            given = [sim.sensor(s).task.object for s in sim.sensors]
        self.assertEqual(given, list(range(3, 3 + len(given))))


class Proportional:
    """A compensator as leaky.c: proportional, with an integrator that forgets."""
    states = 1

    def __init__(self, dt_s, *, gain_per_s: float = 0.4, integral_per_s2: float = 0.04):
        self.dt_s, self.gain, self.integral = dt_s, gain_per_s, integral_per_s2

    def step(self, state, error):
        state[0] += self.dt_s * error
        return self.gain * error + self.integral * state[0]

    def set(self, state, error, output):
        state[0] = (output - self.gain * error) / self.integral


class Compensators(unittest.TestCase):
    def test_it_closes_the_loop(self):
        scenario = SMALL.with_plugin(compensator=bst.register(compensator=Proportional),
                                     gain_per_s=0.35)
        with bst.Simulation(scenario) as sim:
            sim.run_until(25.3)
            snapshot = sim.save()
            expected = course(sim, 30)
            self.assertEqual(sim.control_status.mode, bst.Mode.TRACK)
            truth = sim.truth
            target = truth.items[truth.items["kind"] == bst.SourceKind.OBJECT][0]
            self.assertLess(math.hypot(target["x_mid_px"] - truth.boresight_x_px,
                                       target["y_mid_px"] - truth.boresight_y_px), 1)
            sim.restore(snapshot)
            self.assertEqual(course(sim, 30), expected)

    def test_exceptions_are_raised_by_the_step(self):
        class Wrong(Proportional):
            def step(self, state, error):
                raise ZeroDivisionError("mine")

        class NoNumber(Proportional):
            def step(self, state, error):
                return "text"
        for law, kind in ((Wrong, ZeroDivisionError), (NoNumber, ValueError)):
            scenario = SMALL.with_plugin(compensator=bst.register(compensator=law))
            with bst.Simulation(scenario) as sim, self.assertRaises(kind):
                sim.run_until(40)


class Interrupts(unittest.TestCase):
    def test_one_lets_the_simulation_go_on(self):
        def interrupted(step):
            if step.detections.exposure_id == 1:
                os.kill(os.getpid(), signal.SIGINT)
        name = bst.register(tracker=interrupted)
        with bst.Simulation(SMALL.with_plugin(tracker=name)) as sim:
            with self.assertRaises(KeyboardInterrupt):
                sim.run_until(60)
            self.assertLess(sim.time_s, 50)
            sim.run_until(sim.time_s + 1)

    def test_a_second_one_ends_a_plugin_that_does_not_return(self):
        def endless(step):
            os.kill(os.getpid(), signal.SIGINT)
            while True:
                os.kill(os.getpid(), signal.SIGINT)
        name = bst.register(tracker=endless)
        with bst.Simulation(SMALL.with_plugin(tracker=name)) as sim:
            with self.assertRaises(KeyboardInterrupt):
                sim.run_until(5)
            with self.assertRaises(bst.StateError):
                sim.run_until(5)


if __name__ == "__main__":
    main()
