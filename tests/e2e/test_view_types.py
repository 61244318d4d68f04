#!/usr/bin/env python3
"""Types of the page's modules, by TypeScript's checker over their JSDoc: no error.

The version of typescript is that of view/package.json. It comes from npm into a scratch folder, or is the `tsc` that the environment
variable BORESIGHT_TSC names; the test is skipped, and says so, without both.

Usage, from the repository root: /usr/bin/python3 tests/e2e/test_view_types.py BORESIGHT
"""
import json
import os
import shutil
import subprocess
import unittest

import runs

VIEW = os.path.abspath("view")


def checker():
    """Path of tsc; None: not to be had."""
    path = os.environ.get("BORESIGHT_TSC")
    if not path and shutil.which("npm"):
        folder = runs.scratch()
        path = os.path.join(folder, "node_modules/.bin/tsc")
        with open(os.path.join(VIEW, "package.json"), encoding="utf-8") as file:
            version = json.load(file)["devDependencies"]["typescript"]
        subprocess.run(["npm", "install", "--no-audit", "--no-fund", "--prefix", folder, f"typescript@{version}"], capture_output=True, timeout=300, check=False)
    return path if path and os.path.exists(path) else None


class Types(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.tsc = checker()
        if not cls.tsc:
            raise unittest.SkipTest("there is no typescript: npm does not reach its registry, and BORESIGHT_TSC names none")

    @classmethod
    def tearDownClass(cls):
        runs.clean()

    def check(self, folder):
        result = subprocess.run([self.tsc, "-p", folder], capture_output=True, text=True, timeout=800, check=False)
        return result.returncode, result.stdout + result.stderr

    def test_page(self):
        self.assertEqual(self.check(VIEW), (0, ""))

    def test_errors_are_found(self):
        """With the same settings, a module with a member that its class lacks."""
        folder = runs.scratch()
        with open(os.path.join(VIEW, "tsconfig.json"), encoding="utf-8") as file:
            settings = json.load(file)
        settings["include"] = ["wrong.js"]
        with open(os.path.join(folder, "tsconfig.json"), "w", encoding="utf-8") as file:
            json.dump(settings, file)
        with open(os.path.join(folder, "wrong.js"), "w", encoding="utf-8") as file:
            file.write("export class One { constructor() { this.first = 1; } last() { return this.second; } }\n")
        code, text = self.check(folder)
        self.assertEqual(code, 2)
        self.assertIn("'second' does not exist on type 'One'", text)


if __name__ == "__main__":
    unittest.main()
