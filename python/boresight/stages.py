"""Detectors and frame stages in Python inside the process, as C plug-ins have them."""
from __future__ import annotations

import ctypes
import sys
from typing import Any, Callable, Dict, NamedTuple

import numpy as np
import numpy.typing as npt

from ._keys import KeyTable
from ._plugin import Instance, Part, archive, create, destroy, instance_of, stage_part
from ._structs import (ApplyFunction, DetectFunction, DetectorCreate, DetectorStage, FrameStage,
                       FrameStageCreate)
from .camera import Camera, camera_of
from .errors import ArgumentError, StateError
from .messages import Detection, Detections, Window
from .record import structured

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


def _check_released(instance: Instance, pixels: _Pixels, references: int) -> None:
    """Pixels are valid during the call only: what keeps them keeps the simulation's memory."""
    if references > 2:  # the caller's and that of the count
        pixels.keeper = instance.owner()
        raise StateError("the function keeps an array of its frame, whose memory is valid during "
                         "the call only: keep a copy (data.copy())")


def _window(struct: Any) -> Window:
    return Window(x0=struct.x0, y0=struct.y0, width=struct.width, height=struct.height)


class _Detector(Instance):
    """A detector of one simulation."""

    def __init__(self, function: Callable[..., Any], env: Any, keys: Dict[str, Any]):
        self.camera = camera_of(env.camera[0])
        self.capacity, self.electrons_per_s_v0 = env.capacity, env.electrons_per_s_v0
        super().__init__(function, (self.camera,), keys)

    def detect(self, given: Any, out: int) -> None:
        """Calls the function and stores what it found."""
        window, copies = _window(given.window), self.owner() is None
        pixels = _Pixels(given.pixels, window.height // given.binning,
                         window.width // given.binning, True)
        data = np.asarray(pixels)
        if copies:  # by a command of the program, which keeps nothing for longer
            data = data.copy()
            data.setflags(write=False)
        frame = DetectorFrame(data, given.exposure_id, window, given.binning, given.bits,
                              given.exposure_s, self.camera, self.electrons_per_s_v0)
        found = self.function(frame)
        if not isinstance(found, Detections):
            found = Detections(structured(found, Detection.dtype, "detections"),
                               noise_e=max(self.camera.read_noise_e, 1.0), threshold_snr=5.0)
        del frame, data
        references = sys.getrefcount(pixels)
        _check_released(self, pixels, references)
        _store(found, self.capacity, out)


def detector_part(function: Callable[..., Any], type_name: bytes, table: KeyTable) -> Part:
    """The descriptor of a detector."""
    def create_one(context: int, config: int, env: Any, out: Any) -> int:
        return create(lambda: _Detector(function, env[0], table.values(config)), context, out)

    def detect(key: int, context: int, given: Any, out: int) -> int:
        instance: Any = instance_of(key)
        return int(instance.call(context, lambda: instance.detect(given[0], out)))

    return stage_part("detector", type_name, table, DetectorStage(
        DetectorCreate(create_one), DetectFunction(detect), destroy, archive))


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


class _FrameStage(Instance):
    """A frame stage of one simulation."""

    def __init__(self, function: Callable[..., Any], env: Any, keys: Dict[str, Any]):
        self.camera = camera_of(env.camera[0])
        self.place = env.instance.decode(), env.seed, env.run
        super().__init__(function, (self.camera,), keys)

    def apply(self, given: Any, pointer: int) -> None:
        """Lets the function change pixels in place."""
        pixels, copies = _Pixels(pointer, given.height, given.width, False), self.owner() is None
        lent, most = np.asarray(pixels), (1 << given.bits) - 1
        data = lent.copy() if copies else lent
        changed = self.function(data, FrameStageFrame(
            given.exposure_id, given.start_s, given.end_s, _window(given.window), given.binning,
            given.bits, self.camera, *self.place))
        if changed is not None and changed is not data:
            new = np.asarray(changed)
            if new.shape != data.shape or new.dtype.kind not in "iu":
                raise ArgumentError(f"a frame stage gives whole numbers of shape {data.shape}, "
                                    f"found {new.dtype} {new.shape}")
            data[:] = np.clip(new, 0, most)
            del new
        if data.size and int(data.max()) > most:
            raise ArgumentError(f"a pixel of {int(data.max())} DN (allowed: 0 to {most})")
        if copies:
            lent[:] = data
        del data, changed, lent
        references = sys.getrefcount(pixels)
        _check_released(self, pixels, references)


def frame_stage_part(function: Callable[..., Any], type_name: bytes, table: KeyTable) -> Part:
    """The descriptor of a frame stage."""
    def create_one(context: int, config: int, env: Any, out: Any) -> int:
        return create(lambda: _FrameStage(function, env[0], table.values(config)), context, out)

    def apply(key: int, context: int, given: Any, pixels: int) -> int:
        instance: Any = instance_of(key)
        return int(instance.call(context, lambda: instance.apply(given[0], pixels)))

    return stage_part("frame_stage", type_name, table, FrameStage(
        FrameStageCreate(create_one), ApplyFunction(apply), destroy, archive))
