"""Base class of the dataclasses of scenarios."""
from __future__ import annotations

from dataclasses import fields
from typing import Any, Dict


class Block:
    """A block of a scenario. Values that are None are left out."""

    def to_dict(self) -> Dict[str, Any]:
        """The block as JSON has it."""
        out: Dict[str, Any] = {}
        block: Any = self  # a dataclass, as all of boresight.config are
        for field in fields(block):
            value = getattr(self, field.name)
            if value is not None:
                out[field.name.rstrip("_")] = plain(value)
        return out


def plain(value: Any) -> Any:
    """A value as JSON has it: blocks as dictionaries, sequences as lists."""
    if isinstance(value, Block):
        return value.to_dict()
    if isinstance(value, dict):
        return {key: plain(one) for key, one in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(one) for one in value]
    return value.tolist() if hasattr(value, "tolist") else value
