#!/usr/bin/env python3
"""Makes docs/images/inspection.png: frames of scenarios/inspection.json, each with its own grey scale.

    build/boresight run scenarios/inspection.json --out runs/inspection --set '/record/frames="cube"'
    /usr/bin/python3 docs/make_inspection.py runs/inspection

Blue: box and centre of mass by image processing; red: true centre of mass.
"""
import os
import sqlite3
import struct
import sys
import zlib

import numpy as np
from astropy.io import fits

EXPOSURES = (300, 440, 560, 640, 715, 745, 800, 900)
OUT = os.path.join(os.path.dirname(os.path.abspath(__file__)), "images", "inspection.png")
TILE, GAP = 240, 4
BLUE, RED = (74, 168, 255), (255, 70, 60)


def write_png(path, image):
    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    height, width, _ = image.shape
    rows = b"".join(b"\0" + row.tobytes() for row in image)
    with open(path, "wb") as file:
        file.write(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)) +
                   chunk(b"IDAT", zlib.compress(rows, 9)) + chunk(b"IEND", b""))


def line(tile, start, end, colour):
    count = int(np.max(np.abs(np.subtract(end, start)))) + 1
    for x, y in np.linspace(start, end, 2 * count):
        if 0 <= round(x) < TILE and 0 <= round(y) < TILE:
            tile[round(y), round(x)] = colour


def draw(frame, half, box, centre, truth):
    """A tile about the middle of the sensor, `half` px each way."""
    grey = np.clip(frame.astype(float) - 100.0, 0.0, None)
    bright = grey[grey > 50.0]
    top = np.percentile(bright, 97) if bright.size > 50 else 400.0
    at = np.clip(np.round(256 + (np.arange(TILE) + 0.5) / TILE * 2 * half - half).astype(int), 0, 511)
    levels = (255 * np.clip(grey[np.ix_(at, at)] / top, 0.0, 1.0) ** 0.45).astype(np.uint8)
    tile = np.repeat(levels[:, :, None], 3, axis=2)

    def place(x, y):
        return ((x - 256 + half) * TILE / (2 * half), (y - 256 + half) * TILE / (2 * half))

    if box:
        x0, y0, x1, y1 = box
        corners = [place(x0, y0), place(x1, y0), place(x1, y1), place(x0, y1), place(x0, y0)]
        for start, end in zip(corners, corners[1:]):
            line(tile, start, end, BLUE)
    for (x, y), colour, turned in ((truth, RED, 1), (centre, BLUE, 0)) if centre else ((truth, RED, 1),):
        px, py = place(x, y)
        arms = ((5, 5), (5, -5)) if turned else ((7, 0), (0, 7))
        for dx, dy in arms:
            line(tile, (px - dx, py - dy), (px + dx, py + dy), colour)
    return tile


def main():
    folder = sys.argv[1]
    with sqlite3.connect(os.path.join(folder, "run.sqlite")) as store:
        extended = {row[0]: row[1:] for row in store.execute(
            "SELECT exposure_id, x_px, y_px, x0_px, y0_px, x1_px, y1_px FROM extended_targets ORDER BY size_px")}
        truth = {row[0]: row[1:] for row in store.execute("SELECT exposure_id, x_px, y_px, range_m FROM shapes")}
    image = np.full((2 * TILE + GAP, 4 * TILE + 3 * GAP, 3), 255, np.uint8)
    with fits.open(os.path.join(folder, "frames.fits")) as cube:
        for k, exposure in enumerate(EXPOSURES):
            x, y, range_m = truth[exposure]
            half = 256.0 if range_m < 60 else 48.0 if range_m < 300 else 24.0
            found = extended.get(exposure)
            tile = draw(cube[0].section[exposure], half, found[2:] if found else None, found[:2] if found else None, (x, y))
            top, left = k // 4 * (TILE + GAP), k % 4 * (TILE + GAP)
            image[top:top + TILE, left:left + TILE] = tile
    write_png(OUT, image)


if __name__ == "__main__":
    main()
