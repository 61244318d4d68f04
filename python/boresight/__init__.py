"""Boresight: simulator of a space-based telescope that finds and tracks satellites.

>>> import boresight as bst
>>> with bst.Simulation("neossat_geo_track.json") as sim:
...     for frame in sim.frames(until_s=5):
...         print(frame.exposure_id, frame.data.mean())
"""
from __future__ import annotations

from ._native import version as _version
from .commands import los_command
from .errors import (ArgumentError, BoresightError, BusyError, ClosedError, DeviceError, FileError,
                     ForkError, FormatError, InterruptError, NotFoundError, NumericError,
                     OutOfMemoryError, OutOfRangeError, ProgramError, ScenarioError, StateError)
from .frame import Frame
from .messages import *  # noqa: F401,F403  (classes of all messages, and enums)
from .messages import CHANNELS
from .model import Model
from .record import Message, Record
from .scenario import Scenario
from .simulation import Sensor, Simulation
from .snapshot import Snapshot

__version__ = _version().split(" ", maxsplit=1)[0]
