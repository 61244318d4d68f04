"""Compensators in Python inside the process, as C plug-ins have them."""
from __future__ import annotations

import ctypes
from typing import Any, Callable, Dict, List, Tuple

import numpy as np
import numpy.typing as npt

from ._handle import user_code
from ._keys import KeyTable
from ._native import LIBRARY
from ._plugin import Instance, Part, collect, fail, stage_part
from ._structs import (ArchiveFunction, CompensatorInit, CompensatorSet, CompensatorStage,
                       CompensatorStep)
from .errors import ArgumentError

MOST_NUMBERS = 511
"""Numbers that a compensator may remember: BST_COMPENSATOR_STATE_BYTES, less its own number."""
_MOST_VIEWS = 256
State = npt.NDArray[np.float64]


def _numbers_of(function: Any) -> int:
    """Number of numbers that a compensator remembers: its attribute `states`."""
    count = getattr(function, "states", 0)
    if isinstance(count, bool) or not isinstance(count, int) or not 0 <= count <= MOST_NUMBERS:
        raise ArgumentError(f"register: compensator: `states` is the number of numbers that it "
                            f"remembers, 0 to {MOST_NUMBERS} (found {count!r})")
    return count


class _Law(Instance):
    """A compensator for one time step and one set of keys. Its states are the memory of C, one for
    each axis: C copies them."""

    def __init__(self, given: Callable[..., Any], dt_s: float, keys: Dict[str, Any], count: int):
        super().__init__(given, (dt_s,), keys)
        self.count = count
        self.views: Dict[int, State] = {}
        self.step: Callable[[State, float], Any] = self.target.step
        self.set: Any = getattr(self.target, "set", None)

    def view(self, address: int) -> State:
        """The state at an address of C."""
        found = self.views.get(address)
        if found is None:
            if len(self.views) >= _MOST_VIEWS:
                self.views.clear()
            memory: Any = (ctypes.c_double * self.count).from_address(address + 8)
            found = self.views[address] = np.ndarray((self.count,), np.float64, memory)
        return found


class _Laws:
    """The compensators of one registration. They live as long as the process: C has no end for
    them."""

    def __init__(self, function: Callable[..., Any], table: KeyTable):
        self.function, self.table, self.count = function, table, _numbers_of(function)
        self.numbers: Dict[Tuple[Any, ...], int] = {}
        self.made: List[_Law] = []

    def init(self, context: int, config: int, dt_s: float, state: int) -> int:
        """Initialises a state at rest."""
        user_code.depth += 1
        try:
            keys = self.table.values(config)
            name = (dt_s, *keys.values())
            if name not in self.numbers:
                self.made.append(_Law(self.function, dt_s, keys, self.count))
                self.numbers[name] = len(self.made) - 1
            number = self.numbers[name]
            ctypes.memset(state, 0, 8 + 8 * self.count)
            ctypes.c_int64.from_address(state).value = number
            collect(self.made[number])
            return 0
        except BaseException as error:  # pylint: disable=broad-except
            return fail(context, error)
        finally:
            user_code.depth -= 1

    def step(self, state: int, error: float) -> float:
        """Output for an error; not a number, which ends the run, after an exception."""
        law = self.made[ctypes.c_int64.from_address(state).value]
        user_code.depth += 1
        try:
            return float(law.step(law.view(state), error))
        except BaseException as raised:  # pylint: disable=broad-except
            law.raised = raised
            return float("nan")
        finally:
            user_code.depth -= 1

    def set(self, state: int, error: float, output: float) -> None:
        """Bumpless transfer."""
        law = self.made[ctypes.c_int64.from_address(state).value]
        user_code.depth += 1
        try:
            if law.set is not None:
                law.set(law.view(state), error, output)
        except BaseException as raised:  # pylint: disable=broad-except
            law.raised = raised
            if self.count:
                law.view(state)[:] = np.nan  # so that the next output ends the run
        finally:
            user_code.depth -= 1

    def archive(self, state: int, archive: int) -> int:
        """Saves or restores the numbers of a state."""
        if self.count:
            LIBRARY.bst_archive_bytes(archive, state + 8, 8 * self.count)
        return 0


def compensator_part(function: Callable[..., Any], type_name: bytes, table: KeyTable) -> Part:
    """The descriptor of a compensator."""
    if not isinstance(function, type):
        raise ArgumentError("register: compensator takes a class, created with the time step (s), "
                            f"with a method step(state, error), not {type(function).__name__}")
    laws = _Laws(function, table)
    functions = CompensatorStage(8 + 8 * laws.count, CompensatorInit(laws.init),
                                 CompensatorStep(laws.step), CompensatorSet(laws.set), None,
                                 ArchiveFunction(laws.archive))
    part = stage_part("compensator", type_name, table, functions)
    part.kept += (laws,)
    return part
