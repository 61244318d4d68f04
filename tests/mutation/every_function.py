#!/usr/bin/env python3
"""Plants bugs in every function of a library at once, and counts the functions in which the unit tests notice one.

    tests/mutation/every_function.py tracker --seed 1                   one bug in each function with formulas
    tests/mutation/every_function.py imgproc --each 3 --longest 1       three in each, tests of 1 s at most

Each function gets copies with one bug each, and an environment variable chooses the copy that is called: the library is
compiled once, each test is linked once, and a bug costs only the tests that enter its function, quickest first. Judged by
the unit tests of the folder in the build (--build), within --longest seconds of processor time each: a lower bound.
Prints the survivors, the functions that no test enters, and the share with its 95 % Wilson interval. Bugs that change no
result count as survivors. Nothing in the tree or the build is changed.
"""
import argparse
import json
import os
import random
import re
import resource
import shutil
import subprocess
import sys
import tempfile
import threading
from concurrent.futures import ThreadPoolExecutor

import build_files
from draw_places import WITHOUT_FORMULAS, quantity_lines
from mutate import CLASSES, blank_comments, mutants_of, wilson
from quick_tree import QuickTree

KINDS = ["sign", "axis", "root", "product", "constant", "dropped", *sorted(set(CLASSES) - {"swapped"})]
CHOICE = """
#ifndef BST_MUTANT_CHOICE
#define BST_MUTANT_CHOICE
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>
static int bst_mutant_choice(int function) {
    static int chosen = -1, log = -1;
    static unsigned char entered[65536];
    if (chosen < 0) {
        const char *text = getenv("BST_MUTANT"), *name = getenv("BST_ENTERED");
        log = name ? open(name, O_WRONLY | O_APPEND | O_CREAT, 0600) : -1;
        chosen = text ? atoi(text) : 0;
    }
    if (log >= 0 && !entered[function]) {
        char line[16];
        entered[function] = 1;
        if (write(log, line, (size_t)sprintf(line, "%d\\n", function)) < 0) {
            log = -1;
        }
    }
    return chosen;
}
#endif
"""
FUNCTION = re.compile(r"^(?!typedef|struct \w+ \{|enum|union|#|extern)([A-Za-z_][\w \*\n]*?[ \*])(\w+)(\([^;{}=]*?\)) \{\n(.*?)^\}\n", re.M | re.S)


class Function:
    """A function of a source: its parts, and the bugs that it gets."""

    def __init__(self, path, text, match, code):
        self.path, self.match, self.number, self.bugs = path, match, 0, []
        self.type, self.name, self.parameters = (text[match.start(i):match.end(i)] for i in (1, 2, 3))
        self.body = text[match.start(4):match.end(4)]
        inner = code[match.start(3) + 1:match.end(3) - 1].strip()
        self.names = []
        for part in split_parameters(inner) if inner not in ("", "void") else []:
            pointer = re.search(r"\(\*(\w+)\)", part)
            plain = re.search(r"(\w+)\s*(?:\[[^\]]*\]\s*)*$", part)
            self.names.append(pointer[1] if pointer else plain[1] if plain else "...")

    def usable(self):
        return "..." not in self.parameters and "..." not in self.names and self.name != "main" and "inline" not in self.type

    def text(self):
        """The function with its copies before it."""
        kind = self.type.replace("static ", "")
        declared = "" if "static" not in self.type else f"{self.type}{self.name}{self.parameters};\n"
        call = ", ".join(self.names)
        copies, cases = "", ""
        for number, _, body in self.bugs:
            copies += f"static {kind}{self.name}__m{number}{self.parameters} {{\n{body}}}\n"
            again = f"{self.name}__m{number}({call});"
            cases += f"case {number}: {again} return;\n" if kind.strip() == "void" else f"case {number}: return {again}\n"
        return (f"{declared}{copies}{self.type}{self.name}{self.parameters} {{\n"
                f"switch (bst_mutant_choice({self.number})) {{\n{cases}default: break;\n}}\n{self.body}}}\n")


