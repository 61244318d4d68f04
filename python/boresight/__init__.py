"""Boresight: simulator of a space-based telescope that finds and tracks satellites.

>>> import boresight as bst
>>> with bst.Simulation("neossat_geo_track.json") as sim:
...     for frame in sim.frames(until_s=5):
...         print(frame.exposure_id, frame.data.mean())

Names are loaded when they are first used, so that `boresight.link` needs no shared library.
"""
from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any, List

if TYPE_CHECKING:
    from . import config as config
    from . import errors as errors
    from . import messages as messages
    from .camera import Camera as Camera
    from .commands import los_command as los_command
    from .errors import *  # noqa: F401,F403
    from .frame import Frame as Frame
    from .messages import *  # noqa: F401,F403
    from .model import Model as Model
    from .modules import ModuleEnv as ModuleEnv
    from .modules import ModuleStep as ModuleStep
    from .modules import Port as Port
    from .pool import Pool as Pool
    from .record import Message as Message
    from .record import Record as Record
    from .registration import register as register
    from .run_folder import Run as Run
    from .run_folder import read_run as read_run
    from .scenario import Scenario as Scenario
    from .simulation import Sensor as Sensor
    from .simulation import Simulation as Simulation
    from .snapshot import Snapshot as Snapshot
    from .stages import DetectorFrame as DetectorFrame
    from .stages import FrameStageFrame as FrameStageFrame
    from .tables import Table as Table
    from .tools import Study as Study
    from .tools import check as check
    from .tools import lightcurve as lightcurve
    from .tools import loop as loop
    from .tools import new as new
    from .tools import orbit as orbit
    from .tools import pd as pd
    from .tools import report as report
    from .tools import run as run
    from .tools import schema as schema
    from .tools import study as study

    __version__: str

_PLACES = {
    "camera": ["Camera"],
    "commands": ["los_command"],
    "frame": ["Frame"],
    "model": ["Model"],
    "modules": ["ModuleEnv", "ModuleStep", "Port"],
    "pool": ["Pool"],
    "record": ["Message", "Record"],
    "registration": ["register"],
    "run_folder": ["Run", "read_run"],
    "scenario": ["Scenario"],
    "simulation": ["Sensor", "Simulation"],
    "snapshot": ["Snapshot"],
    "stages": ["DetectorFrame", "FrameStageFrame"],
    "tables": ["Table"],
    "tools": ["Study", "check", "lightcurve", "loop", "new", "orbit", "pd", "report", "run",
              "schema", "study"],
}
_MODULES = ("errors", "messages")
_INSIDE = ("config", "link", "gym")


def _names() -> List[str]:
    """Public names of the classes of errors and messages."""
    found = []
    for module in _MODULES:
        inside = importlib.import_module(f".{module}", __name__)
        found += [n for n, v in vars(inside).items() if isinstance(v, type)
                  and v.__module__ == inside.__name__] + (["CHANNELS"] if module == "messages"
                                                          else [])
    return found


def __getattr__(name: str) -> Any:
    if name == "__version__":
        from ._native import LIBRARY
        value: Any = LIBRARY.bst_version().decode()
        globals()[name] = value
        return value
    if name in _INSIDE:
        return importlib.import_module(f".{name}", __name__)
    for module, names in _PLACES.items():
        if name in names:
            value = getattr(importlib.import_module(f".{module}", __name__), name)
            globals()[name] = value
            return value
    if name[:1].isupper() or name in _MODULES:
        for module in _MODULES:
            inside = importlib.import_module(f".{module}", __name__)
            if name == module:
                return inside
            if name in vars(inside) and not isinstance(vars(inside)[name], type(importlib)):
                return vars(inside)[name]
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> List[str]:
    return sorted({*globals(), *_names(), *(n for names in _PLACES.values() for n in names),
                   "__version__"})
