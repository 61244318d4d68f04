"""Base classes of messages and of their parts: values of a C struct, by name.

A record is an immutable copy of its struct, so that it stays valid when the simulation goes on.
"""
from __future__ import annotations

import html
from typing import Any, ClassVar, Dict, Iterable, List, Mapping, Optional, Tuple, Type, TypeVar

import numpy as np
import numpy.typing as npt

from .errors import ArgumentError

R = TypeVar("R", bound="Record")


def assign(target: npt.NDArray[np.void], name: str, value: Any, what: str) -> None:
    """Stores a value in a field of a structured array, checked for type and shape."""
    names = target.dtype.names or ()
    if name not in names:
        raise ArgumentError(f"{what} has no member {name!r} (it has: {', '.join(names)})")
    field = target[name]
    if (type(value) is np.ndarray and field.dtype.kind == "f" and value.dtype == field.dtype
            and value.shape == field.shape):
        field[...] = value
        return
    if field.dtype.names:
        if isinstance(value, Record):
            value = value.array
        if isinstance(value, Mapping):
            for key, part in value.items():
                assign(field, key, part, f"{what}.{name}")
            return
        if not isinstance(value, (np.ndarray, np.void)) or value.dtype != field.dtype:
            raise ArgumentError(f"{what}.{name} takes a mapping of its members, not "
                                f"{type(value).__name__}")
        field[...] = value
        return
    try:
        given = np.asarray(value)
    except (TypeError, ValueError) as error:
        raise ArgumentError(f"{what}.{name}: {error}") from None
    if given.dtype.kind not in "biuf":
        raise ArgumentError(f"{what}.{name} takes numbers, not {_describe(value)}")
    if field.dtype.kind in "iu" and given.dtype.kind == "f":
        if not np.all(np.isfinite(given)) or not np.all(given == np.trunc(given)):
            raise ArgumentError(f"{what}.{name} takes whole numbers (found {_describe(value)})")
    if field.dtype.kind in "iu" and given.size:
        limits = np.iinfo(field.dtype)
        if given.min() < limits.min or given.max() > limits.max:
            raise ArgumentError(f"{what}.{name} takes {limits.min} to {limits.max} (found "
                                f"{_describe(value)})")
    if field.dtype.kind == "b" and given.size and not np.all((given == 0) | (given == 1)):
        raise ArgumentError(f"{what}.{name} takes True or False (found {_describe(value)})")
    try:
        field[...] = given
    except (TypeError, ValueError):
        raise ArgumentError(f"{what}.{name} takes an array of shape {field.shape}, found "
                            f"{given.shape}") from None


def _describe(value: Any) -> str:
    text = repr(value)
    return text if len(text) < 60 else text[:57] + "..."


class Record:
    """Values of a C struct. Members are attributes with the names that they have in C."""

    __slots__ = ("_data",)
    dtype: ClassVar[np.dtype[np.void]]
    _data: npt.NDArray[np.void]

    def __init__(self, **members: Any):
        data = np.zeros((), self.dtype)
        for name, value in members.items():
            assign(data, name, value, type(self).__name__)
        data.setflags(write=False)
        object.__setattr__(self, "_data", data)

    @classmethod
    def of(cls: Type[R], data: Any) -> R:
        """A record of a structured value of its dtype, without a copy."""
        record = cls.__new__(cls)
        array = np.asarray(data)
        if array.dtype != cls.dtype or array.shape:
            raise ArgumentError(f"{cls.__name__} takes one value of {cls.__name__}.dtype")
        array.setflags(write=False)
        object.__setattr__(record, "_data", array)
        return record

    @property
    def array(self) -> npt.NDArray[np.void]:
        """The struct as a read-only NumPy array without dimensions."""
        return self._data

    def _array(self, name: str) -> Any:
        value = self._data[name].view()
        value.setflags(write=False)
        return value

    def __setattr__(self, name: str, value: Any) -> None:
        raise ArgumentError(f"{type(self).__name__} is immutable: use replace({name}=...)")

    def replace(self: R, **members: Any) -> R:
        """A copy with other values of some members."""
        data = self._data.copy()
        for name, value in members.items():
            assign(data, name, value, type(self).__name__)
        return type(self).of(data)

    def _members(self) -> List[Tuple[str, Any]]:
        shown = []
        for name in self.dtype.names or ():
            if isinstance(getattr(type(self), name, None), property):
                shown.append((name, getattr(self, name)))
        return shown

    def to_dict(self) -> "dict[str, Any]":
        """Members by name; nested records as dictionaries."""
        def plain(value: Any) -> Any:
            if isinstance(value, Record):
                return value.to_dict()
            return [plain(v) for v in value] if isinstance(value, tuple) else value
        return {name: plain(value) for name, value in self._members()}

    def __eq__(self, other: object) -> bool:
        return (isinstance(other, Record) and type(other) is type(self)
                and self._key() == other._key())

    def __hash__(self) -> int:
        return hash(self._key())

    def _key(self) -> Any:
        return packed(self._data)

    def __reduce__(self) -> Any:
        return _record, (type(self), packed(self._data))

    def __repr__(self) -> str:
        return f"{type(self).__name__}({', '.join(f'{n}={_short(v)}' for n, v in self._members())})"

    def _repr_html_(self) -> str:
        rows = "".join(f"<tr><th style='text-align:left'>{name}</th>"
                       f"<td style='text-align:left'>{html.escape(_short(value))}</td></tr>"
                       for name, value in self._members())
        return f"<b>{type(self).__name__}</b><table>{rows}</table>"


