"""Helpers of the tests of the Python package."""
import logging
import pathlib
import sys
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
logging.getLogger("boresight").setLevel(logging.ERROR)  # the star catalogue of a bare machine

import boresight as bst  # noqa: E402

MAIN = "neossat_geo_track"
# the same scene on a sixteenth of the sensor, with the object in the field from the start
SMALL = bst.Scenario.load(MAIN).with_({
    "/observers/0/sensors/0/camera/width_px": 256,
    "/observers/0/sensors/0/camera/height_px": 256,
    "/observers/0/sensors/0/cue/offset_deg": 0.02})


def main():
    """Runs the tests of the calling file."""
    unittest.main(argv=[sys.argv[0], *sys.argv[2:]], verbosity=1)
