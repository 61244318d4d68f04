"""Notebooks: their code, executed without Jupyter."""
import json
import sys
import types

from support import ROOT

FOLDER = ROOT / "docs" / "examples" / "python"


def names():
    """Names of all notebooks of the documentation."""
    return sorted(path.stem for path in FOLDER.glob("*.ipynb"))


def cells(name):
    """Cells of a notebook."""
    return json.loads((FOLDER / f"{name}.ipynb").read_text(encoding="utf-8"))["cells"]


def code(name):
    """Texts of the code cells of a notebook, and whether each is tagged "parameters"."""
    return [("".join(cell["source"]), "parameters" in cell["metadata"].get("tags", []))
            for cell in cells(name) if cell["cell_type"] == "code"]


def execute(name, **parameters):
    """The variables after all cells; parameters replace those of the tagged cell."""
    module = sys.modules[name] = types.ModuleType(name)
    unknown = set(parameters)
    for number, (text, is_tagged) in enumerate(code(name)):
        exec(compile(text, f"{name}.ipynb, code cell {number}", "exec"), vars(module))
        if is_tagged:
            unknown -= set(vars(module))
            vars(module).update(parameters)
    assert not unknown, f"{name}: no parameters {unknown}"
    return module
