"""What the checks of the sources share: which files there are, C without its comments, declared functions."""

import os
import re

FOLDERS = ["include", "sim", "scenegen", "gimbal", "imgproc", "tracker", "control", "obsgen", "view"]
PROTOTYPE = re.compile(r"^(?!static\b|typedef\b|return\b|else\b)[A-Za-z_][\w \t\*]*?[\s\*](bst_\w+)\s*\(", re.M)


def files(suffixes, folders=FOLDERS):
    """The files of the folders whose names end so, in a fixed order."""
    for folder in folders:
        for place, _, names in sorted(os.walk(folder)):
            for name in sorted(names):
                if name.endswith(suffixes):
                    yield os.path.join(place, name)


def without_comments(text):
    """The text with blanks in place of comments, texts, characters and preprocessor lines: lines and places stay."""
    blank = lambda m: re.sub(r"[^\n]", " ", m.group(0))
    text = re.sub(r"/\*.*?\*/|//[^\n]*", blank, text, flags=re.S)
    text = re.sub(r'"(?:\\.|[^"\\\n])*"', blank, text)
    text = re.sub(r"'(?:\\.|[^'\\\n])+'", blank, text)
    return re.sub(r"^[ \t]*#(?:[^\n]*\\\n)*[^\n]*", blank, text, flags=re.M)


def prototypes(code):
    """(name, start, end) of each function that code without comments declares; end: of its semicolon."""
    for match in PROTOTYPE.finditer(code):
        end = re.compile(r"[;{]").search(code, match.end())
        if end and end.group(0) == ";":
            yield match.group(1), match.start(), end.start()
