"""A peer of Boresight's packet link, and a reader of run folders; it requires NumPy and PyZMQ.

A peer program replaces a part of a simulation (image processing, tracker or control)::

    import boresight_link

    with boresight_link.Link("tcp://127.0.0.1:5555", serves="imgproc") as link:
        for step in link.steps():
            bright = step.frame.pixels > 5000               # uint16 [height, width], not a copy
            y, x = bright.nonzero()
            step.send_detections(x_px=x, y_px=y, flux_e=1000.0, snr=10.0)

while the simulation runs in another process, started before or after::

    boresight run SCENARIO.json --link tcp://127.0.0.1:5555 --external imgproc

`Link.steps` waits for each step of the part. It ends the step when the next one is requested; the simulation waits
in between. docs/reference/icd.md defines the messages: here each is a NumPy record with the names from there.
`read_run` opens the folder of a run.

The simulation checks every message. If it rejects one, `LinkError` is raised here.
"""
from __future__ import annotations

import json
import mmap
import os
import sqlite3
import time
from dataclasses import dataclass, field
from typing import Any, Iterator, Optional

import numpy as np
import zmq

VERSION = 3
PIXELS_AT = 4096  # of a slot in shared memory

# Members of each message's record, then of its items: name:type, x for an array. A test compares
# them with docs/reference/icd.md.
_TABLES = {
    "hello": (
        "name:S64 serves:S256 shared_memory:i4",
    ),
    "welcome": (
        "scenario:S64 epoch_utc:S40 tick_rate_hz:i8 duration_ticks:i8 timeout_s:f8 "
        "shared_memory:S64 slot_bytes:i8 slots:i4 count:i4",
        "instance:S160 role:S32 width_px:i4 height_px:i4 bits:i4 pixel_scale_rad:f8 "
        "boresight_px:f8x2 psf_fwhm_px:f8 gain_e_per_dn:f8 offset_dn:f8 read_noise_e:f8 "
        "dark_e_per_s:f8 full_well_e:f8 flux_v0_e_per_s:f8 exposure_s:f8 period_s:f8 "
        "period_ticks:i8",
    ),
    "step": (
        "inputs:i4 attempt:i4",
    ),
    "done": (
        "outputs:i4 busy_s:f8",
    ),
    "error": (
        "sequence:i8 fault:S32 text:S256",
    ),
    "health": (
        "state:i4 text:S256",
    ),
    "end": (
        "reason:i4 text:S256",
    ),
    "frame": (
        "exposure_id:i8 start_tick:i8 end_tick:i8 window.x0:i4 window.y0:i4 "
        "window.width:i4 window.height:i4 binning:i4 bits:i4 width:i4 height:i4",
    ),
    "truth": (
        "exposure_id:i8 start_tick:i8 end_tick:i8 dropped:i4 count:i4 lost:i4 hits:i4 "
        "q_cam_from_gcrf_mid:f8x4 q_cam_from_gcrf_mean:f8x4 observer_gcrf_m:f8x3 "
        "observer_gcrf_mps:f8x3 boresight_x_px:f8 boresight_y_px:f8 background_e:f8 "
        "dark_e:f8",
        "kind:i4 id:u4 norad:i4 flags:u4 x_start_px:f8 y_start_px:f8 x_mid_px:f8 "
        "y_mid_px:f8 x_end_px:f8 y_end_px:f8 x_chief_px:f8 y_chief_px:f8 "
        "x_centroid_px:f8 y_centroid_px:f8 ra_rad:f8 dec_rad:f8 v_mag:f8 electrons:f8 snr:f8 range_m:f8",
    ),
    "pointing_telemetry": (
        "first:i8 capacity:i4 count:i4 q_body_from_gcrf:f8x4 settled:i4 limited:i4",
        "tick:i8 q_cam_from_gcrf:f8x4 axis_rad:f8x2",
    ),
    "nav_telemetry": (
        "tick:i8 position_gcrf_m:f8x3 velocity_gcrf_mps:f8x3 velocity_bary_mps:f8x3 "
        "sun_m:f8x3 moon_m:f8x3",
    ),
    "mount_status": (
        "tick:i8 axes:i4 wheels_saturated:i4 q_body_from_cam_at_zero:f8x4 "
        "q_body_from_gcrf:f8x4 rate_body_radps:f8x3 axis[0].axis_body:f8x3 "
        "axis[0].angle_rad:f8 axis[0].rate_radps:f8 axis[0].rate_limit_radps:f8 "
        "axis[0].accel_limit_radps2:f8 axis[0].min_rad:f8 axis[0].max_rad:f8 "
        "axis[0].redundant:i4 axis[0].flags:u4 axis[1].axis_body:f8x3 "
        "axis[1].angle_rad:f8 axis[1].rate_radps:f8 axis[1].rate_limit_radps:f8 "
        "axis[1].accel_limit_radps2:f8 axis[1].min_rad:f8 axis[1].max_rad:f8 "
        "axis[1].redundant:i4 axis[1].flags:u4 axis[2].axis_body:f8x3 "
        "axis[2].angle_rad:f8 axis[2].rate_radps:f8 axis[2].rate_limit_radps:f8 "
        "axis[2].accel_limit_radps2:f8 axis[2].min_rad:f8 axis[2].max_rad:f8 "
        "axis[2].redundant:i4 axis[2].flags:u4 roll.axis_body:f8x3 roll.angle_rad:f8 "
        "roll.rate_radps:f8 roll.rate_limit_radps:f8 roll.accel_limit_radps2:f8",
    ),
    "detections": (
        "exposure_id:i8 start_tick:i8 end_tick:i8 q_cam_from_gcrf:f8x4 "
        "q_telemetry_from_gcrf:f8x4 background_e:f8 noise_e:f8 threshold_snr:f8 "
        "zero_point_mag:f8 zero_point_sigma_mag:f8 zero_point_stars:i4 "
        "stars_identified:i4 windows:i4 count:i4 lost:i4 bad_pixels:i4",
        "x_px:f8 y_px:f8 cov_xx:f8 cov_xy:f8 cov_yy:f8 flux_e:f8 flux_sigma_e:f8 snr:f8 "
        "length_px:f8 width_px:f8 angle_rad:f8 v_mag:f8 v_mag_sigma:f8 flags:u4 "
        "star_id:u4 label:i4 label_probability:f8 rate_x_pxps:f8 rate_y_pxps:f8 "
        "rate_sigma_pxps:f8",
    ),
    "predictions": (
        "tick:i8 attitude_valid:i4 count:i4 lost:i4 attitude_error_cam_rad:f8x3 "
        "attitude_error_rate_cam_radps:f8x3",
        "track_id:i8 direction_gcrf:f8x3 rate_gcrf_radps:f8x3 sigma_rad:f8 "
        "target_of_interest:i4",
    ),
    "tracks": (
        "exposure_id:i8 tick:i8 attitude.valid:i4 attitude.stars:i4 attitude.tick:i8 "
        "attitude.q_cam_from_gcrf:f8x4 attitude.error_cam_rad:f8x3 "
        "attitude.sigma_rad:f8x3 attitude.rms_px:f8 attitude.shared:f8 "
        "target_id:i8 at_rest:i4 count:i4 "
        "lost:i4",
        "id:i8 status:i4 target_of_interest:i4 direction_gcrf:f8x3 rate_gcrf_radps:f8x3 "
        "covariance:f8x16 v_mag:f8 snr:f8 score:f8 hits:i4 misses_in_row:i4 first_tick:i8 "
        "last_update_tick:i8 x_px:f8 y_px:f8 uncorrelated:i4 hidden:i4",
    ),
    "los_command": (
        "tick:i8 direction_gcrf:f8x3 rate_gcrf_radps:f8x3 accel_gcrf_radps2:f8x3 "
        "near_given:i4 near_rad:f8x3 near_radps:f8x3 roll_given:i4 roll_rad:f8",
    ),
    "sensor_command": (
        "exposure_s:f8 period_s:f8 window.x0:i4 window.y0:i4 window.width:i4 "
        "window.height:i4 binning:i4 pixel_scale_arcsec:f8",
    ),
    "control_status": (
        "tick:i8 mode:i4 target_id:i8 search_step:i4 aim_error_px:f8x2",
    ),
    "pointing": (
        "count:i4",
        "tick:i8 q_cam_from_gcrf:f8x4",
    ),
    "target_states": (
        "count:i4",
        "object:S64 tick:i8 position_gcrf_m:f8x3 velocity_gcrf_mps:f8x3",
    ),
}


