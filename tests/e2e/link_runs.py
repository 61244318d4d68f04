"""Runs whose modules other processes play: what the tests of the link share."""
import os
import socket
import subprocess

import runs

EMBEDDED = ["--set", "/world/star_catalogue=embedded"]
SECONDS = 8


def near():
    """The main scenario on a quarter of the sensor, with a cue that is 0.05 degrees wrong: it has tracks
    within seconds."""
    path = runs.scratch() + "/near.json"
    with open(path, "w", encoding="utf-8") as file:
        file.write(runs.call_well(
            "check", runs.TRACK, *EMBEDDED, "--set", runs.SENSOR + "/cue/offset_deg=0.05", "--set",
            runs.SENSOR + "/camera/width_px=512", "--set", runs.SENSOR + "/camera/height_px=512"))
    return path


def free_port():
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return one.getsockname()[1]


def ipc():
    return f"ipc://{runs.scratch()}/link"


def start_run(scenario, out, address, external, *more, duration=SECONDS, frames=False):
    words = runs.command(scenario, out, *([] if frames else [runs.NO_FRAMES]), duration=duration)
    words.remove("--quiet")  # it says when it waits for peers
    return subprocess.Popen(words + ["--link", address, "--external", external, *more],
                            stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def wait_until_open(run):
    """Returns when the run waits for its peers."""
    line = run.stderr.readline()
    while "waiting for peers" not in line:
        if not line:
            raise AssertionError(f"{run.args}: ended before it waited for peers")
        line = run.stderr.readline()


def serve(scenario, address, part, *more, duration=SECONDS):
    return subprocess.Popen(
        [runs.BORESIGHT, "serve", scenario, "--link", address, "--part", part, "--threads", "1",
         "--duration", str(duration), *EMBEDDED, *more],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def python(script, *words):
    return subprocess.Popen(["/usr/bin/python3", script, *words], stdout=subprocess.PIPE,
                            stderr=subprocess.PIPE, text=True,
                            env=dict(os.environ, PYTHONPATH="python"))


def ended(process, expected=0, timeout=120):
    out, err = process.communicate(timeout=timeout)
    if process.returncode != expected:
        raise AssertionError(f"{process.args}: exit code {process.returncode}: {out}{err}")
    return out + err
