#!/usr/bin/env python3
"""No source file over 600 lines (tables of data excepted), and no path of one machine in any file.

    tree.py      from the root of the sources
"""

import os
import re
import sys

import c_sources

LONGEST = 600
TABLES = {"sim/astro/eop_table.c", "tests/astro/astropy_reference.h"}
FOLDERS = c_sources.FOLDERS + ["tests", "cmake", "scenarios", "docs", ".ci"]
TEXTS = re.compile(r"\.(c|h|inc|cpp|cl|py|cmake|txt|json|md|tle|sh)$|^\.ci/")
SOURCES = re.compile(r"\.(c|h|cpp|cl|py)$")
# written apart, so that this file is no match itself; /home/someone is an example's user
PERSONAL = re.compile(r"/(?:wor[k]|hom[e]|roo[t]|User[s]|mn[t])/(?!someone/)[A-Za-z0-9_.-]+/")


def main():
    wrong, count = [], 0
    for folder in FOLDERS:
        for place, folders, names in os.walk(folder):
            folders[:] = [name for name in folders if name != "__pycache__"]
            for path in sorted(os.path.join(place, name) for name in names):
                if not TEXTS.search(path):
                    continue
                count += 1
                with open(path, encoding="utf-8", errors="replace") as file:
                    text = file.read()
                personal = PERSONAL.search(text)
                if personal:
                    wrong.append(f"{path} names a path of one machine: {personal.group(0)}")
                lines = text.count("\n")
                if SOURCES.search(path) and path not in TABLES and lines > LONGEST:
                    wrong.append(f"{path} has {lines} lines (at most {LONGEST})")
    if count < 1000:
        sys.exit(f"only {count} files found: run this from the root of the sources")
    if wrong:
        sys.exit("\n".join(wrong))
    print(f"{count} files looked at")


if __name__ == "__main__":
    main()
