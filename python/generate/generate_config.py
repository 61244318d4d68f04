"""Makes boresight/config.py, typed dataclasses of scenarios, from the JSON Schema of scenarios.

    python3 generate_config.py boresight.schema.json OUT.py
"""
from __future__ import annotations

import json
import keyword
import pathlib
import sys
import textwrap
from typing import Any, Dict, List, Tuple

HEAD = '''"""Typed dataclasses of scenarios: editors complete their keys, type checkers check their values.

Made from the JSON Schema of scenarios by python/generate/generate_config.py; do not edit. A value
that is None is left out, so that the default applies; `Scenario.of` takes a `config.Scenario`.
"""
from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Dict, Literal, Optional, Sequence, Union

from .block import Block

'''
SIMPLE = {"number": "float", "integer": "int", "string": "str", "boolean": "bool", "null": "None"}


def camel(key: str) -> str:
    return "".join(part.capitalize() for part in key.split("_"))


def singular(key: str) -> str:
    if key.endswith("ies"):
        return key[:-3] + "y"
    return key[:-1] if key.endswith("s") and not key.endswith("ss") else key


class Writer:
    """Collects a class for each kind of object in a schema."""

    def __init__(self) -> None:
        self.lines: List[str] = []
        self.names: Dict[str, str] = {}  # by the text of the object's properties
        self.used: Dict[str, str] = {}   # text by name

    def type_of(self, node: Dict[str, Any], key: str, parents: Tuple[str, ...]) -> str:
        """The annotation of a value."""
        if "enum" in node:
            return "Literal[" + ", ".join(json.dumps(v) for v in node["enum"]) + "]"
        if "const" in node:
            return f"Literal[{json.dumps(node['const'])}]"
        for word in ("oneOf", "anyOf"):
            if word in node and "properties" not in node:
                return self.union([self.alternative(n, key, parents) for n in node[word]])
        kinds = node.get("type", "any")
        if isinstance(kinds, list):
            return self.union([self.type_of({**node, "type": k}, key, parents) for k in kinds])
        if kinds == "array":
            item = self.type_of(node["items"], singular(key), parents) if isinstance(
                node.get("items"), dict) else "Any"
            return f"Sequence[{item}]"
        if kinds == "object":
            if node.get("additionalProperties") is False and node.get("properties"):
                return self.class_of(node, key, parents)
            return "Dict[str, Any]"
        return SIMPLE.get(kinds, "Any")

    @staticmethod
    def union(kinds: List[str]) -> str:
        unique = list(dict.fromkeys(kinds))
        return unique[0] if len(unique) == 1 else "Union[" + ", ".join(unique) + "]"

    def alternative(self, node: Dict[str, Any], key: str, parents: Tuple[str, ...]) -> str:
        """One of several kinds of an object, named after its type: SecondOrderGimbal."""
        kind = node.get("properties", {}).get("type", {})
        name = kind.get("const") or (kind.get("enum") or [None])[0]
        if node.get("type") == "object" and isinstance(name, str):
            if node.get("additionalProperties") is False:
                return self.class_of(node, f"{name}_{key}", parents)
        return self.type_of(node, key, parents)

    def class_of(self, node: Dict[str, Any], key: str, parents: Tuple[str, ...]) -> str:
        """Name of the class of an object, which is written at its first use."""
        text = json.dumps(node["properties"], sort_keys=True)
        if text in self.names:
            return self.names[text]
        for count in range(len(parents) + 1):
            name = camel("_".join([*parents[len(parents) - count:], key]))
            if name not in self.used:
                break
        else:
            name = f"{camel(key)}{sum(n.startswith(camel(key)) for n in self.used) + 1}"
        self.names[text], self.used[name] = name, text
        lines = ["", "@dataclass", f"class {name}(Block):",
                 "    " + doc(node.get("description") or f"The block `{key}`.", "    "), ""]
        for member, value in node["properties"].items():
            if value.get("deprecated") or not member.isidentifier():
                continue
            kind = self.type_of(value, member, (*parents, key))
            fixed = None
            if member == "type" and member in node.get("required", []):
                fixed = value.get("const") or (value.get("enum") or [None])[0]
            default = json.dumps(fixed) if fixed is not None else "None"
            shown = member + "_" if keyword.iskeyword(member) else member
            lines.append(f"    {shown}: {kind if fixed is not None else f'Optional[{kind}]'} = "
                         f"{default}")
            if value.get("description"):
                lines.append("    " + doc(value["description"], "    "))
        self.lines += [*lines, ""]
        return name


def doc(text: str, indent: str) -> str:
    text = text.replace("\\", "\\\\").replace('"""', "'''")
    if text.endswith('"'):
        text += " "
    return f"\n{indent}".join(textwrap.wrap(f'"""{text}"""', 98 - len(indent),
                                            break_long_words=False))


def main() -> None:
    schema_file, out = sys.argv[1:]
    schema = json.loads(pathlib.Path(schema_file).read_text(encoding="utf-8"))
    schema["description"] = "A scenario."
    for word in ("anyOf", "dependentRequired"):
        schema.pop(word, None)
    writer = Writer()
    writer.class_of(schema, "scenario", ())
    text = HEAD + "\n".join(writer.lines)
    path = pathlib.Path(out)
    path.parent.mkdir(parents=True, exist_ok=True)
    if not path.exists() or path.read_text(encoding="utf-8") != text:
        path.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
