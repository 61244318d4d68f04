"""Commands to external modules, of what programs have: arrays, columns, directions."""
from __future__ import annotations

import math
from typing import Any, Dict, Mapping, Optional, Type

import numpy as np
import numpy.typing as npt

from .errors import ArgumentError
from .messages import (CHANNELS, ControlStatus, Detections, LosCommand, LosSample,
                       PointingTelemetry, Predictions, SensorCommand, Tracks)
from .record import Message

COMMANDS: Dict[str, Type[Message]] = {
    "detections": Detections, "tracks": Tracks, "predictions": Predictions,
    "los_command": LosCommand, "sensor_command": SensorCommand, "control_status": ControlStatus}
"""Channels that a program can write in place of a module."""


_ZERO = np.zeros(3)


def command_message(channel: str, value: Any,
                    allowed: Optional[Mapping[str, Type[Message]]] = None) -> Message:
    """The message of a command: the message itself, or its items or members.

    Given:     allowed  class of the messages of each channel; None: COMMANDS
    Errors:    ArgumentError: the value is nothing of that channel
    """
    kinds = COMMANDS if allowed is None else allowed
    kind = kinds.get(channel)
    if kind is None:
        raise ArgumentError(f"{channel!r} cannot be commanded (allowed: {', '.join(kinds)})"
                            if channel in CHANNELS or isinstance(channel, str) else
                            f"a channel is a text, not {type(channel).__name__}")
    if isinstance(value, Message):
        if not isinstance(value, kind):
            raise ArgumentError(f"{channel} takes {kind.__name__}, not {type(value).__name__}")
        return value
    if kind is LosCommand and isinstance(value, (np.ndarray, list, tuple)):
        return los_command(value)
    if kind.item_dtype is None:
        if not isinstance(value, dict) or not all(isinstance(k, str) for k in value):
            raise ArgumentError(f"{channel} takes {kind.__name__} or a dictionary of its members, "
                                f"not {type(value).__name__}")
        return kind(**value)
    return kind(value)


def los_command(direction_gcrf: Any, rate_gcrf_radps: Any = (0.0, 0.0, 0.0),
                accel_gcrf_radps2: Any = (0.0, 0.0, 0.0), tick: int = 0) -> LosCommand:
    """A command of the boresight: an apparent direction in GCRF, which is normalised, at a tick,
    with its rate (rad/s) and acceleration (rad/s2)."""
    direction = vector(direction_gcrf, "direction_gcrf")
    length = math.sqrt(float(np.dot(direction, direction)))
    if not math.isfinite(length) or length == 0.0:
        raise ArgumentError(f"direction_gcrf: {direction} has no direction")
    return LosCommand(tick=tick, direction_gcrf=direction / length,
                      rate_gcrf_radps=vector(rate_gcrf_radps, "rate_gcrf_radps"),
                      accel_gcrf_radps2=vector(accel_gcrf_radps2, "accel_gcrf_radps2"))


def _numbers(value: Any, what: str, count: int, word: str) -> npt.NDArray[np.float64]:
    """`count` numbers; `word` is the count for the message."""
    try:
        array = np.asarray(value, np.float64)
    except (TypeError, ValueError):
        raise ArgumentError(f"{what} takes {word} numbers, not {type(value).__name__}") from None
    if array.shape != (count,):
        raise ArgumentError(f"{what} takes {word} numbers, found shape {array.shape}")
    return array


def vector(value: Any, what: str) -> npt.NDArray[np.float64]:
    """Three numbers."""
    if isinstance(value, tuple) and value == (0.0, 0.0, 0.0):
        return _ZERO
    return _numbers(value, what, 3, "three")


def quaternion(value: Any, what: str) -> npt.NDArray[np.float64]:
    """Four numbers: x, y, z, w."""
    return _numbers(value, what, 4, "four")


def pointing_samples(ticks: Any, q_cam_from_gcrf: Any) -> npt.NDArray[np.void]:
    """Samples of the line of sight: ticks [n], and attitudes [n, 4] (x, y, z, w)."""
    try:
        t, q = np.atleast_1d(np.asarray(ticks)), np.asarray(q_cam_from_gcrf, np.float64)
    except (TypeError, ValueError):
        raise ArgumentError("pointing takes whole numbers and quaternions") from None
    if t.ndim != 1 or t.dtype.kind not in "iu" or (q.shape != (4,) and q.shape != (len(t), 4)):
        raise ArgumentError(f"pointing takes ticks [n] (whole numbers) and quaternions [n, 4], found "
                            f"{t.dtype} {t.shape} and {q.shape}")
    if len(t) > 65536:
        raise ArgumentError(f"pointing: {len(t)} samples (allowed: 1 to 65536)")
    samples = np.zeros(len(t), LosSample.dtype)
    samples["tick"], samples["q_cam_from_gcrf"] = t, q
    return samples


def complete_detections(message: Detections, frame: Optional[Message],
                        telemetry: Optional[PointingTelemetry]) -> Detections:
    """Detections of the newest frame: exposure, times and attitude of it where none are given, and
    a covariance of 0.01 px^2 where both variances are 0."""
    changed: Dict[str, Any] = {}
    if frame is not None and message.end_tick == 0 and message.exposure_id == 0:
        for name in ("exposure_id", "start_tick", "end_tick"):
            changed[name] = int(frame.array[name])
        if telemetry is not None and not message.q_cam_from_gcrf.any():
            middle = (changed["start_tick"] + changed["end_tick"]) / 2
            changed["q_cam_from_gcrf"] = attitude_at(telemetry, middle)
            changed["q_telemetry_from_gcrf"] = changed["q_cam_from_gcrf"]
    items = message.items
    unknown = (items["cov_xx"] == 0) & (items["cov_yy"] == 0)
    if unknown.any():
        items = items.copy()
        items["cov_xx"][unknown] = items["cov_yy"][unknown] = 0.01
    return message.replace(items, **changed)


def attitude_at(telemetry: PointingTelemetry, tick: float) -> npt.NDArray[np.float64]:
    """Measured attitude (x, y, z, w) at a tick, interpolated linearly between samples and held
    outside of them; zeros without samples."""
    ticks, q = telemetry.items["tick"], telemetry.items["q_cam_from_gcrf"]
    if not len(ticks):
        return np.zeros(4)
    k = int(np.clip(np.searchsorted(ticks, tick), 1, max(len(ticks) - 1, 1)))
    a, b = q[k - 1], q[min(k, len(q) - 1)]
    span = float(ticks[min(k, len(q) - 1)] - ticks[k - 1])
    t = min(max((tick - float(ticks[k - 1])) / span, 0.0), 1.0) if span > 0 else 0.0
    mixed = (1.0 - t) * a + t * (b if float(np.dot(a, b)) >= 0 else -b)
    return np.asarray(mixed / np.linalg.norm(mixed), np.float64)
