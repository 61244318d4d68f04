"""Reads the message structs and enums of include/boresight/messages, with the comments on their members."""
from __future__ import annotations

import pathlib
import re
from dataclasses import dataclass, field
from typing import Dict, List, Optional, Tuple

SCALARS = {"int64_t": ("i8", 8), "int32_t": ("i4", 4), "uint32_t": ("u4", 4), "int": ("i4", 4),
           "double": ("f8", 8), "bool": ("?", 1)}
# vectors and quaternions become arrays: number of doubles, and what they hold
ARRAYS = {"bst_vec3": (3, "x, y, z"), "bst_quat": (4, "x, y, z, w")}


@dataclass
class Member:
    """A member of a struct. `type` is a C type; `shape` holds its array dimensions."""
    name: str
    type: str
    shape: Tuple[int, ...] = ()
    pointer: bool = False
    flexible: bool = False
    doc: str = ""


@dataclass
class Struct:
    """A struct with its members in order. `channel` is "" for a part of a message."""
    name: str
    doc: str
    members: List[Member] = field(default_factory=list)
    channel: str = ""


@dataclass
class Enum:
    """An enum. `flags`: its values are single bits."""
    name: str
    doc: str
    values: List[Tuple[str, int, str]] = field(default_factory=list)
    flags: bool = False


def clean(comment: str) -> str:
    """The text of a comment on one line."""
    return re.sub(r"\s+(\* )?", " ", comment.strip()[2:-2]).strip()


def split_members(body: str, separator: str) -> List[Tuple[str, str]]:
    """Declarations of a body with their comments: one on the line of its declaration belongs to it,
    one on lines of its own to the declaration that follows."""
    out: List[Tuple[str, str]] = []
    code, pending, on_line = "", "", False
    for token in re.findall(r"/\*.*?\*/|\n|[^/\n]+|/", body, re.S):
        if token.startswith("/*"):
            if not code.strip() and on_line and out:
                last, doc = out[-1]
                out[-1] = (last, (doc + " " + clean(token)).strip())
            else:
                pending = (pending + " " + clean(token)).strip()
        elif token == "\n":
            on_line = False
            code += " "
        else:
            parts = re.split(separator + r"(?![^(]*\))", token)
            for part in parts[:-1]:
                out.append(((code + part).strip(), pending))
                code, pending, on_line = "", "", True
            code += parts[-1]
    if code.strip():
        out.append((code.strip(), pending))
    return out


class Headers:
    """All structs and enums of the message headers."""

    def __init__(self, folder: pathlib.Path):
        self.constants: Dict[str, int] = {}
        self.structs: List[Struct] = []
        self.enums: List[Enum] = []
        texts = [path.read_text(encoding="utf-8") for path in sorted(folder.glob("*.h"))]
        for text in texts:
            self._read_enums(text)
        for text in texts:
            self._read_structs(text)
        self._order()

    def struct(self, name: str) -> Optional[Struct]:
        """The struct of a C name."""
        return next((s for s in self.structs if s.name == name), None)

    def _value(self, text: str) -> int:
        text = re.sub(r"\b(\d+)u\b", r"\1", text.strip())
        for name in re.findall(r"[A-Z_]\w+", text):
            text = text.replace(name, str(self.constants[name]))
        if not re.fullmatch(r"[\d\s<()+*-]+", text):
            raise ValueError(f"not a constant expression: {text}")
        return int(eval(text))  # pylint: disable=eval-used

    def _read_enums(self, text: str) -> None:
        pattern = r"(/\*(?:(?!\*/).)*\*/\n)?(?:typedef )?enum (bst_\w+ )?\{(.*?)\}\s*(\w*);"
        for match in re.finditer(pattern, text, re.S):
            doc = clean(match[1].strip()) if match[1] else ""
            enum, following = Enum(match[4], doc), 0
            for code, comment in split_members(match[3], ","):
                name, _, value = code.partition("=")
                number = self._value(value) if value else following
                following = number + 1
                self.constants[name.strip()] = number
                enum.values.append((name.strip(), number, comment))
                enum.flags = enum.flags or "<<" in value
            self.enums.append(enum)

    def _read_structs(self, text: str) -> None:
        channels = dict((value, key) for key, value in
                        re.findall(r'#define BST_CHANNEL_(\w+) "(\w+)"', text))
        pattern = r"(/\*(?:(?!\*/).)*\*/\n)?typedef struct (bst_\w+) \{(.*?)\n\} \2;"
        for match in re.finditer(pattern, text, re.S):
            struct = Struct(match[2], clean(match[1].strip()) if match[1] else "")
            short = struct.name[len("bst_"):]
            struct.channel = "frame" if short == "frame_message" else short
            if struct.channel not in channels:
                struct.channel = ""
            for code, comment in split_members(match[3], ";"):
                struct.members += self._declaration(code, comment)
            self.structs.append(struct)

    def _declaration(self, code: str, comment: str) -> List[Member]:
        code = code.replace("const ", "")
        first, rest = code.split(None, 1)
        members = []
        for one in rest.split(","):
            match = re.fullmatch(r"\s*(\*?)\s*(\w+)((?:\[\w*\])*)\s*", one)
            if not match:
                raise ValueError(f"this declaration is not understood: {code}")
            dimensions = re.findall(r"\[(\w*)\]", match[3])
            flexible = dimensions == [""]
            shape = () if flexible else tuple(self._value(d) for d in dimensions)
            members.append(Member(match[2], first, shape, bool(match[1]), flexible, comment))
        return members

    def _order(self) -> None:
        """Parts before the structs that contain them."""
        done: List[Struct] = []

        def visit(struct: Struct) -> None:
            for member in struct.members:
                part = self.struct(member.type)
                if part and part not in done and not member.pointer:
                    visit(part)
            if struct not in done:
                done.append(struct)

        for struct in list(self.structs):
            visit(struct)
        self.structs = done
