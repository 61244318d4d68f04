#!/usr/bin/env python3
"""Plants bugs in the sources, one at a time, and counts how many of them the tests notice.

    tests/mutation/mutate.py --count 60 --seed 1                  bugs anywhere in the sources
    tests/mutation/mutate.py --since v0.1.0 --count 60            only in files that changed since a revision
    tests/mutation/mutate.py --files tracker/sky_filter.c         only in these files
    tests/mutation/mutate.py --suite e2e --count 30               judged by the tests of the whole program

The tree is copied, built once, and every bug is compiled in that copy: nothing here is touched. A bug whose object
file equals that of the sound source cannot be noticed and does not count. A bug counts as noticed if a test fails,
crashes or exceeds its time, or if it does not compile. Tests run in the order of their last duration, and the first
failure ends a bug's trial.

Prints a line for each bug, the survivors with their place, and the score. Ends with 1 if the score is below --least.
The kinds of bugs are those of mutation testing (Offutt et al. 1996, ACM TOSEM 5(2), 99-118: relational, arithmetic and
logical operators, constants, statements) and those that physical code invites: signs, axes, squares, roots.
"""

import argparse
import hashlib
import json
import os
import random
import re
import shutil
import subprocess
import sys
import tempfile
import time

import e2e_suite

FOLDERS = ["sim", "scenegen", "gimbal", "imgproc", "tracker", "control", "obsgen"]
# folders whose tests have names of their own: the rest of a path names its tests (tracker/… → tracker_…)
UNIT_TESTS = {"sim/app": "app|bad_input", "sim/core": "core", "sim/astro": "astro", "sim/world": "world", "sim/io": "io",
              "sim/link": "link", "sim/engine": "engine", "sim/eval": "eval", "sim/studies": "studies",
              "sim/device": "device"}

AXES = [(r"\.x\b", ".y"), (r"\.y\b", ".x"), (r"\.z\b", ".y"), (r"\[0\]", "[1]"), (r"\[1\]", "[0]"), (r"\[2\]", "[1]"),
        (r"\b(\w+)_x\b", r"\1_y"), (r"\b(\w+)_y\b", r"\1_x"), (r"\bx_px\b", "y_px"), (r"\by_px\b", "x_px"),
        (r"\bnx\b", "ny"), (r"\bny\b", "nx")]
OPERATORS = {
    "sign": [(r"(?<=[\w\)\]] )\+(?= [\w\(])", "-"), (r"(?<=[\w\)\]] )-(?= [\w\(])", "+"), (r"(?<=[=(,] )-(?=[\w\(])", ""),
             (r"\+=", "-="), (r"-=", "+=")],
    "product": [(r"(?<=[\w\)\]] )\*(?= [\w\(])", "/"), (r"(?<=[\w\)\]] )/(?= [\w\(])", "*")],
    "relation": [(r"(?<= )<(?= )", "<="), (r"(?<= )>(?= )", ">="), (r"(?<= )<=(?= )", "<"), (r"(?<= )>=(?= )", ">"),
                 (r"(?<= )<(?= )", ">"), (r"(?<= )>(?= )", "<"), (r"==", "!="), (r"!=", "==")],
    "logic": [(r"&&", "||"), (r"\|\|", "&&"), (r"(?<=[(\s])!(?=\w)", "")],
    "constant": [(r"\b2\.0\b", "3.0"), (r"\b0\.5\b", "0.25"), (r"\b1\.0\b", "2.0"), (r"\b0\.0\b", "1.0"),
                 (r"\b2\b(?!\.)", "3"), (r"(?<=[\w\)] [+-] )1\b(?!\.)", "2"), (r"\b(\d+\.\d*[1-9])\b", r"(1.5 * \1)")],
    "root": [(r"\bsqrtf?\(", "("), (r"\bcos\(", "sin("), (r"\bsin\(", "cos("), (r"\bfmin\(", "fmax("),
             (r"\bfmax\(", "fmin("), (r"\bfabsf?\(", "(")],
    "axis": AXES,
}
STATEMENT = re.compile(r"^\s+[\w>\.\[\]\-\*\(\) ]+ (?:=|\+=|-=|\*=) [^=].*;$")


def blank_comments(text):
    """The text with comments and strings blanked, of equal length."""
    pattern = re.compile(r'/\*.*?\*/|//[^\n]*|"(?:\\.|[^"\\\n])*"|\'(?:\\.|[^\'\\\n])*\'', re.S)
    return pattern.sub(lambda m: re.sub(r"[^\n]", " ", m.group()), text)


