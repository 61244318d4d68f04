"""The shared library: where it is, its functions, and calls that turn errors into exceptions."""
from __future__ import annotations

import ctypes
import logging
import os
import pathlib
from ctypes import POINTER, byref, c_bool, c_char_p, c_double, c_int, c_int64, c_size_t, c_uint, \
    c_uint64, c_void_p
from typing import Any, List, Optional

from . import _pocl, _structs
from .errors import OF_STATUS, BoresightError, DeviceError
from .messages import CHANNELS

LOG = logging.getLogger("boresight")
_LEVELS = {0: logging.ERROR, 1: logging.WARNING, 2: logging.INFO, 3: logging.DEBUG}
LOG_WARNING = 1

PACKAGE = pathlib.Path(__file__).resolve().parent


def _first(candidates: List[pathlib.Path], what: str, variable: str) -> pathlib.Path:
    for path in candidates:
        if path.exists():
            return path
    raise ImportError(f"boresight: no {what} beside the package (looked for "
                      f"{', '.join(str(c) for c in candidates)}); set {variable} to its path")


def _places(variable: str, in_package: str, installed: str, built: str) -> List[pathlib.Path]:
    """Where a part of Boresight may be: as the environment says, in the wheel, in the installed
    tree (the package is PREFIX/share/boresight/python/boresight), in the build folder (there it
    is python/boresight)."""
    given = os.environ.get(variable)
    if given:
        return [pathlib.Path(given)]
    return [PACKAGE / in_package, PACKAGE.parents[3] / installed if len(PACKAGE.parents) > 3
            else PACKAGE / in_package, PACKAGE.parents[1] / built]


def library_path() -> pathlib.Path:
    """The shared library libboresight."""
    name = "libboresight.so.0.1"
    candidates = _places("BORESIGHT_LIBRARY", f"lib/{name}", f"lib/{name}", name)
    if len(candidates) > 1:  # Debian's folder of libraries by architecture
        candidates += sorted((candidates[1].parent).glob(f"*/{name}"))
    return _first(candidates, "shared library", "BORESIGHT_LIBRARY")


def program_path() -> pathlib.Path:
    """The program `boresight`."""
    return _first(_places("BORESIGHT_PROGRAM", "bin/boresight", "bin/boresight", "boresight"),
                  "program", "BORESIGHT_PROGRAM")


def scenarios_path() -> pathlib.Path:
    """The folder of the scenarios that come with Boresight."""
    places = _places("BORESIGHT_SCENARIOS", "share/boresight/scenarios",
                     "share/boresight/scenarios", "../scenarios")
    return _first(places, "scenarios", "BORESIGHT_SCENARIOS")


