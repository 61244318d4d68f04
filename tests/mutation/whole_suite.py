#!/usr/bin/env python3
"""Judges a list of planted bugs by the whole suite: all of them are in one program, and an environment variable says which act.

    tests/mutation/whole_suite.py tests/mutation/whole_suite_bugs.json --log outcomes.json
    tests/mutation/whole_suite.py LIST --log outcomes.json --suite e2e         the survivors in the log, by end-to-end tests

The list is as mutate.py --bugs reads it. The function of a bug gets a copy with it (see every_function.py), so that the
libraries are compiled once and each test program is linked once. Each test then runs once without a bug and says which
bugs' lines it enters; those among them that no test has noticed yet act one at a time (first the unit tests nearest to
the bugs) or all together (then the scenes of e2e_figures_kept, the other unit tests and the other end-to-end tests),
where a test that fails is repeated with halves of them. What is noticed together but not alone counts as not noticed.

The log keeps what is done: a run that is ended goes on there. Tests labelled slow and those of the shared library (api,
python) are left out. A bug outside of a function cannot be judged. Nothing in the tree or the build is changed.
"""
import argparse
import json
import os
import re
import shutil
import sys
import tempfile

from every_function import FUNCTION, Function, Library, passes
from mutate import blank_comments, wilson
from quick_tree import QuickTree

NEAR, FAR = 6, 1000  # ranks of unit tests that run before all others with one bug at a time, and of tests that are not near
CHOICE = """
#ifndef BST_MUTANT_CHOICE
#define BST_MUTANT_CHOICE
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
static unsigned char bst_mutant_acts[1024], bst_mutant_logged[1024];
static int bst_mutant_log = -1;
__attribute__((constructor)) static void bst_mutant_read(void) {
    const char *text = getenv("BST_MUTANT"), *name = getenv("BST_ENTERED");
    bst_mutant_log = name ? open(name, O_WRONLY | O_APPEND | O_CREAT | O_CLOEXEC, 0600) : -1;
    for (const char *p = text; p && *p; p = strchr(p, ',') ? strchr(p, ',') + 1 : "") {
        bst_mutant_acts[atoi(p)] = 1;
    }
}
static inline int bst_mutant_enter(int bug) {
    if (bst_mutant_log >= 0 && !bst_mutant_logged[bug]) {
        char line[16];
        bst_mutant_logged[bug] = 1;
        if (write(bst_mutant_log, line, (size_t)sprintf(line, "%d\\n", bug)) < 0) {
            bst_mutant_log = -1;
        }
    }
    return 0;
}
#endif
"""


class Chosen(Function):
    """A function with bugs of a list: its sound body says that a bug's line is entered, where a statement begins there."""

    def text(self):
        kind = self.type.replace("static ", "")
        declared = "" if "static" not in self.type else f"{self.type}{self.name}{self.parameters};\n"
        call, copies, choice, sound = ", ".join(self.names), "", "", self.body
        for number, at, body in sorted(self.bugs, key=lambda bug: -bug[1]):
            copies += f"static {kind}{self.name}__m{number}{self.parameters} {{\n{body}}}\n"
            again = f"{self.name}__m{number}({call});"
            choice += f"if (bst_mutant_acts[{number}]) {{ {again + ' return;' if kind.strip() == 'void' else 'return ' + again} }}\n"
            code = blank_comments(self.body)
            begin = code.rfind("\n", 0, at) + 1
            if code[:begin].rstrip()[-1:] in (";", "{", "}") and not re.match(r"\s*(\}|\.|case|default|else|\w+:)", code[begin:]) \
                    and not re.search(r"=\s*\{[^;]*$", code[:begin]):
                sound = sound[:begin] + f"(void)bst_mutant_enter({number});" + sound[begin:]
            else:
                choice += f"(void)bst_mutant_enter({number});\n"
        return f"{declared}{copies}{self.type}{self.name}{self.parameters} {{\n{choice}{sound}}}\n"


