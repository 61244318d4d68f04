"""TaskingEnv: which satellite each telescope of a constellation looks at."""
from __future__ import annotations

import pathlib
from typing import Any, Dict, List, Optional, Tuple

import numpy as np
import numpy.typing as npt

from ..commands import los_command
from ..errors import ArgumentError
from ..messages import Detections, Label, NavTelemetry, SourceKind, Truth, TruthFlag
from ..model import Model
from ..scenario import Scenario
from ..simulation import Simulation
from .base import Env, spaces
from .catalogue import Catalogue, geostationary, propagated, visible
from .geometry import cam_of_gcrf, gcrf_of_cam

Observation = Dict[str, npt.NDArray[np.float32]]
MIN_SNR = 6.0
"""SNR in a frame from which a target counts as seen."""
MIN_FRAMES = 2
"""Frames of a decision in which a target must be seen."""
MATCH_PX = 8.0
"""Distance of a detection from a target's predicted place, at which it is taken for it."""


class TaskingModel:
    """A model with its targets, which environments share.

    Given:     scenario  of several sensors; None: constellation_quick.json
               targets   number of geostationary targets, evenly from the scenario's catalogue
    """

    def __init__(self, scenario: Any = None, targets: int = 24):
        given = Scenario.of("constellation_quick.json" if scenario is None else scenario)
        self.document = given.to_dict()
        catalogues = self.document["world"].get("catalogues") or []
        if not catalogues:
            raise ArgumentError("TaskingEnv needs a scenario with a catalogue in /world/catalogues")
        sets = geostationary(pathlib.Path(catalogues[0]["elements_file"]), targets)
        free = {k: v for k, v in self.document.items() if k != "tasking"}
        self.model = Model(free, external=["control"]).prepare()
        self.catalogue: Catalogue = propagated(sets, self.model.epoch_utc, self.model.duration_s)

    def with_tasking(self, revisit_s: float) -> Model:
        """The scenario with the built-in tasking module, for the same targets."""
        tasking = {"type": "priority", "targets": [
            {"object": name, "priority": 1, "revisit_s": revisit_s, "frames": 3}
            for name in self.catalogue.names]}
        return Model({**self.document, "tasking": tasking}).prepare()


class Score:
    """Counts the targets that sensors see, from the truth: the gain of a target is the time since it
    was seen before, over `revisit_s`, at most 1."""

    def __init__(self, norad: npt.NDArray[np.int64], revisit_s: float):
        self._index = {int(n): k for k, n in enumerate(norad)}
        self.revisit_s = revisit_s
        self.age_s = np.full(len(norad), float(revisit_s))
        self._frames = np.zeros(len(norad), int)

    def take(self, message: Any) -> None:
        """Counts the targets of a frame."""
        if isinstance(message, Truth):
            items = message.items[(message.items["kind"] == SourceKind.OBJECT)
                                  & (message.items["flags"] & TruthFlag.IN_FIELD > 0)
                                  & (message.items["flags"] & TruthFlag.OCCULTED == 0)
                                  & (message.items["snr"] >= MIN_SNR)]
            for norad in items["norad"]:
                if int(norad) in self._index:
                    self._frames[self._index[int(norad)]] += 1

    def gain(self, time_s: float) -> float:
        """Gain of the time since the last call, and starts anew."""
        self.age_s += time_s
        seen = self._frames >= MIN_FRAMES
        gain = float(np.minimum(self.age_s[seen] / self.revisit_s, 1.0).sum())
        self.age_s[seen] = 0.0
        self._frames[:] = 0
        return gain


