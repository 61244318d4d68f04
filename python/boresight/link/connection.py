"""The connection of a peer to a simulation."""
from __future__ import annotations

import time
from typing import Any, Dict, Iterator, List, Optional, Tuple

import numpy as np
import numpy.typing as npt
import zmq

from .errors import LinkError, LinkTimeout
from .keys import read_keys
from .packet import Message, decode, encode, new_record
from .shared_frames import SharedFrames
from .step import Part, Step


class Link:
    """A connection to a simulation, which may start later. `serves`: parts as in `hello`;
    `keys_file`: made by `boresight link-keys`, if the run requires keys."""

    def __init__(self, address: str, serves: str = "*", name: str = "python",
                 shared_memory: bool = False, timeout_s: float = 60.0, check_pixels: bool = True,
                 keys_file: Optional[str] = None):
        self.timeout_s, self.check_pixels = timeout_s, check_pixels
        self.welcome: Optional[Message] = None
        self.parts: Dict[str, Part] = {}
        self.end: Optional[Message] = None  # why the run has ended
        self.tick_rate_hz = 1
        self._hello = new_record("hello")
        self._hello["name"], self._hello["serves"] = name, serves
        self._hello["shared_memory"] = shared_memory
        self._sequence = 0
        self._inputs: List[Message] = []
        self._shared: Optional[SharedFrames] = None
        self._telemetry: Dict[str, Tuple[npt.NDArray[Any], npt.NDArray[Any]]] = {}
        self._latest: Dict[Tuple[str, str], Message] = {}
        self._last: Optional[Step] = None
        context: Any = zmq.Context.instance()
        self._socket = context.socket(zmq.DEALER)
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

    def attitude_at(self, part: Part, tick: float) -> npt.NDArray[np.float64]:
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
        return np.asarray(mixed / np.linalg.norm(mixed), np.float64)

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
                self.answer(last)
                continue
            step = Step(self, self.parts[header["instance"]], header, inputs)
            self._last = step
            yield step
            step.done()

    # -- inside

    def _send(self, kind: str, record: npt.NDArray[np.void],
              items: Optional[npt.NDArray[np.void]] = None,
              **members: Any) -> None:
        self._socket.send_multipart(encode(kind, self._sequence, record, items, **members))
        self._sequence += 1

    def answer(self, step: Step) -> None:
        """Sends the outputs of a step, then `done`."""
        about = {name: step.header[name] for name in ("tick", "step", "instance")}
        for kind, (record, items) in step.sent.items():
            self._send(kind, record, items, **about)
        done = new_record("done")
        done["outputs"] = len(step.sent)
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
                      for item in message.rows}
        name = message["shared_memory"].decode()
        if name:
            self._shared = SharedFrames(name, int(message["slots"]), int(message["slot_bytes"]))

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
                np.concatenate([ticks, message.rows["tick"]])[-keep:],
                np.concatenate([q, message.rows["q_cam_from_gcrf"]])[-keep:])