class Listed(Library):
    """The libraries that hold the bugs of a list."""

    def __init__(self, tree, items, scratch):
        self.tree, self.scratch, self.functions, self.texts, self.replaced = tree, scratch, [], {}, {}
        self.bugs = {}
        for number, item in enumerate(items, 1):
            path = item["file"]
            if path not in self.texts:
                with open(os.path.join(tree.folder, path), encoding="utf-8") as file:
                    self.texts[path] = file.read()
                code = blank_comments(self.texts[path])
                self.functions += [Chosen(path, self.texts[path], m, code) for m in FUNCTION.finditer(code)]
            self.plant_one(number, item)
        self.functions = [f for f in self.functions if f.bugs]

    def plant_one(self, number, item):
        text, old = self.texts[item["file"]], item["old"]
        at = text.find(old)
        here = [f for f in self.functions if f.path == item["file"] and f.match.start(4) <= at and at + len(old) <= f.match.end(4)]
        if text.count(old) != 1 or not here or not here[0].usable():
            print(f"whole_suite: cannot plant {number} in {item['file']}", flush=True)
            return
        first = here[0].match.start(4)
        same = next((i for i, (a, b) in enumerate(zip(old, item["new"])) if a != b), 0)  # where it differs
        here[0].bugs.append((number, at + same - first, text[first:at] + item["new"] + text[at + len(old):here[0].match.end(4)]))
        self.bugs[number] = (here[0], item)

    def write(self, path):
        place = super().write(path)
        with open(place, encoding="utf-8") as file:
            text = file.read()
        text = text[text.index("#endif\n") + len("#endif\n"):]
        first = re.search(r"^#include", text, re.M).start()  # after what the file defines for its headers
        with open(place, "w", encoding="utf-8") as file:
            file.write(text[:first] + CHOICE + text[first:])
        return place


class Judge:
    """The tests of a build, and what they say of the bugs; kept in a log."""

    def __init__(self, tree, library, log, scratch):
        self.tree, self.library, self.scratch, self.log = tree, library, scratch, log
        self.linked, self.done, self.noticed = {}, {}, {}
        if log and os.path.exists(log):
            with open(log, encoding="utf-8") as file:
                kept = json.load(file)
            self.done, self.noticed = kept["tests"], {int(n): by for n, by in kept["noticed"].items()}

    def alive(self):
        return {number for number in self.library.bugs if number not in self.noticed}

    def save(self):
        if self.log:
            items = {n: f"{item['file']}: {item['new']}" for n, (_, item) in self.library.bugs.items() if n not in self.noticed}
            with open(self.log, "w", encoding="utf-8") as file:
                json.dump({"noticed": self.noticed, "survivors": items, "tests": self.done}, file, indent=1)

    def command(self, name):
        """The command of a test with the bugs in its program, or None."""
        program = self.tree.program_of(name)
        if program and program not in self.linked:
            self.linked[program] = self.library.link(program)
        path = self.linked.get(program)
        return [path if os.path.basename(w) == program else w for w in self.tree.tests[name][2]] if path else None

    def fails(self, command, seconds, bugs):
        passed, spent = passes(self.tree, command, max(5.0, 4 * seconds), {"BST_MUTANT": ",".join(map(str, sorted(bugs)))})
        return not passed, spent

    def among(self, command, seconds, bugs):
        """Those of the bugs that a test notices alone: halves of a set that it notices together."""
        if not bugs or not self.fails(command, seconds, bugs)[0]:
            return []
        if len(bugs) == 1:
            return bugs
        half = len(bugs) // 2
        return self.among(command, seconds, bugs[:half]) + self.among(command, seconds, bugs[half:])

    def apart(self, bugs):
        """Sets of bugs that can act together: of those of one function only the first would act."""
        parts = []
        for number in bugs:
            function = self.library.bugs[number][0]
            part = next((p for p in parts if all(self.library.bugs[n][0] is not function for n in p)), None)
            if part is None:
                parts.append(part := [])
            part.append(number)
        return parts

    def run(self, name, command, longest, together):
        """Runs a test without a bug, and with those that it enters and that are left."""
        if name in self.done or not self.alive():
            return
        entered, log = set(), os.path.join(self.scratch, "entered")
        if os.path.exists(log):
            os.remove(log)
        sound, spent = passes(self.tree, command, longest, {"BST_ENTERED": log})
        if os.path.exists(log):
            with open(log, encoding="utf-8") as file:
                entered = {int(line) for line in file.read().split()}
        if not sound and spent >= longest:
            print(f"whole_suite: {name} is longer than {longest:.0f} s", flush=True)
            return
        self.done[name] = {"sound": sound, "seconds": round(spent, 2), "entered": sorted(entered)}
        if sound:
            left = sorted(entered & self.alive())
            for part in self.apart(left) if together else [[n] for n in left]:
                for number in self.among(command, spent, part):
                    self.noticed[number] = name
                    print(f"noticed {number} {self.library.bugs[number][1]['file']} by {name}", flush=True)
        else:
            print(f"whole_suite: {name} fails without a bug", flush=True)
        self.save()


