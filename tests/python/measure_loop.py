"""A loop over the frames of the main scenario in Python against `boresight run`: docs/results/api.md
has the figures.

    PYTHONPATH=build/python python3 tests/python/measure_loop.py build/boresight [ROUNDS [FRAMES]]

Neither records anything, and both step in one thread (--serial). The command also evaluates the run
against the truth; therefore a single call of C that goes the same way without it is measured too.
In each round, in turn: the command (a long run less a short one, so that its start and end do not
count) and the call; then three simulations go on by one frame in turn: by a call, by the loop, and
by the loop with a NumPy view of each frame. Prints the processor time of a frame (user and system,
all threads): the least, the median, and the median of the ratios in the same turn.
"""
import os
import resource
import statistics
import subprocess
import sys
import tempfile
import time

import boresight as bst

SCENARIO = "neossat_geo_track.json"
SHORT_S, EXPOSURE_S = 10, 0.5
TABLES = ("truth", "truth_stars", "detections", "tracks", "commands", "events", "sightings")
NOTHING = {"/record/frames": "none", "/record/telemetry_hz": 0,
           **{f"/record/{name}": False for name in TABLES}}


def run_ms(program, duration_s, folder):
    """Processor time of the command, ms."""
    options = [f"--set={key}={str(value).lower()}" for key, value in NOTHING.items()]
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run([program, "run", f"scenarios/{SCENARIO}", "--serial", "--quiet", "--overwrite",
                    "--out", folder, "--duration", str(duration_s), *options], check=True,
                   stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return 1e3 * (after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)


def one_call(sim, frames):
    """Goes on to the end of each exposure."""
    for k in range(frames):
        sim.run_until(SHORT_S + k + EXPOSURE_S + 1 / sim.tick_rate_hz)
        yield


def loop(sim, frames):
    """Takes each frame."""
    for _ in sim.frames(until_s=SHORT_S + frames):
        yield


def loop_with_views(sim, frames):
    """Takes each frame and a view of its pixels."""
    for frame in sim.frames(until_s=SHORT_S + frames):
        frame.data[::2, ::2]
        yield


WAYS = {"a call of C each": one_call, "loop": loop, "loop, view of each": loop_with_views}


def in_turn_ms(model, frames):
    """Processor times of each frame, ms, of simulations that go on by a frame in turn."""
    sims = {name: bst.Simulation(model) for name in WAYS}
    times, ways = {name: [] for name in WAYS}, {}
    for name, sim in sims.items():
        sim.run_until(SHORT_S)
        ways[name] = WAYS[name](sim, frames)
    for k in range(frames):
        names = list(WAYS)
        for name in names[k % len(names):] + names[:k % len(names)]:
            before = time.process_time()
            next(ways[name])
            times[name].append(1e3 * (time.process_time() - before))
    for sim in sims.values():
        sim.close()
    return times


def call_ms(model, frames):
    """Processor time of a frame, ms, in one call of C for all of them."""
    with bst.Simulation(model) as sim:
        sim.run_until(SHORT_S)
        before = time.process_time()
        sim.run_until(SHORT_S + frames)
        return 1e3 * (time.process_time() - before) / frames


def show(times, to, many):
    """Prints a table; ratios are medians of those in the same turn."""
    print(f"{'':20}{'least ms':>10}{'median ms':>11}{'ratio':>8}   {many}")
    for name, found in times.items():
        ratio = statistics.median(a / b for a, b in zip(found, times[to]))
        print(f"{name:20}{min(found):10.2f}{statistics.median(found):11.2f}{ratio:8.3f}")


def main():
    program = os.path.abspath(sys.argv[1])
    rounds = int(sys.argv[2]) if len(sys.argv) > 2 else 7
    frames = int(sys.argv[3]) if len(sys.argv) > 3 else 60
    scenario = bst.Scenario.load(SCENARIO).with_({**NOTHING, "/duration_s": SHORT_S + frames})
    model = bst.Model(scenario).prepare()
    runs, turns = {"boresight run": [], "one call of C": []}, {name: [] for name in WAYS}
    with tempfile.TemporaryDirectory() as folder:
        out = os.path.join(folder, "run")
        for _ in range(rounds):
            longer = run_ms(program, SHORT_S + frames, out)
            runs["boresight run"].append((longer - run_ms(program, SHORT_S, out)) / frames)
            runs["one call of C"].append(call_ms(model, frames))
            for name, found in in_turn_ms(model, frames).items():
                turns[name] += found
    show(runs, "boresight run", f"of {rounds} runs in turn, mean of {frames} frames")
    show(turns, "a call of C each", f"of {rounds * frames} frames in turn")


if __name__ == "__main__":
    main()
