"""Gymnasium environments (`pip install boresight[gym]`).

>>> import gymnasium, boresight.gym
>>> env = gymnasium.make("boresight/Pointing-v0")
"""
from __future__ import annotations

import gymnasium

from .baselines import builtin_score, greedy_policy, random_policy, score
from .pointing import PointingEnv
from .tasking import (TaskingEnv, TaskingModel, builtin_tasking_score, greedy_tasks, random_tasks,
                      tasking_score)
from .vector import PointingVectorEnv, TaskingVectorEnv

__all__ = ["PointingEnv", "PointingVectorEnv", "TaskingEnv", "TaskingModel", "TaskingVectorEnv",
           "builtin_score", "builtin_tasking_score", "greedy_policy", "greedy_tasks",
           "random_policy", "random_tasks", "score", "tasking_score"]

gymnasium.register(id="boresight/Pointing-v0", entry_point="boresight.gym:PointingEnv",
                   vector_entry_point="boresight.gym:PointingVectorEnv")
gymnasium.register(id="boresight/Tasking-v0", entry_point="boresight.gym:TaskingEnv",
                   vector_entry_point="boresight.gym:TaskingVectorEnv")
