#!/usr/bin/env python3
"""`boresight new`: scenarios for random pairs of the shipped element sets, whose loop holds.

Usage, from the repository root: /usr/bin/python3 tests/e2e/test_new.py BORESIGHT [PAIRS]
With PAIRS so many pairs with the runs as they are written, else a few short ones.
"""
import json
import os
import random
import subprocess
import sys
import unittest
from concurrent.futures import ThreadPoolExecutor

PAIRS = int(sys.argv.pop(2)) if len(sys.argv) > 2 and sys.argv[2].isdigit() else 0

import runs  # noqa: E402

SETS = ["scenarios/catalogue_2022-06.tle", "scenarios/objects_2022-06.tle"]
SEED = 20220616
STARS = "--stars" in sys.argv and not sys.argv.remove("--stars")
# what `new` says of pairs of which one never sees the other for a whole run
UNSEEN = ("never sees", "too faint", "days apart")


def numbers():
    found = set()
    for path in SETS:
        with open(path, encoding="ascii") as file:
            found |= {line[2:7] for line in file if line.startswith("2 ")}
    return sorted(found)


def call(*words):
    return subprocess.run([runs.BORESIGHT, *words], capture_output=True, text=True, check=False)


def follow(folder, index, pair, *options):
    """What becomes of a pair: (kind, words), kind "unseen", "held" or "failed"."""
    path = os.path.join(folder, f"{index}.json")
    made = call("new", path, "--observer-tle", pair[0], "--target-tle", pair[1], *options)
    if made.returncode != 0:
        unseen = made.returncode == 1 and any(word in made.stderr for word in UNSEEN)
        return ("unseen" if unseen else "failed"), made.stderr.strip()
    said = call("check", "--quiet", path)
    if said.returncode != 0 or said.stderr:
        return "failed", "check: " + said.stderr.strip()
    summary = runs.run(path, os.path.join(folder, str(index)), runs.NO_FRAMES,
                       *(["/world/star_catalogue=default"] if STARS else []))["summary"]
    figures = summary["sensors"][0] if "sensors" in summary else summary
    text = " ".join(made.stdout.split("\n")[i].strip() for i in (1, 2))
    text += f"; RMS {figures['pointing_rms_px']} px, ends in {figures['final_mode']}"
    held = figures["final_mode"] == "track" and (figures["pointing_rms_px"] or 1e9) < 3.0
    return ("held" if held else "failed"), text


def sample(count, *options):
    """The first `count` random pairs that see each other, and the others met on the way."""
    draw, folder, pool = random.Random(SEED), runs.scratch(), numbers()
    results = []
    with ThreadPoolExecutor(2) as workers:
        while sum(kind != "unseen" for _, (kind, _) in results) < count:
            missing = count - sum(kind != "unseen" for _, (kind, _) in results)
            pairs = [draw.sample(pool, 2) for _ in range(missing)]
            jobs = [workers.submit(follow, folder, len(results) + i, pair, *options)
                    for i, pair in enumerate(pairs)]
            results += [(pair, job.result()) for pair, job in zip(pairs, jobs)]
    return results


class New(unittest.TestCase):
    def test_random_pairs(self):
        results = sample(PAIRS or 3, "--duration", os.environ.get("D","20"))
        for pair, (kind, words) in results:
            print(kind, *pair, words, flush=True)
        counts = {kind: sum(k == kind for _, (k, _) in results) for kind in ("held", "failed", "unseen")}
        print(counts)
        self.assertEqual(counts["failed"], 0, results)


def tearDownModule():
    runs.clean()


if __name__ == "__main__":
    unittest.main()
