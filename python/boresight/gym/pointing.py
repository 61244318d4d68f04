"""PointingEnv: keep a satellite at the boresight, from detections alone."""
from __future__ import annotations

from typing import Any, Dict, Optional, Tuple

import numpy as np
import numpy.typing as npt

from ..commands import los_command
from ..errors import ArgumentError
from ..messages import Detections, Label, SourceKind, TruthFlag
from ..model import Model
from ..scenario import Scenario
from ..simulation import Simulation
from .base import Env, spaces
from .geometry import cam_of_gcrf, gcrf_of_cam, tilted

Observation = Dict[str, npt.NDArray[np.float32]]
Action = npt.NDArray[np.float32]
REWARD_PX = 5.0
"""Error of pointing at which the reward is 1/2."""


def default_scenario() -> Scenario:
    """NEOSSat follows a geostationary satellite, with the observation generator."""
    return Scenario.load("neossat_geo_track.json").with_({
        "/observers/0/sensors/0/observation_source": "generator",
        "/observers/0/sensors/0/cue/offset_deg": 0, "/duration_s": 120})


class PointingEnv(Env[Observation, Action]):
    """Commands the line of sight of a telescope from the detections of each frame.

    Action: [2] change of the boresight's angular rate along camera +x and +y, in -1 to 1; 1 is
    `rate_step_px` pixels per frame. The commanded motion goes on until the next action.

    Observation: "detections" [n, 5] x and y from the centre of the sensor (1: its edge),
    log10 of SNR, 0 for objects, 1 for stars and 0.5 for what image processing does not know, 1 for
    rows that are in use; stars last, brightest first. "rate" [2] commanded rate in units of the
    action.

    Reward: 1 / (1 + (d / 5 px)^2) for the true distance d of the satellite from the boresight, 0
    where it is out of the field. The truth is in `info` only: "error_px", "in_field".

    An episode ends after the scenario's duration (truncated), or when the satellite has been out of
    the field for `patience` frames (terminated). `reset(seed=n)` starts the run number n.

    Given:     scenario      of one sensor; its control is played by the agent
               model         instead of a scenario: environments share it
               detections    rows of the observation
               offset_px     greatest distance of the satellite from the boresight at the start
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": 10}

    def __init__(self, scenario: Any = None, *, model: Optional[Model] = None,
                 detections: int = 16, rate_step_px: float = 20.0, offset_px: float = 200.0,
                 patience: int = 10, render_mode: Optional[str] = None):
        if render_mode not in (None, "rgb_array"):
            raise ArgumentError(f"render_mode {render_mode!r} (allowed: None, \"rgb_array\")")
        self.model = model or pointing_model(scenario)
        self.render_mode = render_mode
        self.rows, self.rate_step_px, self.offset_px = detections, rate_step_px, offset_px
        self.patience = patience
        self.camera = self.model.camera()
        low = np.tile(np.array([-2, -2, -2, 0, 0], np.float32), (detections, 1))
        high = np.tile(np.array([2, 2, 8, 1, 1], np.float32), (detections, 1))
        self._low, self._high = low, high
        self.observation_space: Any = spaces.Dict({
            "detections": spaces.Box(low, high, dtype=np.float32),
            "rate": spaces.Box(-100, 100, (2,), np.float32)})
        self.action_space: Any = spaces.Box(-1, 1, (2,), np.float32)
        self._sim: Optional[Simulation] = None
        self._rate = np.zeros(2)
        self._missed = 0
        self._last: Optional[Detections] = None

    def reset(self, *, seed: Optional[int] = None,
              options: Optional[Dict[str, Any]] = None) -> Tuple[Observation, Dict[str, Any]]:
        """Starts the run with the number `seed`; None: a random one."""
        super().reset(seed=seed)
        run = int(self.np_random.integers(2**31)) if seed is None else seed
        self.close()
        sim = self._sim = Simulation(self.model, run=run)
        self._rate, self._missed = np.zeros(2), 0
        sim.step("exposure")
        angle = self.np_random.uniform(0, 2 * np.pi)
        shift = self.offset_px * np.sqrt(self.np_random.uniform()) * self.camera.pixel_scale_rad
        telemetry = sim.pointing_telemetry
        assert telemetry is not None
        q = telemetry.items["q_cam_from_gcrf"][-1]
        sim.command("los_command", tilted(q, shift * np.cos(angle), shift * np.sin(angle)))
        for _ in range(4):  # the mount settles
            found = sim.step("detections")
        return self._observe(found), self._info()

    def step(self, action: Action) -> Tuple[Observation, float, bool, bool, Dict[str, Any]]:
        """Commands the line of sight and goes to the next detections."""
        sim = self._sim
        if sim is None:
            raise ArgumentError("step before reset, or after close")
        given = np.asarray(action, np.float64)
        if given.shape != (2,) or not np.all(np.isfinite(given)):
            raise ArgumentError(f"an action has two finite numbers, found {action!r}")
        self._rate = np.clip(self._rate + np.clip(given, -1, 1), -100, 100)
        self._command(sim)
        found = sim.step("detections")
        info = self._info()
        if found is None:
            return self._observe(self._last), 0.0, False, True, info
        self._missed = 0 if info["in_field"] else self._missed + 1
        error = info["error_px"]
        reward = 1.0 / (1.0 + (error / REWARD_PX) ** 2) if info["in_field"] else 0.0
        truncated = sim.time_s + self._period() > sim.duration_s
        return self._observe(found), float(reward), self._missed >= self.patience, truncated, info

    def _period(self) -> float:
        """Time between frames, s."""
        exposure = self._sim.exposure if self._sim else None
        return max((exposure.end_tick - exposure.start_tick) / self.model.tick_rate_hz, 1.0) \
            if exposure else 1.0

    def _command(self, sim: Simulation) -> None:
        """Turns the boresight on, from where it is by the telemetry, at the commanded rate."""
        telemetry = sim.pointing_telemetry
        assert telemetry is not None
        item = telemetry.items[-1]
        x, y = self._rate * self.rate_step_px * self.camera.pixel_scale_rad / self._period()
        direction = tilted(item["q_cam_from_gcrf"], 0.0, 0.0)
        rate = gcrf_of_cam(item["q_cam_from_gcrf"], [x, y, 0.0])
        rate -= direction * float(direction @ rate)
        sim.los_command = los_command(direction, rate, tick=int(item["tick"]))

    def _observe(self, found: Any) -> Observation:
        rows = np.zeros((self.rows, 5), np.float32)
        if isinstance(found, Detections):
            self._last = found
            star = found.items["label"] == Label.STAR
            items = found.items[np.lexsort((-found.items["snr"], star))][:self.rows]
            half = np.array([self.camera.width_px, self.camera.height_px]) / 2.0
            rows[:len(items), 0] = (items["x_px"] + 0.5 - half[0]) / half[0]
            rows[:len(items), 1] = (items["y_px"] + 0.5 - half[1]) / half[1]
            rows[:len(items), 2] = np.log10(np.maximum(items["snr"], 0.01))
            rows[:len(items), 3] = np.where(items["label"] == Label.STAR, 1.0, np.where(
                items["label"] == Label.OBJECT, 0.0, 0.5))
            rows[:len(items), 4] = 1.0
        return {"detections": np.clip(rows, self._low, self._high),
                "rate": self._rate.astype(np.float32)}

    def _info(self) -> Dict[str, Any]:
        """The truth of the newest frame."""
        truth = self._sim.truth if self._sim else None
        items = truth.items[truth.items["kind"] == SourceKind.OBJECT] if truth else []
        if not truth or not len(items):
            return {"error_px": float("inf"), "in_field": False}
        item = items[0]
        error = np.hypot(item["x_mid_px"] - truth.boresight_x_px,
                         item["y_mid_px"] - truth.boresight_y_px)
        return {"error_px": float(error) if np.isfinite(error) else float("inf"),
                "in_field": bool(item["flags"] & TruthFlag.IN_FIELD)}

    def render(self) -> Any:
        """The detections as a picture: stars grey, others white."""
        image = np.zeros((256, 256, 3), np.uint8)
        if self._last is not None:
            x = self._last.items["x_px"] / self.camera.width_px * 255
            y = self._last.items["y_px"] / self.camera.height_px * 255
            grey = np.where(self._last.items["label"] == Label.STAR, 110, 255)
            inside = (x >= 0) & (x < 256) & (y >= 0) & (y < 256)
            image[y[inside].astype(int), x[inside].astype(int)] = grey[inside, None]
        return image

    def close(self) -> None:
        """Ends the simulation."""
        if self._sim is not None:
            self._sim.close()
            self._sim = None


def pointing_model(scenario: Any = None) -> Model:
    """A model whose control is played by an agent, which environments share."""
    return Model(default_scenario() if scenario is None else scenario, external=["control"]
                 ).prepare()


__all__ = ["PointingEnv", "cam_of_gcrf", "default_scenario", "pointing_model"]
