#!/usr/bin/env python3
"""The documentation is complete and consistent: it builds without a warning, links and anchors resolve, figures of
speed stand in docs/results only.

All pages are read and their links resolved, but only PAGES are written as HTML, or with --full all.

Usage, from the repository root: /usr/bin/python3 tests/e2e/test_docs.py BORESIGHT [--full]
"""
import functools
import glob
import os
import re
import shutil
import subprocess
import sys
import tempfile
import unittest

README_WORDS = 900
# with equations, of the C API and of keys; with the words of the field
PAGES = ["index.md", "glossary.md", "tutorial/index.md", "explanation/equations/tracking.md", "reference/c_api/index.md",
         "reference/scenario_keys/camera.md"]
# what gives away a measured speed: a machine, or a time or rate of computing
TIMINGS = [r"\b(Xeon|EPYC|Zen 3|Ryzen)\b",
           r"\d\s*(ns|µs|ms|s|min)\b[^.|]{0,40}\b(processor|CPU|wall)[- ](clock )?time",
           r"\b(processor|CPU) time[^.|]{0,30}\d",
           r"\d\s*(x|×|times) (as fast as )?real time",
           r"\d\s*(ns|µs|ms) (a|per) (frame|step|pixel|source|star|track|query)",
           r"\b(takes?|took|costs?|needs?) (about |some |up to )?\d[\d.,]*( to \d[\d.,]*)?\s*(ns|µs|ms|s|min)\b[^.|]*\bcores?\b"]


def slug(heading):
    """The anchor that Sphinx and GitHub give a heading."""
    text = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading).replace("`", "").strip().lower()
    return re.sub(r"[^\w\- ]", "", text).replace(" ", "-")


def prose(path):
    """(number, line) outside of fenced blocks."""
    fenced = False
    with open(path, encoding="utf-8") as file:
        for number, line in enumerate(file, 1):
            if line.lstrip().startswith("```"):
                fenced = not fenced
            elif not fenced:
                yield number, line


@functools.lru_cache(maxsize=None)
def anchors(path):
    seen, out = {}, set()
    for _, line in prose(path):
        match = re.match(r"#+ (.*)", line)
        if match:
            name = slug(match[1])
            out.add(name if name not in seen else f"{name}-{seen[name]}")
            seen[name] = seen.get(name, 0) + 1
    return out


def links(path):
    for number, line in prose(path):
        for target in re.findall(r"\]\(([^)\s]+)\)", re.sub(r"`[^`]*`", "", line)):
            if not re.match(r"[a-z]+:", target):
                yield number, target


