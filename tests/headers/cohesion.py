#!/usr/bin/env python3
"""Counts what makes code hard to follow, and fails where there is more of it than allowed.

    cohesion.py [--list]     from the root of the sources; --list names every case

- call cycles: groups of files whose functions call each other in a circle
- long functions: more than 80 lines from head to closing brace
- long parameter lists: 8 parameters or more
- copies: a static function of three lines or more that stands in several files with the same name and text
- namesakes: a function or type that several headers declare under one name
- long command files: files of sim/app with 150 lines or more; what a command does belongs into the libraries
"""

import collections
import re
import sys

from c_sources import files, prototypes, without_comments

ALLOWED = {"call cycles": 5, "long functions": 0, "long parameter lists": 30, "copies": 0, "namesakes": 0,
           "long command files": 0}
LONGEST = 80
MOST_PARAMETERS = 7
LONGEST_COMMAND = 149

HEAD = re.compile(r"^(?!typedef|struct|enum|union|extern|#)((?:[A-Za-z_][\w\*]*[ \t\n\*]+)+)(\w+)\(", re.M)
CALL = re.compile(r"\b([a-z_]\w+)\s*\(")
TYPE = re.compile(r"^\}\s*(bst_\w+);", re.M)


def closing(text, at, pair):
    """Place of the bracket that closes the one at `at`."""
    depth = 0
    for match in re.compile("[" + re.escape(pair) + "]").finditer(text, at):
        depth += 1 if match.group(0) == pair[0] else -1
        if depth == 0:
            return match.start()
    return len(text)


def parameters(text):
    """Number of parameters of a list, commas in brackets not counted."""
    depth, count = 0, 1
    for letter in text:
        depth += letter in "([" 
        depth -= letter in ")]"
        count += letter == "," and depth == 0
    return 0 if text.strip() in ("", "void") else count


Function = collections.namedtuple("Function", "name path line lines parameters static body")


def functions(path):
    with open(path, encoding="utf-8") as file:
        text = without_comments(file.read())
    at = 0
    while match := HEAD.search(text, at):
        end = closing(text, match.end() - 1, "()")
        rest = re.compile(r"\s*(?:__attribute__\s*\(\(.*?\)\)\s*)?\{").match(text, end + 1)
        if not rest:
            at = match.end()
            continue
        last = closing(text, rest.end() - 1, "{}")
        line = text.count("\n", 0, match.start()) + 1
        yield Function(match.group(2), path, line, text.count("\n", match.start(), last) + 1,
                       parameters(text[match.end():end]), "static" in match.group(1),
                       " ".join(text[match.end() - 1:last].split()))
        at = last


def circles(edges):
    """Groups of files that call each other in a circle (Tarjan 1972)."""
    index, low, stack, found = {}, {}, [], []

    def visit(node):
        index[node] = low[node] = len(index)
        stack.append(node)
        for other in sorted(edges[node]):
            if other not in index:
                visit(other)
                low[node] = min(low[node], low[other])
            elif other in stack:
                low[node] = min(low[node], index[other])
        if low[node] == index[node]:
            group = []
            while not group or group[-1] != node:
                group.append(stack.pop())
            if len(group) > 1:
                found.append(sorted(group))

    for node in sorted(edges):
        if node not in index:
            visit(node)
    return found


def namesakes():
    places = collections.defaultdict(set)
    for path in files((".h",)):
        with open(path, encoding="utf-8") as file:
            text = without_comments(file.read())
        for name in TYPE.findall(text):
            places[name].add(path)
        for name, _, _ in prototypes(text):
            places[name].add(path)
    return [f"{name}: {', '.join(sorted(paths))}" for name, paths in sorted(places.items()) if len(paths) > 1]


def long_commands():
    found = []
    for path in files((".c",)):
        if path.startswith("sim/app/"):
            with open(path, encoding="utf-8") as file:
                lines = len(file.readlines())
            if lines > LONGEST_COMMAND:
                found.append(f"{path}: {lines} lines")
    return found


def main():
    sys.setrecursionlimit(10000)
    everything = [f for path in files((".c", ".inc")) for f in functions(path)]
    if len(everything) < 1000:
        sys.exit(f"only {len(everything)} functions found: run this from the root of the sources")
    owner = {f.name: f.path for f in everything if not f.static and f.path.endswith(".c")}
    edges = collections.defaultdict(set)
    for f in everything:
        for name in CALL.findall(f.body):
            if name in owner and owner[name] != f.path and f.path.endswith(".c"):
                edges[f.path].add(owner[name])
                edges[owner[name]]  # known, also without calls of its own
    copies = collections.defaultdict(set)
    for f in everything:
        if f.static and f.lines >= 3:
            copies[f.name, f.body].add(f.path)
    cases = {
        "call cycles": [", ".join(group) for group in circles(edges)],
        "long functions": [f"{f.path}:{f.line}: {f.name}, {f.lines} lines" for f in everything if f.lines > LONGEST],
        "long parameter lists": [f"{f.path}:{f.line}: {f.name}, {f.parameters}" for f in everything
                                 if f.parameters > MOST_PARAMETERS],
        "copies": [f"{name}: {', '.join(sorted(paths))}" for (name, _), paths in sorted(copies.items()) if len(paths) > 1],
        "namesakes": namesakes(),
        "long command files": long_commands(),
    }
    for what, found in cases.items():
        print(f"{what}: {len(found)}, at most {ALLOWED[what]}")
        if "--list" in sys.argv[1:] or len(found) > ALLOWED[what]:
            print("".join(f"  {case}\n" for case in found), end="")
    sys.exit(any(len(found) > ALLOWED[what] for what, found in cases.items()))


if __name__ == "__main__":
    main()
