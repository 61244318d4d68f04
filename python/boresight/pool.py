"""Pool: several simulations at the same time, in threads of C code without Python's lock."""
from __future__ import annotations

import contextlib
import os
import threading
from ctypes import byref, c_void_p
from typing import Any, Iterator, List, NamedTuple, Optional, Sequence

import numpy as np
import numpy.typing as npt

from . import _structs
from ._handle import Interrupt, SimHandle
from ._native import LIBRARY, Context, integer_argument, number_argument, text_argument
from ._owned import Owned
from .commands import COMMANDS
from .errors import ArgumentError, BusyError, ClosedError, ForkError
from .messages import CHANNELS
from .simulation import Simulation


class Columns(NamedTuple):
    """Newest messages of a channel of n simulations: `headers` [n] and `items` [n, m] as structured
    arrays, of which `counts` [n] items are in use; `ticks` [n] when they were published (-1: none
    yet)."""

    headers: npt.NDArray[np.void]
    items: npt.NDArray[np.void]
    counts: npt.NDArray[np.int32]
    ticks: npt.NDArray[np.int64]


class Pool:
    """A pool of threads that steps several simulations at the same time.

    Given:     threads  0: one for each processor
    Notes:     a pool holds simulations for one block at a time (BusyError).

    >>> with Pool().hold([Simulation(model, run=n) for n in range(64)]) as held:
    ...     held.step("detections")
    ...     found = held.view("detections")
    """

    def __init__(self, threads: int = 0):
        number = integer_argument(threads, "threads", 0, 1024)
        self._context, pointer = Context(), c_void_p()
        self._context.check(LIBRARY.bst_sim_pool_create(self._context.pointer, number,
                                                        byref(pointer)))
        assert pointer.value
        self._pointer, self._owned = pointer, Owned(pointer.value, LIBRARY.bst_sim_pool_free)
        self._process, self._lock = os.getpid(), threading.Lock()

    @contextlib.contextmanager
    def hold(self, simulations: Sequence[Optional[Simulation]]) -> Iterator["Held"]:
        """The simulations for the calls of one block; None: left out.

        Errors:    ClosedError, BusyError, also for a simulation that is given twice; ForkError
        """
        if os.getpid() != self._process:
            raise ForkError("this pool belongs to the process from which this one was forked: "
                            "create it here")
        for simulation in simulations:
            if simulation is not None and not isinstance(simulation, Simulation):
                raise ArgumentError(f"hold takes simulations, not {type(simulation).__name__}")
        if not self._owned.live:
            raise ClosedError("the garbage collector has freed this pool")
        if not self._lock.acquire(blocking=False):
            raise BusyError("the pool is in use: one block at a time")
        guards = [s._guard for s in simulations if s is not None]
        taken: List[SimHandle] = []
        held = None
        try:
            for guard in guards:
                taken.append(guard.take())
            held = Held(self._context, self._pointer, simulations, taken,
                        Owned(0, _nothing, self._owned, *(h.owned for h in taken)))
            yield held
        finally:
            if held is not None:
                held._end()
            for guard, _ in zip(guards, taken):
                guard.give_back()
            self._lock.release()


def _nothing(_address: int) -> None:
    """Frees a use that has no C object of its own."""


