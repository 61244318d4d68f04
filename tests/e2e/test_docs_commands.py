#!/usr/bin/env python3
"""Runs every fenced command of README.md and docs/, and checks that nothing escapes it.

Usage, from the repository root:
    /usr/bin/python3 tests/e2e/test_docs_commands.py BORESIGHT CMAKE BUILD_FOLDER [--slow] [--page docs/x.md]

A fenced block of language sh or console is run, all blocks of a page in one shell session each, page after page, in a
scratch folder that looks like the repository. A comment on the line before a block changes that:

    <!-- test: duration=60 -->  `run` commands simulate 60 s instead of 1 s; without the mark a command's own --duration is kept
                                (a shipped study is only planned: --dry-run; one of the page has two replicates of 30 s)
    <!-- test: check -->        without --slow each `run` is only a `check` of the same scenario and settings
    <!-- test: exit=1 -->       the block ends with this exit code
    <!-- test: background -->   the block runs beside the next ones of its page and must end with 0 by its end
    <!-- test: needs=ds9 -->    counted and printed as not run where the program ds9 is missing
    <!-- test: slow -->         run by --slow only (./dev slow), at full length
    <!-- test: tree -->         runs in a copy of the sources without a build folder
    <!-- test: network -->      needs a network or changes the machine: run by --slow when BORESIGHT_TEST_NETWORK is set
    <!-- test: cluster -->      needs Slurm: tests/e2e/slurm/test_slurm.py runs the same command
"""
import glob
import os
import re
import resource
import shutil
import stat
import subprocess
import sys
import tempfile
import unittest

