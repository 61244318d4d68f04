"""Where a command of the program runs that needs plug-ins in Python: in this process, which has
registered them, or in a new one that imports modules which register them.

    python3 -m boresight.host SETTINGS COMMAND ...

SETTINGS is a JSON object: `path`, the folders in which modules are, and `plugins`, their names.
"""
from __future__ import annotations

import ctypes
import importlib
import importlib.util
import json
import os
import sys
import traceback
from typing import Any, List, NamedTuple, Optional, Sequence, Tuple

from .errors import ArgumentError, BoresightError
from .scenario import Scenario

_USAGE = 2  # exit code of a wrong call


class Host(NamedTuple):
    """plugins: names of modules that a new process imports; without any, this process has what is
    needed."""
    plugins: Tuple[str, ...] = ()

    @property
    def is_here(self) -> bool:
        """True if this process runs the command."""
        return not self.plugins

    def command(self) -> List[str]:
        """Command of a new process, without the words of the program."""
        if not sys.executable:
            raise ArgumentError("plugins: this Python does not know its own program "
                                "(sys.executable), so that no other can be started")
        settings = json.dumps({"path": [p or os.getcwd() for p in sys.path],
                               "plugins": self.plugins})
        return [sys.executable, "-m", "boresight.host", settings]


def host_of(plugins: Any, scenario: Any = None) -> Optional[Host]:
    """Where a command must run: in a new process that imports `plugins`, in this one for a scenario
    that names a plug-in that is registered here; None: the program itself can do it.

    Errors:    ArgumentError: `plugins` are no names of modules that can be imported
    """
    names = _names(plugins)
    if names:
        return Host(names)
    return Host() if scenario is not None and _names_registered(scenario) else None


def _names(plugins: Any) -> Tuple[str, ...]:
    """Names of modules, checked."""
    if isinstance(plugins, str) or not isinstance(plugins, (list, tuple)):
        raise ArgumentError("plugins takes a list of names of Python modules, as "
                            f'["my_detector"], not {type(plugins).__name__}')
    for name in plugins:
        if not isinstance(name, str):
            raise ArgumentError("plugins takes names of Python modules, not "
                                f"{type(name).__name__}")
        if name == "__main__" or name.endswith(".py") or "/" in name or name.startswith("."):
            raise ArgumentError(
                f"plugins: {name!r} is no module that another process can import: write the "
                "functions and their boresight.register(...) to a file such as my_detector.py, and "
                'give plugins=["my_detector"]')
        if name not in sys.modules and not _can_be_found(name):
            raise ArgumentError(f"plugins: there is no Python module {name!r} in the folders of "
                                "sys.path: add its folder to sys.path or PYTHONPATH")
    return tuple(plugins)


def _can_be_found(name: str) -> bool:
    try:
        return importlib.util.find_spec(name) is not None
    except (ImportError, ValueError):
        return False


def _names_registered(scenario: Any) -> bool:
    """True if a scenario names a plug-in that is registered in this process."""
    from .registration import registered
    if not registered:
        return False
    try:
        return _has_plugin(Scenario.of(scenario).to_dict(), registered)
    except BoresightError:  # of the scenario: the program reports it
        return False


def _has_plugin(value: Any, names: Any) -> bool:
    if isinstance(value, dict):
        return value.get("plugin") in names or any(_has_plugin(v, names) for v in value.values())
    return isinstance(value, list) and any(_has_plugin(v, names) for v in value)


def import_plugins(names: Sequence[str]) -> None:
    """Imports modules, each of which registers plug-ins.

    Errors:    ArgumentError: what is wrong with a module
    """
    from .registration import registered
    for name in names:
        before = len(registered)
        try:
            importlib.import_module(name)
        except Exception as error:  # pylint: disable=broad-except # whatever the module raises
            where = traceback.extract_tb(error.__traceback__)[-1]
            raise ArgumentError(f"plugins: the module {name!r} cannot be imported: "
                                f"{type(error).__name__}: {error} ({where.filename}, line "
                                f"{where.lineno})") from error
        if len(registered) == before:
            raise ArgumentError(f"plugins: the module {name!r} registers nothing: call "
                                "boresight.register(...) in it, outside of any "
                                'if __name__ == "__main__"')


def main(words: Sequence[str]) -> int:
    """Imports plug-ins, and becomes the program in this process."""
    from ._native import LIBRARY
    try:
        settings = json.loads(words[0])
        sys.path[:] = [*settings["path"], *(p for p in sys.path if p not in settings["path"])]
        import_plugins(settings["plugins"])
    except BoresightError as error:
        sys.stderr.write(f"boresight: {error}\n")
        return _USAGE
    command = [b"boresight", *(os.fsencode(word) for word in words[1:])]
    vector = (ctypes.c_char_p * (len(command) + 1))(*command, None)
    return int(LIBRARY.bst_program_run(len(command), vector, 1, 2))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