def unit_tests(tree, library):
    """[(name, rank)]: what is likely to notice a bug for its time first, by the least rank among those of any bug."""
    ranks = {}
    for function, item in library.bugs.values():
        text = library.texts[item["file"]]
        line = text.count("\n", 0, text.index(item["old"])) + 1
        for rank, name in enumerate(tree.in_order(item["file"], tree.judges_of(item["file"], "unit"), text, line)):
            ranks[name] = min(rank, ranks.get(name, rank))
    names = [n for n, (labels, _, _) in tree.tests.items() if {"unit", "device"} & set(labels) and "slow" not in labels]
    return sorted(((n, ranks.get(n, FAR)) for n in names), key=lambda v: (v[1], tree.costs.get(v[0], tree.expected.get(v[0], 1.0))))


def kept_scenes(tree, command):
    """{name: command} of the scenes of e2e_figures_kept, in their order."""
    with open(os.path.join(tree.folder, "tests", "e2e", "test_figures_kept.py"), encoding="utf-8") as file:
        order = re.findall(r'"(\w+)"', re.search(r"^ORDER = \[(.*?)\]", file.read(), re.M | re.S)[1])
    return {f"e2e_figures_kept {scene}": [w for w in command if w != "--first"] + ["--scenes", scene] for scene in order}


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("bugs", help="list of bugs: JSON [{file, old, new}]")
    parser.add_argument("--build", default="build")
    parser.add_argument("--log", help="file for the outcomes, from which a run that was ended goes on")
    parser.add_argument("--suite", choices=["near", "kept", "unit", "e2e", "all"], default="all")
    parser.add_argument("--longest", type=float, default=120.0, metavar="SECONDS", help="leave out tests that need more (120)")
    parser.add_argument("--tests", default="", help="only those (or scenes) whose names hold this regular expression")
    options = parser.parse_args()
    tree = QuickTree(os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__)))), options.build, 2)
    with open(options.bugs, encoding="utf-8") as file:
        items = json.load(file)
    scratch = tempfile.mkdtemp(prefix="boresight-whole-")
    try:
        library = Listed(tree, items, scratch)
        library.compile()
        judge = Judge(tree, library, options.log, scratch)
        print(f"{len(library.bugs)} bugs, {len(judge.alive())} not noticed yet", flush=True)
        units = unit_tests(tree, library)
        for name, _ in [v for v in units if v[1] < NEAR] if options.suite in ("near", "all") else []:
            if re.search(options.tests, name) and (command := judge.command(name)):
                judge.run(name, command, options.longest, False)
        if options.suite in ("kept", "all"):
            for name, command in kept_scenes(tree, judge.command("e2e_figures_kept")).items():
                if re.search(options.tests, name):
                    judge.run(name, command, options.longest, True)
        ends = [n for n, (labels, _, _) in tree.tests.items() if "e2e" in labels and "slow" not in labels and n != "e2e_figures_kept"]
        for name, _ in units if options.suite in ("unit", "all") else []:
            if re.search(options.tests, name) and (command := judge.command(name)):
                judge.run(name, command, options.longest, True)
        for name in sorted(ends, key=lambda n: tree.expected.get(n, 1.0)) if options.suite in ("e2e", "all") else []:
            if re.search(options.tests, name) and (command := judge.command(name)):
                judge.run(name, command, options.longest, True)
        count, noticed = len(library.bugs), len(judge.noticed)
        low, high = wilson(noticed, count)
        print(f"{noticed} of {count} bugs noticed: {100 * noticed / count:.0f} % (95 % Wilson interval {100 * low:.0f} to {100 * high:.0f} %)")
    finally:
        shutil.rmtree(scratch, ignore_errors=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
