#!/usr/bin/env python3
"""Recorded frames: a run's own frames through the loop again, and `boresight process`.

Usage, from the repository root: /usr/bin/python3 tests/e2e/test_recorded.py BORESIGHT

Frames of NEOSSat are no part of the project. Where the environment variable BORESIGHT_NEOSSAT
names a folder with NEOS_SCI_2024239174545_cord.fits, it is processed too (about 20 s).
"""
import csv
import json
import os
import shutil
import unittest

import numpy
from astropy.io import fits
from astropy.wcs import WCS

import runs
from pictures import write_png, write_table, write_tiff
from runs import call, call_well

CAMERA = "/observers/0/sensors/0/camera/"
MODULES = "/observers/0/sensors/0/modules/"
MAP = os.path.abspath("scenarios/maps/boresight.json")
TABLE_MAP = os.path.abspath("scenarios/maps/table.json")
SOLVE = ("--v-limit", "7.5", "--least-snr", "8", "--catalogue", "embedded", "--quiet")
NEOSSAT = os.path.join(os.environ.get("BORESIGHT_NEOSSAT", ""), "NEOS_SCI_2024239174545_cord.fits")
# tables of what is known only where frames are rendered
OF_RENDERING = {"exposures", "truth", "passes", "sightings"}


def rows(folder, query):
    with runs.database(folder) as tables:
        return [tuple(row) for row in tables.execute(query)]


