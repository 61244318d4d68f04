#!/usr/bin/env python3
"""A rolling shutter in a whole run: the noise-free light lies where the truth says, and the truth's
times are those of each source's own row.

Usage, from the repository root: /usr/bin/python3 tests/e2e/test_rolling_shutter.py BORESIGHT
"""
import os
import subprocess
import unittest

import numpy as np
from astropy.io import fits

import runs

ROW_S, HALF_PX = 1e-3, 14
CAMERA = runs.SENSOR + "/camera/"
SHUTTER = CAMERA + "detector/row_time_s=%g" % ROW_S
COMMON = [runs.SENSOR + "/exposure/first_s=0.6", runs.SENSOR + "/exposure/period_s=2",
          runs.SENSOR + "/modules/gimbal/platform/history_s=4",
          runs.SENSOR + "/modules/scenegen/star_limit_v_mag=11"]


def tearDownModule():
    runs.clean()


def rows(out, query):
    with runs.database(out) as database:
        return [tuple(row) for row in database.execute(query)]


class RollingShutter(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.out = os.path.join(runs.scratch(), "run")
        runs.run(runs.RATE_OPEN, cls.out, SHUTTER, *COMMON, '/record/planes=["stars"]',
                 duration=5)
        cls.rows = rows(cls.out, "SELECT exposure_id, mid_s, x_start_px, y_start_px, x_mid_px,"
                             " y_mid_px, x_end_px, y_end_px, x_chief_px, y_chief_px, electrons"
                             " FROM truth WHERE kind = 'star' AND in_field AND NOT occulted")

    def test_light_is_where_the_truth_has_it(self):
        with fits.open(os.path.join(self.out, "stars.fits")) as hdus:
            images = [hdu.data.astype(float) for hdu in hdus if hdu.data is not None]
        checked = 0
        for star in self.rows:
            image, x, y = images[star[0]], star[8], star[9]
            others = [s for s in self.rows if s[0] == star[0] and s is not star
                      and np.hypot(s[8] - x, s[9] - y) < 3 * HALF_PX]
            if others or not (HALF_PX < x < 1023 - HALF_PX and HALF_PX < y < 1023 - HALF_PX):
                continue
            x0, y0 = int(round(x)) - HALF_PX, int(round(y)) - HALF_PX
            cut = image[y0:y0 + 2 * HALF_PX + 1, x0:x0 + 2 * HALF_PX + 1]
            down, right = np.mgrid[y0:y0 + 2 * HALF_PX + 1, x0:x0 + 2 * HALF_PX + 1]
            # the truth takes the PSF as a point: first order in (motion per row time) x PSF width
            self.assertAlmostEqual((cut * right).sum() / cut.sum(), x, delta=0.02)
            self.assertAlmostEqual((cut * down).sum() / cut.sum(), y, delta=0.02)
            # stars fainter than the truth's list are not there, stamps keep all light
            self.assertAlmostEqual(cut.sum() / star[10], 1.0, delta=1e-3)
            checked += 1
        self.assertGreater(checked, 10)

    def test_times_are_those_of_the_rows(self):
        nominal = dict(rows(self.out, "SELECT exposure_id, mid_s FROM exposures"))
        self.assertEqual(sorted(nominal.values()), [0.85, 2.85])
        spread = []
        for star in self.rows:
            if min(star[3], star[7]) < 0 or max(star[3], star[7]) > 1023:
                continue  # off the sensor the nearest row counts
            middle = 0.5 * (star[3] + star[7])  # of the rows where the exposure starts and ends
            self.assertAlmostEqual(star[1] - nominal[star[0]], (middle - 511.5) * ROW_S, delta=1e-6)
            spread.append(star[1] - nominal[star[0]])
        self.assertGreater(max(spread) - min(spread), 0.7)

    def test_what_does_not_fit_is_refused(self):
        folder = runs.scratch()
        for wrong, words in (
                ([SHUTTER], ["first_s", "0.5115"]),
                ([SHUTTER, COMMON[0], COMMON[1], COMMON[2].replace("=4", "=1")],
                 ["history_s", "row_time_s"]),
                ([SHUTTER, *COMMON, CAMERA + "detector/frame_transfer_s=0.01"],
                 ["/camera/detector: row_time_s", "frame_transfer_s"])):
            words_of_run = runs.command(runs.RATE_OPEN, os.path.join(folder, "x"), *wrong,
                                        duration=5)
            result = subprocess.run(words_of_run, capture_output=True, text=True, timeout=300)
            self.assertEqual(result.returncode, 1)
            for word in words:
                self.assertIn(word, result.stderr)


if __name__ == "__main__":
    unittest.main()
