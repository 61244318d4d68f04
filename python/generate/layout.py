"""Offsets of struct members by the rules of the C ABI: each at a multiple of its alignment."""
from __future__ import annotations

from typing import Dict, List, Tuple

from headers import ARRAYS, SCALARS, Headers, Member, Struct


class Layout:
    """Offset of each member, size and alignment of each struct."""

    def __init__(self, headers: Headers):
        self.headers = headers
        self.sizes: Dict[str, Tuple[int, int]] = {}  # bytes, alignment
        self.offsets: Dict[str, List[int]] = {}
        for struct in headers.structs:
            self._lay_out(struct)

    def item_of(self, struct: Struct) -> str:
        """C type of a struct's items; "" if it has none."""
        return next((m.type for m in struct.members if m.flexible), "")

    def _member(self, member: Member) -> Tuple[int, int]:
        if member.pointer:
            size, alignment = 8, 8
        elif member.type in SCALARS:
            size = alignment = SCALARS[member.type][1]
        elif member.type in ARRAYS:
            size, alignment = 8 * ARRAYS[member.type][0], 8
        else:
            size, alignment = self.sizes[member.type]
        for dimension in member.shape:
            size *= dimension
        return (0 if member.flexible else size), alignment

    def _lay_out(self, struct: Struct) -> None:
        at, widest, offsets = 0, 1, []
        for member in struct.members:
            size, alignment = self._member(member)
            at = (at + alignment - 1) // alignment * alignment
            offsets.append(at)
            at += size
            widest = max(widest, alignment)
        self.offsets[struct.name] = offsets
        self.sizes[struct.name] = ((at + widest - 1) // widest * widest, widest)
