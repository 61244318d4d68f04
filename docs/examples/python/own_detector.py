"""A detector of one's own in the process, and the probability that it finds a star.

    python3 own_detector.py
"""
from __future__ import annotations

from typing import Any, Dict, Tuple

import numpy as np
import numpy.typing as npt

import boresight as bst


def box_detector(frame: bst.DetectorFrame) -> Dict[str, Any]:
    """Sums of 3 x 3 pixels above 5 sigma, and their centroids, in full-sensor pixels."""
    image = frame.data.astype(np.float32)
    level = np.median(image[::4, ::4])
    image -= level
    # the standard deviation from the lower half, which has no stars
    sigma = max(-float(np.quantile(image[::4, ::4], 0.158655)), 0.3)
    rows = image[:-2] + image[1:-1] + image[2:]
    sums = np.zeros_like(image)
    sums[1:-1, 1:-1] = rows[:, :-2] + rows[:, 1:-1] + rows[:, 2:]
    around = [(j, i) for j in (-1, 0, 1) for i in (-1, 0, 1)]
    y, x = np.nonzero(sums[2:-2, 2:-2] > 15.0 * sigma)
    y, x = y + 2, x + 2
    top = np.ones(len(x), bool)
    for j, i in around:  # the largest of its neighbourhood; of equal ones the first
        other = sums[y + j, x + i]
        top &= sums[y, x] > other if (j, i) < (0, 0) else sums[y, x] >= other
    y, x = y[top], x[top]
    total = sums[y, x].astype(float)
    gain, variance = frame.camera.gain_e_per_dn, 6.0 * (sigma / total) ** 2
    return {"x_px": frame.window.x0 + x + sum(i * image[y + j, x + i] for j, i in around) / total,
            "y_px": frame.window.y0 + y + sum(j * image[y + j, x + i] for j, i in around) / total,
            "cov_xx": variance, "cov_yy": variance, "flux_e": total * gain,
            "flux_sigma_e": 3.0 * sigma * gain, "snr": total / (3.0 * sigma),
            "length_px": 2.0, "width_px": 2.0}


def found(sim: bst.Simulation) -> Tuple[npt.NDArray[np.float64], npt.NDArray[np.bool_]]:
    """SNR of each true star that is alone in the newest frame, and whether it was found."""
    truth, detections = sim.truth, sim.detections
    assert truth is not None and detections is not None
    stars = truth.items[(truth.items["kind"] == bst.SourceKind.STAR)
                        & (truth.items["flags"] == bst.TruthFlag.IN_FIELD)]
    # those alone within 12 px
    between = np.hypot(stars["x_mid_px"][:, None] - stars["x_mid_px"][None],
                       stars["y_mid_px"][:, None] - stars["y_mid_px"][None])
    stars = stars[(between < 12.0).sum(axis=1) == 1]
    dx = stars["x_centroid_px"][:, None] - detections.items["x_px"][None]
    dy = stars["y_centroid_px"][:, None] - detections.items["y_px"][None]
    near = np.hypot(dx, dy).min(axis=1, initial=np.inf) < 2.0
    return stars["snr"], near


def main(frames: int = 20) -> Dict[str, float]:
    """Probability of detection by SNR, over some frames of a field of stars."""
    scenario = bst.Scenario.load("neossat_geo_stare.json").with_plugin(
        detector=bst.register(detector=box_detector))
    snr, hit = [], []
    with bst.Simulation(scenario) as sim:
        sim.run_until(10)  # the mount settles
        for _ in range(frames):
            sim.step("detections")
            one, near = found(sim)
            snr.append(one)
            hit.append(near)
    all_snr, all_hit = np.concatenate(snr), np.concatenate(hit)
    result = {}
    for low, high in ((3, 6), (6, 12), (12, 25), (25, 1000)):
        inside = (all_snr >= low) & (all_snr < high)
        if inside.any():
            result[f"{low} to {high}"] = float(all_hit[inside].mean())
            print(f"SNR {low:3d} to {high:4d}: Pd {result[f'{low} to {high}']:.3f} of "
                  f"{inside.sum()} stars")
    return result


if __name__ == "__main__":
    main()
