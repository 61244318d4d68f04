#!/usr/bin/env python3
"""The Earth in the field of a camera with a uniform background: what is drawn, hidden, flagged,
counted and warned of, against rays from the header's WCS to the ellipsoid.

Usage, from the repository root: /usr/bin/python3 tests/e2e/test_earth_in_field.py BORESIGHT
"""
import os
import re
import subprocess
import unittest
import warnings

import erfa
import numpy as np
from astropy.io import fits
from astropy.time import Time
from astropy.wcs import WCS, FITSFixedWarning
from sgp4.api import Satrec

import runs

A_M, F, AU_M = 6378137.0, 1 / 298.257223563, 149597870700.0
EPOCH = Time("2022-06-16T22:10:00", scale="utc")
NEOSSAT = 39089
CAMERA = runs.SENSOR + "/camera"


def observer_km():
    with open("scenarios/catalogue_2022-06.tle", encoding="ascii") as file:
        lines = file.read().splitlines()
    k = next(i for i, line in enumerate(lines) if line.startswith(f"1 {NEOSSAT}"))
    return np.array(Satrec.twoline2rv(lines[k], lines[k + 1]).sgp4(EPOCH.jd1, EPOCH.jd2)[1])


def limb_direction(azimuth_deg, inside_deg):
    """Right ascension and declination of a place near the limb; TEME for GCRF is 0.3 deg off."""
    r = observer_km()
    n = np.linalg.norm(r)
    b = np.arcsin(6371.0 / n) - np.radians(inside_deg)
    down = -r / n
    east = np.cross([0, 0, 1], r)
    east /= np.linalg.norm(east)
    a = np.radians(azimuth_deg)
    side = np.cos(a) * np.cross(r / n, east) + np.sin(a) * east
    d = np.cos(b) * down + np.sin(b) * side
    return np.degrees(np.arctan2(d[1], d[0])) % 360, np.degrees(np.arcsin(d[2]))


def sets(ra, dec, *more):
    return (f'{runs.SENSOR}/cue={{"direction_radec_deg": [{ra}, {dec}]}}',
            f"{CAMERA}/pixel_scale_arcsec=18", f"{CAMERA}/width_px=256", f"{CAMERA}/height_px=256",
            "/record/frames=extensions", *more)


