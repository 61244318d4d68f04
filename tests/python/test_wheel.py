"""What ./dev wheel puts into a wheel: libraries in place of those that nothing needs, and the table of licences; and
the wheel in dist, if there is one."""
import os
import pathlib
import subprocess
import sys
import tempfile
import unittest
import zipfile

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "python" / "wheel"))

import absent  # noqa: E402
import licences  # noqa: E402

PROGRAM = pathlib.Path(sys.argv[1]).resolve()
# loads the libraries with their needs, and uses what starts and ends them
USER = """
import ctypes
zmq = ctypes.CDLL("libzmq.so.5")
zmq.zmq_ctx_new.restype = ctypes.c_void_p
context = zmq.zmq_ctx_new()
assert context
assert zmq.zmq_ctx_term(ctypes.c_void_p(context)) == 0
cfitsio = ctypes.CDLL("libcfitsio.so.10")
status, file = ctypes.c_int(0), ctypes.c_void_p()
cfitsio.ffopen(ctypes.byref(file), b"https://127.0.0.1:9/none.fits", 0, ctypes.byref(status))
assert status.value != 0, "a file on the web was opened"
print(*sorted({line.split()[-1] for line in open("/proc/self/maps") if ".so" in line}))
"""


class Absent(unittest.TestCase):
    def test_substitutes_load_and_bring_nothing_along(self):
        with tempfile.TemporaryDirectory() as name:
            folder = pathlib.Path(name)
            built = absent.build([PROGRAM], folder)
            self.assertIn("libcurl-gnutls.so.4", built)
            self.assertIn("libgssapi_krb5.so.2", built)
            said = subprocess.run([sys.executable, "-c", USER], capture_output=True, text=True,
                                  env={**os.environ, "LD_LIBRARY_PATH": name})
        self.assertEqual(said.returncode, 0, said.stderr)
        self.assertIn(f"{name}/libcurl-gnutls.so.4", said.stdout)
        for library in ("libgnutls", "libkrb5.so", "libssh2", "libnettle", "libldap", "libcrypto"):
            self.assertNotIn(library, said.stdout)

    def test_what_nothing_calls_ends_the_program(self):
        code, script = absent.source("libnorm.so.1", {("NormCreateInstance", ""): "T"})
        self.assertEqual(script.strip(), "")
        with tempfile.TemporaryDirectory() as name:
            library = pathlib.Path(name) / "a.so"
            library.with_suffix(".c").write_text(code)
            subprocess.run(["cc", "-shared", "-fPIC", str(library.with_suffix(".c")), "-o", str(library)], check=True)
            said = subprocess.run([sys.executable, "-c", f"import ctypes; ctypes.CDLL({str(library)!r})"
                                   ".NormCreateInstance()"], capture_output=True, text=True)
        self.assertLess(said.returncode, 0)
        self.assertIn("NormCreateInstance of libnorm.so.1 is not in this wheel", said.stderr)


class Licences(unittest.TestCase):
    def test_the_gpl_and_unknown_licences_are_refused(self):
        for expression, gpl in (("GPL-2.0-or-later", True), ("MIT AND GPL-3.0-only", True), ("MIT", False),
                                ("LGPL-3.0-or-later WITH LGPL-3.0-linking-exception", False)):
            self.assertEqual(licences.is_gpl(expression), gpl, expression)
        known = dict(licences.LICENCES)
        try:
            licences.LICENCES["libpng16-16"] = "GPL-2.0-or-later"
            with self.assertRaisesRegex(SystemExit, "GPL"):
                licences.table(["libpng16-0123abcd.so.16"], [])
            del licences.LICENCES["libpng16-16"]
            with self.assertRaisesRegex(SystemExit, "unknown"):
                licences.table(["libpng16-0123abcd.so.16"], [])
        finally:
            licences.LICENCES.clear()
            licences.LICENCES.update(known)

    def test_the_table_names_each_library(self):
        text, packages = licences.table(["libzmq-0123abcd.so.5.2.4", "libpng16-0123abcd.so.16",
                                         "libcurl-gnutls-0123abcd.so.4"], ["libcurl-gnutls.so.4"])
        self.assertEqual(packages, ["libpng16-16", "libzmq5"])
        self.assertRegex(text, r"`libpng16-0123abcd.so.16` \| libpng16-16 \| [0-9.:+~a-z-]+ \| libpng-2.0")
        self.assertRegex(text, r"`libcurl-gnutls-0123abcd.so.4` \| Boresight, .* MIT")


