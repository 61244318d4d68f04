"""Wrong calls from Python: each raises an exception, and the simulation goes on afterwards."""
import copy
import gc
import multiprocessing
import os
import pickle
import threading
import unittest

import numpy as np

from support import SMALL, bst, main

NO_TEXTS = [5, 1.5, b"bytes", [], {}, object(), ("a",)]
NO_NUMBERS = ["1", b"1", [], {}, object(), None, 1j, True]
NO_TIMES = [v for v in NO_NUMBERS if v is not None]
NO_ITEMS = [5, "text", b"bytes", object(), [1, 2], [None], np.zeros(3), np.zeros((2, 2)),
            {"nothing": [1]}, {1: [2]}, [{"nothing": 1}], {"x_px": [1, 2], "y_px": [1, 2, 3]},
            {"x_px": "a"}, {"x_px": [1j]}, {"x_px": [[1, 2], [3, 4]]}, {"flags": [-1]},
            {"flags": [2**40]}, {"label": [0.5]}, {"star_id": [np.nan]}, {"x_px": [np.nan]},
            {"x_px": [np.inf]}, {"label": [6]}, {"label_probability": [2.0]},
            {"cov_yy": [-1.0], "cov_xx": [1.0]}, {"x_px": [object()]}, {"x_px": [None]},
            np.zeros(2, bst.Track.dtype), np.zeros((1, 1), bst.Detection.dtype)]
CLOSED = [
    lambda s: s.step(), lambda s: s.step("frame"), lambda s: s.run_until(1), lambda s: s.tick,
    lambda s: s.time_s, lambda s: s.run, lambda s: s.frame, lambda s: s.tracks, lambda s: s.truth,
    lambda s: s.view("exposure"), lambda s: s.save(), lambda s: s.restore(b"x"),
    lambda s: s.clone(), lambda s: list(s.frames()), lambda s: s.counters, lambda s: s.observe(),
    lambda s: setattr(s, "detections", []), lambda s: s.command_pointing([0], [0, 0, 0, 1]),
    lambda s: s.command_state("a", 0, [0, 0, 0], [0, 0, 0]),
    lambda s: s.command_attitude("a", 0, [0, 0, 0, 1]), lambda s: pickle.dumps(s),
    lambda s: copy.deepcopy(s), lambda s: s.sensor("neossat/telescope").tracks,
]


def wrong_calls(sim):
    """Wrong calls of a simulation with an external imgproc, as functions."""
    def put(channel, value):
        return lambda: sim.command(channel, value)

    for value in NO_TEXTS:
        yield lambda v=value: sim.step(v)
        yield lambda v=value: sim.step("frame", scope=v)
        yield lambda v=value: sim.view(v)
        yield lambda v=value: sim.view("tracks", v)
        yield lambda v=value: sim.sensor(v)
        yield lambda v=value: sim.view_frame(v)
        yield lambda v=value: sim.frames(v)
        yield put(value, [])
    for value in NO_TIMES:
        yield lambda v=value: sim.run_until(v)
        yield lambda v=value: sim.step(until_s=v)
        yield lambda v=value: sim.frames(until_s=v)
    for value in (np.nan, np.inf, -np.inf, 1e300, 10**400):
        yield lambda v=value: sim.run_until(v)
    for value in ("", "nothing", "a\0b", "frame\n", "\udcff"):
        yield lambda v=value: sim.step(v)
        yield lambda v=value: sim.view(v)
        yield lambda v=value: sim.sensor(v)
        yield lambda v=value: sim.view("tracks", v)
        yield put(value, [])
    for value in NO_ITEMS:
        yield put("detections", value)
    for channel in ("tracks", "predictions", "los_command", "sensor_command", "control_status",
                    "frame", "truth", "exposure", "pointing_telemetry"):
        yield put(channel, {})
        yield put(channel, None)
        yield put(channel, bst.Detections())
    for value in (5, "x", [1, 2], [0, 0, 0], [np.nan, 0, 1], np.zeros((3, 3)), ["a", "b", "c"]):
        yield put("los_command", value)
    for ticks, q in (("a", [0, 0, 0, 1]), ([1.5], [0, 0, 0, 1]), ([1, 2], [0, 0, 1]),
                     ([[1]], [0, 0, 0, 1]), ([1], "q"), ([1], [[0, 0, 0, 1]] * 2),
                     (np.arange(70000), [0, 0, 0, 1]), ([1], [0, 0, 0, 1])):
        yield lambda t=ticks, a=q: sim.command_pointing(t, a)
    for arguments in ((5, 1, [0, 0, 0], [0, 0, 0]), ("INMARSAT GX5", "1", [0, 0, 0], [0, 0, 0]),
                      ("INMARSAT GX5", 1, [0, 0], [0, 0, 0]),
                      ("INMARSAT GX5", 1, [0, 0, 0], "abc"), ("nobody", 1, [0, 0, 0], [0, 0, 0]),
                      ("INMARSAT GX5", np.nan, [0, 0, 0], [0, 0, 0]),
                      ("INMARSAT GX5", 1, [7e6, 0, 0], [0, 7e3, 0]),
                      ("INMARSAT GX5", 1, [np.inf, 0, 0], [0, 0, 0])):
        yield lambda a=arguments: sim.command_state(*a)
    for arguments in ((5, 1, [0, 0, 0, 1]), ("INMARSAT GX5", 1, [0, 0, 1]),
                      ("INMARSAT GX5", 1, [0, 0, 0, 1], "abc"), ("nobody", 1, [0, 0, 0, 1]),
                      ("INMARSAT GX5", np.nan, [0, 0, 0, 1]), ("INMARSAT GX5", 1, [0, 0, 0, 1])):
        yield lambda a=arguments: sim.command_attitude(*a)
    for value in (5, "text", None, [], b"", b"x", b"BSTSTATE" + bytes(400), bytearray(1000),
                  bst.Snapshot(b"y" * 300)):
        yield lambda v=value: sim.restore(v)
    for value in (5, None, "nothing", [], [5], ["plant", "nothing"], [None]):
        yield lambda v=value: sim.restore(b"x" * 500, v)
    for value in (5, "f", [], object()):
        yield lambda v=value: sim.observe(message=v)
        yield lambda v=value: sim.observe(event=v)
    for value in (5, "nothing", ["frame", 5], [None]):
        yield lambda v=value: sim.observe(channels=v)
    for name in ("truth", "frame", "tick", "time_s", "exposure"):
        yield lambda n=name: setattr(sim, n, 1)


