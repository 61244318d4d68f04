"""Substitutes for libraries that Debian's builds of our libraries ask for and Boresight never calls.

Debian's cfitsio can open files on the web, its ZeroMQ knows Kerberos and multicast, its OpenCV
knows OpenGL windows and LAPACK, its TIFF library ten more compressions. These features pull some forty libraries into a wheel, of other
licences. The wheel has small libraries of the same names instead. Their functions fail in the way
that the caller expects, or end the program with a message where nothing in Boresight can reach
them.
"""
import re
import subprocess

# What a function of a library returns; other functions of it end the program.
ABSENT = {
    "libGLX.so.0": {"glXGetCurrentContext": 0, "glXGetCurrentDisplay": 0,
                    "glXGetProcAddressARB": 0},
    # cfitsio: curl_easy_perform returns CURLE_FAILED_INIT
    "libcurl-gnutls.so.4": {"curl_global_init": 0, "curl_global_cleanup": 0, "curl_easy_init": 0,
                            "curl_easy_setopt": 0, "curl_easy_perform": 2,
                            "curl_easy_cleanup": 0},
    # ZeroMQ starts and ends PGM with each context; pgm:// is no endpoint of the packet link
    "libpgm-5.3.so.0": {"pgm_init": 1, "pgm_shutdown": 1},
    "libnorm.so.1": {},
    "libgssapi_krb5.so.2": {},
    # libtiff: sim/io/image_tiff.c replaces the codecs that use these
    "libjbig.so.0": {},
    "libjpeg.so.62": {},
    "libwebp.so.7": {},
    "libLerc.so.4": {},
    "liblzma.so.5": {},
    "liblapack.so.3": {},
    "libblas.so.3": {},
}


def run(*command):
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout


def needed(path):
    """Names of the libraries that a program or library asks the loader for."""
    return re.findall(r"^\s*NEEDED\s+(\S+)", run("objdump", "-p", str(path)), re.M)


def system_libraries():
    """Paths of this machine's libraries by name."""
    found = {}
    for name, path in re.findall(r"^\s*(\S+) \(.*x86-64.*\) => (\S+)$", run("/sbin/ldconfig", "-p"), re.M):
        found.setdefault(name, path)
    return found


def undefined_symbols(path):
    """(name, version or "") of the symbols that a file takes from others."""
    lines = run("nm", "-D", "--undefined-only", str(path)).splitlines()
    return {tuple((line.split()[-1] + "@").split("@")[:2]) for line in lines}


def defined_symbols(path):
    """Types of the symbols that a library defines, by (name, version or "")."""
    found = {}
    for line in run("nm", "-D", "--defined-only", str(path)).splitlines():
        kind, symbol = line.split()[-2:]
        name, version = (symbol.replace("@@", "@") + "@").split("@")[:2]
        found[name, version] = found[name, ""] = kind
    return found


def wanted(programs):
    """{absent library: {(name, version): type}}: what the libraries of `programs` take from it."""
    paths = system_libraries()
    queue, seen, users = [str(p) for p in programs], set(), {}
    while queue:
        path = queue.pop()
        for name in needed(path):
            if name in ABSENT:
                users.setdefault(name, set()).add(path)
            elif name in paths and paths[name] not in seen:
                seen.add(paths[name])
                queue.append(paths[name])
    result = {}
    for library, files in users.items():
        if library not in paths:
            raise SystemExit(f"{library} is not installed: {', '.join(sorted(files))} need it")
        own = defined_symbols(paths[library])
        symbols = set().union(*(undefined_symbols(path) for path in files))
        result[library] = {symbol: own[symbol] for symbol in sorted(symbols) if symbol in own}
    return result


def source(library, symbols):
    """C source of a substitute, and its version script."""
    lines = ["#include <stdio.h>", "#include <stdlib.h>"]
    versions = {}
    for (name, version), kind in symbols.items():
        versions.setdefault(version, []).append(name)
        if kind.upper() in "BDRV":
            lines.append(f"void *{name};")
        elif name in ABSENT[library]:
            lines.append(f"long {name}(void);\nlong {name}(void) {{ return {ABSENT[library][name]}; }}")
        else:
            lines.append(f"void {name}(void);\nvoid {name}(void) {{\n"
                         f'    fputs("boresight: {name} of {library} is not in this wheel\\n", stderr);\n'
                         "    abort();\n}")
    script = [f"{version} {{ global: {'; '.join(names)}; }};"
              for version, names in versions.items() if version]
    return "\n".join(lines) + "\n", "\n".join(script) + "\n"


def build(programs, folder):
    """Builds the substitutes that `programs` need into a folder; returns their names."""
    libraries = wanted(programs)
    for library, symbols in libraries.items():
        code, script = source(library, symbols)
        (folder / f"{library}.c").write_text(code)
        (folder / f"{library}.map").write_text(script)
        options = [f"-Wl,--version-script={folder / library}.map"] if script.strip() else []
        run("cc", "-shared", "-fPIC", f"-Wl,-soname,{library}", *options, "-x", "c",
            str(folder / f"{library}.c"), "-o", str(folder / library))
    return sorted(libraries)
