#!/usr/bin/env python3
"""Every function that a header declares has a comment of its own: a block above it or, for one line, a comment behind
it. libboresight shows the functions and data that include/boresight declares, and nothing else.

    public_functions.py [LIBRARY]     from the root of the sources; LIBRARY: libboresight.so, when it was built
"""

import re
import subprocess
import sys

from c_sources import files, prototypes, without_comments

DATA = re.compile(r"^extern\s+[\w\s\*]*?\b(bst_\w+)\s*(?:\[[^\]]*\]\s*)*(?:,\s*(bst_\w+)\s*)?;", re.M)


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
    code = without_comments(text)
    for name, start, end in prototypes(code):
        yield name, is_documented(text, code, start, end), code.count("\n", 0, start) + 1
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
    for path in files(".h"):
        for name, documented, line in declarations(path):
            count += 1
            if not documented:
                wrong.append(f"{path}:{line}: {name} has no comment: say what it does, what is given and returned")
    if count < 1000:
        sys.exit(f"only {count} declarations found: run this from the root of the sources")
    if len(sys.argv) > 1:
        declared = {name for path in files(".h", ["include"]) for name, _, _ in declarations(path)}
        shown = exported(sys.argv[1])
        wrong += [f"{name} is declared in include/boresight and not in the library" for name in sorted(declared - shown)]
        wrong += [f"{name} is seen in the library and not declared in include/boresight" for name in sorted(shown - declared)]
    if wrong:
        sys.exit("\n".join(wrong) + f"\n{len(wrong)} of {count} declarations are wrong")
    print(f"{count} declarations are documented")


if __name__ == "__main__":
    main()