LOOP = """
import pathlib, sys
sys.path.insert(0, {package!r})
import boresight as bst
from boresight import _native
try:
    with bst.Simulation(bst.Scenario.load("neossat_geo_track.json")) as sim:
        sim.step("frame")
except bst.DeviceError as error:
    print(error)
"""


class Devices(unittest.TestCase):
    """Rendering where the system has no OpenCL driver."""

    def run_python(self, text, **environment):
        said = subprocess.run([sys.executable, "-c", text], capture_output=True, text=True,
                              env={**os.environ, **environment})
        self.assertEqual(said.returncode, 0, said.stderr)
        return said.stdout

    def test_rendering_says_what_to_install(self):
        package = str(PROGRAM.parent / "python")
        said = self.run_python(LOOP.format(package=package), OCL_ICD_VENDORS="/nothing/here")
        self.assertIn("pip install boresight[pocl]", said)
        self.assertIn("apt install pocl-opencl-icd", said)

    def test_pocl_of_the_extra_is_found_where_the_system_has_no_driver(self):
        """Packages with the files of PyPI's pocl-binary-distribution and ziglang, without their content."""
        with tempfile.TemporaryDirectory() as name:
            folder = pathlib.Path(name)
            library, zig = folder / "pyopencl/.libs/libpocl-0123abcd.so", folder / "zig/ziglang/zig"
            for path in (library, folder / "pocl_binary_distribution/__init__.py", zig,
                         zig.with_name("__init__.py"), folder / "drivers/gpu.icd"):
                path.parent.mkdir(parents=True, exist_ok=True)
                path.write_text("")
            search = f"""
import os, pathlib, sys
sys.path[:0] = [{str(PROGRAM.parent / "python")!r}, {name!r}]
from boresight import _pocl
system = os.environ["PATH"]
def found(vendors, path):
    os.environ.pop("OCL_ICD_VENDORS", None)
    os.environ["PATH"] = path
    _pocl.VENDORS = pathlib.Path({name!r}) / vendors
    _pocl.offer()
    print(os.environ.get("OCL_ICD_VENDORS"), os.environ["PATH"] == path, os.environ.get("BORESIGHT_ZIG"))
found("drivers", system)
found("none", system)
found("none", "/nothing/here")
sys.path.append({name!r} + "/zig")
found("none", "/nothing/here")
print(os.environ["PATH"])
"""
            said = self.run_python(search).splitlines()
        linker = PROGRAM.parent / "python" / "boresight" / "linker"
        self.assertEqual(said, ["None True None", f"{library} True None", "None True None",
                                f"{library} False {zig}", f"{linker}:/nothing/here"])

    def test_the_linker_leaves_the_libraries_out(self):
        with tempfile.TemporaryDirectory() as name:
            zig = pathlib.Path(name) / "zig"
            zig.write_text('#!/bin/sh\nprintf "%s|" "$@"\n')
            zig.chmod(0o755)
            said = subprocess.run([str(PROGRAM.parent / "python/boresight/linker/ld"), "-shared", "-o", "a b.so",
                                   "-L/lib", "a.o", "-lgcc", "--as-needed", "-lc"], check=True, capture_output=True,
                                  text=True, env={**os.environ, "BORESIGHT_ZIG": str(zig)}).stdout
        self.assertEqual(said, "ld.lld|-shared|-o|a b.so|-L/lib|a.o|--as-needed|")


WHEELS = sorted((ROOT / "dist").glob("boresight-*.whl"))


@unittest.skipUnless(WHEELS, "no wheel in dist")
class Wheel(unittest.TestCase):
    def test_every_library_inside_is_in_the_table(self):
        with zipfile.ZipFile(WHEELS[-1]) as wheel:
            names = wheel.namelist()
            table = wheel.read(next(n for n in names if n.endswith("/licenses/libraries/LIBRARIES.md"))).decode()
        inside = [n.split("/")[-1] for n in names if n.startswith("boresight.libs/")]
        self.assertGreater(len(inside), 10)
        for name in inside:
            self.assertIn(f"| `{name}` |", table)
            self.assertNotIn("fftw", name)
        self.assertFalse([line for line in table.splitlines() if line.startswith("|") and licences.is_gpl(line)])
        self.assertLessEqual(WHEELS[-1].stat().st_size, 100e6)
        self.assertIn("-py3-none-manylinux_2_", WHEELS[-1].name)


if __name__ == "__main__":
    unittest.main(argv=[sys.argv[0], *sys.argv[2:]], verbosity=1)