class TaskingEnv(Env[Observation, Any]):
    """Chooses the target of each telescope of a constellation, every `decision_s` seconds.

    Action: MultiDiscrete, for each sensor the number of its target. The mount slews to the target's
    catalogued place and follows it; a target that cannot be seen now changes nothing.

    Observation: "targets" [sensors, targets, 4]: angle from the boresight over 180 degrees; 1 if it
    can be seen (sunlight, Earth, Sun), 1 if it is the sensor's target, and the time since it was
    detected by any sensor over `revisit_s` (at most 2); "time" [1] fraction of the run.

    Reward: sum over the targets that any sensor sees (SNR of 6 in two frames) of the time since each
    was seen before over `revisit_s`, at most 1. It follows from the truth, which is in `info` only:
    "age_s". `reset(seed=n)` starts the run number n.
    """

    metadata: Dict[str, Any] = {"render_modes": []}

    def __init__(self, scenario: Any = None, *, model: Optional[TaskingModel] = None,
                 targets: int = 24, decision_s: float = 20.0, revisit_s: float = 300.0):
        self.shared = model or TaskingModel(scenario, targets)
        self.sensors = self.shared.model.sensors
        self.count = len(self.shared.catalogue.names)
        self.decision_s, self.revisit_s = decision_s, revisit_s
        self.render_mode = None
        shape = (len(self.sensors), self.count, 4)
        self.observation_space: Any = spaces.Dict({
            "targets": spaces.Box(0, 2, shape, np.float32),
            "time": spaces.Box(0, 1, (1,), np.float32)})
        self.action_space: Any = spaces.MultiDiscrete([self.count] * len(self.sensors))
        self._sim: Optional[Simulation] = None
        self._score = Score(self.shared.catalogue.norad, revisit_s)
        self._detected_s = np.zeros(self.count)
        self._chosen: List[int] = []

    def reset(self, *, seed: Optional[int] = None,
              options: Optional[Dict[str, Any]] = None) -> Tuple[Observation, Dict[str, Any]]:
        """Starts the run with the number `seed`; None: a random one."""
        super().reset(seed=seed)
        run = int(self.np_random.integers(2**31)) if seed is None else seed
        self.close()
        self._sim = Simulation(self.shared.model, run=run)
        self._score = Score(self.shared.catalogue.norad, self.revisit_s)
        self._sim.observe(message=self._score.take, channels=["truth"])
        self._detected_s = np.full(self.count, -float(self.revisit_s))
        self._chosen = [-1] * len(self.sensors)
        self._sim.run_until(0.1)  # telemetry is there
        for row, scope in enumerate(self.sensors):  # the first targets that can be seen
            first = np.flatnonzero(self._visible(self._sim, scope))
            if len(first):
                self._point(self._sim, scope, int(first[row % len(first)]))
        self._sim.run_until(2.0)
        self._score.gain(0.0)
        return self._observe(self._sim), {"age_s": self._score.age_s.copy()}

    def step(self, action: Any) -> Tuple[Observation, float, bool, bool, Dict[str, Any]]:
        """Points the telescopes and goes to the next decision."""
        sim = self._sim
        if sim is None:
            raise ArgumentError("step before reset, or after close")
        given = np.asarray(action)
        if given.shape != (len(self.sensors),) or given.dtype.kind not in "iu" or \
                given.min() < 0 or given.max() >= self.count:
            raise ArgumentError(f"an action has {len(self.sensors)} numbers from 0 to "
                                f"{self.count - 1}, found {action!r}")
        self._chosen = [int(k) for k in given]
        for scope, target in zip(self.sensors, self._chosen):
            if self._visible(sim, scope)[target]:
                self._point(sim, scope, target)
        sim.run_until(sim.time_s + self.decision_s)
        self._match(sim)
        reward = self._score.gain(self.decision_s)
        truncated = sim.time_s + self.decision_s > sim.duration_s
        return self._observe(sim), reward, False, truncated, {"age_s": self._score.age_s.copy()}

    def _eye(self, sim: Simulation, scope: str) -> NavTelemetry:
        nav = sim.view("nav_telemetry", scope)
        assert isinstance(nav, NavTelemetry)
        return nav

    def _visible(self, sim: Simulation, scope: str) -> npt.NDArray[np.bool_]:
        """Targets that a sensor can look at now, by the catalogue and navigation."""
        nav = self._eye(sim, scope)
        return visible(nav.position_gcrf_m, self.shared.catalogue.at(sim.time_s), nav.sun_m)

    def _point(self, sim: Simulation, scope: str, target: int) -> None:
        """Commands the catalogued direction of a target and its rate."""
        nav, tick, rate_hz = self._eye(sim, scope), sim.tick, sim.tick_rate_hz
        sights = []
        for delay_s in (0.0, 1.0):
            time_s = tick / rate_hz + delay_s
            eye = nav.position_gcrf_m + nav.velocity_gcrf_mps * (time_s - nav.tick / rate_hz)
            sight = self.shared.catalogue.at(time_s)[target] - eye
            sights.append(sight / np.linalg.norm(sight))
        rate = sights[1] - sights[0]
        rate -= sights[0] * float(sights[0] @ rate)
        sim.command("los_command", los_command(sights[0], rate, tick=tick), scope)

    def _match(self, sim: Simulation) -> None:
        """Finds the sensors' targets among the newest detections, by their predicted places."""
        for scope, target in zip(self.sensors, self._chosen):
            found = sim.view("detections", scope)
            if not isinstance(found, Detections) or not found.q_cam_from_gcrf.any():
                continue
            time_s = 0.5 * (found.start_tick + found.end_tick) / sim.tick_rate_hz
            nav = self._eye(sim, scope)
            eye = nav.position_gcrf_m + nav.velocity_gcrf_mps * (
                time_s - nav.tick / sim.tick_rate_hz)
            camera = self.shared.model.camera(scope)
            x, y, z = cam_of_gcrf(found.q_cam_from_gcrf,
                                  self.shared.catalogue.at(time_s)[target] - eye)
            items = found.items[found.items["label"] != Label.STAR]
            if z <= 0 or not len(items):
                continue
            px = 0.5 * (camera.width_px - 1) + x / z / camera.pixel_scale_rad
            py = 0.5 * (camera.height_px - 1) + y / z / camera.pixel_scale_rad
            if np.hypot(items["x_px"] - px, items["y_px"] - py).min() < MATCH_PX:
                self._detected_s[target] = time_s

    def _observe(self, sim: Simulation) -> Observation:
        out = np.zeros((len(self.sensors), self.count, 4), np.float32)
        time_s = sim.time_s
        targets = self.shared.catalogue.at(time_s)
        for row, (scope, chosen) in enumerate(zip(self.sensors, self._chosen)):
            nav = self._eye(sim, scope)
            telemetry = sim.view("pointing_telemetry", scope)
            assert telemetry is not None
            boresight = gcrf_of_cam(telemetry.items["q_cam_from_gcrf"][-1], [0, 0, 1])
            sight = targets - nav.position_gcrf_m
            sight /= np.linalg.norm(sight, axis=1)[:, None]
            out[row, :, 0] = np.arccos(np.clip(sight @ boresight, -1, 1)) / np.pi
            out[row, :, 1] = self._visible(sim, scope)
            if chosen >= 0:
                out[row, chosen, 2] = 1.0
            out[row, :, 3] = np.clip((time_s - self._detected_s) / self.revisit_s, 0, 2)
        return {"targets": out,
                "time": np.array([min(time_s / sim.duration_s, 1.0)], np.float32)}

    def close(self) -> None:
        """Ends the simulation."""
        if self._sim is not None:
            self._sim.close()
            self._sim = None


