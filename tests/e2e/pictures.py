"""Writes PNG and TIFF files and side tables after their standards, without the libraries that read them."""
import csv
import struct
import zlib


def write_png(path, pixels):
    """A grey PNG of 16 bits, top row first (ISO/IEC 15948)."""
    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
    height, width = pixels.shape
    rows = b"".join(b"\0" + row.astype(">u2").tobytes() for row in pixels)
    with open(path, "wb") as file:
        file.write(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 16, 0, 0, 0, 0)) +
                   chunk(b"IDAT", zlib.compress(rows, 1)) + chunk(b"IEND", b""))


def write_tiff(path, frames, order="<"):
    """A TIFF file of 16 bits with a page for each frame, without compression; order: < or > (TIFF 6.0)."""
    out, link = bytearray((b"II" if order == "<" else b"MM") + struct.pack(order + "HI", 42, 0)), 4
    for pixels in frames:
        height, width = pixels.shape
        strip, data = len(out), pixels.astype(order + "u2").tobytes()
        out += data
        out[link:link + 4] = struct.pack(order + "I", len(out))
        tags = ((256, 4, width), (257, 4, height), (258, 3, 16), (259, 3, 1), (262, 3, 1), (273, 4, strip),
                (277, 3, 1), (278, 4, height), (279, 4, len(data)))
        out += struct.pack(order + "H", len(tags))
        for tag, kind, value in tags:
            out += struct.pack(order + "HHI", tag, kind, 1)
            out += struct.pack(order + "HH", value, 0) if kind == 3 else struct.pack(order + "I", value)
        link = len(out)
        out += struct.pack(order + "I", 0)
    with open(path, "wb") as file:
        file.write(out)


def write_table(path, hdus, name, **more):
    """A side table for the map `table` with what the headers of Boresight's frames say.

    name(i): path of the picture of frame i; more: columns, each a function of i or a value.
    """
    keys = {"time_utc": "DATE-OBS", "exposure_s": "EXPTIME", "gain_e_per_dn": "GAIN", "read_noise_e": "RDNOISE",
            "offset_dn": "OFFSET", "pixel_scale_arcsec": "PIXSCALE", "exposure_id": "FRAMEID"}
    for axis in "xyz":
        keys[f"observer_{axis}_m"] = "OBSPOS" + axis.upper()
        keys[f"observer_v{axis}_mps"] = "OBSVEL" + axis.upper()
    with open(path, "w", encoding="utf-8", newline="") as file:
        out = csv.writer(file)
        out.writerow(["file", *keys, *more])
        for i, hdu in enumerate(hdus):
            out.writerow([name(i), *(hdu.header[key] for key in keys.values()),
                          *(value(i) if callable(value) else value for value in more.values())])
