"""PointingEnv: keep a satellite at the boresight, from detections alone."""
from __future__ import annotations

from typing import Any, Dict, Optional, Tuple

import numpy as np
import numpy.typing as npt

from ..errors import ArgumentError
from ..messages import Label
from ..model import Model
from ..pool import Pool
from ..scenario import Scenario
from ..simulation import Simulation
from .base import Env, spaces
from .pointing_group import HIGH, LOW, PointingGroup, PointingSettings

Observation = Dict[str, npt.NDArray[np.float32]]
Action = npt.NDArray[np.float32]


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
        self.settings = PointingSettings(detections, rate_step_px, offset_px, patience)
        self.rate_step_px = rate_step_px
        self.camera = self.model.camera()
        self.observation_space: Any = pointing_observations(self.settings)
        self.action_space: Any = spaces.Box(-1, 1, (2,), np.float32)
        self._group = PointingGroup(self.model, 1, Pool(1), self.settings)

    @property
    def simulation(self) -> Optional[Simulation]:
        """The simulation of the episode; None before `reset`."""
        return self._group.sims[0]

    def reset(self, *, seed: Optional[int] = None,
              options: Optional[Dict[str, Any]] = None) -> Tuple[Observation, Dict[str, Any]]:
        """Starts the run with the number `seed`; None: a random one."""
        super().reset(seed=seed)
        run = int(self.np_random.integers(2**31)) if seed is None else seed
        self._group.begin([0], [run], [self.np_random])
        self._group.settle()
        return self._observe(), self._info()

    def step(self, action: Action) -> Tuple[Observation, float, bool, bool, Dict[str, Any]]:
        """Commands the line of sight and goes to the next detections."""
        if self.simulation is None:
            raise ArgumentError("step before reset, or after close")
        given = np.asarray(action, np.float64)
        if given.shape != (2,) or not np.all(np.isfinite(given)):
            raise ArgumentError(f"an action has two finite numbers, found {action!r}")
        out = self._group.step(given[None], np.zeros(1, bool))
        return (self._observe(), float(out.reward[0]), bool(out.terminated[0]),
                bool(out.truncated[0]), self._info())

    def _observe(self) -> Observation:
        return {"detections": self._group.detections[0].copy(),
                "rate": self._group.rate[0].astype(np.float32)}

    def _info(self) -> Dict[str, Any]:
        """The truth of the newest frame."""
        return {"error_px": float(self._group.error_px[0]),
                "in_field": bool(self._group.in_field[0])}

    def render(self) -> Any:
        """The detections as a picture: stars grey, others white."""
        image = np.zeros((256, 256, 3), np.uint8)
        items = self._group.items(0)
        if len(items):
            x = items["x_px"] / self.camera.width_px * 255
            y = items["y_px"] / self.camera.height_px * 255
            grey = np.where(items["label"] == Label.STAR, 110, 255)
            inside = (x >= 0) & (x < 256) & (y >= 0) & (y < 256)
            image[y[inside].astype(int), x[inside].astype(int)] = grey[inside, None]
        return image

    def close(self) -> None:
        """Ends the simulation."""
        self._group.close()


def pointing_observations(settings: PointingSettings) -> Any:
    """The space of observations of PointingEnv."""
    low, high = np.tile(LOW, (settings.detections, 1)), np.tile(HIGH, (settings.detections, 1))
    return spaces.Dict({"detections": spaces.Box(low, high, dtype=np.float32),
                        "rate": spaces.Box(-100, 100, (2,), np.float32)})


def pointing_model(scenario: Any = None) -> Model:
    """A model whose control is played by an agent, which environments share."""
    return Model(default_scenario() if scenario is None else scenario, external=["control"]
                 ).prepare()


__all__ = ["PointingEnv", "default_scenario", "pointing_model"]
