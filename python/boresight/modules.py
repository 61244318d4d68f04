"""Modules in Python inside the process, as C plug-ins have them: what their steps get and give."""
from __future__ import annotations

import ctypes
import hashlib
from ctypes import byref, c_int, c_void_p
from typing import Any, Callable, Dict, List, NamedTuple, Optional, Sequence, Tuple

import numpy as np
import numpy.typing as npt

from . import commands
from ._native import LIBRARY, Context
from ._structs import FrameHandle, Sample, SimFrame
from .camera import Camera, camera_of
from .errors import ArgumentError, ClosedError, StateError
from .frame import Frame, LentCount, take_pixels
from .messages import CHANNELS, Detections, FrameMessage, PointingTelemetry, Tracks
from .payload import message_at
from .record import Message, packed
from .views import ChannelViews

_TICKS = ("predictions", "los_command", "control_status", "task")  # with a tick of validity


class Port(NamedTuple):
    """A channel that a module reads or writes (bst_port).

    trigger: it steps whenever a new message becomes visible; optional: there may be no writer;
    feedback: the input closes a loop; max_age_s: an older message counts as none, 0: any age
    """
    channel: str
    output: bool = False
    trigger: bool = False
    optional: bool = False
    feedback: bool = False
    max_age_s: float = 0.0
    capacity: int = 0


class ModuleEnv:
    """What a module's class is created with: names, clock, and the onboard camera.

    instance: "observer/sensor/module"; scope: "observer/sensor", "" of a module for all sensors;
    period_s: of its steps, 0: triggers only; frame_exposure_s, frame_period_s: of the sensor's
    frames; frame_latency_s: from the end of an exposure until control has its tracks; sensors:
    names "observer/sensor" of all sensors, of a module for all sensors
    """

    def __init__(self, env: Any, camera: Optional[int]):
        self.instance: str = env.instance.decode()
        self.scope = self.instance.rpartition("/")[0]
        self.tick_rate_hz = int(env.tick_rate_hz)
        self.period_s = env.period_ticks / env.tick_rate_hz
        self.seed, self.run = int(env.seed), int(env.run)
        self.frame_exposure_s = float(env.frame_exposure_s)
        self.frame_period_s = float(env.frame_period_s)
        self.frame_latency_s = float(env.frame_latency_s)
        self.sensors: Tuple[str, ...] = tuple(env.members[i].scope.decode()
                                              for i in range(env.member_count))
        self._camera = camera
        self.camera: Optional[Camera] = None
        if camera:
            from ._structs import CameraHead
            self.camera = camera_of(CameraHead.from_address(camera))

    def directions_cam(self, x_px: Any, y_px: Any) -> npt.NDArray[np.float64]:
        """Unit directions [n, 3] in the camera frame that fall on points of the sensor, by the
        onboard camera model with its distortion.

        Given:     x_px, y_px  [n] full-sensor pixel coordinates
        """
        try:
            x, y = (np.ascontiguousarray(np.atleast_1d(v), np.float64) for v in (x_px, y_px))
        except (TypeError, ValueError):
            raise ArgumentError("directions_cam takes pixel coordinates") from None
        if x.ndim != 1 or x.shape != y.shape:
            raise ArgumentError(f"directions_cam takes x_px [n] and y_px [n], found {x.shape} and "
                                f"{y.shape}")
        if not np.all(np.isfinite(x)) or not np.all(np.isfinite(y)):
            raise ArgumentError("directions_cam: a pixel coordinate is not finite")
        if not self._camera:
            raise ClosedError("the camera is that of a simulation that has ended, or of no single "
                              "sensor")
        out = np.empty((len(x), 3))
        LIBRARY.bst_camera_unproject_points(self._camera, x.ctypes.data, y.ctypes.data, len(x),
                                            out.ctypes.data)
        return out

    def directions_gcrf(self, x_px: Any, y_px: Any,
                        q_cam_from_gcrf: Any) -> npt.NDArray[np.float64]:
        """Apparent unit directions [n, 3] in GCRF of points of the sensor, by an attitude of the
        camera (x, y, z, w), as `q_cam_from_gcrf` of detections."""
        try:
            q = np.asarray(q_cam_from_gcrf, np.float64)
        except (TypeError, ValueError):
            raise ArgumentError("an attitude is a unit quaternion (x, y, z, w)") from None
        if q.shape != (4,) or not abs(float(np.dot(q, q)) - 1.0) < 1e-6:
            raise ArgumentError(f"an attitude is a unit quaternion (x, y, z, w), found {q}")
        v, u = self.directions_cam(x_px, y_px), -q[:3]  # the inverse rotation
        return np.asarray(v + 2.0 * np.cross(u, np.cross(u, v) + q[3] * v))

    def rng(self, stream: str = "") -> np.random.Generator:
        """Random numbers that repeat with the seed and the number of the run, of this instance
        alone. Keep the generator as an attribute, so that it is saved."""
        digest = hashlib.sha256(f"{self.instance}\n{stream}".encode()).digest()
        return np.random.default_rng([self.seed, self.run, int.from_bytes(digest[:8], "little")])

    def close(self) -> None:
        """Ends the use of the camera, which belongs to the simulation."""
        self._camera = None

    def __reduce__(self) -> Any:
        raise TypeError("a ModuleEnv belongs to its simulation: keep it, or what is needed of it, "
                        "as an attribute of its own")