ROOT = os.getcwd()
SECONDS = 1
# where PoCL keeps the kernels that the tests before compiled (its own rule), as HOME is another one here
KERNELS = os.environ.get("POCL_CACHE_DIR") or os.path.join(
    os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache"), "pocl", "kcache")
LANGUAGES = {"sh", "console", "text", "json", "c", "python", "cmake", "{toctree}"}
# variables that later blocks of a page use; not the variables of one command
SETTING = re.compile(r"""export .*|\w+=(\S*|"[^"]*")""")
WORDS = re.compile(r"<!-- test: (.*) -->")
# no site packages: it starts once for each command
WRAPPER = """#!/usr/bin/python3 -IS
import json, os, sys
words = sys.argv[1:]
length = os.environ.get("DOCS_DURATION")
if "run" in words[:3] and length and "--replay" not in words and "--help" not in words:
    if "--duration" not in words:
        words += ["--duration", length]
    elif os.environ.get("DOCS_OWN"):
        words[words.index("--duration") + 1] = length
    if words[0] == "run":
        words += ["--no-pictures"]
if words[:1] == ["run"] and length and os.environ.get("DOCS_CHECK"):
    at = words.index("--out")
    words = ["check", "--quiet"] + [word for word in words[1:at] + words[at + 2:] if word not in ("--overwrite", "--no-pictures")]
if words[:1] == ["study"] and length and "--out" in words and "--emit" not in words and "scenarios/" in words[1]:
    words += ["--dry-run"] if "--dry-run" not in words else []
elif (words[:1] == ["study"] and length and "--out" in words and words[1].endswith(".json")
      and not os.path.realpath(words[1]).startswith({root!r} + os.sep)):
    with open(words[1], encoding="utf-8") as file:
        study = dict(json.load(file), replicates=2)
    if study.get("set", {{}}).get("/duration_s", 0) > 30:
        study["set"]["/duration_s"] = 30
    with open(words[1], "w", encoding="utf-8") as file:
        json.dump(study, file)
if words[:1] == ["view"]:  # it shows a run until Ctrl-C
    import signal, subprocess, urllib.request
    viewer = subprocess.Popen([{program!r}, *words, "--no-browser"], stdout=subprocess.PIPE, text=True)
    urllib.request.urlopen(viewer.stdout.readline().strip() + "api/run").close()
    viewer.send_signal(signal.SIGINT)
    sys.exit(viewer.wait())
os.execv({program!r}, [{program!r}] + words)
"""


def pages():
    return ["README.md"] + sorted(glob.glob("docs/**/*.md", recursive=True))


def blocks(path):
    """(line, language, marks, text) of each fenced block of a page."""
    out, marks, start, language, lines = [], {}, 0, None, []
    with open(path, encoding="utf-8") as file:
        for number, line in enumerate(file, 1):
            stripped = line.strip()
            if language is None and stripped.startswith("```"):
                start, language, lines = number, stripped[3:].strip(), []
            elif language is not None and stripped == "```":
                out.append((start, language, marks, "".join(lines)))
                language, marks = None, {}
            elif language is not None:
                lines.append(line)
            else:
                match = WORDS.fullmatch(stripped)
                if match:
                    marks = dict((word.split("=", 1) + ["yes"])[:2] for word in match[1].split())
                elif stripped:
                    marks = {}
    return out


class Scratch:
    """A folder that commands take for the repository."""

    def __init__(self, program):
        self.path = tempfile.mkdtemp(prefix="boresight-docs-")
        for name in ("scenarios", "python", "docs", "tests", "sim", "cmake", "CMakeLists.txt", "CMakePresets.json", "dev"):
            os.symlink(os.path.join(ROOT, name), os.path.join(self.path, name))
        build = os.path.join(self.path, "build")
        os.makedirs(build)
        os.makedirs(os.path.join(self.path, "runs"))
        for name in os.listdir(BUILD):
            if name not in ("boresight", "docs", "docs-source", "docs-stage"):
                os.symlink(os.path.join(BUILD, name), os.path.join(build, name))
        tools = os.path.join(self.path, ".tools")
        os.makedirs(tools)
        for wrapper in (os.path.join(build, "boresight"), os.path.join(tools, "boresight")):
            with open(wrapper, "w", encoding="utf-8") as file:
                file.write(WRAPPER.format(program=program, root=os.path.realpath(ROOT)))
            os.chmod(wrapper, os.stat(wrapper).st_mode | stat.S_IXUSR)
        os.symlink(CMAKE, os.path.join(tools, "cmake"))
        self.tools = tools

    def start(self, text, marks):
        length = marks.get("duration", "" if "slow" in marks else str(SECONDS))
        home = os.path.join(self.path, "home")
        os.makedirs(home, exist_ok=True)
        environment = dict(os.environ, DOCS_DURATION=length, DOCS_OWN="" if SLOW else marks.get("duration", ""),
                           DOCS_CHECK="" if SLOW else marks.get("check", ""), PATH=self.tools + ":" + os.environ["PATH"],
                           HOME=home, POCL_CACHE_DIR=KERNELS)
        folder = self.path
        if "tree" in marks:
            folder = os.path.join(self.path, "tree")
            shutil.copytree(ROOT, folder, symlinks=True, ignore=shutil.ignore_patterns("build", "build-*", "runs", ".git"))
        return subprocess.Popen(["bash", "-e", "-u", "-o", "pipefail", "-c", text], cwd=folder, env=environment,
                                stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)


def left_out(marks):
    """Why a block is not run here, or None."""
    if "cluster" in marks:
        return "tests/e2e/slurm/test_slurm.py runs it"
    if "network" in marks and not (SLOW and os.environ.get("BORESIGHT_TEST_NETWORK")):
        return "needs a network: --slow with BORESIGHT_TEST_NETWORK set"
    if "slow" in marks and not SLOW:
        return "slow: ./dev slow runs it"
    if "needs" in marks and not shutil.which(marks["needs"]):
        return f"the program {marks['needs']} is missing"
    return None


class Commands(unittest.TestCase):
    def test_every_block_says_its_language(self):
        wrong = [f"{path}:{line}: ```{language}" for path in pages() for line, language, _, _ in blocks(path)
                 if language not in LANGUAGES]
        self.assertEqual(wrong, [])

    def test_commands_in_other_blocks(self):
        """A block that is not run holds no command: no line of it begins with the program or ./dev."""
        command = re.compile(r"\s*(\$ )?(build/boresight|boresight|\./dev) [a-z]")
        wrong = [f"{path}:{line}: {row}" for path in pages() for line, language, _, text in blocks(path)
                 if language == "text" for row in text.split("\n") if command.match(row) and not row.startswith("boresight:")
                 and not re.match(r"boresight [a-z-]+:", row)]
        self.assertEqual(wrong, [])

    def test_commands_run(self):
        """Blocks of one page share a folder, variables and what they wrote, in the order of the page."""
        count, failed, skipped = 0, [], []
        for path in PAGES or pages():
            todo = [block for block in blocks(path) if block[1] in ("sh", "console")]
            if not todo:
                continue
            scratch, background, before = Scratch(PROGRAM), [], ""
            for line, _, marks, text in todo:
                place = f"{path}:{line}"
                settings = "".join(row + "\n" for row in text.split("\n") if SETTING.fullmatch(row))
                why = left_out(marks)
                if why:
                    skipped.append(f"{place}: {why}")
                    before += settings
                    continue
                count += 1
                process = scratch.start(before + text, marks)
                before += settings
                if "background" in marks:
                    background.append((place, process))
                    continue
                self.finish(place, process, int(marks.get("exit", "0")), failed)
                for other in background:
                    self.finish(*other, 0, failed)
                background = []
            for other in background:
                self.finish(*other, 0, failed)
            shutil.rmtree(scratch.path)
        print(f"{count} blocks run, {len(skipped)} left to others:\n  " + "\n  ".join(skipped))
        self.assertEqual(failed, [])
        self.assertGreater(count, 0)

    spent_s = 0.0  # of the processor, by blocks so far

    def finish(self, place, process, expected, failed):
        try:
            output, _ = process.communicate(timeout=3600 if SLOW else 300)
        except subprocess.TimeoutExpired:
            process.kill()
            output = process.communicate()[0] + "\ntoo slow: mark it <!-- test: slow -->"
        used = resource.getrusage(resource.RUSAGE_CHILDREN)
        spent, self.spent_s = used.ru_utime + used.ru_stime - self.spent_s, used.ru_utime + used.ru_stime
        print(f"{place}: exit code {process.returncode}, {spent:.1f} s of processor time", flush=True)
        if process.returncode != expected:
            failed.append(f"{place}: exit code {process.returncode}, not {expected}: {output[-1500:]}")


if __name__ == "__main__":
    PROGRAM, CMAKE, BUILD = os.path.abspath(sys.argv[1]), shutil.which(sys.argv[2]), os.path.abspath(sys.argv[3])
    SLOW = "--slow" in sys.argv
    PAGES = [sys.argv[i + 1] for i, word in enumerate(sys.argv) if word == "--page"]
    unittest.main(argv=sys.argv[:1])
