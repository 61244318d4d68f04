"""Libraries inside a wheel, with their licences: a table for the wheel, and a check of it."""
import pathlib
import re
import subprocess

# SPDX expressions by Debian package, of the parts that are compiled into the library. Debian's
# copyright file, which the wheel contains, is the source. A package that is not listed is an error.
LICENCES = {
    "libbsd0": "BSD-3-Clause AND BSD-2-Clause AND ISC",
    "libbz2-1.0": "bzip2-1.0.6",
    "libcfitsio10": "CFITSIO",
    "libcfitsio10t64": "CFITSIO",
    "libcjson1": "MIT",
    "liberfa1": "BSD-3-Clause",
    "libexpat1": "MIT",
    "libgeographiclib23": "MIT",
    "libgeographiclib26": "MIT",
    "libdeflate0": "MIT",
    "libmd0": "BSD-3-Clause AND BSD-2-Clause AND ISC AND Beerware",
    "libopencv-core406": "Apache-2.0 AND BSD-3-Clause",
    "libopencv-core410": "Apache-2.0 AND BSD-3-Clause",
    "libopencv-imgproc406": "Apache-2.0 AND BSD-3-Clause",
    "libopencv-imgproc410": "Apache-2.0 AND BSD-3-Clause",
    "libpng16-16": "libpng-2.0",
    "libpng16-16t64": "libpng-2.0",
    "libsodium23": "ISC",
    "libsqlite3-0": "blessing",
    "libtbb12": "Apache-2.0",
    "libtiff6": "libtiff",
    "libzstd1": "BSD-3-Clause",
    "libtbbmalloc2": "Apache-2.0",
    # linked as a shared library of its own, which a user can replace
    "libzmq5": "LGPL-3.0-or-later WITH LGPL-3.0-linking-exception",
    "ocl-icd-libopencl1": "BSD-2-Clause",
    "zlib1g": "Zlib",
}

# Licence texts that notices only refer to, in /usr/share/common-licenses
TEXTS = {"Apache-2.0": ["Apache-2.0"], "LGPL-3.0": ["LGPL-3", "GPL-3"]}
COMMON = pathlib.Path("/usr/share/common-licenses")
DOCUMENTATION = pathlib.Path("/usr/share/doc")


def original_name(file_name):
    """The name of a library before auditwheel put a hash of its content into it."""
    return re.sub(r"-[0-9a-f]{8}(?=\.)", "", file_name)


def package_of(library):
    """Debian package and version of a library."""
    found = subprocess.run(["dpkg", "-S", f"*/{library}"], capture_output=True, text=True).stdout
    packages = sorted({line.split(":")[0] for line in found.splitlines()
                       if line.endswith(f"-linux-gnu/{library}")})
    if len(packages) != 1:
        raise SystemExit(f"{library}: of which Debian package? found: {', '.join(packages) or 'none'}")
    version = subprocess.run(["dpkg-query", "-W", "-f", "${Version}", packages[0]], check=True,
                             capture_output=True, text=True).stdout
    return packages[0], version


def is_gpl(expression):
    """Whether an SPDX expression demands the GPL (the LGPL is another licence)."""
    return re.search(r"(?<![A-Za-z])GPL", expression) is not None


def table(names, substitutes):
    """Markdown table of the libraries, and the Debian packages that they come from."""
    rows, packages = [], []
    for name in sorted(names, key=str.lower):
        library = original_name(name)
        if library in substitutes:
            rows.append(f"| `{name}` | Boresight, in place of the library of this name | | MIT |")
            continue
        package, version = package_of(library)
        if package not in LICENCES:
            raise SystemExit(f"{library}: licence of {package} unknown; read "
                             f"{DOCUMENTATION / package / 'copyright'} and add it to {__file__}")
        if is_gpl(LICENCES[package]):
            raise SystemExit(f"{library} ({package}) has the licence {LICENCES[package]}: "
                             "nothing under the GPL may be in a wheel")
        packages.append(package)
        rows.append(f"| `{name}` | {package} | {version} | {LICENCES[package]} |")
    text = """# Libraries in this wheel

The folder `boresight.libs` contains these shared libraries of Debian; only their names and search
paths are changed. Their complete copyright notices are beside this file, by the name of their
package. Notices of the GPL among them are about files that are not compiled into the library
(Debian's packaging, examples).

libzmq is under the LGPL with an exception for linking: it may be replaced by another build of the
same interface. Debian publishes its sources. The GPL is beside this file because the LGPL refers to
it.

| file | Debian package | version | licence (SPDX) |
|---|---|---|---|
"""
    return text + "\n".join(rows) + "\n", sorted(set(packages))


def write(folder, libraries, substitutes):
    """Writes the table and the notices of a list of libraries into a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    text, packages = table(libraries, substitutes)
    (folder / "LIBRARIES.md").write_text(text)
    for package in packages:
        notice = (DOCUMENTATION / package / "copyright").read_bytes()
        (folder / f"{package}.txt").write_bytes(notice)
        for licence, files in TEXTS.items():
            for name in files if licence in LICENCES[package] else []:
                (folder / f"{name}.txt").write_bytes((COMMON / name).read_bytes())
    return text
