"""mypy --strict on the package and its examples; left out (exit code 77) where mypy is not installed."""
import importlib.util
import os
import pathlib
import subprocess
import sys
import tempfile
import unittest

import notebook
from support import ROOT, main

if importlib.util.find_spec("mypy") is None:
    print("mypy is not installed: nothing is tested")
    sys.exit(77)

PACKAGE = pathlib.Path(os.environ["PYTHONPATH"].split(os.pathsep)[0])
# what a type checker must find: a wrong type, a member that does not exist, a message that may be None
WRONG = """import boresight as bst
from boresight import config

camera = config.Camera(width_px="wide")
with bst.Simulation("neossat_geo_track") as sim:
    sim.run_until("now")
    print(sim.tracks.target_id)
    print(bst.Tracks().targets)
bst.register(tracker=5)
"""


def check(*paths):
    """Exit code and lines of mypy --strict."""
    with tempfile.TemporaryDirectory() as cache:
        done = subprocess.run(
            [sys.executable, "-m", "mypy", "--config-file", str(ROOT / "pyproject.toml"), "--strict",
             "--cache-dir", cache, *map(str, paths)], capture_output=True, text=True,
            env={**os.environ, "MYPYPATH": str(PACKAGE)}, check=False)
    return done.returncode, done.stdout + done.stderr


class Types(unittest.TestCase):
    def test_package_and_examples_are_clean(self):
        with tempfile.TemporaryDirectory() as folder:
            for name in notebook.names():
                text = "\n\n".join(text for text, _ in notebook.code(name))
                (pathlib.Path(folder) / f"{name}.py").write_text(text + "\n", encoding="utf-8")
            code, said = check(PACKAGE / "boresight", folder)
        self.assertEqual(code, 0, said)

    def test_wrong_programs_are_found(self):
        with tempfile.TemporaryDirectory() as folder:
            file = pathlib.Path(folder) / "wrong.py"
            file.write_text(WRONG)
            code, said = check(file)
        self.assertEqual(code, 1, said)
        for line in (4, 6, 7, 8, 9):
            self.assertIn(f"wrong.py:{line}: error", said)


if __name__ == "__main__":
    main()
