"""Reads the files that test_fits.c wrote with astropy and compares them with what it wrote.

Usage: check_fits.py FOLDER        all that test_astropy_reads wrote
       check_fits.py FOLDER full   a0.fits to a2.fits, that a full disk ended
"""

import io
import os
import sys
import warnings

import astropy.units as u
import numpy as np
from astropy.io import fits
from astropy.time import Time
from astropy.wcs import WCS

WIDTH, HEIGHT, FRAMES = 61, 37, 5


def pixels(frame, width=WIDTH, height=HEIGHT):
    y, x = np.mgrid[0:height, 0:width]
    return ((frame * 9001 + y * 1777 + x * 13) % 65536).astype(np.uint16)


def start_of(frame):
    return Time("2022-06-16T23:59:58.25", scale="utc") + frame * u.s


FRACTIONS = ("EARTHFRC", "MOONFRC", "SUNFRC")


def check_time(text, expected, what):
    """ISO text against astropy's own clock: written to 1 us."""
    off = abs((Time(text, format="isot", scale="utc") - expected).sec)
    assert off < 1e-6, (what, text, off)


def check_places(wcs, places, frame):
    for row in places[places[:, 0] == frame]:
        x, y = wcs.all_world2pix([[row[1], row[2]]], 0)[0]
        # The true pixel differs by the misfit of a plane to aberration over half a degree: v/c
        # (0.007 rad)^2 = 5e-9 rad = 2e-5 px of 50 arcsec.
        assert np.hypot(x - row[3], y - row[4]) < 1e-3, (frame, x, y, row)


def check_image_header(h, frame, places):
    assert h["FRAMEID"] == frame
    assert h["BUNIT"] == "adu" and h["RADESYS"] == "ICRS" and h["TIMESYS"] == "UTC"
    assert h["EXPTIME"] == 0.5 and h["GAIN"] == 1.5 and h["RDNOISE"] == 8.0
    assert h["OFFSET"] == 100.0 and h["BITS"] == 14
    assert h["SATURATE"] == 2**14 - 1  # the converter ends before 80000 / 1.5 + 100
    assert h["OBJECT"] == "O'Target" and h["INSTRUME"] == "telescope" and h["OBSERVER"] == "neossat"
    assert [h["OBSPOS" + axis] for axis in "XYZ"] == [7.0e6 + frame, -1.0e5, 2.5e5]
    assert [h["OBSVEL" + axis] for axis in "XYZ"] == [10.0, 7400.0, -120.5]
    assert [h[key] for key in FRACTIONS] == [0.25, 0.125, 0.0625]
    assert h["PIXSCALE"] == 50.0 and (h["WINX0"], h["WINY0"], h["BINNING"]) == (0, 0, 1)
    assert 0.0 < h["WCSRESID"] < 1e-3
    begin = start_of(frame)
    for key, offset in (("OBS", 0.0), ("BEG", 0.0), ("AVG", 0.25), ("END", 0.5)):
        check_time(h["DATE-" + key], begin + offset * u.s, key)
        # 16 digits: half a step of 1e-11 d, and half the double's own of 7e-12 d
        assert abs(h["MJD-" + key] - (begin + offset * u.s).mjd) < 1e-11, key
    assert h["ABERRAT"] == "absorbed"
    text = " ".join(h["COMMENT"])
    assert "aberration" in text and "Light time" in text
    assert h["CRPIX1"] == (WIDTH + 1) / 2 and h["CRPIX2"] == (HEIGHT + 1) / 2
    check_places(WCS(h), places, frame)


def check_extensions(path, places):
    with fits.open(path) as f:
        f.verify("exception")
        assert len(f) == FRAMES + 2
        assert f[0].header["CREATOR"] == "boresight test"
        for i in range(FRAMES):
            hdu = f["FRAME", i + 1]
            assert hdu.data.dtype == np.uint16 and (hdu.data == pixels(i)).all(), i
            check_image_header(hdu.header, i, places)
        part = f["FRAME", FRAMES + 1]
        assert (part.data == pixels(FRAMES, 20, 10)).all()
        assert part.header["BINNING"] == 2 and part.header["SATURATE"] == 255
        assert (part.header["WINX0"], part.header["WINY0"]) == (10, 4)
        check_camera(f[0].header)
        assert part.header["PIXSCALE"] == 100.0
        # full-sensor boresight 30 (0-based) in a window from 10, two pixels a bin: 9.75 -> FITS 10.75
        assert part.header["CRPIX1"] == 10.75 and part.header["CRPIX2"] == (18 - 4 + 0.5) / 2 + 0.5