_FUNCTIONS = {
    "bst_version": (c_char_p, []),
    "bst_version_git_revision": (c_char_p, []),
    "bst_channel_type_find": (POINTER(_structs.ChannelType), [c_char_p]),
    "bst_model_load": (c_int, [c_void_p, c_char_p, POINTER(_structs.ModelOptions),
                               POINTER(c_void_p)]),
    "bst_model_prepare": (c_int, [c_void_p, c_void_p]),
    "bst_model_free": (None, [c_void_p]),
    "bst_model_name": (c_char_p, [c_void_p]),
    "bst_model_epoch_utc": (c_char_p, [c_void_p]),
    "bst_model_tick_rate_hz": (c_int64, [c_void_p]),
    "bst_model_duration_s": (c_double, [c_void_p]),
    "bst_model_seed": (c_uint64, [c_void_p]),
    "bst_model_run": (c_uint64, [c_void_p]),
    "bst_model_sensor_count": (c_int, [c_void_p]),
    "bst_model_sensor": (c_char_p, [c_void_p, c_int]),
    "bst_model_scenario": (c_int, [c_void_p, c_void_p, POINTER(c_void_p)]),
    "bst_text_free": (None, [c_void_p]),
    "bst_sim_create": (c_int, [c_void_p, c_void_p, POINTER(_structs.SimOptions),
                               POINTER(c_void_p)]),
    "bst_sim_free": (None, [c_void_p]),
    "bst_sim_observe": (None, [c_void_p, POINTER(_structs.SimObserver)]),
    "bst_sim_run_until": (c_int, [c_void_p, c_void_p, c_double]),
    "bst_sim_step": (c_int, [c_void_p, c_void_p, c_char_p, c_char_p, c_double, POINTER(c_bool)]),
    "bst_sim_time_s": (c_double, [c_void_p]),
    "bst_sim_tick": (c_int64, [c_void_p]),
    "bst_sim_run": (c_uint64, [c_void_p]),
    "bst_sim_counter": (c_char_p, [c_void_p, c_int, POINTER(c_int64)]),
    "bst_sim_channel": (c_char_p, [c_void_p, c_int, POINTER(c_char_p)]),
    "bst_sim_view": (c_int, [c_void_p, c_void_p, c_char_p, c_char_p,
                             POINTER(_structs.SimMessage)]),
    "bst_sim_view_frame": (c_int, [c_void_p, c_void_p, c_char_p, POINTER(_structs.SimFrame)]),
    "bst_sim_hold_frame": (c_int, [c_void_p, POINTER(_structs.SimFrame), POINTER(c_void_p)]),
    "bst_sim_release_frame": (None, [c_void_p]),
    "bst_sim_command": (c_int, [c_void_p, c_void_p, c_char_p, c_char_p, c_void_p]),
    "bst_sim_command_pointing": (c_int, [c_void_p, c_void_p, c_char_p, c_void_p, c_int]),
    "bst_sim_command_state": (c_int, [c_void_p, c_void_p, c_char_p, c_double, _structs.Vec3,
                                      _structs.Vec3]),
    "bst_sim_command_attitude": (c_int, [c_void_p, c_void_p, c_char_p, c_double, _structs.Quat,
                                         _structs.Vec3]),
    "bst_sim_save": (c_int, [c_void_p, c_void_p, POINTER(c_void_p), POINTER(c_size_t)]),
    "bst_state_free": (None, [c_void_p]),
    "bst_model_camera": (POINTER(_structs.CameraHead), [c_void_p, c_int]),
    "bst_plugin_register": (c_int, [c_void_p, c_char_p, c_char_p, c_void_p, c_void_p]),
    "bst_fail": (c_int, [c_void_p, c_int, c_char_p, c_char_p]),
    "bst_archive_is_restoring": (c_bool, [c_void_p]),
    "bst_archive_ctx": (c_void_p, [c_void_p]),
    "bst_archive_bytes": (None, [c_void_p, c_void_p, c_size_t]),
    "bst_archive_count": (c_int, [c_void_p, c_int, c_int]),
    "bst_env_camera": (c_void_p, [POINTER(_structs.ModuleEnv)]),
    "bst_camera_unproject_points": (None, [c_void_p, c_void_p, c_void_p, c_int, c_void_p]),
    "bst_step_ctx": (c_void_p, [c_void_p]),
    "bst_step_tick": (c_int64, [c_void_p]),
    "bst_step_latest": (_structs.Sample, [c_void_p, c_int]),
    "bst_step_next": (_structs.Sample, [c_void_p, c_int]),
    "bst_step_write": (c_void_p, [c_void_p, c_int, POINTER(c_int)]),
    "bst_step_event": (None, [c_void_p, c_char_p, c_char_p, c_char_p]),
    "bst_step_count": (None, [c_void_p, c_char_p]),
    "bst_program_run": (c_int, [c_int, POINTER(c_char_p), c_int, c_int]),
    "bst_sim_restore": (c_int, [c_void_p, c_void_p, c_char_p, c_size_t, c_uint]),
    "bst_sim_clone": (c_int, [c_void_p, c_void_p, POINTER(c_void_p)]),
    "bst_sim_pool_create": (c_int, [c_void_p, c_int, POINTER(c_void_p)]),
    "bst_sim_pool_free": (None, [c_void_p]),
    "bst_sim_pool_step": (c_int, [c_void_p, c_void_p, c_void_p, c_int, c_char_p, c_void_p,
                                  c_double, c_void_p]),
    "bst_sim_pool_view": (c_int, [c_void_p, c_void_p, c_int, c_char_p, c_char_p,
                                  POINTER(_structs.SimColumns)]),
    "bst_sim_pool_command": (c_int, [c_void_p, c_void_p, c_int, c_char_p, c_char_p, c_void_p]),
}


