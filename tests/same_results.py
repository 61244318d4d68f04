#!/usr/bin/env python3
"""Whether two builds of the program give the same bytes: for changes that move or rename code.

    /usr/bin/python3 tests/same_results.py OLD/boresight NEW/boresight

Runs, from the repository root, every shipped scenario for a short time (or its whole study, curve of detection and
loop analysis in short) with both programs, and compares tables, frames, pictures and printed JSON. What differs by a
program's version, wall time or processor time is left out. Keys of printed JSON are compared under their present
names (those that NEW's schema marks as deprecated are renamed). Where OLD does not know the present names of the shipped
scenarios, run this from a checkout of OLD: NEW reads its scenarios with warnings. Prints a line for each and ends with 1
if any differs.
"""
import glob
import hashlib
import json
import os
import re
import shutil
import sqlite3
import subprocess
import sys
import tempfile

from astropy.io import fits

DURATIONS_S = {"constellation_images": 12, "constellation_quick": 600, "day_constellation": 600, "day_eclipse": 1200,
               "day_generator": 1200, "day_images": 60, "day_plant": 300, "frame_by_frame": 7, "galactic_core": 6}
PEERS = {"link_realtime"}  # needs another program
CLOCK = re.compile(r"(seconds|wall|cpu|rate_hz_real|real_time|speed|rss|memory|processor|started|finished|late|version|"
                   r"program|revision|host|created|build|device|path|took|process_ms)", re.I)


PRESENT = {}  # present names of keys by former ones


def former_names(node, out):
    """Fills `out` from a JSON schema."""
    if isinstance(node, list):
        for item in node:
            former_names(item, out)
    elif isinstance(node, dict):
        for key, child in node.items():
            if isinstance(child, dict) and child.get("deprecated"):
                out[key] = child["description"].removeprefix("Former name of ").rstrip(".")
            former_names(child, out)


def without_clock(value):
    """A JSON value without what depends on when, where and how fast it was made, under present names."""
    if isinstance(value, dict):
        return {PRESENT.get(k, k): without_clock(v) for k, v in value.items()
                if not CLOCK.search(PRESENT.get(k, k)) or k.endswith("_px")}
    return [without_clock(v) for v in value] if isinstance(value, list) else value


def digest(lines):
    total = hashlib.sha256()
    for line in lines:
        total.update(line if isinstance(line, bytes) else repr(line).encode())
    return total.hexdigest()[:16]


def tables(path):
    """Each table's digest."""
    db = sqlite3.connect(path)
    found = {}
    for (name,) in db.execute("SELECT name FROM sqlite_master WHERE type = 'table' ORDER BY name").fetchall():
        columns = [row[1] for row in db.execute(f'PRAGMA table_info("{name}")') if not CLOCK.search(row[1])
                   or row[1] in ("seconds", "time_s")]
        chosen = ", ".join(f'"{c}"' for c in columns) or "1"
        found[name] = digest([columns] + db.execute(f'SELECT {chosen} FROM "{name}" ORDER BY rowid').fetchall())
    db.close()
    return found


def frames(path):
    total = []
    with fits.open(path) as hdus:
        for hdu in hdus:
            total += [card.image for card in hdu.header.cards if card.keyword not in ("ORIGIN", "CREATOR", "DATE", "HISTORY")]
            if hdu.data is not None:
                total.append(hdu.data.tobytes())
    return digest(total)


def folder(out):
    """What is in a folder of results, file by file."""
    found = {}
    for path in sorted(glob.glob(out + "/**/*", recursive=True)):
        name = os.path.relpath(path, out)
        if name.endswith((".sqlite", ".db")):
            found.update({f"{name}:{k}": v for k, v in tables(path).items()})
        elif name.endswith((".fits", ".fz")):
            found[name] = frames(path)
        elif name.endswith((".png", ".csv", ".tle")) and "speed" not in name:
            with open(path, "rb") as file:
                found[name] = digest([file.read()])
        elif name.endswith(".json"):
            with open(path, encoding="utf-8") as file:
                found[name] = digest([json.dumps(without_clock(json.load(file)), sort_keys=True)])
    return found


def jobs():
    """Name and arguments; {out} is a folder of the job's own."""
    for path in sorted(glob.glob("scenarios/*.json")):
        name = os.path.splitext(os.path.basename(path))[0]
        if name.endswith("schema") or name in PEERS:
            continue
        with open(path, encoding="utf-8") as file:
            if "observers" not in json.load(file) and name not in DURATIONS_S and "extends" not in open(path).read():
                continue
        yield name, ["run", path, "--quiet", "--out", "{out}/run", "--threads", "1", "--duration",
                     str(DURATIONS_S.get(name, 30)), "--set", "/world/star_catalogue=embedded"]
    track = "scenarios/neossat_geo_track.json"
    yield "loop", ["loop", track, "--json", "{out}/loop.json"]
    yield "loop of a full mount", ["loop", "scenarios/full_plant.json", "--json", "{out}/loop.json"]
    yield "pd", ["pd", "scenarios/neossat_geo_stare.json", "--snr", "4:8:2", "--trials", "100", "--empty-frames", "20",
                 "--json", "{out}/pd.json"]
    yield "study", ["study", "{study}", "--out", "{out}/study", "--workers", "1"]


def study(place):
    """A small study of two settings and two replicates."""
    path = os.path.join(place, "study.json")
    with open(path, "w", encoding="utf-8") as file:
        json.dump({"boresight_study": 1, "name": "same", "kind": "loop", "seed": "0x7", "replicates": 2,
                   "scenarios": [{"file": os.path.abspath("scenarios/neossat_geo_track.json")}],
                   "set": {"/duration_s": 20, "/world/star_catalogue": "embedded"},
                   "sweeps": [{"axes": [{"path": "/observers/0/sensors/0/camera/aperture_m", "values": [0.1, 0.15]}]}]},
                  file)
    return path


def run(program, words, out, place):
    words = [program] + [w.replace("{out}", out).replace("{study}", place + "/study.json") for w in words]
    os.makedirs(out)
    result = subprocess.run(words, capture_output=True, text=True, timeout=1800)
    if result.returncode not in (0, 3):
        return {"exit code": f"{result.returncode}: {result.stderr[-200:]}"}
    return folder(out)


def main():
    old, new = (os.path.abspath(p) for p in sys.argv[1:3])
    place = tempfile.mkdtemp(prefix="boresight-same-")
    study(place)
    for words in (["schema"], ["study", "--schema"]):
        shown = subprocess.run([new, *words], capture_output=True, text=True, check=True).stdout
        former_names(json.loads(shown), PRESENT)
    wrong = 0
    try:
        for name, words in jobs():
            seen = []
            for program in (old, new):
                out = os.path.join(place, "out")
                seen.append(run(program, words, out, place))
                shutil.rmtree(out)
            differ = sorted(k for k in seen[0].keys() | seen[1].keys() if seen[0].get(k) != seen[1].get(k))
            failed = seen[0].get("exit code") or seen[1].get("exit code")
            wrong += bool(differ or failed)
            print(f"{name}: " + (f"failed: {failed}" if failed else f"{len(differ)} of {len(seen[0])} differ: {differ[:6]}" if
                                 differ else f"{len(seen[0])} equal"), flush=True)
    finally:
        shutil.rmtree(place, ignore_errors=True)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