def hits_of(header, shape):
    """Where rays of the pixels meet the ellipsoid: Earth's-axis coordinates in m, NaN beside it."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", FITSFixedWarning)
        wcs = WCS(header)
    y, x = np.mgrid[0:shape[0], 0:shape[1]]
    ra, dec = np.radians(wcs.all_pix2world(x, y, 0))
    star = np.stack([np.cos(dec) * np.cos(ra), np.cos(dec) * np.sin(ra), np.sin(dec)], -1)
    t = Time(header["DATE-AVG"], scale="utc")
    turn = erfa.pmat06(t.tt.jd1, t.tt.jd2)
    eye = np.array([header[f"OBSPOS{c}"] for c in "XYZ"])
    # the WCS absorbs all aberration; light from the Earth has only that of the observer about it
    earth = np.array(erfa.epv00(t.tt.jd1, t.tt.jd2)[1]["v"]) * AU_M / 86400 / 299792458.0
    star = star + earth - np.sum(star * earth, -1, keepdims=True) * star
    star /= np.linalg.norm(star, axis=-1, keepdims=True)
    scale = np.array([1, 1, 1 / (1 - F)]) / A_M
    p, d = turn @ eye * scale, star @ turn.T * scale
    dd, pd, pp = np.sum(d * d, -1), d @ p, p @ p - 1
    root = pd ** 2 - dd * pp
    way = np.where((root > 0) & (pd < 0), (-pd - np.sqrt(np.maximum(root, 0))) / dd, np.nan)
    return (p + way[..., None] * d) / scale, turn


def sun_and_moon(t, turn):
    sun = -np.array(erfa.epv00(t.tt.jd1, t.tt.jd2)[0]["p"])
    moon = np.array(erfa.moon98(t.tt.jd1, t.tt.jd2)["p"])
    return turn @ sun, turn @ moon


class Drawn(unittest.TestCase):
    def frame(self, azimuth, inside, exposure_s, *more):
        out = os.path.join(runs.scratch(), "limb")
        words = runs.command(runs.STARE, out, *sets(*limb_direction(azimuth, inside),
                             f"{runs.SENSOR}/exposure/exposure_s={exposure_s}", *more), duration=2)
        done = subprocess.run(words, capture_output=True, text=True, timeout=600)
        self.assertEqual(done.returncode, 0, done.stderr)
        with fits.open(os.path.join(out, "frames.fits")) as hdus:
            return out, hdus[1].header, hdus[1].data.astype(float), done.stderr

    def test_day_night_and_limb(self):
        # a quarter of each azimuth's field is sky; the bright ones through a dark filter
        counted = [0, 0]
        for azimuth in (0, 90, 180, 270):
            out, header, image, printed = self.frame(
                azimuth, 0.3, 0.5, f"{CAMERA}/throughput=1e-6", f"{CAMERA}/read_noise_e=1",
                f"{CAMERA}/background/limb_scale_height_m=0")
            points, turn = hits_of(header, image.shape)
            covered = np.isfinite(points[..., 0])
            # a lattice of 33 places a side
            self.assertAlmostEqual(header["EARTHFRC"], covered.mean(), delta=0.04)
            self.assertGreater(covered.mean(), 0.3)
            normal = points / np.array([1, 1, (1 - F) ** 2])
            normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
            sun, _ = sun_and_moon(Time(header["DATE-AVG"], scale="utc"), turn)
            lit = normal @ (sun / np.linalg.norm(sun))
            # Lambert's law by hand: albedo 0.3, V -26.74 at 1 au, V 0 is 3.6e10 photons /s/m2
            flux = 3.6e10 * np.pi / 4 * 0.15 ** 2 * 1e-6 * 0.7 * 0.5
            expected = 0.3 / np.pi * lit * 10 ** (0.4 * 26.74) / np.sum(sun ** 2) * flux * \
                np.radians(18 / 3600) ** 2
            electrons = (image - 500) * 1.6
            day = covered & (lit > 0.02) & (expected < 60000) & (expected > 300)
            day[:4], day[-4:], day[:, :4], day[:, -4:] = False, False, False, False
            # three pixels from the limb, where PSF and smear have no share
            inner = day & np.isfinite(np.roll(points[..., 0], 5, 0) + np.roll(points[..., 0], -5, 0)
                                      + np.roll(points[..., 0], 5, 1) + np.roll(points[..., 0], -5, 1))
            if inner.sum() > 500:
                ratio = np.sum(electrons[inner]) / np.sum(expected[inner])
                self.assertAlmostEqual(ratio, 1.0, delta=0.01)  # bilinear between nodes
                counted[0] += 1
            night = covered & (lit < -0.02)
            if night.sum() > 500:
                self.assertLess(abs(np.median(electrons[night])), 3.0)  # read noise, dark
                counted[1] += 1
            db = runs.database(out)
            rows = db.execute("SELECT earth_fraction, moon_fraction, sun_fraction FROM exposures")
            for row in rows.fetchall():
                self.assertGreater(row[0], 0.3)
                self.assertEqual(row[1:], (0, 0))
            losses = runs.manifest(out)["losses"]["neossat/telescope"]
            self.assertEqual(losses["earth_frames"], losses["frames"])
            self.assertNotIn("moon_frames", losses)
            summary = runs.manifest(out)["summary"]
            self.assertEqual([summary[f"{body}_frames"] for body in ("earth", "moon", "sun")],
                             [summary["frames"], 0, 0])
            self.assertIn("the Earth is in the field from 0.0 s until the end of the run", printed)
        self.assertGreaterEqual(counted[0], 1)
        self.assertGreaterEqual(counted[1], 1)

    def test_night_side_has_airglow_and_moonlight(self):
        # a large pupil and no noise of the detector; the full Moon was two days before
        for azimuth in (0, 90):
            _, header, image, _ = self.frame(
                azimuth, 3.0, 0.5, f"{CAMERA}/aperture_m=2", f"{CAMERA}/dark_current_e_per_s=0",
                f"{CAMERA}/read_noise_e=1", f"{CAMERA}/background_mag_arcsec2=30")
            points, turn = hits_of(header, image.shape)
            normal = points / np.array([1, 1, (1 - F) ** 2])
            normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
            t = Time(header["DATE-AVG"], scale="utc")
            sun, moon = sun_and_moon(t, turn)
            lit = normal @ (sun / np.linalg.norm(sun))
            night = np.isfinite(lit) & (lit < -0.05)
            if night.sum() < 5000:
                continue
            flux = 3.6e10 * np.pi / 4 * 2 ** 2 * 0.7 * 0.7 * 0.5
            airglow = flux * 10 ** (-0.4 * 22) * 18 ** 2
            phase = np.degrees(np.arccos(np.dot(-moon, sun - moon) / np.linalg.norm(moon)
                                         / np.linalg.norm(sun - moon)))
            v = -12.73 + 0.026 * phase + 4e-9 * phase ** 4 + 5 * np.log10(
                np.linalg.norm(moon) * AU_M / 3.844e8 * np.linalg.norm(sun - moon))
            by_moon = 0.3 / np.pi * np.maximum(normal @ (moon / np.linalg.norm(moon)), 0) * \
                10 ** (-0.4 * v) * flux * np.radians(18 / 3600) ** 2
            expected = np.median((airglow + by_moon)[night])
            # twilight of the limb above the night: none; counts' noise: 0.1 %
            self.assertAlmostEqual(np.median((image[night] - 500) * 1.6) / expected, 1, delta=0.02)
            return
        self.fail("no night in either direction")


class Hidden(unittest.TestCase):
    """Stars behind the Earth: not in images, and not in the generator's detections."""

    def test_generator(self):
        ra, dec = limb_direction(0, 0.3)
        more = (f"{runs.SENSOR}/observation_source=generator",
                runs.NO_FRAMES)
        out = os.path.join(runs.scratch(), "generated")
        runs.run(runs.STARE, out, *sets(ra, dec)[:-1], f"{CAMERA}/pixel_scale_arcsec=60", *more,
                 duration=4)
        db = runs.database(out)
        hidden = db.execute("SELECT count(*) FROM truth WHERE kind = 'star' AND in_field AND "
                            "occulted").fetchone()[0]
        seen = db.execute("SELECT count(*) FROM truth WHERE kind = 'star' AND in_field AND NOT "
                          "occulted AND snr > 20").fetchone()[0]
        self.assertGreater(hidden, 5)
        self.assertGreater(seen, 5)
        self.assertEqual(db.execute("SELECT count(*) FROM truth WHERE occulted AND electrons > 0")
                         .fetchone()[0], 0)
        # nothing is detected where only what is hidden would be
        rows = db.execute(
            "SELECT d.exposure_id, d.x_px, d.y_px FROM detections d").fetchall()
        self.assertGreater(len(rows), 5)
        for exposure, x, y in rows:
            near = db.execute("SELECT occulted FROM truth WHERE exposure_id = ? AND "
                              "abs(x_centroid_px - ?) < 3 AND abs(y_centroid_px - ?) < 3",
                              (exposure, x, y)).fetchall()
            self.assertTrue(not near or any(not o for o, in near), (exposure, x, y))


