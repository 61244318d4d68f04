"""Callbacks of a simulation: exceptions in them end the call that steps, and are raised by it."""
from __future__ import annotations

from ctypes import byref
from typing import Any, Callable, Optional, Set

from . import _structs
from ._handle import Guard, Interrupt, SimHandle
from ._native import LIBRARY
from .messages import CHANNELS
from .payload import message_at
from .record import Message

_STATE_ERROR = 10  # BST_ERR_STATE: what a callback returns after an exception


class Observers:
    """The bst_sim_observer of a simulation. It lives as long as its Guard is used."""

    def __init__(self, guard: Guard):
        self._context = guard.context
        self._message: Optional[Callable[[Message], Any]] = None
        self._event: Optional[Callable[[int, str, str, str], Any]] = None
        self._channels: Optional[Set[str]] = None
        self._raised: Optional[BaseException] = None
        self.interrupt = Interrupt()
        self._on_message = _structs.MessageFunction(self._received)
        self._on_event = _structs.EventFunction(self._happened)
        self._on_interrupted = _structs.InterruptedFunction(self._asked)

    def set(self, sim: SimHandle, message: Optional[Callable[[Message], Any]],
            event: Optional[Callable[[int, str, str, str], Any]],
            channels: Optional[Set[str]]) -> None:
        """Sets the functions of the user."""
        self._message, self._event, self._channels = message, event, channels
        self.install(sim)

    def install(self, sim: SimHandle) -> None:
        """Gives the callbacks that are needed to the C object."""
        observer = _structs.SimObserver()
        if self._message:
            observer.message = self._on_message
        if self._event:
            observer.event = self._on_event
        observer.interrupted = self._on_interrupted
        LIBRARY.bst_sim_observe(sim.pointer, byref(observer))
        sim.callbacks = (self._on_message, self._on_event, self._on_interrupted)

    def finish(self, status: int) -> None:
        """Raises what a callback raised in the call before, or the error of the call."""
        raised, self._raised = self._raised, None
        if raised is not None:
            raise raised
        self._context.check(status)

    def _received(self, _user: Any, scope: bytes, channel: bytes, payload: int, tick: int) -> int:
        try:
            name = channel.decode()
            if self._message and name in CHANNELS and (self._channels is None
                                                       or name in self._channels):
                self._message(message_at(name, payload, scope.decode(), tick, -1))
            return 0
        except BaseException as error:  # pylint: disable=broad-except
            self._raised = error
            return _STATE_ERROR

    def _happened(self, _user: Any, tick: int, instance: bytes, kind: bytes, text: bytes) -> int:
        try:
            if self._event:
                self._event(tick, instance.decode(), kind.decode(), text.decode("utf-8", "replace"))
            return 0
        except BaseException as error:  # pylint: disable=broad-except
            self._raised = error
            return _STATE_ERROR

    def _asked(self, _user: Any, _tick: int) -> bool:
        return self.interrupt.came
