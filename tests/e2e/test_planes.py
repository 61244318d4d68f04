#!/usr/bin/env python3
"""Noise-free planes and the segmentation mask as a user reads them, with astropy: frames are planes
plus noise, header by header, and each pixel of the mask belongs to the source that its light is of.

Usage, from the repository root: /usr/bin/python3 tests/e2e/test_planes.py BORESIGHT
"""
import os
import unittest

import numpy as np
from astropy.io import fits
from astropy.wcs import WCS

import runs

SCENARIO = "scenarios/frame_by_frame.json"
NAMES = ("stars", "targets", "background", "segmentation", "saturation")
ALL = '/record/planes=["stars", "targets", "background", "segmentation", "saturation"]'
BITPIX = dict(zip(NAMES, (-32, -32, -32, 32, 8)))


def tearDownModule():
    runs.clean()


def images(out, name):
    with fits.open(os.path.join(out, f"{name}.fits")) as hdus:
        return [(hdu.header, hdu.data.astype(float)) for hdu in hdus[1:]]


class Planes(unittest.TestCase):
    binning = 1

    @classmethod
    def setUpClass(cls):
        folder = runs.scratch()
        sets = [f"{runs.SENSOR}/exposure/binning={cls.binning}",
                f"{runs.SENSOR}/camera/full_well_e=3000"]  # some pixels are full
        cls.out, cls.plain = (os.path.join(folder, name) for name in ("planes", "plain"))
        runs.run(SCENARIO, cls.out, ALL, "/record/checksums=true", *sets)
        runs.run(SCENARIO, cls.plain, *sets)
        cls.frames = images(cls.out, "frames")
        cls.planes = {name: images(cls.out, name) for name in NAMES}

    @classmethod
    def on_sensor(cls, pixel):
        """Sensor pixels from a window's first one, of the frame's pixels."""
        return cls.binning * (pixel + 0.5) - 0.5

    def test_off_means_none_and_changes_nothing(self):
        self.assertFalse([n for n in os.listdir(self.plain) if n.split(".")[0] in NAMES])
        for (_, with_planes), (_, without) in zip(self.frames, images(self.plain, "frames")):
            np.testing.assert_array_equal(with_planes, without)

    def test_headers_are_the_frames(self):
        for name, planes in self.planes.items():
            self.assertEqual(len(planes), len(self.frames))
            for (header, data), (frame, pixels) in zip(planes, self.frames):
                self.assertEqual(data.shape, pixels.shape)
                for key in ("FRAMEID", "DATE-OBS", "EXPTIME", "EXTVER", "CRPIX1", "CRPIX2",
                            "CRVAL1", "CRVAL2", "CD1_1", "CD2_1", "WINX0", "PIXSCALE"):
                    self.assertEqual(header[key], frame[key], (name, key))
                self.assertEqual(header["EXTNAME"], name.upper())
                self.assertEqual(header["BITPIX"], BITPIX[name])
                self.assertEqual(header["BUNIT"], "electron" if BITPIX[name] < 0 else "")
                self.assertNotIn("GAIN", header)
            with fits.open(os.path.join(self.out, f"{name}.fits"), checksum=True) as hdus:
                self.assertIn("DATASUM", hdus[1].header)

    def test_frames_are_planes_plus_noise(self):
        with fits.open(os.path.join(self.out, "frames.fits")) as hdus:
            keys = hdus[0].header
        gain, offset, read = keys["GAIN"], keys["OFFSET"], keys["RDNOISE"]
        for k, (_, counts) in enumerate(self.frames):
            mean = sum(self.planes[name][k][1] for name in NAMES[:3])
            sigma = np.sqrt(mean + read ** 2 + gain ** 2 / 12)
            free = self.planes["saturation"][k][1] == 0
            z = (((counts - offset) * gain - mean) / sigma)[free]
            n = len(z)
            # 5 sigma of the mean and of the standard deviation
            self.assertAlmostEqual(z.mean(), 0.0, delta=5 / np.sqrt(n))
            self.assertAlmostEqual(z.std(), 1.0, delta=5 / np.sqrt(2 * n))
            lit = z[(mean > 2 * np.median(mean))[free]]
            self.assertAlmostEqual(lit.mean(), 0.0, delta=5 / np.sqrt(len(lit)))
            self.assertAlmostEqual(lit.std(), 1.0, delta=5 / np.sqrt(2 * len(lit)))

    def test_the_light_is_where_and_as_much_as_truth_says(self):
        rows = runs.database(self.out).execute(
            "SELECT * FROM truth WHERE kind = 'object' ORDER BY exposure_id").fetchall()
        for row, (header, data) in zip(rows, self.planes["targets"]):
            # stamps leave out what is below the tolerance of the noise
            self.assertAlmostEqual(data.sum() / row["electrons"], 1.0, delta=1e-3)
            y, x = np.indices(data.shape)
            x, y = (self.on_sensor(c) for c in (x, y))
            self.assertAlmostEqual((data * x).sum() / data.sum() + header["WINX0"],
                                   row["x_centroid_px"], delta=0.01)
            self.assertAlmostEqual((data * y).sum() / data.sum() + header["WINY0"],
                                   row["y_centroid_px"], delta=0.01)

    def test_the_mask(self):
        with fits.open(os.path.join(self.out, "frames.fits")) as hdus:
            read = hdus[0].header["RDNOISE"]
        tables = runs.database(self.out)
        names = dict(tables.execute("SELECT id, name FROM objects").fetchall())
        self.assertEqual(list(names.values()), ["visitor"])
        for k, (header, mask) in enumerate(self.planes["segmentation"]):
            light = self.planes["stars"][k][1] + self.planes["targets"][k][1]
            level = np.sqrt(self.planes["background"][k][1] + read ** 2)
            # a source above the level alone is also above it with the others' light too
            self.assertTrue(np.all(light[mask > 0] > level[mask > 0] * (1 - 1e-4)))
            # what is above it without an owner is the sum of several that are not
            self.assertLess(np.count_nonzero((mask == 0) & (light > 1.5 * level)), 5)
            items = {row["item"]: row for row in tables.execute(
                "SELECT * FROM truth WHERE exposure_id = ?", (header["FRAMEID"],))}
            found = set(np.unique(mask).astype(int)) - {0}
            self.assertLessEqual(found, set(items))
            target = [i for i, row in items.items() if row["kind"] == "object"][0]
            own = self.planes["targets"][k][1]
            stars = self.planes["stars"][k][1]
            alone = (own > level) & (own > 2 * stars)
            self.assertTrue(np.all(mask[alone] == target))
            self.assertGreater(np.count_nonzero(alone), 20 / self.binning ** 2)
            for i in found:
                y, x = np.nonzero(mask == i)
                row = items[i]
                near = np.hypot(self.on_sensor(x) + header["WINX0"] - row["x_chief_px"],
                                self.on_sensor(y) + header["WINY0"] - row["y_chief_px"])
                self.assertLess(near.min(), 4.0)

    def test_saturated_pixels(self):
        tables = runs.database(self.out)
        with fits.open(os.path.join(self.out, "frames.fits")) as hdus:
            keys = hdus[0].header
        full = keys["OFFSET"] + 3000 / keys["GAIN"]
        seen = 0
        for k, (header, flags) in enumerate(self.planes["saturation"]):
            counts = self.frames[k][1]
            self.assertLessEqual(set(np.unique(flags)), {0, 1})
            seen += np.count_nonzero(flags)
            if self.binning == 1:  # within 6 sigma of the read noise
                margin = 6 * keys["RDNOISE"] / keys["GAIN"] + 1
                self.assertTrue(np.all(np.abs(counts[flags > 0] - full) < margin))
                self.assertTrue(np.all(counts[flags == 0] < full + margin))
            # where there are flags there is a source that says so
            mask = self.planes["segmentation"][k][1]
            saturated = {row["item"] for row in tables.execute(
                "SELECT item FROM truth WHERE exposure_id = ? AND saturated",
                (header["FRAMEID"],))}
            self.assertLessEqual(set(np.unique(mask[flags > 0]).astype(int)) - {0}, saturated)
        self.assertGreater(seen, 3)

    def test_misuse(self):
        for value, words in (('["star"]', "\"stars\", \"targets\""), ('["stars", "stars"]', "twice"),
                             ('"stars"', "array of names")):
            with self.assertRaisesRegex(AssertionError, f"/record/planes.*{words}"):
                runs.run(SCENARIO, os.path.join(runs.scratch(), "run"), f"/record/planes={value}")


