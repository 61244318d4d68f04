#!/usr/bin/env python3
"""Onboard knowledge that differs from the truth, in the closed loop, against its effect by theory;
and several sensors and observers in one run.

Usage, from the repository root: /usr/bin/python3 tests/e2e/test_knowledge.py BORESIGHT
"""
import os
import unittest
import warnings

import numpy as np
from astropy.io import fits
from astropy.wcs import WCS, FITSFixedWarning

import runs

KNOWN = runs.SENSOR + "/knowledge"
LIGHT = 299792458.0
ARCSEC = np.radians(1 / 3600)
CASES = {
    "right": (),
    "dropped": (KNOWN + "/stars/dropped_fraction=0.3",),
    "displaced": (KNOWN + "/stars/displaced_fraction=0.3",
                  KNOWN + "/stars/displaced_sigma_arcsec=10"),
    "scale": (KNOWN + "/camera/scale_error_ppm=300",),
    "velocity": (KNOWN + "/orbit/velocity_rtn_mps=[0, 1000, 0]",),
    "place": (KNOWN + "/orbit/position_rtn_m=[0, 10000, 0]", KNOWN + "/orbit/along_track_mps=1",
              KNOWN + "/clock_offset_s=1"),
    "rotation": (KNOWN + "/camera/rotation_error_deg=0.05",),
}


def boresight(q):
    x, y, z, w = q
    return np.array([2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)])


