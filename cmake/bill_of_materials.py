#!/usr/bin/env python3
"""Software bill of materials of a built program, as CycloneDX 1.5 JSON: the Debian packages whose
libraries it loads, with versions, and which of them it names itself.

    python3 cmake/bill_of_materials.py build/boresight > boresight.cdx.json

Sources have no third-party code, and kernels are built at run time by the OpenCL driver. The same
program on the same system gives the same bytes: no serial number, and the time is that of
SOURCE_DATE_EPOCH.
"""
import datetime
import json
import os
import re
import subprocess
import sys


def run(*words):
    return subprocess.run(words, capture_output=True, text=True, check=True,
                          env={**os.environ, "LC_ALL": "C"}).stdout


def loaded(program):
    """Paths of the libraries that the dynamic linker loads, by the names they are asked for."""
    found = dict(re.findall(r"^\s*(\S+) => (/\S+) \(", run("ldd", program), re.MULTILINE))
    return {name: os.path.realpath(path) for name, path in found.items()}


def named(program):
    return set(re.findall(r"\(NEEDED\)\s+Shared library: \[(.+)\]", run("readelf", "-d", program)))


def packages_of(paths):
    """Debian packages of files, which may be listed without the /usr that their folder is a link to."""
    names = {name: path for path in paths for name in (path, path.removeprefix("/usr"))}
    said = subprocess.run(["dpkg-query", "-S", *names], capture_output=True, text=True, check=False).stdout
    found = {names[path]: owners.split(",")[0] for owners, path in
             re.findall(r"^(\S.*): (/\S+)$", said, re.MULTILINE) if path in names}
    for path in paths:
        if path not in found:
            sys.exit(f"{path}: belongs to no Debian package; this program is described on Debian only")
    return found


def components_of(packages):
    said = run("dpkg-query", "-W", "-f", "${binary:Package}\t${Package}\t${Version}\t${Architecture}\t"
               "${source:Package} ${source:Version}\n", *packages)
    out = {}
    for line in said.splitlines():
        key, name, version, arch, source = line.split("\t")
        purl = f"pkg:deb/debian/{name}@{version.replace('+', '%2B').replace(':', '%3A')}?arch={arch}"
        out[key.split(":")[0]] = {"type": "library", "bom-ref": purl, "name": name, "version": version, "purl": purl,
                                  "properties": [{"name": "debian:source", "value": source}]}
    return out


def describe(program):
    libraries = loaded(program)
    owner = packages_of(libraries.values())
    packages = {name: owner[path].split(":")[0] for name, path in libraries.items()}
    components = components_of(sorted(set(packages.values())))
    version = run(program, "--version").split()[1]
    me = f"boresight@{version}"
    seconds = int(os.environ.get("SOURCE_DATE_EPOCH") or os.path.getmtime(program))
    direct = sorted({components[packages[name]]["bom-ref"] for name in named(program) if name in packages})
    return {"bomFormat": "CycloneDX", "specVersion": "1.5", "version": 1,
            "metadata": {
                "timestamp": datetime.datetime.fromtimestamp(seconds, datetime.timezone.utc).strftime("%Y-%m-%dT%H:%M:%SZ"),
                "component": {"type": "application", "bom-ref": me, "name": "boresight", "version": version}},
            "components": list(components.values()),
            "dependencies": [{"ref": me, "dependsOn": direct}]}


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    print(json.dumps(describe(sys.argv[1]), indent=2))
