"""A user's table of stars as a catalogue: each kind of file gives the same bytes, stars stand where astropy's proper
motion puts them, and a run draws, identifies and names them."""
import gzip
import json
import os
import re
import unittest
import warnings

import astropy.units as u
import numpy as np
from astropy.coordinates import GCRS, CartesianRepresentation, Distance, SkyCoord, get_body_barycentric
from astropy.table import MaskedColumn, Table
from astropy.time import Time

import runs

STARE = ("scenarios/neossat_geo_stare.json", "--seed", "5")


def table_of(ra, dec, g, rng):
    n = len(ra)
    return Table({"source_id": 4000000000000000000 + np.arange(n, dtype=np.int64), "ra": ra, "dec": dec,
                  "ref_epoch": np.full(n, 2016.0), "pmra": rng.normal(0, 300, n), "pmdec": rng.normal(0, 300, n),
                  "phot_g_mean_mag": g, "bp_rp": rng.uniform(-0.2, 2.8, n)})


class StarTable(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = runs.scratch()

    def path(self, name):
        return os.path.join(self.folder, name)

    def load(self, table, out, *words):
        return runs.call_well("stars", "import", self.path(table), "--out", self.path(out), *words)

    def test_kinds_and_places(self):
        rng = np.random.default_rng(7)
        n = 3000
        ra, dec = rng.uniform(0, 360, n), np.degrees(np.arcsin(rng.uniform(-1, 1, n)))
        table = table_of(ra, dec, rng.uniform(5, 20, n), rng)
        table.write(self.path("t.csv"))
        table["ra"].unit, table["pmra"].unit = "deg", "mas / yr"
        table.write(self.path("t.ecsv"), delimiter=",")
        table.write(self.path("blanks.ecsv"))
        table.write(self.path("t.fits"))
        with open(self.path("t.csv"), "rb") as plain, gzip.open(self.path("t.csv.gz"), "wb") as packed:
            packed.write(plain.read())
        images = []
        # columns beside ours: strings of any length, arrays, flags, complex numbers, values that are missing
        wide = table.copy()
        wide.add_column([f"star {'x' * (i % 5)}" for i in range(n)], name="designation", index=0)
        wide.add_column(rng.normal(size=(n, 3)).astype(np.float32), name="xp", index=2)
        wide["flag"], wide["spectrum"] = rng.uniform(size=n) < 0.5, rng.normal(size=n) + 1j
        for form in ("binary", "tabledata", "binary2"):
            if form == "binary2":  # has a mask of missing values
                wide["radial_velocity"] = MaskedColumn(rng.normal(size=n), mask=np.arange(n) % 7 == 0)
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # of names without a unit
                wide.write(self.path(form + ".vot"), format="votable", tabledata_format=form)
        with open(self.path("binary2.vot"), "rb") as plain, gzip.open(self.path("b.vot.gz"), "wb") as packed:
            packed.write(plain.read())
        for kind in ("t.csv", "t.csv.gz", "t.ecsv", "t.fits", "blanks.ecsv", "tabledata.vot", "binary.vot", "binary2.vot",
                     "b.vot.gz"):
            self.load(kind, kind + ".stars", "--base", "none")
            with open(self.path(kind + ".stars"), "rb") as file:
                images.append(file.read())
        self.assertTrue(all(image == images[0] for image in images))
        table["dec"].unit = "rad"
        table.write(self.path("rad.fits"))
        result = runs.call("stars", "import", self.path("rad.fits"), "--out", self.path("x"))
        self.assertIn('column dec: unit "rad"; allowed: deg', result.stderr)
        # identities count the records; G - V by the published relation, evaluated here from its text
        then = SkyCoord(ra * u.deg, dec * u.deg, pm_ra_cosdec=np.array(table["pmra"]) * u.mas / u.yr,
                        pm_dec=np.array(table["pmdec"]) * u.mas / u.yr, obstime=Time(2016.0, format="jyear"))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # stars without a distance
            moved = then.apply_space_motion(new_obstime=Time(2000.0, format="jyear"))
        for number in (0, 1, 700, 1500, 2222, n - 1):
            text = runs.call_well("stars", "info", self.path("t.csv.stars"), str(2**30 + number))
            i = int(re.search(r"source +(\d+)", text)[1]) - 4000000000000000000
            place = re.search(r"RA (\S+) Dec (\S+) deg", text)
            found = SkyCoord(float(place[1]) * u.deg, float(place[2]) * u.deg)
            # motions are rounded to 0.1 mas/yr, places to 0.3 mas, and printed to 0.36 mas
            self.assertLess(found.separation(SkyCoord(moved[i].ra, moved[i].dec)).mas, 2.0)
            v = float(re.search(r"V +(\S+)", text)[1])
            x = table["bp_rp"][i]
            self.assertAlmostEqual(table["phot_g_mean_mag"][i] - v,
                                   np.polyval([0.01426, -0.2156, 0.01424, -0.02704], x), delta=2e-3)

    def test_run(self):
        out = self.path("stare")
        runs.run(STARE[0], out, duration=4)
        with runs.database(out) as rows:
            ra, dec = rows.execute("SELECT boresight_ra_deg, boresight_dec_deg FROM exposures LIMIT 1").fetchone()
        rng = np.random.default_rng(8)
        n = 400
        table = table_of(ra + rng.uniform(-1, 1, n) / np.cos(np.radians(dec)), dec + rng.uniform(-1, 1, n),
                         rng.uniform(7, 11, n), rng)
        table["pmra"] = table["pmdec"] = 0.0
        table.write(self.path("field.csv"))
        self.load("field.csv", "field.stars", "--base", "none", "--complete-to", "11",
                  "--cone", f"{ra:.4f},{dec:.4f},1")
        runs.run(STARE[0], out + "2", f"/world/star_catalogue={self.path('field.stars')}", duration=4)
        with runs.database(out + "2") as rows:
            found = rows.execute("SELECT d.star_id, t.id, d.x_px - t.x_centroid_px, d.y_px - t.y_centroid_px FROM detections d "
                                 "JOIN truth t ON t.exposure_id = d.exposure_id AND t.id = d.star_id AND t.kind = 'star' "
                                 "WHERE d.star_id > 0").fetchall()
            alone = rows.execute("SELECT count(*) FROM detections WHERE star_id > 0").fetchone()[0]
        self.assertGreater(len(found), 30)
        self.assertEqual(len(found), alone)
        self.assertTrue(all(2**30 <= row[0] < 2**30 + n for row in found))
        self.assertLess(np.median(np.hypot([row[2] for row in found], [row[3] for row in found])), 0.3)

    def test_variable_stars_and_parallax(self):
        """A pulsating star and a near one, in rendered frames, in the truth and by the generator."""
        out = self.path("first")
        runs.run(STARE[0], out, duration=1)
        with runs.database(out) as rows:
            ra, dec = rows.execute("SELECT boresight_ra_deg, boresight_dec_deg FROM exposures LIMIT 1").fetchone()
        with open(STARE[0], encoding="utf-8") as file:
            start = Time(json.load(file)["epoch_utc"].rstrip("Z"), scale="utc")
        # V 7 to 9 in 40 s; two near stars and ten others
        period_d, epoch_jd = 40 / 86400, float(np.floor(start.tdb.jd))
        places = [(ra, dec)] + [(ra + 0.2 * np.cos(k), dec + 0.2 * np.sin(k)) for k in range(12)]
        with open(self.path("vary.csv"), "w", encoding="ascii") as file:
            file.write("source_id,ra,dec,ref_epoch,pmra,pmdec,v_mag,b_minus_v,parallax,period_d,amplitude_mag,maximum_jd\n")
            file.write(f"1,{ra:.9f},{dec:.9f},2000,0,0,8,0.6,0,{period_d:.15f},2,{epoch_jd}\n")
            for k, (x, y) in enumerate(places[1:], 2):
                file.write(f"{k},{x:.9f},{y:.9f},2000,0,0,{7 + 0.1 * k:.1f},0.6,{600 if k < 4 else ''},,,\n")
        text = self.load("vary.csv", "vary.stars", "--base", "none")
        self.assertIn("2 have a parallax, 1 are variable", text)
        info = runs.call_well("stars", "info", self.path("vary.stars"))
        self.assertIn("2 of them with a parallax, 1 variable", info)
        earth = get_body_barycentric("earth", start, ephemeris="builtin").xyz.to_value(u.m)
        rate = {}
        for name, words in (("frames", ()), ("generator", (runs.GENERATOR,))):
            runs.run(STARE[0], self.path(name), f"/world/star_catalogue={self.path('vary.stars')}", *words, duration=20)
            with runs.database(self.path(name)) as rows:
                found = rows.execute(
                    "SELECT e.mid_s, t.id, t.v_mag, t.ra_deg, t.dec_deg, d.flux_e / t.electrons, e.observer_gcrf_x_m, "
                    "e.observer_gcrf_y_m, e.observer_gcrf_z_m, d.v_mag FROM truth t JOIN exposures e USING (exposure_id) "
                    "LEFT JOIN detections d ON d.exposure_id = t.exposure_id AND d.star_id = t.id WHERE t.kind = 'star' "
                    "ORDER BY 1, 2").fetchall()
            varied = [row for row in found if 6.9 < row[2] < 9.1 and abs(row[3] - ra) < 1e-6 and abs(row[4] - dec) < 1e-6]
            self.assertEqual(len(varied), 20)
            for row in varied:
                # the light time from the barycentre is minutes, the observer's part of it 0.02 s
                toward = SkyCoord(ra * u.deg, dec * u.deg).cartesian.xyz.value
                delay_s = (earth + row[6:9]) @ toward / 299792458.0
                days = (start.tdb.jd1 - epoch_jd) + start.tdb.jd2 + (row[0] + delay_s) / 86400
                # tolerance: 7 us of the year, the Earth's motion in 20 s (2 ms of light time), 1 mmag of the file
                self.assertAlmostEqual(row[2], 8 - np.cos(2 * np.pi * days / period_d), delta=2e-3)
            self.assertGreater(max(row[2] for row in varied) - min(row[2] for row in varied), 0.8)
            flux = [row[5] for row in varied if row[5] is not None]
            self.assertGreater(len(flux), 10)
            rate[name] = np.mean(flux)
            # measured light follows the truth's: of V 9 to 10 sigma in a frame
            self.assertTrue(all(abs(f - rate[name]) < 0.2 for f in flux), flux)
            for k in (1, 2):
                far = SkyCoord(places[k][0] * u.deg, places[k][1] * u.deg)
                frame = GCRS(obstime=start, obsgeoloc=CartesianRepresentation(*found[0][6:9] * u.m))
                near = SkyCoord(far, distance=Distance(parallax=600 * u.mas))
                seen = [SkyCoord(row[3] * u.deg, row[4] * u.deg) for row in found if
                        abs(row[3] - places[k][0]) < 3e-4 and abs(row[4] - places[k][1]) < 3e-4 and row[0] < 1]
                self.assertEqual(len(seen), 1)
                shift = near.transform_to(frame).separation(far.transform_to(frame)).mas
                self.assertGreater(shift, 100)
                self.assertAlmostEqual(seen[0].separation(far).mas, shift, delta=1.0)
        self.assertAlmostEqual(rate["frames"], rate["generator"], delta=0.1)

    def test_usage(self):
        with open(self.path("bad.csv"), "w", encoding="ascii") as file:
            file.write("ra,dec,ref_epoch,v\n1,2,2016,5\n")
        with open(self.path("sky.txt"), "w", encoding="ascii") as file:
            file.write("sky 9\n")
        for words, message in [
                ((), "a table needs --out FILE"),
                (("--out", self.path("x"), "--cone", "1,2,3"), "--cone has no effect without --complete-to"),
                (("--out", self.path("x"), "--complete-to", "9", "--cone", "1,2"), "--cone 1,2: give RA,DEC,RADIUS"),
                (("--out", self.path("x"), "--subset", self.path("sky.txt")), "--subset is for Tycho-2's archive"),
                (("--out", self.path("bad.csv")), "bad.csv")]:
            result = runs.call("stars", "import", self.path("bad.csv"), *words)
            self.assertEqual(result.returncode, 2, result.stderr)
            self.assertIn(message, result.stderr)


def tearDownModule():
    runs.clean()


if __name__ == "__main__":
    unittest.main()
