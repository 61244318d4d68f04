"""Several environments at once: their simulations step in threads, in C code without Python's lock.
"""
from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor
from typing import Any, Dict, List, Optional, Sequence, Tuple, Union

import numpy as np
import numpy.typing as npt
from gymnasium.spaces import Box
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from ..errors import ArgumentError
from ..model import Model
from ..pool import Pool
from .pointing import Observation, pointing_model, pointing_observations
from .pointing_group import PointingGroup, PointingSettings
from .tasking import TaskingEnv, TaskingModel

_Base: Any = VectorEnv
Batch = Dict[str, npt.NDArray[np.float32]]


def _seeds(seed: Union[int, Sequence[Optional[int]], None], count: int) -> List[Optional[int]]:
    """Run numbers of environments: seed + k, or those given; None: random ones."""
    if seed is None:
        return [None] * count
    return [seed + k for k in range(count)] if isinstance(seed, int) else list(seed)


class ThreadedVectorEnv(_Base):
    """Several environments, stepped in threads. An environment that has ended starts anew with the
    step after (gymnasium's AutoresetMode.NEXT_STEP).

    Given:     envs     of one kind
               threads  that step them; 0: one for each processor
    """

    metadata = {"autoreset_mode": AutoresetMode.NEXT_STEP, "render_modes": []}

    def __init__(self, envs: Sequence[Any], threads: int = 0):
        self.envs = list(envs)
        num_envs = self.num_envs = len(self.envs)
        self.single_observation_space = self.envs[0].observation_space
        self.single_action_space = self.envs[0].action_space
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._pool = ThreadPoolExecutor(threads or min(num_envs, len(os.sched_getaffinity(0))))
        self._ended = np.zeros(num_envs, bool)

    def reset(self, *, seed: Union[int, Sequence[Optional[int]], None] = None,
              options: Optional[Dict[str, Any]] = None) -> Tuple[Batch, Dict[str, Any]]:
        """Starts all; an integer seed gives environment k the run number seed + k."""
        seeds = _seeds(seed, self.num_envs)

        def begin(number: int) -> Tuple[Observation, Dict[str, Any]]:
            env: Any = self.envs[number]
            observation, info = env.reset(seed=seeds[number])
            return observation, info
        results = list(self._pool.map(begin, range(self.num_envs)))
        self._ended[:] = False
        return self._stack([r[0] for r in results]), self._infos([r[1] for r in results])

    def step(self, actions: Any) -> Tuple[Batch, Any, Any, Any, Dict[str, Any]]:
        """Steps all at once."""
        def one(number: int) -> Tuple[Observation, float, bool, bool, Dict[str, Any]]:
            if self._ended[number]:
                observation, info = self.envs[number].reset()
                return observation, 0.0, False, False, info
            observation, reward, terminated, truncated, info = self.envs[number].step(
                actions[number])
            return observation, reward, terminated, truncated, info
        results = list(self._pool.map(one, range(self.num_envs)))
        terminated = np.array([r[2] for r in results])
        truncated = np.array([r[3] for r in results])
        self._ended = terminated | truncated
        return (self._stack([r[0] for r in results]), np.array([r[1] for r in results], np.float64),
                terminated, truncated, self._infos([r[4] for r in results]))

    @staticmethod
    def _stack(observations: List[Observation]) -> Batch:
        return {key: np.stack([o[key] for o in observations]) for key in observations[0]}

    def _infos(self, infos: List[Dict[str, Any]]) -> Dict[str, Any]:
        out: Dict[str, Any] = {}
        for number, info in enumerate(infos):
            out = self._add_info(out, info, number)
        return out

    def close_extras(self, **_: Any) -> None:
        """Ends the simulations and threads."""
        for env in self.envs:
            env.close()
        self._pool.shutdown()


class PointingVectorEnv(_Base):
    """Several PointingEnv that share a model, as arrays: C code steps them in a pool of threads. An
    environment that has ended starts anew with the step after (AutoresetMode.NEXT_STEP).

    Given:     threads  of the pool; 0: one for each processor
               the others are those of PointingEnv
    """

    metadata = {"autoreset_mode": AutoresetMode.NEXT_STEP, "render_modes": []}

    def __init__(self, num_envs: int = 1, scenario: Any = None, *, threads: int = 0,
                 model: Optional[Model] = None, detections: int = 16, rate_step_px: float = 20.0,
                 offset_px: float = 200.0, patience: int = 10):
        self.num_envs = num_envs
        self.model = model or pointing_model(scenario)
        settings = PointingSettings(detections, rate_step_px, offset_px, patience)
        self.single_observation_space = pointing_observations(settings)
        self.single_action_space = Box(-1, 1, (2,), np.float32)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._group = PointingGroup(self.model, num_envs, Pool(threads), settings)
        self._generators = [seeding.np_random()[0] for _ in range(num_envs)]
        self._ended = np.zeros(num_envs, bool)

    def reset(self, *, seed: Union[int, Sequence[Optional[int]], None] = None,
              options: Optional[Dict[str, Any]] = None) -> Tuple[Batch, Dict[str, Any]]:
        """Starts all; an integer seed gives environment k the run number seed + k."""
        seeds = _seeds(seed, self.num_envs)
        for number, one in enumerate(seeds):
            if one is not None:
                self._generators[number] = seeding.np_random(one)[0]
        self._begin(list(range(self.num_envs)), seeds)
        self._group.settle()
        self._ended[:] = False
        return self._observations(), self._infos()

    def _begin(self, numbers: List[int], seeds: Sequence[Optional[int]]) -> None:
        generators = [self._generators[number] for number in numbers]
        runs = [int(generator.integers(2**31)) if seed is None else seed
                for seed, generator in zip(seeds, generators)]
        self._group.begin(numbers, runs, generators)

    def step(self, actions: Any) -> Tuple[Batch, Any, Any, Any, Dict[str, Any]]:
        """Steps all at once."""
        given = np.asarray(actions, np.float64)
        if given.shape != (self.num_envs, 2) or not np.all(np.isfinite(given)):
            raise ArgumentError(f"actions have {self.num_envs} x 2 finite numbers, found "
                                f"{actions!r}")
        if any(sim is None for sim in self._group.sims):
            raise ArgumentError("step before reset, or after close")
        fresh = self._ended
        if fresh.any():
            numbers = [int(k) for k in np.flatnonzero(fresh)]
            self._begin(numbers, [None] * len(numbers))
        out = self._group.step(given, fresh)
        self._ended = out.terminated | out.truncated
        return (self._observations(), out.reward, out.terminated, out.truncated, self._infos())

    def _observations(self) -> Batch:
        return {"detections": self._group.detections.copy(),
                "rate": self._group.rate.astype(np.float32)}

    def _infos(self) -> Dict[str, Any]:
        there = np.ones(self.num_envs, bool)
        return {"error_px": self._group.error_px.copy(), "_error_px": there,
                "in_field": self._group.in_field.copy(), "_in_field": there}

    def close_extras(self, **_: Any) -> None:
        """Ends the simulations."""
        self._group.close()


class TaskingVectorEnv(ThreadedVectorEnv):
    """Several TaskingEnv that share a model; further options are those of TaskingEnv."""

    def __init__(self, num_envs: int = 1, scenario: Any = None, *, threads: int = 0,
                 targets: int = 24, **options: Any):
        model = options.pop("model", None) or TaskingModel(scenario, targets)
        super().__init__([TaskingEnv(model=model, **options) for _ in range(num_envs)], threads)
