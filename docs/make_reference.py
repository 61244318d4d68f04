#!/usr/bin/env python3
"""Turns a JSON Schema of the program into pages of key tables.

usage: boresight schema | docs/make_reference.py OUT_FOLDER
       boresight study --schema | docs/make_reference.py OUT_FOLDER

Writes OUT_FOLDER/index.md and one page for each large block. A block whose keys were listed before
is not listed again: its section links to the first one. former_names.md lists the former names of
keys, which the schema marks as deprecated.
"""
import json
import pathlib
import sys

SKIPPED = {"description", "$schema"}
# blocks that get a page of their own: path, file, title
PAGES = [("/world", "world", "Keys of /world: stars and objects"),
         ("/observers[]", "observers", "Keys of /observers: orbits and sensors"),
         ("/observers[]/sensors[]/camera", "camera", "Keys of camera: optics and detector"),
         ("/observers[]/sensors[]/knowledge", "knowledge", "Keys of knowledge: onboard errors"),
         ("modules/gimbal/platform", "platform", "Keys of platform: jitter and spacecraft")]


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
        if child.get("deprecated"):
            continue
        if "then" in child:
            below.append((key, "", child))
            rows.append(f"| `{key}` | object, or a [plug-in](../../how-to/plugins.md) |  |  | "
                        f"{cell(child.get('description', ''))} |")
            continue
        doc, unit = split_unit(child.get("description", ""))
        default = f"`{json.dumps(child['default'])}`" if "default" in child else ""
        if key in required:
            default = "required"
        kind = kind_of(child) + (f" [{cell(unit)}]" if unit else "")
        rows.append(f"| `{key}` | {kind} | {range_of(child)} | {cell(default)} | "
                    f"{cell(doc)} |")
        if child.get("type") == "array" and child["items"].get("type") == "object":
            below.append((key, "[]", child["items"]))
        elif "properties" in child and key != "delay_s":
            below.append((key, "", child))
    return rows, below


class Writer:
    """Collects pages; remembers where each set of keys was listed first."""

    def __init__(self, title, intro):
        self.pages = {"index": [f"# {title}\n\n{intro}\n"]}
        self.titles = {}
        self.first = {}
        self.former = []

    def list_former(self, node, path):
        """Former names of the keys of a block."""
        for key, child in node.get("properties", {}).items():
            if child.get("deprecated"):
                now = child["description"].removeprefix("Former name of ").rstrip(".")
                row = f"| `{path or '/'}` | `{key}` | `{now}` |"
                if row not in self.former:
                    self.former.append(row)

    def write_former(self):
        self.open_page("former_names", "Former names of keys")
        self.say("former_names",
                 "Documents with a former name still work. The program logs a warning that gives the present name, "
                 "`boresight check` prints present names only. A key under both names is an error.\n\n"
                 "| block | former name | present name |\n|---|---|---|\n" + "\n".join(self.former) + "\n")

    def open_page(self, name, title):
        self.pages[name] = [f"# {title}\n"]
        self.titles[name] = title

    def say(self, page, text):
        self.pages[page].append(text)

    def modules(self, role, choices, path):
        for choice in choices:
            if choice.get("title"):
                continue  # what any plug-in may say
            kind = choice["properties"]["type"]
            delays = choice["properties"]["delay_s"]["properties"]
            name = kind.get("const") or kind["enum"][0]
            page = f"module_{role}_{name}"
            self.open_page(page, f"Keys of module {role}, type {name}")
            self.say(page, f"{kind.get('description', '')}\n\nInputs that `delay_s` may name: "
                     + (", ".join(f"`{d}`" for d in delays) or "none") + ".\n")
            self.block(choice, path, page, 2)

    def block(self, node, path, page, level):
        rows, below = table(own(node))
        self.list_former(own(node), path)
        if "then" in node:
            properties = node["then"]["properties"]
            rows.append(f"| `plugin` | string |  |  | {cell(properties['plugin']['description'])} |")
        self.say(page, "| key | type [unit] | allowed | default | meaning |\n|---|---|---|---|---|\n"
                 + "\n".join(rows) + "\n")
        for key, tail, child in below:
            if key != "modules":
                self.child(child, f"{path}/{key}{tail}", page, level)
        for role, choices in node.get("properties", {}).get("modules", {}).get("properties", {}).items():
            self.modules(role, choices["oneOf"], f"modules/{role}")
        for key, child in node.get("properties", {}).items():
            if "oneOf" in child:
                self.modules(key, child["oneOf"], f"{path}/{key}")

    def child(self, child, here, page, level):
        keys = json.dumps(own(child).get("properties"), sort_keys=True)
        text = split_unit(child["description"])[0] + "\n" if "description" in child else ""
        known = self.first.get(keys)
        for path, name, title in PAGES:
            if here == path and not known:
                self.say(page, f"{'#' * level} `{here}`\n\n{text}\nSee [{title}]({name}.md).\n")
                self.open_page(name, title)
                self.first[keys] = (here, name)
                self.say(name, text)
                return self.block(child, here, name, 2)
        self.say(page, f"{'#' * level} `{here}`\n\n{text}")
        if known:
            return self.say(page, f"The keys are those of [`{known[0]}`]({known[1]}.md).\n")
        self.first[keys] = (here, page)
        return self.block(child, here, page, min(level + 1, 4))


def main():
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    schema = json.load(sys.stdin)
    if schema["title"] == "Boresight study":
        writer = Writer("Keys of a study", "Generated from `boresight study --schema`. "
                        "[Run a study](../../how-to/studies.md) explains how to use the keys.")
    else:
        writer = Writer("Keys of a scenario",
                        "Generated from `boresight schema`. Every object also takes a `description`, which the "
                        "program ignores. The path of a key is the JSON pointer that `--set` takes; replace `[]` "
                        "by the number of the element.")
    writer.block(schema, "", "index", 2)
    writer.write_former()
    if writer.titles:
        links = "\n".join(f"- [{title}]({name}.md)" for name, title in writer.titles.items())
        toc = "\n".join(writer.titles)
        writer.pages["index"].insert(1, f"{links}\n\n```{{toctree}}\n:hidden:\n{toc}\n```\n")
    folder = pathlib.Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    for name, parts in writer.pages.items():
        (folder / f"{name}.md").write_text("\n".join(parts), encoding="utf-8")


if __name__ == "__main__":
    main()
