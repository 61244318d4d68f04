"""Several environments at once: their simulations step in threads, in C code without Python's lock.
"""
from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from typing import Any, Dict, List, Optional, Sequence, Tuple, Union

import numpy as np
import numpy.typing as npt
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from .pointing import Observation, PointingEnv, pointing_model
from .tasking import TaskingEnv, TaskingModel

_Base: Any = VectorEnv
Batch = Dict[str, npt.NDArray[np.float32]]


class ThreadedVectorEnv(_Base):
    """Several environments, stepped in threads. An environment that has ended starts anew with the
    step after (gymnasium's AutoresetMode.NEXT_STEP).

    Given:     envs     of one kind
               threads  that step them; 0: one for each environment, at most 32
    """

    metadata = {"autoreset_mode": AutoresetMode.NEXT_STEP, "render_modes": []}

    def __init__(self, envs: Sequence[Any], threads: int = 0):
        self.envs = list(envs)
        num_envs = self.num_envs = len(self.envs)
        self.single_observation_space = self.envs[0].observation_space
        self.single_action_space = self.envs[0].action_space
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._pool = ThreadPoolExecutor(threads or min(num_envs, 32))
        self._ended = np.zeros(num_envs, bool)

    def reset(self, *, seed: Union[int, Sequence[Optional[int]], None] = None,
              options: Optional[Dict[str, Any]] = None) -> Tuple[Batch, Dict[str, Any]]:
        """Starts all; an integer seed gives environment k the run number seed + k."""
        if seed is None:
            seeds: List[Optional[int]] = [None] * self.num_envs
        elif isinstance(seed, int):
            seeds = [seed + k for k in range(self.num_envs)]
        else:
            seeds = list(seed)
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


class PointingVectorEnv(ThreadedVectorEnv):
    """Several PointingEnv that share a model; further options are those of PointingEnv."""

    def __init__(self, num_envs: int = 1, scenario: Any = None, *, threads: int = 0,
                 **options: Any):
        model = options.pop("model", None) or pointing_model(scenario)
        super().__init__([PointingEnv(model=model, **options) for _ in range(num_envs)], threads)


class TaskingVectorEnv(ThreadedVectorEnv):
    """Several TaskingEnv that share a model; further options are those of TaskingEnv."""

    def __init__(self, num_envs: int = 1, scenario: Any = None, *, threads: int = 0,
                 targets: int = 24, **options: Any):
        model = options.pop("model", None) or TaskingModel(scenario, targets)
        super().__init__([TaskingEnv(model=model, **options) for _ in range(num_envs)], threads)
