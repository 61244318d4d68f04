#!/usr/bin/env python3
"""A space station that sets behind the Earth: frames and truth at the limb.

Usage, from the repository root: /usr/bin/python3 tests/e2e/test_body_limb.py BORESIGHT
"""
import json
import math
import os
import subprocess
import tempfile
import unittest

import numpy as np
from astropy.io import fits

import runs

R_M, OBSERVER_M, TARGET_M = 6378137.0, 6978e3, 6798e3
CAMERA = {"width_px": 256, "height_px": 256, "pixel_scale_arcsec": 0.03, "aperture_m": 1, "obscuration": 0, "throughput": 0.7,
          "quantum_efficiency": 0.7, "photon_flux_v0_per_s_m2": 3.6e10, "psf_fwhm_px": 2, "background_mag_arcsec2": 22,
          "dark_current_e_per_s": 5, "read_noise_e": 3, "full_well_e": 200000, "gain_e_per_dn": 3.1, "offset_dn": 100, "bits": 16,
          "background": {"earth": True, "limb_scale_height_m": 0}}


def orbit(radius_m, anomaly_deg):
    return {"source": "numerical", "forces": {"gravity": "two_body"}, "state": {
        "source": "keplerian", "semi_major_axis_m": radius_m, "eccentricity": 0, "inclination_deg": 0, "raan_deg": 0,
        "arg_perigee_deg": 0, "true_anomaly_deg": anomaly_deg}}


def rows(folder, query):
    with runs.database(folder) as base:
        return base.execute(query).fetchall()


class BodyLimb(unittest.TestCase):
    def test_station_that_sets(self):
        """In the equator's plane the limb is a row. The line of sight grazes the Earth at the start, and the target sets."""
        apart = math.degrees(math.acos(R_M / OBSERVER_M) + math.acos(R_M / TARGET_M))
        scene = {"boresight": 1, "name": "limb", "epoch_utc": "2022-10-15T00:00:00Z", "duration_s": 1.3, "tick_rate_hz": 10000,
                 "seed": "0x1",
                 "world": {"objects": [{"name": "target", "orbit": orbit(TARGET_M, 200 + apart), "area_m2": 400, "albedo": 0.3,
                                        "brightness": {"model": "shape"},
                                        "shape": {"file": os.path.abspath("scenarios/satellites/iss_like.json")},
                                        "attitude": [{"law": "nadir"}]}]},
                 "observers": [{"name": "o", "orbit": orbit(OBSERVER_M, 200), "sensors": [{
                     "name": "camera", "camera": CAMERA, "exposure": {"exposure_s": 0.0005, "period_s": 0.5},
                     "modules": {"gimbal": {"type": "ideal", "object": "target", "rate_hz": 2000},
                                 "scenegen": {"type": "opencl"}}}]}],
                 "record": {"frames": "cube"}}
        with tempfile.TemporaryDirectory() as folder:
            path, out = os.path.join(folder, "limb.json"), os.path.join(folder, "run")
            with open(path, "w", encoding="ascii") as file:
                json.dump(scene, file)
            run = subprocess.run([runs.BORESIGHT, "run", path, "--out", out], capture_output=True, text=True)
            self.assertEqual(run.returncode, 0, run.stderr)
            shapes = rows(out, "SELECT visible, x0_px, y0_px, x1_px, y1_px, x_px FROM shapes ORDER BY exposure_id")
            truth = rows(out, "SELECT occulted, electrons FROM truth WHERE kind = 'object' ORDER BY exposure_id")
            with fits.open(os.path.join(out, "frames.fits")) as file:
                frames = [np.array(part, dtype=float) for part in next(h.data for h in file if h.data is not None)]
        visible = [row[0] for row in shapes]
        self.assertEqual((visible[0], visible[2]), (1, 0))
        self.assertTrue(0.2 < visible[1] < 0.6)
        self.assertEqual([row[0] for row in truth], [0, 0, 1])
        # the light of the body falls by less than 1 % in half a second
        self.assertAlmostEqual(truth[1][1] / truth[0][1], visible[1], delta=0.01)
        self.assertEqual(truth[2][1], 0)
        self.assertEqual(shapes[2][1:5], (None,) * 4)
        # beside the body the Earth's edge, with 203 DN above the offset, is where the box of what is left begins
        column = frames[1][:, 5:30].mean(axis=1)
        edge = np.sum(column - 100.0 > 0.5 * (column[0] - 100.0)) - 0.5
        self.assertAlmostEqual(shapes[1][2], edge, delta=0.6)
        x0, x1 = int(shapes[1][1]), int(shapes[1][3])
        for frame, rows_of_earth in ((frames[1], int(edge) - 3), (frames[2], 180)):
            earth = frame[:rows_of_earth, x0:x1]
            beside = frame[:rows_of_earth, 5:45]
            self.assertAlmostEqual(earth.mean(), beside.mean(), delta=0.5)  # 100 times as much at the panels
            self.assertLess(earth.max(), beside.mean() + 6 * beside.std())
        self.assertGreater(frames[1][int(edge):int(edge) + 4, x0:x1].max(), 500)  # panels that are not hidden


if __name__ == "__main__":
    unittest.main()