def mutants_of(path, text):
    """All (kind, offset, old, new) of a file."""
    found = []
    code = blank_comments(text)
    at, depth = 0, 0
    for line in code.split("\n"):
        inside = depth > 0
        depth += line.count("{") - line.count("}")
        # declarations, tables and preprocessor lines hold no logic
        if inside and not re.match(r"\s*(#|static const|const char)", line) and "assert" not in line:
            for kind, rules in OPERATORS.items():
                for pattern, new in rules:
                    for m in re.finditer(pattern, line):
                        found.append((kind, at + m.start(), m.group(), m.expand(new) if "\\" in new else new))
            if STATEMENT.match(line) and re.match(r"^\s+(?:[\w\.\[\]>-]+) ?(?:=|\+=|-=|\*=)", line):
                statement = line.strip()
                found.append(("statement", at + line.index(statement), statement, ";"))
        at += len(line) + 1
    return found


def run(command, **keywords):
    return subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False, **keywords)


class Tree:
    """A copy of the sources with a build of its own."""

    def __init__(self, source, folder, preset, jobs):
        self.folder, self.build, self.jobs = folder, os.path.join(folder, "build"), jobs
        listed = run(["git", "-C", source, "ls-files", "-co", "--exclude-standard"]).stdout.split("\n")
        for name in filter(None, listed):
            if os.path.isfile(os.path.join(source, name)):
                target = os.path.join(folder, name)
                if not os.path.exists(target):
                    os.makedirs(os.path.dirname(target), exist_ok=True)
                    shutil.copy2(os.path.join(source, name), target)
        configured = run(["cmake", "--preset", preset, "-G", "Ninja", "-B", self.build], cwd=folder)
        if configured.returncode:
            sys.exit(f"mutate: cmake failed:\n{configured.stdout}")
        self.make("all")
        shown = run(["ctest", "--test-dir", self.build, "--show-only=json-v1"]).stdout
        self.tests = {}
        for test in json.loads(shown)["tests"]:
            labels = [p["value"] for p in test["properties"] if p["name"] == "LABELS"][0]
            self.tests[test["name"]] = (labels, os.path.basename(test["command"][0]), " ".join(test["command"]))
        self.costs = {}

    def make(self, *targets):
        made = run(["ninja", "-C", self.build, f"-j{self.jobs}", "--quiet", *targets])
        if made.returncode and targets == ("all",):
            sys.exit(f"mutate: the sound tree does not build:\n{made.stdout}")
        return made.returncode == 0

    def object_of(self, path):
        folder = os.path.dirname(path)
        for root, _, files in os.walk(os.path.join(self.build, folder, "CMakeFiles")):
            for name in files:
                if os.path.join(root, name).endswith("/" + os.path.basename(path) + ".o"):
                    return os.path.relpath(os.path.join(root, name), self.build)
        return None

    def tests_for(self, path, suite):
        """Names of the tests that judge a file: those of its folder, or those of the program."""
        if suite == "e2e":
            return e2e_suite.concerned(path, [n for n, (labels, _, _) in self.tests.items() if "e2e" in labels])
        else:
            folder = os.path.dirname(path)
            prefix = UNIT_TESTS.get(folder, folder.split("/")[0])
            names = [n for n, (labels, _, _) in self.tests.items()
                     if re.match(rf"(?:{prefix})_", n) and "unit" in labels and "slow" not in labels]
        return sorted(names, key=lambda n: self.costs.get(n, 1.0))

    def judge(self, names):
        """The first test that fails, or None."""
        for name in names:
            begun = time.monotonic()
            labels, program, command = self.tests[name]
            if program.startswith("test_") and not self.make(program):
                return name + " (does not link)"
            if "boresight" in command and not self.make("boresight"):
                return name + " (does not link)"
            code = run(["ctest", "--test-dir", self.build, "-R", f"^{name}$", "--timeout",
                        str(max(60, int(10 * self.costs.get(name, 30))))]).returncode
            if code:
                return name
            self.costs[name] = time.monotonic() - begun
        return None


def digest(path):
    with open(path, "rb") as file:
        return hashlib.sha256(file.read()).hexdigest()


def candidates(options, tree):
    if options.files:
        names = options.files
    else:
        command = ["git", "-C", options.source, "diff", "--name-only", options.since] if options.since else \
            ["git", "-C", options.source, "ls-files"]
        names = run(command).stdout.split("\n")
    names = [n for n in names if n.endswith(".c") and n.split("/")[0] in FOLDERS
             and os.path.exists(os.path.join(tree.folder, n)) and not os.path.basename(n).startswith(options.without)]
    found = []
    for name in sorted(names):
        with open(os.path.join(tree.folder, name), encoding="utf-8") as file:
            found.append((name, mutants_of(name, file.read())))
    return [(n, m) for n, m in found if m]