def check_camera(h):
    assert h["APTDIA"] == 0.15 and h["DARKCUR"] == 0.3 and h["PIXSCALE"] == 50.0
    assert h["GAIN"] == 1.5 and h["RDNOISE"] == 8.0 and h["OFFSET"] == 100.0 and h["BITS"] == 16


def check_window_cube(path):
    """The columns of a cube of windows, each with a number of its own; places as in an extension."""
    with fits.open(path) as f:
        check_camera(f[0].header)
        assert (f[0].data[0] == pixels(FRAMES, 20, 10)).all()
        row, = f["FRAMES"].data
        assert (row["WINX0"], row["WINY0"], row["BINNING"], row["BITS"]) == (10, 4, 2, 8)
        assert row["CRPIX1"] == 10.75 and row["CRPIX2"] == (18 - 4 + 0.5) / 2 + 0.5
        assert list(row["OBSPOS"]) == [7.0e6 + FRAMES, -1.0e5, 2.5e5] and list(row["OBSVEL"]) == [10.0, 7400.0, -120.5]
        assert [row[key] for key in FRACTIONS] == [0.25, 0.125, 0.0625]
        assert 0.0 < row["WCSRESID"] < 1e-3
        assert abs(row["MJD-AVG"] - (start_of(FRAMES) + 0.25 * u.s).mjd) < 1e-11


def check_cube(path, places):
    with fits.open(path) as f:
        f.verify("exception")
        h = f[0].header
        assert f[0].data.shape == (FRAMES, HEIGHT, WIDTH) and "CTYPE3" not in h
        assert f[0].data.dtype == np.uint16
        table = f["FRAMES"].data
        assert len(table) == FRAMES
        for i in range(FRAMES):
            assert (f[0].data[i] == pixels(i)).all()
            row = table[i]
            assert row["FRAMEID"] == i and row["EXPTIME"] == 0.5
            check_time(row["DATE-OBS"], start_of(i), "row")
            check_time(row["DATE-AVG"], start_of(i) + 0.25 * u.s, "row")
            assert abs(row["MJD-OBS"] - start_of(i).mjd) < 1e-11
            assert row["OBSPOS"][0] == 7.0e6 + i and row["OBSVEL"][2] == -120.5
            wcs = WCS(naxis=2)
            wcs.wcs.ctype = [f["FRAMES"].header["CTYPE1"], f["FRAMES"].header["CTYPE2"]]
            wcs.wcs.crpix = [row["CRPIX1"], row["CRPIX2"]]
            wcs.wcs.crval = [row["CRVAL1"], row["CRVAL2"]]
            wcs.wcs.cd = [[row["CD1_1"], row["CD1_2"]], [row["CD2_1"], row["CD2_2"]]]
            check_places(wcs, places, i)


def check_killed(folder, places):
    """Every complete frame of a run that was killed is there, without any warning."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with fits.open(os.path.join(folder, "killed_ext.fits")) as f:
            assert len(f) == FRAMES + 1
            for i in range(FRAMES):
                assert (f[i + 1].data == pixels(i)).all()
                check_image_header(f[i + 1].header, i, places)
        with fits.open(os.path.join(folder, "killed_cube.fits")) as f:
            assert f[0].data.shape == (FRAMES, HEIGHT, WIDTH)
            for i in range(FRAMES):
                assert (f[0].data[i] == pixels(i)).all()


def check_sums(path, all_hdus=True):
    """CHECKSUM and DATASUM of every HDU by astropy, which finds a changed byte by them."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with fits.open(path, checksum=True, disable_image_compression=True) as f:
            for hdu in f[0 if all_hdus else 1:]:
                assert "CHECKSUM" in hdu.header and "DATASUM" in hdu.header, hdu.name
                assert hdu.verify_checksum() == 1 and hdu.verify_datasum() == 1, hdu.name
            data = f[-1].fileinfo()["datLoc"]
        with fits.open(path, checksum=True) as f:
            assert sum(hdu.size for hdu in f) > 0
    with open(path, "rb") as f:
        damaged = bytearray(f.read())
    damaged[data] ^= 1
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        with fits.open(io.BytesIO(bytes(damaged)), checksum=True) as f:
            assert len(f) > 1
    assert any("Datasum verification failed" in str(one.message) for one in said), path


