#!/usr/bin/env python3
"""Every function that a header declares has a comment of its own: a block above it or, for one line, a comment behind
it. libboresight shows the functions and data that include/boresight declares, and nothing else.

    public_functions.py [LIBRARY]     from the root of the sources; LIBRARY: libboresight.so, when it was built
"""

import os
import re
import subprocess
import sys

FOLDERS = ["include", "sim", "scenegen", "gimbal", "imgproc", "tracker", "control", "obsgen"]
FUNCTION = re.compile(r"^(?!static\b|typedef\b|return\b|else\b)[A-Za-z_][\w \t\*]*?[\s\*](bst_\w+)\s*\(", re.M)
DATA = re.compile(r"^extern\s+[\w\s\*]*?\b(bst_\w+)\s*(?:\[[^\]]*\]\s*)*(?:,\s*(bst_\w+)\s*)?;", re.M)


def headers(folders):
    for folder in folders:
        for place, _, names in sorted(os.walk(folder)):
            for name in sorted(names):
                if name.endswith(".h"):
                    yield os.path.join(place, name)


def blanked(text):
    """The text with the letters of comments and preprocessor lines as blanks, so that places in it stay the same."""
    blank = lambda m: re.sub(r"[^\n]", " ", m.group(0))
    text = re.sub(r"/\*.*?\*/|//[^\n]*", blank, text, flags=re.S)
    return re.sub(r"^[ \t]*#(?:[^\n]*\\\n)*[^\n]*", blank, text, flags=re.M)


def is_documented(text, code, start, end):
    """Whether a comment ends on the line above the declaration at `start`, or begins behind its `;` at `end`."""
    if re.match(r"[ \t]*/\*", text[end + 1:]):
        return True
    above = text[:start].rstrip(" \t")
    if not above.endswith("*/\n") or code[:start].rstrip(" \t\n").endswith("\\"):
        return False
    opening = above.rindex("/*")
    behind = above[above.rfind("\n", 0, opening) + 1:opening].strip()  # it is of the declaration before it
    heading = re.fullmatch(r"/\*[\s-]*(\w+\.c|[^/]*----)\s*\*/\n", above[opening:])
    return not behind and not heading


def declarations(path):
    """(name, documented, line) of the functions that a header declares, then of its data."""
    with open(path, encoding="utf-8") as file:
        text = file.read()
    code = blanked(text)
    for match in FUNCTION.finditer(code):
        end = re.compile(r"[;{]").search(code, match.end())
        if end and end.group(0) == ";":
            line = code.count("\n", 0, match.start()) + 1
            yield match.group(1), is_documented(text, code, match.start(), end.start()), line
    for match in DATA.finditer(code):
        for name in match.groups():
            if name:
                yield name, True, code.count("\n", 0, match.start()) + 1


def exported(library):
    """Names that the dynamic linker sees in a library."""
    lines = subprocess.run(["nm", "-D", "--defined-only", library], check=True, capture_output=True, text=True).stdout
    names = {line.split()[-1].split("@")[0] for line in lines.splitlines()}
    return {name for name in names if not name.startswith("_")}  # without the linker's own


def main():
    wrong = []
    count = 0
    for path in headers(FOLDERS):
        for name, documented, line in declarations(path):
            count += 1
            if not documented:
                wrong.append(f"{path}:{line}: {name} has no comment: say what it does, what is given and returned")
    if count < 1000:
        sys.exit(f"only {count} declarations found: run this from the root of the sources")
    if len(sys.argv) > 1:
        declared = {name for path in headers(["include"]) for name, _, _ in declarations(path)}
        shown = exported(sys.argv[1])
        wrong += [f"{name} is declared in include/boresight and not in the library" for name in sorted(declared - shown)]
        wrong += [f"{name} is seen in the library and not declared in include/boresight" for name in sorted(shown - declared)]
    if wrong:
        sys.exit("\n".join(wrong) + f"\n{len(wrong)} of {count} declarations are wrong")
    print(f"{count} declarations are documented")


if __name__ == "__main__":
    main()
