#!/usr/bin/env python3
"""Turns `boresight schema` into docs/reference.md.

usage: build/boresight schema | docs/make_reference.py > docs/reference.md
"""
import json
import sys

SKIPPED = {"description", "$schema"}


def own(node):
    """The object's own keys, where a plug-in may take its place."""
    return node.get("else", node)


def kind_of(node):
    if not {"const", "enum", "type", "properties", "pattern"} & set(node):
        return "any"
    if "const" in node:
        return f'`"{node["const"]}"`'
    if "enum" in node:
        return ", ".join(f"`{choice}`" for choice in node["enum"])
    kind = node.get("type", "object")
    if kind == ["number", "null"]:
        return "number or `null`"
    if "pattern" in node:
        return "seed: `\"0x…\"`, decimal string or integer"
    if kind == "array" and node["items"].get("type") == "object":
        return "list of objects"
    if kind == "array" and "enum" in node["items"]:
        return "list of " + ", ".join(f"`{choice}`" for choice in node["items"]["enum"])
    if kind == "array":
        return f"{node['minItems']} numbers"
    return kind


def number(value):
    text = f"{value:.12g}" if abs(value) < 1e6 else f"{value:.6e}"
    if "e" in text and "." in text:
        mantissa, exponent = text.split("e")
        text = mantissa.rstrip("0").rstrip(".") + "e" + exponent
    return text.replace("e+0", "e").replace("e-0", "e-").replace("e+", "e")


def range_of(node):
    if node.get("type") == "array":
        item = node.get("items", {})
        if item.get("type") == "object":
            return f"{number(node['minItems'])} to {number(node['maxItems'])} of them"
        node = item
    if "pattern" in node:
        return "up to 64 bits"
    if "minimum" in node:
        return f"{number(node['minimum'])} to {number(node['maximum'])}"
    if "maxLength" in node:
        return f"up to {number(node['maxLength'])} bytes"
    return ""


def split_unit(text):
    if text.endswith("]") and " [" in text:
        doc, unit = text[:-1].rsplit(" [", 1)
        return doc, unit
    return text, ""


def cell(text):
    return text.replace("|", "\\|")


def table(node):
    """Rows of an object's own keys, and the blocks below it."""
    rows, below = [], []
    # a scenario that extends another needs none of those that one on its own needs
    required = node.get("required", [key for choice in node.get("anyOf", [])
                                     for key in choice["required"] if key != "extends"])
    for key, child in node.get("properties", {}).items():
        if key in SKIPPED and child.get("type") == "string" and len(child) == 1:
            continue
        if "then" in child:
            below.append((key, "", child))
            rows.append(f"| `{key}` | object, or a [plug-in](plugins.md) |  |  |  | "
                        f"{cell(child.get('description', ''))} |")
            continue
        doc, unit = split_unit(child.get("description", ""))
        default = f"`{json.dumps(child['default'])}`" if "default" in child else ""
        if key in required:
            default = "required"
        rows.append(f"| `{key}` | {kind_of(child)} | {cell(unit)} | {range_of(child)} | {cell(default)} | "
                    f"{cell(doc)} |")
        if child.get("type") == "array" and child["items"].get("type") == "object":
            below.append((key, "[]", child["items"]))
        elif "properties" in child and key != "delay_s":
            below.append((key, "", child))
    return rows, below


def write_modules(role, choices, path):
    for choice in choices:
        if choice.get("title"):
            continue  # what any plug-in may say
        kind = choice["properties"]["type"]
        delays = choice["properties"]["delay_s"]["properties"]
        name = kind.get("const") or kind["enum"][0]
        print(f"## Module `{role}` of type `{name}`\n\n{kind.get('description', '')}\n")
        print("Inputs that `delay_s` may name: "
              + (", ".join(f"`{d}`" for d in delays) or "none") + ".\n")
        write(choice, path, 3)


def write(node, path, level):
    rows, below = table(own(node))
    if "then" in node:
        properties = node["then"]["properties"]
        rows.append(f"| `plugin` | string |  |  |  | {cell(properties['plugin']['description'])} |")
    modules = [b for b in below if b[0] == "modules"]
    print("| key | type | unit | allowed | default | meaning |\n|---|---|---|---|---|---|")
    print("\n".join(rows) + "\n")
    for key, tail, child in below:
        if (key, tail, child) in modules:
            continue
        here = f"{path}/{key}{tail}"
        print(f"{'#' * level} `{here}`\n")
        if "description" in child:
            print(split_unit(child["description"])[0] + "\n")
        write(child, here, min(level + 1, 4))
    for key, _, child in modules:
        for role, choices in child["properties"].items():
            write_modules(role, choices["oneOf"], f"modules/{role}")
    for key, child in node.get("properties", {}).items():
        if "oneOf" in child:
            write_modules(key, child["oneOf"], f"{path}/{key}")


def main():
    schema = json.load(sys.stdin)
    if schema["title"] == "Boresight study":
        print("# Reference of the study keys\n\n"
              "Made from the program's own tables: `build/boresight study --schema | "
              "docs/make_reference.py > docs/study_reference.md`.\nWhat the keys are for is in "
              "[studies](studies.md).\n\n## The study\n")
    else:
        print("# Reference of the scenario keys\n\n"
              "Made from the program's own tables: `build/boresight schema | docs/make_reference.py > "
              "docs/reference.md`.\nEvery object also takes a `description`, which is ignored. The path of a "
              "key is what `--set` takes, with\nthe number of the element in place of `[]`.\n\n## The scenario\n")
    write(schema, "", 2)


if __name__ == "__main__":
    main()