def wrong_objects():
    """Wrong constructions, as functions."""
    for value in (5, None, b"x", [], object(), "no such file.json", "a\0b", {}, {"boresight": 1},
                  {"x": object()}, {"x": float("nan")}, "/", bst.Scenario):
        yield lambda v=value: bst.Simulation(v)
        yield lambda v=value: bst.Model(v)
    for keys in ({"external": 5}, {"external": [5]}, {"external": ["nothing"]},
                 {"external": ["scenegen"]}, {"run": -1}, {"run": 1.5}, {"run": "1"},
                 {"run": 2**70}, {"device": 5}, {"threads": -1}, {"threads": "2"},
                 {"device": "no such device"}, {"nothing": 1}):
        yield lambda k=keys: bst.Simulation(SMALL, **k)
    for values in ({"duration_s": "x"}, {"duration_s": -1}, {"nothing": 1}, {"duration_s": [1]},
                   {"objects__7__area_m2": 1}, {"objects__0__area_m2": None},
                   {"duration_s": float("nan")}, {"observers__0__sensors": {}}):
        yield lambda v=values: SMALL.with_(**v).validate()
    for values in ({5: 1}, {"no pointer": 1}, {"/duration_s": object()}, {"/duration_s": {1, 2}}):
        yield lambda v=values: SMALL.with_(v)
    for kind in (bst.Detections, bst.Tracks, bst.LosCommand, bst.Window, bst.Task):
        yield lambda k=kind: k(nothing=1)
        yield lambda k=kind: k("items")
        yield lambda k=kind: k.of(np.zeros(5))
        yield lambda k=kind: k.of(b"x")
        yield lambda k=kind: setattr(k(), "x", 1)
    for members in ({"exposure_id": "a"}, {"exposure_id": 1.5}, {"exposure_id": 2**70},
                    {"q_cam_from_gcrf": [1, 2]}, {"count": 3}, {"noise_e": object()}):
        yield lambda m=members: bst.Detections(**m)
    yield lambda: bst.read_run("no such folder")
    yield lambda: bst.orbit(5)
    yield lambda: bst.pd(SMALL, snr=object())
    yield lambda: bst.pd(SMALL, json="x")
    yield lambda: bst.loop(SMALL, nothing=1)
    yield lambda: bst.study("no such file")
    yield lambda: bst.report("no such folder")


def works(*arguments, **keys):
    """A function that could be registered."""


class NoCall:
    """A class that cannot be called."""

    def __init__(self, first):
        self.first = first


class NoLaw(NoCall):
    """A compensator with a wrong number of numbers."""
    states = 1000

    def step(self, state, error):
        """Output."""
        return error