def check_packed(folder):
    """Compressed frames hold the same pixels and keys, and the same bytes each time."""
    with open(os.path.join(folder, "rice.fits"), "rb") as one, \
            open(os.path.join(folder, "rice_again.fits"), "rb") as other:
        assert one.read() == other.read()
    with fits.open(os.path.join(folder, "rice.fits"), disable_image_compression=True) as f:
        assert f[1].header["ZCMPTYPE"] == "RICE_1" and f[1].header["XTENSION"] == "BINTABLE"
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with fits.open(os.path.join(folder, "killed_rice.fits")) as f:
            assert len(f) == FRAMES + 1
            for i in range(FRAMES):
                assert (f[i + 1].data == pixels(i)).all()


def states_of_append(folder):
    """Every order of events in which a process may die while it appends a frame, played on the last
    frame of a file: the frames before it are read without an error, and none that is torn."""
    with open(os.path.join(folder, "killed_ext.fits"), "rb") as f:
        whole = f.read()
    with fits.open(os.path.join(folder, "killed_ext.fits")) as f:
        start = f[FRAMES].fileinfo()["hdrLoc"]
    hdu = whole[start:]
    end = hdu.index(b"END" + b" " * 77)
    states = []
    for done in [0, 1, 80, end] + list(range(end + 3, len(hdu), 997)) + [len(hdu)]:
        written = bytearray(hdu[:done].ljust(len(hdu), b"\0"))
        written[end:end + 3] = b"\0\0\0"
        states.append((FRAMES - 1, whole[:start] + bytes(written) + b"\0"))
    states.append((FRAMES, whole + b"\0"))
    states.append((FRAMES, whole))
    cut_path = os.path.join(folder, "state.fits")
    for k, (frames, content) in enumerate(states):
        with open(cut_path, "wb") as f:
            f.write(content)
        with warnings.catch_warnings(record=True) as said:
            warnings.simplefilter("always")
            with fits.open(cut_path) as f:
                assert len(f) == frames + 1, (k, len(f))
                for i in range(frames):
                    assert (f[i + 1].data == pixels(i)).all(), (k, i)
        assert not any("truncated" in str(one.message) for one in said), k


def check_full(folder):
    """What a full disk left: whole frames, and not a warning."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for kind in range(3):
            with fits.open(os.path.join(folder, f"a{kind}.fits")) as f:
                f.verify("exception")
                frames = list(f[0].data) if f[0].data is not None else [hdu.data for hdu in f[1:]]
                assert len(frames) > 1
                for i, frame in enumerate(frames):
                    assert (frame == pixels(i)).all(), (kind, i)


def check_cut(folder):
    """Killed in the middle of the last frame, wherever that is: the frames before it are there."""
    with open(os.path.join(folder, "killed_ext.fits"), "rb") as f:
        whole = f.read()
    with fits.open(os.path.join(folder, "killed_ext.fits")) as f:
        last = f[FRAMES].fileinfo()
    cut_path = os.path.join(folder, "cut.fits")
    for size in (last["hdrLoc"] + 1000, last["hdrLoc"] + 2880, last["datLoc"], last["datLoc"] + 999):
        with open(cut_path, "wb") as f:
            f.write(whole[:size])
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            with fits.open(cut_path) as f:
                for i in range(FRAMES - 1):
                    assert (f[i + 1].data == pixels(i)).all(), (size, i)


def main():
    folder = sys.argv[1]
    if sys.argv[2:] == ["full"]:
        return check_full(folder)
    places = np.loadtxt(os.path.join(folder, "places.txt"))
    check_extensions(os.path.join(folder, "ext[1].fits"), places)
    check_cube(os.path.join(folder, "cube.fits"), places)
    check_window_cube(os.path.join(folder, "window_cube.fits"))
    for name in ("ext[1].fits", "cube.fits", "rice.fits", "killed_ext.fits", "killed_rice.fits"):
        check_sums(os.path.join(folder, name))
    check_killed(folder, places)
    check_cut(folder)
    check_extensions(os.path.join(folder, "rice.fits"), places)
    check_packed(folder)
    states_of_append(folder)


if __name__ == "__main__":
    main()
