"""Registers plug-ins in Python: detectors, compensators and frame stages, and whole modules."""
from __future__ import annotations

import ctypes
import functools
import hashlib
import inspect
import pathlib
from typing import Any, Callable, Dict, List, Optional, Tuple

from ._keys import KeyTable, defaults_of
from ._native import LIBRARY, Context, text_argument
from ._plugin import Part, check_function
from .compensators import compensator_part
from .errors import ArgumentError
from .roles import ROLES, module_part, ports_of
from .stages import detector_part, frame_stage_part

_STAGES: Dict[str, Callable[..., Part]] = {
    "detector": detector_part, "frame_stage": frame_stage_part, "compensator": compensator_part}
_kept: List[Any] = []  # what C may use until the process ends
registered: Dict[str, Dict[str, Tuple[str, ...]]] = {}
"""Plug-ins of this process by name: kinds of their parts, each with the channels that it reads."""

Function = Optional[Callable[..., Any]]


def register(name: str = "", *, detector: Function = None, frame_stage: Function = None,
             compensator: Function = None, imgproc: Function = None, tracker: Function = None,
             control: Function = None, tasking: Function = None) -> str:
    """Registers functions and classes of Python as a plug-in of this process.

    Given:     name         of the plug-in; "": that of the function
               detector     of image processing: f(DetectorFrame) -> detections: a Detections, a
                            structured array, a mapping of columns or a sequence of records, in
                            full-sensor pixels. Only a Detections has background_e, noise_e and
                            threshold_snr; else they are 0, the read noise and 5
               frame_stage  f(data, FrameStageFrame): changes data in place, or returns new pixels
               compensator  of control or of a mount: a class, created with the time step (s);
                            step(state, error) gives the output, and set(state, error, output), if
                            there is one, makes that the next output for this error. `states` is
                            the number of numbers in the array `state`: all that it remembers
               imgproc, tracker, control, tasking
                            a whole module: f(ModuleStep) reads the channels of its sensor and
                            assigns or returns messages. Attributes `rate_hz` and `ports` replace
                            the rate and the ports of the role
    Returned:  the plug-in's name for scenarios: Scenario.with_plugin(tracker=name)
    Errors:    ArgumentError
    Notes:     a class is created for each simulation: of a stage with the Camera, of a module with
               a ModuleEnv. It is called as the function would be, and its attributes are saved with
               the simulation. An object that can be called is copied for each simulation.
               Keyword-only parameters with defaults are keys that scenarios set beside "plugin".
               Results must depend on the arguments alone, so that runs repeat. The call may come in
               any thread.

    >>> mine = register(tracker=MyTracker)
    >>> sim = Simulation(scenario.with_plugin(tracker=mine, gate_px=4.0))
    """
    given = {"detector": detector, "frame_stage": frame_stage, "compensator": compensator,
             "imgproc": imgproc, "tracker": tracker, "control": control, "tasking": tasking}
    functions = {kind: f for kind, f in given.items() if f is not None}
    if not functions:
        raise ArgumentError(f"register: give one of {', '.join(given)}")
    for kind, function in functions.items():
        check_function(kind, function)
    text = text_argument(name, "name")
    first: Any = next(iter(functions.values()))
    own = getattr(first, "__name__", type(first).__name__)
    short = (text or own.encode("ascii", "replace").replace(b"?", b"_")).strip(b"<>")
    full = short if b":" in short else b"python:" + short
    parts = [_part(kind, function, short) for kind, function in functions.items()]
    modules, stages = (_list([p for p in parts if (p.kind in ROLES) == whole])
                       for whole in (True, False))
    context = Context()
    context.check(LIBRARY.bst_plugin_register(context.pointer, full, _digest(functions), modules,
                                              stages))
    _kept.append((parts, modules, stages))
    registered[full.decode()] = {
        kind: tuple(p.channel for p in ports_of(kind, f) if not p.output) if kind in ROLES else ()
        for kind, f in functions.items()}
    return full.decode()


def _digest(functions: Dict[str, Callable[..., Any]]) -> Optional[bytes]:
    """SHA-256 of the sources of functions, of the whole files where there are files; None: there is
    a function without a source."""
    total = hashlib.sha256()
    for function in functions.values():
        source: Any = function
        if isinstance(source, functools.partial):
            source = source.func
        if not inspect.isroutine(source) and not isinstance(source, type):
            source = type(source)
        try:
            path = pathlib.Path(inspect.getsourcefile(source) or "")
            total.update(path.read_bytes() if path.is_file() else
                         inspect.getsource(source).encode())
        except (OSError, TypeError):
            return None
    return total.hexdigest().encode()


def _part(kind: str, function: Callable[..., Any], type_name: bytes) -> Part:
    table = KeyTable(defaults_of(function, f"register: {kind}"))
    if kind in ROLES:
        return module_part(kind, function, type_name, table)
    return _STAGES[kind](function, type_name, table)


def _list(parts: List[Part]) -> Any:
    """Addresses of descriptors, ending with NULL; None without any."""
    if not parts:
        return None
    return (ctypes.c_void_p * (len(parts) + 1))(*[ctypes.addressof(p.desc) for p in parts], None)