def with_attributes(**attributes):
    """A module with attributes of its own."""
    def module(step):
        pass
    vars(module).update(attributes)
    return module


def with_key(default):
    """A module with a key."""
    def module(step, *, key=default):
        pass
    return module


def wrong_registrations():
    """Wrong plug-ins, as functions."""
    roles = ("detector", "frame_stage", "compensator", "imgproc", "tracker", "control", "tasking")
    for role in roles:
        for value in (5, "text", b"x", [], {}, object(), NoCall):
            yield lambda r=role, v=value: bst.register(**{r: v})
        for name in ("a/b", "a b", "\0", "x" * 200, 5, b"x"):
            yield lambda r=role, n=name: bst.register(n, **{r: NoLaw if r == "compensator"
                                                              else works})
    yield lambda: bst.register()
    yield lambda: bst.register("name")
    yield lambda: bst.register(gimbal=works)
    yield lambda: bst.register(compensator=works)
    yield lambda: bst.register(compensator=NoLaw)
    for role in ("imgproc", "tracker", "control", "tasking"):
        for attributes in ({"rate_hz": "fast"}, {"rate_hz": -1}, {"rate_hz": np.nan},
                           {"rate_hz": True}, {"ports": 5}, {"ports": ["tracks"]}, {"ports": []},
                           {"ports": [bst.Port("tracks")]},
                           {"ports": [bst.Port("nothing", output=True)]},
                           {"ports": [bst.Port("planes"), bst.Port("task", output=True)]},
                           {"ports": [bst.Port("frame", output=True)]},
                           {"ports": [bst.Port("los_history", output=True)]},
                           {"ports": [bst.Port("tracks"), bst.Port("tracks", output=True)]},
                           {"ports": [bst.Port("tracks", output=True, capacity=-1)]},
                           {"ports": [bst.Port("tracks", output=True, capacity=10**6)]},
                           {"ports": [bst.Port("task", output=True),
                                      bst.Port("tracks", max_age_s=np.nan)]}):
            yield lambda r=role, a=attributes: bst.register(**{r: with_attributes(**a)})
        for default in (None, [], np.nan, 1j, b"x"):
            yield lambda r=role, d=default: bst.register(**{r: with_key(d)})
    for keys in ({"tracker": 5}, {"tracker": "python:nobody"}, {"control": "no/file.so"}, {},
                 {"tasking": "python:nobody"}, {"gimbal": "python:nobody"},
                 {"compensator": "python:nobody"}):
        yield lambda k=keys: SMALL.with_plugin(**k).validate()


# what a tracker must not do in its step: the text is executed with `step`, `env` and `bst`
WRONG_STEPS = [
    "return 5", "return 'tracks'", "return [1]", "return {'tracks': 5}", "return {'nothing': []}",
    "return {5: []}", "return bst.Detections()", "return [bst.Tracks(), bst.Detections()]",
    "return {'neossat/telescope': 5}", "step.detections = []", "step.tracks = 5",
    "step.tracks = 'x'", "step.tracks = [None]", "step.tracks = {'id': ['a']}",
    "step.tracks = {'nothing': [1]}", "step.los_command = [0, 0, 1]", "step.task = {}",
    "step.frame", "step.truth", "step.tracks", "step.view('nothing')", "step.view(5)",
    "step.view(None)", "step.view([])", "step.unread('tracks')", "step.unread([])",
    "step.command('tracks', 5)", "step.command(5, [])", "step.command(None, None)",
    "step.command([], [])", "step.event(5, 'x')", "step.event('x', None)", "step.event('a\\0', 'b')",
    "step.count(5)", "step.count('a\\0')", "step.sensors['nobody']", "step.nothing",
    "step.nothing = 1", "step.detections.items['x_px'][:] = 0", "step.detections.exposure_id = 5",
    "step.detections.array['exposure_id'] = 5", "env.directions_cam('x', [1])",
    "env.directions_cam([1], [1, 2])", "env.directions_cam([[1]], [[1]])",
    "env.directions_cam(None, [1])", "env.directions_gcrf([1], [1], [0, 0, 0, 2])",
    "env.directions_gcrf([1], [1], 'q')", "env.directions_gcrf([1], [1], [0, 0, 1])",
    "env.directions_gcrf([1], [1], None)", "pickle.dumps(env)", "pickle.dumps(step)",
    "step.tracks = [{'direction_gcrf': [0, 0, 2]}]", "return bst.Tracks([{}])",
    "return bst.Tracks([{'id': 1, 'direction_gcrf': [0, 0, np.nan]}])",
    "return bst.Predictions([{'direction_gcrf': [0, 0, 0]}])",
]