class Held:
    """Simulations that a Pool holds for a block. A call is for all of them, or for those `where` an
    array [n] is true.

    Errors:    ClosedError: the block has ended; BusyError: called from a callback or another thread
    """

    def __init__(self, context: Context, pool: c_void_p,
                 simulations: Sequence[Optional[Simulation]], handles: List[SimHandle],
                 uses: Owned):
        self._context, self._pool, self._uses = context, pool, uses
        self._held, self._handles = [s for s in simulations if s is not None], handles
        self._count = len(simulations)
        self._lock, self._open = threading.Lock(), True
        numbers = iter(h.pointer.value for h in handles)
        self._pointers = np.array([0 if s is None else next(numbers) for s in simulations],
                                  np.uintp)

    def _end(self) -> None:
        """Ends the block; waits for a call that another thread has begun."""
        with self._lock:
            self._open = False

    @contextlib.contextmanager
    def _alone(self) -> Iterator[None]:
        """One call at a time, while the block lasts."""
        if not self._lock.acquire(blocking=False):
            raise BusyError("the simulations are in use: by another thread, or by the call whose "
                            "callback this is")
        try:
            if not self._open or not self._uses.live:
                raise ClosedError("the block in which the pool held these simulations has ended")
            yield
        finally:
            self._lock.release()

    def _chosen(self, where: Any) -> npt.NDArray[np.uintp]:
        """Pointers of the simulations of a call."""
        if where is None:
            return self._pointers
        mask = np.asarray(where, bool)
        if mask.shape != (self._count,):
            raise ArgumentError(f"where: {self._count} flags, found shape {mask.shape}")
        return np.where(mask, self._pointers, np.uintp(0))

    def ticks(self) -> npt.NDArray[np.int64]:
        """[n] ticks that the simulations have reached; 0 for those that are left out."""
        with self._alone():
            return np.array([LIBRARY.bst_sim_tick(int(p)) if p else 0 for p in self._pointers],
                            np.int64)

    def step(self, channel: Optional[str], messages: Any = None, until_s: float = 1e9,
             where: Any = None) -> npt.NDArray[np.int32]:
        """Steps all, each until messages of a channel are published, or until a time.

        Given:     channel   of any sensor; None: all go to the time
                   messages  [n] number of messages; None: 1 each
                   until_s   seconds since the scenario's epoch
        Returned:  [n] number of messages that came
        Errors:    those of Simulation.step, of the first simulation that failed; the others are
                   stepped all the same
        """
        name, until = text_argument(channel, "channel", True), number_argument(until_s, "until_s")
        arrived = np.zeros(self._count, np.int32)
        wanted = None if messages is None else np.ascontiguousarray(messages, np.int32)
        if wanted is not None and wanted.shape != (self._count,):
            raise ArgumentError(f"messages: {self._count} numbers, found shape {wanted.shape}")
        pointers = self._chosen(where)
        with self._alone(), self._interrupt():
            status = LIBRARY.bst_sim_pool_step(
                self._context.pointer, self._pool, pointers.ctypes.data, self._count, name,
                wanted.ctypes.data if wanted is not None else None, until, arrived.ctypes.data)
        if status:
            self._raise(status)
        return arrived

    @contextlib.contextmanager
    def _interrupt(self) -> Iterator[None]:
        """Ctrl-C ends the steps of all simulations."""
        one, observers = Interrupt(), [s._observers for s in self._held]
        own = [o.interrupt for o in observers]
        for each in observers:
            each.interrupt = one
        try:
            with one:
                yield
        finally:
            for each, before in zip(observers, own):
                each.interrupt = before

    def _raise(self, status: int) -> None:
        """Raises what a callback or stage of a simulation has raised, or the error of the call."""
        error = self._context.error(status)
        for simulation, handle in zip(self._held, self._handles):
            simulation._raise_pending(handle)
        raise error

    def view(self, channel: str, scope: Optional[str] = None, items: int = 0,
             into: Optional[Columns] = None, where: Any = None) -> Columns:
        """Copies of the newest messages of a channel.

        Given:     scope  "observer/sensor"; None: the first sensor that has the channel
                   items  at most so many of each: the first, of rings the newest (oldest first)
                   into   of an earlier call for the same channel: its arrays are filled again, and
                          those of simulations that are left out stay as they are
        Returned:  zeros for simulations that are left out
        """
        name, of = text_argument(channel, "channel"), text_argument(scope, "scope", True)
        if channel not in CHANNELS:
            raise ArgumentError(f"there is no channel {channel!r} (allowed: {', '.join(CHANNELS)})")
        kind = CHANNELS[channel]
        most = integer_argument(items, "items", 0, 2**20)
        most = most if kind.item_dtype else 0
        out = into or Columns(np.zeros(self._count, kind.dtype),
                              np.zeros((self._count, most), kind.item_dtype or np.dtype([])),
                              np.zeros(self._count, np.int32), np.full(self._count, -1, np.int64))
        most = _checked(out, channel, self._count)
        columns = _structs.SimColumns(out.headers.ctypes.data,
                                      out.items.ctypes.data if most else None, most,
                                      out.counts.ctypes.data, out.ticks.ctypes.data)
        pointers = self._chosen(where)
        with self._alone():
            self._context.check(LIBRARY.bst_sim_pool_view(
                self._context.pointer, pointers.ctypes.data, self._count, of, name,
                byref(columns)))
        return out

    def command(self, channel: str, values: npt.NDArray[np.void], scope: Optional[str] = None,
                where: Any = None) -> None:
        """Gives the external module of each simulation its next output.

        Given:     channel  one whose messages have no items, such as "los_command"
                   values   [n] structured array of the message's dtype
        Errors:    as Simulation.command, of the first simulation that refuses
        """
        kind, of = COMMANDS.get(channel), text_argument(scope, "scope", optional=True)
        if kind is None or kind.item_dtype is not None:
            raise ArgumentError(f"{channel!r} cannot be commanded to several simulations at once")
        data = np.ascontiguousarray(values)
        if data.dtype != kind.dtype or data.shape != (self._count,):
            raise ArgumentError(f"{channel} takes {self._count} values of {kind.__name__}.dtype")
        pointers = self._chosen(where)
        with self._alone():
            self._context.check(LIBRARY.bst_sim_pool_command(
                self._context.pointer, pointers.ctypes.data, self._count, of, channel.encode(),
                data.ctypes.data))


def _checked(columns: Any, channel: str, count: int) -> int:
    """Items of each message that columns have room for.

    Errors:    ArgumentError: memory of another shape or type than the C code fills
    """
    kind = CHANNELS[channel]
    fits = isinstance(columns, Columns) and all(
        isinstance(array, np.ndarray) and array.flags.c_contiguous and array.flags.writeable
        and array.dtype == dtype and array.shape[:1] == (count,) and array.ndim == dimensions
        for array, dtype, dimensions in zip(
            columns, (kind.dtype, kind.item_dtype or np.dtype([]), np.dtype(np.int32),
                      np.dtype(np.int64)), (1, 2, 1, 1)))
    if not fits:
        raise ArgumentError(f"into takes the columns of an earlier view of {channel!r}")
    return int(columns.items.shape[1])


__all__ = ["Columns", "Held", "Pool"]
