"""What if the satellite burns now? Two branches of one simulation, with and without a manoeuvre.

    python3 branch_manoeuvre.py
"""
from __future__ import annotations

from typing import Tuple

import numpy as np
import numpy.typing as npt

import boresight as bst

Vector = npt.NDArray[np.float64]


def target_state(sim: bst.Simulation) -> Tuple[float, Vector, Vector]:
    """Time, position and velocity (GCRF) of the satellite, from the truth of two frames."""
    places, times = [], []
    for _ in range(2):
        sim.step("frame")
        truth = sim.truth
        assert truth is not None
        item = truth.items[truth.items["kind"] == bst.SourceKind.OBJECT][0]
        ra, dec = item["ra_rad"], item["dec_rad"]
        sight = np.array([np.cos(dec) * np.cos(ra), np.cos(dec) * np.sin(ra), np.sin(dec)])
        places.append(truth.observer_gcrf_m + item["range_m"] * sight)
        times.append(0.5 * (truth.start_tick + truth.end_tick) / sim.tick_rate_hz)
    velocity = (places[1] - places[0]) / (times[1] - times[0])
    return times[1], places[1], velocity


def miss_px(sim: bst.Simulation) -> float:
    """Distance of the satellite's true image from the boresight in the newest frame, px."""
    truth = sim.truth
    assert truth is not None
    item = truth.items[truth.items["kind"] == bst.SourceKind.OBJECT][0]
    return float(np.hypot(item["x_mid_px"] - truth.boresight_x_px,
                          item["y_mid_px"] - truth.boresight_y_px))


def main(burn_mps: float = 400.0) -> Tuple[float, float]:
    """Error of pointing without and with a burn, some seconds after it."""
    scenario = bst.Scenario.load("neossat_geo_track.json").with_(
        objects__0__external_states=True, observers__0__sensors__0__cue__offset_deg=0.02)
    with bst.Simulation(scenario) as sim:
        sim.run_until(40)
        time_s, position, velocity = target_state(sim)
        with sim.clone() as branch:
            along = velocity / np.linalg.norm(velocity)
            branch.command_state("INMARSAT GX5", sim.time_s, position + velocity *
                                 (sim.time_s - time_s), velocity + burn_mps * along)
            for one in (sim, branch):
                one.run_until(60)
            result = miss_px(sim), miss_px(branch)
    print(f"error of pointing at 60 s: {result[0]:.2f} px without, {result[1]:.2f} px with a burn "
          f"of {burn_mps:g} m/s")
    return result


if __name__ == "__main__":
    main()
