"""Makes boresight/messages.py (classes and NumPy types of all messages) and a C file that asserts
at compile time that C lays out the structs in the same way.

    python3 generate_messages.py INCLUDE_FOLDER STRUCTS.py OUT.py OUT.c
"""
from __future__ import annotations

import importlib.util
import pathlib
import re
import sys
import textwrap
from typing import List

from headers import ARRAYS, SCALARS, Enum, Headers, Member, Struct
from layout import Layout

HEAD = '''"""Messages of all channels, their items and enums.

Made from include/boresight/messages by python/generate/generate_messages.py; do not edit.
"""
from __future__ import annotations

import enum
from typing import ClassVar, Dict, Tuple, Type

import numpy as np
import numpy.typing as npt

from .record import Message, Record

'''


def python_name(c_name: str) -> str:
    """bst_attitude_fix -> AttitudeFix; bst_frame_message -> FrameMessage."""
    return "".join(part.capitalize() for part in c_name[len("bst_"):].split("_"))


def docstring(text: str, indent: str) -> str:
    text = text.replace("\\", "\\\\")
    text = text[:1].upper() + text[1:]
    if text and text[-1] not in ".!?":
        text += "."
    lines = textwrap.wrap(f'"""{text}"""', 98 - len(indent)) or ['""""""']
    return f"\n{indent}".join(lines)


def array_kind(member: Member) -> str:
    return {"double": "np.float64", "int64_t": "np.int64", "uint32_t": "np.uint32",
            "bool": "np.bool_"}.get(member.type, "np.float64" if member.type in ARRAYS else
                                    "np.int32")


def numpy_format(member: Member, layout: Layout) -> str:
    shape = list(member.shape)
    if member.pointer:
        base = '"<u8"'
    elif member.type in SCALARS:
        code = SCALARS[member.type][0]
        base = f'"{code}"' if code == "?" else f'"<{code}"'
    elif member.type in ARRAYS:
        base, shape = '"<f8"', shape + [ARRAYS[member.type][0]]
    else:
        base = python_name(member.type) + ".dtype"
    if not shape:
        return base
    dims = ", ".join(str(d) for d in shape) + ("," if len(shape) == 1 else "")
    return f"({base}, ({dims}))"


def property_text(member: Member) -> List[str]:
    """A property that reads a member."""
    if member.pointer or member.flexible or (member.name == "count" and not member.shape):
        return []
    name, doc = member.name, member.doc
    if member.type in ARRAYS:
        doc = f"{doc} ({ARRAYS[member.type][1]})" if doc else ARRAYS[member.type][1]
    nested = member.type not in SCALARS and member.type not in ARRAYS
    if nested and member.shape:
        kind = python_name(member.type)
        returned, value = (f"Tuple[{kind}, ...]",
                           f'tuple({kind}.of(part) for part in self._data["{name}"])')
    elif nested:
        kind = python_name(member.type)
        returned, value = kind, f'{kind}.of(self._data["{name}"])'
    elif member.shape or member.type in ARRAYS:
        returned = value = f"npt.NDArray[{array_kind(member)}]"
    else:
        returned = {"double": "float", "bool": "bool"}.get(member.type, "int")
        value = f'{returned}(self._data["{name}"])'
    lines = ["    @property", f"    def {name}(self) -> {returned}:"]
    if doc:
        lines.append("        " + docstring(doc, "        "))
    if value == returned:  # an array
        return lines + [f'        value: {returned} = self._array("{name}")',
                        "        return value", ""]
    return lines + [f"        return {value}", ""]


def dtype_text(struct: Struct, layout: Layout) -> List[str]:
    lines = ["    dtype: ClassVar[np.dtype[np.void]] = np.dtype({"]
    pairs = [(m, at) for m, at in zip(struct.members, layout.offsets[struct.name])
             if not m.flexible]
    for key, values in (("names", [f'"{m.name}"' for m, _ in pairs]),
                        ("formats", [numpy_format(m, layout) for m, _ in pairs]),
                        ("offsets", [str(at) for _, at in pairs])):
        body = textwrap.fill(", ".join(values), 90, initial_indent=" " * 12,
                             subsequent_indent=" " * 12, break_on_hyphens=False)
        lines += [f'        "{key}": [', body, "        ],"]
    return lines + [f'        "itemsize": {layout.sizes[struct.name][0]},', "    })"]


