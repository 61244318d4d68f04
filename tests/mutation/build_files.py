"""What both ways of judging a planted bug share: the tests and the objects of a build by Ninja."""
import os
import re
import subprocess

import e2e_suite

# folders whose tests have names of their own: the rest of a path names its tests (tracker/… → tracker_…)
UNIT_TESTS = {f"sim/{name}": name for name in (
    "core", "messages", "dynamics", "astro", "device", "catalogue", "optics", "world", "onboard", "io", "link",
    "engine", "eval", "studies", "satellite", "api", "registry", "cli", "run", "analysis", "process", "export", "report", "study_kinds", "bench")}
UNIT_TESTS["sim/app"] = "app|bad_input"
# the cue as the spacecraft and the world have it; labels as image processing and the generator make them
UNIT_TESTS["sim/onboard"] = "onboard|world_cue|imgproc_discriminate|imgproc_label|obsgen_labels"


def run(command, **keywords):
    return subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False, **keywords)


def listed_tests(build):
    """{name: (labels, command)} of all tests of a build, whether or not their programs are built yet."""
    commands, labels = {}, {}
    for root, _, files in os.walk(os.path.join(build, "tests")):
        if "CTestTestfile.cmake" in files:
            with open(os.path.join(root, "CTestTestfile.cmake"), encoding="utf-8") as file:
                text = file.read()
            for name, command in re.findall(r"^add_test\(\[=\[(.*?)\]=\] (.*)\)$", text, re.M):
                commands[name] = re.findall(r'"((?:[^"\\]|\\.)*)"', command)
            labels.update(re.findall(r'^set_tests_properties\(\[=\[(.*?)\]=\] .*\bLABELS "([^"]*)"', text, re.M))
    return {name: (labels[name].split(";"), command) for name, command in commands.items() if name in labels}


def expected_seconds(source):
    """{name: seconds} of the longer tests, from costs.cmake."""
    with open(os.path.join(source, "tests", "costs.cmake"), encoding="utf-8") as file:
        text = file.read()
    return {name: float(seconds) for name, seconds in
            re.findall(r"(\w+) (\d+)(?=[\s)])", text[text.index("set(bst_costs"):text.index("# bst_cost")])}


class Judges:
    """Which object holds a source and which tests judge it. Users set build, objects and tests {name: (labels, …)}."""

    def __init__(self):
        self.build, self.objects, self.tests = "", [], {}
        self.costs, self.unsound, self.skipped = {}, set(), set()
        self.first = None  # test that noticed a listed bug before: it is run first

    def first_of_all(self, names):
        """The names with the test to run first at their head, if it is among them."""
        return sorted(names, key=lambda n: n != self.first)

    def object_of(self, path):
        """The object of a source, by itself or in a unity build of the nearest folder above with a library of its own."""
        folder = os.path.dirname(path)
        while folder:
            rest = re.escape(os.path.relpath(path, folder))
            made = [o for o in self.objects if re.fullmatch(rf"{re.escape(folder)}/CMakeFiles/[^/]+\.dir/{rest}\.o", o)]
            for together in [o for o in self.objects if o.startswith(folder + "/CMakeFiles/") and "/Unity/" in o]:
                with open(os.path.join(self.build, together[:-len(".o")]), encoding="utf-8") as file:
                    made += [together] if f'/{path}"' in file.read() else []
            if made:
                return made[0]
            folder = os.path.dirname(folder)
        return None

    def tests_for(self, path, suite):
        """Names of the tests that judge a file: those of its folder, those of the program, or first the ones and then the
        others (ci)."""
        if suite == "ci":
            return self.tests_for(path, "unit") + self.tests_for(path, "e2e")
        if suite == "e2e":
            return e2e_suite.concerned(path, [n for n, (labels, _, _) in self.tests.items() if "e2e" in labels])
        top = "/".join(path.split("/")[:2])
        prefix = UNIT_TESTS.get(top, path.split("/")[0])
        names = [n for n, (labels, _, _) in self.tests.items()
                 if re.match(rf"(?:{prefix})(?:_|$)", n) and {"unit", "device"} & set(labels)
                 and not ({"slow"} | self.skipped) & set(labels)]
        return sorted(set(names) - self.unsound, key=lambda n: self.costs.get(n, 1.0))