def asks_for(text):
    """The lines of a source that must be before its first header: which functions of the system it wants."""
    return "".join(re.findall(r"^#define _\w+_SOURCE\b.*\n", text, re.M))


def split_parameters(text):
    parts, depth, now = [], 0, ""
    for c in text:
        depth += c in "([" and 1 or c in ")]" and -1 or 0
        if c == "," and depth == 0:
            parts, now = parts + [now], ""
        else:
            now += c
    return parts + [now]


def in_context(path, text, at, old, new):
    """A bug as mutate.py --bugs reads it: with so many lines about it that the text occurs once in its file."""
    first, last = text.rfind("\n", 0, at) + 1, text.index("\n", at + len(old))
    while text.count(text[first:last]) > 1:
        first, last = text.rfind("\n", 0, max(first - 1, 0)) + 1, text.index("\n", last + 1)
    return {"file": path, "old": text[first:last], "new": text[first:at] + new + text[at + len(old):last]}


class Library:
    """A library of the build with the bugs in it, in a scratch folder."""

    def __init__(self, tree, folder, rng, each, scratch):
        self.tree, self.scratch, self.functions, self.texts = tree, scratch, [], {}
        self.listed = {}  # number of a bug: as mutate.py --bugs reads it
        listed = build_files.run(["git", "-C", tree.folder, "ls-files", "--", folder]).stdout.split("\n")
        for path in listed:
            if path.endswith(".c") and (WITHOUT_FORMULAS.match(folder + "/") or not WITHOUT_FORMULAS.match(path)):
                self.plant(path, rng, each)
        if not self.functions:
            sys.exit(f"every_function: no function with formulas in {folder}")
        self.bugs = {number: (f, shown) for f in self.functions for number, shown, _ in f.bugs}
        self.replaced = {}  # archive of the build: its copy

    def plant(self, path, rng, each):
        with open(os.path.join(self.tree.folder, path), encoding="utf-8") as file:
            text = file.read()
        code, lines = blank_comments(text), set(quantity_lines(text.split("\n")))
        mutants = [m for m in mutants_of(path, text) if m[0] in KINDS]
        for match in FUNCTION.finditer(code):
            f = Function(path, text, match, code)
            first, last = match.start(4), match.end(4)
            inside = [m for m in mutants if first <= m[1] < last and text.count("\n", 0, m[1]) in lines]
            if not inside or not f.usable():
                continue
            f.number = len(self.functions) + 1
            for kind in rng.sample(kinds := sorted({m[0] for m in inside}), min(each, len(kinds))):
                _, at, old, new = rng.choice([m for m in inside if m[0] == kind])
                number = sum(len(g.bugs) for g in self.functions) + len(f.bugs) + 1
                self.listed[number] = in_context(path, text, at, old, new)
                line = text.count("\n", 0, at) + 1
                f.bugs.append((number, f"{path}:{line} {f.name}: {kind} '{old}' -> '{new}' [{text.split(chr(10))[line - 1].strip()}]",
                               text[first:at] + new + text[at + len(old):last]))
            self.functions.append(f)
        self.texts[path] = text

    def write(self, path):
        text = self.texts[path]
        for f in sorted((f for f in self.functions if f.path == path), key=lambda f: -f.match.start()):
            text = text[:f.match.start()] + f.text() + text[f.match.end():]
        place = os.path.join(self.scratch, path)
        os.makedirs(os.path.dirname(place), exist_ok=True)
        with open(place, "w", encoding="utf-8") as file:
            file.write(asks_for(text) + CHOICE + text)
        return place

    def compile_object(self, target, paths):
        """Compiles an object with the bugs of its sources; drops those that do not compile."""
        entry = self.tree.compilations[target]
        made = os.path.join(self.scratch, target.replace("/", "_"))
        for _ in range(6):
            places = {path: self.write(path) for path in paths}
            unit = next(iter(places.values()))
            if "/Unity/" in target:
                with open(os.path.join(entry["directory"], entry["file"]), encoding="utf-8") as file:
                    together = file.read()
                for path, place in places.items():
                    together = together.replace(os.path.join(self.tree.folder, path), place)
                unit = made + ".c"
                with open(unit, "w", encoding="utf-8") as file:
                    file.write(together)
            result = build_files.run([*self.tree.words_of(entry), "-O1", "-w", "-Werror=implicit-function-declaration",
                                      "-iquote", os.path.join(self.tree.folder, os.path.dirname(paths[0])),
                                      "-o", made, "-c", unit], cwd=entry["directory"])
            if result.returncode == 0:
                return made
            wrong = set()
            for place, line in re.findall(r"^(\S+?):(\d+):\d+: (?:fatal )?error", result.stdout, re.M):
                with open(place, encoding="utf-8") as file:
                    before = "".join(file.readlines()[:int(line)])
                wrong |= {int(n) for n in re.findall(r"__m(\d+)\(.*?\) \{\n", before, re.S)[-1:]}
            if not wrong:
                print(f"every_function: left out: {target}\n{result.stdout[:600]}", flush=True)
                return None
            for f in self.functions:
                for number, _, _ in [b for b in f.bugs if b[0] in wrong]:
                    self.bugs.pop(number, None)
                f.bugs = [b for b in f.bugs if b[0] not in wrong]
        return None

    def compile(self):
        sources = {}
        for path in self.texts:
            target = self.tree.object_of(path)
            if target and any(f.path == path for f in self.functions):
                sources.setdefault(target, []).append(path)
        with ThreadPoolExecutor(2) as pool:
            objects = dict(zip(sources, pool.map(lambda t: self.compile_object(t, sources[t]), sources)))
        for target, made in objects.items():
            if made is None:
                for f in [f for f in self.functions if f.path in sources[target]]:
                    for number, _, _ in f.bugs:
                        self.bugs.pop(number, None)
        with open(os.path.join(self.tree.build, "build.ninja"), encoding="utf-8") as file:
            for archive, members in re.findall(r"^build (\S+\.a): \w*STATIC_LIBRARY_LINKER\w+ (.*?)(?: \||$)", file.read() + "\n", re.M):
                members = [m for m in members.split() if m.endswith(".o")]
                if any(objects.get(m) for m in members):
                    copy = os.path.join(self.scratch, archive.replace("/", "_"))
                    subprocess.run(["ar", "qcS", copy, *(objects.get(m) or os.path.join(self.tree.build, m) for m in members)], check=True)
                    subprocess.run(["ranlib", copy], check=True)
                    self.replaced[archive] = copy

    def link(self, program):
        """The program with the library that has the bugs; None if it has no use for it."""
        words = self.tree.link_of(program)
        if not words or not any(w in self.replaced for w in words):
            return None
        words, path = [self.replaced.get(w, w) for w in words], os.path.join(self.scratch, program)
        words[words.index("-o") + 1] = path
        result = build_files.run(words, cwd=self.tree.build)
        return path if result.returncode == 0 else None