def packed(array: npt.NDArray[np.void]) -> bytes:
    """Bytes of a structured array, with zeros between its members."""
    mask = _masks.get(array.dtype)
    if mask is None:
        mask = _masks[array.dtype] = np.zeros(array.dtype.itemsize, np.uint8)
        _mark(array.dtype, mask)
    data = np.frombuffer(array.tobytes(), np.uint8)
    return (data.reshape(-1, len(mask)) & mask).tobytes() if len(data) else b""


_masks: Dict["np.dtype[np.void]", npt.NDArray[np.uint8]] = {}


def _mark(dtype: Any, mask: npt.NDArray[np.uint8]) -> None:
    """Sets all bits of the bytes that are members."""
    for name in dtype.names or ():
        member, at = dtype.fields[name][:2]
        for k in range(int(np.prod(member.shape))):
            one = mask[at + k * member.base.itemsize:at + (k + 1) * member.base.itemsize]
            if member.base.names:
                _mark(member.base, one)
            else:
                one[:] = 255


def _short(value: Any) -> str:
    if isinstance(value, np.ndarray):
        return np.array2string(value, precision=6, separator=", ", max_line_width=200)
    return f"{value:.9g}" if isinstance(value, float) else repr(value)


def _record(cls: Type[Record], data: bytes) -> Record:
    """Unpickles a record."""
    return cls.of(np.frombuffer(data, cls.dtype, 1).copy().reshape(()))


class Message(Record):
    """A message of a channel: its members, and `items` as a structured array.

    Given:     items    a structured array, a mapping of columns, or a sequence of records; members
                        that it lacks are 0
               members  values of members by name; the others are 0
    """

    __slots__ = ("items", "scope", "written_tick", "sequence")
    channel: ClassVar[str]
    item_type: ClassVar[Optional[Type[Record]]] = None
    item_dtype: ClassVar[Optional[np.dtype[np.void]]] = None
    items: npt.NDArray[np.void]
    scope: str
    written_tick: int
    sequence: int

    def __init__(self, items: Any = None, **members: Any):
        if "count" in members:
            raise ArgumentError(f"{type(self).__name__}: count is the number of items")
        super().__init__(**members)
        self._set(self._items_of(items), "", -1, -1)

    def _set(self, items: npt.NDArray[np.void], scope: str, tick: int, sequence: int) -> None:
        items.setflags(write=False)
        object.__setattr__(self, "items", items)
        object.__setattr__(self, "scope", scope)
        object.__setattr__(self, "written_tick", tick)
        object.__setattr__(self, "sequence", sequence)

    @classmethod
    def received(cls, header: npt.NDArray[np.void], items: npt.NDArray[np.void], scope: str,
                 tick: int, sequence: int) -> "Message":
        """A message that a simulation published at a tick; takes the arrays over."""
        message = cls.of(header)
        message._set(items, scope, tick, sequence)
        return message

    @classmethod
    def _items_of(cls, items: Any) -> npt.NDArray[np.void]:
        dtype = cls.item_dtype
        if dtype is None:
            if items is not None:
                raise ArgumentError(f"{cls.__name__} has no items")
            return np.zeros(0, np.dtype([]))
        if items is None:
            return np.zeros(0, dtype)
        return structured(items, dtype, f"{cls.__name__}.items")

    def __len__(self) -> int:
        """Number of items; a message without items is true all the same."""
        return len(self.items)

    def __bool__(self) -> bool:
        return True

    def replace(self: "M", items: Any = None, **members: Any) -> "M":
        """A copy with other items or other values of some members."""
        changed = super().replace(**members)
        changed._set(self.items if items is None else self._items_of(items), self.scope,
                     self.written_tick, self.sequence)
        return changed

    def copy(self: "M") -> "M":
        """The same message: messages are copies already, which nothing changes."""
        return self

    def __copy__(self: "M") -> "M":
        return self

    def to_pandas(self) -> Any:
        """The items as a pandas.DataFrame; array members as one column for each element."""
        from .tables import data_frame
        return data_frame(columns_of(self.items))

    def _key(self) -> Any:
        return packed(self._data), packed(self.items)

    def __reduce__(self) -> Any:
        return _message, (type(self), packed(self._data), packed(self.items), self.scope,
                          self.written_tick, self.sequence)

    def __repr__(self) -> str:
        text = super().__repr__()
        if self.item_dtype is not None:
            text = f"{text[:-1]}{', ' if self._members() else ''}items={len(self.items)})"
        return text

    def _repr_html_(self) -> str:
        text = super()._repr_html_()
        if self.item_dtype is None or not len(self.items):
            return text
        names = self.items.dtype.names or ()
        head = "".join(f"<th>{name}</th>" for name in names)
        rows = "".join("<tr>" + "".join(f"<td>{html.escape(str(item[n]))}</td>" for n in names)
                       + "</tr>" for item in self.items[:20])
        left = len(self.items) - 20
        more = f"<p>{left} more</p>" if left > 0 else ""
        return f"{text}<table><tr>{head}</tr>{rows}</table>{more}"


