"""What a new user does with the installed package, in a root with nothing else: bare_root.sh runs it there.

    bare_root.py generator        the closed loop without an OpenCL device, and what rendering says then
    bare_root.py picture [FILE]   the closed loop with images, until the target is in track; a picture of a frame
"""
import base64
import hashlib
import pathlib
import re
import subprocess
import sys

import boresight as bst
from boresight import _native

SENSOR = "/observers/0/sensors/0"
MAIN = bst.Scenario.load("neossat_geo_track.json").with_({f"{SENSOR}/cue/offset_deg": 0.02})


def follow(scenario, until_s):
    """Runs the closed loop frame by frame or detection by detection; returns the last mode of control."""
    with bst.Simulation(scenario) as sim:
        sim.run_until(until_s)
        assert sim.tracks and len(sim.tracks) > 0, "no track"
        return bst.Mode(sim.control_status.mode).name


def generator():
    """Everything but rendering works without a device; rendering says what to install."""
    mode = follow(MAIN.with_({f"{SENSOR}/observation_source": "generator"}), 30)
    assert mode == "TRACK", mode
    summary = bst.run(MAIN.with_({f"{SENSOR}/observation_source": "generator"}), duration_s=20).summary
    assert summary["final_mode"] == "track", summary["final_mode"]
    try:
        follow(MAIN, 5)
    except bst.DeviceError as error:
        text = str(error)
    else:
        raise SystemExit("rendering without an OpenCL device raised no error")
    assert "pip install boresight[pocl]" in text and "pocl-opencl-icd" in text, text
    said = subprocess.run([str(pathlib.Path(sys.executable).with_name("boresight")), "run",
                           str(_native.scenarios_path() / "neossat_geo_track.json"), "--duration", "2",
                           "--out", "run"], capture_output=True, text=True)
    assert said.returncode != 0 and "pocl-opencl-icd" in said.stderr, said
    print("without a device:", text)


def picture(path=None):
    """The loop with images; the picture is that of a notebook."""
    with bst.Simulation(MAIN) as sim:
        for frame in sim.frames(until_s=30):
            mode = bst.Mode(sim.control_status.mode).name
            if mode == "TRACK" and frame.exposure_id >= 10:
                break
        else:
            raise SystemExit(f"the target is not in track after 30 s (mode {mode})")
        image = re.search(r"base64,([^\"]+)", frame._repr_html_())
        data = base64.b64decode(image.group(1))
    assert data.startswith(b"\x89PNG"), data[:8]
    if path:
        pathlib.Path(path).write_bytes(data)
    digest = hashlib.sha256(frame.data.tobytes()).hexdigest()[:16]
    print(f"frame {frame.exposure_id}: {frame.data.shape[1]} x {frame.data.shape[0]} pixels, digest {digest}, "
          f"a picture of {len(data)} bytes, mode {mode}")


if __name__ == "__main__":
    print("Python", sys.version.split()[0], "- boresight", bst.__version__)
    {"generator": generator, "picture": picture}[sys.argv[1]](*sys.argv[2:])
