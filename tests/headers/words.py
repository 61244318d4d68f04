#!/usr/bin/env python3
"""No private words: names and sentences use the terms of the field. Each pattern below once named something in this
project; the message says what it is called now.

    words.py      from the root of the sources
"""

import re
import subprocess
import sys

import c_sources

# pattern (whole words, any case) -> the term
WORDS = {
    r"company|companion light": "neighbours, deblend",
    r"wander(s|ing)?": "centroid error",
    r"islands?|island_notes": "logical process, message log",
    r"stand_ins?|stands_for": "substitution, substitutes_for",
    r"plugged": "plugin",
    r"fates?": "outcome",
    r"promis(e|es|ed|ing)": "lookahead; guarantee",
    r"told|tells|foretells?": "received, reported; detects, states",
    r"foresees|foreseen": "predicts, planned",
    r"anybody|somebody|nobody": "name who",
    r"put aside": "stored, logged",
    r"whoever|(?<!for )whom": "the caller, the consumer: name it",
    r"that which": "what, the one that",
    r"BST_MODULE_(APART|LINKS|PROMISES)": "BST_MODULE_DEFERRABLE, _MULTI_SENSOR, _HAS_LOOKAHEAD",
    r"fft_light|light_wrap|light_grid|growing\.c|crowd\.c|hits\.c|borrow\.h|lanes\.h": "see docs: names of files",
}
FOLDERS = c_sources.FOLDERS + ["python", "docs", "README.md", "tests"]
# Names of objects and users in tests ("nobody"), and this file.
TEST_NAMES = r"anybody|somebody|nobody"
SELF = "tests/headers/words.py"
FILES = re.compile(r"\.(c|h|inc|cl|cpp|py|md|txt)$")


def main():
    names = subprocess.run(["git", "ls-files", *FOLDERS], check=True, capture_output=True, text=True).stdout.split("\n")
    names = [name for name in names if FILES.search(name) and name != SELF]
    if len(names) < 300:
        sys.exit(f"only {len(names)} files found: run this from the root of the sources")
    patterns = [(re.compile(rf"\b({pattern})\b", re.I), term) for pattern, term in WORDS.items()]
    any_word = re.compile(rf"\b(?:{'|'.join(f'(?:{pattern})' for pattern in WORDS)})\b", re.I)
    wrong = []
    for name in names:
        with open(name, encoding="utf-8") as file:
            text = file.read()
            if not any_word.search(text):  # a fifth of the time of the patterns line by line
                continue
            for number, line in enumerate(text.split("\n"), 1):
                for pattern, term in patterns:
                    if name.startswith("tests/") and TEST_NAMES in pattern.pattern:
                        continue
                    for match in pattern.finditer(line):
                        wrong.append(f"{name}:{number}: {match.group(0)!r}: say {term}")
    if wrong:
        sys.exit("\n".join(wrong) + f"\n{len(wrong)} private words")
    print(f"{len(names)} files without private words")


if __name__ == "__main__":
    main()
