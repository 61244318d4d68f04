"""The program `boresight` that comes with the package: runs it, with its errors as exceptions."""
from __future__ import annotations

import contextlib
import ctypes
import os
import pathlib
import pty
import signal
import subprocess
import sys
import tempfile
import threading
from typing import Any, Iterator, List, Optional, Sequence, Tuple

from . import _native
from ._plugin import last_raised
from .errors import ArgumentError, BusyError, ProgramError
from .host import Host
from .scenario import Scenario


_INTERRUPTED = 130
_running = threading.Lock()


@contextlib.contextmanager
def work_folder() -> Iterator[pathlib.Path]:
    """A temporary folder."""
    with tempfile.TemporaryDirectory(prefix="boresight-") as folder:
        yield pathlib.Path(folder)


def options_of(**options: Any) -> List[str]:
    """Options of the program by name: None and False are left out, True is a flag, the parts of a
    tuple have ":" between them, those of a list ",": snr=(3, 9, 0.5) is --snr 3:9:0.5."""
    words: List[str] = []
    for name, value in options.items():
        option = "--" + name.rstrip("_").replace("_", "-")
        if value is None or value is False:
            continue
        if value is True:
            words.append(option)
            continue
        if isinstance(value, (list, tuple)):
            separator = ":" if isinstance(value, tuple) else ","
            value = separator.join(str(part) for part in value)
        elif not isinstance(value, (str, int, float, os.PathLike)) and not hasattr(value, "item"):
            raise ArgumentError(f"{name} takes a number, a text, a path, a tuple or a list, not "
                                f"{type(value).__name__}")
        words += [option, str(value)]
    return words


@contextlib.contextmanager
def scenario_arguments(scenario: Any) -> Iterator[List[str]]:
    """Arguments of the program that name a scenario: its file, or a temporary one, and --set."""
    given = Scenario.of(scenario)
    if given.text is None:
        yield [given.path, *given.arguments()]
        return
    with work_folder() as folder:
        file = folder / "scenario.json"
        file.write_text(given.to_json(), encoding="utf-8")
        yield [str(file)]


def execute(arguments: Sequence[str], progress: bool = False, allowed: Sequence[int] = (0,),
            host: Optional[Host] = None) -> str:
    """Runs the program to its end. Ctrl-C ends it properly first.

    Given:     arguments  of the program
               progress   shows what it writes to the standard error as it comes
               allowed    exit codes that are no errors
               host       where plug-ins in Python are; None: the scenario has none
    Returned:  what it wrote to the standard output
    Errors:    ProgramError, with what it wrote to the standard error; KeyboardInterrupt
    """
    if any("\0" in word for word in arguments):
        raise ArgumentError("an argument with a zero in it")
    reading, writing = pty.openpty() if progress else os.pipe()
    said: List[bytes] = []
    reader = threading.Thread(target=_read, args=(reading, said, progress), daemon=True)
    last_raised.clear()
    try:
        reader.start()
        try:
            if host is not None and host.is_here:
                code, output = _run_here(arguments, writing)
            else:
                code, output = _run_process(arguments, writing, host)
        finally:
            os.close(writing)
    finally:
        reader.join()
        os.close(reading)
    text = b"".join(said).decode("utf-8", "replace")
    if code not in allowed:
        raise ProgramError(_message(text, code), code) from (last_raised[0] if last_raised
                                                             else None)
    for line in _lines(text):
        if line.startswith("boresight: warning: ") and not progress:
            _native.LOG.warning("%s", line[len("boresight: warning: "):])
    return output.decode("utf-8", "replace")


def _run_process(arguments: Sequence[str], errors: int,
                 host: Optional[Host]) -> Tuple[int, bytes]:
    """Runs the program as a process of its own: exit code and output."""
    command = [*(host.command() if host is not None else [str(_native.program_path())]),
               *arguments]
    try:
        # a session of its own: Ctrl-C comes to it from here alone, and once
        process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                                   stderr=errors, start_new_session=True)
    except OSError as error:
        raise ProgramError(f"{command[0]} cannot be executed: {error.strerror}") from None
    try:
        output, _ = process.communicate()
    except KeyboardInterrupt:
        process.send_signal(signal.SIGINT)
        process.communicate()
        raise
    return process.returncode, output


def _run_here(arguments: Sequence[str], errors: int) -> Tuple[int, bytes]:
    """Runs a command of the program in this process: exit code and output."""
    words = [b"boresight", *(os.fsencode(word) for word in arguments)]
    vector = (ctypes.c_char_p * (len(words) + 1))(*words, None)
    if not _running.acquire(blocking=False):
        raise BusyError("another command with plug-ins in Python runs in this process: wait for "
                        "its end, or give plugins=[MODULE], so that it gets a process of its own")
    try:
        with tempfile.TemporaryFile() as output:
            code = _native.LIBRARY.bst_program_run(len(words), vector, output.fileno(), errors)
            if code == _INTERRUPTED:
                raise KeyboardInterrupt
            output.seek(0)
            return int(code), output.read()
    finally:
        _running.release()


def _read(reading: int, said: List[bytes], progress: bool) -> None:
    """Collects what the program writes; shows it where that is asked for."""
    while True:
        try:
            data = os.read(reading, 65536)
        except OSError:  # a terminal without a program
            return
        if not data:
            return
        said.append(data)
        if progress:
            sys.stderr.write(data.decode("utf-8", "replace").replace("\r\n", "\n"))
            sys.stderr.flush()


def _lines(text: str) -> List[str]:
    """Lines as they stand in the end, without what a progress line overwrote."""
    return [line.rstrip("\r").rsplit("\r", 1)[-1].replace("\x1b[K", "").strip()
            for line in text.split("\n")]


def _message(text: str, code: int) -> str:
    """What a program that failed says of it."""
    lines = [line for line in _lines(text) if line]
    prefix = "boresight: "
    errors = [line[len(prefix):] for line in lines
              if line.startswith(prefix) and not line.startswith(prefix + "warning: ")]
    if errors:
        return "\n".join(errors)
    return "\n".join(lines) or (f"boresight ended by signal {-code}" if code < 0 else
                                f"boresight ended with exit code {code}")


def version() -> Tuple[str, str]:
    """Version and path of the program."""
    return execute(["--version"]).strip(), str(_native.program_path())


def main() -> None:
    """The command `boresight` of an installed wheel: becomes the program."""
    path = str(_native.program_path())
    os.execv(path, [path, *sys.argv[1:]])
