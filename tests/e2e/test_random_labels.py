#!/usr/bin/env python3
"""Random scenes (random_scenes.py) with images: their labels against the light in the frames, and the
figures of summary and report against a recomputation from run.sqlite (figures.py).

Usage, from the repository root:
  /usr/bin/python3 tests/e2e/test_random_labels.py BORESIGHT [COUNT]
"""
import json
import os
import sys
import unittest

import numpy as np
from astropy.io import fits

COUNT = int(sys.argv.pop(2)) if len(sys.argv) > 2 and sys.argv[2].isdigit() else 0
# without COUNT one whose kernels other tests compile: hits in a crowded sky
SCENES = range(COUNT) if COUNT else (46,)

import figures  # noqa: E402  (after the arguments)
import random_scenes  # noqa: E402
import runs  # noqa: E402
from figure_checks import FigureChecks  # noqa: E402

SEED = 33
FRAMES, EVERY = (24, 3) if COUNT else (14, 2)  # frames of a run, and those whose labels are looked at
BOX, STARS = 20.0, 40.0  # side; all stars, however faint
MOST = 400  # sources of a frame that are looked at
# Light outside the box: Moffat of beta 2.5 with a FWHM of 3.2 px, 4 %; diffraction patterns with the
# smallest apertures 10 %; sources of the truth that are too faint to part from the sky add some.
LEAST, GREATEST = 0.86, 1.08


def light(pixels, x0, y0, x1, y1):
    """Counts above the sky in a box, noise of that, centroid; the sky is the median of the ring
    of 8 px round it. Pixels count as a whole by their centres."""
    rows, columns = slice(max(y0 - 8, 0), y1 + 8), slice(max(x0 - 8, 0), x1 + 8)
    part = pixels[rows, columns].astype(float)
    y, x = np.mgrid[rows.start:rows.start + part.shape[0], columns.start:columns.start + part.shape[1]]
    inside = (x >= x0) & (x < x1) & (y >= y0) & (y < y1)
    ring = part[~inside]
    sky, sigma = np.median(ring), 1.4826 * np.median(np.abs(ring - np.median(ring)))
    above = np.where(inside, part - sky, 0.0)
    flux = above.sum()
    # of the sum, and of the median of the ring under all of the box
    noise = sigma * np.sqrt(inside.sum() + 1.57 * inside.sum() ** 2 / ring.size)
    return flux, noise, (above * x).sum() / flux, (above * y).sum() / flux, sigma, part[inside[:]].max()


