#!/usr/bin/env python3
"""Frames in which nothing is symmetric, judged axis by axis: a sensor that is not square, windows whose corner differs in
x and y, binning, a slanted and bent path of the stars. Wherever a sign, an axis or a factor of binning is confused, these
differ: the light on the recorded pixels, the truth, the detections of image processing and of the observation generator.

Usage, from the repository root: /usr/bin/python3 tests/e2e/test_skewed_frames.py BORESIGHT
"""
import json
import os
import unittest

import numpy as np
from astropy.io import fits
from astropy.wcs import WCS

import runs

WIDTH, HEIGHT, SCALE = 640, 448, 6.0 * np.pi / 648000
RA, DEC, POSITION_ANGLE = 252.565, -8.7495, 0.7  # where the stars in the program reach V 12
EXPOSURE = 1.0
# window, binning, path over the exposure in px (x, y), bend in px (x, y)
CASES = [((0, 0, 640, 448), 1, (0.0, 0.0), (0.0, 0.0)),
         ((0, 0, 640, 448), 1, (17.0, 9.0), (0.0, 0.0)),
         ((48, 16, 560, 416), 1, (-12.0, 15.0), (0.0, 0.0)),
         ((0, 0, 640, 448), 2, (0.0, 0.0), (0.0, 0.0)),
         ((64, 32, 512, 384), 2, (26.0, -15.0), (0.0, 0.0)),
         ((64, 32, 512, 384), 2, (30.0, 17.0), (-2.0, 3.5)),
         ((64, 32, 512, 384), 1, (20.0, 14.0), (-1.2, 1.7))]
REPEATS = 12


def multiply(p, q):
    """Hamilton product, scalar last."""
    (a, b, c, d), (e, f, g, h) = p, q
    return np.array([d * e + a * h + b * g - c * f, d * f - a * g + b * h + c * e,
                     d * g + a * f - b * e + c * h, d * h - a * e - b * f - c * g])


def looking_at(ra, dec, roll):
    """Camera axes from GCRF: +z to the direction, +x turned by roll from east."""
    east = np.array([-np.sin(ra), np.cos(ra), 0.0])
    north = np.array([-np.cos(ra) * np.sin(dec), -np.sin(ra) * np.sin(dec), np.cos(dec)])
    z = np.array([np.cos(ra) * np.cos(dec), np.sin(ra) * np.cos(dec), np.sin(dec)])
    x = np.cos(roll) * east + np.sin(roll) * north
    m = np.array([x, np.cross(z, x), z])
    w = np.sqrt(max(0.0, 1 + m[0, 0] + m[1, 1] + m[2, 2])) / 2
    q = np.array([0.0, 0.0, 0.0, w])
    if w > 0.1:
        q[:3] = np.array([m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1]]) / (4 * w)
    else:
        k = int(np.argmax(np.diag(m)))
        i, j = (k + 1) % 3, (k + 2) % 3
        s = 2 * np.sqrt(1 + m[k, k] - m[i, i] - m[j, j])
        q[k], q[i], q[j], q[3] = s / 4, (m[i, k] + m[k, i]) / s, (m[j, k] + m[k, j]) / s, (m[j, i] - m[i, j]) / s
    return q


def moved(q, x_px, y_px):
    """The attitude in which stars near the axis lie (x, y) px farther: a turn about the camera's y by -x, about x by +y."""
    v = np.array([y_px, -x_px, 0.0]) * SCALE
    half = np.linalg.norm(v) / 2
    turn = np.append(-v / 2 * np.sinc(half / np.pi), np.cos(half))
    return multiply(turn, q)


