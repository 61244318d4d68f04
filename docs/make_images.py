#!/usr/bin/env python3
"""Puts the pictures of a run, or of the tutorial, into docs/images, small enough for a README.

usage: docs/make_images.py RUN_FOLDER
       docs/make_images.py --tutorial RUNS_FOLDER

RUN_FOLDER is a run of the main scenario: its quicklook.png and pointing.png are taken. RUNS_FOLDER is what
the commands of docs/tutorial wrote (runs/). The palette has at most 48 colours; the larger the file would be, the
fewer: noise in a picture costs most of its bytes, and its last bits show nothing. Needs numpy only.
"""
import pathlib
import struct
import sys
import zlib

import numpy as np

MAIN = {"quicklook.png": "quicklook.png", "pointing.png": "pointing.png"}
TUTORIAL = {"iss/quicklook.png": "tutorial_satellite.png", "box_detector.png": "tutorial_detector.png",
            "aperture.png": "tutorial_study.png"}
COLOURS = 48
LARGEST = 290_000  # bytes


def read_png(path):
    """An 8-bit RGB image without interlacing as [height][width][3]."""
    data = path.read_bytes()
    position, compressed, header = 8, b"", None
    while position < len(data):
        length, kind = struct.unpack(">I4s", data[position:position + 8])
        body = data[position + 8:position + 8 + length]
        if kind == b"IHDR":
            header = struct.unpack(">IIBBBBB", body)
        elif kind == b"IDAT":
            compressed += body
        position += 12 + length
    width, height, depth, colour, _, _, interlaced = header
    if (depth, colour, interlaced) != (8, 2, 0):
        sys.exit(f"{path}: an 8-bit RGB image without interlacing is expected")
    raw = zlib.decompress(compressed)
    stride = 3 * width
    rows = np.zeros((height + 1, stride), dtype=np.uint8)
    for y in range(height):
        kind = raw[y * (stride + 1)]
        line = np.frombuffer(raw, np.uint8, stride, y * (stride + 1) + 1).reshape(width, 3)
        above = rows[y].reshape(width, 3)
        if kind == 0:
            out = line
        elif kind == 1:
            out = np.cumsum(line, axis=0, dtype=np.uint64).astype(np.uint8)
        elif kind == 2:
            out = line + above
        else:
            out = np.zeros_like(line)
            left = np.zeros(3, dtype=int)
            upper_left = np.zeros(3, dtype=int)
            for x in range(width):
                up = above[x].astype(int)
                if kind == 3:
                    guess = (left + up) // 2
                else:
                    p = left + up - upper_left
                    a, b, c = abs(p - left), abs(p - up), abs(p - upper_left)
                    guess = np.where((a <= b) & (a <= c), left, np.where(b <= c, up, upper_left))
                out[x] = (line[x] + guess) & 255
                left, upper_left = out[x].astype(int), up
        rows[y + 1] = out.reshape(stride)
    return rows[1:].reshape(height, width, 3)


def quantise(image, apart):
    """Palette and indices: the commonest colours that lie so far apart, each pixel's nearest."""
    coarse = (image >> 1).astype(np.uint32)
    codes = coarse[..., 0] << 16 | coarse[..., 1] << 8 | coarse[..., 2]
    values, inverse, counts = np.unique(codes, return_inverse=True, return_counts=True)
    rgb = np.stack([values >> 16 & 255, values >> 8 & 255, values & 255], axis=1).astype(int) * 2
    palette = []
    for i in np.argsort(-counts, kind="stable"):
        if all(np.abs(rgb[i] - p).max() >= apart for p in palette):
            palette.append(rgb[i])
            if len(palette) == COLOURS:
                break
    palette = np.array(palette)
    nearest = ((rgb[:, None, :] - palette[None]) ** 2).sum(axis=2).argmin(axis=1)
    return palette.astype(np.uint8), nearest[inverse].reshape(codes.shape).astype(np.uint8)


def chunk(kind, body):
    return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))


def make_png(palette, indices):
    height, width = indices.shape
    lines = np.zeros((height, width + 1), dtype=np.uint8)
    lines[:, 1:] = indices
    return (b"\x89PNG\r\n\x1a\n"
            + chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 3, 0, 0, 0))
            + chunk(b"PLTE", palette.tobytes())
            + chunk(b"IDAT", zlib.compress(lines.tobytes(), 9))
            + chunk(b"IEND", b""))


def main():
    words = sys.argv[1:]
    pictures = TUTORIAL if words[:1] == ["--tutorial"] else MAIN
    if pictures is TUTORIAL:
        words = words[1:]
    if len(words) != 1:
        sys.exit(__doc__)
    folder = pathlib.Path(__file__).resolve().parent / "images"
    folder.mkdir(exist_ok=True)
    for source, name in pictures.items():
        image = read_png(pathlib.Path(words[0]) / source)
        for apart in (14, 20, 28, 40):
            png = make_png(*quantise(image, apart))
            if len(png) <= LARGEST:
                break
        (folder / name).write_bytes(png)
        print(f"{folder.name}/{name}: {len(png) / 1e3:.0f} kB")


if __name__ == "__main__":
    main()