def _dtype(members: str) -> np.dtype:
    """Packed, little-endian, padded to a multiple of 8 bytes."""
    names, formats, offsets, end = [], [], [], 0
    for member in members.split():
        name, kind = member.split(":")
        kind, _, count = kind.partition("x")
        one = np.dtype((kind if kind[0] == "S" else "<" + kind, (int(count),) if count else ()))
        names.append(name)
        formats.append(one)
        offsets.append(end)
        end += one.itemsize
    return np.dtype({"names": names, "formats": formats, "offsets": offsets,
                     "itemsize": (end + 7) // 8 * 8})


RECORDS = {name: _dtype(tables[0]) for name, tables in _TABLES.items()}
ITEMS = {name: _dtype(tables[1]) for name, tables in _TABLES.items() if len(tables) > 1}

LABELS = {"unknown": 0, "star": 1, "object": 2, "artefact": 3, "hot_pixel": 4, "hit": 5}
MODES = {name: number for number, name in enumerate(
    ("idle", "slew", "search", "acquire", "track", "reacquire", "stare", "rate", "coast", "fixed",
     "scan"))}


class LinkError(Exception):
    """The simulation has rejected a message, or a received message is invalid."""


class LinkTimeout(LinkError):
    """Time-out: no message was received."""


# ---------------------------------------------------------------------------- CRC-32C

def _byte_table() -> np.ndarray:
    crc = np.arange(256, dtype=np.uint32)
    for _ in range(8):
        crc = np.where(crc & 1, (crc >> 1) ^ np.uint32(0x82F63B78), crc >> 1).astype(np.uint32)
    return crc


_BYTE = _byte_table()
_BYTE_LIST = [int(x) for x in _BYTE]
_WORD = (_BYTE[(_BYTE[np.arange(65536) & 255] ^ (np.arange(65536) >> 8)) & 255] ^
         (_BYTE[np.arange(65536) & 255] >> 8)).astype(np.uint32)


def _multiply(a: int, b: int) -> int:
    """Product of two polynomials modulo the CRC polynomial; bit 31 is the coefficient of x^0."""
    product = 0
    for bit in range(31, -1, -1):
        if a >> bit & 1:
            product ^= b
        b = (b >> 1) ^ (0x82F63B78 if b & 1 else 0)
    return product


def _zeros(count: int) -> int:
    """Effect of `count` zero bytes on the CRC register: x^(8 count)."""
    power, square = 0x80000000, 0x00800000
    while count:
        if count & 1:
            power = _multiply(power, square)
        square = _multiply(square, square)
        count >>= 1
    return power


def crc32c(data: Any) -> int:
    """CRC-32C (RFC 3720) of bytes or any buffer: b"123456789" gives 0xE3069283."""
    data = np.frombuffer(data, np.uint8)
    crc, start = 0xFFFFFFFF, 0
    if data.size >= 2048:
        # parallel lanes with one register each, then combined pairwise
        lanes = 1 << max(4, (data.size.bit_length() - 1) // 2)
        length = data.size // lanes // 2 * 2
        start = lanes * length
        words = np.ascontiguousarray(data[:start].reshape(lanes, length).view("<u2").T)
        register = np.zeros(lanes, np.uint32)
        register[0] = 0xFFFFFFFF
        for row in words:
            register = _WORD[(register ^ row) & 0xFFFF] ^ (register >> 16)
        shift = _zeros(length)
        while register.size > 1:
            left, moved, power = register[0::2], np.zeros(register.size // 2, np.uint32), shift
            for bit in range(31, -1, -1):
                moved ^= np.where(left >> np.uint32(bit) & 1, np.uint32(power), np.uint32(0))
                power = (power >> 1) ^ (0x82F63B78 if power & 1 else 0)
            register = moved ^ register[1::2]
            shift = _multiply(shift, shift)
        crc = int(register[0])
    for byte in data[start:].tolist():
        crc = _BYTE_LIST[(crc ^ byte) & 255] ^ (crc >> 8)
    return crc ^ 0xFFFFFFFF


# ---------------------------------------------------------------------------- messages

@dataclass
class Message:
    """A received message. `record` and `items` are read-only views of its bytes."""
    header: dict
    record: np.void
    items: Optional[np.ndarray] = None
    pixels: Optional[np.ndarray] = None  # of a frame: uint16 [height, width], not a copy

    @property
    def type(self) -> str:
        return self.header["type"]

    def __getitem__(self, name: str) -> Any:
        """A member of the record."""
        return self.record[name]


def new_record(kind: str) -> np.ndarray:
    """A zeroed record (an array without dimensions), to be filled: r["tick"] = 5."""
    return np.zeros((), RECORDS[kind])


def new_items(kind: str, count: int) -> np.ndarray:
    """`count` zeroed items, to be filled: items["x_px"] = ..."""
    return np.zeros(count, ITEMS[kind])


def encode(kind: str, sequence: int, record: np.ndarray, items: Optional[np.ndarray] = None,
           **members: Any) -> list[bytes]:
    """The parts of a message; `members`: further header members: tick, step, instance."""
    if items is not None:
        record = record.copy()
        record["count"] = len(items)
    payload = record.tobytes() + (items.tobytes() if items is not None else b"")
    header = {"version": VERSION, "type": kind, "tick": 0, "sequence": sequence, **members,
              "lengths": [len(payload)], "crcs": ["%08x" % crc32c(payload)]}
    text = (json.dumps(header)[:-1] + ",").encode("ascii")
    return [text + b'"crc32c":"%08x"}' % crc32c(text), payload]


def decode(parts: list[Any], check: bool = True) -> Message:
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


class _SharedFrames:
    """The ring of frames in /dev/shm, for reading."""

    def __init__(self, name: str, slots: int, slot_bytes: int):
        if "/" in name[1:] or not name.startswith("/boresight-"):
            raise LinkError(f"shared memory of another name: {name}")
        with open("/dev/shm" + name, "rb") as file:
            self._memory = mmap.mmap(file.fileno(), 0, prot=mmap.PROT_READ)
        self._slots, self._slot_bytes = slots, slot_bytes
        if len(self._memory) < slots * slot_bytes:
            raise LinkError("the shared memory is shorter than the simulation says")

    def pixels(self, number: int, height: int, width: int) -> np.ndarray:
        """Pixels of message `number`, valid until the step is answered."""
        at = number % self._slots * self._slot_bytes
        lies, length = np.frombuffer(self._memory, "<i8", 2, at)
        if lies != number or length != 2 * height * width:
            raise LinkError("a frame is not in the shared memory any more")
        return np.frombuffer(self._memory, "<u2", height * width,
                             at + PIXELS_AT).reshape(height, width)


# ---------------------------------------------------------------------------- steps

@dataclass
class Part:
    """A part that this peer plays, with the onboard knowledge of its sensor."""
    instance: str
    role: str
    record: np.void

    def __getitem__(self, name: str) -> Any:
        """A member of `welcome`: width_px, pixel_scale_rad, gain_e_per_dn, ..."""
        return self.record[name]


@dataclass
class Step:
    """A step of a part: its inputs, and the answer to it."""
    link: "Link"
    part: Part
    header: dict
    inputs: list[Message] = field(default_factory=list)
    _sent: dict = field(default_factory=dict)
    _done: bool = False

    @property
    def tick(self) -> int:
        return self.header["tick"]

    @property
    def seconds(self) -> float:
        """Time since the start of the run, s."""
        return self.tick / self.link.tick_rate_hz

    def get(self, kind: str) -> Optional[Message]:
        """The newest input of a type in this step, or None."""
        return next((m for m in reversed(self.inputs) if m.type == kind), None)

    @property
    def frame(self) -> Optional[Message]:
        return self.get("frame")

    def send(self, kind: str, record: np.ndarray, items: Optional[np.ndarray] = None) -> None:
        """Answers with a message, at most one of each type (see new_record and new_items)."""
        if self._done or kind in self._sent:
            raise LinkError(f"a step takes one {kind}, before it is done")
        self._sent[kind] = (record, items)

    def send_detections(self, x_px: Any, y_px: Any, **columns: Any) -> None:
        """Detections in the frame of this step: full-sensor pixels, and any other member of an item
        by name (flux_e, snr, cov_xx, label, ...), each a number or an array. cov_xx and cov_yy are
        0.01 px^2 by default."""
        frame = self.frame
        if frame is None:
            raise LinkError("there is no frame in this step")
        x_px = np.atleast_1d(np.asarray(x_px, float))
        items, record = new_items("detections", len(x_px)), new_record("detections")
        items["cov_xx"] = items["cov_yy"] = 0.01
        for name, values in {"x_px": x_px, "y_px": y_px, **columns}.items():
            items[name] = values
        for name in ("exposure_id", "start_tick", "end_tick"):
            record[name] = frame[name]
        q = self.link.attitude_at(self.part, (frame["start_tick"] + frame["end_tick"]) / 2)
        record["q_cam_from_gcrf"] = record["q_telemetry_from_gcrf"] = q
        self.send("detections", record, items)

    def send_command(self, direction_gcrf: Any, rate_gcrf_radps: Any = (0.0, 0.0, 0.0),
                     tick: Optional[int] = None) -> None:
        """Commands the boresight: apparent direction (normalised) at a tick, by default this step's,
        with rate and acceleration."""
        direction = np.asarray(direction_gcrf, float)
        record = new_record("los_command")
        record["tick"] = self.tick if tick is None else tick
        record["direction_gcrf"] = direction / np.linalg.norm(direction)
        record["rate_gcrf_radps"] = rate_gcrf_radps
        self.send("los_command", record)

    def send_status(self, mode: str, target_id: int = 0) -> None:
        """Sends the mode of control, for recording and summary: one of MODES."""
        record = new_record("control_status")
        record["tick"], record["mode"], record["target_id"] = self.tick, MODES[mode], target_id
        self.send("control_status", record)

    def send_sensor(self, exposure_s: float = 0.0, period_s: float = 0.0,
                    window: tuple[int, int, int, int] = (0, 0, 0, 0), binning: int = 0,
                    pixel_scale_arcsec: float = 0.0) -> None:
        """Commands exposure settings from the next exposure on; 0: unchanged. `window`: x0, y0, width,
        height in full-sensor pixels; zeros: full sensor."""
        record = new_record("sensor_command")
        record["exposure_s"], record["period_s"], record["binning"] = exposure_s, period_s, binning
        record["pixel_scale_arcsec"] = pixel_scale_arcsec
        for name, value in zip(("x0", "y0", "width", "height"), window):
            record["window." + name] = value
        self.send("sensor_command", record)

    def send_pointing(self, ticks: Any, q_cam_from_gcrf: Any) -> None:
        """Answer of a gimbal: true attitudes (x, y, z, w), from GCRF to camera axes, at ascending ticks up to
        the next step, `period_ticks` from now; start and end, or a history."""
        ticks = np.atleast_1d(np.asarray(ticks))
        items = new_items("pointing", len(ticks))
        items["tick"], items["q_cam_from_gcrf"] = ticks, q_cam_from_gcrf
        self.send("pointing", new_record("pointing"), items)

    def send_states(self, states: Any) -> None:
        """Answer of a gimbal: states of commanded objects: (name, tick, position m, velocity m/s), GCRF.
        Two-body motion continues each state until the next one."""
        states = list(states)
        items = new_items("target_states", len(states))
        for item, (name, tick, position, velocity) in zip(items, states):
            item["object"], item["tick"] = name, tick
            item["position_gcrf_m"], item["velocity_gcrf_mps"] = position, velocity
        self.send("target_states", new_record("target_states"), items)

    def done(self) -> None:
        """Ends the step. `Link.steps` does this when the next step is requested."""
        if not self._done:
            self._done = True
            self.link._answer(self)


def read_keys(path: str) -> dict[str, bytes]:
    """The keys of a file of `boresight link-keys`, which only its owner may read."""
    with open(path, encoding="ascii") as file:
        mode = os.fstat(file.fileno()).st_mode & 0o7777
        if mode & 0o077:
            raise LinkError(f"{path}: others can read or change it (found mode {mode:04o}; allowed: "
                            "0600)")
        lines = [line.split() for line in file if line.strip() and not line.startswith("#")]
    keys = {words[0]: words[1].encode() for words in lines if len(words) == 2}
    for name in ("simulation_public", "peer_public", "peer_secret"):
        if len(keys.get(name, b"")) != 40:
            raise LinkError(f"{path}: has no line {name} with 40 characters")
    return keys


class Link:
    """A connection to a simulation, which may start later. `serves`: parts as in `hello`;
    `keys_file`: made by `boresight link-keys`, if the run requires keys."""

    def __init__(self, address: str, serves: str = "*", name: str = "python",
                 shared_memory: bool = False, timeout_s: float = 60.0, check_pixels: bool = True,
                 keys_file: Optional[str] = None):
        self.timeout_s, self.check_pixels = timeout_s, check_pixels
        self.welcome: Optional[Message] = None
        self.parts: dict[str, Part] = {}
        self.end: Optional[Message] = None  # why the run has ended
        self.tick_rate_hz = 1
        self._hello = new_record("hello")
        self._hello["name"], self._hello["serves"] = name, serves
        self._hello["shared_memory"] = shared_memory
        self._sequence, self._inputs, self._shared = 0, [], None
        self._telemetry: dict[str, tuple[np.ndarray, np.ndarray]] = {}
        self._latest: dict[tuple[str, str], Message] = {}
        self._last: Optional[Step] = None
        self._socket = zmq.Context.instance().socket(zmq.DEALER)
        self._socket.linger = 500
        if keys_file is not None:
            keys = read_keys(keys_file)
            self._socket.curve_serverkey = keys["simulation_public"]
            self._socket.curve_publickey = keys["peer_public"]
            self._socket.curve_secretkey = keys["peer_secret"]
        self._socket.connect(address)
        self._send("hello", self._hello)

    def __enter__(self) -> "Link":
        return self

    def __exit__(self, *_: Any) -> None:
        self.close()

    def close(self, why: str = "the peer has ended") -> None:
        """Disconnects; the simulation waits for another peer up to its time-out."""
        if not self._socket.closed:
            if self.end is None:
                record = new_record("end")
                record["reason"], record["text"] = 3, why
                self._send("end", record)
            self._socket.close()

    def health(self, state: int = 0, text: str = "") -> None:
        """Reports the health of a long step: 0 good, 1 degraded, 2 failed."""
        record = new_record("health")
        record["state"], record["text"] = state, text
        self._send("health", record)

    def latest(self, part: Part, kind: str) -> Optional[Message]:
        """The newest received message of a type for a part, of this step or an earlier one."""
        return self._latest.get((part.instance, kind))

    def attitude_at(self, part: Part, tick: float) -> np.ndarray:
        """The measured attitude (x, y, z, w), from GCRF to camera axes, interpolated in the received
        telemetry of a part; zeros if there is none."""
        ticks, q = self._telemetry.get(part.instance, (np.zeros(0), np.zeros((0, 4))))
        if len(ticks) == 0:
            return np.zeros(4)
        k = int(np.clip(np.searchsorted(ticks, tick), 1, max(len(ticks) - 1, 1)))
        a, b = q[k - 1], q[min(k, len(q) - 1)]
        span = float(ticks[min(k, len(q) - 1)] - ticks[k - 1])
        t = min(max((tick - ticks[k - 1]) / span, 0.0), 1.0) if span > 0 else 0.0
        mixed = (1.0 - t) * a + t * (b if np.dot(a, b) >= 0 else -b)
        return mixed / np.linalg.norm(mixed)

    def steps(self) -> Iterator[Step]:
        """The steps of the parts that this peer plays, until the run ends."""
        while True:
            message = self._receive()
            if message.type == "end":
                self.end = message
                return
            if message.type != "step":
                continue
            header, inputs, self._inputs = message.header, self._inputs, []
            last = self._last
            if last and (last.header["instance"], last.header["step"]) == (
                    header["instance"], header["step"]):
                # the connection was lost: repeat the answer to the repeated step
                last.header = header
                self._answer(last)
                continue
            step = Step(self, self.parts[header["instance"]], header, inputs)
            self._last = step
            yield step
            step.done()

    # -- inside

    def _send(self, kind: str, record: np.ndarray, items: Optional[np.ndarray] = None,
              **members: Any) -> None:
        self._socket.send_multipart(encode(kind, self._sequence, record, items, **members))
        self._sequence += 1

    def _answer(self, step: Step) -> None:
        about = {name: step.header[name] for name in ("tick", "step", "instance")}
        for kind, (record, items) in step._sent.items():
            self._send(kind, record, items, **about)
        done = new_record("done")
        done["outputs"] = len(step._sent)
        self._send("done", done, **about)

    def _receive(self) -> Message:
        """The next message for `steps`; others are stored or answered here."""
        end = time.monotonic() + self.timeout_s
        while True:
            left = end - time.monotonic()
            if left <= 0 or not self._socket.poll(int(1e3 * left) + 1):
                raise LinkTimeout(f"nothing has come for {self.timeout_s:g} s")
            frames = self._socket.recv_multipart(copy=False)
            message = decode([f.buffer for f in frames], self.check_pixels)
            if message.type == "welcome":
                self._welcome(message)
            elif message.type == "error":
                self._error(message)
            elif message.type in ("step", "end"):
                return message
            else:
                self._keep(message)

    def _welcome(self, message: Message) -> None:
        self.welcome, self._inputs = message, []
        self.tick_rate_hz = int(message["tick_rate_hz"])
        self.parts = {item["instance"].decode(): Part(item["instance"].decode(),
                                                      item["role"].decode(), item)
                      for item in message.items}
        name = message["shared_memory"].decode()
        if name:
            self._shared = _SharedFrames(name, int(message["slots"]), int(message["slot_bytes"]))

    def _error(self, message: Message) -> None:
        fault, text = message["fault"].decode(), message["text"].decode()
        if fault == "stranger":  # the connection was lost, or an answer was too late
            self._send("hello", self._hello)
        elif fault not in ("late", "duplicate"):
            raise LinkError(f"the simulation has refused a message: {fault}: {text}")

    def _keep(self, message: Message) -> None:
        self._inputs.append(message)
        instance = message.header.get("instance", "")
        if message.type == "frame" and "slot" in message.header:
            if self._shared is None:
                raise LinkError("a frame in a shared memory that was not announced")
            message.pixels = self._shared.pixels(message.header["slot"], int(message["height"]),
                                                 int(message["width"]))
        elif message.type != "frame":
            self._latest[instance, message.type] = message
        if message.type == "pointing_telemetry":
            ticks, q = self._telemetry.get(instance, (np.zeros(0), np.zeros((0, 4))))
            keep = int(message["capacity"])
            self._telemetry[instance] = (
                np.concatenate([ticks, message.items["tick"]])[-keep:],
                np.concatenate([q, message.items["q_cam_from_gcrf"]])[-keep:])


# ---------------------------------------------------------------------------- run folders

class Run:
    """The folder of a run: manifest, scenario, and tables and frames as arrays."""

    def __init__(self, folder: str):
        self.folder = folder
        self.manifest = self._json("manifest.json")
        self.scenario = self._json("scenario.json")

    def _json(self, name: str) -> dict:
        with open(os.path.join(self.folder, name), encoding="utf-8") as file:
            return json.load(file)

    def _open(self) -> sqlite3.Connection:
        path = os.path.abspath(os.path.join(self.folder, "run.sqlite"))
        return sqlite3.connect(f"file:{path}?mode=ro", uri=True)

    @property
    def tables(self) -> list[str]:
        """Names of the tables; the table "columns" describes their columns."""
        with self._open() as store:
            return [row[0] for row in store.execute(
                "SELECT name FROM sqlite_master WHERE type = 'table' ORDER BY name")]

    def table(self, name: str) -> dict[str, np.ndarray]:
        """A table by columns. Missing numbers are NaN, missing texts ''."""
        with self._open() as store:
            if name not in self.tables:
                raise KeyError(f"{self.folder} has no table {name}; there are {self.tables}")
            about = list(store.execute(f'PRAGMA table_info("{name}")'))
            rows = store.execute(f'SELECT * FROM "{name}" ORDER BY rowid').fetchall()
        columns = {}
        for index, (_, column, kind, *_rest) in enumerate(about):
            values = [row[index] for row in rows]
            if kind == "TEXT":
                columns[column] = np.array([v or "" for v in values], dtype=str)
            elif kind == "INTEGER" and None not in values:
                columns[column] = np.array(values, dtype=np.int64)
            else:
                columns[column] = np.array([np.nan if v is None else v for v in values], float)
        return columns

    def frames(self) -> Iterator[np.ndarray]:
        """The images of frames.fits in order, uint16 [height, width]; planes of a cube."""
        with open(os.path.join(self.folder, "frames.fits"), "rb") as file:
            while True:
                cards = _fits_header(file)
                if cards is None:
                    return
                axes = [int(cards[f"NAXIS{k + 1}"]) for k in range(int(cards.get("NAXIS", 0)))]
                width = abs(int(cards["BITPIX"])) // 8
                size = width * int(np.prod(axes)) if axes else 0
                size = (size + int(cards.get("PCOUNT", 0))) * int(cards.get("GCOUNT", 1))
                start = file.tell()
                if cards.get("ZIMAGE") == "T":
                    yield _compressed_image(cards, file.read(size))
                if cards.get("XTENSION", "IMAGE") == "IMAGE" and len(axes) in (2, 3) and width == 2:
                    data = np.fromfile(file, ">i2", int(np.prod(axes)))
                    image = (data.astype(np.int32) + int(float(cards.get("BZERO", 0))))
                    image = image.astype(np.uint16).reshape(axes[::-1])
                    yield from image if len(axes) == 3 else [image]
                file.seek(start + (size + 2879) // 2880 * 2880)


def _compressed_image(cards: dict[str, str], data: bytes) -> np.ndarray:
    """The 16-bit image of a compressed HDU as Boresight writes it: a Rice tile for each row."""
    wanted = {"ZCMPTYPE": "RICE_1", "ZBITPIX": "16", "TFORM1": "1PB", "ZNAXIS": "2",
              "ZTILE2": "1", "ZTILE1": cards.get("ZNAXIS1", ""), "ZNAME1": "BLOCKSIZE",
              "TFIELDS": "1", "NAXIS1": "8"}
    for key, value in wanted.items():
        if not cards.get(key, "").strip("' ").startswith(value):
            raise ValueError(f"compressed frame: {key} is {cards.get(key)}, {value} is understood; "
                             "read it with astropy")
    width, height = int(cards["ZNAXIS1"]), int(cards["ZNAXIS2"])
    rows = np.frombuffer(data, ">i4", 2 * height).reshape(height, 2).astype(np.int64)
    heap = data[int(cards.get("THEAP", 8 * height)):]
    image = _rice_decode(heap, rows[:, 1], rows[:, 0], width, int(cards["ZVAL1"]))
    return (image + np.uint16(int(float(cards.get("BZERO", 0))))).astype(np.uint16)


def _rice_decode(heap: bytes, starts: np.ndarray, sizes: np.ndarray, width: int,
                 block: int) -> np.ndarray:
    """Decodes a Rice tile of 16-bit pixels per row, all rows at once: FITS Standard 4.0, 10.4.1."""
    if np.any(starts < 0) or np.any(sizes < 2) or np.any(starts + sizes > len(heap)):
        raise ValueError("compressed frame: its rows lie outside the data")
    words = np.ndarray((len(heap) + 1,), ">u8", heap + bytes(8), strides=(1,))
    bit = 8 * starts.astype(np.int64)
    end = bit + 8 * sizes

    def window(bit: np.ndarray) -> np.ndarray:
        """At least 57 next bits of each row, left-aligned."""
        at = np.minimum(bit, end) >> 3
        return words[at].astype(np.uint64) << (bit & 7).astype(np.uint64)

    def leading(bit: np.ndarray, n: np.ndarray) -> np.ndarray:
        """The next n (0 to 16) bits of each row."""
        return ((window(bit) >> np.uint64(1)) >> (63 - n).astype(np.uint64)).astype(np.int64)

    last = leading(bit, np.full(len(bit), 16))
    bit = bit + 16
    image = np.empty((len(bit), width), np.uint16)
    for column in range(width):
        if column % block == 0:
            code = leading(bit, np.full(len(bit), 4))
            bit = bit + 4
            coded = (code > 0) & (code < 15)
            low_bits = np.where(coded, code - 1, np.where(code == 15, 16, 0))
        high = np.zeros(len(bit), np.int64)
        going = coded.copy()
        while np.any(going):
            # 53 bits are exact in a double, whose exponent counts the zeros before the first one
            top = window(bit) >> np.uint64(11)
            zeros = np.where(top > 0, 53 - np.frexp(top.astype(np.float64))[1], 53)
            high += np.where(going, zeros, 0)
            bit = bit + np.where(going, zeros + (top > 0), 0)
            going = going & (top == 0) & (bit < end)
        mapped = (high << low_bits) + leading(bit, low_bits)
        bit = bit + low_bits
        # 0, 1, 2, 3, ... encode 0, -1, 1, -2, ...
        last = last + np.where(mapped & 1, ~(mapped >> 1), mapped >> 1)
        image[:, column] = last & 0xFFFF
    if np.any(bit > end):
        raise ValueError("compressed frame: a row ends before its last pixel")
    return image


def _fits_header(file: Any) -> Optional[dict[str, str]]:
    """Keywords of the next header with their values as text; None at the end of the file."""
    cards: dict[str, str] = {}
    while True:
        block = file.read(2880)
        if len(block) < 2880:
            return None
        for at in range(0, 2880, 80):
            card = block[at:at + 80].decode("ascii", "replace")
            if card[:8].strip() == "END":
                return cards
            if card[8:10] == "= ":
                value = card[10:].strip()
                value = value[1:].split("'")[0] if value.startswith("'") else value.split("/")[0]
                cards[card[:8].strip()] = value.strip()


def read_run(folder: str) -> Run:
    """Opens the folder of a run (also of an interrupted one, FOLDER.partial)."""
    return Run(folder)
