"""Simulation: one run, step by step."""
from __future__ import annotations

import ctypes
from ctypes import byref, c_bool, c_char_p, c_int64, c_size_t, c_void_p
from typing import Any, Callable, Dict, Iterable, Iterator, List, Optional, Sequence, Tuple, Union

import numpy as np

from . import _native, _structs, commands
from ._handle import Guard, SimHandle
from ._native import LIBRARY, number_argument, text_argument
from .errors import ArgumentError, BoresightError, FormatError
from .frame import Frame, take_pixels
from .messages import Detections, FrameMessage, PointingTelemetry
from .model import Model
from .observers import Observers
from .payload import message_at, viewed
from .record import Message
from .snapshot import Snapshot, component_bits
from ._plugin import Instance, collected, forget_raised, own, raise_of
from .views import ChannelViews

BytesLike = Union[bytes, bytearray, memoryview]


class Simulation(ChannelViews):
    """One run of a scenario, in memory: step it, look at it, command it, save it, go back.

    Given:     scenario  a Scenario, a path, a dictionary, or a Model, which simulations share
               external  modules that Python plays instead ("imgproc", "tracker", "control",
                         "gimbal", or "observer/sensor/module"): assign what they give
               run       number of the run, which keys the noise; None: the scenario's
               device    OpenCL device: part of its name or its number; None: the default
               threads   of the device's processor; 0: all cores
    Errors:    ScenarioError, DeviceError, ...
    Notes:     a simulation is for one thread at a time, in the process that made it (BusyError,
               ForkError). Ctrl-C ends a running call between two steps, with KeyboardInterrupt;
               the simulation can go on. Attributes of channels are those of the first sensor that
               has the channel; `sensor` gives those of another one.

    >>> with Simulation("neossat_geo_track.json", external=["imgproc"]) as sim:
    ...     for frame in sim.frames(until_s=10):
    ...         y, x = (frame.data > 5000).nonzero()
    ...         sim.detections = {"x_px": x, "y_px": y, "flux_e": 1000.0, "snr": 10.0}
    """

    def __init__(self, scenario: Any, external: Sequence[str] = (), *, run: Optional[int] = None,
                 device: Optional[str] = None, threads: int = 0):
        if isinstance(scenario, Model):
            if external or device is not None or threads:
                raise ArgumentError("external, device and threads are those of the model: give "
                                    "them to Model(...)")
            self.model = scenario
        else:
            self.model = Model(scenario, external, device, threads)
        options = _structs.SimOptions()
        if run is not None:
            options.other_run = True
            options.run = _native.integer_argument(run, "run", 0, 2**53 - 1)
        context, out, handle = _native.Context(), c_void_p(), self.model.handle
        with collected() as plugins:
            context.check(LIBRARY.bst_sim_create(context.pointer, handle.pointer, byref(options),
                                                 byref(out)))
        self._begin(out, plugins)

    def _begin(self, pointer: c_void_p, plugins: List[Instance]) -> None:
        assert pointer.value
        handle = SimHandle(pointer.value, self.model.handle)
        own(plugins, handle)
        self._guard = Guard(handle)
        self._observers = Observers(self._guard)
        self._observers.install(handle)
        self._channels: List[Tuple[str, str]] = []
        scope = c_char_p()
        while True:
            name = LIBRARY.bst_sim_channel(handle.pointer, len(self._channels), byref(scope))
            if name is None:
                break
            self._channels.append(((scope.value or b"").decode(), name.decode()))

    # ---- life

    def __enter__(self) -> "Simulation":
        return self

    def __exit__(self, *_: Any) -> None:
        self.close()

    def close(self) -> None:
        """Ends the simulation. Messages and frames that were taken stay valid."""
        self._guard.close()

    @property
    def closed(self) -> bool:
        """True after `close`."""
        return self._guard.closed

    # ---- what there is

    @property
    def sensors(self) -> List[str]:
        """Names "observer/sensor"."""
        return self.model.sensors

    @property
    def channels(self) -> List[Tuple[str, str]]:
        """Scope and name of each channel that a module writes."""
        return list(self._channels)

    def sensor(self, scope: str) -> "Sensor":
        """Channels of one sensor, "observer/sensor"."""
        text_argument(scope, "sensor")
        if scope not in self.sensors:
            raise ArgumentError(f"there is no sensor {scope!r} (allowed: "
                                f"{', '.join(self.sensors)})")
        return Sensor(self, scope)

    @property
    def time_s(self) -> float:
        """Time that the simulation has reached, seconds since the scenario's epoch."""
        with self._guard.use() as sim:
            return float(LIBRARY.bst_sim_time_s(sim.pointer))

    @property
    def tick(self) -> int:
        """Tick that the simulation has reached."""
        with self._guard.use() as sim:
            return int(LIBRARY.bst_sim_tick(sim.pointer))

    @property
    def tick_rate_hz(self) -> int:
        """Ticks per second."""
        return self.model.tick_rate_hz

    @property
    def duration_s(self) -> float:
        """Duration of the run as the scenario sets it, s. Nothing ends there by itself."""
        return self.model.duration_s

    @property
    def run(self) -> int:
        """Number of the run, which keys the noise."""
        with self._guard.use() as sim:
            return int(LIBRARY.bst_sim_run(sim.pointer))

    @property
    def counters(self) -> Dict[str, int]:
        """Counters of the run, by name."""
        found: Dict[str, int] = {}
        count = c_int64()
        with self._guard.use() as sim:
            while True:
                name = LIBRARY.bst_sim_counter(sim.pointer, len(found), byref(count))
                if name is None or name.decode() in found:
                    return found
                found[name.decode()] = count.value

    # ---- stepping

    def run_until(self, until_s: float) -> None:
        """Steps everything that is due before a time, seconds since the scenario's epoch.

        Nothing is done if this time has been reached. The scenario's duration is no limit.
        """
        until = number_argument(until_s, "until_s")
        with self._guard.use() as sim:
            forget_raised(sim)
            with self._observers.interrupt:
                status = LIBRARY.bst_sim_run_until(self._guard.context.pointer, sim.pointer, until)
            self._finish(sim, status)

    def step(self, channel: Optional[str] = None, *, scope: Optional[str] = None,
             until_s: Optional[float] = None) -> Union[bool, Message, Frame, None]:
        """Steps until a message is published, or until a time.

        Given:     channel  "frame", "exposure", "detections", ...; None: the end of the next tick
                            at which a module steps
                   scope    "observer/sensor"; None: any sensor
                   until_s  seconds since the scenario's epoch; None: the scenario's duration
        Returned:  the message (a Frame for "frame"), None at the end; without a channel: False at
                   the end
        Notes:     the simulation stops before a module reads the message.
        """
        name = text_argument(channel, "channel", optional=True)
        where = text_argument(scope, "scope", optional=True)
        until = self.duration_s if until_s is None else number_argument(until_s, "until_s")
        arrived = c_bool()
        with self._guard.use() as sim:
            before = self._sequences(sim, channel) if channel and scope is None else {}
            forget_raised(sim)
            with self._observers.interrupt:
                status = LIBRARY.bst_sim_step(self._guard.context.pointer, sim.pointer, where,
                                              name, until, byref(arrived))
            self._finish(sim, status)
            if channel is None or not arrived.value:
                return bool(arrived.value) if channel is None else None
            for each, sequence in self._sequences(sim, channel).items() if before else ():
                scope = each if sequence != before[each] else scope
            if channel == "frame":
                return self._frame(sim, scope)
            return self._view(sim, scope, channel)

    def _sequences(self, sim: SimHandle, channel: str) -> Dict[str, int]:
        """Number of the newest message of a channel by sensor, if several sensors have it."""
        scopes = [s for s, c in self._channels if c == channel]
        found: Dict[str, int] = {}
        view = _structs.SimMessage()
        for scope in scopes if len(scopes) > 1 else ():
            self._guard.context.check(LIBRARY.bst_sim_view(
                self._guard.context.pointer, sim.pointer, scope.encode(), channel.encode(),
                byref(view)))
            found[scope] = view.sequence
        return found

    def frames(self, scope: Optional[str] = None,
               until_s: Optional[float] = None) -> Iterator[Frame]:
        """The frames of the run in order, from now until a time (None: the scenario's duration).
        What is commanded in the body of a loop is there before image processing reads the frame.
        """
        text_argument(scope, "scope", optional=True)
        until = self.duration_s if until_s is None else number_argument(until_s, "until_s")
        return self._frames(scope, until)

    def _frames(self, scope: Optional[str], until: float) -> Iterator[Frame]:
        while True:
            frame = self.step("frame", scope=scope, until_s=until)
            if not isinstance(frame, Frame):
                return
            yield frame

    # ---- messages

    def view(self, channel: str, scope: Optional[str] = None) -> Optional[Message]:
        """A copy of the newest message of a channel; None before the first one.

        Given:     scope  "observer/sensor"; None: the first sensor that has the channel
        """
        with self._guard.use() as sim:
            return self._view(sim, scope, channel)

    def _view(self, sim: SimHandle, scope: Optional[str], channel: str) -> Optional[Message]:
        view, name = _structs.SimMessage(), text_argument(channel, "channel")
        self._guard.context.check(LIBRARY.bst_sim_view(
            self._guard.context.pointer, sim.pointer, text_argument(scope, "scope", True), name,
            byref(view)))
        return viewed(channel, view, scope or self._first_scope(channel))

    def _first_scope(self, channel: str) -> str:
        return next((s for s, c in self._channels if c == channel), "")

    def view_frame(self, scope: Optional[str] = None) -> Optional[Frame]:
        """The newest frame of a sensor, without a copy; None before the first one."""
        with self._guard.use() as sim:
            return self._frame(sim, scope)

    def _frame(self, sim: SimHandle, scope: Optional[str]) -> Optional[Frame]:
        context, view = self._guard.context, _structs.SimFrame()
        context.check(LIBRARY.bst_sim_view_frame(context.pointer, sim.pointer,
                                                 text_argument(scope, "scope", True),
                                                 byref(view)))
        if not view.message:
            return None
        where = scope or self._first_scope("frame")
        data = take_pixels(context, view, sim.owned, self._guard.lent)
        message = message_at("frame", view.message, where, -1, -1)
        assert isinstance(message, FrameMessage)
        return Frame(data, message, where, self.tick_rate_hz)

    # ---- commands

    def command(self, channel: str, value: Any, scope: Optional[str] = None) -> None:
        """Gives an external module its next output, with the checks of the packet link.

        Given:     channel  "detections", "tracks", "predictions", "los_command", "sensor_command"
                            or "control_status"
                   value    the message, or its items (a structured array, a mapping of columns or
                            a sequence of records), or its members (a dictionary). A `los_command`
                            may be a direction; it holds at the present tick
                   scope    "observer/sensor"; None: the first sensor with such a module
        Errors:    NotFoundError: no external module writes the channel; ArgumentError: the message
                   names what is wrong
        Notes:     the module publishes it at its next step. Detections that name no exposure are
                   those of the newest frame.
        """
        where = text_argument(scope, "scope", optional=True)
        message = commands.command_message(channel, value)
        with self._guard.use() as sim:
            if isinstance(message, Detections):
                message = commands.complete_detections(message, *self._of_frame(sim, scope))
            elif message.channel == "los_command" and not isinstance(value, (dict, Message)):
                message = message.replace(tick=int(LIBRARY.bst_sim_tick(sim.pointer)))
            data = bytearray(message.array.tobytes())
            if message.item_dtype is not None:
                at = message.dtype.fields["count"][1]  # type: ignore[index]
                data[at:at + 4] = np.int32(len(message.items)).tobytes()
                data += message.items.tobytes()
            payload = (ctypes.c_char * len(data)).from_buffer(data)
            self._guard.context.check(LIBRARY.bst_sim_command(
                self._guard.context.pointer, sim.pointer, where, channel.encode(), payload))

    def _of_frame(self, sim: SimHandle,
                  scope: Optional[str]) -> Tuple[Optional[Message], Optional[PointingTelemetry]]:
        """Newest frame and measured attitudes of a sensor, where it has them."""
        names = {c for s, c in self._channels if scope in (None, s)}
        frame = self._view(sim, scope, "frame") if "frame" in names else None
        telemetry = (self._view(sim, scope, "pointing_telemetry")
                     if "pointing_telemetry" in names else None)
        return frame, telemetry if isinstance(telemetry, PointingTelemetry) else None

    def command_pointing(self, ticks: Any, q_cam_from_gcrf: Any,
                         scope: Optional[str] = None) -> None:
        """Gives an external gimbal the true attitude of the camera from now on.

        Given:     ticks            [n] ascending
                   q_cam_from_gcrf  [n, 4] unit quaternions (x, y, z, w), interpolated, and held
                                    after the last one
        """
        where = text_argument(scope, "scope", optional=True)
        samples = commands.pointing_samples(ticks, q_cam_from_gcrf)
        with self._guard.use() as sim:
            self._guard.context.check(LIBRARY.bst_sim_command_pointing(
                self._guard.context.pointer, sim.pointer, where, samples.ctypes.data,
                len(samples)))

    def command_state(self, name: str, time_s: float, position_gcrf_m: Any,
                      velocity_gcrf_mps: Any) -> None:
        """Sets the state of an object whose key "external_states" is true; two-body motion
        continues it.

        Given:     time_s             since the epoch; later than that of its last state
                   position_gcrf_m    [3]
                   velocity_gcrf_mps  [3]
        """
        what, time = text_argument(name, "name"), number_argument(time_s, "time_s")
        position = _structs.Vec3(*commands.vector(position_gcrf_m, "position_gcrf_m"))
        velocity = _structs.Vec3(*commands.vector(velocity_gcrf_mps, "velocity_gcrf_mps"))
        with self._guard.use() as sim:
            self._guard.context.check(LIBRARY.bst_sim_command_state(
                self._guard.context.pointer, sim.pointer, what, time, position, velocity))

    def command_attitude(self, name: str, time_s: float, q_body_from_gcrf: Any,
                         rate_body_radps: Any = (0.0, 0.0, 0.0)) -> None:
        """Sets the attitude of an object with a shape whose key "external_states" is true; it turns
        at a constant rate until the next command.

        Given:     time_s            since the epoch; later than that of its last attitude
                   q_body_from_gcrf  [4] x, y, z, w
                   rate_body_radps   [3] body frame
        """
        what, time = text_argument(name, "name"), number_argument(time_s, "time_s")
        attitude = _structs.Quat(*commands.quaternion(q_body_from_gcrf, "q_body_from_gcrf"))
        rate = _structs.Vec3(*commands.vector(rate_body_radps, "rate_body_radps"))
        with self._guard.use() as sim:
            self._guard.context.check(LIBRARY.bst_sim_command_attitude(
                self._guard.context.pointer, sim.pointer, what, time, attitude, rate))

    # ---- saved states

    def save(self) -> Snapshot:
        """Saves the state. The simulation goes on as if it had not been saved."""
        data, size = c_void_p(), c_size_t()
        with self._guard.use() as sim:
            self._finish(sim, LIBRARY.bst_sim_save(self._guard.context.pointer, sim.pointer,
                                                   byref(data), byref(size)))
        try:
            return Snapshot(ctypes.string_at(data, size.value))
        finally:
            LIBRARY.bst_state_free(data)

    def restore(self, snapshot: BytesLike, components: Union[str, Iterable[str]] = "all") -> None:
        """Restores a saved state, or components of it. Continued with the same commands, every
        message and every pixel equals that of the simulation that was saved.

        Given:     components  "all", or some of "plant", "onboard", "random" and "time"
        Errors:    FormatError: no saved state, a damaged one, or that of another version;
                   StateError: that of another scenario, or components that do not fit
        """
        if not isinstance(snapshot, (bytes, bytearray, memoryview)):
            raise ArgumentError(f"restore takes a Snapshot, not {type(snapshot).__name__}")
        data, bits = bytes(snapshot), component_bits(components)
        if not data:
            raise FormatError("this is no saved state of a simulation")
        with self._guard.use() as sim:
            with collected() as plugins:
                status = LIBRARY.bst_sim_restore(self._guard.context.pointer, sim.pointer, data,
                                                 len(data), bits)
            own(plugins, sim)
            self._finish(sim, status)

    def clone(self) -> "Simulation":
        """A second simulation of the same model in the same state, without observers."""
        out = c_void_p()
        with self._guard.use() as sim:
            with collected() as plugins:
                status = LIBRARY.bst_sim_clone(self._guard.context.pointer, sim.pointer,
                                               byref(out))
            self._finish(sim, status)
        return _simulation(self.model, out, plugins)

    def _finish(self, sim: SimHandle, status: int) -> None:
        """Raises the exception of a call: of an observer, of a plug-in in Python, or of C."""
        if status:
            raise_of(sim)
        self._observers.finish(status)

    def _raise_pending(self, sim: SimHandle) -> None:
        """Raises what a stage in Python or an observer has raised in a call, if anything."""
        raise_of(sim)
        self._observers.finish(0)

    def __reduce__(self) -> Any:
        return _unpickled, (self.model, self.save())

    # ---- observers

    def observe(self, message: Optional[Callable[[Message], Any]] = None,
                event: Optional[Callable[[int, str, str, str], Any]] = None,
                channels: Optional[Iterable[str]] = None) -> None:
        """Sets the callbacks that are called while the simulation steps; without arguments, none.

        Given:     message   called with each message (a copy) when it is published
                   event     called with tick, instance, kind and text of each event
                   channels  calls `message` for these channels only
        Notes:     an exception in a callback ends the call that steps, and is raised by it. A
                   callback cannot use the simulation (BusyError).
        """
        for function in (message, event):
            if function is not None and not callable(function):
                raise ArgumentError(f"observe takes functions, not {type(function).__name__}")
        names = None if channels is None else {channels} if isinstance(channels, str) else set(
            channels)
        known = {c for _, c in self._channels}
        if names is not None and not names <= known:
            raise ArgumentError(f"observe: no module writes {sorted(map(str, names - known))} "
                                f"(allowed: {', '.join(sorted(known))})")
        with self._guard.use() as sim:
            self._observers.set(sim, message, event, names)

    def __repr__(self) -> str:
        state = "closed" if self.closed else "in use"
        try:
            state = f"run {self.run} at {self.time_s:.3f} s of {self.duration_s:g} s"
        except BoresightError:
            pass
        return f"<Simulation of {self.model.name!r}: {state}>"

    def _repr_html_(self) -> str:
        from .frame import html_text
        text = f"<p>{html_text(repr(self))}</p>"
        try:
            frame = self.view_frame() if ("frame" in {c for _, c in self._channels}) else None
        except BoresightError:
            frame = None
        return text + (frame._repr_html_() if frame else "")


