#!/usr/bin/env python3
"""Puts the libraries that a wheel needs into it, with their licences.

    repair.py WHEEL FOLDER SOURCES

WHEEL is what pip built from SOURCES; the finished wheel is written into FOLDER. Needs auditwheel, patchelf and wheel
in PATH. Ends with 1 and a reason if a library has a licence that is not known or is the GPL, or the wheel is too large.
"""
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile
import zipfile

import absent
import licences

LARGEST_MB = 100


def run(*command, **environment):
    subprocess.run([str(word) for word in command], check=True, env={**os.environ, **environment})


def one(folder, pattern):
    """The only path of a pattern."""
    found = list(folder.glob(pattern))
    if len(found) != 1:
        raise SystemExit(f"{folder}: {len(found)} paths {pattern} where one is expected")
    return found[0]


def repair(wheel, folder, sources, work):
    """Makes the finished wheel in `folder`; `work` is empty."""
    plain, substitutes, repaired, unpacked = (work / name for name in ("plain", "absent", "repaired", "unpacked"))
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(plain)
    substitutes.mkdir()
    names = absent.build([one(plain, "boresight/lib/libboresight.so.*"), plain / "boresight/bin/boresight"], substitutes)
    run("auditwheel", "repair", "--wheel-dir", repaired, wheel, LD_LIBRARY_PATH=str(substitutes))
    run(sys.executable, "-m", "wheel", "unpack", "--dest", unpacked, one(repaired, "*.whl"))
    tree = one(unpacked, "*")
    notices = one(tree, "*.dist-info") / "licenses"
    libraries = [path.name for path in (tree / "boresight.libs").iterdir()]
    print(licences.write(notices / "libraries", libraries, names))
    shutil.copy(sources / "sim/catalogue/data/LICENCE.md", notices / "star_catalogue.md")
    folder.mkdir(parents=True, exist_ok=True)
    for old in folder.glob("boresight-*.whl"):
        old.unlink()
    run(sys.executable, "-m", "wheel", "pack", "--dest-dir", folder, tree)
    return one(folder, "boresight-*.whl")


def main():
    wheel, folder, sources = (pathlib.Path(word).resolve() for word in sys.argv[1:])
    with tempfile.TemporaryDirectory() as work:
        finished = repair(wheel, folder, sources, pathlib.Path(work))
    size_mb = finished.stat().st_size / 1e6
    if size_mb > LARGEST_MB:
        raise SystemExit(f"{finished} has {size_mb:.0f} MB (at most {LARGEST_MB})")
    print(f"{finished}: {size_mb:.1f} MB")


if __name__ == "__main__":
    main()
