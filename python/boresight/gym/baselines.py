"""Policies to compare with: random, greedy, and the built-in control."""
from __future__ import annotations

from typing import Any, Callable, Optional, Sequence

import numpy as np

from ..messages import SourceKind, TruthFlag
from ..model import Model
from ..scenario import Scenario
from ..simulation import Simulation
from .pointing import Action, Observation, PointingEnv, default_scenario
from .pointing_group import REWARD_PX

Policy = Callable[[Observation], Action]


def random_policy(seed: int = 0) -> Policy:
    """Random actions."""
    generator = np.random.default_rng(seed)
    return lambda observation: generator.uniform(-1, 1, 2).astype(np.float32)


def greedy_policy(env: PointingEnv, gain: float = 0.3, damping: float = 0.9) -> Policy:
    """Turns towards the brightest detection that is no star and not at the edge, by a proportional
    and derivative law on its pixels."""
    half = np.array([env.camera.width_px, env.camera.height_px]) / 2.0
    before: "list[Any]" = []

    def act(observation: Observation) -> Action:
        rows = observation["detections"]
        rows = rows[(rows[:, 4] == 1) & (rows[:, 3] < 0.75)
                    & (np.abs(rows[:, :2]).max(axis=1) < 0.95)]
        if not len(rows):
            before.clear()
            return np.zeros(2, np.float32)
        offset = rows[np.argmax(rows[:, 2]), :2] * half / env.rate_step_px
        motion = offset - before[0] if before else np.zeros(2)
        before[:] = [offset]
        action: Action = np.clip(gain * offset + damping * motion, -1, 1).astype(np.float32)
        return action
    return act


def score(env: PointingEnv, policy: Policy, runs: Sequence[int] = range(5),
          steps: Optional[int] = None) -> float:
    """Mean reward per frame of a policy over some runs; an episode that ends early has 0 for the
    rest of it."""
    total, count = 0.0, 0
    for run in runs:
        observation, _ = env.reset(seed=run)
        most = steps or int(env.model.duration_s) - 5
        for _ in range(most):
            observation, reward, terminated, truncated, _ = env.step(policy(observation))
            total += reward
            if terminated or truncated:
                break
        count += most
    return total / count


def builtin_score(scenario: Any = None, runs: Sequence[int] = range(5),
                  offset_px: float = 100.0) -> float:
    """The same figure of the built-in control, whose cue is off by a distance."""
    given = default_scenario() if scenario is None else Scenario.of(scenario)
    camera = Model(given).camera()
    model = Model(given.with_({"/observers/0/sensors/0/cue/offset_deg":
                               offset_px * camera.pixel_scale_arcsec / 3600.0})).prepare()
    total, count = 0.0, 0
    for run in runs:
        with Simulation(model, run=run) as sim:
            for _ in range(4):
                sim.step("detections")
            while sim.step("detections") is not None:
                truth = sim.truth
                assert truth is not None
                items = truth.items[truth.items["kind"] == SourceKind.OBJECT]
                if len(items) and items[0]["flags"] & TruthFlag.IN_FIELD:
                    error = np.hypot(items[0]["x_mid_px"] - truth.boresight_x_px,
                                     items[0]["y_mid_px"] - truth.boresight_y_px)
                    total += float(1.0 / (1.0 + (error / REWARD_PX) ** 2))
                count += 1
    return total / max(count, 1)