class Recorded(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        """Three frames of 10 degrees."""
        cls.folder = runs.scratch()
        cls.scenario = os.path.join(cls.folder, "wide.json")
        with open(cls.scenario, "w", encoding="utf-8") as file:
            json.dump({"extends": os.path.abspath(runs.STARE),
                       "set": {CAMERA + "width_px": 300, CAMERA + "height_px": 300,
                               CAMERA + "pixel_scale_arcsec": 120, CAMERA + "aperture_m": 0.04,
                               "/record": {"frames": "extensions", "compression": "rice"}}}, file)
        cls.made = os.path.join(cls.folder, "run")
        runs.run(cls.scenario, cls.made, duration=3)

    def path(self, name):
        return os.path.join(self.folder, name)

    def recorded(self, frames, keyword_map=MAP, **keys):
        return MODULES + "scenegen=" + json.dumps({"type": "recorded", "frames": frames,
                                                   "keyword_map": keyword_map, **keys})

    def test_recorded_frames_give_the_same_results_as_rendered_ones(self):
        self.compare_results(self.recorded(self.made))

    def test_pictures_give_the_same_results_as_rendered_frames(self):
        """16-bit PNG files with a side table; pages of a TIFF file, of the other order of bytes."""
        with fits.open(os.path.join(self.made, "frames.fits")) as file:
            hdus = file[1:]
            folder = self.path("pictures")
            os.mkdir(folder)
            for i, hdu in enumerate(hdus):
                write_png(os.path.join(folder, f"{i}.png"), hdu.data)
            write_table(os.path.join(folder, "night.csv"), hdus, lambda i: f"{i}.png")
            write_tiff(self.path("cube.tif"), [hdu.data for hdu in hdus], ">")
            write_table(self.path("cube.csv"), hdus, lambda i: "cube.tif")
        self.compare_results(self.recorded(folder, TABLE_MAP))
        self.compare_results(self.recorded(self.path("cube.csv"), TABLE_MAP))

    def test_frames_that_others_compressed(self):
        """GZIP_2, RICE_1 of 32 bits, and floats as scaled integers with dithering, in rows, in blocks of several rows and
        columns that do not divide the frame, against astropy's pixels."""
        with fits.open(os.path.join(self.made, "frames.fits")) as file:
            frames, headers = [hdu.data for hdu in file[1:]], [hdu.header for hdu in file[1:]]
        kinds = ((numpy.int32, {"compression_type": "GZIP_2", "tile_size": (140, 110)}),
                 (numpy.int32, {"compression_type": "RICE_1"}),
                 (numpy.float32, {"compression_type": "RICE_1", "quantize_method": 1, "dither_seed": 9999, "quantize_level": 64,
                                  "tile_size": (70, 200)}))
        hdus = [fits.PrimaryHDU()]
        for pixels, header, (kind, options) in zip(frames, headers, kinds):
            kept = fits.Header((key, header[key]) for key in ("DATE-OBS", "EXPTIME", "PIXSCALE", "FRAMEID", "GAIN", "RDNOISE", "OFFSET"))
            hdus.append(fits.CompImageHDU(pixels.astype(kind), kept, **options))
        packed, again = self.path("packed.fits"), self.path("unpacked")
        fits.HDUList(hdus).writeto(packed)
        runs.run(self.scenario, again, self.recorded(packed), duration=3)
        with fits.open(packed) as ours, fits.open(os.path.join(again, "frames.fits")) as read:
            self.assertEqual(len(read), 4)
            self.assertTrue(numpy.any(ours[3].data != numpy.floor(ours[3].data)))
            for a, b in zip(ours[1:], read[1:]):
                numpy.testing.assert_array_equal(b.data, numpy.floor(a.data.astype(float) + 0.5))

    def compare_results(self, scenegen):
        again = runs.scratch()
        runs.run(self.scenario, os.path.join(again, "run"), scenegen, duration=3)
        again = os.path.join(again, "run")
        for name, in rows(self.made, "SELECT name FROM sqlite_master WHERE type = 'table'"):
            if name not in OF_RENDERING:
                with self.subTest(table=name):
                    query = f'SELECT * FROM "{name}"'
                    self.assertEqual(rows(again, query), rows(self.made, query))
        self.assertGreater(len(rows(again, "SELECT * FROM detections")), 100)
        with open(os.path.join(again, "frames.fits"), "rb") as a, \
                open(os.path.join(self.made, "frames.fits"), "rb") as b:
            self.assertEqual(a.read(), b.read())

    def fails(self, *sets, says):
        words = runs.command(self.scenario, self.path("failed"), *sets, duration=3)
        result = call(*words[1:], "--overwrite")
        self.assertEqual(result.returncode, 1, result.stderr)
        for text in says:
            self.assertIn(text, result.stderr)
        self.assertNotIn("Sanitizer", result.stderr)

    def test_wrong_frames_are_refused_with_file_hdu_and_keyword(self):
        frames = os.path.join(self.made, "frames.fits")
        late = self.path("late.fits")
        shutil.copy(frames, late)
        with fits.open(late, mode="update", disable_image_compression=True) as file:
            file[2].header["DATE-OBS"] = "2022-06-16T22:10:01.500000"
        self.fails(self.recorded(late), says=["late.fits: HDU 3: DATE-OBS gives a start 0.5 s later"])
        cut = self.path("cut.fits")
        with open(frames, "rb") as whole, open(cut, "wb") as file:
            file.write(whole.read()[:-30000])
        self.fails(self.recorded(cut), says=["cut.fits: HDU 4: is cut short"])
        wrong = self.path("wrong.json")
        with open(MAP, encoding="utf-8") as file:
            keys = json.load(file)
        keys["exposure_s"] = {"keyword": "EXPOSED"}
        with open(wrong, "w", encoding="utf-8") as file:
            json.dump(keys, file)
        self.fails(self.recorded(frames, wrong),
                   says=["frames.fits: HDU 2: EXPOSED (exposure_s of the map boresight): is missing"])
        dark = self.path("dark.fits")
        shutil.copy(frames, dark)
        with fits.open(dark, mode="update", disable_image_compression=True) as file:
            file[2].header["EXPTIME"] = 0.0
        result = call("process", dark, "--map", "boresight", "--prepare", "--out", self.path("never"), *SOLVE)
        self.assertEqual(result.returncode, 1)
        self.assertIn("dark.fits: HDU 3: EXPTIME (exposure_s of the map boresight) gives 0 (allowed: above 0)", result.stderr)
        self.assertFalse(os.path.exists(self.path("never")))
        self.fails(self.recorded(frames), CAMERA + "width_px=299",
                   says=["frames.fits: HDU 2: NAXIS1 and NAXIS2 give 300 x 300"])

    def compare_wcs(self, folder):
        """The WCS of the processed frames against that of the truth, at middle and corners. The
        first frame is of the end of a slew: its streaks are bright at their ends."""
        places = numpy.array([[149.5, 149.5], [0, 0], [299, 0], [0, 299], [299, 299]])
        with fits.open(os.path.join(folder, "run", "frames.fits")) as a, \
                fits.open(os.path.join(self.made, "frames.fits")) as b:
            self.assertEqual(len(a), len(b))
            for made, true in zip(a[2:], b[2:]):
                sky = WCS(true.header).all_pix2world(places, 0)
                found = WCS(made.header).all_world2pix(sky, 0)
                # 30 stars, rms 0.03 px; the rest is the pixel scale, common to all frames
                self.assertLess(numpy.abs(found - places).max(), 0.1)

    def product(self, folder, name):
        with open(os.path.join(folder, "products", name), encoding="utf-8") as file:
            return list(csv.DictReader(file))

    def compare_light(self, curves):
        """Magnitudes and electrons of the stars against those that were drawn; the zero point comes from the stars."""
        true = {row[:2]: row[2:] for row in rows(self.made, "SELECT exposure_id, id, v_mag, electrons, x_centroid_px,"
                                                 " y_centroid_px FROM truth WHERE kind = 'star' AND in_field = 1")}
        pairs = [(row, true[int(row["frame"]), int(row["id"])]) for row in curves if row["source"] == "star"
                 and float(row["snr"]) > 50 and (int(row["frame"]), int(row["id"])) in true]
        self.assertGreater(len(pairs), 20)
        off = numpy.array([[float(row["v_mag"]) - t[0], 2.5 * numpy.log10(float(row["flux_e"]) / t[1]),
                            float(row["x_px"]) - t[2], float(row["y_px"]) - t[3]] for row, t in pairs])
        # the PSF of the map is not the camera's: some hundredths; light is measured for a PSF of the map's width
        self.assertLess(numpy.abs(numpy.median(off[:, 0])), 0.03)
        self.assertLess(numpy.abs(numpy.median(off[:, 1])), 0.1)
        self.assertLess(numpy.abs(numpy.median(off[:, 2:], axis=0)).max(), 0.03)

    def compare_attitudes(self, attitudes):
        """Middle of the frames and angle of their rows against the WCS of the truth, but for the first, as in compare_wcs."""
        with fits.open(os.path.join(self.made, "frames.fits")) as file:
            self.assertEqual(len(attitudes), len(file) - 1)
            for row, hdu in list(zip(attitudes, file[1:]))[1:]:
                self.assertEqual(float(row["exposure_s"]), hdu.header["EXPTIME"])
                self.assertEqual(row["start_utc"][:22], hdu.header["DATE-OBS"][:22])
                # the middle and one pixel nearer to the first row
                (ra, up_ra), (dec, up_dec) = WCS(hdu.header).all_pix2world([149.5, 149.5], [149.5, 148.5], 0)
                angle = numpy.degrees(numpy.arctan2((up_ra - ra) * numpy.cos(numpy.radians(dec)), up_dec - dec))
                off = [(float(row["ra_deg"]) - ra) * numpy.cos(numpy.radians(dec)), float(row["dec_deg"]) - dec]
                # aberration, of which the catalogue's places are free: 20.5 + 5.2 arcsec; 0.2 px
                self.assertLess(numpy.hypot(*off), 26 / 3600 + 0.2 / 30)
                self.assertLess(abs((float(row["position_angle_deg"]) - angle + 180) % 360 - 180), 0.1)

    def test_process(self):
        out = self.path("processed")
        said = call_well("process", self.made, "--map", "boresight", "--out", out, *SOLVE, timeout=900)
        self.assertIn("attitude from the stars in 3", said)
        self.compare_wcs(out)
        query = "SELECT exposure_id, star_id FROM detections WHERE star_id > 0"
        ours, true = set(rows(os.path.join(out, "run"), query)), set(rows(self.made, query))
        # the onboard PSF of the run is narrower by the jitter, which faint stars notice
        self.assertGreater(len(ours & true), 0.85 * len(true))
        for name in ("report.html", "products/attitudes.csv", "products/light_curves.csv",
                     "products/paths.csv", "input/scenario.json"):
            self.assertTrue(os.path.getsize(os.path.join(out, name)) > 0, name)
        curves = self.product(out, "light_curves.csv")
        self.assertEqual({row["id"] for row in curves if row["source"] == "star"}, {str(star) for _, star in ours})
        self.compare_light(curves)
        self.compare_attitudes(self.product(out, "attitudes.csv"))
        again = call("process", self.made, "--map", "boresight", "--out", out, *SOLVE, timeout=900)
        self.assertEqual(again.returncode, 1)
        self.assertIn("--overwrite", again.stderr)

    def test_files_of_others(self):
        """Real numbers with a blank pixel, a frame a file, out of order, upside down, no WCS."""
        folder = self.path("night")
        os.mkdir(folder)
        with fits.open(os.path.join(self.made, "frames.fits")) as file:
            for i, hdu in enumerate(file[1:]):
                pixels = hdu.data.astype(numpy.float32)[::-1] - 500
                pixels[7, 9] = numpy.nan
                primary = fits.PrimaryHDU(pixels)
                primary.header["WHEN"] = hdu.header["DATE-AVG"][:10]
                primary.header["CLOCK"] = hdu.header["DATE-AVG"][11:]
                primary.header["MSEC"] = 500
                primary.writeto(os.path.join(folder, f"{9 - i}.fits"))
        own = self.path("own.json")
        with open(own, "w", encoding="utf-8") as file:
            json.dump({"boresight_keyword_map": 1, "name": "own", "gain_e_per_dn": {"value": 1.6},
                       "time": {"keyword": "WHEN", "clock_keyword": "CLOCK", "moment": "middle"},
                       "exposure_s": {"keyword": "MSEC", "factor": 0.001},
                       "pixel_scale_arcsec": {"value": 116}, "pedestal_dn": 1000,
                       "camera": {"psf_fwhm_px": 2, "aperture_m": 0.04}}, file)
        out = self.path("others")
        said = call_well("process", folder, "--map", own, "--out", out, *SOLVE, timeout=900)
        self.assertIn("attitude from the stars in 3", said)
        self.assertIn("first row last", said)
        self.compare_wcs(out)

    def test_frames_without_an_attitude_are_a_warning(self):
        wrong = self.path("wrong.json")
        with open(wrong, "w", encoding="utf-8") as file:
            json.dump({"boresight_keyword_map": 1, "name": "wrong", "pixel_scale_arcsec": {"value": 12}}, file)
        result = call("process", self.made, "--map", wrong, "--out", self.path("wrong"), "--prepare", *SOLVE)
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertIn("attitude from the stars in 0", result.stdout)
        self.assertIn("no frame has an attitude", result.stderr)

    @unittest.skipUnless(os.path.exists(NEOSSAT), "BORESIGHT_NEOSSAT names no folder with the frame")
    def test_neossat(self):
        """The science frame: curved streaks of 228 px, by the places that eyes gave."""
        runs.need_full_catalogue()
        out = self.path("neossat")
        call_well("process", NEOSSAT, "--map", "neossat", "--out", out, "--quiet", timeout=1800)
        with open(os.path.join(out, "products", "paths.csv"), encoding="utf-8") as file:
            path = numpy.array([[float(r["dx_px"]), float(r["dy_px"])] for r in csv.DictReader(file)])
        found = numpy.array(rows(os.path.join(out, "run"),
                                 "SELECT x_px, y_px FROM detections WHERE streak = 1 AND label = 'star'"))
        stars = rows(os.path.join(out, "run"), "SELECT stars_identified FROM detection_frames")
        self.assertGreaterEqual(stars[0][0], 8)
        streaks = streaks_seen()
        missed = [number for number, places in streaks
                  if not any(all(numpy.hypot(*(middle + path - place).T).min() <= 3.0 for place in places)
                             for middle in found)]
        # 3 of 104; 8 without the joint fit
        self.assertLessEqual(len(missed), 0.05 * len(streaks), missed)


def streaks_seen():
    """Number and places of the streaks that eyes see on NEOSSat's frame."""
    name = os.path.join(os.path.dirname(os.path.abspath(__file__)), "neossat_streaks.txt")
    with open(name, encoding="utf-8") as file:
        words = [line.split() for line in file if not line.startswith("#")]
    return [(w[0], [numpy.array([float(v.strip("EB")) for v in p.split(",")]) for p in w[2:]])
            for w in words]


def tearDownModule():
    runs.clean()


if __name__ == "__main__":
    unittest.main()
