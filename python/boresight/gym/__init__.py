"""Gymnasium environments (`pip install boresight[gym]`).

>>> import gymnasium, boresight.gym
>>> env = gymnasium.make("boresight/Pointing-v0")
"""
from __future__ import annotations

import gymnasium

from .baselines import builtin_score, greedy_policy, random_policy, score
from .pointing import PointingEnv
from .vector import PointingVectorEnv

__all__ = ["PointingEnv", "PointingVectorEnv", "builtin_score", "greedy_policy", "random_policy",
           "score"]

gymnasium.register(id="boresight/Pointing-v0", entry_point="boresight.gym:PointingEnv",
                   vector_entry_point="boresight.gym:PointingVectorEnv")
