"""Model: a scenario that has been read and checked, and what its simulations share."""
from __future__ import annotations

import json
import os
import threading
from ctypes import byref, c_char_p, c_void_p
from typing import Any, Dict, List, Optional, Sequence, Union

from . import _native, _structs
from ._native import LIBRARY, Context
from ._owned import Owned
from .camera import Camera, camera_of
from .errors import ArgumentError, ClosedError, ForkError
from .scenario import Scenario


class ModelHandle:
    """A bst_model; freed with the last simulation and frame that refer to it."""

    def __init__(self, pointer: int):
        self.pointer = c_void_p(pointer)
        self.owned = Owned(pointer, LIBRARY.bst_model_free)


class Model:
    """A scenario that has been read and checked. Many simulations may share it, in any number of
    threads: they share its star catalogue and its compiled kernels.

    Given:     scenario  a Scenario, a path or a dictionary
               external  modules that Python plays ("imgproc", "tracker", "control", "gimbal", or
                         "observer/sensor/module")
               device    OpenCL device: part of its name or its number; None: the default
               threads   of the device's processor; 0: all cores
    Errors:    ScenarioError and others: the text names file, key and allowed values
    """

    def __init__(self, scenario: Any, external: Sequence[str] = (), device: Optional[str] = None,
                 threads: int = 0):
        given = Scenario.of(scenario)
        self.external = external_names(external)
        self.scenario = given.with_external(self.external) if self.external else given
        self.device = device
        self.threads = _native.integer_argument(threads, "threads", 0, 4096)
        self._process = os.getpid()
        self._lock = threading.Lock()
        self._handle = load_model(self.scenario, device, self.threads)

    @property
    def handle(self) -> ModelHandle:
        """The C object, of this process."""
        if os.getpid() != self._process:
            raise ForkError("this model belongs to the process from which this one was forked: "
                            "create it here, or start processes with the method \"spawn\"")
        if not self._handle.owned.live:
            raise ClosedError("the garbage collector has freed this model")
        return self._handle

    def prepare(self) -> "Model":
        """Opens star catalogue, orbits and device now; the first simulation does it too."""
        context = Context()
        context.check(LIBRARY.bst_model_prepare(context.pointer, self.handle.pointer))
        return self

    @property
    def name(self) -> str:
        """Name of the scenario."""
        return str(LIBRARY.bst_model_name(self.handle.pointer).decode())

    @property
    def epoch_utc(self) -> str:
        """Epoch of the scenario, ISO 8601, UTC."""
        return str(LIBRARY.bst_model_epoch_utc(self.handle.pointer).decode())

    @property
    def tick_rate_hz(self) -> int:
        """Ticks per second of the clock that times all messages."""
        return int(LIBRARY.bst_model_tick_rate_hz(self.handle.pointer))

    @property
    def duration_s(self) -> float:
        """Duration of a run as the scenario sets it, s."""
        return float(LIBRARY.bst_model_duration_s(self.handle.pointer))

    @property
    def seed(self) -> int:
        """Seed as the scenario sets it."""
        return int(LIBRARY.bst_model_seed(self.handle.pointer))

    @property
    def run(self) -> int:
        """Number of the run as the scenario sets it."""
        return int(LIBRARY.bst_model_run(self.handle.pointer))

    @property
    def sensors(self) -> List[str]:
        """Names "observer/sensor"."""
        count = LIBRARY.bst_model_sensor_count(self.handle.pointer)
        return [LIBRARY.bst_model_sensor(self.handle.pointer, k).decode() for k in range(count)]

    def camera(self, sensor: Union[int, str] = 0) -> Camera:
        """True camera of a sensor, by its number or its name "observer/sensor"."""
        names = self.sensors
        if isinstance(sensor, str):
            if sensor not in names:
                raise ArgumentError(f"there is no sensor {sensor!r} (allowed: "
                                    f"{', '.join(names)})")
            sensor = names.index(sensor)
        number = _native.integer_argument(sensor, "sensor", 0, len(names) - 1)
        self.prepare()
        return camera_of(LIBRARY.bst_model_camera(self.handle.pointer, number)[0])

    def to_dict(self) -> Dict[str, Any]:
        """The complete scenario, with every default written out."""
        context, text = Context(), c_void_p()
        context.check(LIBRARY.bst_model_scenario(context.pointer, self.handle.pointer,
                                                 byref(text)))
        try:
            from ctypes import string_at
            value = json.loads(string_at(text))
        finally:
            LIBRARY.bst_text_free(text)
        return dict(value)

    def __reduce__(self) -> Any:
        return _model, (self.scenario, self.external, self.device, self.threads)

    def __repr__(self) -> str:
        return f"<Model {self.name!r}: {', '.join(self.sensors)}; {self.duration_s:g} s>"


def _model(scenario: Scenario, external: Sequence[str], device: Optional[str],
           threads: int) -> Model:
    """Unpickles a model: reads its scenario again."""
    model = Model(scenario, (), device, threads)
    model.external = tuple(external)
    return model


def external_names(external: Any) -> "tuple[str, ...]":
    """Names of external modules from a text or a sequence of texts."""
    try:
        names = (external,) if isinstance(external, str) else tuple(external)
    except TypeError:
        raise ArgumentError(f"external takes names of modules, not "
                            f"{type(external).__name__}") from None
    for name in names:
        if not isinstance(name, str):
            raise ArgumentError(f"external takes names of modules, not {type(name).__name__}")
    return names


def load_model(scenario: Scenario, device: Optional[str] = None, threads: int = 0) -> ModelHandle:
    """Reads and checks a scenario."""
    context, out = Context(), c_void_p()
    values = [_native.text_argument(a, "assignment") for a in scenario.assignments]
    options = _structs.ModelOptions()
    options.assignments = (c_char_p * max(len(values), 1))(*values)
    options.assignment_count = len(values)
    options.text = _native.text_argument(scenario.text, "scenario", optional=True)
    options.device = _native.text_argument(device, "device", optional=True)
    options.threads = threads
    context.check(LIBRARY.bst_model_load(
        context.pointer, _native.text_argument(scenario.path, "path"), byref(options), byref(out)))
    assert out.value
    return ModelHandle(out.value)