class BinnedPlanes(Planes):
    """The same in pixels that are read together."""
    binning = 2

    def test_a_full_converter(self):
        """The sum of four pixels fills it, none of them its well."""
        out = os.path.join(runs.scratch(), "run")
        runs.run(SCENARIO, out, ALL, runs.SENSOR + "/exposure/binning=2",
                 runs.SENSOR + "/camera/full_well_e=1e6", runs.SENSOR + "/camera/bits=13")
        tables = runs.database(out)
        frames, flags = images(out, "frames"), images(out, "saturation")
        light = [sum(planes) for planes in zip(*(
            [data for _, data in images(out, name)] for name in NAMES[:3]))]
        with fits.open(os.path.join(out, "frames.fits")) as hdus:
            keys = hdus[0].header
        top = (8191 - keys["OFFSET"]) * keys["GAIN"]
        seen = 0
        for k, (header, flagged) in enumerate(flags):
            self.assertLessEqual(set(np.unique(flagged)), {0, 2})
            np.testing.assert_array_equal(flagged > 0, frames[k][1] == 8191)
            # sources whose light alone is well above or below the top, by the planes
            for row in tables.execute("SELECT * FROM truth WHERE exposure_id = ? AND in_field",
                                      (header["FRAMEID"],)):
                x, y = ((row[f"{c}_chief_px"] - header[f"WIN{c.upper()}0"] + 0.5) / 2 - 0.5
                        for c in "xy")
                box = light[k][max(int(y) - 2, 0):int(y) + 4, max(int(x) - 2, 0):int(x) + 4]
                if box.max() < 0.6 * top:
                    self.assertFalse(row["saturated"])
                elif box.max() > 1.3 * top and row["kind"] == "object":
                    self.assertTrue(row["saturated"])
                    seen += 1
        self.assertGreater(seen, 2)


