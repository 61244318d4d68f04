#!/usr/bin/env python3
"""Plants bugs in the sources, one at a time, and counts how many of them the tests notice.

    tests/mutation/mutate.py --count 60 --seed 1                  bugs anywhere in the sources
    tests/mutation/mutate.py --since v0.1.0 --count 60            only in files that changed since a revision
    tests/mutation/mutate.py --files tracker/mtt/sky_filter.c         only in these files
    tests/mutation/mutate.py --suite e2e --count 30               judged by the tests of the whole program
    tests/mutation/mutate.py --quick --files sim/eval --count 30   seconds for each bug: no copy, see quick_tree.py
    tests/mutation/mutate.py --quick --bugs bugs.json          those of a list
    tests/mutation/mutate.py --coverage build-cov --count 100     many bugs: only the tests that execute a bug's line run
    tests/mutation/mutate.py --coverage build-cov --unexecuted sim/world    lines that no unit test of the folder executes

The tree is copied, built once, and every bug is compiled in that copy: nothing here is touched. A bug whose object
file equals that of the sound source cannot be noticed and does not count. A bug counts as noticed if a test fails,
crashes or exceeds its time. Tests run in the order of their last duration, and the first failure ends a bug's trial.
With --work the copy is kept, and the next call takes over only what has changed since. With --quick there is no copy:
see quick_tree.py.

Rows of numbers, which are tables, hold no logic and get no bugs.

The suite ci is the honest one: what ./dev test runs for a file, whatever the labels `heavy`, `vector`, `device` and
`sanitized` say about the build in which it runs it; only `slow` tests are left out. With --skip or --budget a score is a
lower bound. It leaves out what the sanitizers would notice.

The unit suite judges a file by the unit and device tests of its own part of the tree: sim/world/orbit/… by world_…, tracker/… by
tracker_…. The command line, sim/app, has few of those: its tests are the e2e suite. The unit suite therefore leaves
sim/app out (--files still takes its files).

--coverage names a folder for a build with gcov (made there, kept up to date): every unit test runs once in it, and a
bug is judged only by the tests that execute its line; where none does, by all of its folder.

A file is drawn by the number of its lines that can hold a bug, and a kind of bug evenly among those of the file.
Prints a line for each bug, the survivors with their place, and the score with its 95 % Wilson interval (Wilson 1927,
JASA 22, 209-212). Bugs that change no result (fmax of numbers that are equal, for example) count as survivors: look at
each one. Ends with 1 if the score is below --least.
The kinds of bugs are those of mutation testing (Offutt et al. 1996, ACM TOSEM 5(2), 99-118: relational, arithmetic and
logical operators, constants, statements) and those that physical code invites: signs, axes, squares, roots, dropped
factors. --kinds sign axis root product constant dropped draws from the second sort alone.
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

from build_files import Judges, listed_tests, run
from quick_tree import QuickTree

FOLDERS = ["sim", "scenegen", "gimbal", "imgproc", "tracker", "control", "obsgen", "view"]
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
    # a factor or a term that is forgotten, and an angle or a span of time that counts backwards
    "dropped": [(r"(?<=[\w\)\]]) [*/] (?:\w+(?:(?:->|\.)\w+|\[\w+\])*|\d+\.\d+)(?=[;,)\s])", ""),
                (r"(?<=[\w\)\]]) [+-] (?:\w+(?:(?:->|\.)\w+|\[\w+\])*|\d+\.\d+)(?=[;,)])", ""),
                (r" \* BST_(?:DEG|ARCSEC)_RAD\b", ""), (r" / BST_(?:DEG|ARCSEC)_RAD\b", "")],
}
# Bugs of physical code by class: {kind: (lines that it concerns, rules)}
VALUE = r"\w+(?:(?:->|\.)\w+|\[\w+\])*"
TERM = rf"(?<=[\w\)\]]) [+-] {VALUE}(?: \* {VALUE})*(?=[;,)])"
CLASSES = {
    "window": (re.compile(r"window|binning|first_|\b[xy]0\b|offset|corner|origin"),
               OPERATORS["sign"] + AXES + [(r" [*/] [\w.>-]*binning\w*", ""), (TERM, "")]),
    "covariance": (re.compile(r"cov|varian|sigma|_px2|_rad2|\b[pr]\[|xy|noise|error"),
                   [(rf"(?<![\w.>])({VALUE}(?:xy|\[1\]|\[2\]))(?= \*|[;,)])", r"-\1"), (r"\b2\.0 \* ", ""), (r"\b2\.0f? \* ", "3.0 * "),
                    (r"(?<=[\w\)\]] )-(?= [\w\(])", "+"), (TERM, ""), (r"\[1\]", "[0]"), (r"\[2\]", "[1]"), (r"\[3\]", "[0]")]),
    "squared": (re.compile(r""), [(rf"(?<![\w.>])({VALUE}) \* \1(?![\w\[(.-])", r"\1"), (r"\bsqrtf?\(", "(")]),
    "swapped": (re.compile(r""), [(rf"(?<=[(,\s])({VALUE}), ({VALUE})(?=\))", r"\2, \1"), (rf"\(({VALUE}), ({VALUE})(?=,)", r"(\2, \1")]),
    "time": (re.compile(r"light_time|SPEED_OF_LIGHT|BST_C_|_time|mid|delay|start_s|end_s|exposure_s|\bt\b|dt"),
             OPERATORS["sign"] + [(TERM, ""), (r"\b0\.5 \* ", "")]),
}
TABLE_ROW = re.compile(r"^\s*\{?\s*[-+]?[\d.][\d.eExXa-fA-F+\-,\s{}]*\}?,?\s*$")
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
        if inside and not re.match(r"\s*(#|static const|const char)", line) and "assert" not in line \
                and not TABLE_ROW.match(line):
            for kind, rules in OPERATORS.items():
                for pattern, new in rules:
                    for m in re.finditer(pattern, line):
                        found.append((kind, at + m.start(), text[at + m.start():at + m.end()], m.expand(new) if "\\" in new else new))
            for kind, (concerned, rules) in CLASSES.items():
                for pattern, new in rules if concerned.search(line) else []:
                    for m in re.finditer(pattern, line):
                        found.append((kind, at + m.start(), text[at + m.start():at + m.end()], m.expand(new)))
            if STATEMENT.match(line) and re.match(r"^\s+(?:[\w\.\[\]>-]+) ?(?:=|\+=|-=|\*=)", line):
                first, last = at + len(line) - len(line.lstrip()), at + len(line.rstrip())
                found.append(("statement", first, text[first:last], ";"))
        at += len(line) + 1
    return found


def same_text(a, b):
    with open(a, "rb") as first, open(b, "rb") as second:
        return first.read() == second.read()


class Coverage:
    """Which unit tests execute which lines, by gcov, in a build folder of its own; kept there from call to call."""

    def __init__(self, source, build, jobs, names):
        self.source, self.build = os.path.abspath(source), os.path.abspath(build)
        flags = "-O1 --coverage"
        made = run(["cmake", "-S", self.source, "-B", self.build, "-G", "Ninja", "-DCMAKE_BUILD_TYPE=Coverage",
                    f"-DCMAKE_C_FLAGS_COVERAGE={flags}", f"-DCMAKE_CXX_FLAGS_COVERAGE={flags}"])
        if made.returncode:
            sys.exit(f"mutate: cmake failed:\n{made.stdout}")
        tests = {n: c for n, (labels, c) in listed_tests(self.build).items()
                 if n in names and os.path.basename(c[0]).startswith("test_")}
        made = run(["ninja", "-C", self.build, f"-j{jobs}", "--quiet", *{os.path.basename(c[0]) for c in tests.values()}])
        if made.returncode:
            sys.exit(f"mutate: the build with gcov failed:\n{made.stdout}")
        kept = os.path.join(self.build, "executed_lines.json")
        self.known = {}
        if os.path.exists(kept):
            with open(kept, encoding="utf-8") as file:
                self.known = json.load(file)
        for name, command in tests.items():
            program = digest(command[0])
            if self.known.get(name, {}).get("program") != program:
                self.known[name] = {"program": program, **self.measure(command)}
                with open(kept, "w", encoding="utf-8") as file:
                    json.dump(self.known, file)
        self.lines = {}  # file: {line: the tests that execute it}
        for name, entry in self.known.items():
            for path, (counted, executed) in entry["files"].items():
                lines = self.lines.setdefault(path, {})
                for line in counted:
                    lines.setdefault(line, set())
                for line in executed:
                    lines[line].add(name)

    def measure(self, command):
        """Time and {file: (lines with code, lines executed)} of one test."""
        def counters():
            return [os.path.join(root, f) for root, _, files in os.walk(self.build) for f in files if f.endswith(".gcda")]
        for name in counters():
            os.remove(name)
        begun, code = time.monotonic(), 1
        try:
            code = run(command, cwd=self.source, timeout=900).returncode
        except subprocess.TimeoutExpired:
            pass
        spent = time.monotonic() - begun
        found = {}
        for line in run(["gcov", "--json-format", "--stdout", *counters()], cwd=self.build).stdout.split("\n"):
            if not line.startswith("{"):
                continue
            shown = json.loads(line)
            for file in shown["files"]:
                path = os.path.relpath(os.path.join(shown["current_working_directory"], file["file"]), self.source)
                if path.split("/")[0] in FOLDERS and path.endswith(".c"):
                    found[path] = (sorted({v["line_number"] for v in file["lines"]}),
                                   sorted({v["line_number"] for v in file["lines"] if v["count"] > 0}))
        return {"seconds": spent, "code": code, "files": found}

    def tests_of(self, path, line, names):
        """Of these tests, those that execute the line, or the nearest lines with code above and below it."""
        lines = self.lines.get(path, {})
        near = [max((v for v in lines if v <= line), default=None), min((v for v in lines if v > line), default=None)]
        near = near[:1] if near[0] == line else near
        reached = set().union(*(lines[v] for v in near if v is not None))
        judges = [n for n in names if n in reached or n not in self.known]
        return judges if judges else names  # a child process that is killed leaves no trace with gcov

    def unexecuted(self, path, names):
        """Lines with code that none of these tests executes, as ranges."""
        lines = self.lines.get(path, {})
        missed, ranges = sorted(v for v, tests in lines.items() if not tests.intersection(names)), []
        for line in missed:
            follows = ranges and not any(ranges[-1][1] < v < line for v in lines)
            ranges = ranges[:-1] + [(ranges[-1][0], line)] if follows else ranges + [(line, line)]
        return len(missed), len(lines), ranges


class Tree(Judges):
    """A copy of the sources with a build of its own."""

    def __init__(self, source, folder, preset, jobs):
        super().__init__()
        self.folder, self.build, self.jobs = folder, os.path.join(folder, "build"), jobs
        listed = run(["git", "-C", source, "ls-files", "-co", "--exclude-standard"]).stdout.split("\n")
        for name in filter(None, listed):
            origin, target = os.path.join(source, name), os.path.join(folder, name)
            if os.path.isfile(origin) and not (os.path.exists(target) and same_text(origin, target)):
                os.makedirs(os.path.dirname(target), exist_ok=True)
                shutil.copy(origin, target)
        configured = run(["cmake", "--preset", preset, "-G", "Ninja", "-B", self.build], cwd=folder)
        if configured.returncode:
            sys.exit(f"mutate: cmake failed:\n{configured.stdout}")
        self.objects = re.findall(r"^(\S+\.o):", run(["ninja", "-C", self.build, "-t", "targets", "all"]).stdout, re.M)
        self.tests = {name: (labels, os.path.basename(command[0]), " ".join(command))
                      for name, (labels, command) in listed_tests(self.build).items()}

    def make(self, *targets):
        return run(["ninja", "-C", self.build, f"-j{self.jobs}", "--quiet", *targets]).returncode == 0

    def prove(self, names):
        """Runs the tests that have not run yet on the sound tree: one that fails there judges nothing."""
        for name in [n for n in names if n not in self.costs]:
            failed = self.judge([name])
            if failed:
                print(f"mutate: left out, for it fails without a bug: {failed}", flush=True)
                self.unsound.add(name)

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
        names = run(["git", "-C", options.source, "ls-files", "--", *options.files]).stdout.split("\n")
    else:
        command = ["git", "-C", options.source, "diff", "--name-only", options.since] if options.since else \
            ["git", "-C", options.source, "ls-files"]
        names = run(command).stdout.split("\n")
    names = [n for n in names if n.endswith(".c") and n.split("/")[0] in FOLDERS
             and os.path.exists(os.path.join(tree.folder, n)) and not os.path.basename(n).startswith(options.without)]
    if options.suite == "unit" and not options.files:
        names = [n for n in names if not n.startswith("sim/app/")]
    found = []
    for name in sorted(names):
        with open(os.path.join(tree.folder, name), encoding="utf-8") as file:
            text = file.read()
        mutants = [m for m in mutants_of(name, text)
                   if (m[0] in options.kinds if options.kinds else m[0] not in CLASSES)]
        found.append((name, mutants, len({text.count("\n", 0, m[1]) for m in mutants})))
    return [f for f in found if f[1]]


def listed(path, tree):
    """The bugs of a list [{"file", "old", "new", "test"}]: `old` is text that occurs once in the file. Others are stale. The
    test, which may be left out, is the one to run first."""
    with open(path, encoding="utf-8") as file:
        items = json.load(file)
    for item in items:
        name = os.path.join(tree.folder, item["file"])
        text = ""
        if os.path.exists(name):
            with open(name, encoding="utf-8") as file:
                text = file.read()
        if text.count(item["old"]) == 1:
            tree.first = item.get("test")
            yield item["file"], ("listed", text.index(item["old"]), item["old"], item["new"])
        else:
            print(f"stale    {item['file']}: {item['old']!r} is there {text.count(item['old'])} times, not once", flush=True)


def drawn(pools, rng, most):
    """Bugs drawn at random, none twice."""
    tried = set()
    for _ in range(most):
        bug = draw(pools, rng)
        if bug not in tried:
            tried.add(bug)
            yield bug


def draw(pools, rng):
    """A file by its lines that can hold a bug, a kind among those in it, a place of that kind."""
    name, mutants, _ = rng.choices(pools, [lines for _, _, lines in pools])[0]
    kind = rng.choice(sorted({m[0] for m in mutants}))
    return name, rng.choice([m for m in mutants if m[0] == kind])


def trial(tree, coverage, name, line, mutant, suite):
    """(outcome, the test that noticed): noticed, survived, equal, or no tests."""
    kind, at, old, new = mutant
    path = os.path.join(tree.folder, name)
    with open(path, encoding="utf-8") as file:
        sound = file.read()
    assert sound[at:at + len(old)] == old
    if isinstance(tree, QuickTree):
        return tree.trial(name, sound, mutant, suite, coverage, line)
    target = tree.object_of(name)
    if target is None or not tree.make(target):
        return "equal", "not compiled"
    before = digest(os.path.join(tree.build, target))
    names = tree.tests_for(name, suite)
    if coverage:
        names = coverage.tests_of(name, line, names)
    tree.prove(names)
    names = tree.first_of_all([n for n in names if n not in tree.unsound])
    try:
        with open(path, "w", encoding="utf-8") as file:
            file.write(sound[:at] + new + sound[at + len(old):])
        if not tree.make(target):
            return "equal", "does not compile"
        if digest(os.path.join(tree.build, target)) == before:
            return "equal", "same object"
        if not names:
            return "survived", "no tests"
        failed = tree.judge(names)
        return ("noticed", failed) if failed else ("survived", f"{len(names)} tests passed")
    finally:
        with open(path, "w", encoding="utf-8") as file:
            file.write(sound)


def show_unexecuted(pools, tree, coverage):
    for name, _, _ in pools:
        missed, of, ranges = coverage.unexecuted(name, tree.tests_for(name, "unit"))
        if missed or not of:
            shown = " ".join(f"{a}-{b}" if b > a else str(a) for a, b in ranges)
            print(f"{name}: {missed} of {of} lines: {shown}" if of else f"{name}: no test executes any of it")
    return 0


def wilson(k, n):
    """Wilson 95 % interval of a share."""
    z, p = 1.96, k / n
    middle, half = (p + z * z / 2 / n) / (1 + z * z / n), z * (p * (1 - p) / n + z * z / 4 / n / n) ** 0.5 / (1 + z * z / n)
    return middle - half, middle + half


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0], epilog="example: mutate.py --count 60 --seed 1")
    parser.add_argument("--source", default=os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__)))))
    parser.add_argument("--work", help="folder of the copy, kept for the next time (default: a temporary one)")
    parser.add_argument("--quick", metavar="BUILD", nargs="?", const="build",
                        help="no copy: compile each bug by itself and link it before the libraries of this build (build); "
                        "one run at a time there")
    parser.add_argument("--skip", nargs="+", default=[], metavar="LABEL", help="leave out tests with these labels (heavy)")
    parser.add_argument("--files", nargs="+", help="files or folders to plant bugs in")
    parser.add_argument("--bugs", metavar="FILE", help='plant the bugs of a list, JSON [{"file", "old", "new"}], but those '
                        "whose text is no longer there")
    parser.add_argument("--coverage", help="folder for a build with gcov: run only the tests that execute a bug's line")
    parser.add_argument("--unexecuted", nargs="+", dest="files_unexecuted", metavar="FILE",
                        help="with --coverage: show the lines that no unit test of the folder executes, and end")
    parser.add_argument("--since", help="only files that changed since this git revision")
    parser.add_argument("--without", nargs="*", default=["bench_"], help="beginnings of file names to leave out")
    parser.add_argument("--suite", choices=["unit", "e2e", "ci"], default="unit",
                        help="which tests judge (default unit, which leaves sim/app out: its tests are the e2e suite); ci: "
                        "the unit tests, then the e2e ones that concern the file, as ./dev test runs both")
    parser.add_argument("--kinds", nargs="+", choices=sorted(OPERATORS) + sorted(CLASSES) + ["statement"], metavar="KIND",
                        help=f"only bugs of these kinds: {', '.join(sorted(OPERATORS) + sorted(CLASSES))}, statement; "
                        "the last ones but statement only if named")
    parser.add_argument("--count", type=int, default=30, help="bugs to plant (default 30)")
    parser.add_argument("--minutes", type=float, default=float("inf"), help="plant no more after so many minutes")
    parser.add_argument("--budget", type=float, default=float("inf"), metavar="SECONDS",
                        help="with --quick: processor time of the tests of a bug; it survives if none has failed by then")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=os.cpu_count())
    parser.add_argument("--least", type=float, default=0.0, help="least score, 0 to 1, for exit code 0")
    parser.add_argument("--json", help="file for the outcomes")
    options = parser.parse_args()
    options.without = tuple(options.without)
    rng = random.Random(options.seed)
    options.files = options.files_unexecuted or options.files
    folder = os.path.abspath(options.work) if options.work else tempfile.mkdtemp(prefix="boresight-mutation-")
    try:
        tree = QuickTree(options.source, options.quick, options.jobs) if options.quick else \
            Tree(options.source, folder, "release", options.jobs)
        tree.skipped = set(options.skip)
        tree.budget = options.budget
        pools = [] if options.bugs and not options.coverage else candidates(options, tree)  # some 20 s of processor time for all files
        coverage = None
        if options.coverage:
            names = set().union(*(tree.tests_for(name, "unit") for name, _, _ in pools))
            coverage = Coverage(options.source, options.coverage, options.jobs, names)
            tree.costs = {n: coverage.known[n]["seconds"] for n in names & set(coverage.known)
                          if coverage.known[n]["code"] == 0}
        if options.files_unexecuted:
            return show_unexecuted(pools, tree, coverage) if coverage else parser.error("--unexecuted needs --coverage")
        if not pools and not options.bugs:
            sys.exit("mutate: no source file to plant a bug in: look at --files and --since")
        outcomes, begun = [], time.monotonic()
        bugs = listed(options.bugs, tree) if options.bugs else drawn(pools, rng, 20 * options.count)
        for name, mutant in bugs:
            if (not options.bugs and len(outcomes) == options.count) or \
                    (outcomes and time.monotonic() > begun + 60 * options.minutes):
                break
            with open(os.path.join(tree.folder, name), encoding="utf-8") as file:
                text = file.read()
            line = text.count("\n", 0, mutant[1]) + 1
            outcome, by = trial(tree, coverage, name, line, mutant, options.suite)
            if outcome == "equal":
                if options.bugs:
                    print(f"{outcome:9}{name}:{line} '{mutant[2]}' -> '{mutant[3]}'  {by}", flush=True)
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
              f"(95 % Wilson interval {100 * low:.0f} to {100 * high:.0f} %)")
        if options.json:
            with open(options.json, "w", encoding="utf-8") as file:
                json.dump(outcomes, file, indent=1)
        return 1 if noticed / len(outcomes) < options.least else 0
    finally:
        if not options.work:
            shutil.rmtree(folder, ignore_errors=True)


if __name__ == "__main__":
    sys.exit(main())
