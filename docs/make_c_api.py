#!/usr/bin/env python3
"""Writes one Markdown page for each public C header, from its comment blocks.

usage: docs/make_c_api.py HEADERS_FOLDER OUT_FOLDER

HEADERS_FOLDER is include/boresight, of the repository or installed: both have the same headers.
Programs include them as "boresight/NAME.h", by the name of that folder.
"""
import pathlib
import re
import sys
import textwrap

SECTION = re.compile(r"(Given|Given and returned|Returned|Errors|Ownership|Notes?|References?|Threads?)\s*:\s*(.*)", re.DOTALL)
NAME = re.compile(r"\b((?:bst|BST)_\w+)\b")


def markdown(text):
    """Plain comment text as Markdown; names of the interface as code, and what is between backquotes already."""
    if match := re.search(r"`[^`]+`", text):
        return markdown(text[:match.start()]) + match[0] + markdown(text[match.end():])
    out = re.sub(r"([\\`*<>\[\]#|$~])", r"\\\1", text)
    out = re.sub(r"(?<![\w`])([A-Za-z]\w*_\w*(?:->\w+|\.\w+)?)", r"`\1`", out)
    return re.sub(r"(?m)^(\s*)([-+]|\d+\.)(\s)", r"\1\\\2\3", out)


def unwrap(comment):
    """Lines of a comment without its stars."""
    body = re.sub(r"^/\*+\s?|\s*\*+/$", "", comment.strip())
    return [re.sub(r"^\s*\* ?", "", line).rstrip() for line in body.split("\n")]


def describe(comment):
    """A comment block as paragraphs; its named parts as bold labels with lists of arguments."""
    paragraphs, current = [], []
    for line in unwrap(comment):
        if not line.strip() or SECTION.match(line.strip()):
            paragraphs.append(current)
            current = []
        if line.strip():
            current.append(line)
    paragraphs.append(current)
    out = []
    for lines in filter(None, paragraphs):
        match = SECTION.match(lines[0].strip())
        if not match and all(line.startswith("  ") for line in lines):
            out.append("```c\n" + textwrap.dedent("\n".join(lines)) + "\n```")
            continue
        if not match:
            out.append(markdown(" ".join(line.strip() for line in lines)))
            continue
        label, first = match[1], match[2]
        rows = ([first] if first else []) + [line.strip() for line in lines[1:]]
        items = []
        for row in rows:
            parts = re.split(r"\s{2,}", row, maxsplit=1)
            if len(parts) == 2 and re.fullmatch(r"[*&\w\[\], .>-]+", parts[0]):
                items.append([parts[0], parts[1]])
            elif items:
                items[-1][1] += " " + row
            else:
                items.append(["", row])
        if any(name for name, _ in items):
            out.append(f"**{label}:**\n\n" + "\n".join(
                f"- `{name}`: {markdown(text)}" if name else f"- {markdown(text)}" for name, text in items))
        else:
            out.append(f"**{label}:** {markdown(' '.join(text for _, text in items))}")
    return "\n\n".join(out)


def items(text):
    """(comment, declaration) of each item at file scope; a comment alone has no declaration."""
    position, comment = 0, ""
    while position < len(text):
        rest = text[position:]
        space = re.match(r"\s+", rest)
        if space:
            if comment and space[0].count("\n") > 1:
                yield comment, ""
                comment = ""
            position += len(space[0])
            continue
        block = re.match(r"/\*.*?\*/", rest, re.DOTALL)
        if block:
            if comment:
                yield comment, ""
            comment = block[0]
            position += len(block[0])
            continue
        if rest[0] == "#":
            line = re.match(r"#(?:[^\\\n]|\\\n|\\.)*", rest)[0]
            position += len(line)
            if re.match(r"#\s*define\s+\w+_H\s*$", line) or not re.match(r"#\s*define", line):
                continue
            trailing = re.search(r"/\*.*?\*/\s*$", line, re.DOTALL)
            after = trailing[0] if trailing else ""
            yield comment or after, line[:len(line) - len(after)].rstrip()
            comment = ""
            continue
        if re.match(r'extern "C" \{|\}', rest):
            position += len(re.match(r'extern "C" \{|\}', rest)[0])
            continue
        depth, end, signature = 0, 0, None
        masked = re.sub(r"/\*.*?\*/", lambda m: " " * len(m[0]), rest, flags=re.DOTALL)
        for end, letter in enumerate(masked):
            if letter == "{":
                if depth == 0 and re.search(r"\)\s*$", masked[:end]):
                    signature = rest[:end].rstrip() + ";"
                depth += 1
            elif letter == "}":
                depth -= 1
                if depth == 0 and signature:
                    break
            elif letter == ";" and depth == 0:
                break
        yield comment, signature or rest[:end + 1]
        comment = ""
        position += end + 1


def name_of(declaration):
    for pattern in (r"#\s*define\s+(\w+)", r"\}\s*(\w+)\s*;\s*$", r"(?:struct|enum|union)\s+(bst_\w+)\s*[;{]",
                    r"\(\*(\w+)\)", r"\b(bst_\w+)\s*\(", r"\b((?:bst|BST)_\w+)"):
        match = re.search(pattern, declaration)
        if match:
            return match[1]
    return ""



def page(header, text):
    out = []
    seen = set()
    first = True
    for comment, declaration in items(text):
        if not declaration:
            if comment:
                out.append(describe(comment) + "\n")
            first = False
            continue
        if first and comment and declaration.startswith("#"):
            out.append(describe(comment) + "\n")
        first = False
        name = name_of(declaration)
        if not name or re.fullmatch(r"(typedef )?(struct|enum) \w+( \w+)?;", declaration.strip()) and not comment:
            continue
        if name not in seen:
            out.append(f"## {name}\n")
            seen.add(name)
        out.append(f"```c\n{declaration.strip()}\n```\n")
        if comment:
            out.append(describe(comment) + "\n")
    include = f"`#include \"{header}\"`"
    return f"# {header}\n\n{include}\n\n" + "\n".join(out)


def main():
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    source, target = (pathlib.Path(word).resolve() for word in sys.argv[1:])
    headers = sorted(source.rglob("*.h"))
    if not headers:
        sys.exit(f"{source}: there are no headers here")
    target.mkdir(parents=True, exist_ok=True)
    listed = []
    for path in headers:
        name = path.relative_to(source).as_posix()
        header = f"{source.name}/{name}"
        out = name.replace("/", "_").removesuffix(".h")
        text = path.read_text(encoding="utf-8")
        (target / f"{out}.md").write_text(page(header, text), encoding="utf-8")
        match = re.match(r"\s*(/\*.*?\*/)", text, re.DOTALL)
        purpose = re.split(r"(?<=\.)\s+(?=[A-Z])|\s{2,}", " ".join(unwrap(match[1])).strip())[0] if match else ""
        listed.append((header, out, purpose))
    rows = "\n".join(f"| [{header}]({out}.md) | {markdown(purpose)} |" for header, out, purpose in listed)
    toc = "\n".join(out for _, out, _ in listed)
    (target / "index.md").write_text(
        "# C API\n\nThese pages are generated from the comment blocks of the public headers. "
        "[Use Boresight as a library](../../how-to/library.md) shows how to compile and link.\n\n"
        f"| header | purpose |\n|---|---|\n{rows}\n\n```{{toctree}}\n:hidden:\n:maxdepth: 1\n{toc}\n```\n",
        encoding="utf-8")


if __name__ == "__main__":
    main()