def class_text(struct: Struct, layout: Layout) -> List[str]:
    name, item = python_name(struct.name), layout.item_of(struct)
    base = "Message" if struct.channel else "Record"
    lines = ["", f"class {name}({base}):", "    " + docstring(struct.doc or name, "    "), "",
             "    __slots__ = ()"]
    if struct.channel:
        lines.append(f'    channel: ClassVar[str] = "{struct.channel}"')
    lines += dtype_text(struct, layout)
    if item:
        lines.append(f"    item_type: ClassVar[Type[Record]] = {python_name(item)}")
        lines.append("    item_dtype: ClassVar[np.dtype[np.void]] = " + python_name(item) + ".dtype")
    lines.append("")
    for member in struct.members:
        lines += property_text(member)
    return lines


def enum_text(enum: Enum) -> List[str]:
    """An enum; its members lose their common prefix. Enums of sizes only are left out."""
    values = [(n, v, d) for n, v, d in enum.values if not n.endswith("_COUNT")]
    name = python_name(enum.name) if enum.name else ""
    prefix = re.match(r"BST_[A-Z]+_", values[0][0])
    if not name and enum.flags and prefix:
        name = python_name("bst_" + prefix[0][4:-1].lower() + "_flag")
    if not name or not prefix:
        return []
    base, kind = ("enum.IntFlag", "Bits") if enum.flags else ("enum.IntEnum", "Values")
    lines = ["", f"class {name}({base}):",
             "    " + docstring(enum.doc or f"{kind} of `{enum.name or prefix[0] + '...'}`", "    "), ""]
    for c_name, value, doc in values:
        lines.append(f"    {c_name[len(prefix[0]):]} = {value}")
        if doc:
            lines.append("    " + docstring(doc, "    "))
    return lines + [""]


def python_text(headers: Headers, layout: Layout) -> str:
    lines: List[str] = []
    for enum in headers.enums:
        lines += enum_text(enum)
    for struct in headers.structs:
        lines += class_text(struct, layout)
    lines += ["", "CHANNELS: Dict[str, Type[Message]] = {"]
    for struct in headers.structs:
        if struct.channel:
            lines.append(f'    "{struct.channel}": {python_name(struct.name)},')
    lines += ["}", '"""Class of the messages of each channel."""', ""]
    return HEAD + "\n".join(lines)


def c_text(headers: Headers, layout: Layout, structs_file: str) -> str:
    """Assertions for the messages and for the ctypes structs of _structs.py."""
    lines = ["/* Asserts that C lays out the structs as the Python package expects. Generated. */",
             '#include "boresight/boresight.h"', '#include "boresight/frame.h"',
             '#include "boresight/module.h"', '#include "boresight/sim_pool.h"',
             '#include "boresight/stages.h"', "",
             '#define SAME(what, number) _Static_assert((what) == (number), "layout of " #what)',
             ""]

    def same(c_name: str, member: str, offset: int) -> None:
        lines.append(f"SAME(offsetof({c_name}, {member}), {offset});")

    for struct in headers.structs:
        lines.append(f"SAME(sizeof({struct.name}), {layout.sizes[struct.name][0]});")
        for member, offset in zip(struct.members, layout.offsets[struct.name]):
            same(struct.name, member.name, offset)
    spec = importlib.util.spec_from_file_location("structs", structs_file)
    assert spec and spec.loader
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    for cls in module.ALL:
        if not getattr(cls, "C_PREFIX", False):
            lines.append(f"SAME(sizeof({cls.C_NAME}), {module.size_of(cls)});")
        for name, *_ in cls._fields_:
            same(cls.C_NAME, name, getattr(cls, name).offset)
    lines.append(f"SAME(BST_STAGE_ABI, {module.STAGE_ABI});")
    lines.append(f"SAME(BST_MODULE_ABI, {module.MODULE_ABI});")
    return "\n".join(lines) + "\n"


def write_if_changed(path: str, text: str) -> None:
    out = pathlib.Path(path)
    out.parent.mkdir(parents=True, exist_ok=True)
    if not out.exists() or out.read_text(encoding="utf-8") != text:
        out.write_text(text, encoding="utf-8")


def main() -> None:
    include, structs_file, python_file, c_file = sys.argv[1:]
    headers = Headers(pathlib.Path(include) / "boresight" / "messages")
    layout = Layout(headers)
    write_if_changed(python_file, python_text(headers, layout))
    write_if_changed(c_file, c_text(headers, layout, structs_file))


if __name__ == "__main__":
    main()