class Comatic(unittest.TestCase):
    """Coma moves the light from the chief ray: truth has both places."""

    def test_the_chief_ray_is_the_wcs_and_the_centroid_is_the_light(self):
        out = os.path.join(runs.scratch(), "comatic")
        optics = '"psf": "diffraction", "q": 1.5, "wavelengths": 1, "zernike_nm": 550'
        runs.run(SCENARIO, out, '/record/planes=["targets"]',
                 f'{runs.SENSOR}/camera/optics={{{optics}, "zernike_waves": {{"z7": -0.03, "z8": 0.05}}}}')
        query = "SELECT * FROM truth WHERE kind = 'object' ORDER BY exposure_id"
        rows = runs.database(out).execute(query).fetchall()
        # the light of a sphere comes from beside its centre, with and without coma
        plain = os.path.join(runs.scratch(), "plain")
        runs.run(SCENARIO, plain, f"{runs.SENSOR}/camera/optics={{{optics}}}")
        beside = [[r["x_centroid_px"] - r["x_chief_px"], r["y_centroid_px"] - r["y_chief_px"]]
                  for r in runs.database(plain).execute(query)]
        seen = 0
        for row, of_sphere, (header, data) in zip(rows, beside, images(out, "targets")):
            y, x = np.indices(data.shape)
            light = np.array([(data * x).sum() / data.sum() + header["WINX0"],
                              (data * y).sum() / data.sum() + header["WINY0"]])
            chief = np.array([row["x_chief_px"], row["y_chief_px"]])
            centroid = np.array([row["x_centroid_px"], row["y_centroid_px"]])
            # the mean slope of 2 sqrt(2) (3 r^3 - 2 r) cos(a) over the aperture is 2 sqrt(2) waves
            # per radius, and a wave per radius moves light by 2 lambda F, 2 Q px at 551 nm
            shift = 2 * 1.5 * 550 / 551 * np.sqrt(8) * np.array([0.05, -0.03])
            self.assertLess(np.hypot(*of_sphere), 0.1)
            np.testing.assert_allclose(centroid - chief - of_sphere, shift, atol=0.002)  # of the OTF's table
            place = WCS(header).all_world2pix([[row["ra_deg"], row["dec_deg"]]], 0)[0]
            place += [header["WINX0"], header["WINY0"]]
            np.testing.assert_allclose(chief, place, atol=0.02)  # of a visitor at 300 km
            # the wings of a hard aperture hold 0.9 px / R of the moment beyond R px
            if min(data.shape) == 512 and row["electrons"] > 0:
                np.testing.assert_allclose(light, centroid, atol=0.005)
                seen += 1
        self.assertGreater(seen, 1)


if __name__ == "__main__":
    unittest.main()
