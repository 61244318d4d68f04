"""Labelled frames for training: each frame with boxes round what is in it, as a data loader yields.

    python3 labelled_frames.py
"""
from __future__ import annotations

from typing import Iterator, Tuple

import numpy as np
import numpy.typing as npt

import boresight as bst

Sample = Tuple[npt.NDArray[np.float32], npt.NDArray[np.float32], npt.NDArray[np.int64]]


def samples(runs: int, until_s: float, half_box_px: float = 6.0) -> Iterator[Sample]:
    """Image in sigma of its noise [height, width], boxes [n, 4] (x0, y0, x1, y1) in pixels, and
    labels [n] (0 star, 1 satellite). Each run has other noise; the model is read once."""
    model = bst.Model("neossat_geo_stare.json").prepare()
    for run in range(runs):
        with bst.Simulation(model, run=run) as sim:
            for frame in sim.frames(until_s=until_s):
                truth = sim.truth
                assert truth is not None
                bright = truth.items[(truth.items["flags"] & bst.TruthFlag.IN_FIELD > 0)
                                     & (truth.items["snr"] > 6)]
                x = np.stack([bright["x_start_px"], bright["x_end_px"]])
                y = np.stack([bright["y_start_px"], bright["y_end_px"]])
                boxes = np.stack([x.min(0) - half_box_px, y.min(0) - half_box_px,
                                  x.max(0) + half_box_px, y.max(0) + half_box_px], axis=1)
                level = np.median(frame.data[::4, ::4])
                noise = max(float(np.median(np.abs(frame.data[::4, ::4] - level))) / 0.6745, 1.0)
                image = ((frame.data - level) / noise).astype(np.float32)
                yield image, boxes.astype(np.float32), bright["kind"].astype(np.int64)


def main(runs: int = 2, until_s: float = 4.0) -> int:
    """Prints the samples; returns their number."""
    count = 0
    for image, boxes, labels in samples(runs, until_s):
        print(f"image {image.shape}, {len(boxes)} boxes, {int(labels.sum())} of satellites")
        count += 1
    return count


if __name__ == "__main__":
    main()