M = TypeVar("M", bound=Message)


def _message(cls: Type[Message], data: bytes, items: bytes, scope: str, tick: int,
             sequence: int) -> Message:
    """Unpickles a message."""
    header = np.frombuffer(data, cls.dtype, 1).copy().reshape(())
    dtype = cls.item_dtype
    array = np.zeros(0, np.dtype([])) if dtype is None else np.frombuffer(items, dtype).copy()
    return cls.received(header, array, scope, tick, sequence)


def structured(items: Any, dtype: np.dtype[np.void], what: str) -> npt.NDArray[np.void]:
    """A new array of a dtype from a structured array, a mapping of columns (scalars are repeated),
    or a sequence of records or mappings."""
    if isinstance(items, np.ndarray) and items.dtype == dtype and items.ndim == 1:
        return np.array(items, dtype)
    if isinstance(items, np.ndarray) and items.dtype.names:
        if items.ndim != 1:
            raise ArgumentError(f"{what} takes one dimension, found shape {items.shape}")
        return _from_columns({n: items[n] for n in items.dtype.names}, len(items), dtype, what)
    if isinstance(items, Mapping):
        lengths = {n: np.shape(v)[0] for n, v in items.items() if np.ndim(v) > 0
                   and not (n in (dtype.names or ()) and np.ndim(v) == len(dtype[n].shape))}
        if len(set(lengths.values())) > 1:
            raise ArgumentError(f"{what}: columns of different lengths: {lengths}")
        count = next(iter(lengths.values())) if lengths else (1 if items else 0)
        return _from_columns(items, count, dtype, what)
    if isinstance(items, Iterable) and not isinstance(items, (str, bytes, np.ndarray)):
        rows = list(items)
        out = np.zeros(len(rows), dtype)
        for at, row in enumerate(rows):
            if isinstance(row, Record):
                row = row.array
            if isinstance(row, (np.void, np.ndarray)) and row.dtype == dtype and row.shape == ():
                out[at] = row
            elif isinstance(row, Mapping):
                for name, value in row.items():
                    assign(out[at:at + 1], name, [value] if np.ndim(value) else value,
                           f"{what}[{at}]")
            else:
                raise ArgumentError(f"{what}[{at}] is {type(row).__name__} (allowed: a record of "
                                    "that type, or a mapping of its members)")
        return out
    raise ArgumentError(f"{what} takes a structured array, a mapping of columns or a sequence of "
                        f"records, not {type(items).__name__}")


def _from_columns(columns: Mapping[str, Any], count: int, dtype: np.dtype[np.void],
                  what: str) -> npt.NDArray[np.void]:
    out = np.zeros(count, dtype)
    for name, value in columns.items():
        if not isinstance(name, str):
            raise ArgumentError(f"{what}: a column's name is {type(name).__name__}, not a text")
        assign(out, name, value, what)
    return out


def columns_of(items: npt.NDArray[np.void]) -> "dict[str, npt.NDArray[Any]]":
    """Columns of a structured array; "direction_gcrf_0" ... for the elements of array members."""
    columns: "dict[str, npt.NDArray[Any]]" = {}
    for name in items.dtype.names or ():
        values = items[name]
        if values.ndim == 1:
            columns[name] = values
            continue
        flat = values.reshape(len(items), -1)
        for k in range(flat.shape[1]):
            columns[f"{name}_{k}"] = flat[:, k]
    return columns
