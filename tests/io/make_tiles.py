#!/usr/bin/env python3
"""Writes frames that astropy compresses in tiles, of every kind, and what astropy reads back from them: for test_fits_tiles.c.

Usage: make_tiles.py FOLDER    N.fits and N.f4, pixels of all planes as 32-bit floats of this machine; prints how many.
"""
import os
import sys
import warnings

import numpy as np
from astropy.io import fits

WIDTH, HEIGHT, PLANES = 53, 37, 5
WITHOUT_WIDTH = 7  # doubles as whole numbers whose header does not say of how many bytes: 4


def pixels(planes=1):
    """A slope, noise, a star, and a part that is far above it."""
    rng = np.random.default_rng(8)
    z, y, x = np.mgrid[:planes, :HEIGHT, :WIDTH]
    image = 90 + 3.0 * x - 1.5 * y + 40 * z + rng.normal(0, 6, x.shape) + 900 * np.exp(-((x - 20)**2 + (y - 11)**2) / 8)
    return image if planes > 1 else image[0]


def cases():
    """(pixels, options of fits.CompImageHDU)"""
    def of(method, tile=(17, 8), **more):
        return {"compression_type": method, "tile_size": tile, **more}
    for kind, scale, method in ((np.uint8, 0.25, "RICE_1"), (np.int16, 1, "GZIP_2"), (np.uint16, 40, "RICE_1"), (np.int32, 9000, "RICE_1"), (np.int32, 9000, "GZIP_1")):
        yield np.clip(pixels() * scale, 0, None).astype(kind), of(method)
    image = pixels()
    odd = image.copy()
    odd[5, 7] = np.nan
    odd[16:24, 17:34] *= 1e12
    odd[30, 40] = 3e13  # a tile that whole numbers of its noise do not hold: it is kept as it is
    for kind, method, dither in ((np.float32, "RICE_1", -1), (np.float32, "RICE_1", 1), (np.float64, "RICE_1", 2), (np.float32, "GZIP_2", 1)):
        yield image.astype(kind), of(method, quantize_method=dither, quantize_level=16, dither_seed=77)
    yield odd.astype(np.float32), of("RICE_1", quantize_method=1, quantize_level=16, dither_seed=9990)
    yield odd, of("RICE_1", quantize_method=1, quantize_level=16, dither_seed=9990)
    yield odd.astype(np.float32), of("GZIP_2", (20, 5), quantize_level=0)
    yield odd, of("GZIP_1", (20, 5), quantize_level=0)
    cube = pixels(PLANES)
    yield cube.astype(np.int16), of("RICE_1", (WIDTH, HEIGHT, 2))
    yield cube.astype(np.float32), of("RICE_1", (20, 9, 3), quantize_level=16)


def rename(path, old, new):
    with open(path, "rb") as file:
        data = file.read()
    assert old in data
    with open(path, "wb") as file:
        file.write(data.replace(old, new))


def main():
    warnings.simplefilter("ignore")
    count = 0
    for image, options in cases():
        path = os.path.join(sys.argv[1], f"{count}.fits")
        fits.HDUList([fits.PrimaryHDU(), fits.CompImageHDU(image, **options)]).writeto(path)
        if count == WITHOUT_WIDTH:
            rename(path, b"BYTEPIX", b"UNKNOWN")
        with fits.open(path) as file:
            back = np.array(file[1].data, np.float32)
        back[np.isnan(image)] = np.nan  # astropy 5 reads the number that stands for none
        back.reshape(-1, HEIGHT, WIDTH).tofile(path[:-5] + ".f4")
        count += 1
    print(count)


if __name__ == "__main__":
    main()