class Inputs(ChannelViews):
    """The channels of one sensor for one step of a module: newest messages as attributes; outputs
    are assigned. None: there is no message, or none that is fresh enough.

    Errors:    NotFoundError, ArgumentError: the module does not read or write the channel
    """

    __slots__ = ("_step", "_reads", "_writes", "_base", "_unread", "scope", "_info")
    _step: "ModuleStep"

    def __init__(self, step: "ModuleStep", info: "StepInfo", member: int):
        self._step, self._info, self.scope = step, info, info.scopes[member]
        self._reads, self._writes = info.reads, info.writes
        self._base = member * len(info.ports)
        self._unread: Dict[str, List[Sample]] = {}
        for channel in info.queues:
            samples = self._unread[channel] = []
            while True:
                sample = LIBRARY.bst_step_next(step.pointer, self._base + info.reads[channel])
                if not sample.payload:
                    break
                samples.append(sample)

    def view(self, channel: str) -> Optional[Message]:
        """Newest message of an input; None: there is none, or none that is fresh enough."""
        sample = self._newest(channel)
        if sample is None:
            return None
        return message_at(channel, sample.payload, self.scope, sample.written_tick,
                          sample.sequence)

    def unread(self, channel: str) -> List[Message]:
        """Messages of a queue that came since the step before, oldest first."""
        self._port(channel)
        return [message_at(channel, s.payload, self.scope, s.written_tick, s.sequence)
                for s in self._unread.get(channel, ())]

    def _port(self, channel: str) -> int:
        self._step.check_running()
        port = self._reads.get(channel)
        if port is None:
            raise ArgumentError(f"the module does not read {channel!r} (it reads: "
                                f"{', '.join(self._reads)}); add a Port to its `ports`")
        return self._base + port

    def _newest(self, channel: str) -> Optional[Sample]:
        port = self._port(channel)
        sample: Sample = LIBRARY.bst_step_latest(self._step.pointer, port)
        return sample if sample.payload and not sample.stale else None

    def view_frame(self) -> Optional[Frame]:
        """Newest frame; its pixels are not copied, and stay valid as long as they are referred
        to."""
        sample = self._newest("frame")
        if sample is None:
            return None
        message = message_at("frame", sample.payload, self.scope, sample.written_tick,
                             sample.sequence)
        assert isinstance(message, FrameMessage)
        data = self._step.info.pixels(sample.payload, message)
        return Frame(data, message, self.scope, self._step.tick_rate_hz)

    # ---- outputs

    def command(self, channel: str, value: Any) -> None:
        """Writes an output: a message, its items or its members, as Simulation.command takes them.
        A tick of validity of 0 becomes the present one; detections and tracks that name no exposure
        are those of the newest frame."""
        self._step.check_running()
        port = self._writes.get(channel)
        if port is None:
            raise ArgumentError(f"the module does not write {channel!r} (it writes: "
                                f"{', '.join(self._writes)})")
        if channel == "los_command" and isinstance(value, (np.ndarray, list, tuple)):
            message: Message = commands.los_command(value, tick=self._step.tick)
        else:
            message = self._completed(commands.command_message(channel, value,
                                                               self._info.outputs))
        capacity = c_int()
        payload = LIBRARY.bst_step_write(self._step.pointer, self._base + port, byref(capacity))
        _store(message, payload, capacity.value)

    def _completed(self, message: Message) -> Message:
        if message.channel in _TICKS and not int(message.array["tick"]):
            message = message.replace(tick=self._step.tick)
        elif isinstance(message, Detections):
            frame = self.view("frame") if "frame" in self._reads else None
            telemetry = (self.view("pointing_telemetry") if "pointing_telemetry" in self._reads
                         else None)
            assert telemetry is None or isinstance(telemetry, PointingTelemetry)
            message = commands.complete_detections(message, frame, telemetry)
        elif isinstance(message, Tracks) and "detections" in self._reads and not message.tick:
            newest = self.view("detections")
            if isinstance(newest, Detections):
                message = message.replace(exposure_id=newest.exposure_id,
                                          tick=(newest.start_tick + newest.end_tick) // 2)
        return message


def _store(message: Message, payload: int, capacity: int) -> None:
    """Writes a message into the memory of an output."""
    header, items = message.array, message.items
    if message.item_dtype is not None:
        header = np.array(header)
        header["count"] = min(len(items), capacity)
        if len(items) > capacity and "lost" in (header.dtype.names or ()):
            header["lost"] += len(items) - capacity
        items = items[:capacity]
    data = packed(header)
    ctypes.memmove(payload, data, len(data))
    if len(items):
        body = packed(items)
        ctypes.memmove(payload + len(data), body, len(body))


class ModuleStep(Inputs):
    """One step of a module; valid during its call.

    tick, time_s: of the step, since the scenario's epoch
    """

    __slots__ = ("pointer", "tick", "time_s", "tick_rate_hz", "info", "_sensors")
    tick: int
    time_s: float
    tick_rate_hz: int

    def __init__(self, pointer: int, info: "StepInfo"):
        self.pointer: Optional[int] = pointer
        self.info, self.tick_rate_hz = info, info.tick_rate_hz
        self.tick = int(LIBRARY.bst_step_tick(pointer))
        self.time_s = self.tick / info.tick_rate_hz
        self._sensors: Optional[Dict[str, Inputs]] = None
        super().__init__(self, info, 0)

    @property
    def sensors(self) -> Dict[str, Inputs]:
        """Channels of each sensor, of a module for all sensors ("tasking")."""
        self.check_running()
        if self._sensors is None:
            scopes = self.info.scopes
            self._sensors = {scope: Inputs(self, self.info, k) if k else self
                             for k, scope in enumerate(scopes)}
        return self._sensors

    def event(self, kind: str, text: str) -> None:
        """Records an event: a short fixed word, and a text of at most 399 bytes."""
        self.check_running()
        LIBRARY.bst_step_event(self.pointer, _text(kind, "kind"), b"%s", _text(text, "text"))

    def count(self, name: str) -> None:
        """Counts a condition of the data for the summary of the run."""
        self.check_running()
        LIBRARY.bst_step_count(self.pointer, _text(name, "name"))

    def check_running(self) -> None:
        """A step that has ended has no messages any more."""
        if self.pointer is None:
            raise StateError("the step has ended: it is valid during its call only; keep its "
                             "messages instead, which are copies")

    def give(self, value: Any) -> None:
        """Writes what the module's function returned: messages, or a mapping of channels."""
        if value is None:
            return
        if isinstance(value, Message):
            self.command(value.channel, value)
        elif isinstance(value, dict) and value and all(k in self.info.scopes for k in value):
            for scope, one in value.items():
                if not isinstance(one, Message):
                    raise ArgumentError(f"{scope}: a message is expected, not "
                                        f"{type(one).__name__}")
                self.sensors[scope].command(one.channel, one)
        elif isinstance(value, dict):
            for channel, one in value.items():
                self.command(channel, one)
        elif isinstance(value, (list, tuple)) and all(isinstance(v, Message) for v in value):
            for one in value:
                self.command(one.channel, one)
        else:
            raise ArgumentError("a module returns None, a message, a sequence of messages, or a "
                                f"mapping of channels, not {type(value).__name__}")


def _text(value: Any, what: str) -> bytes:
    from ._native import text_argument
    text = text_argument(value, what)
    assert text is not None
    return text


class StepInfo:
    """What the steps of a module instance share."""

    def __init__(self, ports: Sequence[Port], env: ModuleEnv, owner: Callable[[], Any]):
        self.ports, self.owner = ports, owner
        self.tick_rate_hz = env.tick_rate_hz
        self.scopes = env.sensors or (env.scope,)
        self.reads = {p.channel: k for k, p in enumerate(ports) if not p.output}
        self.writes = {p.channel: k for k, p in enumerate(ports) if p.output}
        self.outputs = {channel: CHANNELS[channel] for channel in self.writes}
        self.queues = [c for c in self.reads if LIBRARY.bst_channel_type_find(c.encode())[0].kind]
        self.context, self.lent = Context(), LentCount()

    def pixels(self, payload: int, message: FrameMessage) -> npt.NDArray[np.uint16]:
        """Pixels of a frame message of C."""
        handle = FrameHandle.from_address(int(message.array["frame"]))
        pointer = c_void_p()
        self.context.check(handle.ops[0].map(handle.owner, self.context.pointer, byref(pointer)))
        view = SimFrame(payload, pointer, handle.width, handle.height)
        owner = self.owner()
        data = take_pixels(self.context, view, owner and owner.owned, self.lent)
        if owner is None:  # in a command of the program, which keeps nothing for longer
            data = data.copy()
            data.setflags(write=False)
        return data
