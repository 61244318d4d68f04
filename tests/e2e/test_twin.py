#!/usr/bin/env python3
"""boresight twin: the hidden path of a simulated frame is found again, and the twin renders it.

Usage, from the repository root:
    /usr/bin/python3 tests/e2e/test_twin.py BORESIGHT           one frame, and what is refused
    /usr/bin/python3 tests/e2e/test_twin.py BORESIGHT --full    50 random frames; needs the full catalogue

The frame of NEOSSat is no part of the project. Where the environment variable BORESIGHT_NEOSSAT
names a folder with NEOS_SCI_2024239174545_cord.fits, it gets a twin too (about 70 s of processor time).
"""
import hashlib
import json
import os
import sys
import unittest

import numpy
from astropy.io import fits

import runs
import twin_bound
from runs import call, call_well

FULL = "--full" in sys.argv and not sys.argv.remove("--full")
SENSOR = "/observers/0/sensors/0/"
NEOSSAT = os.path.join(os.environ.get("BORESIGHT_NEOSSAT", ""), "NEOS_SCI_2024239174545_cord.fits")
EXPOSURE_S = 5.0
SAMPLES = 101


def product(p, q):
    """Hamilton product of quaternions [..., 4], scalar last."""
    a, b = p[..., :3], q[..., :3]
    return numpy.concatenate((p[..., 3:] * b + q[..., 3:] * a + numpy.cross(a, b),
                              p[..., 3:] * q[..., 3:] - (a * b).sum(-1, keepdims=True)), -1)


def rotation(vector):
    """Quaternions of rotation vectors [..., 3] that are not 0."""
    angle = numpy.linalg.norm(vector, axis=-1, keepdims=True)
    return numpy.concatenate((numpy.sin(angle / 2) * vector / angle, numpy.cos(angle / 2)), -1)


def attitudes(rng, q_middle, length_px, scale_rad):
    """A curved path of uneven speed, with a roll of up to 1 mrad: [SAMPLES, 4]."""
    u = numpy.linspace(0, 1, SAMPLES)
    angle, bend, faster = rng.uniform(0, 2 * numpy.pi), rng.uniform(-0.2, 0.2), rng.uniform(-0.3, 0.3)
    along = length_px * (u - 0.5 + faster * (u * u - u))
    across = bend * length_px * (4 * (u - 0.5) ** 2 - 0.33) + 0.5 * numpy.sin(2 * numpy.pi * u + angle)
    x = along * numpy.cos(angle) - across * numpy.sin(angle)
    y = along * numpy.sin(angle) + across * numpy.cos(angle)
    turn = numpy.stack((-y * scale_rad, x * scale_rad, rng.uniform(-1e-3, 1e-3) * (u - 0.501)), -1)
    return product(rotation(turn), numpy.broadcast_to(q_middle, (SAMPLES, 4)))


def write_scenario(folder, path, camera, catalogue):
    """A frame of a camera whose line of sight follows `path`."""
    pointing = [{"time_s": EXPOSURE_S * i / (SAMPLES - 1), "q_cam_from_gcrf": q.tolist()} for i, q in enumerate(path)]
    with open(os.path.join(folder, "path.json"), "w", encoding="utf-8") as file:
        json.dump({"boresight_frame_updates": 1,
                   "frames": [{"frame": 0, "exposure_s": EXPOSURE_S, "period_s": EXPOSURE_S + 2, "pointing": pointing}]}, file)
    sets = {SENSOR + "frame_updates_file": "path.json", SENSOR + "exposure/exposure_s": EXPOSURE_S,
            SENSOR + "exposure/period_s": EXPOSURE_S + 2,
            SENSOR + "modules": {"gimbal": {"type": "scripted", "platform": {"history_s": 20, "telemetry_history_s": 24}},
                                 "scenegen": {"type": "opencl"}},
            "/record": {"frames": "extensions"}, "/duration_s": EXPOSURE_S + 1, "/world/star_catalogue": catalogue}
    sets.update({SENSOR + "camera/" + key: value for key, value in camera.items()})
    scenario = os.path.join(folder, "scenario.json")
    with open(scenario, "w", encoding="utf-8") as file:
        json.dump({"extends": os.path.abspath(runs.STARE), "set": sets}, file)
    return scenario


