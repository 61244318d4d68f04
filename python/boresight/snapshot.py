"""Snapshot: the saved state of a simulation."""
from __future__ import annotations

import os
import pathlib
from typing import Any, Union

from .errors import ArgumentError, FileError

COMPONENTS = {"plant": 1, "onboard": 2, "random": 4, "time": 8}
ALL = 15


class Snapshot(bytes):
    """The saved state of a simulation: bytes that begin with version and digest.

    It can be pickled, sent to another process, written to a file, and restored any number of
    times in simulations of the same scenario.
    """

    def write(self, path: Union[str, "os.PathLike[str]"]) -> None:
        """Writes it to a file, which appears complete or not at all."""
        target = pathlib.Path(path)
        draft = target.with_name(f".{target.name}.{os.getpid()}.partial")
        try:
            draft.write_bytes(self)
            os.replace(draft, target)
        except OSError as error:
            draft.unlink(missing_ok=True)
            raise FileError(f"{target}: {error.strerror}") from None

    @classmethod
    def read(cls, path: Union[str, "os.PathLike[str]"]) -> "Snapshot":
        """A snapshot of a file; `restore` checks its content."""
        try:
            return cls(pathlib.Path(path).read_bytes())
        except OSError as error:
            raise FileError(f"{path}: {error.strerror}") from None

    def __repr__(self) -> str:
        return f"<Snapshot of {len(self) / 1000:.1f} kB>"

    def __reduce__(self) -> Any:
        return Snapshot, (bytes(self),)


def component_bits(components: Any) -> int:
    """Bits of bst_state_component: of "all", a name, or several names."""
    if isinstance(components, str):
        components = [components]
    try:
        names = list(components)
    except TypeError:
        raise ArgumentError(f"components takes names, not {type(components).__name__}") from None
    bits = 0
    for name in names:
        if name == "all":
            bits |= ALL
        elif isinstance(name, str) and name in COMPONENTS:
            bits |= COMPONENTS[name]
        else:
            raise ArgumentError(f"components: {name!r} (allowed: \"all\", "
                                + ", ".join(f'"{c}"' for c in COMPONENTS) + ")")
    if not bits:
        raise ArgumentError("components: none is named")
    return bits
