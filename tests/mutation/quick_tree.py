"""Judges planted bugs without a copy of the tree: for mutate.py --quick.

A bug is compiled by itself into a scratch folder (-O1) and linked before the libraries of a build that is there, so
that it costs one compilation, one link for each test program, and their runs. The sources and the build stay as they
are. Tests of the shared library (libboresight) are left out: their programs do not link the bug."""
import hashlib
import json
import os
import re
import resource
import shlex
import subprocess
import sys
import tempfile

import build_files


# tests that compare all outputs of a part of the tree in cases without symmetry
DENSE = re.compile(r"symmetr|_parts$|_frame$|_units$|_columns$|(control|obsgen|tracker|imgproc)_module")


def children_seconds():
    """Processor time of all child processes so far."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


class QuickTree(build_files.Judges):
    """A build of the sources, and a scratch folder for the bug."""

    def __init__(self, source, build, jobs):
        super().__init__()
        self.folder, self.build, self.jobs = os.path.abspath(source), os.path.abspath(build), jobs
        if not os.path.exists(os.path.join(self.build, "build.ninja")):
            sys.exit(f"mutate: {build} holds no build by Ninja: make one (cmake --preset release -G Ninja) or name it")
        self.scratch = tempfile.TemporaryDirectory(prefix="boresight-mutant-")
        self.compilations = {}
        for entry in json.loads(self.ninja("-t", "compdb").stdout):
            if entry["output"].endswith(".o"):
                self.compilations[os.path.relpath(entry["output"], self.build)
                                  if os.path.isabs(entry["output"]) else entry["output"]] = entry
        self.objects = list(self.compilations)
        self.tests = {name: (labels, os.path.basename(command[0]), command)
                      for name, (labels, command) in build_files.listed_tests(self.build).items()}
        self.sound_objects, self.links, self.target = {}, {}, None
        self.proven, self.made, self.included = {}, {}, {}  # of tests, of programs, of programs
        self.costs_file = os.path.join(self.build, "test_seconds.json")
        if os.path.exists(self.costs_file):
            with open(self.costs_file, encoding="utf-8") as file:
                self.costs = json.load(file)
        self.budget, self.ended = float("inf"), False  # processor time of a bug's tests, s
        self.expected = build_files.expected_seconds(self.folder)

    def ninja(self, *words):
        return build_files.run(["ninja", "-C", self.build, f"-j{self.jobs}", "--quiet", *words])

    def make(self, *targets):
        return self.ninja(*targets).returncode == 0

    @staticmethod
    def words_of(entry):
        """The words of a compilation without its source, its object and its level of optimisation."""
        words, skip = [], 0
        for word in shlex.split(entry["command"]):
            if skip or word in ("-o", "-c", "-MT", "-MF"):
                skip = 0 if skip else 1
            elif word != "-MD" and not re.fullmatch(r"-O\w*|.*ccache", word):
                words.append(word)
        return words

    def compile(self, target, name, text):
        """Compiles a source, by itself or within its unity build, with this text; digest of the object, or None."""
        place = os.path.join(self.scratch.name, name)
        os.makedirs(os.path.dirname(place), exist_ok=True)
        with open(place, "w", encoding="utf-8") as file:
            file.write(text)
        entry = self.compilations[target]
        unit = os.path.join(entry["directory"], entry["file"])
        if "/Unity/" in target:
            with open(unit, encoding="utf-8") as file:
                together = file.read()
            unit = os.path.join(self.scratch.name, "unity.c")
            with open(unit, "w", encoding="utf-8") as file:
                file.write(together.replace(os.path.join(self.folder, name), place))
        else:
            unit = place
        made = build_files.run([*self.words_of(entry), "-O1", "-w", "-iquote", os.path.join(self.folder, os.path.dirname(name)),
                                "-o", self.object(), "-c", unit], cwd=entry["directory"])
        if made.returncode:
            return None
        with open(self.object(), "rb") as file:
            return hashlib.sha256(file.read()).hexdigest()

    def object(self):
        return os.path.join(self.scratch.name, "mutant.o")

    def sound(self, target, name, text):
        """Digest of the object of the sound source, compiled as a bug is."""
        if (target, name) not in self.sound_objects:
            self.sound_objects[target, name] = self.compile(target, name, text)
        return self.sound_objects[target, name]

    def link_of(self, program):
        """The words that link a program; None for one that is not linked with the libraries themselves."""
        if not self.links:  # one call for all programs: Ninja needs long to read a build
            programs = sorted({self.program_of(n) for n in self.tests} - {None})
            for line in self.ninja("-t", "commands", *programs).stdout.split("\n"):
                made = re.search(r" -o (\S+) ", line)
                if made and (name := os.path.basename(made[1])) in programs and ".o " not in made[0]:
                    words = shlex.split(line.removeprefix(": && ").removesuffix(" && :"))
                    self.links[name] = None if any("libboresight.so" in w for w in words) else words
            for name in programs:
                self.links.setdefault(name, None)
        return self.links[program]

    def link(self, program):
        """Links a program with the bug into the scratch folder; its path, or None."""
        words = list(self.link_of(program))
        at = words.index("-o") + 1
        path = os.path.join(self.scratch.name, program)
        words[at:at + 1] = [path] + ([] if self.target in words else [self.object()])
        words = [self.object() if w == self.target else w for w in words]
        return path if build_files.run(words, cwd=self.build).returncode == 0 else None

    def program_of(self, name):
        """The program that a test runs: its own, or boresight; None: neither."""
        _, first, command = self.tests[name]
        return first if first.startswith("test_") else \
            "boresight" if os.path.join(self.build, "boresight") in command else None

    def judges_of(self, path, suite):
        names = self.tests_for(path, suite)
        if suite != "e2e":
            names += self.including(path, set(names))
        return [n for n in names if self.program_of(n) and self.link_of(self.program_of(n))]

    def including(self, path, others):
        """Unit tests of other folders that include the header of a source."""
        own = os.path.splitext(path)[0]
        own = {own, "boresight/" + os.path.basename(own)}
        return [n for n, (labels, _, _) in self.tests.items()
                if n not in others | self.unsound and {"unit", "device"} & set(labels)
                and not ({"slow"} | self.skipped) & set(labels) and self.program_of(n)
                and any(own & headers for headers, _ in self.sources_of(self.program_of(n)))]

    def is_sound(self, name):
        """Whether a test passes with the sound programs: one that fails there judges nothing."""
        if name not in self.proven:
            begun = children_seconds()
            self.proven[name] = self.passes(self.tests[name][2], 900)
            self.keep_cost(name, children_seconds() - begun)
            if not self.proven[name]:
                print(f"mutate: left out, for it fails without a bug: {name}", flush=True)
                self.unsound.add(name)
        return self.proven[name]

    def sources_of(self, program):
        """[(the headers that it includes, its words)] of a test program's sources."""
        if program not in self.included:
            texts = []
            for target, entry in self.compilations.items():
                if f"/{program}.dir/" in target and "tests/" in target:
                    with open(os.path.join(entry["directory"], entry["file"]), encoding="utf-8") as file:
                        text = file.read()
                    texts.append((set(re.findall(r'^#include "([^"]+)\.h"', text, re.M)), set(re.findall(r"[a-z]{4,}", text))))
            self.included[program] = texts
        return self.included[program]

    def nearness(self, name, path, near):
        """How likely a test is to judge a bug: by words of its name, the headers that it includes, and words of the lines
        about the bug that few tests know."""
        program = self.program_of(name)
        own, folder = os.path.splitext(path)[0], os.path.dirname(path)
        words = set(re.split(r"[/_.]", path)[-3:-1]) | {os.path.basename(own)}
        score = sum(w in name for w in words if len(w) > 3) + 2.0 * bool(DENSE.search(name))
        for headers, known in self.sources_of(program):
            score += 4 * (own in headers) + any(os.path.dirname(h) == folder for h in headers)
            score += sum(near[w] for w in known if w in near)
        return score

    def in_order(self, path, names, text, line):
        """The tests that are most likely to judge a bug for their time first."""
        lines = text.split("\n")
        words = set(re.findall(r"[a-z]{4,}", "\n".join(lines[max(0, line - 4):line + 3])))
        sources = [known for n in names for _, known in self.sources_of(self.program_of(n))]
        near = {w: 1.0 / count for w in words if (count := sum(w in known for known in sources)) > 0}

        def cost(name):
            return self.costs.get(name, self.expected.get(name, 1.0))
        return sorted(names, key=lambda n: -(0.3 + self.nearness(n, path, near)) / (0.5 + cost(n)))

    def keep_cost(self, name, seconds):
        """Keeps the processor time of a test, for this run and later ones of this build."""
        self.costs[name] = seconds
        with open(self.costs_file, "w", encoding="utf-8") as file:
            json.dump(self.costs, file)

    def passes(self, command, seconds):
        """Whether a test passes within so much processor time; a processor shared with others makes it wait longer."""
        limit = int(seconds) + 1
        with tempfile.TemporaryDirectory(prefix="boresight-mutant-run-") as rest:
            try:
                return subprocess.run(command, cwd=self.folder, timeout=10 * limit, check=False, stdin=subprocess.DEVNULL,
                                      stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
                                      preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_CPU, (limit, limit)),
                                      env={**os.environ, "TMPDIR": rest, "PYTHONDONTWRITEBYTECODE": "1"}).returncode == 0
            except subprocess.TimeoutExpired:
                return False

    def judge(self, names):
        """The first test that fails with the bug that was compiled last and passes without it, or None."""
        unmade = {self.program_of(n) for n in names} - set(self.made)
        if unmade and self.make(*unmade):  # one call of Ninja for all of them
            self.made.update({program: True for program in unmade})
        linked, begun_cpu = {}, children_seconds()
        for name in names:
            if children_seconds() > begun_cpu + self.budget:
                self.ended = True
                break
            program = self.program_of(name)
            if program not in self.made:
                self.made[program] = self.make(program)
            if program not in linked:
                linked = {program: self.link(program) if self.made[program] else None}
            if not linked[program]:  # the object needs libraries that this program has none of
                continue
            own = [re.sub(rf".*/{re.escape(program)}", linked[program], w) if os.path.basename(w) == program else w
                   for w in self.tests[name][2]]
            begun = children_seconds()
            usual = self.costs.get(name, self.expected.get(name, 2.0))
            if self.passes(own, max(20.0, 5.0 * usual)):
                if name not in self.costs:
                    self.keep_cost(name, children_seconds() - begun)
            elif self.is_sound(name):
                return name
        return None

    def trial(self, name, text, mutant, suite, coverage, line):
        """(outcome, the test that noticed), as mutate.trial."""
        _, at, old, new = mutant
        self.target = self.object_of(name)
        if self.target is None:
            return "equal", "not compiled"
        names = self.judges_of(name, suite)
        if coverage:
            names = coverage.tests_of(name, line, names)
        names = [n for n in names if n not in self.unsound]
        ordered = [n for n in names if "e2e" in self.tests[n][0]]  # those have their order
        names = self.in_order(name, [n for n in names if n not in ordered], text, line) + ordered
        names = self.first_of_all(names)
        before = self.sound(self.target, name, text)
        after = self.compile(self.target, name, text[:at] + new + text[at + len(old):])
        if after is None:
            return "equal", "does not compile"
        if after == before:
            return "equal", "same object"
        if not names:
            return "survived", "no tests"
        self.ended = False
        failed = self.judge(names)
        return ("noticed", failed) if failed else \
            ("survived", "ended by time" if self.ended else f"{len(names)} tests passed")
