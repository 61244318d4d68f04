#!/usr/bin/env python3
"""What `cmake --install` leaves: a tree that can be moved, out of which a C program is built with
pkg-config and with CMake, far from the sources.

Usage, from the repository root:
/usr/bin/python3 tests/e2e/test_install.py BORESIGHT CMAKE CC BUILD_FOLDER
"""
import glob
import json
import os
import re
import shutil
import subprocess
import sys
import unittest

CMAKE, CC, BUILD = sys.argv[2:5]
del sys.argv[2:5]
import runs  # noqa: E402  (takes the program's path off the arguments)

ROOT = os.getcwd()
EXAMPLE = os.path.join(ROOT, "docs", "examples", "use_library")


def call(*words, **options):
    result = subprocess.run(words, capture_output=True, text=True, timeout=300, **options)
    if result.returncode != 0:
        raise AssertionError(f"{words}: exit code {result.returncode}\n{result.stdout}"
                             f"{result.stderr}")
    return result.stdout


def only(pattern):
    found = glob.glob(pattern, recursive=True)
    assert len(found) == 1, f"{pattern}: {found}"
    return found[0]


class Packages(unittest.TestCase):
    def test_docs_name_every_package(self):
        with open("dev", encoding="utf-8") as file:
            lists = re.findall(r"packages_(?:build|run|test|docs|package)='([^']*)'", file.read())
        self.assertEqual(len(lists), 5)
        with open("docs/how-to/build.md", encoding="utf-8") as file:
            words = set(re.split(r"[\s`.,]+", file.read()))
        missing = set(" ".join(lists).split()) - words
        self.assertFalse(missing, "packages that ./dev installs and docs/how-to/build.md does not name")

    def test_bill_of_materials(self):
        """Direct dependencies are the packages of the libraries that the linker wrote into the program."""
        bill = json.loads(call(sys.executable, "cmake/bill_of_materials.py", runs.BORESIGHT))
        of = {part["bom-ref"]: part["name"] for part in bill["components"]}
        direct = {of[ref] for ref in bill["dependencies"][0]["dependsOn"]}
        self.assertLessEqual({"libsqlite3-0", "libcfitsio10", "ocl-icd-libopencl1", "libc6"}, direct)
        self.assertLess(direct, set(of.values()))  # libraries of libraries too
        versions = {part["name"]: part["version"] for part in bill["components"]}
        self.assertEqual(versions["libcjson1"], call("dpkg-query", "-W", "-f", "${Version}", "libcjson1"))


