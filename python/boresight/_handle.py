"""The C object of a simulation, guarded: one thread at a time, in the process that made it."""
from __future__ import annotations

import atexit
import contextlib
import importlib
import os
import signal
import threading
from ctypes import c_void_p
from typing import Any, Callable, Iterator, List, Tuple

from ._native import LIBRARY, Context
from ._owned import Owned
from .errors import BusyError, ClosedError, ForkError
from .frame import LentCount
from .model import ModelHandle


try:  # without the look-up in enumerations, which takes longer than all else of a call
    _signals: Any = importlib.import_module("_signal")
except ImportError:
    _signals = signal
_get_handler: Callable[..., Any] = _signals.getsignal
_set_handler: Callable[..., Any] = _signals.signal

_SIGINT = int(signal.SIGINT)
_exiting: List[bool] = []
# at the end of the process its memory goes with it: callbacks into Python would come too late
atexit.register(_exiting.append, True)


def _free(pointer: int, free: Any = LIBRARY.bst_sim_free,
          exiting: List[bool] = _exiting) -> None:
    """Frees a bst_sim, unless the process ends."""
    if not exiting:
        free(pointer)


class SimHandle:
    """A bst_sim; freed when neither a Simulation nor a lent frame refers to it."""

    def __init__(self, pointer: int, model: ModelHandle):
        self.pointer, self.model = c_void_p(pointer), model
        self.owned = Owned(pointer, _free, model.owned)
        self.callbacks: Any = None  # what C may call until the object is freed
        self.plugins: List[Any] = []  # instances of plug-ins in Python


class Guard:
    """Gives the C object to one call at a time.

    Errors:    ClosedError, BusyError (another thread, or the callback of a running call),
               ForkError
    """

    def __init__(self, handle: SimHandle):
        self._handle: "SimHandle | None" = handle
        self._process = os.getpid()
        self._lock = threading.Lock()
        self.context = Context()
        self.lent = LentCount()

    def take(self) -> SimHandle:
        """The C object, for this caller alone until `give_back`."""
        if os.getpid() != self._process:
            raise ForkError("this simulation belongs to the process from which this one was "
                            "forked: create it here, or restore a snapshot of it here")
        if not self._lock.acquire(blocking=False):
            raise BusyError("the simulation is in use: by another thread, or by the call whose "
                            "callback this is; a simulation is for one thread at a time")
        if self._handle is None or not self._handle.owned.live:
            self._lock.release()
            raise ClosedError("the simulation is closed")
        return self._handle

    def give_back(self) -> None:
        """Ends a `take`."""
        self._lock.release()

    @contextlib.contextmanager
    def use(self) -> Iterator[SimHandle]:
        """The C object for one call."""
        handle = self.take()
        try:
            yield handle
        finally:
            self._lock.release()

    def replace(self, handle: SimHandle) -> None:
        """Takes another C object, while `use` is active."""
        self._handle, self.lent = handle, LentCount()

    def close(self) -> None:
        """Frees the C object, or leaves that to the frames that are still referred to."""
        if os.getpid() != self._process:
            return
        if not self._lock.acquire(blocking=False):
            raise BusyError("the simulation is in use: it cannot be closed now")
        try:
            self._handle = None
        finally:
            self._lock.release()

    @property
    def closed(self) -> bool:
        """True after `close`."""
        return self._handle is None


class UserCode(threading.local):
    """Number of calls of plug-ins in Python that are running in this thread."""
    depth = 0


user_code = UserCode()


class Interrupt:
    """Remembers Ctrl-C while C code runs, so that the C code ends cleanly first. Python calls the
    handler of a signal when the C code asks, through a callback, whether to stop. A second Ctrl-C
    ends the plug-in in Python that is running, and the simulation with it."""

    def __init__(self) -> None:
        self._came: List[Tuple[int, Any]] = []
        self._previous: Any = None
        self._active = False

    def __enter__(self) -> "Interrupt":
        self._came.clear()
        self._active = (threading.current_thread() is threading.main_thread()
                        and callable(_get_handler(_SIGINT)))
        if self._active:
            self._previous = _set_handler(_SIGINT, self._note)
        return self

    def _note(self, number: int, frame: Any) -> None:
        self._came.append((number, frame))
        if len(self._came) > 1 and user_code.depth:
            self._previous(number, frame)

    @property
    def came(self) -> bool:
        """True if the signal has come since the C code was called."""
        return bool(self._came)

    def __exit__(self, *_: Any) -> None:
        if self._active:
            self._active = False
            _set_handler(_SIGINT, self._previous)
            if self._came:
                self._previous(*self._came[0])  # raises KeyboardInterrupt unless set otherwise
