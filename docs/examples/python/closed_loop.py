"""A closed loop in ten lines: Python sees each frame, the simulator does the rest.

    python3 closed_loop.py
"""
from __future__ import annotations

import boresight as bst


def main(until_s: float = 60.0) -> str:
    """Runs the main scenario from a good cue; returns the mode in which control ends."""
    scenario = bst.Scenario.load("neossat_geo_track.json").with_(
        observers__0__sensors__0__cue__offset_deg=0.02)
    with bst.Simulation(scenario) as sim:
        for frame in sim.frames(until_s=until_s):
            status, tracks = sim.control_status, sim.tracks
            mode = bst.Mode(status.mode).name if status else "-"
            print(f"{frame.start_s:6.1f} s  brightest pixel {frame.data.max():5d} DN  {mode:9s}"
                  f"  {len(tracks) if tracks else 0} tracks")
        return mode


if __name__ == "__main__":
    main()
