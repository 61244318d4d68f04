"""Stages in Python inside the process: detectors and frame stages, as C plug-ins have them.

A function is a stage without a state. A class is created once for each simulation, with the
camera; if it has `get_state() -> bytes` and `set_state(bytes)`, its simulation can be saved.
"""
from __future__ import annotations

import contextlib
import ctypes
import sys
import threading
import weakref
from typing import Any, Callable, Dict, Iterator, List, NamedTuple, Optional

import numpy as np
import numpy.typing as npt

from ._native import LIBRARY, Context, text_argument
from ._structs import (STAGE_ABI, ApplyFunction, ArchiveFunction, DestroyFunction, DetectFunction,
                       DetectorCreate, DetectorStage, FrameStage, FrameStageCreate, StageDesc)
from .camera import Camera, camera_of
from .errors import ArgumentError, StateError
from .messages import Detection, Detections, Window
from .record import structured

_STATE_ERROR = 10  # BST_ERR_STATE
_MOST_STATE = 1 << 30  # bytes of a stage's state
# what a detector finds; imgproc fills in the other members
_FOUND = ("x_px", "y_px", "cov_xx", "cov_xy", "cov_yy", "flux_e", "flux_sigma_e", "snr",
          "length_px", "width_px", "angle_rad", "flags", "label")
_ARTEFACT = 3  # BST_LABEL_ARTEFACT


class DetectorFrame(NamedTuple):
    """A frame for a detector. `data` is the memory of the renderer, valid during the call."""
    data: npt.NDArray[np.uint16]
    exposure_id: int
    window: Window
    binning: int
    bits: int
    exposure_s: float
    camera: Camera
    electrons_per_s_v0: float


class FrameStageFrame(NamedTuple):
    """The frame whose pixels a frame stage changes."""
    exposure_id: int
    start_s: float
    end_s: float
    window: Window
    binning: int
    bits: int
    camera: Camera
    instance: str
    seed: int
    run: int


class _Pixels:
    """Memory of a frame for the time of a call."""

    def __init__(self, pointer: int, height: int, width: int, readonly: bool):
        self.keeper: Any = None
        self.__array_interface__ = {"shape": (height, width), "typestr": "<u2",
                                    "data": (pointer, readonly), "version": 3}


class Stage:
    """A stage of one simulation. `raised`: the exception that ended a call."""

    def __init__(self, function: Callable[..., Any], env: Dict[str, Any]):
        self.env = env
        is_class = isinstance(function, type)
        self.function: Callable[..., Any] = function(env["camera"]) if is_class else function
        self.saved = not is_class or (hasattr(self.function, "get_state")
                                      and hasattr(self.function, "set_state"))
        self.has_state = is_class
        self.raised: Optional[BaseException] = None
        self.owner: Callable[[], Any] = lambda: None  # the simulation's handle

    def call(self, context: int, work: Callable[[], None]) -> int:
        """A status for C: an exception becomes its message, and is raised by the call that steps.
        """
        try:
            work()
            return 0
        except BaseException as error:  # pylint: disable=broad-except
            self.raised = error
            text = f"{type(error).__name__}: {error}".encode("utf-8", "replace")
            return int(LIBRARY.bst_fail(context, _STATE_ERROR, b"%s", text.replace(b"\0", b"?")))

    def check_released(self, pixels: _Pixels, references: int) -> None:
        """Pixels are valid during the call only: what keeps them keeps the simulation's memory."""
        if references > 2:  # the caller's and that of the count
            pixels.keeper = self.owner()
            raise StateError("the function keeps an array of its frame, whose memory is valid "
                             "during the call only: keep a copy (data.copy())")


_stages: Dict[int, Stage] = {}
_lock = threading.Lock()
_counter = iter(range(1, 2**62))
_local = threading.local()
_kept: List[Any] = []  # descriptors and callbacks, which C may use until the process ends


@contextlib.contextmanager
def collected() -> Iterator[List[Stage]]:
    """The stages that C creates in this thread meanwhile."""
    before, _local.created = getattr(_local, "created", None), []
    try:
        yield _local.created
    finally:
        _local.created = before


def own(stages: List[Stage], handle: Any) -> None:
    """Makes stages those of a simulation's handle."""
    for stage in stages:
        stage.owner = weakref.ref(handle)
    handle.stages += stages


