#!/usr/bin/env python3
"""The four Astra satellites at 19.2 degrees east, cue wrong by 0.02 and 0.3 degrees: the target at the end
is the satellite of the cue, or the run says that it may not be.

Usage, from the repository root: /usr/bin/python3 tests/e2e/astra_cluster.py BORESIGHT [SEEDS] [KEY=VALUE ...]
SEEDS: 20; two or fewer run for 60 s, more for 180 s. Prints a line for each cue error; fails if a target is silently
wrong, or if fewer than 9 of 10 are right.
"""
import json
import math
import os
import re
import sys

import runs

NAMES = {"ASTRA 1KR": 29055, "ASTRA 1L": 31306, "ASTRA 1M": 33436, "ASTRA 1N": 37775}
SENSOR = "/observers/0/sensors/0/"
RIGHT_PX = 5.0


def scenario(seed, offset_deg, more, duration_s):
    """The main scenario with the cluster in place of its target."""
    names = list(NAMES)
    base = os.path.abspath("scenarios")
    objects = [{"name": name, "orbit": {"source": "sgp4", "elements_file": f"{base}/objects_2022-06.tle", "norad": norad},
                "area_m2": 8 + 3 * k, "albedo": 0.25} for k, (name, norad) in enumerate(NAMES.items())]
    values = {SENSOR + "cue/object": names[seed % 4], SENSOR + "cue/offset_deg": offset_deg,
              SENSOR + "cue/offset_angle_deg": (137.5 * seed) % 360, SENSOR + "cue/sigma_deg": offset_deg,
              SENSOR + "observation_source": "generator", **more}
    return {"boresight": 1, "extends": f"{base}/neossat_geo_track.json", "seed": hex(1000 + seed), "duration_s": duration_s,
            "world": {"objects": objects}, "set": values}, seed % 4


def judge(out, wanted):
    """(what the run is: none, right, wrong; whether it says that it is ambiguous; its probability)."""
    db = runs.database(out)
    (last,) = db.execute("SELECT max(exposure_id) FROM track_frames").fetchone()
    row = db.execute("SELECT track_id, ra_deg, dec_deg FROM tracks WHERE exposure_id = ? AND target_of_interest = 1",
                     (last,)).fetchone()
    text = [e for e in db.execute("SELECT kind, text FROM events WHERE kind IN ('target_ambiguous', 'target_resolved',"
                                  " 'target_selected', 'target_lost') ORDER BY time_s, rowid")]
    ambiguous, stated = False, None
    for kind, words in text:
        if kind == "target_ambiguous":
            ambiguous = True
        elif kind in ("target_resolved", "target_selected", "target_lost"):
            ambiguous = False
        found = re.search(r"probability (\S+)", words)
        stated = float(found.group(1).rstrip(",")) if found else stated
    if row is None:
        return "none", ambiguous, stated
    _, ra, dec = row
    scale = 3.0 / 3600.0
    off = {i: math.hypot((ra - r) * math.cos(math.radians(d)), dec - d) / scale for i, r, d in db.execute(
        "SELECT id, ra_deg, dec_deg FROM truth WHERE exposure_id = ? AND kind = 'object'", (last,))}
    nearest = min(off, key=off.get) if off else None
    if nearest is None or off[nearest] > RIGHT_PX:
        return "none", ambiguous, stated
    return "right" if nearest == wanted else "wrong", ambiguous, stated


def main():
    seeds = int(sys.argv[1]) if len(sys.argv) > 1 else 20
    more = {key: json.loads(value) for key, value in (word.split("=", 1) for word in sys.argv[2:])}
    silent = right = 0
    for offset in (0.02, 0.3):
        count = {}
        for seed in range(seeds):
            made, wanted = scenario(seed, offset, more, 180 if seeds > 2 else 60)
            folder = runs.scratch()
            path, out = os.path.join(folder, "astra.json"), os.path.join(folder, "run")
            with open(path, "w", encoding="utf-8") as file:
                json.dump(made, file)
            runs.run(path, out)
            what, ambiguous, stated = judge(out, wanted)
            key = what + (", reported" if ambiguous else "")
            count[key] = count.get(key, 0) + 1
            silent += what == "wrong" and not ambiguous
            right += what == "right"
            print(offset, seed, key, stated, file=sys.stderr)
            runs.clean()
        print(f"{offset} deg off:", ", ".join(f"{v} {k}" for k, v in sorted(count.items())))
    print(f"silently wrong: {silent}")
    return silent > 0 or right < 0.9 * 2 * seeds


if __name__ == "__main__":
    sys.exit(main())