class Predicted(unittest.TestCase):
    def test_times_of_an_orbit(self):
        """What `check` predicts of an inertial stare against the frames of the run."""
        ra, dec = limb_direction(0, -15)
        more = (f"{runs.SENSOR}/observation_source=generator",
                f"{runs.SENSOR}/exposure/period_s=20", "/tick_rate_hz=100",
                f"{runs.SENSOR}/modules/gimbal/rate_hz=100",
                f"{runs.SENSOR}/modules/gimbal/platform/jitter_high_px_rms=0",
                f"{runs.SENSOR}/modules/gimbal/platform/jitter_low_px_rms=0",
                f"{runs.SENSOR}/modules/gimbal/platform/drift_arcsec_per_s=[0, 0, 0]",
                runs.NO_FRAMES)
        out = os.path.join(runs.scratch(), "orbit")
        words = runs.command(runs.STARE, out, *sets(ra, dec)[:-1], *more, duration=6000)
        done = subprocess.run(words, capture_output=True, text=True, timeout=600)
        self.assertEqual(done.returncode, 0, done.stderr)
        found = re.search(r"the Earth is in the field from ([0-9.]+) s until ([0-9.]+) s",
                          done.stderr)
        self.assertTrue(found, done.stderr)
        first, last = float(found[1]), float(found[2])
        rows = runs.database(out).execute(
            "SELECT mid_s, earth_fraction FROM exposures ORDER BY mid_s").fetchall()
        times = np.array([t for t, share in rows if share > 0])
        times = times[(times > first - 100) & (times < last + 100)]
        # 20 s between frames; the circle about the sensor is met 0.3 deg, 6 s, before it
        self.assertLess(abs(times[0] - first), 40)
        self.assertLess(abs(times[-1] - last), 40)


def tearDownModule():
    runs.clean()


if __name__ == "__main__":
    unittest.main()
