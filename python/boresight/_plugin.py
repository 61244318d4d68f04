"""Plug-ins in Python: what their kinds share. Each simulation has instances of its own."""
from __future__ import annotations

import contextlib
import copy
import ctypes
import functools
import inspect
import pathlib
import pickle
import threading
import traceback
import weakref
from typing import Any, Callable, Dict, Iterator, List, Optional, Tuple

from ._handle import user_code
from ._keys import KeyTable
from ._native import LIBRARY
from ._structs import ArchiveFunction, DestroyFunction
from .errors import ArgumentError, StateError

STATE_ERROR = 10  # BST_ERR_STATE
_MOST_STATE = 1 << 30  # bytes of an instance's state
_PACKAGE = pathlib.Path(__file__).resolve().parent


class Instance:
    """A plug-in in one simulation.

    Given:     given     of the user: a function; a class, which is created here; or an object that
                         can be called, of which this is a copy
               argument  of the class's constructor
               keys      further keyword arguments
    """

    def __init__(self, given: Callable[..., Any], argument: Tuple[Any, ...],
                 keys: Dict[str, Any]):
        self.has_state = not inspect.isroutine(given) and not isinstance(given, functools.partial)
        self.argument = argument
        self.target: Any = given  # what has the state
        if isinstance(given, type):
            self.target = given(*argument, **keys)
        elif self.has_state:
            self.target = copy.deepcopy(given)
        self.function: Callable[..., Any] = self.target
        if keys and not isinstance(given, type):
            self.function = functools.partial(self.target, **keys)
        self.raised: Optional[BaseException] = None  # what ended a call
        self.owner: Callable[[], Any] = lambda: None  # the simulation's handle

    def call(self, context: int, work: Callable[[], None]) -> int:
        """A status for C: an exception becomes its message, and is raised by the call that steps.
        """
        user_code.depth += 1
        try:
            work()
            return 0
        except BaseException as error:  # pylint: disable=broad-except
            self.raised = error
            return fail(context, error)
        finally:
            user_code.depth -= 1

    # ---- saved states

    def get_state(self) -> bytes:
        """The state of an object: by its own get_state, or pickled."""
        own = getattr(self.target, "get_state", None)
        if own is not None and hasattr(self.target, "set_state"):
            return bytes(own())
        try:
            return pickle.dumps(self._members(), 4)
        except Exception as error:  # pylint: disable=broad-except # pickle raises many kinds
            raise StateError(
                f"the state of {type(self.target).__name__} cannot be saved: {error}. Give the "
                "class get_state() -> bytes and set_state(bytes)") from None

    def set_state(self, state: bytes) -> None:
        """Restores a state that get_state gave."""
        own = getattr(self.target, "set_state", None)
        if own is not None and hasattr(self.target, "get_state"):
            own(state)
            return
        members = pickle.loads(state)
        if hasattr(type(self.target), "__setstate__"):
            type(self.target).__setstate__(self.target, members)
            return
        for name in self._members():
            delattr(self.target, name)
        self.target.__dict__.update(members)

    def _members(self) -> Any:
        """What is saved: by the class's own __getstate__, or all attributes but the argument of
        the constructor."""
        own = getattr(type(self.target), "__getstate__", None)
        if own is not None and own is not getattr(object, "__getstate__", None):
            return own(self.target)
        return {name: value for name, value in vars(self.target).items()
                if not any(value is one for one in self.argument)}


def described(error: BaseException) -> str:
    """An exception with the place in the user's code that raised it."""
    where = [entry for entry in traceback.extract_tb(error.__traceback__)
             if _PACKAGE not in pathlib.Path(entry.filename).parents]
    place = f" ({where[-1].filename}, line {where[-1].lineno})" if where else ""
    return f"{type(error).__name__}: {error}{place}"


def fail(context: int, error: BaseException) -> int:
    """Reports an exception to C."""
    text = described(error).encode("utf-8", "replace").replace(b"\0", b"?")
    last_raised[:] = [error]
    return int(LIBRARY.bst_fail(context, STATE_ERROR, b"%s", text))


