"""Pictures of frames for notebooks, as PNG without other libraries."""
from __future__ import annotations

import base64
import struct
import zlib
from typing import Any

import numpy as np
import numpy.typing as npt

WIDEST = 512  # pixels of a picture's longer side


def stretched(data: npt.NDArray[Any]) -> npt.NDArray[np.uint8]:
    """Grey levels of a frame: from the 5 % quantile to the 99.8 % quantile, reduced in size by the
    brightest pixel of each block."""
    step = -(-max(data.shape) // WIDEST)
    rows, columns = (min(step, size) for size in data.shape)  # of a block: a frame may be thinner
    height, width = data.shape[0] // rows, data.shape[1] // columns
    blocks = data[:height * rows, :width * columns].reshape(height, rows, width, columns)
    small = blocks.max(axis=(1, 3)).astype(float)
    low, high = np.quantile(small, (0.05, 0.998))
    level = np.clip((small - low) / max(high - low, 1.0), 0.0, 1.0)
    return np.asarray(255.0 * np.sqrt(level) + 0.5, np.uint8)


def png(grey: npt.NDArray[np.uint8]) -> bytes:
    """A picture of grey levels [height, width] as PNG (W3C Recommendation, 2003)."""
    def chunk(kind: bytes, data: bytes) -> bytes:
        return (struct.pack(">I", len(data)) + kind + data
                + struct.pack(">I", zlib.crc32(kind + data)))

    height, width = grey.shape
    rows = np.zeros((height, width + 1), np.uint8)  # each row begins with its filter: none
    rows[:, 1:] = grey
    return (b"\x89PNG\r\n\x1a\n"
            + chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0))
            + chunk(b"IDAT", zlib.compress(rows.tobytes(), 6)) + chunk(b"IEND", b""))


def html_image(data: npt.NDArray[Any]) -> str:
    """A frame as an image in HTML."""
    if data.ndim != 2 or not data.size:
        return ""
    text = base64.b64encode(png(stretched(data))).decode()
    return f'<img src="data:image/png;base64,{text}" style="image-rendering: pixelated">'
