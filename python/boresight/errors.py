"""Exceptions of the package. Each has the status of the C library as a base class of its own and,
where Python has one, the built-in exception of that meaning."""
from __future__ import annotations

from typing import Dict, Type


class BoresightError(Exception):
    """Base class of all errors of Boresight. The text says where, what was found and what is
    allowed."""


class ArgumentError(BoresightError, ValueError):
    """A value outside its documented range, or of a wrong type or shape."""


class OutOfMemoryError(BoresightError, MemoryError):
    """An allocation failed."""


class FileError(BoresightError, OSError):
    """The operating system refused a file operation."""


class FormatError(BoresightError, ValueError):
    """The content of a file or of a saved state is not what its format allows."""


class ScenarioError(BoresightError, ValueError):
    """A scenario is wrong; the text names file, key and allowed values."""


class OutOfRangeError(BoresightError, ValueError):
    """A date or value outside the range of the data."""


class NotFoundError(BoresightError, LookupError):
    """A name, file or number that does not exist."""


class DeviceError(BoresightError, RuntimeError):
    """OpenCL failed, or there is no OpenCL device."""


class NumericError(BoresightError, ArithmeticError):
    """An iteration did not converge."""


class StateError(BoresightError, RuntimeError):
    """A call in the wrong order."""


class ClosedError(StateError):
    """The simulation or model has been closed."""


class BusyError(StateError):
    """The simulation is in use: by another thread, or by the call whose callback this is."""


class ForkError(StateError):
    """The simulation or model belongs to the process from which this one was forked."""


class InterruptError(BoresightError):
    """A run was interrupted."""


class ProgramError(BoresightError, RuntimeError):
    """The program `boresight` failed; the text is what it wrote. `code`: its exit code."""

    def __init__(self, message: str, code: int = 1):
        super().__init__(message, code)
        self.code = code

    def __str__(self) -> str:
        return str(self.args[0])


OF_STATUS: Dict[int, Type[BoresightError]] = {
    1: ArgumentError, 2: OutOfMemoryError, 3: FileError, 4: FormatError, 5: ScenarioError,
    6: OutOfRangeError, 7: NotFoundError, 8: DeviceError, 9: NumericError, 10: StateError,
    11: InterruptError}
"""Exception of each bst_status."""