def passes(tree, command, seconds, environment):
    """(whether a test passes within so much processor time, what it needed of it)."""
    limit = int(seconds) + 1
    with tempfile.TemporaryDirectory(prefix="boresight-mutant-run-") as rest:
        with subprocess.Popen(command, cwd=tree.folder, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL,
                              stderr=subprocess.DEVNULL,
                              preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_CPU, (limit, limit)),
                              env={**os.environ, "TMPDIR": rest, **environment}) as child:
            watch = threading.Timer(20.0 * limit, child.kill)  # one that waits for ever uses no processor time
            watch.start()
            _, status, used = os.wait4(child.pid, 0)
            watch.cancel()
            child.returncode = os.waitstatus_to_exitcode(status)
    return child.returncode == 0, used.ru_utime + used.ru_stime


def enter(tree, library, name, longest, scratch):
    """(name, command, seconds, functions) of a test that passes without a bug in its time, or None."""
    program = tree.program_of(name)
    path = library.link(program)
    if path is None:
        return None
    command = [re.sub(rf".*/{re.escape(program)}$", path, w) if os.path.basename(w) == program else w for w in tree.tests[name][2]]
    log = os.path.join(scratch, name + ".entered")
    sound, spent = passes(tree, command, longest, {"BST_ENTERED": log})
    if not sound:
        return None
    entered = set()
    if os.path.exists(log):
        with open(log, encoding="utf-8") as file:
            entered = {int(line) for line in file.read().split()}
    return name, command, spent, entered


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("folder", help="folder of a library, or of a part of one: tracker, sim/eval, imgproc/streak")
    parser.add_argument("--build", default="build")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--each", type=int, default=1, help="bugs in each function, of different kinds (default 1)")
    parser.add_argument("--longest", type=float, default=2.0, metavar="SECONDS", help="leave out tests that need more (default 2)")
    parser.add_argument("--budget", type=float, default=6.0, metavar="SECONDS", help="of tests for each bug (default 6)")
    parser.add_argument("--json", help="file for the outcomes")
    parser.add_argument("--survivors", help="file for those that survived, a list for mutate.py --bugs: --suite e2e judges them")
    options = parser.parse_args()
    tree = QuickTree(os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__)))), options.build, 2)
    scratch = tempfile.mkdtemp(prefix="boresight-every-")
    try:
        library = Library(tree, options.folder, random.Random(options.seed), options.each, scratch)
        library.compile()
        names = sorted(set().union(*(tree.judges_of(path, "unit") for path in {f.path for f in library.functions})))
        tree.make(*sorted({tree.program_of(name) for name in names}))
        with ThreadPoolExecutor(2) as pool:
            tests = list(filter(None, pool.map(lambda n: enter(tree, library, n, options.longest, scratch), names)))
        tests.sort(key=lambda t: t[2])
        print(f"{len(library.bugs)} bugs in {len(library.functions)} functions, {len(tests)} of {len(names)} tests", flush=True)

        def judge(number):
            f, shown = library.bugs[number]
            left, reached = options.budget, [t for t in tests if f.number in t[3]]
            for name, command, seconds, _ in reached:
                passed, spent = passes(tree, command, max(3.0, 3 * seconds), {"BST_MUTANT": str(number)})
                if not passed:
                    return "noticed", name, shown
                left -= spent
                if left < 0:
                    return "survived", "ended by time", shown
            return "survived", f"{len(reached)} tests passed" if reached else "not entered", shown
        with ThreadPoolExecutor(2) as pool:
            outcomes = []
            for outcome in pool.map(judge, sorted(library.bugs)):
                outcomes.append(outcome)
                if outcome[0] == "survived":
                    print(f"{outcome[2]}  {outcome[1]}", flush=True)
        noticed = sum(o[0] == "noticed" for o in outcomes)
        low, high = wilson(noticed, len(outcomes))
        print(f"{options.folder}: {noticed} of {len(outcomes)} bugs noticed: {100 * noticed / len(outcomes):.0f} % "
              f"(95 % Wilson interval {100 * low:.0f} to {100 * high:.0f} %)", flush=True)
        if options.json:
            with open(options.json, "w", encoding="utf-8") as file:
                json.dump(outcomes, file, indent=1)
        if options.survivors:
            left = [library.listed[n] for n, o in zip(sorted(library.bugs), outcomes) if o[0] == "survived"]
            with open(options.survivors, "w", encoding="utf-8") as file:
                json.dump(left, file, indent=1)
    finally:
        shutil.rmtree(scratch, ignore_errors=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
