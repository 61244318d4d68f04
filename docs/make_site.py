#!/usr/bin/env python3
"""Builds the documentation: copies docs/, adds the generated pages, runs Sphinx.

usage: docs/make_site.py BORESIGHT SOURCE_FOLDER [HTML_FOLDER [PAGE...]]

SOURCE_FOLDER receives the pages that Sphinx reads. Without HTML_FOLDER nothing but these is made. With PAGEs (tutorial/index.md)
all pages are read and all references resolved, but only those named are written, with straight quotes: that is much faster.
No step needs a network.
"""
import json
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile

DOCS = pathlib.Path(__file__).resolve().parent
ROOT = DOCS.parent
TABLES_RUN = "scenarios/neossat_geo_track.json"  # writes every table of run.sqlite


def output_of(*words, **more):
    return subprocess.run(words, check=True, capture_output=True, text=True, cwd=ROOT, **more).stdout


def write_commands(program, path):
    """One section for each command, with its own help text."""
    overview = output_of(program, "help")
    listed = overview.split("commands:\n", 1)[1].split("\n\n", 1)[0]
    parts = ["# Commands\n\nGenerated from `boresight help COMMAND`. "
             "[Command line](command_line.md) describes what all commands have in common.\n"]
    for name, purpose in re.findall(r"^  (\S+)\s+(.*)$", listed, re.MULTILINE):
        parts.append(f"## boresight {name}\n\nPurpose: {purpose}.\n\n```text\n{output_of(program, 'help', name).strip()}\n```\n")
    path.write_text("\n".join(parts), encoding="utf-8")


def write_tables(program, path):
    with tempfile.TemporaryDirectory() as folder:
        run = pathlib.Path(folder) / "run"
        output_of(program, "run", TABLES_RUN, "--duration", "1", "--quiet", "--out", str(run),
                  "--set", "/record/frames=none", "--set", "/world/star_catalogue=embedded")
        path.write_text(output_of(sys.executable, str(DOCS / "make_tables.py"), str(run / "run.sqlite")), encoding="utf-8")


def write_notebook(notebook, page):
    """A page of a notebook: its texts, and its code as it is executed by tests/python/test_examples.py."""
    parts = []
    for cell in json.loads(notebook.read_text(encoding="utf-8"))["cells"]:
        text = "".join(cell["source"])
        parts.append(text if cell["cell_type"] == "markdown" else f"```python\n{text}\n```")
    parts.insert(1, f"The notebook `docs/examples/python/{notebook.name}`, without its outputs.")
    page.write_text("\n\n".join(parts) + "\n", encoding="utf-8")


def write_notebooks(source):
    """Pages of the notebooks, in place of the folder of examples, which is no part of the site."""
    folder = source / "how-to" / "notebooks"
    folder.mkdir()
    for notebook in sorted((source / "examples" / "python").glob("*.ipynb")):
        write_notebook(notebook, folder / f"{notebook.stem}.md")
    guide = source / "how-to" / "python.md"
    text = re.sub(r"\(\.\./examples/python/(\w+)\.ipynb\)", r"(notebooks/\1.md)", guide.read_text(encoding="utf-8"))
    pages = "\n".join(f"notebooks/{page.stem}" for page in sorted(folder.glob("*.md")))
    guide.write_text(f"{text}\n```{{toctree}}\n:hidden:\n\n{pages}\n```\n", encoding="utf-8")


def generate(program, source):
    if source.exists():
        shutil.rmtree(source)
    shutil.copytree(DOCS, source, ignore=shutil.ignore_patterns("make_*.py", "__pycache__", "*.1"))
    reference = source / "reference"
    keys = [sys.executable, str(DOCS / "make_reference.py")]
    output_of(*keys, str(reference / "scenario_keys"), input=output_of(program, "schema"))
    output_of(*keys, str(reference / "study_keys"), input=output_of(program, "study", "--schema"))
    write_commands(program, reference / "commands.md")
    write_tables(program, reference / "database.md")
    write_notebooks(source)
    output_of(sys.executable, str(DOCS / "make_c_api.py"), str(ROOT / "include" / "boresight"), str(reference / "c_api"))
    changes = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    (source / "changes.md").write_text(changes.replace("](docs/", "]("), encoding="utf-8")


def sphinx(source, builder, html, *pages, plain=False):
    """Runs Sphinx. Its trees of many small objects live to the end: without the search for garbage it takes two thirds of the
    time. -n: a link that leads nowhere is a warning; a warning is an error. plain: straight quotes."""
    run = "import gc, sys; gc.disable(); from sphinx.cmd.build import main; sys.exit(main(sys.argv[1:]))"
    done = subprocess.run([sys.executable, "-c", run, "-q", "-n", "-b", builder, "-D", f"smartquotes={int(not plain)}",
                           "-d", str(source.with_name(source.name + "-doctrees")), str(source), html, *pages],
                          stderr=subprocess.PIPE, text=True, check=False)
    # said when only some pages are written, which is what was asked for
    wrong = [line for line in done.stderr.splitlines() if line and not (pages and "the index will be incomplete" in line)]
    if wrong or done.returncode != 0:
        sys.exit("\n".join(wrong) or f"Sphinx ended with exit code {done.returncode}")


def main():
    if len(sys.argv) < 3:
        sys.exit(__doc__)
    program, source = (pathlib.Path(word).resolve() for word in sys.argv[1:3])
    generate(str(program), source)
    if len(sys.argv) == 4:
        sphinx(source, "html", sys.argv[3])
    elif len(sys.argv) > 4:
        sphinx(source, "dummy", sys.argv[3], plain=True)
        sphinx(source, "html", sys.argv[3], *(str(source / page) for page in sys.argv[4:]), plain=True)


if __name__ == "__main__":
    main()
