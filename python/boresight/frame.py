"""Frame: the pixels of a frame without a copy, and its metadata."""
from __future__ import annotations

from ctypes import byref, c_void_p
from typing import Any, List, Optional

import numpy as np
import numpy.typing as npt

from ._native import LIBRARY, Context
from ._owned import Owned
from ._structs import SimFrame
from .messages import FrameMessage, Window

MOST_LENT = 4
"""Frames of a simulation whose pixels are lent at a time; further ones are copies, so that the
renderer never waits for a frame that Python keeps."""


class LentPixels:
    """Memory of a frame for NumPy. The frame is released with the last array that refers to it.

    It keeps the simulation alive that the frame belongs to.
    """

    def __init__(self, held: int, owner: Optional[Owned], pointer: int, height: int, width: int,
                 lent: "List[LentCount]"):
        self._owned = Owned(held, LIBRARY.bst_sim_release_frame,
                            *(() if owner is None else (owner,)))
        self._lent = lent[0]
        self._lent.count += 1
        self.__array_interface__ = {"shape": (height, width), "typestr": "<u2",
                                    "data": (pointer, True), "version": 3}

    def __del__(self) -> None:
        self._lent.count -= 1


class LentCount:
    """Number of frames of a simulation whose pixels are lent."""

    def __init__(self) -> None:
        self.count = 0


def take_pixels(context: Context, view: SimFrame, owner: Optional[Owned],
                lent: LentCount) -> npt.NDArray[np.uint16]:
    """Pixels of a frame that bst_sim_view_frame has lent, as a read-only array."""
    held = c_void_p()
    context.check(LIBRARY.bst_sim_hold_frame(context.pointer, byref(view), byref(held)))
    assert held.value
    pixels = LentPixels(held.value, owner, view.pixels, view.height, view.width, [lent])
    array = np.asarray(pixels)
    if lent.count > MOST_LENT:
        array = array.copy()
        array.setflags(write=False)
    return array


class Frame:
    """A frame: `data` and what the detector says of it.

    `data` is a read-only array of uint16, [height, width], in digital numbers. It is the memory of
    the renderer, not a copy, and stays valid and unchanged for as long as it is referred to. Of a
    simulation at most four frames are lent at a time; `data` of further ones is a copy.
    """

    __slots__ = ("data", "message", "scope", "_tick_rate_hz")

    def __init__(self, data: npt.NDArray[np.uint16], message: FrameMessage, scope: str,
                 tick_rate_hz: int):
        self.data, self.message, self.scope = data, message, scope
        self._tick_rate_hz = tick_rate_hz

    @property
    def exposure_id(self) -> int:
        """Number of the exposure: 0, 1, 2, ..."""
        return self.message.exposure_id

    @property
    def start_tick(self) -> int:
        """Start of the exposure, ticks."""
        return self.message.start_tick

    @property
    def end_tick(self) -> int:
        """End of the exposure, ticks."""
        return self.message.end_tick

    @property
    def start_s(self) -> float:
        """Start of the exposure, seconds since the scenario's epoch."""
        return self.start_tick / self._tick_rate_hz

    @property
    def end_s(self) -> float:
        """End of the exposure, seconds since the scenario's epoch."""
        return self.end_tick / self._tick_rate_hz

    @property
    def exposure_s(self) -> float:
        """Length of the exposure, s."""
        return (self.end_tick - self.start_tick) / self._tick_rate_hz

    @property
    def window(self) -> Window:
        """Read-out window in full-sensor pixels."""
        return self.message.window

    @property
    def binning(self) -> int:
        """Sensor pixels along a side of a pixel of the frame."""
        return self.message.binning

    @property
    def bits(self) -> int:
        """Bits of a pixel's number."""
        return self.message.bits

    def sensor_px(self, x: Any, y: Any) -> Any:
        """Full-sensor coordinates (x, y) of pixel coordinates of `data`."""
        b, w = self.binning, self.window
        return (w.x0 + (np.asarray(x) + 0.5) * b - 0.5, w.y0 + (np.asarray(y) + 0.5) * b - 0.5)

    def copy(self) -> "Frame":
        """The same frame with pixels of its own."""
        data = self.data.copy()
        data.setflags(write=False)
        return Frame(data, self.message, self.scope, self._tick_rate_hz)

    def __array__(self, dtype: Any = None, copy: Any = None) -> npt.NDArray[Any]:
        if copy is False and dtype is not None and np.dtype(dtype) != self.data.dtype:
            raise ValueError("another type of pixels needs a copy")
        array = self.data if dtype is None else self.data.astype(dtype, copy=False)
        return array.copy() if copy else array

    def __reduce__(self) -> Any:
        return Frame, (self.data.copy(), self.message, self.scope, self._tick_rate_hz)

    def __repr__(self) -> str:
        height, width = self.data.shape
        return (f"<Frame {self.exposure_id} of {self.scope}: {width} x {height} px, "
                f"{self.start_s:.3f} to {self.end_s:.3f} s>")

    def _repr_html_(self) -> str:
        from .picture import html_image
        return f"<p>{html_text(repr(self))}</p>{html_image(self.data)}"


def html_text(text: str) -> str:
    """A text in HTML."""
    import html
    return html.escape(text)