def raise_of(handle: Any) -> None:
    """Raises the exception that a stage of a simulation has met."""
    for stage in handle.stages:
        if stage.raised is not None:
            raised, stage.raised = stage.raised, None
            raise raised


def _create(function: Callable[..., Any], context: int, env: Dict[str, Any], out: Any) -> int:
    try:
        stage = Stage(function, env)
    except BaseException as error:  # pylint: disable=broad-except
        text = f"{type(error).__name__}: {error}".encode("utf-8", "replace")
        return int(LIBRARY.bst_fail(context, _STATE_ERROR, b"%s", text.replace(b"\0", b"?")))
    with _lock:
        key = next(_counter)
        _stages[key] = stage
    created = getattr(_local, "created", None)
    if created is not None:
        created.append(stage)
    out[0] = key
    return 0


def _destroy(key: Optional[int]) -> None:
    with _lock:
        _stages.pop(key or 0, None)


def _archive(key: int, archive: int) -> int:
    stage, context = _stages[key], LIBRARY.bst_archive_ctx(archive)

    def work() -> None:
        if not stage.saved:
            raise StateError(f"{type(stage.function).__name__} has no get_state and set_state, so "
                             "that a simulation with it cannot be saved")
        if not stage.has_state:
            return
        restoring = LIBRARY.bst_archive_is_restoring(archive)
        state = b"" if restoring else bytes(stage.function.get_state())  # type: ignore[attr-defined]
        count = LIBRARY.bst_archive_count(archive, len(state), _MOST_STATE)
        buffer = ctypes.create_string_buffer(state, max(count, 1))
        LIBRARY.bst_archive_bytes(archive, buffer, count)
        if restoring:
            stage.function.set_state(buffer.raw[:count])  # type: ignore[attr-defined]
    return stage.call(context, work)


def _window(struct: Any) -> Window:
    return Window(x0=struct.x0, y0=struct.y0, width=struct.width, height=struct.height)


def _detector_functions(function: Callable[..., Any]) -> DetectorStage:
    def create(context: int, _config: int, env: Any, out: Any) -> int:
        given = env[0]
        return _create(function, context, {
            "camera": camera_of(given.camera[0]), "capacity": given.capacity,
            "electrons_per_s_v0": given.electrons_per_s_v0}, out)

    def detect(key: int, context: int, given: Any, out: int) -> int:
        stage = _stages[key]
        return stage.call(context, lambda: _detect(stage, given[0], out))

    return DetectorStage(DetectorCreate(create), DetectFunction(detect), DestroyFunction(_destroy),
                         ArchiveFunction(_archive))


def _detect(stage: Stage, given: Any, out: int) -> None:
    """Calls a detector and stores what it found."""
    window = _window(given.window)
    pixels = _Pixels(given.pixels, window.height // given.binning, window.width // given.binning,
                     True)
    frame = DetectorFrame(np.asarray(pixels), given.exposure_id, window, given.binning, given.bits,
                          given.exposure_s, stage.env["camera"], stage.env["electrons_per_s_v0"])
    found = stage.function(frame)
    if not isinstance(found, Detections):
        found = Detections(structured(found, Detection.dtype, "detections"),
                           noise_e=max(stage.env["camera"].read_noise_e, 1.0), threshold_snr=5.0)
    del frame
    references = sys.getrefcount(pixels)
    stage.check_released(pixels, references)
    _store(found, stage.env["capacity"], out)


def _store(found: Detections, capacity: int, out: int) -> None:
    """Writes detections into a bst_detections."""
    items = np.zeros(min(len(found.items), capacity), Detection.dtype)
    for name in _FOUND:
        items[name] = found.items[name][:len(items)]
        if not np.all(np.isfinite(items[name])):
            raise ArgumentError(f"a detection's {name} is not finite")
    items["label"] = np.where(items["label"] == _ARTEFACT, _ARTEFACT, 0)
    unknown = (items["cov_xx"] == 0) & (items["cov_yy"] == 0)
    items["cov_xx"][unknown] = items["cov_yy"][unknown] = 0.01
    header = _memory(out, Detections.dtype, 1)
    for name in ("background_e", "noise_e", "threshold_snr"):
        header[name] = found.array[name]
    header["count"], header["lost"] = len(items), len(found.items) - len(items)
    _memory(out + Detections.dtype.itemsize, Detection.dtype, len(items))[:] = items