class Sensor(ChannelViews):
    """The channels of one sensor of a simulation."""

    __slots__ = ("simulation", "scope")

    def __init__(self, simulation: Simulation, scope: str):
        self.simulation, self.scope = simulation, scope

    def view(self, channel: str) -> Optional[Message]:
        """A copy of the newest message of a channel; None before the first one."""
        return self.simulation.view(channel, self.scope)

    def view_frame(self) -> Optional[Frame]:
        """The newest frame, without a copy; None before the first one."""
        return self.simulation.view_frame(self.scope)

    def command(self, channel: str, value: Any) -> None:
        """As Simulation.command, for this sensor."""
        self.simulation.command(channel, value, self.scope)

    def frames(self, until_s: Optional[float] = None) -> Iterator[Frame]:
        """As Simulation.frames, for this sensor."""
        return self.simulation.frames(self.scope, until_s)

    def __repr__(self) -> str:
        return f"<Sensor {self.scope} of {self.simulation!r}>"


def _simulation(model: Model, pointer: c_void_p, plugins: List[Instance]) -> Simulation:
    """A Simulation of a C object that exists."""
    simulation = Simulation.__new__(Simulation)
    simulation.model = model
    simulation._begin(pointer, plugins)
    return simulation


def _unpickled(model: Model, snapshot: Snapshot) -> Simulation:
    """Unpickles a simulation."""
    simulation = Simulation(model)
    simulation.restore(snapshot)
    return simulation