class RandomLabels(FigureChecks, unittest.TestCase):
    def test_scenes(self):
        counted = labelled = 0
        for number in SCENES:
            with self.subTest(scene=number):
                sources, in_track = self.scene(number)
                counted += sources
                labelled += in_track
        print(f"{counted} sources of {len(SCENES)} scenes looked at, {labelled} frames in track")
        self.assertGreater(counted, 30 * len(SCENES))
        self.assertGreater(labelled, 0)

    def scene(self, number):
        folder = runs.scratch()
        path = random_scenes.write(folder, SEED, number, runs.BORESIGHT, "embedded", False)
        with open(path, encoding="utf-8") as file:
            scenario = json.load(file)
        out = os.path.join(folder, "run")
        sensor = scenario["observers"][0]["sensors"][0]
        summary = runs.run(path, out, "/record/frames=extensions", '/record/planes=["segmentation"]',
                           "/record/detections_of=all",
                           duration=FRAMES * sensor["exposure"]["period_s"])["summary"]
        print(number, scenario["description"])
        self.check_figures(scenario, out, summary)
        return self.labels(sensor, out), summary["track_frames"]

    def check_figures(self, scenario, out, summary):
        orbit = scenario["world"]["objects"][0]["orbit"]
        frames = figures.Frames(runs.database(out), figures.Orbit(
            orbit["elements_file"], orbit["norad"], scenario["epoch_utc"]), orbit["norad"])
        # 10 m at the distance: precession and nutation of another model
        self.assertLess(frames.disagreement, 0.2 * figures.ARCSEC)
        mine, unclear = figures.judge(frames)
        self.assertEqual(unclear, 0)
        self.compare(mine, summary)
        self.check_page(self.read_page(out), mine, summary)

    def labels(self, sensor, out):
        camera = sensor["camera"]
        said = runs.call("export", out, "--coco", out + ".coco", "--yolo", out + ".yolo", "--star-limit",
                         str(STARS), "--box", str(BOX), "--every", str(EVERY))
        self.assertEqual(said.returncode, 0, said.stderr)
        with open(out + ".coco/annotations.json", encoding="utf-8") as file:
            data = json.load(file)
        ratios, off, sources, stars = [], [], 0, set()
        with fits.open(out + "/frames.fits") as frames, fits.open(out + "/segmentation.fits") as masks:
            pixels = {h.header["FRAMEID"]: h.data for h in frames[1:] if h.data is not None}
            segments = {h.header["FRAMEID"]: h.data for h in masks[1:]}
            tables = runs.database(out)
            for image in data["images"]:
                mine = [a for a in data["annotations"] if a["image_id"] == image["id"]]
                self.yolo(out, image, mine)
                exposure = image["exposure_id"]
                truth = tables.execute("SELECT item, electrons, x_centroid_px, y_centroid_px, x_start_px, "
                                       "x_end_px, y_start_px, y_end_px FROM truth WHERE exposure_id = ? AND "
                                       "electrons > 0", (exposure,)).fetchall()
                places = np.array([tuple(row)[2:4] for row in truth])
                ways = np.array([tuple(row)[4:] for row in truth])
                electrons = np.array([row["electrons"] for row in truth])
                done = 0
                for a in sorted(mine, key=lambda a: -a["snr"]):
                    x, y, w, h = a["bbox"]
                    if a["snr"] < 40 or done == MOST:
                        break
                    if min(x, y) < 12 or x + w > image["width"] - 12 or y + h > image["height"] - 12:
                        continue
                    # COCO counts from the image's edge, the truth from the centre of the first pixel
                    own = np.argmin(np.hypot(*(places - [a["x_centroid"] - 0.5, a["y_centroid"] - 0.5]).T))
                    reach = 5.0  # what scatters into the box; the ring's median is hardly moved
                    near = ((ways[:, :2].max(axis=1) > x - 0.5 - reach) & (ways[:, :2].min(axis=1) < x + w - 0.5 + reach) &
                            (ways[:, 2:].max(axis=1) > y - 0.5 - reach) & (ways[:, 2:].min(axis=1) < y + h - 0.5 + reach))
                    near[own] = False
                    if electrons[near].sum() > 0.03 * electrons[own]:
                        continue
                    x0, y0, x1, y1 = (int(round(v)) for v in (x, y, x + w, y + h))
                    flux, noise, cx, cy, sigma, peak = light(pixels[exposure], x0, y0, x1, y1)
                    if peak > 0.6 * min(65535, camera["offset_dn"] + camera["full_well_e"] / camera["gain_e_per_dn"]):
                        continue  # charge that blooms or is cut
                    done += 1
                    stars.add((a["norad"], a["v_mag"]))
                    # with the faint ones whose light is in the box too
                    near = ((places[:, 0] >= x0 - 0.5) & (places[:, 0] < x1 - 0.5) &
                            (places[:, 1] >= y0 - 0.5) & (places[:, 1] < y1 - 0.5))
                    expected = electrons[near].sum() / camera["gain_e_per_dn"]
                    true_x, true_y = electrons[near] @ places[near] / electrons[near].sum()
                    ratios.append(flux / expected)
                    self.assertLess(np.hypot(*(places[own] - [a["x_centroid"] - 0.5, a["y_centroid"] - 0.5])), 1e-6)
                    # noise of the light itself, with that of the box
                    allowed = 5 * np.hypot(noise, np.sqrt(electrons[own]) / camera["gain_e_per_dn"]) / expected
                    good = LEAST - allowed < ratios[-1] < GREATEST + allowed
                    spread = 5 * sigma * np.sqrt((x1 - x0) * (y1 - y0) * (max(w, h) ** 2 / 12)) / flux + 0.25
                    off.append((cx - true_x, cy - true_y))
                    good &= abs(off[-1][0]) < spread and abs(off[-1][1]) < spread
                    # the segment that bears its number lies in the box, but for the wings of the brightest
                    mask = segments[exposure] == truth[int(own)]["item"]
                    inside = mask[y0:y1, x0:x1]
                    good &= mask.sum() == 0 or inside.sum() >= 0.85 * mask.sum()
                    sources += good
                    if not good:
                        print(f"  frame {exposure}: {a['object_name'] or 'star'} SNR {a['snr']:.0f} at {x:.1f} {y:.1f}: light "
                              f"{ratios[-1]:.3f} +- {allowed:.3f}, off {off[-1]} of {spread:.2f}, mask {inside.sum()} "
                              f"of {mask.sum()}")
        off = np.array(off).reshape(-1, 2)
        print(f"  {sources} of {len(ratios)} sources; light in the box: median {np.median(ratios or [1]):.4f}; "
              f"centroid off {np.median(off, axis=0) if len(off) else '-'}")
        # radiation hits in a box and hot pixels in a ring
        self.assertGreaterEqual(sources, 0.97 * len(ratios) - 1)
        self.assertTrue(not ratios or 0.9 < np.median(ratios) < 1.04, np.median(ratios or [1]))
        if len(stars) > 20:  # of few stars in a crowded stare it is that of what stands beside them
            self.assertLess(np.hypot(*np.median(off, axis=0)), 0.03 + 0.25 / np.sqrt(len(stars)))
        return sources

    def yolo(self, out, image, annotations):
        name = image["file_name"].replace(".png", ".txt")
        with open(f"{out}.yolo/labels/{name}", encoding="ascii") as file:
            lines = [[float(word) for word in line.split()] for line in file]
        self.assertEqual(len(lines), len(annotations))
        self.assertEqual([line[0] for line in lines], [a["category_id"] - 1 for a in annotations])
        cx, cy, w, h = np.array(lines).reshape(-1, 5)[:, 1:].T
        got = np.array([cx - w / 2, cy - h / 2, w, h]).T * np.tile([image["width"], image["height"]], 2)
        np.testing.assert_allclose(got, np.array([a["bbox"] for a in annotations]).reshape(-1, 4), atol=1e-5)


def tearDownModule():
    runs.clean()


if __name__ == "__main__":
    unittest.main()
