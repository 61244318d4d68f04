"""Readers of what `boresight export` writes: PNG pictures, MP4 boxes, CCSDS OEM and TDM."""

import datetime
import struct
import zlib


def read_png(path):
    """Width, height and rows of bytes of a PNG (ISO 15948): RGB or grey of 8 bits, or grey of 16."""
    with open(path, "rb") as file:
        data = file.read()
    assert data[:8] == b"\x89PNG\r\n\x1a\n"
    at, body = 8, b""
    while at < len(data):
        size, kind = struct.unpack(">I4s", data[at:at + 8])
        part = data[at + 8:at + 8 + size]
        assert zlib.crc32(kind + part) == struct.unpack(">I", data[at + 8 + size:at + 12 + size])[0]
        if kind == b"IHDR":
            width, height, depth, colour = struct.unpack(">IIBB", part[:10])
            assert (depth, colour) in ((8, 2), (8, 0), (16, 0)), (depth, colour)
        body += part if kind == b"IDAT" else b""
        at += 12 + size
    assert kind == b"IEND"
    return width, height, unfilter(zlib.decompress(body), width, height, 3 if colour == 2 else depth // 8)


def unfilter(data, width, height, channels):
    rows, above = [], bytearray(width * channels)
    stride = width * channels
    for y in range(height):
        how = data[y * (stride + 1)]
        row = bytearray(data[y * (stride + 1) + 1:(y + 1) * (stride + 1)])
        for i in range(stride if how else 0):
            left = row[i - channels] if i >= channels else 0
            corner = above[i - channels] if i >= channels else 0
            guess = left + above[i] - corner
            paeth = min((left, above[i], corner), key=lambda v: abs(guess - v))
            row[i] = (row[i] + [0, left, above[i], (left + above[i]) // 2, paeth][how]) & 255
        rows.append(row)
        above = row
    return rows


def read_boxes(data):
    """The boxes of an ISO base media file, one after another."""
    at, out = 0, {}
    while at < len(data):
        size, kind = struct.unpack(">I4s", data[at:at + 8])
        assert 8 <= size <= len(data) - at, (size, kind)
        out[kind.decode()] = data[at + 8:at + size]
        at += size
    return out


def read_oem(path):
    """Segments of an OEM: (metadata, [(utc, [x y z vx vy vz] in km and km/s)])."""
    segments, meta, inside, covariance = [], None, False, False
    with open(path, encoding="ascii") as file:
        lines = file.read().splitlines()
    assert lines[0] == "CCSDS_OEM_VERS = 2.0"
    for line in lines[1:]:
        if line in ("COVARIANCE_START", "COVARIANCE_STOP"):
            covariance = line == "COVARIANCE_START"
        elif covariance:
            continue
        elif line == "META_START":
            meta, inside = {}, True
            segments.append((meta, []))
        elif line == "META_STOP":
            inside = False
        elif inside and "=" in line:
            key, value = line.split("=", 1)
            meta[key.strip()] = value.strip()
        elif line and line[0].isdigit():
            words = line.split()
            segments[-1][1].append((words[0], [float(w) for w in words[1:]]))
    return segments


def read_tdm(path):
    """Segments of a TDM: (metadata with its comments, {keyword: [(utc, value)]})."""
    segments, place = [], None
    with open(path, encoding="ascii") as file:
        lines = file.read().splitlines()
    assert lines[0] == "CCSDS_TDM_VERS = 2.0"
    for line in lines[1:]:
        if line in ("META_START", "DATA_START"):
            place = line
            if line == "META_START":
                segments.append(({"COMMENT": []}, {}))
        elif line in ("META_STOP", "DATA_STOP"):
            place = None
        elif place == "META_START" and line.startswith("COMMENT "):
            segments[-1][0]["COMMENT"].append(line[8:])
        elif place and "=" in line:
            key, value = (part.strip() for part in line.split("=", 1))
            if place == "META_START":
                segments[-1][0][key] = value
            else:
                utc, number = value.split()
                segments[-1][1].setdefault(key, []).append((utc, float(number)))
    return segments


def seconds(utc, epoch):
    """Seconds from one UTC text to another; the runs here meet no leap second."""
    parse = lambda text: datetime.datetime.fromisoformat(text[:26])  # noqa: E731
    beyond = lambda text: float(f"0.000000{text[26:] or 0}")  # of a microsecond # noqa: E731
    utc, epoch = utc.rstrip("Z"), epoch.rstrip("Z")
    return (parse(utc) - parse(epoch)).total_seconds() + beyond(utc) - beyond(epoch)