def call_in_child(function):
    """Result of a function in a forked process: "raised NAME", "returned", or the exit code."""
    reading, writing = os.pipe()
    child = os.fork()
    if child == 0:
        try:
            function()
            text = "returned"
        except BaseException as error:  # pylint: disable=broad-except
            text = f"raised {type(error).__name__}"
        os.write(writing, text.encode())
        os._exit(0)
    os.close(writing)
    said = os.read(reading, 1000).decode()
    os.close(reading)
    _, code = os.waitpid(child, 0)
    return said if code == 0 else f"exit code {code}"


class Misuse(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.model = bst.Model(SMALL, external=["imgproc"]).prepare()

    def setUp(self):
        self.sim = bst.Simulation(self.model)
        self.sim.run_until(2)

    def tearDown(self):
        self.sim.close()

    def check(self, number, call):
        with self.assertRaises(Exception, msg=f"call {number} raised nothing") as caught:
            call()
        self.assertTrue(str(caught.exception), f"call {number}: an exception without a text")

    def test_wrong_calls_raise(self):
        calls = list(wrong_calls(self.sim))
        self.assertGreaterEqual(len(calls), 200)
        for number, call in enumerate(calls):
            with self.subTest(call=number):
                self.check(number, call)
        self.sim.run_until(4)  # unharmed
        with bst.Simulation(self.model) as other:
            other.run_until(4)
            self.assertEqual(other.tracks, self.sim.tracks)
            np.testing.assert_array_equal(other.frame.data, self.sim.frame.data)

    def test_wrong_constructions_raise(self):
        for number, call in enumerate(wrong_objects()):
            with self.subTest(call=number):
                self.check(number, call)

    def test_a_pool_raises(self):
        pool, other = bst.Pool(2), bst.Simulation(self.model)
        pair = [self.sim, None]
        with pool.hold(pair) as held:
            exposure = held.view("exposure")
            small = np.zeros(1, bst.LosCommand.dtype)
            calls = [
                lambda: held.step("nonsense"), lambda: held.step(3), lambda: held.step("frame", [1]),
                lambda: held.step("frame", until_s="x"), lambda: held.step("frame", where=[True]),
                lambda: held.step("frame", until_s=float("nan")),
                lambda: held.view("nonsense"), lambda: held.view(None), lambda: held.view("frame", 7),
                lambda: held.view("exposure", items=-1), lambda: held.view("truth", into=exposure),
                lambda: held.view("exposure", into=3), lambda: held.view("tracks", "no/sensor"),
                lambda: held.view("exposure", into=exposure._replace(ticks=exposure.ticks[:1])),
                lambda: held.view("exposure", into=exposure._replace(counts=exposure.ticks)),
                lambda: held.command("detections", small), lambda: held.command("x", small),
                lambda: held.command("los_command", small), lambda: held.command("los_command", 3),
                lambda: held.command("los_command", np.zeros(2, bst.LosCommand.dtype)),
                lambda: self.sim.tracks, lambda: self.sim.close(),
                lambda: pool.hold([other]).__enter__(), lambda: bst.Pool(1).hold(pair).__enter__()]
            for number, call in enumerate(calls):
                with self.subTest(call=number):
                    self.check(number, call)
        for number, call in enumerate([
                lambda: held.step("frame"), lambda: held.view("exposure"), held.ticks,
                lambda: pool.hold([self.sim, self.sim]).__enter__(), lambda: bst.Pool(-1),
                lambda: bst.Pool("x"), lambda: pool.hold([3]).__enter__()]):
            with self.subTest(after=number):
                self.check(number, call)
        other.close()
        with self.assertRaises(bst.ClosedError):
            with pool.hold([self.sim, other]):
                pass
        self.assertEqual(call_in_child(lambda: pool.hold([]).__enter__()), "raised ForkError")
        with pool.hold([self.sim]) as held:  # unharmed
            self.assertEqual(held.step("frame")[0], 1)

    def test_a_callback_of_a_pool_raises(self):
        pool, seen = bst.Pool(2), []

        def look(_message):
            with self.assertRaises(bst.BusyError):
                held.view("exposure")
            seen.append(1)
            raise KeyError("own")
        self.sim.observe(message=look, channels=["exposure"])
        with pool.hold([self.sim]) as held:
            with self.assertRaises(KeyError):
                held.step("frame")
        self.assertEqual(seen, [1])

    def test_wrong_registrations_raise(self):
        calls = list(wrong_registrations())
        self.assertGreaterEqual(len(calls), 150)
        for number, call in enumerate(calls):
            with self.subTest(call=number):
                self.check(number, call)

    def test_wrong_steps_raise(self):
        scenario = SMALL.with_({"/observers/0/sensors/0/modules/scenegen/star_limit_v_mag": 5})
        space = {"bst": bst, "np": np, "pickle": pickle}
        steps = []  # the one that is tried is the last

        class Wrong:
            def __init__(self, env):
                self.env = env

            def __call__(self, step):
                return steps[-1](self.env, step)
        # one model for all: its catalogue and kernels are prepared once
        model = bst.Model(scenario.with_plugin(tracker=bst.register(tracker=Wrong))).prepare()
        for number, text in enumerate(WRONG_STEPS):
            exec(f"def wrong(env, step):\n    {text}\n", space)
            steps.append(space["wrong"])
            with bst.Simulation(model) as sim, self.subTest(step=text):
                self.check(number, lambda: sim.run_until(2))

    def test_an_env_ends_with_its_simulation(self):
        kept = []

        class Keeps:
            def __init__(self, env):
                kept.append(env)

            def __call__(self, step):
                kept.append(step)
        sim = bst.Simulation(SMALL.with_plugin(tracker=bst.register(tracker=Keeps)))
        sim.run_until(1)
        self.assertEqual(kept[0].directions_cam([1.0], [2.0]).shape, (1, 3))
        sim.close()
        del sim
        gc.collect()
        with self.assertRaises(bst.ClosedError):
            kept[0].directions_cam([1.0], [2.0])
        self.assertEqual(kept[0].camera.width_px, 256)
        with self.assertRaises(bst.StateError):
            kept[1].detections

    def test_closed_simulations_raise(self):
        self.sim.close()
        self.sim.close()
        for number, call in enumerate(CLOSED):
            with self.subTest(call=number):
                with self.assertRaises(bst.ClosedError):
                    call(self.sim)
        self.assertIn("closed", repr(self.sim))

    def test_arrays_are_read_only(self):
        frame, message = self.sim.frame, self.sim.exposure
        with self.assertRaises(ValueError):
            frame.data[0, 0] = 1
        with self.assertRaises(ValueError):
            self.sim.truth.items["x_px" if False else "x_mid_px"][:] = 0
        with self.assertRaises(ValueError):
            message.array["id"] = 5
        with self.assertRaises(bst.ArgumentError):
            message.id = 5

    def test_one_thread_at_a_time(self):
        raised, done = [], threading.Event()
        entered = threading.Event()

        def slow(_message):
            entered.set()
            done.wait(20)
        self.sim.observe(message=slow, channels=["exposure"])
        thread = threading.Thread(target=lambda: self.sim.run_until(3))
        thread.start()
        self.assertTrue(entered.wait(20))
        for call in (lambda: self.sim.tracks, lambda: self.sim.step(), self.sim.close,
                     lambda: self.sim.run_until(9), self.sim.save):
            try:
                call()
            except bst.BusyError as error:
                raised.append(error)
        done.set()
        thread.join()
        self.assertEqual(len(raised), 5)
        self.assertEqual(self.sim.time_s, 3)

    def test_many_threads_at_random(self):
        errors = []

        def work(number):
            for k in range(60):
                try:
                    (self.sim.step, lambda: self.sim.tracks, lambda: self.sim.frame,
                     lambda: self.sim.run_until(self.sim.time_s + 0.05))[(number + k) % 4]()
                except bst.BusyError:
                    pass
                except Exception as error:  # pylint: disable=broad-except
                    errors.append(error)
        threads = [threading.Thread(target=work, args=(n,)) for n in range(6)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        self.assertEqual(errors, [])

    def test_forked_processes_raise(self):
        frame = self.sim.frame
        for call in (lambda: self.sim.step(), lambda: self.sim.tracks, lambda: self.sim.save(),
                     lambda: bst.Simulation(self.model)):
            self.assertEqual(call_in_child(call), "raised ForkError")

        def drop_all():  # nothing of the parent is freed by its child
            nonlocal frame
            self.sim.close()
            del self.sim
            frame = None
            gc.collect()
        self.assertEqual(call_in_child(drop_all), "returned")
        self.assertEqual(int(frame.data.sum()), int(self.sim.frame.data.sum()))
        self.sim.run_until(3)

    def test_spawned_processes_get_the_scenario(self):
        context = multiprocessing.get_context("spawn")
        with context.Pool(1) as pool:
            self.assertEqual(pool.apply(bst.Scenario.to_dict, (SMALL,)), SMALL.to_dict())


if __name__ == "__main__":
    main()
