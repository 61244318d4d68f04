#!/usr/bin/env python3
"""Thickens a catalogue and multiplies observers: a constellation at the scale of tomorrow.

    python3 thickened.py SCENARIO FOLDER [--objects 30000] [--observers 100] [--seed 1]

SCENARIO is a scenario with tasking whose objects come from one element file (world.catalogues), such as
scenarios/day_constellation.json. Into FOLDER go objects.tle and scenario.json.

Objects. The element sets of the file are kept. Further ones are copies of sets drawn at random, so that the shares of
orbits are those of the file. Node, argument of perigee and mean anomaly of a copy are uniform from 0 to 360 degrees;
its inclination differs by a normal deviate of 0.05 degrees, and its mean motion by one of 0.2 % (both 0 within 0.1
revolutions a day of the geostationary ring, whose slots the mean anomaly fills). Satellites of one launch so become
strangers: the model has no clusters, no breakups and no shells that are finer than this. Copies have catalogue numbers
from 100,001 on, in Alpha-5, and their sources' names with the number of the copy.

The names of other files in the scenario are changed to where they are, seen from FOLDER.

Observers. Those of the scenario are kept; further ones have the sensors of one of them in turn, on orbits of the file
drawn at random: nearly circular ones of 500 km to 1,500 km height, and geostationary ones, in turn.

The same seed gives the same bytes.
"""
import argparse
import copy
import json
import os
import random
import sys

FIRST = 100001
MOST = 339999 - FIRST + 1  # that Alpha-5 can number
LETTERS = "ABCDEFGHJKLMNPQRSTUVWXYZ"


def checksum(line):
    """Last digit of a line of a TLE: the sum of digits, a minus sign counting 1, modulo 10."""
    return sum(int(c) if c.isdigit() else c == "-" for c in line[:68]) % 10


def alpha5(number):
    return f"{LETTERS[number // 10000 - 10]}{number % 10000:04d}"


def read(path):
    """Element sets of a file of two or three lines each, as (name, line 1, line 2)."""
    sets, name = [], ""
    with open(path, encoding="utf-8") as file:
        lines = [line.rstrip("\n") for line in file if not line.startswith("#")]
    for first, second in zip(lines, lines[1:]):
        if first.startswith("1 ") and second.startswith("2 "):
            sets.append((name, first.ljust(69), second.ljust(69)))
        elif second.startswith("1 "):
            name = first.strip().removeprefix("0 ")
    if not sets:
        sys.exit(f"{path}: there is no element set of two or three lines")
    for _, first, _ in sets:
        if not first[2:7].strip().isdigit():
            sys.exit(f"{path}: catalogue number {first[2:7]} (allowed: 0 to 99999; copies have those from {FIRST} on)")
    return sets


def load(path):
    try:
        with open(path, encoding="utf-8") as file:
            scenario = json.load(file)
    except (OSError, ValueError) as error:
        sys.exit(f"{path}: {error}")
    catalogues = scenario.get("world", {}).get("catalogues", [])
    if len(catalogues) != 1 or not scenario.get("observers"):
        sys.exit(f"{path}: /world/catalogues has {len(catalogues)} catalogues and /observers "
                 f"{len(scenario.get('observers', []))} observers (allowed: 1 catalogue, 1 observer or more, both in "
                 "this file)")
    return scenario


def moved(node, base, folder):
    """A part of the scenario with the names of files relative to another folder."""
    if isinstance(node, dict):
        return {key: moved(value, base, folder) for key, value in node.items()}
    if isinstance(node, list):
        return [moved(value, base, folder) for value in node]
    if isinstance(node, str) and "." in node and os.path.isfile(os.path.join(base, node)):
        return os.path.relpath(os.path.join(base, node), folder)
    return node


def numbered(line, number):
    line = line[:2] + alpha5(number) + line[7:68]
    return line + str(checksum(line))


def copy_of(source, number, rng):
    """A copy of an element set on another orbit of its kind."""
    name, first, second = source
    motion, inclination = float(second[52:63]), float(second[8:16])
    if abs(motion - 1.0027) > 0.1:
        motion *= 1.0 + 0.002 * rng.gauss(0.0, 1.0)
        inclination = min(max(inclination + 0.05 * rng.gauss(0.0, 1.0), 0.0), 179.9999)
    node, perigee, anomaly = (rng.uniform(0.0, 359.9999) for _ in range(3))
    line = (f"{second[:8]}{inclination:8.4f} {node:8.4f} {second[26:33]} {perigee:8.4f} {anomaly:8.4f} "
            f"{motion:11.8f}{second[63:68]}")
    return f"{name[:16]} c{number - FIRST + 1}", numbered(first, number), numbered(line, number)


def height_km(second):
    """Mean height over the equatorial radius, by Kepler's third law."""
    radius = (398600.8 / (float(second[52:63]) * 2.0 * 3.141592653589793 / 86400.0) ** 2) ** (1.0 / 3.0)
    return radius - 6378.135


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenario")
    parser.add_argument("folder")
    parser.add_argument("--objects", type=int, default=30000)
    parser.add_argument("--observers", type=int, default=100)
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    scenario = load(arguments.scenario)
    base = os.path.dirname(os.path.abspath(arguments.scenario))
    path = os.path.join(base, scenario["world"]["catalogues"][0]["elements_file"])
    sets = read(path)
    scenario = moved(scenario, base, os.path.abspath(arguments.folder))
    catalogue = scenario["world"]["catalogues"][0]
    own = catalogue["elements_file"]
    rng = random.Random(arguments.seed)
    if not len(sets) <= arguments.objects <= len(sets) + MOST:
        sys.exit(f"--objects {arguments.objects}: allowed are {len(sets)}, those of {path}, to {len(sets) + MOST}")
    if arguments.observers < len(scenario["observers"]):
        sys.exit(f"--observers {arguments.observers}: the scenario has {len(scenario['observers'])}")
    all_sets = sets + [copy_of(sets[rng.randrange(len(sets))], FIRST + k, rng)
                       for k in range(arguments.objects - len(sets))]
    low = [s for s in sets if float("0." + s[2][26:33].strip()) < 0.01 and 500.0 < height_km(s[2]) < 1500.0]
    high = [s for s in sets if abs(float(s[2][52:63]) - 1.0027) < 0.01 and float(s[2][8:16]) < 5.0]
    if not low:
        sys.exit(f"{path}: no nearly circular orbit of 500 km to 1,500 km height for observers")
    observers = scenario["observers"]
    for observer in observers:
        if observer["orbit"].get("elements_file") == own:
            observer["orbit"]["elements_file"] = "objects.tle"
    given = len(observers)
    for k in range(given, arguments.observers):
        source = rng.choice(low if k % 2 == 0 or not high else high)
        observer = copy.deepcopy(observers[k % given])
        observer["name"] = f"observer{k}"
        observer["orbit"] = {"elements_file": "objects.tle", "norad": int(source[1][2:7])}
        observers.append(observer)
    scenario["name"] = f"{scenario['name']}_{arguments.observers}_{arguments.objects}"
    scenario.pop("$schema", None)
    catalogue["elements_file"] = "objects.tle"
    os.makedirs(arguments.folder, exist_ok=True)
    with open(os.path.join(arguments.folder, "objects.tle"), "w", encoding="utf-8") as file:
        for name, first, second in all_sets:
            file.write(f"{name}\n{first}\n{second}\n")
    with open(os.path.join(arguments.folder, "scenario.json"), "w", encoding="utf-8") as file:
        json.dump(scenario, file, indent=4)
        file.write("\n")


if __name__ == "__main__":
    main()
