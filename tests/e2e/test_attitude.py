#!/usr/bin/env python3
"""Attitude from stars in the main scenario against the Cramer-Rao bound by the stars' photon noise
(the standard deviation that the tracker states, which is that of least squares with the centroids'
own covariances), and the target's place against its covariance.

Usage, from the repository root: /usr/bin/python3 tests/e2e/test_attitude.py BORESIGHT [SEEDS]
"""
import os
import sys
import unittest

import numpy as np

import runs

SEEDS = int(sys.argv.pop(1)) if len(sys.argv) > 1 and sys.argv[1].isdigit() else 1
ARCSEC = np.radians(1 / 3600)
SETTLED_S = 30


def columns(row, prefix, names):
    return np.array([row[prefix + name] for name in names])


def turn(row):
    """Rotation vector from the true mean attitude to the measured one, camera axes, arcsec."""
    x, y, z, w = columns(row, "attitude_q_cam_from_gcrf_", "xyzw")
    p, q, r, s = columns(row, "q_cam_from_gcrf_mean_", "xyzw") * [-1, -1, -1, 1]
    v = np.array([w * p + x * s + y * r - z * q, w * q - x * r + y * s + z * p,
                  w * r + x * q - y * p + z * s])
    return 2 * v * np.sign(w * s - x * p - y * q - z * r) / ARCSEC


def direction(ra_deg, dec_deg):
    ra, dec = np.radians(ra_deg), np.radians(dec_deg)
    return np.array([np.cos(dec) * np.cos(ra), np.cos(dec) * np.sin(ra), np.sin(dec)])


def misfit(row):
    """Chi-square of the target's true place, 2 degrees of freedom."""
    d = direction(row["ra_deg"], row["dec_deg"])
    e1 = np.array([-d[1], d[0], 0]) / np.hypot(d[0], d[1])
    off = direction(row["true_ra"], row["true_dec"]) - d
    v = np.array([off @ e1, off @ np.cross(d, e1)])
    c = np.array([[row["cov_d1_d1_rad2"], row["cov_d1_d2_rad2"]],
                  [row["cov_d1_d2_rad2"], row["cov_d2_d2_rad2"]]])
    return v @ np.linalg.solve(c, v)


class Attitude(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        folder = runs.scratch()
        cls.out = {seed: os.path.join(folder, str(seed)) for seed in range(1, SEEDS + 1)}
        runs.parallel(lambda seed: runs.run(runs.TRACK, cls.out[seed], runs.NO_FRAMES, seed=seed),
                      cls.out)

    @classmethod
    def tearDownClass(cls):
        runs.clean()

    def rows(self, query):
        return [row for out in self.out.values() for row in runs.database(out).execute(query)]

    def test_error_over_bound(self):
        rows = self.rows("SELECT * FROM track_frames JOIN exposures USING (sensor, exposure_id) "
                         f"WHERE attitude_valid AND time_s > {SETTLED_S}")
        error = np.array([turn(row) for row in rows])
        sigma = np.array([[row[f"attitude_sigma_{k}_arcsec"] for k in "xyz"] for row in rows])
        error, sigma = (np.sqrt(np.mean(x ** 2, axis=0)) for x in (error, sigma))
        cross = np.hypot(*error[:2]) / np.hypot(*sigma[:2])
        print(f"{len(rows)} frames: RMS error {error.round(4)} arcsec, bound {sigma.round(4)}, ratio "
              f"{(error / sigma).round(3)}, across the boresight {cross:.3f}")
        self.assertGreater(len(rows), 250 * SEEDS)
        # two axes of so many frames, whose stars repeat: three standard errors
        self.assertLess(cross, 1.1 + 3 / np.sqrt(4 * len(rows)))
        self.assertLess(error[2] / sigma[2], 1.1 + 3 / np.sqrt(2 * len(rows)))

    def test_target_lies_where_its_covariance_says(self):
        chi2 = [misfit(row) for row in self.rows(
            "SELECT t.*, o.ra_deg AS true_ra, o.dec_deg AS true_dec FROM tracks t JOIN truth o USING "
            "(sensor, exposure_id) WHERE t.target_of_interest AND o.kind = 'object' AND "
            f"t.time_s > {SETTLED_S}")]
        print(f"target's place: chi-square {np.mean(chi2) / 2:.2f} per degree of freedom")
        # less: nothing accelerates as process_noise allows for
        self.assertLess(np.mean(chi2) / 2, 1.1)
        self.assertGreater(np.mean(chi2) / 2, 0.3)


class SharedDisplacement(unittest.TestCase):
    """Images and generator state the same displacement that all streaks of a frame share, and the
    attitude has it: along the streaks more than across them."""

    @classmethod
    def setUpClass(cls):
        folder = runs.scratch()
        cls.out = {name: os.path.join(folder, name) for name in ("image", "generator")}
        runs.parallel(lambda name: runs.run(
            runs.TRACK, cls.out[name], runs.NO_FRAMES, "/record/truth_stars=true",
            f"{runs.SENSOR}/observation_source={name}", duration=30), cls.out)

    @classmethod
    def tearDownClass(cls):
        runs.clean()

    def rows(self, name, columns):
        return np.array(runs.database(self.out[name]).execute(
            f"SELECT {columns} FROM detection_frames JOIN track_frames USING (sensor, exposure_id) "
            "JOIN (SELECT sensor, exposure_id, avg(x_end_px - x_start_px) AS dx, "
            "avg(y_end_px - y_start_px) AS dy FROM truth WHERE kind = 'star' GROUP BY 1, 2) "
            "USING (sensor, exposure_id) WHERE attitude_valid AND time_s > 12").fetchall())

    def test_images_and_generator_state_the_same(self):
        image, generator = (np.mean(self.rows(name, "shared_xx_px2, shared_xy_px2, shared_yy_px2"),
                                    axis=0) for name in ("image", "generator"))
        print(f"shared displacement {np.sqrt(image[0] + image[2]):.5f} px in images, "
              f"{np.sqrt(generator[0] + generator[2]):.5f} px in the generator")
        # the bends that bright stars leave unknown differ a little
        self.assertLess(np.abs(image - generator).max(), 0.05 * (image[0] + image[2]))

    def test_it_lies_along_the_streaks_and_in_the_attitude(self):
        for xx, xy, yy, dx, dy, sx, sy, r in self.rows(
                "image", "shared_xx_px2, shared_xy_px2, shared_yy_px2, dx, dy, "
                "attitude_sigma_x_arcsec, attitude_sigma_y_arcsec, attitude_correlation_xy"):
            shared = np.array([[xx, xy], [xy, yy]])
            # a rotation about y moves stars along x, one about x against y
            attitude = np.array([[sy * sy, -r * sx * sy], [-r * sx * sy, sx * sx]]) / 9  # 3 arcsec
            along = np.array([dx, dy]) / np.hypot(dx, dy)
            across = np.array([-along[1], along[0]])
            self.assertGreater(along @ shared @ along, 4 * (across @ shared @ across))
            self.assertGreater(along @ attitude @ along, along @ shared @ along)
            self.assertGreater(along @ attitude @ along, across @ attitude @ across)


if __name__ == "__main__":
    unittest.main()
