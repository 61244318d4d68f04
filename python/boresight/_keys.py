"""Keys of a plug-in in Python: its keyword-only parameters, as a configuration table of C."""
from __future__ import annotations

import ctypes
import inspect
import json
import math
from typing import Any, Callable, Dict, List

from . import _structs
from .errors import ArgumentError

_TEXT_BYTES = 512
_MOST_INTEGER = 2.0**53
_MOST_REAL = 1e300
# C type and bst_config_type of a key, by the type of its default
_KINDS = {bool: (ctypes.c_bool, 0), int: (ctypes.c_int64, 1), float: (ctypes.c_double, 2),
          str: (ctypes.c_char * _TEXT_BYTES, 3)}
# of every module block and of every stage
_RESERVED = ("plugin", "type", "rate_hz", "offset_s", "delay_s", "description")


def defaults_of(function: Callable[..., Any], what: str) -> Dict[str, Any]:
    """Keyword-only parameters of a function or of a class's constructor, with their defaults.

    Errors:    ArgumentError: one has no default, or one that is neither bool, int, float nor str
    """
    try:
        parameters = inspect.signature(function).parameters.values()
    except (TypeError, ValueError):  # of C, without a signature
        return {}
    found: Dict[str, Any] = {}
    for parameter in parameters:
        if parameter.kind is not parameter.KEYWORD_ONLY:
            continue
        name, default = parameter.name, parameter.default
        if name in _RESERVED:
            raise ArgumentError(f"{what}: the key {name!r} has a meaning of its own: choose "
                                "another name")
        if type(default) not in _KINDS or (isinstance(default, float)
                                           and not math.isfinite(default)):
            raise ArgumentError(f"{what}: the keyword {name!r} becomes a key of scenarios: give it "
                                "a default that is a bool, an int, a finite float or a str")
        found[name] = default
    return found


class KeyTable:
    """A bst_config_desc table with the keys of a plug-in, and their values from C."""

    def __init__(self, defaults: Dict[str, Any]):
        self.names = list(defaults)
        fields = [(name, _KINDS[type(value)][0]) for name, value in defaults.items()]
        self._struct: Any = type("Keys", (ctypes.Structure,), {"_fields_": fields})
        self._table = (_structs.ConfigDesc * (len(defaults) + 1))()
        self._texts: List[bytes] = []
        for entry, (name, value) in zip(self._table, defaults.items()):
            most = _MOST_INTEGER if isinstance(value, int) else _MOST_REAL
            member = getattr(self._struct, name)
            entry.key, entry.type = self._kept(name), _KINDS[type(value)][1]
            entry.unit, entry.doc = b"", self._kept(f"A keyword of the plug-in; default {value!r}.")
            entry.minimum, entry.maximum = -most, most
            entry.fallback = self._kept(json.dumps(value))
            entry.offset, entry.size = member.offset, member.size

    def _kept(self, text: str) -> bytes:
        data = text.encode()
        self._texts.append(data)
        return data

    @property
    def pointer(self) -> Any:
        """Address of the table; None without keys."""
        return ctypes.addressof(self._table) if self.names else None

    @property
    def config_bytes(self) -> int:
        """Bytes of the struct that the table fills."""
        return ctypes.sizeof(self._struct) if self.names else 0

    def values(self, config: Any) -> Dict[str, Any]:
        """Values of the keys in a struct that C has filled."""
        if not self.names or not config:
            return {}
        struct = self._struct.from_address(config)
        found = {name: getattr(struct, name) for name in self.names}
        return {name: value.decode("utf-8", "replace") if isinstance(value, bytes) else value
                for name, value in found.items()}
