"""What environments derive from: the classes of Gymnasium, or, where it is not installed, classes with
as much of them as a program needs that steps environments itself."""
from __future__ import annotations

from typing import TYPE_CHECKING, Any, Dict, Generic, Optional, Sequence, Tuple, TypeVar

import numpy as np
import numpy.typing as npt

ObsType = TypeVar("ObsType")
ActType = TypeVar("ActType")


class PlainEnv(Generic[ObsType, ActType]):
    """The part of gymnasium.Env that environments use."""
    metadata: Dict[str, Any] = {}
    render_mode: Optional[str] = None
    _generator: Optional[np.random.Generator] = None

    @property
    def np_random(self) -> np.random.Generator:
        """Random numbers of the environment."""
        if self._generator is None:
            self._generator = np.random.default_rng()
        return self._generator

    @property
    def unwrapped(self) -> Any:
        """The environment itself."""
        return self

    def reset(self, *, seed: Optional[int] = None,
              options: Optional[Dict[str, Any]] = None) -> Tuple[Any, Dict[str, Any]]:
        """Seeds the random numbers."""
        if seed is not None:
            self._generator = np.random.default_rng(seed)
        return None, {}


class PlainBox:
    """Arrays of a shape with limits."""

    def __init__(self, low: Any, high: Any, shape: Optional[Sequence[int]] = None,
                 dtype: Any = np.float32):
        self.low, self.high, self.dtype = low, high, np.dtype(dtype)
        self.shape = np.shape(low) if shape is None else tuple(shape)

    def sample(self) -> npt.NDArray[Any]:
        """A random array."""
        return np.random.default_rng().uniform(self.low, self.high, self.shape).astype(self.dtype)

    def contains(self, value: Any) -> bool:
        """True for an array of this space."""
        return bool(isinstance(value, np.ndarray) and value.shape == self.shape
                    and value.dtype == self.dtype and np.all(value >= self.low)
                    and np.all(value <= self.high))


class PlainMultiDiscrete:
    """Whole numbers, each from 0 to below one of `nvec`."""

    def __init__(self, nvec: Sequence[int]):
        self.nvec = np.asarray(nvec, np.int64)
        self.shape = self.nvec.shape

    def sample(self) -> npt.NDArray[np.int64]:
        """Random numbers."""
        return np.random.default_rng().integers(0, self.nvec)

    def contains(self, value: Any) -> bool:
        """True for an array of this space."""
        array = np.asarray(value)
        return bool(array.shape == self.shape and array.dtype.kind in "iu"
                    and np.all(array >= 0) and np.all(array < self.nvec))


class PlainDict(Dict[str, Any]):
    """A space for each key."""

    @property
    def spaces(self) -> Dict[str, Any]:
        """The spaces by their keys."""
        return dict(self)

    def sample(self) -> Dict[str, Any]:
        """A random value of each space."""
        return {key: space.sample() for key, space in self.items()}

    def contains(self, value: Any) -> bool:
        """True for a dictionary with values of the spaces."""
        return (isinstance(value, dict) and value.keys() == self.keys()
                and all(space.contains(value[key]) for key, space in self.items()))


class PlainSpaces:
    """The part of gymnasium.spaces that environments use."""
    Box, Dict, MultiDiscrete = PlainBox, PlainDict, PlainMultiDiscrete


if TYPE_CHECKING:
    Env = PlainEnv
    spaces: Any = PlainSpaces
    HAS_GYMNASIUM: bool
else:
    try:
        from gymnasium import Env, spaces
        HAS_GYMNASIUM = True
    except ImportError:
        Env, spaces, HAS_GYMNASIUM = PlainEnv, PlainSpaces, False
