#!/usr/bin/env python3
"""A detector of one's own in the loop: sums of 3 x 3 pixels above a threshold, and their centroids.

In one terminal the run, in another this program (either first):

    boresight run scenarios/neossat_geo_stare.json --link tcp://127.0.0.1:5555 --external imgproc
    PYTHONPATH=python python3 python/examples/own_detector.py tcp://127.0.0.1:5555
"""
import argparse

import numpy as np

from boresight.link import Link


def box_sums(image):
    """The sum of each pixel with its eight neighbours; the border stays 0."""
    rows = image[:-2] + image[1:-1] + image[2:]
    sums = np.zeros_like(image)
    sums[1:-1, 1:-1] = rows[:, :-2] + rows[:, 1:-1] + rows[:, 2:]
    return sums


def detect(pixels, threshold_sigma):
    """Columns, rows, sums over the background and their noise, in digital numbers."""
    sample = np.sort(pixels[::4, ::4], axis=None).astype(float)
    level = np.median(sample)
    # the standard deviation from the lower half, which has no stars
    sigma = max(level - sample[int(0.158655 * sample.size)], 0.3)
    image = pixels.astype(np.float32) - np.float32(level)
    sums = box_sums(image)
    noise = 3.0 * sigma
    y, x = np.nonzero(sums > threshold_sigma * noise)
    inside = (x > 1) & (y > 1) & (x < image.shape[1] - 2) & (y < image.shape[0] - 2)
    x, y = x[inside], y[inside]
    around = [(j, i) for j in (-1, 0, 1) for i in (-1, 0, 1)]
    # largest among its neighbours; of equal ones the first in reading order
    top = np.ones(x.size, bool)
    for j, i in around:
        if (j, i) < (0, 0):
            top &= sums[y, x] > sums[y + j, x + i]
        elif (j, i) > (0, 0):
            top &= sums[y, x] >= sums[y + j, x + i]
    x, y = x[top], y[top]
    total = sums[y, x].astype(float)
    moment_x = sum(i * image[y + j, x + i] for j, i in around) / total
    moment_y = sum(j * image[y + j, x + i] for j, i in around) / total
    return x + moment_x, y + moment_y, total, sigma


def main():
    parser = argparse.ArgumentParser(description="A detector of one's own in the loop.")
    parser.add_argument("address", help="for example tcp://127.0.0.1:5555")
    parser.add_argument("--threshold-sigma", type=float, default=5.0)
    options = parser.parse_args()
    with Link(options.address, serves="imgproc", name="own detector",
                             shared_memory=True) as link:
        for step in link.steps():
            frame, part = step.frame, step.part
            x, y, total, sigma = detect(frame.pixels, options.threshold_sigma)
            gain = float(part["gain_e_per_dn"])
            exposure_s = (frame["end_tick"] - frame["start_tick"]) / link.tick_rate_hz
            flux = total * gain
            # six pixels a unit away from the middle, each with the noise of one
            variance = 6.0 * (sigma / total) ** 2
            step.send_detections(
                x_px=frame["window.x0"] + x, y_px=frame["window.y0"] + y,
                cov_xx=variance, cov_yy=variance,
                flux_e=flux, flux_sigma_e=3.0 * sigma * gain, snr=total / (3.0 * sigma),
                length_px=2.0, width_px=2.0,
                v_mag=-2.5 * np.log10(flux / (exposure_s * float(part["flux_v0_e_per_s"]))),
                v_mag_sigma=1.0857 * 3.0 * sigma / total)
            print(f"{step.seconds:8.2f} s  frame {frame['exposure_id']}: {len(x)} detections",
                  flush=True)


if __name__ == "__main__":
    main()
