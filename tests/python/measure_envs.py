"""Steps of Gymnasium environments against those of a C program: docs/results/api.md has the figures.

    PYTHONPATH=build/python python tests/python/measure_envs.py build/boresight [ROUNDS]

No environment ends. In each round, in turn: the benchmarks env_1 and env_64 (C), one PointingEnv on one processor, and a
PointingVectorEnv of 64 on all of them. Prints the least and the median of wall time and of processor
time for a step of one environment.
"""
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time

import numpy as np

try:
    import gymnasium  # noqa: F401
except ImportError:
    print("gymnasium is not installed: nothing is measured")
    sys.exit(0)

from boresight.gym import PointingEnv, PointingVectorEnv
from boresight.gym.pointing import pointing_model

ENVS, VECTOR_STEPS, SINGLE_STEPS, WARM_STEPS = 64, 30, 100, 4


def of_c(program, name):
    """Wall and processor time of a step of the benchmark, ms."""
    with tempfile.NamedTemporaryFile(suffix=".json") as out:
        subprocess.run([program, "bench", name, "--json", out.name], check=True,
                       stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        with open(out.name, encoding="utf-8") as file:
            result = json.load(file)["results"][0]
    return result["ms_median"], result["cpu_ms"]


def of_steps(step, count):
    """Median wall time and mean processor time of a call, ms."""
    for _ in range(WARM_STEPS):
        step()
    wall, cpu = [], time.process_time()
    for _ in range(count):
        before = time.perf_counter()
        step()
        wall.append(time.perf_counter() - before)
    return 1e3 * statistics.median(wall), 1e3 * (time.process_time() - cpu) / count


def single(model):
    """One environment, on one processor."""
    processors = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {min(processors)})
    try:
        env = PointingEnv(model=model, patience=10**6)
        env.reset(seed=1)
        return of_steps(lambda: env.step(np.zeros(2, np.float32)), SINGLE_STEPS)
    finally:
        env.close()
        os.sched_setaffinity(0, processors)


def vector(model):
    """A step of one of 64 environments."""
    envs = PointingVectorEnv(ENVS, model=model, patience=10**6)
    envs.reset(seed=1)
    actions = np.zeros((ENVS, 2), np.float32)
    wall, cpu = of_steps(lambda: envs.step(actions), VECTOR_STEPS)
    envs.close()
    return wall / ENVS, cpu / ENVS


def main():
    program, rounds = sys.argv[1], int(sys.argv[2]) if len(sys.argv) > 2 else 5
    model = pointing_model()
    kinds = {"C, 1": lambda: of_c(program, "env_1"), "C, 64": lambda: of_c(program, "env_64"),
             "PointingEnv": lambda: single(model), "PointingVectorEnv, 64": lambda: vector(model)}
    times = {name: [] for name in kinds}
    for _ in range(rounds):
        for name, measure in kinds.items():
            times[name].append(measure())
    print(f"{'':24}{'wall ms':>10}{'median':>10}{'cpu ms':>10}{'median':>10}")
    for name, found in times.items():
        print(f"{name:24}" + "".join(f"{value:10.3f}" for k in range(2) for value in (
            min(f[k] for f in found), statistics.median(f[k] for f in found))))


if __name__ == "__main__":
    main()
