"""Copies of C messages as Python messages."""
from __future__ import annotations

import ctypes
from typing import Any, Optional, Type

import numpy as np
import numpy.typing as npt

from ._structs import SimMessage
from .messages import CHANNELS, LosHistory, PointingTelemetry
from .record import Message

_RINGS = (LosHistory, PointingTelemetry)


def copied(address: int, dtype: "np.dtype[np.void]", count: int) -> npt.NDArray[np.void]:
    """A copy of `count` values at an address."""
    return np.frombuffer(ctypes.string_at(address, count * dtype.itemsize), dtype, count)


def message_at(channel: str, payload: int, scope: str, tick: int, sequence: int) -> Message:
    """A copy of the message at an address."""
    kind = CHANNELS[channel]
    header = copied(payload, kind.dtype, 1).reshape(())
    items = _items(kind, header, payload + kind.dtype.itemsize)
    return kind.received(header, items, scope, tick, sequence)


def _items(kind: Type[Message], header: npt.NDArray[np.void], address: int) -> Any:
    dtype = kind.item_dtype
    if dtype is None:
        return np.zeros(0, np.dtype([]))
    if kind not in _RINGS:
        return copied(address, dtype, int(header["count"]))
    # a ring: sample n is at n modulo capacity; oldest first
    written, capacity = int(header["written"]), int(header["capacity"])
    if written <= capacity:
        return copied(address, dtype, written)
    end, size = written % capacity, dtype.itemsize
    return np.frombuffer(ctypes.string_at(address + end * size, (capacity - end) * size)
                         + ctypes.string_at(address, end * size), dtype, capacity)


def viewed(channel: str, view: SimMessage, scope: str) -> Optional[Message]:
    """A copy of a message that bst_sim_view has lent; None if there is none."""
    if not view.payload:
        return None
    return message_at(channel, view.payload, scope, view.written_tick, view.sequence)