def updates(path):
    """Writes the file that drives the frames; frame 0 only starts the clock."""
    centre = looking_at(np.radians(RA), np.radians(DEC), POSITION_ANGLE)
    frames = []
    for number in range(len(CASES) * REPEATS):
        window, binning, way, bend = CASES[number // REPEATS]
        dither = 7.3 * np.array([np.cos(2.1 * number), np.sin(3.7 * number)])
        pointing = []
        for k in range(17):
            u = k / 16 - 0.5
            bow = 6 * u * u - 0.5  # as image processing has it: the mean stays
            pointing.append({"time_s": (u + 0.5) * EXPOSURE, "q_cam_from_gcrf": list(moved(
                centre, *(dither + u * np.array(way) + bow * np.array(bend))))})
        frames.append({"frame": number, "window_px": list(window), "binning": binning, "pointing": pointing})
    with open(path, "w", encoding="utf-8") as file:
        json.dump({"boresight_frame_updates": 1, "frames": frames}, file)
    return len(frames)


def scenario(folder, generator):
    """The stare of NEOSSat with a skewed camera that a file drives; the path of its file."""
    with open(runs.STARE, encoding="utf-8") as file:
        base = json.load(file)
    count = updates(os.path.join(folder, "updates.json"))
    for orbit in [o["orbit"] for o in base["world"]["objects"] + base["observers"]]:
        if "elements_file" in orbit:
            orbit["elements_file"] = os.path.abspath(os.path.join("scenarios", orbit["elements_file"]))
    base.pop("$schema", None)
    base["duration_s"] = 2.0 * count
    base["record"] = {**base.get("record", {}), "frames": "extensions", "compression": "none"}  # unpacking takes time
    sensor = base["observers"][0]["sensors"][0]
    sensor["camera"].update(width_px=WIDTH, height_px=HEIGHT, pixel_scale_arcsec=6.0, aperture_m=0.3)
    sensor["camera"].pop("detector", None)
    sensor["exposure"] = {"exposure_s": EXPOSURE, "period_s": 2.0}
    sensor["frame_updates_file"] = "updates.json"
    sensor["observation_source"] = "generator" if generator else "image"
    sensor["modules"] = {"gimbal": {"type": "scripted"}, "scenegen": {"type": "opencl"},
                         "imgproc": {"type": "standard", "delay_s": {"frame": 0.15}},
                         "obsgen": {"type": "statistical"}}
    path = os.path.join(folder, "generator.json" if generator else "images.json")
    with open(path, "w", encoding="utf-8") as file:
        json.dump(base, file)
    return path


ROWS = """SELECT d.exposure_id, d.x_px - t.x_centroid_px AS dx, d.y_px - t.y_centroid_px AS dy, d.cov_xx_px2 AS xx,
    d.cov_xy_px2 AS xy, d.cov_yy_px2 AS yy, t.snr AS snr, d.snr AS seen, d.flux_e AS flux, d.flux_sigma_e AS sigma,
    t.electrons AS electrons, t.x_centroid_px AS x, t.y_centroid_px AS y
    FROM detections d JOIN truth t ON d.exposure_id = t.exposure_id AND t.kind = 'star' AND t.id = d.star_id
    WHERE NOT (d.saturated OR d.edge OR d.blend) AND t.snr > 12"""


def lonely(db):
    """Rows whose star has no other of a tenth of its light within 45 px."""
    stars = {}
    for e, i, x, y, electrons in db.execute(
            "SELECT exposure_id, id, x_centroid_px, y_centroid_px, electrons FROM truth WHERE kind = 'star'"):
        stars.setdefault(e, []).append((x, y, electrons))
    kept = []
    for row in db.execute(ROWS):
        near = sum(np.hypot(x - row["x"], y - row["y"]) < 45 and electrons > 0.1 * row["electrons"]
                   for x, y, electrons in stars[row["exposure_id"]])
        if near == 1:
            kept.append(row)
    return {key: np.array([row[key] for row in kept], float) for key in kept[0].keys()}


def expected_snr(row, case, camera):
    """sqrt(sum s^2 / sigma^2) over the pixels that are read: the path cut into points, each a Gaussian on a grid of
    sixths of a sensor pixel, summed over pixels."""
    window, binning, way, bend = CASES[case]
    fine, half = 6, 24
    edges = (np.arange(2 * half * fine) + 0.5) / fine - half
    grid = np.zeros((2 * half * fine,) * 2)
    # the star's place within a pixel that is read, by its mean place
    corner = [(row[k] - window[j] + 0.5) % binning for j, k in enumerate(("x", "y"))]
    steps = 160 if way != (0.0, 0.0) else 1
    sigma = camera["psf_fwhm_px"] / np.sqrt(8 * np.log(2))
    for k in range(steps):
        u = (k + 0.5) / steps - 0.5
        bow = 6 * u * u - 0.5
        x, y = (corner[j] + u * way[j] + bow * bend[j] for j in range(2))
        grid += np.outer(np.exp(-0.5 * ((edges - y) / sigma) ** 2), np.exp(-0.5 * ((edges - x) / sigma) ** 2))
    side = fine * binning
    cut = grid[:grid.shape[0] // side * side, :grid.shape[1] // side * side]
    image = cut.reshape(cut.shape[0] // side, side, cut.shape[1] // side, side).sum(axis=(1, 3))
    image *= row["electrons"] / grid.sum()
    variance = binning ** 2 * camera["dark_and_sky_e"] + camera["read_noise_e"] ** 2
    return np.sqrt(np.sum(image ** 2) / variance)


class Skewed(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        folder = runs.scratch()
        cls.out = {True: os.path.join(folder, "generator"), False: os.path.join(folder, "images")}
        files = {generator: scenario(folder, generator) for generator in cls.out}
        runs.parallel(lambda generator: runs.run(files[generator], cls.out[generator],
                                                 "/record/frames=extensions"), cls.out)
        cls.rows = {generator: lonely(runs.database(out)) for generator, out in cls.out.items()}

    def cases(self):
        for generator in (False, True):
            for case in range(len(CASES)):
                rows = self.rows[generator]
                mine = rows["exposure_id"] // REPEATS == case
                yield ("generator" if generator else "images", case,
                       {key: values[mine] for key, values in rows.items()})

    def test_detections_lie_where_the_light_is(self):
        for name, case, r in self.cases():
            n = len(r["dx"])
            self.assertGreater(n, 30, (name, case))
            # 0.5 px of binning or a swapped axis shows as a mean of tenths of a pixel
            means = np.median(r["dx"]), np.median(r["dy"])
            self.assertLess(np.hypot(*means), 0.02, (name, case))

    def test_covariances_lie_along_the_path(self):
        for name, case, r in self.cases():
            way, bend = np.array(CASES[case][2]), CASES[case][3]
            matrix = np.array([[r["xx"], r["xy"]], [r["xy"], r["yy"]]]).transpose(2, 0, 1)
            values, vectors = np.linalg.eigh(matrix)
            offset = np.array([r["dx"], r["dy"]]).T
            normal = np.einsum("nij,ni->nj", vectors, offset) / np.sqrt(values)
            # normal deviates on the short and the long axis: the median of their squares is 0.455
            spread = np.median(normal ** 2, axis=0) / 0.455
            slope = np.median(r["xy"] / np.sqrt(r["xx"] * r["yy"]))
            print(f"{name} case {case}: {len(offset)} stars, short and long axis {spread.round(2)}, correlation "
                  f"{slope:+.2f}")
            if any(way) and not any(bend):
                self.assertEqual(np.sign(slope), np.sign(way[0] * way[1]), (name, case))
                along = np.abs(vectors[:, :, 1] @ way) / np.hypot(*way)
                self.assertGreater(np.median(along), 0.97, (name, case))
            # 5 sigma of a median of squares of n normal deviates (relative 2.3 / sqrt(n) each); a bent path is known
            # less well than its stars show, because the bend itself is uncertain
            margin = 5 * 2.3 / np.sqrt(len(offset))
            self.assertLess(np.max(np.log(spread)), max(margin, 0.5), (name, case))
            if not any(bend):
                self.assertGreater(np.min(np.log(spread)), -max(margin, 0.5), (name, case))

    def test_light_and_signal_to_noise(self):
        for name, case, r in self.cases():
            db = runs.database(self.out[name == "generator"])
            sky, dark = db.execute("SELECT background_e, dark_e FROM exposures WHERE exposure_id = ?",
                                   (case * REPEATS,)).fetchone()
            with open(os.path.join(self.out[False], "scenario.json"), encoding="utf-8") as file:
                camera = json.load(file)["observers"][0]["sensors"][0]["camera"]
            camera["dark_and_sky_e"] = sky + dark
            self.assertLess(abs(np.median(r["flux"] / r["electrons"]) - 1), 0.01, (name, case))
            spread = np.median(np.abs(r["flux"] - r["electrons"]) / r["sigma"]) / 0.6745
            self.assertLess(abs(np.log(spread)), 4 * 1.17 / np.sqrt(len(r["x"])), (name, case, spread))  # 4 sigma of a median
            ratio = []
            for k in range(0, len(r["x"]), 16):
                row = {key: values[k] for key, values in r.items()}
                ratio.append(row["snr"] / expected_snr(row, case, camera))
            # the detection's SNR is its flux over the same noise; straight trails lose some by their templates
            seen = np.median(r["seen"] / r["flux"] * r["electrons"] / r["snr"])
            if not any(CASES[case][3]):
                self.assertTrue(0.9 < seen < 1.15, (name, case, seen))
            print(f"{name} case {case}: true SNR over the sum over pixels {np.median(ratio):.3f}")
            if any(CASES[case][3]):
                continue  # a bend counts as blur in the truth's SNR, which is 15 to 30 % low then
            # the truth's SNR is that of the mean place within a pixel; of points with binned pixels it varies by 6 %
            # with the place, and these are the same stars again and again
            self.assertLess(abs(np.median(ratio) - 1), 0.01 if any(CASES[case][2]) or CASES[case][1] == 1 else 0.07,
                            (name, case))

    def test_headers_of_windows_and_binning(self):
        """Stars of the truth through each header's WCS, by astropy, at their binned pixels of the window."""
        db = runs.database(self.out[False])
        rows = {row["exposure_id"]: row for row in db.execute("SELECT * FROM frames")}
        with fits.open(os.path.join(self.out[False], "frames.fits")) as hdus:
            for hdu in hdus[1:]:
                header, number = hdu.header, hdu.header["FRAMEID"]
                window, binning, way, bend = CASES[number // REPEATS]
                self.assertEqual([header[k] for k in ("WINX0", "WINY0", "BINNING")], [*window[:2], binning])
                self.assertEqual([rows[number][k] for k in ("x0_px", "y0_px", "width_px", "height_px", "binning")],
                                 [*window, binning])
                self.assertEqual(header["PIXSCALE"], 6.0 * binning)
                # full pixels hold as many electrons each; counts end with the converter
                self.assertEqual((header["GAIN"], header["RDNOISE"]), (1.6, 8.0))
                stars = np.array([tuple(row) for row in db.execute(
                    "SELECT ra_deg, dec_deg, x_chief_px, y_chief_px FROM truth WHERE exposure_id = ? AND kind = 'star'"
                    " AND in_field", (number,))])
                self.assertGreater(len(stars), 5)
                x, y = WCS(header).all_world2pix(stars[:, 0], stars[:, 1], 0)
                places = (stars[:, 2:] - window[:2] - 0.5 * (binning - 1)) / binning
                # the header's WCS is good to a thousandth of a pixel
                self.assertLess(np.hypot(x - places[:, 0], y - places[:, 1]).max(), 2e-3, number)
                # the table's is that of the whole sensor
                row = rows[number]
                self.assertAlmostEqual(header["CRPIX1"], (row["crpix1"] - 1 - window[0] - 0.5 * (binning - 1)) / binning + 1,
                                       delta=1e-9)
                self.assertAlmostEqual(header["CRPIX2"], (row["crpix2"] - 1 - window[1] - 0.5 * (binning - 1)) / binning + 1,
                                       delta=1e-9)

    def test_recorded_pixels_are_where_the_truth_says(self):
        """First moments of the brightest lonely stars on the recorded pixels, against the truth."""
        r, offsets = self.rows[False], {case: [] for case in range(len(CASES))}
        with fits.open(os.path.join(self.out[False], "frames.fits")) as hdus:
            images = [h.data.astype(float) for h in hdus if h.data is not None and h.data.ndim == 2]
            images = [image - np.median(image) for image in images]
            for k in np.argsort(-r["electrons"]):
                number = int(r["exposure_id"][k])
                case = number // REPEATS
                window, binning, way, bend = CASES[case]
                if len(offsets[case]) >= 20:
                    continue
                image = images[number]
                self.assertEqual(image.shape, (window[3] // binning, window[2] // binning))
                reach = np.array([abs(way[j]) / 2 + abs(bend[j]) + 7 for j in range(2)]) / binning
                place = [(r[axis][k] - window[j] - 0.5 * (binning - 1)) / binning for j, axis in enumerate("xy")]
                x0, y0 = np.round(np.array(place) - reach).astype(int)
                x1, y1 = np.round(np.array(place) + reach).astype(int) + 1
                if x0 < 3 or y0 < 3 or x1 > image.shape[1] - 3 or y1 > image.shape[0] - 3:
                    continue
                light = image[y0:y1, x0:x1]
                yy, xx = np.mgrid[y0:y1, x0:x1]
                offsets[case].append([binning * (np.sum(light * xx) / light.sum() - place[0]),
                                      binning * (np.sum(light * yy) / light.sum() - place[1])])
        for case, found in offsets.items():
            self.assertGreater(len(found), 8, case)
            middle = np.median(found, axis=0)
            print(f"case {case}: light of {len(found)} stars {middle.round(3)} px from the truth")
            # moments of a box are pulled by its noise and by faint neighbours: a tenth of a pixel; a shift of the
            # binning's half pixel or of a window's corner is more
            self.assertLess(np.abs(middle).max(), 0.15, case)


def tearDownModule():
    runs.clean()


if __name__ == "__main__":
    unittest.main()
