"""Roles of modules in Python: the ports that they have, and their descriptors for C."""
from __future__ import annotations

import ctypes
from typing import Any, Callable, Dict, List, Sequence, Tuple

from ._keys import KeyTable
from ._native import LIBRARY
from ._plugin import Instance, Part, archive, create, destroy, instance_of
from ._structs import MODULE_ABI, ModuleCreate, ModuleDesc, StepFunction
from ._structs import Port as PortStruct
from .errors import ArgumentError
from .messages import CHANNELS
from .modules import ModuleEnv, ModuleStep, Port, StepInfo

_MULTI_SENSOR = 1 << 4  # BST_MODULE_MULTI_SENSOR
_RINGS = ("los_history", "pointing_telemetry")
_ITEMS = 256  # of an output without a capacity
_MOST_ITEMS = 16384

_TELEMETRY = (Port("pointing_telemetry", optional=True, max_age_s=10.0),
              Port("nav_telemetry", optional=True, max_age_s=60.0))
ROLES: Dict[str, Tuple[float, Tuple[Port, ...]]] = {
    "imgproc": (0.0, (
        Port("frame", trigger=True),
        Port("predictions", optional=True, feedback=True, max_age_s=30.0), *_TELEMETRY,
        Port("detections", output=True, capacity=2048))),
    "tracker": (0.0, (
        Port("detections", trigger=True), *_TELEMETRY,
        Port("task", optional=True, feedback=True),
        Port("tracks", output=True, capacity=256),
        Port("predictions", output=True, capacity=256))),
    "control": (20.0, (
        Port("tracks", trigger=True, optional=True), *_TELEMETRY,
        Port("mount_status", optional=True), Port("task", optional=True, feedback=True),
        Port("los_command", output=True), Port("sensor_command", output=True),
        Port("control_status", output=True))),
    "tasking": (1.0, (
        Port("tracks", optional=True), Port("nav_telemetry", optional=True),
        Port("mount_status", optional=True), Port("task", output=True)))}
"""Steps per second and ports of each role that a module in Python can have."""


class Module(Instance):
    """A module of one simulation."""

    def __init__(self, function: Callable[..., Any], env: Any, ports: Sequence[Port],
                 keys: Dict[str, Any]):
        self.env = ModuleEnv(env[0], LIBRARY.bst_env_camera(env))
        super().__init__(function, (self.env,), keys)
        self.info = StepInfo(ports, self.env, lambda: self.owner())

    def step(self, pointer: int) -> None:
        """Calls the function, and writes what it returns."""
        step = ModuleStep(pointer, self.info)
        try:
            step.give(self.function(step))
        finally:
            step.pointer = None


def ports_of(role: str, function: Any) -> Tuple[Port, ...]:
    """Ports of a module: its attribute `ports`, or those of its role."""
    ports = getattr(function, "ports", ROLES[role][1])
    what = f"register: {role}: ports"
    if not isinstance(ports, (list, tuple)) or not all(isinstance(p, Port) for p in ports):
        raise ArgumentError(f"{what} is a list of boresight.Port")
    for port in ports:
        if port.channel not in CHANNELS or port.channel == "planes":
            known = ", ".join(c for c in CHANNELS if c != "planes")
            raise ArgumentError(f"{what}: {port.channel!r} is no channel (allowed: {known})")
        if port.output and port.channel in (*_RINGS, "frame", "truth"):
            raise ArgumentError(
                f"{what}: a module in Python cannot write {port.channel!r}; give the gimbal to "
                'Simulation(external=["gimbal"]) and its command_pointing, and change frames in a '
                "frame_stage")
        if not 0 <= port.capacity <= _MOST_ITEMS or not 0.0 <= port.max_age_s < float("inf"):
            raise ArgumentError(f"{what}: {port.channel!r}: capacity 0 to {_MOST_ITEMS}, max_age_s "
                                f"0 or more (found {port.capacity}, {port.max_age_s})")
    names = [port.channel for port in ports]
    if len(set(names)) < len(names) or not any(port.output for port in ports):
        raise ArgumentError(f"{what}: each channel once, and at least one output (found "
                            f"{', '.join(names)})")
    return tuple(ports)


def rate_of(role: str, function: Any) -> float:
    """Steps per second: its attribute `rate_hz`, or that of its role."""
    rate = getattr(function, "rate_hz", ROLES[role][0])
    if isinstance(rate, bool) or not isinstance(rate, (int, float)) or not 0 <= rate <= 1e5:
        raise ArgumentError(f"register: {role}: rate_hz is steps per second, 0 (triggers only) to "
                            f"100000 (found {rate!r})")
    return float(rate)


def module_part(role: str, function: Callable[..., Any], type_name: bytes, table: KeyTable) -> Part:
    """The descriptor of a module."""
    ports = ports_of(role, function)
    structs = (PortStruct * len(ports))()
    kept: List[Any] = [table, structs]
    for struct, port in zip(structs, ports):
        name = port.channel.encode()
        kept.append(name)
        struct.channel, struct.direction = name, int(port.output)
        struct.flags = port.optional + 2 * port.trigger + 4 * port.feedback
        struct.max_age_s = port.max_age_s
        has_items = CHANNELS[port.channel].item_dtype is not None
        struct.capacity = (port.capacity or _ITEMS) if port.output and has_items else 0

    def create_one(env: Any, config: int, out: Any) -> int:
        return create(lambda: Module(function, env, ports, table.values(config)), env[0].ctx, out)

    def step(key: int, pointer: int) -> int:
        instance: Any = instance_of(key)
        return int(instance.call(LIBRARY.bst_step_ctx(pointer), lambda: instance.step(pointer)))

    desc = ModuleDesc(
        abi=MODULE_ABI, role=role.encode(), type=type_name, doc=b"A module in Python.",
        flags=_MULTI_SENSOR if role == "tasking" else 0, config=table.pointer,
        config_bytes=table.config_bytes, default_rate_hz=rate_of(role, function),
        ports=ctypes.addressof(structs), port_count=len(ports), create=ModuleCreate(create_one),
        step=StepFunction(step), destroy=destroy, archive=archive)
    return Part(role, desc, tuple(kept))