def draw(pools, rng):
    """A file by the root of its size, a kind among those in it, a place of that kind: no kind swamps the others."""
    name, mutants = rng.choices(pools, [len(m) ** 0.5 for _, m in pools])[0]
    kind = rng.choice(sorted({m[0] for m in mutants}))
    return name, rng.choice([m for m in mutants if m[0] == kind])


def trial(tree, name, mutant, suite):
    """(outcome, the test that noticed): noticed, survived, equal, or no tests."""
    kind, at, old, new = mutant
    path = os.path.join(tree.folder, name)
    with open(path, encoding="utf-8") as file:
        sound = file.read()
    assert sound[at:at + len(old)] == old
    target = tree.object_of(name)
    if target is None or not tree.make(target):
        return "equal", "not compiled"
    before = digest(os.path.join(tree.build, target))
    try:
        with open(path, "w", encoding="utf-8") as file:
            file.write(sound[:at] + new + sound[at + len(old):])
        if not tree.make(target):
            return "equal", "does not compile"
        if digest(os.path.join(tree.build, target)) == before:
            return "equal", "same object"
        names = tree.tests_for(name, suite)
        if not names:
            return "survived", "no tests"
        failed = tree.judge(names)
        return ("noticed", failed) if failed else ("survived", f"{len(names)} tests passed")
    finally:
        with open(path, "w", encoding="utf-8") as file:
            file.write(sound)


def wilson(k, n):
    """Wilson 95 % interval of a share."""
    z, p = 1.96, k / n
    middle, half = (p + z * z / 2 / n) / (1 + z * z / n), z * (p * (1 - p) / n + z * z / 4 / n / n) ** 0.5 / (1 + z * z / n)
    return middle - half, middle + half


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0], epilog="example: mutate.py --count 60 --seed 1")
    parser.add_argument("--source", default=os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__)))))
    parser.add_argument("--work", help="folder of the copy, kept for the next time (default: a temporary one)")
    parser.add_argument("--files", nargs="+", help="files to plant bugs in")
    parser.add_argument("--since", help="only files that changed since this git revision")
    parser.add_argument("--without", nargs="*", default=["bench_"], help="beginnings of file names to leave out")
    parser.add_argument("--suite", choices=["unit", "e2e"], default="unit", help="which tests judge (default unit)")
    parser.add_argument("--count", type=int, default=30, help="bugs to plant (default 30)")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=os.cpu_count())
    parser.add_argument("--least", type=float, default=0.0, help="least score, 0 to 1, for exit code 0")
    parser.add_argument("--json", help="file for the outcomes")
    options = parser.parse_args()
    options.without = tuple(options.without)
    rng = random.Random(options.seed)
    folder = options.work or tempfile.mkdtemp(prefix="boresight-mutation-")
    try:
        tree = Tree(options.source, folder, "release", options.jobs)
        pools = candidates(options, tree)
        if not pools:
            sys.exit("mutate: no source file to plant a bug in: look at --files and --since")
        outcomes, tried = [], set()
        for _ in range(20 * options.count):
            if len(outcomes) == options.count:
                break
            name, mutant = draw(pools, rng)
            if (name, mutant) in tried:
                continue
            tried.add((name, mutant))
            with open(os.path.join(tree.folder, name), encoding="utf-8") as file:
                text = file.read()
            line = text.count("\n", 0, mutant[1]) + 1
            outcome, by = trial(tree, name, mutant, options.suite)
            if outcome == "equal":
                continue
            shown = text.split("\n")[line - 1].strip()
            outcomes.append({"file": name, "line": line, "kind": mutant[0], "old": mutant[2], "new": mutant[3],
                             "outcome": outcome, "by": by, "code": shown})
            print(f"{outcome:9}{name}:{line} {mutant[0]} '{mutant[2]}' -> '{mutant[3]}'  [{shown}]  {by}", flush=True)
        noticed = sum(o["outcome"] == "noticed" for o in outcomes)
        if not outcomes:
            sys.exit("mutate: no bug could be planted in these files")
        low, high = wilson(noticed, len(outcomes))
        print(f"{noticed} of {len(outcomes)} bugs noticed: {100 * noticed / len(outcomes):.0f} % "
              f"(95 % interval {100 * low:.0f} to {100 * high:.0f} %)")
        if options.json:
            with open(options.json, "w", encoding="utf-8") as file:
                json.dump(outcomes, file, indent=1)
        return 1 if noticed / len(outcomes) < options.least else 0
    finally:
        if not options.work:
            shutil.rmtree(folder, ignore_errors=True)


if __name__ == "__main__":
    sys.exit(main())
