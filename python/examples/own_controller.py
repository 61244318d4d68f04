#!/usr/bin/env python3
"""A controller of one's own in the loop: looks at a direction that drifts over the sky, and follows
the target as soon as the tracker has it.

In one terminal the run, in another this program (either first):

    boresight run scenarios/neossat_geo_track.json --link tcp://127.0.0.1:5555 --external control
    PYTHONPATH=python python3 python/examples/own_controller.py tcp://127.0.0.1:5555 --ra 10 --dec 5
"""
import argparse

import numpy as np

from boresight.link import Link

LIGHT_MPS = 299792458.0


def apparent(direction, nav):
    """Where a geometric direction is seen from a moving observer (stellar aberration, first order in
    v/c: 0.002 arcsec off)."""
    seen = direction + nav["velocity_bary_mps"] / LIGHT_MPS
    return seen / np.linalg.norm(seen)


def main():
    parser = argparse.ArgumentParser(description="A controller of one's own in the loop.")
    parser.add_argument("address", help="for example tcp://127.0.0.1:5555")
    parser.add_argument("--ra", type=float, required=True, help="right ascension at the start, deg")
    parser.add_argument("--dec", type=float, required=True, help="declination, deg")
    parser.add_argument("--rate-ra", type=float, default=0.0, help="d(ra)/dt, deg/s")
    parser.add_argument("--rate-dec", type=float, default=0.0, help="d(dec)/dt, deg/s")
    options = parser.parse_args()

    def planned(seconds):
        ra = np.radians(options.ra + options.rate_ra * seconds)
        dec = np.radians(options.dec + options.rate_dec * seconds)
        return np.array([np.cos(dec) * np.cos(ra), np.cos(dec) * np.sin(ra), np.sin(dec)])

    with Link(options.address, serves="control", name="own controller") as link:
        mode = ""
        for step in link.steps():
            nav, tracks = link.latest(step.part, "nav_telemetry"), link.latest(step.part, "tracks")
            if nav is None:
                continue  # nothing is known yet: the step is answered without a command
            target = None
            if tracks is not None and tracks["target_id"]:
                target = next(t for t in tracks.items if t["id"] == tracks["target_id"])
            if target is not None:
                # the track is of the middle of an exposure; carried on to now
                age_s = (step.tick - tracks["tick"]) / link.tick_rate_hz
                rate = target["rate_gcrf_radps"]
                geometric = target["direction_gcrf"] + age_s * rate
            else:
                geometric = planned(step.seconds)
                rate = planned(step.seconds + 0.5) - planned(step.seconds - 0.5)
            seen = apparent(geometric, nav)
            # telemetry differs from the attitude by the stars; the command refers to telemetry
            if tracks is not None and tracks["attitude.valid"]:
                q = tracks["attitude.q_cam_from_gcrf"]
                error_gcrf = rotate_back(q, tracks["attitude.error_cam_rad"])
                seen = seen + np.cross(error_gcrf, seen)
            step.send_command(seen, rate)
            step.send_status("track" if target is not None else "rate",
                             int(tracks["target_id"]) if target is not None else 0)
            now = "follows the target" if target is not None else "points along the plan"
            if now != mode:
                print(f"{step.seconds:8.2f} s  {now}", flush=True)
                mode = now


def rotate_back(q, v):
    """A vector from camera into GCRF axes; q turns GCRF into camera axes (x, y, z, w)."""
    u = -q[:3]
    return v + 2.0 * np.cross(u, np.cross(u, v) + q[3] * v)


if __name__ == "__main__":
    main()
