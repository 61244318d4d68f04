#!/usr/bin/env python3
"""Draws places at which to write plausible bugs by hand: a file by its lines with physical quantities, none twice, and one
of these lines; prints the lines about it.

    tests/mutation/draw_places.py 20261127 63 > places.txt

Write one bug to each place into a list for mutate.py --bugs before you look at the tests: a sign, an axis, an index, a
unit, a factor, a root, a term off the diagonal, an offset of half a pixel or half an exposure.
"""
import os
import random
import re
import subprocess
import sys

SOURCES = re.compile(r"(sim|scenegen|imgproc|tracker|control|gimbal|obsgen)/.*\.c$")
WITHOUT_FORMULAS = re.compile(r"sim/(app|core|link|device|registry|cli|bench|api|engine|studies)/")
QUANTITY = re.compile(r"_(px|rad|radps|s|m|mps|e|deg|gcrf\w*|w|k|mag|snr|m2)\b|\.[xyz]\b|sqrt|cos\(|sin\(|bst_(vec3|quat|mat3)|0\.5"
                      r"|covarian|\[[012]\]|exp\(|log|binning|variance|sigma")
AROUND, LEAST = 5, 6  # lines shown on each side; lines with quantities that a file must have


def quantity_lines(lines):
    return [i for i, line in enumerate(lines)
            if re.match(r"\s{4,}", line) and QUANTITY.search(line) and re.search(r"[-+*/]|[xyz]\b|\[", line)
            and not re.match(r"\s*(/\*|\*|#|static const)", line) and ("=" in line or "return" in line or "(" in line)]


def main():
    rng, count = random.Random(int(sys.argv[1])), int(sys.argv[2])
    root = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
    names = subprocess.run(["git", "-C", root, "ls-files"], capture_output=True, text=True, check=True).stdout.split("\n")
    pool = {}
    for name in names:
        if SOURCES.match(name) and not WITHOUT_FORMULAS.match(name):
            with open(os.path.join(root, name), encoding="utf-8") as file:
                lines = file.read().split("\n")
            places = quantity_lines(lines)
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
