"""The frames of a run: FITS images, cubes and compressed images as Boresight writes them."""
from __future__ import annotations

import os
import pathlib
from typing import Any, BinaryIO, Dict, Iterator, List, NamedTuple, Optional

import numpy as np
import numpy.typing as npt

from .errors import FormatError
from .rice import rice_decode

Cards = Dict[str, str]
Pixels = npt.NDArray[np.uint16]
BLOCK = 2880  # bytes: FITS Standard 4.0, section 3.1


class Place(NamedTuple):
    """Where an image is in a file."""
    hdu: int
    cards: Cards
    start: int            # of the data, bytes
    size: int             # of the data, bytes
    plane: Optional[int]  # of a cube


def images(path: pathlib.Path) -> List[Place]:
    """The 16-bit images of a file, in order; each plane of a cube by itself."""
    return list(_images(path))


def _images(path: pathlib.Path) -> Iterator[Place]:
    with open(path, "rb") as file:
        length, hdu = os.fstat(file.fileno()).st_size, 0
        while True:
            cards = _header(file)
            if cards is None:
                return
            axes = [int(cards[f"NAXIS{k + 1}"]) for k in range(int(cards.get("NAXIS", 0)))]
            width = abs(int(cards["BITPIX"])) // 8
            size = width * int(np.prod(axes)) if axes else 0
            size = (size + int(cards.get("PCOUNT", 0))) * int(cards.get("GCOUNT", 1))
            start = file.tell()
            if start + size > length:
                return  # a file that is still being written, or was cut
            if cards.get("ZIMAGE") == "T":
                yield Place(hdu, cards, start, size, None)
            elif cards.get("XTENSION", "IMAGE") == "IMAGE" and width == 2 and len(axes) == 2:
                yield Place(hdu, cards, start, size, None)
            elif cards.get("XTENSION", "IMAGE") == "IMAGE" and width == 2 and len(axes) == 3:
                for plane in range(axes[2]):
                    yield Place(hdu, cards, start, size, plane)
            file.seek(start + (size + BLOCK - 1) // BLOCK * BLOCK)
            hdu += 1


def read_image(path: pathlib.Path, place: Place) -> Pixels:
    """Pixels of an image, uint16 [height, width]."""
    with open(path, "rb") as file:
        cards = place.cards
        if cards.get("ZIMAGE") == "T":
            file.seek(place.start)
            return _compressed(cards, file.read(place.size))
        width, height = int(cards["NAXIS1"]), int(cards["NAXIS2"])
        file.seek(place.start + 2 * width * height * (place.plane or 0))
        data = np.fromfile(file, ">i2", width * height).astype(np.int32)
        return (data + _zero(cards)).astype(np.uint16).reshape(height, width)


def _zero(cards: Cards) -> int:
    return int(float(cards.get("BZERO", 0)))


def _compressed(cards: Cards, data: bytes) -> Pixels:
    """The 16-bit image of a compressed HDU as Boresight writes it: a Rice tile for each row."""
    wanted = {"ZCMPTYPE": "RICE_1", "ZBITPIX": "16", "TFORM1": "1PB", "ZNAXIS": "2",
              "ZTILE2": "1", "ZTILE1": cards.get("ZNAXIS1", ""), "ZNAME1": "BLOCKSIZE",
              "TFIELDS": "1", "NAXIS1": "8"}
    for key, value in wanted.items():
        if not cards.get(key, "").strip("' ").startswith(value):
            raise FormatError(f"compressed frame: {key} is {cards.get(key)}, {value} is "
                              "understood; read it with astropy")
    width, height = int(cards["ZNAXIS1"]), int(cards["ZNAXIS2"])
    rows = np.frombuffer(data, ">i4", 2 * height).reshape(height, 2).astype(np.int64)
    heap = data[int(cards.get("THEAP", 8 * height)):]
    image = rice_decode(heap, rows[:, 1], rows[:, 0], width, int(cards["ZVAL1"]))
    return np.asarray(image + np.uint16(_zero(cards)), np.uint16)


def _header(file: BinaryIO) -> Optional[Cards]:
    """Keywords of the next header with their values as text; None at the end of the file."""
    cards: Cards = {}
    while True:
        block = file.read(BLOCK)
        if len(block) < BLOCK:
            return None
        for at in range(0, BLOCK, 80):
            card = block[at:at + 80].decode("ascii", "replace")
            if card[:8].strip() == "END":
                return cards
            if card[8:10] == "= ":
                value = card[10:].strip()
                value = value[1:].split("'")[0] if value.startswith("'") else value.split("/")[0]
                cards[card[:8].strip()] = value.strip()


def wcs_of(path: pathlib.Path, place: Place) -> Any:
    """The astropy.wcs.WCS of an image."""
    try:
        from astropy.io import fits
        from astropy.wcs import WCS
    except ImportError:
        raise ImportError("wcs needs astropy: pip install boresight[astropy]") from None
    with fits.open(path) as file:
        if place.plane is None:
            return WCS(file[place.hdu].header)
        raise FormatError(f"{path}: the WCS of a plane of a cube is a row of its table FRAMES; set "
                          "/record/frames to \"extensions\"")
