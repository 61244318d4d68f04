"""Rice decompression of 16-bit images: FITS Standard 4.0, section 10.4.1."""
from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from .errors import FormatError

Ints = npt.NDArray[np.int64]


class _Bits:
    """The next bits of several rows of a heap, each at a place of its own."""

    def __init__(self, heap: bytes, starts: Ints, sizes: Ints):
        # overlapping 64-bit words, one from each byte on
        self._words: npt.NDArray[np.uint64] = np.ndarray((len(heap) + 1,), ">u8", heap + bytes(8), strides=(1,))
        self.bit = 8 * starts
        self.end = 8 * (starts + sizes)

    def window(self) -> npt.NDArray[np.uint64]:
        """At least 57 next bits of each row, left-aligned."""
        at = np.minimum(self.bit, self.end) >> 3
        shift = (self.bit & 7).astype(np.uint64)
        return np.asarray(self._words[at].astype(np.uint64) << shift)

    def take(self, n: Any) -> Ints:
        """The next n (0 to 16) bits of each row, which are taken."""
        count = np.broadcast_to(np.asarray(n, np.int64), self.bit.shape)
        value = (self.window() >> np.uint64(1)) >> (63 - count).astype(np.uint64)
        self.bit = self.bit + count
        return np.asarray(value, np.int64)

    def take_zeros(self, going: npt.NDArray[np.bool_]) -> Ints:
        """Zeros before the next one of the rows in `going`; they and the one are taken."""
        count = np.zeros(len(self.bit), np.int64)
        going = going.copy()
        while np.any(going):
            # 53 bits are exact in a double, whose exponent counts the zeros before the first one
            top = self.window() >> np.uint64(11)
            zeros = np.where(top > 0, 53 - np.frexp(top.astype(np.float64))[1], 53)
            count += np.where(going, zeros, 0)
            self.bit = self.bit + np.where(going, zeros + (top > 0), 0)
            going = going & (top == 0) & (self.bit < self.end)
        return count


def rice_decode(heap: bytes, starts: Ints, sizes: Ints, width: int,
                block: int) -> npt.NDArray[np.uint16]:
    """Decodes a Rice tile of 16-bit pixels per row, all rows at once.

    Given:     starts, sizes  [rows] bytes of each row in the heap
               width          pixels of a row
               block          pixels of a block
    """
    if np.any(starts < 0) or np.any(sizes < 2) or np.any(starts + sizes > len(heap)):
        raise FormatError("compressed frame: its rows lie outside the data")
    bits = _Bits(heap, starts, sizes)
    last = bits.take(16)
    image = np.empty((len(starts), width), np.uint16)
    for column in range(width):
        if column % block == 0:
            code = bits.take(4)
            coded = (code > 0) & (code < 15)
            low_bits = np.where(coded, code - 1, np.where(code == 15, 16, 0))
        high = bits.take_zeros(coded)
        mapped = (high << low_bits) + bits.take(low_bits)
        # 0, 1, 2, 3, ... encode 0, -1, 1, -2, ...
        last = last + np.where(mapped & 1, ~(mapped >> 1), mapped >> 1)
        image[:, column] = last & 0xFFFF
    if np.any(bits.bit > bits.end):
        raise FormatError("compressed frame: a row ends before its last pixel")
    return image