last_raised: List[BaseException] = []
"""The newest exception of a plug-in in this process."""
_instances: Dict[int, Instance] = {}
_lock = threading.Lock()
_counter = iter(range(1, 2**62))
_local = threading.local()


@contextlib.contextmanager
def collected() -> Iterator[List[Instance]]:
    """The instances that C creates in this thread meanwhile."""
    before, _local.created = getattr(_local, "created", None), []
    try:
        yield _local.created
    finally:
        _local.created = before


def collect(instance: Instance) -> None:
    """Notes an instance for `collected`."""
    created = getattr(_local, "created", None)
    if created is not None:
        created.append(instance)


def own(instances: List[Instance], handle: Any) -> None:
    """Makes instances those of a simulation's handle."""
    for instance in instances:
        instance.owner = weakref.ref(handle)
    handle.plugins += instances


def raise_of(handle: Any) -> None:
    """Raises the exception that a plug-in of a simulation has met."""
    for instance in handle.plugins:
        if instance.raised is not None:
            raised, instance.raised = instance.raised, None
            raise raised


def forget_raised(handle: Any) -> None:
    """Forgets exceptions that an earlier call did not raise, because Ctrl-C came first."""
    for instance in handle.plugins:
        instance.raised = None


def create(make: Callable[[], Instance], context: int, out: Any) -> int:
    """Creates an instance for C: *out is its number."""
    user_code.depth += 1
    try:
        instance = make()
    except BaseException as error:  # pylint: disable=broad-except
        return fail(context, error)
    finally:
        user_code.depth -= 1
    with _lock:
        key = next(_counter)
        _instances[key] = instance
    collect(instance)
    out[0] = key
    return 0


def instance_of(key: int) -> Instance:
    """The instance of a number."""
    return _instances[key]


def _destroy(key: Optional[int]) -> None:
    with _lock:
        instance = _instances.pop(key or 0, None)
    for argument in instance.argument if instance else ():
        if hasattr(argument, "close"):
            argument.close()


def _archive(key: int, archive: int) -> int:
    instance, context = _instances[key], LIBRARY.bst_archive_ctx(archive)

    def work() -> None:
        if not instance.has_state:
            return
        restoring = LIBRARY.bst_archive_is_restoring(archive)
        state = b"" if restoring else instance.get_state()
        if len(state) > _MOST_STATE:
            raise StateError(f"a state of {len(state)} bytes (allowed: at most {_MOST_STATE})")
        count = LIBRARY.bst_archive_count(archive, len(state), _MOST_STATE)
        buffer = ctypes.create_string_buffer(state, max(count, 1))
        LIBRARY.bst_archive_bytes(archive, buffer, count)
        if restoring:
            instance.set_state(buffer.raw[:count])
    return instance.call(context, work)


destroy = DestroyFunction(_destroy)
archive = ArchiveFunction(_archive)


class Part:
    """One module or stage of a plug-in: its descriptor, and what C uses with it until the process
    ends."""

    def __init__(self, kind: str, desc: ctypes.Structure, kept: Tuple[Any, ...]):
        self.kind, self.desc, self.kept = kind, desc, kept


def check_function(kind: str, function: Any) -> None:
    """What is registered must be called."""
    if not callable(function):
        raise ArgumentError(f"register: {kind} takes a function or a class, not "
                            f"{type(function).__name__}")
    needed = "step" if kind == "compensator" else "__call__"
    if isinstance(function, type) and not any(needed in vars(base) for base in function.__mro__):
        raise ArgumentError(f"register: {kind}: the class {function.__name__} lacks the method "
                            f"{needed}, which each frame, step or error goes through")


def stage_part(kind: str, type_name: bytes, table: KeyTable, functions: ctypes.Structure) -> Part:
    """A stage's descriptor."""
    from ._structs import STAGE_ABI, StageDesc
    desc = StageDesc(STAGE_ABI, kind.encode(), type_name, b"A stage in Python.", table.pointer,
                     table.config_bytes, ctypes.addressof(functions))
    return Part(kind, desc, (table, functions))