def _load() -> Any:
    _pocl.offer()
    path = library_path()
    try:
        library = ctypes.CDLL(str(path))
        for name, (result, arguments) in _FUNCTIONS.items():
            function = getattr(library, name)
            function.restype, function.argtypes = result, arguments
    except (OSError, AttributeError) as error:
        raise ImportError(f"boresight: {path} cannot be used: {error}") from None
    return library


def _check(library: Any) -> None:
    """The structs of the messages must be those of the library."""
    for name, message in CHANNELS.items():
        found = library.bst_channel_type_find(name.encode())
        items = message.item_dtype.itemsize if message.item_dtype else 0
        if not found or (found[0].header_bytes, found[0].item_bytes) != (message.dtype.itemsize,
                                                                         items):
            raise ImportError(f"boresight: {library_path()} is of another version than the package:"
                              f" the message {name!r} differs; install both from one build")


LIBRARY = _load()
_check(LIBRARY)


def version() -> str:
    """Version of the library, and the revision of its sources where that is known."""
    number = LIBRARY.bst_version().decode()
    revision = LIBRARY.bst_version_git_revision().decode()
    return f"{number} ({revision})" if revision else str(number)


def _to_log(_user: Any, level: int, text: bytes) -> None:
    LOG.log(_LEVELS.get(level, logging.INFO), "%s", text.decode("utf-8", "replace"))


_log = _structs.LogFunction(_to_log)


class Context:
    """A bst_ctx: the message of the last error. Warnings go to the logger "boresight"."""

    def __init__(self) -> None:
        self.struct = _structs.Context(b"", _log, None, LOG_WARNING, 0)
        self.pointer = byref(self.struct)

    def check(self, status: int) -> None:
        """Raises the exception of a status that is not BST_OK."""
        if status != 0:
            raise self.error(status)

    def error(self, status: int) -> BoresightError:
        """The exception of a status with the stored message."""
        text = self.struct.message.decode("utf-8", "replace") or f"error {status}"
        kind = OF_STATUS.get(status, BoresightError)
        if kind is DeviceError and "pocl" not in text.lower():
            text += " (rendering needs an OpenCL device; PoCL is one on any CPU: " \
                    "pip install boresight[pocl], or apt install pocl-opencl-icd)"
        return kind(text)


def text_argument(value: Any, what: str, optional: bool = False) -> Optional[bytes]:
    """A text for C: no other type, no zero bytes in it."""
    from .errors import ArgumentError
    if value is None and optional:
        return None
    if not isinstance(value, str):
        raise ArgumentError(f"{what} takes a text, not {type(value).__name__}")
    if "\0" in value:
        raise ArgumentError(f"{what}: a text with a zero in it")
    try:
        return value.encode("utf-8")
    except UnicodeEncodeError:
        raise ArgumentError(f"{what}: {value!r} is no Unicode text") from None


def number_argument(value: Any, what: str) -> float:
    """A number for C."""
    import numbers

    from .errors import ArgumentError
    if isinstance(value, bool) or not isinstance(value, numbers.Real):
        raise ArgumentError(f"{what} takes a number, not {type(value).__name__}")
    try:
        return float(value)
    except OverflowError:
        raise ArgumentError(f"{what}: {value} is too large") from None


def integer_argument(value: Any, what: str, least: int, most: int) -> int:
    """A whole number for C."""
    import operator

    from .errors import ArgumentError
    try:
        number = operator.index(value)
    except TypeError:
        raise ArgumentError(f"{what} takes a whole number, not {type(value).__name__}") from None
    if isinstance(value, bool) or not least <= number <= most:
        raise ArgumentError(f"{what}: {value} (allowed: {least} to {most})")
    return number
