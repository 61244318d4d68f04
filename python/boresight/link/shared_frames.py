"""Frames of the link in shared memory."""
from __future__ import annotations

import mmap

import numpy as np
import numpy.typing as npt

from .errors import LinkError

PIXELS_AT = 4096  # of a slot in shared memory


class SharedFrames:
    """The ring of frames in /dev/shm, for reading."""

    def __init__(self, name: str, slots: int, slot_bytes: int):
        if "/" in name[1:] or not name.startswith("/boresight-"):
            raise LinkError(f"shared memory of another name: {name}")
        with open("/dev/shm" + name, "rb") as file:
            self._memory = mmap.mmap(file.fileno(), 0, prot=mmap.PROT_READ)
        self._slots, self._slot_bytes = slots, slot_bytes
        if len(self._memory) < slots * slot_bytes:
            raise LinkError("the shared memory is shorter than the simulation says")

    def pixels(self, number: int, height: int, width: int) -> npt.NDArray[np.uint16]:
        """Pixels of message `number`, valid until the step is answered."""
        at = number % self._slots * self._slot_bytes
        lies, length = np.frombuffer(self._memory, "<i8", 2, at)
        if lies != number or length != 2 * height * width:
            raise LinkError("a frame is not in the shared memory any more")
        return np.frombuffer(self._memory, "<u2", height * width,
                             at + PIXELS_AT).reshape(height, width)