def path_error_px(folder, name, path, scale_rad):
    """RMS distance between two paths at equal times. The frame does not tell which end came first."""
    with open(os.path.join(folder, name + "_path.json"), encoding="utf-8") as file:
        nodes = json.load(file)["frames"][0]["pointing"]
    found = numpy.array([node["q_cam_from_gcrf"] for node in nodes])
    at = numpy.array([node["time_s"] for node in nodes]) / EXPOSURE_S * (SAMPLES - 1)
    errors = []
    for true in (path, path[::-1]):
        q = numpy.stack([numpy.interp(at, numpy.arange(SAMPLES), true[:, k]) for k in range(4)], -1)
        off = product(found, q * [-1, -1, -1, 1])
        errors.append(numpy.sqrt(((2 * off[:, :2] * numpy.sign(off[:, 3:])) ** 2).sum(-1).mean()) / scale_rad)
    return min(errors)


class Twin(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        """A frame of 4.3 degrees beside Orion with streaks of 16 px."""
        cls.folder = runs.scratch()
        rng = numpy.random.default_rng(5)
        cls.scale_rad = numpy.radians(120 / 3600)
        # boresight at RA 91, Dec -6: from the axes of the camera, z ahead
        ra, dec = numpy.radians((91.0, -6.0))
        middle = product(rotation(numpy.array([dec - numpy.pi / 2, 0, 0])),
                         rotation(numpy.array([0, 0, -ra - numpy.pi / 2])))
        cls.path = attitudes(rng, middle, 16.0, cls.scale_rad)
        camera = {"width_px": 128, "height_px": 128, "pixel_scale_arcsec": 120, "aperture_m": 0.04, "psf_fwhm_px": 2.2,
                  "full_well_e": 1e6, "gain_e_per_dn": 4}
        scenario = write_scenario(cls.folder, cls.path, camera, "embedded")
        cls.made = os.path.join(cls.folder, "run")
        runs.run(scenario, cls.made)
        cls.words = ("twin", cls.made, "--map", "boresight", "--v-limit", "6.5", "--least-snr", "8", "--catalogue",
                     "embedded", "--quiet", "--threads", "1")

    def report(self, name):
        with open(os.path.join(self.folder, name + "_report.json"), encoding="utf-8") as file:
            return json.load(file)

    def test_hidden_path_is_found_and_the_twin_renders_the_frame(self):
        out = os.path.join(self.folder, "twin.json")
        said = call_well(*self.words, "--out", out, timeout=600)
        self.assertIn("which end came first is not known", said)
        # the issue asks for 0.03 px of frames with 100 stars; this one has the embedded catalogue's
        self.assertLess(path_error_px(self.folder, "twin", self.path, self.scale_rad), 0.03)
        report = self.report("twin")
        # chi squared of 16,384 pixels: standard deviation 0.011
        self.assertAlmostEqual(report["figures"]["chi2_per_pixel_by_header_noise"], 1.0, delta=0.04)
        self.assertGreater(report["figures"]["explained_variance_of_light"], 0.98)
        stars = [s for s in report["stars"] if s["in_catalogue"] and s["share_on_frame"] == 1]
        self.assertGreater(len(stars), 10)
        # what the twin's own run shows is the recorded frame with other noise
        with fits.open(self.made + "/frames.fits") as a, fits.open(self.folder + "/twin_run/frames.fits") as b:
            difference = 4.0 * (a[1].data.astype(float) - b[1].data)
        background = numpy.abs(difference - numpy.median(difference)) < 5 * report["fit"]["noise_e"]
        self.assertAlmostEqual(difference[background].std() / (numpy.sqrt(2) * report["fit"]["noise_e"]), 1.0, delta=0.1)
        for name in ("_report.html", "_report.png", "_stars.bin", "_psf.fits"):
            self.assertGreater(os.path.getsize(self.folder + "/twin" + name), 0, name)
        self.assertTrue(report["streaks_fit"])
        self.assertIs(type(report["fit"]["converged"]), bool)
        # the level of 12,000 pixels without stars is that of the recorded frame
        self.assertEqual(report["camera"]["pedestal_dn"], 0)
        self.assertAlmostEqual(report["camera"]["level_rendered_minus_recorded_dn"], 0,
                               delta=5 * report["fit"]["noise_e"] / 4 / numpy.sqrt(12000 / 2))
        # what the embedded catalogue has about the frame is not complete to V 11
        self.assertNotIn("V 11", call_well("stars", "info", self.folder + "/twin_stars.bin"))
        self.refuses_to_replace(out)

    def test_short_streaks_and_hot_pixels(self):
        """The ends of streaks of 3 px seem to be 8 px apart: the PSF blurs them. Some pixels are hot."""
        folder = os.path.join(self.folder, "short")
        os.mkdir(folder)
        path = attitudes(numpy.random.default_rng(6), self.path[SAMPLES // 2], 3.0, self.scale_rad)
        camera = {"width_px": 148, "height_px": 110, "pixel_scale_arcsec": 120, "aperture_m": 0.04, "psf_fwhm_px": 2.2,
                  "full_well_e": 1e6, "gain_e_per_dn": 4,
                  "detector": {"hot_fraction": 0.001, "hot_median_e_per_s": 400, "hot_spread_dex": 0}}
        runs.run(write_scenario(folder, path, camera, "embedded"), folder + "/run")
        call_well("twin", folder + "/run", *self.words[2:], "--out", folder + "/twin.json", timeout=600)
        self.assertLess(path_error_px(folder, "twin", path, self.scale_rad), 0.05)
        # standard deviation 0.011
        figures = self.report("short/twin")["figures"]
        self.assertAlmostEqual(figures["chi2_per_pixel_by_header_noise"], 1.0, delta=0.04)
        self.assertGreater(figures["chi2_per_pixel_without_defect_map"], 2)
        # the twin has the hot pixels (16 expected of 16,280), where they are
        dark = fits.getdata(folder + "/twin_dark.fits")
        hot = dark > numpy.median(dark) + 300
        self.assertEqual(hot.sum(), figures["pixels_with_a_level_of_their_own"])
        self.assertTrue(4 < hot.sum() < 33, hot.sum())
        with fits.open(folder + "/run/frames.fits") as a, fits.open(folder + "/twin_run/frames.fits") as b:
            difference = 4.0 * (a[1].data.astype(float) - b[1].data)
        # charge of 2,000 e-: a shot noise of 45 e- in each of both, and the noise of the pixel
        self.assertLess(numpy.abs(difference[hot]).max(), 5 * numpy.sqrt(2 * (2000 + self.report("short/twin")["fit"]["noise_e"]**2)))
        self.assertLess(numpy.abs(difference[hot].mean()), 500)

    def refuses_to_replace(self, out):
        os.remove(out)
        again = call(*self.words, "--out", out)
        self.assertEqual(again.returncode, 1)
        self.assertIn("twin_path.json: is there already", again.stderr)
        frame = os.path.join(self.folder, "x_psf.fits")
        with open(frame, "wb") as file:
            file.write(b"SIMPLE")
        own = call("twin", frame, "--map", "boresight", "--overwrite", "--out", self.folder + "/x.json")
        self.assertEqual(own.returncode, 1)
        self.assertIn("x_psf.fits, which is read", own.stderr)

    def lights(self, name, run):
        """Fitted light, true light and standard deviation [stars, 3], e-: stars whole on the frame and alone within 60"."""
        def unit(ra_deg, dec_deg):
            ra, dec = numpy.radians(ra_deg), numpy.radians(dec_deg)
            return numpy.stack((numpy.cos(dec) * numpy.cos(ra), numpy.cos(dec) * numpy.sin(ra), numpy.sin(dec)), -1)
        rows = runs.database(run).execute("SELECT ra_deg, dec_deg, electrons FROM truth WHERE kind = 'star' AND electrons > 0")
        truth = numpy.array([tuple(row) for row in rows])
        places, found = unit(truth[:, 0], truth[:, 1]), []
        for star in self.report(name)["stars"]:
            if star["in_catalogue"] and star["share_on_frame"] == 1 and star["flux_sigma_e"] > 0:
                away = numpy.degrees(numpy.linalg.norm(places - unit(star["ra_deg"], star["dec_deg"]), axis=1)) * 3600
                if away.min() < 5 and (away < 60).sum() == 1:
                    found.append((star["flux_e"], truth[away.argmin(), 2], star["flux_sigma_e"]))
        return found

    def middle_limit_px(self, name):
        """Standard deviation of the time's middle along a path of length L by the noise of the light.

        Light that falls linearly by a share d from one end to the other moves the middle of the time by d L / 8. Stars of
        signal-to-noise ratios s tell d with a standard deviation of sqrt(12) / sqrt(sum s^2), as uniform light has a
        standard deviation of L / sqrt(12): L sqrt(3) / (4 sqrt(sum s^2)).
        """
        report = self.report(name)
        snr2 = sum((s["flux_e"] / s["flux_sigma_e"])**2 for s in report["stars"] if s["flux_sigma_e"])
        return report["fit"]["path_length_px"] * numpy.sqrt(3) / 4 / numpy.sqrt(snr2)

    def path_bound_px(self, run, name, path, scale_rad, fwhm_px):
        """Cramér-Rao bound of the path with splines of 7 coefficients (5 to 11 change it by 7 %), by the true stars."""
        rows = runs.database(run).execute("SELECT ra_deg, dec_deg, electrons FROM truth WHERE kind = 'star' AND electrons > 0")
        ra, dec, fluxes = numpy.array([tuple(row) for row in rows]).T
        ra, dec = numpy.radians((ra, dec))
        stars = numpy.stack((numpy.cos(dec) * numpy.cos(ra), numpy.cos(dec) * numpy.sin(ra), numpy.sin(dec)), -1)
        at = (numpy.arange(twin_bound.NODES) + 0.5) / twin_bound.NODES * (SAMPLES - 1)
        q = numpy.stack([numpy.interp(at, numpy.arange(SAMPLES), path[:, k]) for k in range(4)], -1)
        q /= numpy.linalg.norm(q, axis=1, keepdims=True)
        t = 2 * numpy.cross(q[:, :3], stars[:, None])
        seen = stars[:, None] + q[:, 3:] * t + numpy.cross(q[:, :3], t)
        places = seen[..., :2] / seen[..., 2:] / scale_rad + 149.5
        return twin_bound.path_bound_px(places, fluxes, fwhm_px / 2.3548, self.report(name)["fit"]["noise_e"], (300, 300), 7)

    def sees_stars(self, run, path):
        """True if the Earth, its air (100 km) and 2 degrees about it are beside the field of 1.67 degrees."""
        with fits.open(run + "/frames.fits") as file:
            place = numpy.array([file[1].header["OBSPOS" + axis] for axis in "XYZ"])
        x, y, z, w = path.mean(0) / numpy.linalg.norm(path.mean(0))
        ahead = numpy.array([2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)])
        away = numpy.linalg.norm(place)
        return numpy.degrees(numpy.arccos(-ahead @ place / away) - numpy.arcsin(6478e3 / away)) > 1.18 + 2

    def random_frame(self, seed):
        """What the twin of frame `seed` comes to; {} if the Earth is near the field."""
        rng = numpy.random.default_rng(seed)
        folder = os.path.join(self.folder, str(seed))
        os.mkdir(folder)
        scale_rad = numpy.radians(20 / 3600)
        q = rng.normal(size=4)
        path = attitudes(rng, q / numpy.linalg.norm(q), rng.uniform(30, 90), scale_rad)
        camera = {"width_px": 300, "height_px": 300, "pixel_scale_arcsec": 20, "aperture_m": 0.12,
                  "psf_fwhm_px": rng.uniform(1.8, 2.6), "full_well_e": 1e6, "gain_e_per_dn": 4}
        call_well("run", write_scenario(folder, path, camera, "default"), "--quiet", "--out", folder + "/run", timeout=3600)
        if not self.sees_stars(folder + "/run", path):
            return {}
        found = call("twin", folder + "/run", "--map", "boresight", "--v-limit", "10.5", "--quiet",
                     "--out", folder + "/twin.json", timeout=3600)
        self.assertEqual((found.returncode, found.stderr), (0, ""), seed)
        report = self.report(f"{seed}/twin")
        self.assertTrue(report["streaks_fit"], seed)
        frame = {"path_px": path_error_px(folder, "twin", path, scale_rad), "limit_px": self.middle_limit_px(f"{seed}/twin"),
                 "chi2": report["figures"]["chi2_per_pixel_by_header_noise"],
                 "chi2_by_measured_noise": report["figures"]["chi2_per_pixel"],
                 "path_length_px": report["fit"]["path_length_px"], "lights": self.lights(f"{seed}/twin", folder + "/run")}
        if frame["path_px"] > 0.03:
            frame["limit_px"] = self.path_bound_px(folder + "/run", f"{seed}/twin", path, scale_rad, camera["psf_fwhm_px"])
        return frame

    @unittest.skipUnless(FULL, "only with --full")
    def test_random_frames(self):
        """50 frames with hidden paths; directions near the Earth are drawn again, whatever the twin makes of them.

        If BORESIGHT_TWIN_RESULTS names a folder, each frame's figures are written there, and those that are there already
        are not computed again: a run that was stopped goes on. The file's name has the digest of the program.
        """
        runs.need_full_catalogue()
        with open(runs.BORESIGHT, "rb") as file:
            digest = hashlib.sha256(file.read()).hexdigest()[:12]
        kept = os.environ.get("BORESIGHT_TWIN_RESULTS")
        frames, beside_earth = [], 0
        for seed in range(200):
            if len(frames) == 50:
                break
            result = os.path.join(kept, f"{digest}_{seed}.json") if kept else None
            if result and os.path.exists(result):
                with open(result, encoding="utf-8") as file:
                    frame = json.load(file)
            else:
                frame = self.random_frame(seed)
                if result:
                    with open(result + ".part", "w", encoding="utf-8") as file:
                        json.dump(frame, file)
                    os.rename(result + ".part", result)
            if not frame:
                beside_earth += 1
                continue
            frames.append(frame)
            lights = numpy.array(frame["lights"]).reshape(-1, 3)
            print(f"{seed}: path {frame['path_px']:.4f} px ({frame['path_px'] / frame['limit_px']:.1f} of its limit), "
                  f"chi2 {frame['chi2']:.4f}, light {numpy.mean((lights[:, 0] - lights[:, 1]) / lights[:, 2]):+.2f}", flush=True)
        print(f"{beside_earth} directions near the Earth were drawn again")
        errors, limits, chi2 = (numpy.array([f[key] for f in frames]) for key in ("path_px", "limit_px", "chi2"))
        print(f"path: RMS {numpy.sqrt((errors**2).mean()):.4f}, median {numpy.median(errors):.4f}, largest {errors.max():.4f} px, "
              f"{(errors <= 0.03).sum()} up to 0.03 px; chi2 {chi2.min():.4f} to {chi2.max():.4f}, mean {chi2.mean():.4f}")
        fitted, true, sigma = numpy.concatenate([numpy.array(f["lights"]).reshape(-1, 3) for f in frames]).T
        off, weight = (fitted - true) / sigma, (true / sigma)**2
        share = ((fitted - true) / true * weight).sum() / weight.sum()
        print(f"light of {len(off)} stars: off by {off.mean():+.3f} +- {1 / numpy.sqrt(len(off)):.3f} standard deviations "
              f"(their scatter {off.std():.3f}), by {share:+.2e} +- {weight.sum()**-0.5:.1e} of itself (weighted)")
        self.assertLess(numpy.sqrt((errors**2).mean()), 0.03)
        # what the noise of the light allows, where that is more; other errors of the path add to it
        self.assertTrue((errors < numpy.maximum(0.03, 3 * limits)).all())
        self.assertLess(abs(off.mean()), 0.1)
        self.assertLess(numpy.abs(chi2 - 1).max(), 0.02)

    @unittest.skipUnless(os.path.exists(NEOSSAT), "BORESIGHT_NEOSSAT names no folder with the frame")
    def test_neossat(self):
        """The science frame; limits are those of issue 26."""
        runs.need_full_catalogue()
        call_well("twin", NEOSSAT, "--map", "neossat", "--out", self.folder + "/neossat.json", "--quiet", timeout=1800)
        figures = self.report("neossat")["figures"]
        self.assertTrue(self.report("neossat")["fit"]["direction_known"])  # of its rate_history
        self.assertLess(figures["streaks_across_rms_px"], 0.1)
        self.assertLess(figures["streaks_along_rms_px"], 0.35)
        self.assertLess(figures["photometry_scatter_bright_mag"], 0.2)
        self.assertLess(figures["chi2_per_pixel"], 1.3)
        self.assertLess(figures["chi2_per_pixel_on_streaks"], 1.7)
        self.assertGreater(figures["explained_variance_of_light"], 0.98)


def tearDownModule():
    runs.clean()


if __name__ == "__main__":
    unittest.main()