def greedy_tasks(env: TaskingEnv, slew_weight: float = 3.0, wait: int = 8) -> Any:
    """A policy: each sensor in turn takes the visible target with the highest age over the way to
    it, that no sensor before has taken. A target that was looked at and not detected is left out
    for `wait` decisions."""
    left_out = np.zeros(env.count, int)
    arrived = 0.5 / 180.0  # of the angle in the observation: half a degree

    def act(observation: Observation) -> npt.NDArray[np.int64]:
        if float(observation["time"][0]) * env.shared.model.duration_s < env.decision_s:
            left_out[:] = 0  # a new run
        left_out[:] = np.maximum(left_out - 1, 0)
        for row in observation["targets"]:
            left_out[(row[:, 2] == 1) & (row[:, 0] < arrived) & (row[:, 3] > 0.5)] = wait
        chosen: List[int] = []
        for row in observation["targets"]:
            value = row[:, 1] * (row[:, 3] + 0.5 * row[:, 2] * (row[:, 0] >= arrived)) / (
                1.0 + slew_weight * row[:, 0])
            value[left_out > 0] *= 0.01
            value[chosen] = -1.0
            chosen.append(int(np.argmax(value)))
        return np.array(chosen, np.int64)
    return act


def random_tasks(env: TaskingEnv, seed: int = 0) -> Any:
    """A policy of random targets."""
    generator = np.random.default_rng(seed)
    return lambda observation: generator.integers(0, env.count, len(env.sensors))


def tasking_score(env: TaskingEnv, policy: Any, runs: Any = range(3)) -> float:
    """Mean sum of rewards of a run."""
    total = 0.0
    for run in runs:
        observation, _ = env.reset(seed=run)
        truncated = False
        while not truncated:
            observation, reward, _, truncated, _ = env.step(policy(observation))
            total += reward
    return total / len(runs)


def builtin_tasking_score(env: TaskingEnv, runs: Any = range(3)) -> float:
    """The same figure of the built-in tasking module and control, for the same targets."""
    model, total = env.shared.with_tasking(env.revisit_s), 0.0
    for run in runs:
        score = Score(env.shared.catalogue.norad, env.revisit_s)
        with Simulation(model, run=run) as sim:
            sim.observe(message=score.take, channels=["truth"])
            sim.run_until(2.0)
            score.gain(0.0)
            while sim.time_s + env.decision_s <= sim.duration_s + 1e-9:
                sim.run_until(sim.time_s + env.decision_s)
                total += score.gain(env.decision_s)
    return total / len(runs)
