"""Columns of run.sqlite and keys of frames.fits that tell the truth, against numbers of our own."""
import os

import erfa
import numpy as np
from astropy.io import fits
from astropy.time import Time, TimeDelta
from astropy.wcs import WCS

import figures
import optics
from optics import ARCSEC, angle, columns, quaternion, rotate, turn_between, unit
from skewed_scene import DURATION_S, EXPOSURE_S, NORAD, PERIOD_S, SUN_V_MAG, TELEMETRY_HZ, TICKS, WINDOW


class TruthTables:
    """Tests of a SkewedRun: exposures, line of sight, places and light of sources, frames."""

    # ---------------------------------------------------------------- the truth

    def test_exposures(self):
        epoch = Time(self.scene["epoch_utc"], scale="utc")
        camera = self.sensor["camera"]
        pupil = np.pi / 4 * 0.2 ** 2 * (1 - 0.2)
        per_mag0 = camera["photon_flux_v0_per_s_m2"] * pupil * camera["throughput"] * camera["quantum_efficiency"]
        sky_e = per_mag0 * 10 ** (-0.4 * camera["background_mag_arcsec2"]) * 3 * 3 * EXPOSURE_S
        self.assertEqual([e["exposure_id"] for e in self.exposures], list(range(DURATION_S)))
        for e in self.exposures:
            k = e["exposure_id"]
            self.assertEqual((e["start_tick"], e["end_tick"], e["dropped"]),
                             (k * TICKS * PERIOD_S, (k * PERIOD_S + EXPOSURE_S) * TICKS, 0))
            self.assertAlmostEqual(e["mid_s"], k * PERIOD_S + EXPOSURE_S / 2, delta=1e-12)
            mid = e["mid_s"]
            # ERFA against ERFA with Earth orientation: metres in low orbit
            self.close(columns(e, "observer_gcrf", tail="_m"), self.eye.position(mid), 1.0)
            self.close(columns(e, "observer_gcrf", tail="_mps"), self.velocity(self.eye, mid, 0.1), 0.05)
            utc = epoch + TimeDelta(mid, format="sec")
            earth = erfa.epv00(utc.tt.jd1, utc.tt.jd2)
            earth_bary = np.array(earth[1]["v"]) * optics.AU_M / 86400
            self.close(columns(e, "velocity_bary", tail="_mps") - columns(e, "observer_gcrf", tail="_mps"), earth_bary, 0.01)
            # the Sun where it is; light time is worth 4000 km of 1.5e8
            self.close(columns(e, "sun", tail="_m"), -np.array(earth[0]["p"]) * optics.AU_M -
                       columns(e, "observer_gcrf", tail="_m"), 5e6)
            self.close([e["boresight_x_px"], e["boresight_y_px"]], self.camera.centre, 1e-9)
            self.assertEqual(e["pixel_scale_arcsec"], 3.0)
            self.assertAlmostEqual(e["dark_e"], 2.5, delta=1e-9)
            if e["earth_fraction"] == 0:
                self.assertAlmostEqual(e["background_e"] / sky_e, 1, delta=1e-5)
            self.assertEqual((e["sources"], e["lost"]), (len(self.in_frame["truth"][k]), 0))
            self.assertEqual((e["hits"], e["hits_e"]), (0, 0))
            if self.SOURCE == "generator":
                self.assertEqual((e["error_sigma"], e["nodes"]), (None, 0))
            elif e["earth_fraction"] == 0:
                self.assertTrue(0 < e["error_sigma"] < 0.06, e["error_sigma"])
                self.assertGreaterEqual(e["nodes"], e["sources"])
            # the boresight and the attitudes, from the line of sight as it was recorded
            self.close(rotate(optics.conjugate(quaternion(e, "q_cam_from_gcrf_mean")), [0, 0, 1]),
                       unit(e["boresight_ra_deg"], e["boresight_dec_deg"]), 1e-12)
            mean = quaternion(e, "q_cam_from_gcrf_mean")
            ticks = range(e["start_tick"], e["end_tick"] + 1, TICKS // TELEMETRY_HZ)
            turns = np.array([turn_between(quaternion(self.los[t], "q_cam_from_gcrf"), mean) for t in ticks])
            weights = np.ones(len(turns))
            weights[0] = weights[-1] = 0.5  # trapezoid
            across = weights @ turns / weights.sum() / ARCSEC
            # jitter of 0.2 px RMS between the samples, and what the mean of a slew is off by with its samples
            most = np.abs(turns).max() / ARCSEC
            self.assertLess(np.hypot(*across[:2]), 0.3 + 0.006 * most, k)
            self.assertLess(abs(across[2]), 1.5 + 0.01 * most, k)
            self.close(turn_between(quaternion(self.los[round(mid * TICKS)], "q_cam_from_gcrf"),
                                    quaternion(e, "q_cam_from_gcrf_mid")), 0, 1e-12)

    def test_line_of_sight(self):
        self.assertEqual(len(self.los), TELEMETRY_HZ * DURATION_S)
        for tick, row in self.los.items():
            self.assertAlmostEqual(row["time_s"], tick / TICKS, delta=1e-12)
            self.close(rotate(optics.conjugate(quaternion(row, "q_cam_from_gcrf")), [0, 0, 1]),
                       unit(row["ra_deg"], row["dec_deg"]), 1e-12)

    def test_places_of_sources(self):
        """Pixels of all sources from their directions, at the start, in the middle and at the end."""
        checked = {"star": 0, "object": 0}
        for e in self.exposures:
            rows = self.in_frame["truth"][e["exposure_id"]]
            ticks = np.array(range(e["start_tick"], e["end_tick"] + 1, TICKS // TELEMETRY_HZ))
            attitudes = [quaternion(self.los[t], "q_cam_from_gcrf") for t in ticks]
            for row in rows:
                self.assertEqual(row["mid_s"], e["mid_s"])
                if row["x_start_px"] is None or row["x_end_px"] is None:
                    continue
                if row["kind"] == "star":
                    along = [optics.apparent(e, unit(row["ra_deg"], row["dec_deg"]), star=True)] * len(ticks)
                else:
                    place = self.target.position if row["id"] == 0 else self.neighbour
                    along = self.apparent_path(e, place, ticks / TICKS)
                path = self.camera.pixels(rotate(attitudes, along))
                if np.abs(path[-1] - path[0]).max() > 30:
                    continue  # slews: the ends are sharp, the samples between them too few
                # 1 m of orbits at 4e7 m is 0.0017 px
                near = 1e-4 if row["kind"] == "star" else 3e-3
                for when, expected in (("start", path[0]), ("mid", path[len(path) // 2]), ("end", path[-1])):
                    self.close([row[f"x_{when}_px"], row[f"y_{when}_px"]], expected, near, tuple(row), when)
                weights = np.ones(len(path))
                weights[0] = weights[-1] = 0.5
                mean = weights @ path / weights.sum()
                self.close([row["x_chief_px"], row["y_chief_px"]], mean, 0.12, e["exposure_id"])
                self.close([row["x_centroid_px"] - row["x_chief_px"], row["y_centroid_px"] - row["y_chief_px"]], 0, 1e-9)
                first, size = np.array(WINDOW[:2]), np.array(WINDOW[2:])
                inside = np.all(mean > first - 0.5) and np.all(mean < first + size - 0.5)
                if np.all(np.abs(mean - first - (size - 1) / 2) < size / 2 - 2) or not inside:
                    self.assertEqual(row["in_field"], int(inside))
                checked[row["kind"]] += 1
        self.assertGreater(checked["star"], 250)
        self.assertGreater(checked["object"], 50)

    def light_of(self, v_mag):
        camera = self.sensor["camera"]
        return (camera["photon_flux_v0_per_s_m2"] * np.pi / 4 * 0.2 ** 2 * 0.8 * camera["throughput"] *
                camera["quantum_efficiency"] * EXPOSURE_S * 10 ** (-0.4 * v_mag))

    def test_light_of_sources(self):
        sigma2, ratios = 4 / (8 * np.log(2)), []  # of the PSF, 2 px FWHM
        for e in self.exposures:
            b = self.BINNING
            noise = np.sqrt(b ** 2 * (e["background_e"] + e["dark_e"]) + 8 ** 2)
            for item, row in enumerate(self.in_frame["truth"][e["exposure_id"]], 1):
                self.assertEqual(row["item"], item)
                if row["electrons"] > 0:
                    self.assertAlmostEqual(row["electrons"] / self.light_of(row["v_mag"]), 1, delta=1e-6)
                if row["x_start_px"] is None or row["x_end_px"] is None:
                    continue
                swept = np.hypot(row["x_end_px"] - row["x_start_px"], row["y_end_px"] - row["y_start_px"])
                if swept < 0.5 and row["electrons"] > 0:
                    # a sampled Gaussian, its pixels of b x b as a convolution with a box: sum s^2 is
                    # N^2 b^2 / (4 pi (sigma^2 + b^2/12)), the mean over places within a pixel, to 1 %; jitter of 0.14 px
                    # an axis widens it by 3 %, and short ways by as much; the place within a binned pixel is worth 6 %
                    ideal = b * row["electrons"] / np.sqrt(4 * np.pi * (sigma2 + b ** 2 / 12)) / noise
                    ratios.append(row["snr"] / ideal)
                    self.assertTrue(0.93 - 0.05 * (b > 1) < ratios[-1] < 1.02 + 0.05 * (b > 1), ratios[-1])
                    # of a Gaussian of 2 px in the brightest pixel: 0.2 of its light, or 0.3 to 0.6 of it in one of 2 x 2
                    low, high = (0.2, 0.2) if b == 1 else (0.3, 0.6)
                    if not 0.7 < row["electrons"] * high / 1e5 or row["electrons"] * low / 1e5 > 1.4:
                        self.assertEqual(row["saturated"], int(row["electrons"] * low > 1e5))
                if row["kind"] == "star":
                    self.assertEqual((row["norad"], row["sunlit_fraction"], row["phase_deg"], row["range_m"], row["occulted"]),
                                     (0, None, None, None, 0))
                    continue
                place, info = (self.target.position, (4, 0.25)) if row["id"] == 0 else (self.neighbour, (1, 0.3))
                direction, there, _ = self.seen_from(e, place, e["mid_s"])
                self.assertEqual(row["norad"], NORAD if row["id"] == 0 else 0)
                # SGP4 to 1 m, of 4e7 m; the second's frame turns with the first's velocity
                self.assertLess(angle(direction, unit(row["ra_deg"], row["dec_deg"])), 1e-7)
                here = columns(e, "observer_gcrf", tail="_m")
                far = np.linalg.norm(there - here)
                self.assertAlmostEqual(row["range_m"], far, delta=3)
                sun = columns(e, "sun", tail="_m") + here - there
                phase = angle(sun, here - there)
                self.assertAlmostEqual(row["phase_deg"], np.degrees(phase), delta=0.01)
                self.assertEqual(row["sunlit_fraction"], 1.0)
                au = np.linalg.norm(sun) / optics.AU_M
                ratio = (2 * info[0] * info[1] * ((np.pi - phase) * np.cos(phase) + np.sin(phase)) /
                         (3 * np.pi ** 2 * far ** 2 * au ** 2))
                self.assertAlmostEqual(row["v_mag"], SUN_V_MAG - 2.5 * np.log10(ratio), delta=2e-3)
                self.assertEqual(row["occulted"], int(figures.sight(here, there) is False))


    # ---------------------------------------------------------------- frames

    def test_frames_and_headers(self):
        """The table `frames`, the headers and the WCS, against the exposures and the camera."""
        epoch = Time(self.scene["epoch_utc"], scale="utc")
        camera = self.sensor["camera"]
        zero_point = 2.5 * np.log10(self.light_of(0) / EXPOSURE_S)
        b, corner = self.BINNING, np.array(WINDOW[:2])
        grid = np.array([(x, y) for x in np.linspace(corner[0], corner[0] + WINDOW[2] - 1, 9)
                         for y in np.linspace(corner[1], corner[1] + WINDOW[3] - 1, 7)])
        misfits, quiet = [], {e["exposure_id"] for e in self.tracking()}
        with fits.open(os.path.join(self.out, "frames.fits")) as hdus:
            self.assertEqual(len(hdus), len(self.exposures) + 1)
            first = hdus[0].header
            for key, value in (("TELESCOP", "neossat"), ("OBSERVER", "neossat"), ("INSTRUME", "telescope"),
                               ("OBJECT", "INMARSAT GX5"), ("APTDIA", 0.2), ("DARKCUR", 5), ("BUNIT", "adu")):
                self.assertEqual(first[key], value, key)
            for frame, e, hdu in zip(self.tables["frames"], self.exposures, hdus[1:]):
                h, k = hdu.header, e["exposure_id"]
                start = epoch + TimeDelta(k * PERIOD_S, format="sec")
                self.assertEqual([frame[c] for c in ("sensor", "exposure_id", "start_tick", "end_tick", "start_s", "exposure_s",
                                                     "x0_px", "y0_px", "width_px", "height_px", "binning", "bits", "fits_index")],
                                 [0, k, e["start_tick"], e["end_tick"], k * PERIOD_S, EXPOSURE_S, *WINDOW, b, 16, k + 1])
                self.assertLess(abs((Time(frame["start_utc"].rstrip("Z"), scale="utc") - start).sec), 1e-6)
                for key, later in (("DATE-OBS", 0), ("DATE-BEG", 0), ("DATE-AVG", 0.25), ("DATE-END", 0.5)):
                    self.assertLess(abs((Time(h[key], scale="utc") - start).sec - later), 1e-6, key)
                    mjd = "MJD" + key[4:]
                    self.assertLess(abs((Time(h[mjd], format="mjd", scale="utc") - start).sec - later), 1e-6, mjd)
                for key, value in (("EXPTIME", 0.5), ("GAIN", 1.6), ("RDNOISE", 8), ("OFFSET", 500), ("BITS", 16),
                                   ("PIXSCALE", 3 * b), ("WINX0", WINDOW[0]), ("WINY0", WINDOW[1]), ("BINNING", b),
                                   ("FRAMEID", k), ("EXTVER", k + 1),
                                   ("INSTRUME", "telescope"), ("OBSERVER", "neossat"), ("OBJECT", "INMARSAT GX5"),
                                   ("EARTHFRC", e["earth_fraction"]), ("MOONFRC", 0), ("SUNFRC", 0)):
                    self.assertEqual(h[key], value, key)
                self.assertAlmostEqual(h["ZEROPNT"], zero_point, delta=1e-6)
                # the well of 100000 e- of 1.6 e- a count, or the end of the converter
                self.assertAlmostEqual(h["SATURATE"], min(500 + 1e5 / 1.6, 65535), delta=1)
                for axis in "XYZ":
                    self.assertAlmostEqual(h["OBSPOS" + axis], e[f"observer_gcrf_{axis.lower()}_m"], delta=1e-5)
                    self.assertAlmostEqual(h["OBSVEL" + axis], e[f"observer_gcrf_{axis.lower()}_mps"], delta=1e-8)
                # the table's WCS is that of the whole sensor, in its own pixels
                for axis in (1, 2):
                    self.assertAlmostEqual(h[f"CRPIX{axis}"], (frame[f"crpix{axis}"] - 0.5 - WINDOW[axis - 1]) / b + 0.5,
                                           delta=1e-9)
                for key, column, scale in (("CRVAL1", "crval1_deg", 1), ("CRVAL2", "crval2_deg", 1), ("CD1_1", "cd1_1_deg", b),
                                           ("CD1_2", "cd1_2_deg", b), ("CD2_1", "cd2_1_deg", b), ("CD2_2", "cd2_2_deg", b),
                                           ("WCSRESID", "wcs_residual_px", 1 / b)):
                    self.assertAlmostEqual(h[key], frame[column] * scale, delta=1e-12 + 1e-13 * abs(frame[column]), msg=key)
                if k % 3 and e["earth_fraction"] == 0:
                    continue  # astropy's WCS takes most of the time; its keys are those of the table in each frame
                # catalogue places through aberration, mean attitude and camera, and through astropy's TAN-SIP
                back = rotate(optics.conjugate(quaternion(e, "q_cam_from_gcrf_mean")), self.camera.directions(grid))
                place = optics.geometric(e, back, star=True)
                ra, dec = np.degrees(np.arctan2(place[:, 1], place[:, 0])), np.degrees(np.arcsin(place[:, 2]))
                wcs = WCS(h)
                seen = (np.array(wcs.all_world2pix(ra, dec, 0)).T + 0.5) * b - 0.5 + corner
                misfits.append(np.hypot(*(seen - grid).T).max())
                self.assertLess(misfits[-1], 2e-3, k)
                if k in quiet:
                    self.assertAlmostEqual(misfits[-1], frame["wcs_residual_px"], delta=2e-5)
                self.close(wcs.pixel_to_world_values(*((grid - corner + 0.5) / b - 0.5).T)[1], dec, 2e-3 * 3 / 3600)
        print(f"WCS against aberration and camera: at most {max(misfits):.1e} px off")

    def test_pixels(self):
        """Background and noise of the frames as detections report them, from the pixels."""
        with fits.open(os.path.join(self.out, "frames.fits")) as hdus:
            for d in self.tables["detection_frames"]:
                e = self.exposures[d["exposure_id"]]
                if e["earth_fraction"] > 0 or e["sources"] > 50:
                    continue  # trails of the slew are no background
                electrons = (hdus[d["exposure_id"] + 1].data.astype(float) - 500) * 1.6
                middle = np.median(electrons)
                noise = 1.4826 * np.median(np.abs(electrons - middle))
                # counts are steps of 1.6 e-; the mean of what is below 3 sigma is finer than the median
                kept = electrons[np.abs(electrons - middle) < 3 * noise]
                light = self.BINNING ** 2 * (e["background_e"] + e["dark_e"])
                self.assertAlmostEqual(kept.mean(), light, delta=0.15)
                self.assertAlmostEqual(d["background_e"], kept.mean(), delta=0.3)
                self.assertAlmostEqual(d["noise_e"] / np.sqrt(light + 64 + 1.6 ** 2 / 12), 1, delta=0.02)
