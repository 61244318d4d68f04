"""A peer of Boresight's packet link; it requires NumPy and PyZMQ (`pip install boresight[link]`).

A peer program replaces a part of a simulation (image processing, tracker or control)::

    from boresight.link import Link

    with Link("tcp://127.0.0.1:5555", serves="imgproc") as link:
        for step in link.steps():
            bright = step.frame.pixels > 5000               # uint16 [height, width], not a copy
            y, x = bright.nonzero()
            step.send_detections(x_px=x, y_px=y, flux_e=1000.0, snr=10.0)

while the simulation runs in another process, started before or after::

    boresight run SCENARIO.json --link tcp://127.0.0.1:5555 --external imgproc

`Link.steps` waits for each step of the part. It ends the step when the next one is requested; the
simulation waits in between. docs/reference/icd.md defines the messages: here each is a NumPy
record with the names from there. The shared library of Boresight is not needed.

The simulation checks every message. If it rejects one, `LinkError` is raised here.
"""
from __future__ import annotations

from .connection import Link
from .crc import crc32c
from .errors import LinkError, LinkTimeout
from .keys import read_keys
from .packet import Message, decode, encode, new_items, new_record
from .step import Part, Step
from .tables import ITEMS, LABELS, MODES, RECORDS, VERSION

__all__ = ["ITEMS", "LABELS", "MODES", "RECORDS", "VERSION", "Link", "LinkError", "LinkTimeout",
           "Message", "Part", "Step", "crc32c", "decode", "encode", "new_items", "new_record",
           "read_keys"]
