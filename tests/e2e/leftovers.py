"""What a run that did not end well left behind, read as a user would: FITS with astropy, tables with
sqlite3. Shared by test_interrupted.py and test_faults.py.
"""
import glob
import json
import os
import sqlite3
import warnings

import numpy as np
from astropy.io import fits


def frames_in(path):
    """Images of every frame of a file. Each HDU that astropy lists is read: a torn one is an
    error. At most, what follows the last whole HDU is warned of."""
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        with fits.open(path, memmap=False) as hdus:
            if hdus[0].header["NAXIS"] == 3:
                frames = list(hdus[0].data) if hdus[0].data is not None else []
            else:
                frames = [hdu.data for hdu in hdus[1:]]
                assert all(hdu.name == "FRAME" for hdu in hdus[1:])
            for hdu in hdus:
                hdu.verify("exception")
    for one in said:
        assert "truncated" not in str(one.message), one.message
    return frames


def rows_in(path):
    """Rows of the table of frames; None when there is no such table yet."""
    db = sqlite3.connect(path)
    try:
        assert db.execute("PRAGMA integrity_check").fetchall() == [("ok",)]
        names = [row[0] for row in db.execute("SELECT name FROM sqlite_master")]
        counts = [db.execute(f'SELECT count(*) FROM "{name}"').fetchone()[0] for name in names
                  if not name.startswith("sqlite_")]
        return counts[[n for n in names if not n.startswith("sqlite_")].index("frames")] \
            if "frames" in names else None
    finally:
        db.close()


def check(out, reference, total, count_in_manifest=True):
    """Checks what a run of `total` frames with the output folder `out` left, whenever it ended.
    `reference` holds the images of its first frames. Returns (where it is, frames, rows)."""
    partial = out + ".partial"
    # a folder that was being prepared holds nothing but the lock
    for draft in glob.glob(glob.escape(partial) + ".*"):
        assert set(os.listdir(draft)) <= {"lock"}, draft
    if os.path.exists(out):
        assert not os.path.exists(partial)
        where, left = "complete", out
    elif os.path.exists(partial):
        where, left = "partial", partial
    else:
        return "nothing", 0, 0
    path = os.path.join(left, "frames.fits")
    frames = frames_in(path) if os.path.exists(path) else []
    for k, (mine, expected) in enumerate(zip(frames, reference)):
        assert np.array_equal(mine, expected), k
    path = os.path.join(left, "run.sqlite")
    rows = rows_in(path) if os.path.exists(path) else None
    # rows are committed after their frames
    assert (rows or 0) <= len(frames), (rows, len(frames))
    path = os.path.join(left, "manifest.json")
    complete = False
    if os.path.exists(path):
        with open(path, encoding="utf-8") as file:
            manifest = json.load(file)
        complete = manifest["complete"]
        assert complete == (manifest["ended"] == "complete")
    if where == "complete":
        assert complete
        assert not os.path.exists(os.path.join(left, "run.sqlite-wal"))
    if complete:
        # the manifest comes last: what it speaks of is there
        assert (len(frames), rows) == (total, total), (len(frames), rows)
    return where, len(frames), rows or 0