class Docs(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.mkdtemp(prefix="boresight-site-")
        cls.source = os.path.join(cls.folder, "source")
        cls.html = os.path.join(cls.folder, "html")
        cls.built = subprocess.run([sys.executable, "docs/make_site.py", PROGRAM, cls.source, cls.html] + ([] if FULL else PAGES),
                                   capture_output=True, text=True)

    @classmethod
    def tearDownClass(cls):
        shutil.rmtree(cls.folder)

    def test_builds_without_a_warning(self):
        """Sphinx with -W and -n. Without Sphinx this fails: ./dev deps installs it."""
        self.assertEqual(self.built.returncode, 0, self.built.stdout + self.built.stderr[-3000:])
        for name in ("index.html", "search.html", "searchindex.js", "tutorial/index.html", "reference/c_api/index.html"):
            self.assertTrue(os.path.exists(os.path.join(self.html, name)), name)

    def test_search_index_knows_the_words_of_the_field(self):
        """The index holds stems: custodi for custody, read_noise_ for the key read_noise_e."""
        with open(os.path.join(self.html, "searchindex.js"), encoding="utf-8") as file:
            index = file.read()
        for word in ("kalman", "moffat", "psf", "sgp4", "bloom", "custodi", "cosmic", "zernik", "read_noise_"):
            self.assertTrue(word in index, word)

    def test_needs_no_network(self):
        """No page loads a script, a style sheet, a font or a picture from elsewhere."""
        outside = re.compile(r"<(?:script|img)[^>]*\ssrc=\"https?:|<link[^>]*\shref=\"https?:[^>]*stylesheet|url\(\s*['\"]?https?:")
        wrong = []
        for path in glob.glob(self.html + "/**/*.*", recursive=True):
            if path.endswith((".html", ".css")):
                with open(path, encoding="utf-8") as file:
                    wrong += [os.path.relpath(path, self.html)] if outside.search(file.read()) else []
        self.assertEqual(wrong, [])

    def test_links_and_anchors_resolve(self):
        """Of the site with its generated pages, and of README and CHANGELOG in the repository."""
        pages = [(path, self.source) for path in glob.glob(self.source + "/**/*.md", recursive=True)]
        wrong, count = [], 0
        for path, root in pages + [("README.md", "."), ("CHANGELOG.md", ".")]:
            for number, target in links(path):
                count += 1
                name, _, anchor = target.partition("#")
                other = os.path.normpath(os.path.join(os.path.dirname(path), name)) if name else path
                place = f"{os.path.relpath(path, root)}:{number}: {target}"
                if not os.path.exists(other):
                    wrong.append(place + ": no such file")
                elif root != "." and not os.path.abspath(other).startswith(os.path.abspath(root)):
                    wrong.append(place + ": outside of the site")
                elif anchor and anchor not in anchors(other):
                    wrong.append(place + ": no such heading")
        self.assertGreater(count, 200)
        self.assertEqual(wrong, [])

    def test_c_api_has_each_public_header(self):
        """One page for each header of include/boresight, under the name that programs include, and no other."""
        found = []
        for path in glob.glob(self.source + "/reference/c_api/*.md"):
            with open(path, encoding="utf-8") as file:
                found += re.findall(r'^`#include "(.*)"`$', file.read(), re.MULTILINE)
        public = [os.path.relpath(path, "include") for path in glob.glob("include/boresight/**/*.h", recursive=True)]
        self.assertEqual(sorted(found), sorted(public))

    def test_paths_in_the_sources_exist(self):
        """What messages, help texts and comments call docs/... is there."""
        wrong = []
        for folder in ("sim", "scenegen", "gimbal", "imgproc", "tracker", "control", "obsgen", "scenarios", "python", "tests", "cmake"):
            for path in glob.glob(folder + "/**/*.*", recursive=True):
                if not path.endswith((".c", ".h", ".cpp", ".py", ".json", ".txt", ".cmake", ".cl", ".inc")):
                    continue
                with open(path, encoding="utf-8") as file:
                    for name in re.findall(r"\bdocs/[\w/.-]+\.(?:md|py|png|c)\b", file.read()):
                        if not os.path.exists(name) and not os.path.exists(os.path.join(self.source, name[5:])):
                            wrong.append(f"{path}: {name}")
        self.assertEqual([line for line in wrong if "docs/x.md" not in line], [])

    def test_every_page_is_in_the_index(self):
        """A page beside the others is named by the index of its folder."""
        wrong = []
        for path in glob.glob("docs/**/*.md", recursive=True):
            folder, name = os.path.split(path)
            index = os.path.join(folder, "index.md")
            if name in ("index.md", "glossary.md"):
                continue
            with open(index, encoding="utf-8") as file:
                if f"]({name})" not in file.read():
                    wrong.append(path)
        self.assertEqual(wrong, [])

    def test_headings_are_said_once(self):
        """No page has two sections of one name on one level of one section (what was moved and not deleted)."""
        wrong = []
        for path in ["README.md"] + glob.glob("docs/**/*.md", recursive=True):
            above, seen = {}, set()
            for number, line in prose(path):
                match = re.match(r"(#+) (.*)", line)
                if match:
                    level = len(match[1])
                    above = {k: v for k, v in above.items() if k < level} | {level: match[2]}
                    place = tuple(above.values())
                    wrong += [f"{path}:{number}: {match[2]}"] if place in seen else []
                    seen.add(place)
        self.assertEqual(wrong, [])

    def test_readme_is_short(self):
        with open("README.md", encoding="utf-8") as file:
            self.assertLessEqual(len(file.read().split()), README_WORDS)

    def test_timings_stand_in_results_only(self):
        wrong = []
        for path in ["README.md"] + glob.glob("docs/**/*.md", recursive=True):
            if path.startswith("docs/results/"):
                continue
            for number, line in prose(path):
                for pattern in TIMINGS:
                    match = re.search(pattern, line)
                    if match:
                        wrong.append(f"{path}:{number}: {match[0]}")
        self.assertEqual(wrong, [])

    def test_results_are_dated(self):
        """Each page of results says when, and the ones with times say on which machine."""
        for path in glob.glob("docs/results/*.md"):
            if path.endswith("index.md"):
                continue
            with open(path, encoding="utf-8") as file:
                self.assertRegex(file.read(), r"20\d\d-\d\d-\d\d", path)


if __name__ == "__main__":
    PROGRAM, FULL = os.path.abspath(sys.argv[1]), "--full" in sys.argv
    unittest.main(argv=sys.argv[:1])
