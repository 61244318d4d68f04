"""What the end-to-end tests share: running the program and reading what it left.

The tests that use it take the path of the program as their first argument and run from the
repository root. They use the embedded star catalogue, whether or not the full one is there.
"""
import json
import os
import shutil
import sqlite3
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor

BORESIGHT = os.path.abspath(sys.argv.pop(1))
TRACK = "scenarios/neossat_geo_track.json"
STARE = "scenarios/neossat_geo_stare.json"
RATE_OPEN = "scenarios/neossat_geo_rate_open.json"
DAY_PLANT = "scenarios/day_plant.json"
SENSOR = "/observers/0/sensors/0"
NO_FRAMES = "/record/frames=none"
# of constellation_quick.json: at its own epoch the Earth's light fills an image, which takes longer than all else
DARK = "/epoch_utc=2022-06-16T22:15:00Z"
# without OpenCL, whose start takes most of the time of `check`
GENERATOR = SENSOR + "/observation_source=generator"

_folders = []


def scratch():
    """A new folder, removed by clean()."""
    folder = tempfile.mkdtemp(prefix="boresight-e2e-")
    _folders.append(folder)
    return folder


def clean():
    """Removes what scratch() made; for tearDownModule."""
    while _folders:
        shutil.rmtree(_folders.pop(), ignore_errors=True)


def command(scenario, out, *sets, seed=None, duration=None, threads=1, serial=False, pictures=False):
    """Arguments of `boresight run`; `sets` are overrides "/path=value". Pictures take 0.2 s."""
    words = [BORESIGHT, "run", scenario, "--quiet", "--out", out, "--threads", str(threads),
             "--set", "/world/star_catalogue=embedded"]
    if not pictures:
        words.append("--no-pictures")
    if seed is not None:
        words += ["--seed", hex(seed)]
    if duration is not None:
        words += ["--duration", str(duration)]
    if serial:
        words.append("--serial")
    for one in sets:
        words += ["--set", one]
    return words


def run(scenario, out, *sets, **options):
    """Runs a scenario to its end and returns the manifest; fails with the program's message."""
    result = subprocess.run(command(scenario, out, *sets, **options), capture_output=True,
                            text=True, timeout=3600)
    if result.returncode != 0:
        raise AssertionError(f"exit code {result.returncode}: {result.stderr}")
    return manifest(out)


def call(*words, timeout=120, **options):
    """The program with these words, to its end: returncode, stdout and stderr as text. Ends with
    subprocess.TimeoutExpired after `timeout` seconds; `options` are those of subprocess.run."""
    return subprocess.run([BORESIGHT, *words], capture_output=True, text=True, timeout=timeout,
                          check=False, **options)


def call_well(*words, **options):
    """call() that must end with exit code 0 and an empty standard error: what it printed."""
    result = call(*words, **options)
    if (result.returncode, result.stderr) != (0, ""):
        raise AssertionError(f"{words}: exit code {result.returncode}: {result.stderr}")
    return result.stdout


def export(*words, **options):
    """call_well() of `boresight export`."""
    return call_well("export", *words, **options)


def manifest(out):
    with open(os.path.join(out, "manifest.json"), encoding="utf-8") as file:
        return json.load(file)


def need_full_catalogue():
    """Fails unless the user's own star catalogue is there: fields of the slow tests that lie beyond
    the stars in the program would have too few for an attitude."""
    said = subprocess.run([BORESIGHT, "stars", "info", "default"], capture_output=True, text=True,
                          check=True).stdout
    if "embedded" in said:
        raise AssertionError("needs the full star catalogue: run `boresight stars fetch` first")


def database(out):
    """The run's tables, opened for reading; rows by column name."""
    connection = sqlite3.connect(f"file:{out}/run.sqlite?mode=ro", uri=True)
    connection.row_factory = sqlite3.Row
    return connection


def parallel(function, jobs, workers=None):
    """function(job) for every job, as many at a time as there are processors; results in order."""
    with ThreadPoolExecutor(workers or os.cpu_count()) as pool:
        return list(pool.map(function, jobs))