class Installed(unittest.TestCase):
    """The stage is made under one name and used under another."""

    @classmethod
    def setUpClass(cls):
        cls.folder = runs.scratch()
        first = os.path.join(cls.folder, "made here")
        call(CMAKE, "--install", BUILD, "--prefix", first)
        cls.stage = os.path.join(cls.folder, "moved")
        os.rename(first, cls.stage)
        cls.libdir = os.path.dirname(only(cls.stage + "/lib*/**/libboresight.so"))
        cls.scenario = cls.stage + "/share/boresight/scenarios/neossat_geo_stare.json"

    def check_output(self, text):
        lines = text.splitlines()
        version = call(self.stage + "/bin/boresight", "--version").split()[1]
        self.assertEqual(lines[0], f"libboresight {version}")
        frames = [line for line in lines if line.startswith("frame ")]
        self.assertEqual(len(frames), 3)
        for line in frames:
            found = re.fullmatch(r"frame \d+: (\d+) x (\d+) px, mean ([0-9.]+) DN, peak (\d+) DN",
                                 line)
            self.assertTrue(found, line)
            # an offset of 500 DN under everything; stars far above the mean
            self.assertGreater(float(found[3]), 500.0)
            self.assertLess(float(found[3]), 2000.0)
            self.assertGreater(int(found[4]), 2 * float(found[3]))
        detections = [int(line.split()[0]) for line in lines if "detections" in line]
        self.assertEqual(len(detections), 3)
        self.assertGreater(min(detections), 0)
        self.assertEqual(sum(line.endswith(" tracks") for line in lines), 3)

    @unittest.skipUnless(shutil.which("pkg-config"), "needs pkg-config")
    def test_pkg_config(self):
        work = os.path.join(self.folder, "by pkg-config")
        os.mkdir(work)
        shutil.copy(os.path.join(EXAMPLE, "first_frames.c"), work)
        environment = {**os.environ, "PKG_CONFIG_PATH": self.libdir + "/pkgconfig"}
        # one word a line, as the path may hold spaces; the language's extensions off and on
        flags = call("pkg-config", "--cflags", "--libs", "boresight", env=environment)
        self.assertEqual(call("pkg-config", "--modversion", "boresight", env=environment).strip(),
                         call(self.stage + "/bin/boresight", "--version").split()[1])
        for dialect in ("-std=c17", "-std=gnu11"):
            call(CC, dialect, "-Wall", "-Wextra", "-Werror", "first_frames.c", *flags.split(), "-o",
                 "first_frames", cwd=work)
        out = call("./first_frames", self.scenario, "3", cwd=work,
                   env={**os.environ, "LD_LIBRARY_PATH": self.libdir})
        self.check_output(out)

    @unittest.skipUnless(shutil.which("pkg-config"), "needs pkg-config")
    def test_plugin(self):
        """The example detector, built against the installed library, measured by the program."""
        work = os.path.join(self.folder, "plugin")
        shutil.copytree(os.path.join(ROOT, "docs", "examples", "plugin_detector"), work)
        flags = call("pkg-config", "--cflags", "--libs", "boresight",
                     env={**os.environ, "PKG_CONFIG_PATH": self.libdir + "/pkgconfig"}).split()
        words = [CC, "-std=c17", "-Wall", "-Wextra", "-Werror", "-O2", "-shared", "-fPIC",
                 "box_detector.c", *flags, "-lm", "-o"]
        call(*words, "box_detector.so", cwd=work)
        # the installed program finds the installed library for the plug-in
        environment = {k: v for k, v in os.environ.items() if k != "LD_LIBRARY_PATH"}
        sensor = "/observers/0/sensors/0"
        imgproc = (sensor + '/modules/imgproc/detector={"plugin": ' +
                   json.dumps(work + "/box_detector.so") + ', "threshold_sigma": 5}')
        out = call(self.stage + "/bin/boresight", "pd",
                   self.stage + "/share/boresight/scenarios/detection.json", "--snr", "4:12:2",
                   "--trials", "400", "--empty-frames", "8", "--json", "pd.json", "--set", imgproc,
                   "--set", sensor + "/camera/width_px=1024", "--set",
                   sensor + "/camera/height_px=1024", cwd=work, env=environment)
        with open(work + "/pd.json", encoding="utf-8") as file:
            measured = json.load(file)
        self.assertIn("loss", out)
        # nine pixels alike have 0.71 of the best SNR at FWHM 2 px in a pixel's middle, 3.0 dB, less
        # what is gained by taking the best of several places; the frames are few
        self.assertGreater(measured["loss_db_pd50"], 0.3)
        self.assertLess(measured["loss_db_pd50"], 4.5)
        self.assertGreater(measured["points"][-1]["pd"], 0.98)
        self.assertIn('"box"', call(self.stage + "/bin/boresight", "schema", cwd=work,
                                    env={**environment, "BORESIGHT_PLUGINS": "./box_detector.so"}))
        # a whole module, by the command line, that is called as one that is there; and none
        with open(os.path.join(ROOT, "docs", "examples", "stare_at.c"), encoding="utf-8") as file:
            text = file.read()
        with open(work + "/box_detector.c", "w", encoding="utf-8") as file:
            file.write(text.replace('"stare_at",', '"standard",'))
        call(*words, "twin.so", cwd=work)
        for name, message in (("twin.so", 'role "control" and type "standard" already'),
                              (self.libdir + "/libboresight.so", "is no plug-in"),
                              ("none.so", "there is no such file"), ("a:b.so", 'without ":"')):
            result = subprocess.run(
                [self.stage + "/bin/boresight", "--plugin", name, "check", self.scenario],
                capture_output=True, text=True, timeout=60, cwd=work, env=environment)
            self.assertIn(message, result.stderr)
            self.assertIn(result.returncode, (1, 2))

    @unittest.skipUnless(shutil.which("pkg-config"), "needs pkg-config")
    def test_every_example_runs(self):
        """A run of the installed program with each example, built by the command in its first
        lines, in an environment that names no folder of libraries."""
        environment = {k: v for k, v in os.environ.items()
                       if k not in ("LD_LIBRARY_PATH", "BORESIGHT_PLUGINS")}
        build = {**environment, "PKG_CONFIG_PATH": self.libdir + "/pkgconfig"}
        modules = runs.SENSOR + "/modules/"
        examples = self.stage + "/share/doc/boresight/docs/examples/"
        cases = [("plugin_detector/box_detector.c", modules + "imgproc/detector=", {}),
                 ("plugin_compensator/leaky.c", modules + "control/compensator=", {}),
                 ("plugin_frame_stage/banding.c", modules + "scenegen/frame_stage=", {}),
                 ("stare_at.c", modules + "control=", {"ra_deg": 252.36, "dec_deg": -8.82})]
        for example, where, keys in cases:
            work = runs.scratch()
            source = shutil.copy(examples + example, work)
            with open(source, encoding="utf-8") as file:
                command = re.search(r"^ \*\s+(cc -shared .*)$", file.read(), re.MULTILINE)[1]
            # the installed tree lies in a folder with a space here, which $(...) splits
            flags = call("pkg-config", "--cflags", "--libs", "boresight", env=build)
            words = re.sub(r"\$\(pkg-config [^)]*\)", "@FLAGS@", command).split()[1:]
            at = words.index("@FLAGS@")
            call(CC, *words[:at], *flags.split(), *words[at + 1:], cwd=work)
            library = only(work + "/*.so")
            call(self.stage + "/bin/boresight", "run", self.scenario, "--out", "run", "--quiet",
                 "--duration", "2", "--threads", "1", "--set", runs.NO_FRAMES, "--set",
                 where + json.dumps({"plugin": library, **keys}), cwd=work, env=environment)
            with open(work + "/run/manifest.json", encoding="utf-8") as file:
                loaded = json.load(file)["plugins"]
            self.assertEqual([p["file"] for p in loaded], [os.path.realpath(library)])

    def test_cmake_package(self):
        work = os.path.join(self.folder, "by cmake")
        shutil.copytree(EXAMPLE, work)
        build = os.path.join(work, "build")
        call(CMAKE, "-S", work, "-B", build, f"-DCMAKE_PREFIX_PATH={self.stage}",
             f"-DCMAKE_C_COMPILER={CC}")
        call(CMAKE, "--build", build)
        self.check_output(call(build + "/first_frames", self.scenario, "3", cwd=work))
        # another minor version may have other interfaces
        with open(work + "/CMakeLists.txt", encoding="utf-8") as file:
            text = file.read()
        with open(work + "/CMakeLists.txt", "w", encoding="utf-8") as file:
            file.write(text.replace("boresight 0.1", "boresight 9.1"))
        result = subprocess.run([CMAKE, "-S", work, "-B", build + "2",
                                 f"-DCMAKE_PREFIX_PATH={self.stage}"], capture_output=True,
                                text=True, timeout=120)
        self.assertNotEqual(result.returncode, 0)
        self.assertRegex(result.stderr, r'compatible with requested\s+version "9.1"')

    def test_headers(self):
        include = self.stage + "/include"
        headers = sorted(os.path.relpath(path, include)
                         for path in glob.glob(include + "/**/*.h", recursive=True))
        self.assertGreater(len(headers), 30)
        self.assertIn("boresight/boresight.h", headers)
        self.assertIn("boresight/messages/detections.h", headers)
        self.assertEqual([h for h in headers if not h.startswith("boresight/")], [])
        source = os.path.join(self.folder, "headers.c")
        with open(source, "w", encoding="ascii") as file:
            file.writelines(f'#include "{header}"\n' for header in headers)
        call(CC, "-std=gnu17", "-Wall", "-Werror", "-fsyntax-only", "-I", include, source)

    def test_nothing_names_the_build(self):
        forbidden = [ROOT.encode(), os.path.abspath(BUILD).encode(),
                     os.path.join(self.folder, "made here").encode()]
        for folder, _, names in os.walk(self.stage):
            for name in names:
                path = os.path.join(folder, name)
                with open(path, "rb") as file:
                    data = file.read()
                self.assertEqual([f for f in forbidden if f in data], [], path)

    def test_program_and_its_files(self):
        program = self.stage + "/bin/boresight"
        work = runs.scratch()
        # the installed scenarios run from anywhere
        call(program, "run", self.scenario, "--out", "run", "--duration", "2", "--quiet",
             "--threads", "1", "--set", runs.NO_FRAMES, cwd=work)
        self.assertTrue(os.path.exists(work + "/run/manifest.json"))
        for name in ("share/boresight/scenarios/boresight.schema.json",
                     "share/man/man1/boresight.1", "share/doc/boresight/LICENSE",
                     "share/applications/boresight.desktop", "share/icons/hicolor/scalable/apps/boresight.svg",
                     "share/doc/boresight/docs/reference/run_folder.md",
                     "share/doc/boresight/docs/examples/use_library/first_frames.c"):
            self.assertTrue(os.path.exists(os.path.join(self.stage, name)), name)
        for file in (program, os.path.join(self.libdir, "libboresight.so")):
            dynamic = call("readelf", "-d", file)
            self.assertNotIn("RPATH", dynamic)
            self.assertNotIn("RUNPATH", dynamic)

    def complete(self, *words):
        """What bash offers for the last of the words, as the installed completion has it."""
        program = self.stage + "/bin/boresight"
        script = '. "$1"; shift; COMP_WORDS=("$@"); COMP_CWORD=$(($# - 1)); _boresight "$1" ' \
                 '"${COMP_WORDS[COMP_CWORD]}" "${COMP_WORDS[COMP_CWORD - 1]}" 2>&1; printf "%s\\n" "${COMPREPLY[@]}"'
        return call("bash", "-c", script, "bash", self.stage + "/share/bash-completion/completions/boresight",
                    program, *words).split()

    def test_completion(self):
        self.assertEqual(self.complete("re"), ["report"])
        self.assertIn("calibrate-obsgen", self.complete("help", ""))
        self.assertEqual(self.complete("run", "--se"), ["--set", "--seed", "--serial"])
        self.assertEqual(self.complete("--no-plugins", "export", "run", "--frames", ""), ["png", "mp4"])
        self.assertEqual(self.complete("run", "scenarios/neossat_geo_t"), ["scenarios/neossat_geo_track.json"])
        self.assertEqual(self.complete("view", "runs/a/b", "scenarios/neossat_geo_t"), ["scenarios/neossat_geo_track.json"])
        for path in ("zsh/site-functions/_boresight", "fish/vendor_completions.d/boresight.fish"):
            self.assertTrue(os.path.exists(f"{self.stage}/share/{path}"), path)

    def test_destdir(self):
        folder = runs.scratch()
        call(CMAKE, "--install", BUILD, "--prefix", "/usr/local",
             env={**os.environ, "DESTDIR": folder})
        self.assertEqual(os.listdir(folder), ["usr"])
        self.assertTrue(os.path.exists(folder + "/usr/local/bin/boresight"))


def tearDownModule():
    runs.clean()


if __name__ == "__main__":
    unittest.main()
