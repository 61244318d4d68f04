"""Messages of the link as bytes: header, payload and pixels."""
from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Any, Dict, List, Optional

import numpy as np
import numpy.typing as npt

from .crc import crc32c
from .errors import LinkError
from .tables import ITEMS, RECORDS, VERSION


@dataclass
class Message:
    """A received message. `record` and `items` are read-only views of its bytes."""
    header: Dict[str, Any]
    record: np.void
    items: Optional[npt.NDArray[np.void]] = None
    pixels: Optional[npt.NDArray[np.uint16]] = None  # of a frame: uint16 [height, width], not a copy

    @property
    def type(self) -> str:
        """Type of the message."""
        return str(self.header["type"])

    @property
    def rows(self) -> npt.NDArray[np.void]:
        """Items of a message that has some."""
        if self.items is None:
            raise LinkError(f"{self.type} has no items")
        return self.items

    def __getitem__(self, name: str) -> Any:
        """A member of the record."""
        return self.record[name]


def new_record(kind: str) -> npt.NDArray[np.void]:
    """A zeroed record (an array without dimensions), to be filled: r["tick"] = 5."""
    return np.zeros((), RECORDS[kind])


def new_items(kind: str, count: int) -> npt.NDArray[np.void]:
    """`count` zeroed items, to be filled: items["x_px"] = ..."""
    return np.zeros(count, ITEMS[kind])


def encode(kind: str, sequence: int, record: npt.NDArray[np.void],
           items: Optional[npt.NDArray[np.void]] = None,
           **members: Any) -> List[bytes]:
    """The parts of a message; `members`: further header members: tick, step, instance."""
    if items is not None:
        record = record.copy()
        record["count"] = len(items)
    payload = record.tobytes() + (items.tobytes() if items is not None else b"")
    header = {"version": VERSION, "type": kind, "tick": 0, "sequence": sequence, **members,
              "lengths": [len(payload)], "crcs": ["%08x" % crc32c(payload)]}
    text = (json.dumps(header)[:-1] + ",").encode("ascii")
    return [text + b'"crc32c":"%08x"}' % crc32c(text), payload]


def decode(parts: List[Any], check: bool = True) -> Message:
    """Decodes a message from its parts (buffers). Raises LinkError for an invalid message."""
    head = bytes(parts[0])
    try:
        header = json.loads(head)
        declared, kind = int(header["crc32c"], 16), header["type"]
        record_type, item_type = RECORDS[kind], ITEMS.get(kind)
        lengths, crcs = header["lengths"], header["crcs"]
    except (ValueError, KeyError, TypeError) as error:
        raise LinkError(f"invalid header: {head[:200]!r}") from error
    if header.get("version") != VERSION:
        raise LinkError(f"version {header.get('version')} of the protocol, this is {VERSION}")
    if crc32c(head[:-20]) != declared:
        raise LinkError("the checksum of a header is wrong")
    shared = "slot" in header
    if len(parts) != 1 + len(lengths) - shared or len(crcs) != len(parts) - 1:
        raise LinkError(f"{kind} in {len(parts)} parts")
    for part, length, crc in zip(parts[1:], lengths, crcs):
        if len(part) != length or (check and crc32c(part) != int(crc, 16)):
            raise LinkError(f"a part of {kind} is not what its header says")
    payload = parts[1]
    if len(payload) < record_type.itemsize:
        raise LinkError(f"{kind} of {len(payload)} bytes")
    record = np.frombuffer(payload, record_type, 1)[0]
    items = None
    if item_type is not None:
        if len(payload) != record_type.itemsize + int(record["count"]) * item_type.itemsize:
            raise LinkError(f"{kind} of {len(payload)} bytes with {record['count']} items")
        items = np.frombuffer(payload, item_type, offset=record_type.itemsize)
    message = Message(header, record, items)
    if kind == "frame" and not shared:
        message.pixels = np.frombuffer(parts[2], "<u2").reshape(record["height"], record["width"])
    return message