def _memory(address: int, dtype: "np.dtype[np.void]", count: int) -> npt.NDArray[np.void]:
    """Memory of C as a structured array."""
    if not count:
        return np.zeros(0, dtype)
    buffer: Any = (ctypes.c_char * (count * dtype.itemsize)).from_address(address)
    array: npt.NDArray[np.void] = np.ndarray((count,), dtype, buffer)
    return array


def _frame_stage_functions(function: Callable[..., Any]) -> FrameStage:
    def create(context: int, _config: int, env: Any, out: Any) -> int:
        given = env[0]
        return _create(function, context, {
            "camera": camera_of(given.camera[0]), "instance": given.instance.decode(),
            "seed": given.seed, "run": given.run}, out)

    def apply(key: int, context: int, given: Any, pixels: int) -> int:
        stage = _stages[key]
        return stage.call(context, lambda: _apply(stage, given[0], pixels))

    return FrameStage(FrameStageCreate(create), ApplyFunction(apply), DestroyFunction(_destroy),
                      ArchiveFunction(_archive))


def _apply(stage: Stage, given: Any, pointer: int) -> None:
    """Lets a frame stage change pixels in place."""
    pixels = _Pixels(pointer, given.height, given.width, False)
    env = stage.env
    data, most = np.asarray(pixels), (1 << given.bits) - 1
    changed = stage.function(data, FrameStageFrame(
        given.exposure_id, given.start_s, given.end_s, _window(given.window), given.binning,
        given.bits, env["camera"], env["instance"], env["seed"], env["run"]))
    if changed is not None and changed is not data:
        new = np.asarray(changed)
        if new.shape != data.shape or new.dtype.kind not in "iu":
            raise ArgumentError(f"a frame stage gives whole numbers of shape {data.shape}, found "
                                f"{new.dtype} {new.shape}")
        data[:] = np.clip(new, 0, most)
        del new
    if data.size and int(data.max()) > most:
        raise ArgumentError(f"a pixel of {int(data.max())} DN (allowed: 0 to {most})")
    del data, changed
    references = sys.getrefcount(pixels)
    stage.check_released(pixels, references)


def register(name: str = "", *, detector: Optional[Callable[..., Any]] = None,
             frame_stage: Optional[Callable[..., Any]] = None) -> str:
    """Registers stages in Python as an in-process plug-in.

    Given:     name         of the plug-in; "": that of the function
               detector     f(DetectorFrame) -> detections: a Detections, a structured array, a
                            mapping of columns or a sequence of records, in full-sensor pixels. Only
                            a Detections has background_e, noise_e and threshold_snr; else they
                            are 0, the read noise and 5. Or a class, created with the camera for
                            each simulation
               frame_stage  f(data, FrameStageFrame): changes data in place, or returns new pixels
    Returned:  the plug-in's name for scenarios: Scenario.with_plugin(detector=name)
    Notes:     results must depend on the arguments alone, so that runs repeat. `data` is valid
               during the call. The function may be called in any thread.

    >>> mine = register(detector=my_detector)
    >>> sim = Simulation(scenario.with_plugin(detector=mine))
    """
    given = {"detector": detector, "frame_stage": frame_stage}
    for kind, function in given.items():
        if function is not None and not callable(function):
            raise ArgumentError(f"register: {kind} takes a function, not "
                                f"{type(function).__name__}")
    functions = {k: f for k, f in given.items() if f is not None}
    if not functions:
        raise ArgumentError("register: give a detector or a frame_stage")
    first = next(iter(functions.values()))
    text = text_argument(name, "name")
    short = (text or getattr(first, "__name__", type(first).__name__).encode()).strip(b"<>")
    full = short if b":" in short else b"python:" + short
    made: Dict[str, Callable[..., ctypes.Structure]] = {
        "detector": _detector_functions, "frame_stage": _frame_stage_functions}
    tables = [(kind, made[kind](function)) for kind, function in functions.items()]
    descs = [StageDesc(STAGE_ABI, kind.encode(), short, b"a stage in Python", None, 0,
                       ctypes.addressof(table)) for kind, table in tables]
    pointers = (ctypes.c_void_p * (len(descs) + 1))(*[ctypes.addressof(d) for d in descs], None)
    context = Context()
    context.check(LIBRARY.bst_plugin_register(context.pointer, full, None, pointers))
    _kept.append((tables, descs, pointers))
    return full.decode()