class Loop(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        folder = runs.scratch()
        cls.out = {name: os.path.join(folder, name) for name in CASES}
        runs.parallel(lambda name: runs.run(runs.TRACK, cls.out[name], runs.NO_FRAMES, *CASES[name],
                                            duration=60), CASES)

    def tracked(self, name):
        """Frames in which stars gave the attitude, with the true one."""
        return runs.database(self.out[name]).execute(
            "SELECT * FROM track_frames JOIN exposures USING (sensor, exposure_id) WHERE "
            "attitude_valid AND time_s > 25").fetchall()

    def test_the_loop_holds(self):
        for name, out in self.out.items():
            figures = runs.manifest(out)["summary"]
            print(f"{name}: {figures['final_mode']}, {figures['track_fraction']:.3f} in track, "
                  f"pointing RMS {figures['pointing_rms_px']:.3f} px")
            self.assertEqual(figures["final_mode"], "track", name)
            self.assertGreaterEqual(figures["track_fraction"], 0.95, name)
            # 0.2 px as ever; what all directions share cancels between stars and target
            self.assertLessEqual(figures["pointing_rms_px"], 0.5, name)

    def test_dropped_stars_are_missing(self):
        count = {name: np.mean([row["attitude_stars"] for row in self.tracked(name)])
                 for name in ("right", "dropped")}
        print("stars a frame:", count)
        # some 20 different stars pass: binomial 1 sigma 0.1
        self.assertLess(abs(count["dropped"] / count["right"] - 0.7), 0.25)

    def test_a_scale_error_shows_in_the_residuals(self):
        rms = {name: np.sqrt(np.mean([row["attitude_rms_px"] ** 2 for row in self.tracked(name)]))
               for name in ("right", "scale")}
        db = runs.database(self.out["scale"])
        spread = []
        for row in self.tracked("scale"):
            places = np.array([tuple(r) for r in db.execute(
                "SELECT x_px, y_px FROM detections WHERE label = 'star' AND NOT edge AND NOT blend "
                "AND exposure_id = ?", (row["exposure_id"],))])
            spread.append(np.mean(np.var(places, axis=0)))
        expected = np.hypot(rms["right"], 300e-6 * np.sqrt(np.mean(spread)))
        print(f"residuals {rms['right']:.4f} px, with 300 ppm {rms['scale']:.4f}, expected "
              f"{expected:.4f}")
        # weights differ from star to star, and the attitude takes its share of three parameters
        self.assertLess(abs(rms["scale"] - expected), 0.35 * expected)
        self.assertGreater(rms["scale"], 1.2 * rms["right"])

    def test_a_velocity_error_is_aberration_in_the_attitude(self):
        off = {}
        for name in ("right", "velocity"):
            rows, vectors = self.tracked(name), []
            for row in rows:
                q = [row[f"attitude_q_cam_from_gcrf_{k}"] for k in "xyzw"]
                true = [row[f"q_cam_from_gcrf_mean_{k}"] for k in "xyzw"]
                vectors.append(boresight(q) - boresight(true))
            off[name] = np.mean(vectors, axis=0) / ARCSEC
        row = self.tracked("velocity")[0]
        r = np.array([row[f"observer_gcrf_{k}_m"] for k in "xyz"])
        v = np.array([row[f"observer_gcrf_{k}_mps"] for k in "xyz"])
        n = np.cross(r, v) / np.linalg.norm(np.cross(r, v))
        b = boresight([row[f"q_cam_from_gcrf_mean_{k}"] for k in "xyzw"])
        t = np.cross(n, r / np.linalg.norm(r))
        expected = 1000 / LIGHT * (t - (t @ b) * b) / ARCSEC
        found = off["velocity"] - off["right"]
        print(f"1 km/s: attitude off by {np.linalg.norm(found):.4f} arcsec, expected "
              f"{np.linalg.norm(expected):.4f}")
        # a frame's attitude is good to 0.1 arcsec; 30 frames, the noise common to both runs
        self.assertLess(np.linalg.norm(found - expected), 0.05)
        self.assertGreater(np.linalg.norm(expected), 0.3)

    def test_a_rotation_error_is_roll_in_the_attitude(self):
        rolls = []
        for row in self.tracked("rotation"):
            q = np.array([row[f"attitude_q_cam_from_gcrf_{k}"] for k in "xyzw"])
            true = np.array([row[f"q_cam_from_gcrf_mean_{k}"] for k in "xyzw"])
            # z of q * conj(true), times 2
            rolls.append(2 * (q[2] * true[3] - q[3] * true[2] - q[0] * true[1] + q[1] * true[0]) *
                         np.sign(q @ true))
        found = np.degrees(np.mean(rolls))
        print(f"0.05 deg of rotation: roll {found:.4f} deg")
        # roll of a frame from some 10 stars over 300 px: 1e-4 rad, mean of 30 frames
        self.assertLess(abs(abs(found) - 0.05), 0.005)


class Width(unittest.TestCase):
    def test_a_wrong_psf_loses_signal_to_noise(self):
        folder = runs.scratch()
        # the onboard PSF as a file: a Gaussian of 3 px, five samples a pixel
        samples = np.mgrid[-60:61, -60:61] / (5 * 3 / np.sqrt(8 * np.log(2)))
        fits.PrimaryHDU(np.exp(-0.5 * np.sum(samples ** 2, axis=0)).astype(np.float32),
                        fits.Header({"OVERSAMP": 5})).writeto(os.path.join(folder, "psf.fits"))
        cases = {"right": (), "key": (KNOWN + "/camera/psf_fwhm_px=3",),
                 "file": (KNOWN + "/camera/psf_file=" + os.path.join(folder, "psf.fits"),)}
        snr = {}
        for name, sets in cases.items():
            out = os.path.join(folder, name)
            # read noise above all photons: weights of the fit are even, as the formula has them
            runs.run(runs.STARE, out, runs.NO_FRAMES, runs.SENSOR + "/camera/read_noise_e=150",
                     *sets, duration=24)
            rows = runs.database(out).execute(
                "SELECT star_id, avg(snr) FROM detections WHERE label = 'star' AND NOT edge AND NOT "
                "blend AND NOT saturated AND exposure_id > 1 GROUP BY star_id").fetchall()
            snr[name] = {row[0]: row[1] for row in rows}
        # two Gaussians overlap by 2 s t / (s^2 + t^2); pixel and jitter widen both
        width = lambda fwhm: fwhm ** 2 / (8 * np.log(2)) + 1 / 12 + 0.14 ** 2
        s, t = width(2), width(3)
        expected = 2 * np.sqrt(s * t) / (s + t)
        for name in ("key", "file"):
            both = [k for k in snr["right"] if k in snr[name] and 7 < snr["right"][k] < 40]
            ratio = np.median([snr[name][k] / snr["right"][k] for k in both])
            print(f"PSF of 3 px by {name}: SNR ratio {ratio:.4f} of {len(both)} stars, expected "
                  f"{expected:.4f}")
            self.assertGreater(len(both), 4)
            self.assertLess(abs(ratio - expected), 0.02)


class Several(unittest.TestCase):
    def test_each_sensor_has_its_own(self):
        out = os.path.join(runs.scratch(), "two")
        runs.run("scenarios/two_observers.json", out)
        db = runs.database(out)
        sensors = db.execute("SELECT * FROM sensors ORDER BY 1").fetchall()
        self.assertEqual([(s["observer"], s[2]) for s in sensors],
                         [("neossat", "narrow"), ("neossat", "wide"), ("follower", "narrow")])
        frames, shapes, rotations = [6, 3, 6], [(256, 256), (240, 320), (200, 200)], [30, -45, None]
        scales = [6, 20, 12]
        for k, sensor in enumerate(sensors):
            path = os.path.join(out, f"frames_{sensor['observer']}_{sensor[2]}.fits")
            with fits.open(path) as hdus:
                hdus.verify("exception")
                self.assertEqual(len(hdus), frames[k] + 1)
                self.assertEqual(hdus[0].header.get("ROTATION"), rotations[k])
                for i, hdu in enumerate(hdus[1:]):
                    self.assertEqual(hdu.data.shape, shapes[k])
                    wcs = WCS(hdu.header)
                    self.assertEqual(hdu.header["OBSERVER"], sensor["observer"])
                    scale = np.sqrt(np.abs(np.linalg.det(wcs.pixel_scale_matrix))) * 3600
                    self.assertLess(abs(scale / scales[k] - 1), 2e-4)  # aberration
                    self.check_places(db, k, i, wcs)
            self.assertEqual(db.execute("SELECT count(*) FROM exposures WHERE sensor = ?",
                                        (k,)).fetchone()[0], frames[k])
        # the observer is at one place, whoever asks
        both = db.execute("SELECT a.*, '|', b.* FROM exposures a JOIN exposures b ON a.mid_s = b.mid_s"
                          " WHERE a.sensor = 0 AND b.sensor = 1").fetchall()
        self.assertEqual(len(both), 3)
        for row in both:
            values = tuple(row)
            middle = values.index("|")
            names = row.keys()
            for j, name in enumerate(names[:middle]):
                if name.startswith(("observer_", "velocity_", "sun_")):
                    self.assertEqual(values[j], values[middle + 1 + j], name)

    def check_places(self, db, sensor, exposure, wcs):
        rows = np.array([tuple(r) for r in db.execute(
            "SELECT ra_deg, dec_deg, x_mean_px, y_mean_px FROM truth WHERE in_field AND sensor = ? "
            "AND exposure_id = ?", (sensor, exposure))])
        self.assertGreater(len(rows), 0)
        places = wcs.all_world2pix(rows[:, :2], 0, tolerance=1e-6, maxiter=60)
        # the motion's curvature within 0.5 s, and WCSRESID
        self.assertLess(np.max(np.hypot(*(places - rows[:, 2:]).T)), 0.02)


def setUpModule():
    warnings.simplefilter("ignore", FITSFixedWarning)


def tearDownModule():
    runs.clean()


if __name__ == "__main__":
    unittest.main()
