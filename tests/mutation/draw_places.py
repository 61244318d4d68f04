#!/usr/bin/env python3
"""Draws places at which to write plausible bugs by hand: a file by its lines with physical quantities, none twice, and one
of these lines; prints the lines about it.

    tests/mutation/draw_places.py 20261127 63 > places.txt
    tests/mutation/draw_places.py 20261127 63 program > places.txt

The second form draws from what the whole program shows (runs, exports, reports, views, modules, files), `formulas` from
the rest; without either it is the folders with formulas as a whole. Lines near a bug of the lists beside this script are
left out.

Write one bug to each place into a list for mutate.py --bugs before you look at the tests: a sign, an axis, an index, a
unit, a factor, a root, a term off the diagonal, an offset of half a pixel or half an exposure.
"""
import glob
import json
import os
import random
import re
import subprocess
import sys

SOURCES = re.compile(r"(sim|scenegen|imgproc|tracker|control|gimbal|obsgen)/.*\.c$")
WITHOUT_FORMULAS = re.compile(r"sim/(app|core|link|device|registry|cli|bench|api|engine|studies)/")
PROGRAM = re.compile(r"sim/(app|run|export|report|engine|io|link|messages|api|process|world|studies|study_kinds|onboard)/"
                     r"|sim/analysis/(check|pd|score|camera|calibration|loop|characterize|new|challenge|solve)/"
                     r"|.*module.*\.c$|.*config\.c$|tracker/catalogue|view/")
QUANTITY = re.compile(r"_(px|rad|radps|s|m|mps|e|deg|gcrf\w*|w|k|mag|snr|m2)\b|\.[xyz]\b|sqrt|cos\(|sin\(|bst_(vec3|quat|mat3)|0\.5"
                      r"|covarian|\[[012]\]|exp\(|log|binning|variance|sigma")
AROUND, LEAST = 5, 6  # lines shown on each side; lines with quantities that a file must have
NEAR = 4              # lines about a bug of a list in which no other is drawn


def quantity_lines(lines):
    return [i for i, line in enumerate(lines)
            if re.match(r"\s{4,}", line) and QUANTITY.search(line) and re.search(r"[-+*/]|[xyz]\b|\[", line)
            and not re.match(r"\s*(/\*|\*|#|static const)", line) and ("=" in line or "return" in line or "(" in line)]


def planted_lines(root):
    """{file: numbers from 0 of the lines of bugs of the lists}"""
    found = {}
    for path in glob.glob(os.path.join(root, "tests", "mutation", "*.json")):
        with open(path, encoding="utf-8") as file:
            bugs = json.load(file)
        for bug in bugs:
            source = os.path.join(root, bug["file"])
            if os.path.exists(source):
                with open(source, encoding="utf-8") as file:
                    text = file.read()
                if bug["old"] in text:
                    found.setdefault(bug["file"], []).append(text.count("\n", 0, text.index(bug["old"])))
    return found


def drawn_from(name, part):
    if part == "program":
        return re.match(r"(sim|scenegen|imgproc|tracker|control|gimbal|obsgen|view)/.*\.c$", name) and PROGRAM.match(name)
    return SOURCES.match(name) and not WITHOUT_FORMULAS.match(name) and not (part == "formulas" and PROGRAM.match(name))


def main():
    rng, count, part = random.Random(int(sys.argv[1])), int(sys.argv[2]), sys.argv[3] if len(sys.argv) > 3 else "all"
    root = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
    planted = planted_lines(root)
    names = subprocess.run(["git", "-C", root, "ls-files"], capture_output=True, text=True, check=True).stdout.split("\n")
    pool = {}
    for name in names:
        if drawn_from(name, part):
            with open(os.path.join(root, name), encoding="utf-8") as file:
                lines = file.read().split("\n")
            places = [i for i in quantity_lines(lines) if all(abs(i - line) > NEAR for line in planted.get(name, []))]
            if len(places) >= LEAST:
                pool[name] = (lines, places)
    left, chosen = list(pool), []
    while len(chosen) < count and left:
        chosen.append(rng.choices(left, [len(pool[name][1]) for name in left])[0])
        left.remove(chosen[-1])
    for name in chosen:
        lines, places = pool[name]
        at = rng.choice(places)
        print(f"=== {name}:{at + 1}")
        for i in range(max(0, at - AROUND), min(len(lines), at + AROUND + 1)):
            print((">" if i == at else " ") + lines[i])


if __name__ == "__main__":
    main()
