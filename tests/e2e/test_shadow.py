#!/usr/bin/env python3
"""The entry of a geostationary satellite into the Earth's shadow, in the truth of a run, against 4000
rays from the Sun's disc past the ellipsoid; Sun and pole from ERFA.

Usage, from the repository root: /usr/bin/python3 tests/e2e/test_shadow.py BORESIGHT
"""
import os
import unittest

import erfa
import numpy as np
from astropy.time import Time, TimeDelta

import runs

A_M, F, AU_M, C_MPS = 6378137.0, 1 / 298.257223563, 149597870700.0, 299792458.0
SUN_M, RAYS = 6.957e8, 4000
EPOCH = Time("2022-09-22T22:05:00", scale="utc")


def seen_part(place, sun, pole):
    """Share of the rays from the Sun's disc that reach a place."""
    way = sun - place
    distance = np.linalg.norm(way)
    e3 = way / distance
    e1 = np.cross(e3, [0, 0, 1])
    e1 /= np.linalg.norm(e1)
    e2 = np.cross(e3, e1)
    k = np.arange(RAYS)  # of equal area: a sunflower
    off, turn = np.arcsin(SUN_M / distance) * np.sqrt((k + 0.5) / RAYS), k * np.pi * (3 - 5 ** 0.5)
    d = (np.cos(off)[:, None] * e3 + np.sin(off)[:, None] *
         (np.cos(turn)[:, None] * e1 + np.sin(turn)[:, None] * e2))
    dz, pz, b = d @ pole, place @ pole, A_M * (1 - F)
    dd = (1 - dz ** 2) / A_M ** 2 + dz ** 2 / b ** 2
    pd = (d @ place - dz * pz) / A_M ** 2 + pz * dz / b ** 2
    pp = (place @ place - pz ** 2) / A_M ** 2 + pz ** 2 / b ** 2 - 1
    return 1 - np.mean((pd < 0) & (pd ** 2 > dd * pp))


class Shadow(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        out = os.path.join(runs.scratch(), "eclipse")
        runs.run("scenarios/equinox_eclipse.json", out, runs.NO_FRAMES,
                 runs.SENSOR + "/observation_source=generator", runs.SENSOR +
                 '/modules/gimbal={"type": "ideal", "object": "INMARSAT GX5"}', duration=460)
        cls.rows = np.array(runs.database(out).execute(
            "SELECT t.mid_s, t.sunlit_fraction, t.v_mag, t.range_m, t.ra_deg, t.dec_deg,"
            " e.observer_gcrf_x_m, e.observer_gcrf_y_m, e.observer_gcrf_z_m FROM truth t"
            " JOIN exposures e USING (exposure_id) WHERE t.kind = 'object' AND t.id = 0"
            " AND t.mid_s > 300 ORDER BY t.mid_s").fetchall(), float)

    def test_entry(self):
        """The penumbra lasts 125 s: by the mean of 120 fractions the entry is right to 0.02 s."""
        shift = []
        for k, row in enumerate(self.rows):
            if not 0.02 < row[1] < 0.98:
                continue
            tau = row[3] / C_MPS
            t = EPOCH.tai + TimeDelta(row[0] - tau, format="sec")
            helio, bary = erfa.epv00(t.tt.jd1, t.tt.jd2)
            earth_mps = np.array(bary["v"]) * AU_M / 86400
            sun = -np.array(helio["p"]) * AU_M
            # the Earth flies towards light that is 500 s old: 20 arcsec
            sun = sun + np.linalg.norm(sun) / C_MPS * earth_mps
            ra, dec = np.radians(row[4:6])
            line = np.array([np.cos(dec) * np.cos(ra), np.cos(dec) * np.sin(ra), np.sin(dec)])
            # the line runs to where the satellite was from where the Earth's motion has taken the eye
            place = row[6:9] + row[3] * line + tau * earth_mps
            pole = erfa.pnm06a(t.tt.jd1, t.tt.jd2)[2]
            slope = (self.rows[k + 1][1] - self.rows[k - 1][1]) / 2.0
            shift.append((row[1] - seen_part(place, sun, pole)) / slope)
        self.assertGreater(len(shift), 100)
        # 4000 rays: 1e-3 of the disc, 0.1 s each
        self.assertLess(np.abs(shift).max(), 0.25)
        self.assertLess(abs(np.mean(shift)), 0.02)

    def test_light_is_bent_into_the_umbra(self):
        umbra = self.rows[self.rows[:, 1] == 0.0]
        self.assertGreater(len(umbra), 5)
        # by the air: dim, and dimmer and dimmer
        self.assertTrue(np.all(np.isfinite(umbra[:, 2])) and np.all(np.diff(umbra[:, 2]) > 0))
        self.assertGreater(umbra[0, 2], 18.0)
        # just before the contact the air above the limb thins the light by a hundredth
        full = self.rows[self.rows[:, 1] == 1.0]
        self.assertLess(np.ptp(full[:5, 2]), 0.03)


def tearDownModule():
    runs.clean()


if __name__ == "__main__":
    unittest.main()
