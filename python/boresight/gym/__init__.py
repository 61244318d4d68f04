"""Gymnasium environments (`pip install boresight[gym]`). Without Gymnasium, environments can be made
and stepped; `gymnasium.make` and the vector environments need it.

>>> import gymnasium, boresight.gym
>>> env = gymnasium.make("boresight/Pointing-v0")
"""
from __future__ import annotations

from typing import TYPE_CHECKING, Any

from .base import HAS_GYMNASIUM
from .baselines import builtin_score, greedy_policy, random_policy, score
from .pointing import PointingEnv
from .tasking import (TaskingEnv, TaskingModel, builtin_tasking_score, greedy_tasks, random_tasks,
                      tasking_score)

if TYPE_CHECKING:
    from .vector import PointingVectorEnv as PointingVectorEnv
    from .vector import TaskingVectorEnv as TaskingVectorEnv

__all__ = ["PointingEnv", "PointingVectorEnv", "TaskingEnv", "TaskingModel", "TaskingVectorEnv",
           "builtin_score", "builtin_tasking_score", "greedy_policy", "greedy_tasks",
           "random_policy", "random_tasks", "score", "tasking_score"]


def __getattr__(name: str) -> Any:
    if name in ("PointingVectorEnv", "TaskingVectorEnv"):
        if not HAS_GYMNASIUM:
            raise ImportError(f"boresight.gym.{name} needs Gymnasium: pip install boresight[gym]")
        from . import vector
        return getattr(vector, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def _register() -> None:
    """Makes the environments known to gymnasium.make."""
    import gymnasium
    for name in ("Pointing", "Tasking"):
        gymnasium.register(id=f"boresight/{name}-v0", entry_point=f"boresight.gym:{name}Env",
                           vector_entry_point=f"boresight.gym:{name}VectorEnv")


if HAS_GYMNASIUM:
    _register()
