#!/usr/bin/env python3
"""Valid scenarios of varied kind, drawn from a seed: observers and targets of the shipped element
sets that see each other, optics, detectors, clocks, skies and ways to point.

Usage, from the repository root:
  /usr/bin/python3 tests/e2e/random_scenes.py --seed N [--count 10] --out DIR
      [--boresight build/boresight] [--catalogue default|embedded] [--generator]

Scene k of seed N is the same whatever --count is. With --boresight each scene has passed
`boresight check`: one that is refused is drawn anew. --generator leaves out what the observation
generator does not model (docs/how-to/observation_generator.md). --catalogue embedded keeps to
fields that the stars in the program suffice for. As a module: scene(), write().
"""
import argparse
import functools
import json
import math
import os
import subprocess
import sys
from datetime import datetime, timedelta

import numpy as np
from sgp4.api import Satrec, jday

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
ELEMENTS = os.path.join(ROOT, "scenarios", "objects_2022-06.tle")
CALIBRATION = os.path.join(ROOT, "scenarios", "calibration", "neossat.obsgen")
EARTH_KM, AU_KM, SUN_V = 6378.137, 1.495978707e8, -26.74
FIRST, LAST = datetime(2022, 6, 15), datetime(2022, 6, 17, 20)
DURATION_S = 60.0
# all-sky stars brighter than V (boresight stars info); beyond the last, little changes for a field
COUNTS = {7: 15449, 8: 45631, 9: 130728, 10: 357173, 11: 946005}
DEEPEST = {"default": 11.0, "embedded": 9.0}
SQUARE_DEGREES = 41253.0
FWHM_PER_SIGMA = 2.3548200450309493
KINDS = ("leo-geo", "leo-meo", "geo-geo", "leo-leo", "meo-geo", "leo-other", "geo-meo", "meo-meo")
SKIES = ("sparse", "catalogue", "crowded")
STRATEGIES = ("track", "track", "track", "rate", "stare")
# how far target and stars part in an exposure, px, and how often: the longest are not filtered for
MOTIONS = ((0.0, 1.5), (1.5, 8.0), (8.0, 60.0), (66.0, 150.0))
MOTION_SHARES = (0.35, 0.3, 0.25, 0.1)


def regime(satellite):
    revolutions_a_day = satellite.no_kozai * 1440.0 / (2.0 * math.pi)
    if satellite.ecco > 0.02:
        return "other"
    if revolutions_a_day > 12.5:
        return "leo"
    if 0.99 < revolutions_a_day < 1.01:
        return "geo"
    return "meo" if 1.8 < revolutions_a_day < 6.0 else "other"


@functools.lru_cache(maxsize=None)
def satellites():
    """Element sets by regime: (catalogue number, name, satellite)."""
    found = {"leo": [], "meo": [], "geo": [], "other": []}
    with open(ELEMENTS, encoding="utf-8") as file:
        lines = [line.rstrip("\n") for line in file if not line.startswith("#")]
    for k in range(len(lines) - 1):
        if lines[k].startswith("1 ") and lines[k + 1].startswith("2 "):
            satellite = Satrec.twoline2rv(lines[k], lines[k + 1])
            name = lines[k - 1].strip() if k and lines[k - 1][:2] not in ("1 ", "2 ") else ""
            found[regime(satellite)].append((satellite.satnum, name, satellite))
    return found


def state(satellite, when):
    """Position and velocity, km, km/s, TEME; None when SGP4 ends early."""
    day, part = jday(when.year, when.month, when.day, when.hour, when.minute,
                     when.second + 1e-6 * when.microsecond)
    error, r, v = satellite.sgp4(day, part)
    return None if error else (np.array(r), np.array(v))


def sun(when):
    """Direction of the Sun, to 0.01 degree (Astronomical Almanac, low precision)."""
    n = (when - datetime(2000, 1, 1, 12)).total_seconds() / 86400.0
    g = math.radians(357.528 + 0.9856003 * n)
    lon = math.radians(280.460 + 0.9856474 * n + 1.915 * math.sin(g) + 0.020 * math.sin(2 * g))
    tilt = math.radians(23.439 - 4e-7 * n)
    return np.array([math.cos(lon), math.cos(tilt) * math.sin(lon), math.sin(tilt) * math.sin(lon)])


def angle(a, b):
    return math.atan2(np.linalg.norm(np.cross(a, b)), float(np.dot(a, b)))


def sight(observer, target, when):
    """Range (km), direction, rate (rad/s) and phase angle of a sight that is free, or None."""
    a, b = state(observer, when), state(target, when)
    if a is None or b is None:
        return None
    d, w, s = b[0] - a[0], b[1] - a[1], sun(when)
    distance = np.linalg.norm(d)
    u = d / distance
    height = np.linalg.norm(a[0])
    limb = math.asin(min(EARTH_KM / height, 1.0))
    if angle(u, -a[0]) < limb + math.radians(12.0) or angle(u, s) < math.radians(50.0):
        return None
    along = float(np.dot(b[0], s))
    if along < 0.0 and np.linalg.norm(b[0] - along * s) < EARTH_KM + 150.0:
        return None
    rate = np.linalg.norm(w - np.dot(w, u) * u) / distance
    return distance, u, rate, angle(-u, s)


def geometry(rng, kind):
    """Two satellites and a time at which they see each other for the whole duration."""
    first, second = kind.split("-")
    lists = satellites()
    for _ in range(20000):
        number, name, observer = lists[first][rng.integers(len(lists[first]))]
        other, other_name, target = lists[second][rng.integers(len(lists[second]))]
        when = FIRST + timedelta(seconds=int(rng.integers(int((LAST - FIRST).total_seconds()))))
        middle = sight(observer, target, when + timedelta(seconds=0.5 * DURATION_S))
        if number == other or middle is None or middle[3] > math.radians(100.0):
            continue
        # a target that turns the mount by a degree a second or more is a scene of its own
        if not 100.0 < middle[0] < 80000.0 or middle[2] > math.radians(0.3):
            continue
        ends = [sight(observer, target, when + timedelta(seconds=s)) for s in (0.0, DURATION_S)]
        if None not in ends:
            return {"observer": (number, name), "target": (other, other_name), "when": when,
                    "range_km": middle[0], "direction": middle[1], "rate": middle[2],
                    "phase": middle[3]}
    raise RuntimeError(f"no {kind} pair that sees each other in 20000 draws")


def log_uniform(rng, low, high):
    return float(math.exp(rng.uniform(math.log(low), math.log(high))))


def rounded(value, digits=4):
    return float(f"{value:.{digits}g}")


def point_spread(rng):
    """optics and the deviation of a Gaussian of about its noise-equivalent area, px."""
    kind = rng.choice(["gaussian", "gaussian", "gaussian", "moffat", "diffraction"])
    fwhm = rounded(rng.uniform(1.5, 3.2), 3)
    if kind == "moffat":
        return fwhm, {"psf": "moffat", "moffat_beta": rounded(rng.uniform(2.5, 5.0), 3)}, \
            1.2 * fwhm / FWHM_PER_SIGMA
    if kind == "diffraction":
        q = rounded(rng.uniform(1.2, 2.4), 3)
        return fwhm, {"psf": "diffraction", "q": q, "band_nm": [500, 800], "wavelengths": 6,
                      "diffusion_px": rounded(rng.uniform(0.1, 0.35), 2)}, 0.55 * q
    return fwhm, {}, fwhm / FWHM_PER_SIGMA


def camera(rng, generator):
    fwhm, optics, sigma = point_spread(rng)
    side = int(rng.choice([512, 640, 768, 1024]))
    out = {
        "width_px": side, "height_px": side,
        "pixel_scale_arcsec": rounded(log_uniform(rng, 2.0, 24.0), 3),
        "aperture_m": rounded(log_uniform(rng, 0.05, 0.5), 3),
        "obscuration": rounded(rng.choice([0.0, rng.uniform(0.05, 0.2)]), 2),
        "throughput": rounded(rng.uniform(0.5, 0.85), 2),
        "quantum_efficiency": rounded(rng.uniform(0.5, 0.9), 2),
        "photon_flux_v0_per_s_m2": float(rng.choice([8.8e9, 2.0e10, 3.6e10])),
        "psf_fwhm_px": fwhm,
        "background_mag_arcsec2": rounded(rng.uniform(17.0, 22.5), 3),
        "dark_current_e_per_s": rounded(log_uniform(rng, 0.05, 20.0), 2),
        "read_noise_e": rounded(log_uniform(rng, 1.5, 12.0), 2),
        "full_well_e": float(rng.choice([3e4, 1e5, 2e5])),
        "gain_e_per_dn": rounded(log_uniform(rng, 0.5, 3.0), 2),
        "offset_dn": 500, "bits": 16,
    }
    if optics:
        out["optics"] = optics
    detector = {}
    if rng.random() < 0.4:
        detector["prnu_rms"] = rounded(rng.uniform(0.002, 0.01), 2)
    if rng.random() < 0.3:
        detector["column_offset_rms_e"] = rounded(rng.uniform(0.2, 0.4) * out["read_noise_e"], 2)
    if rng.random() < 0.4:
        detector["cosmic_rays"] = {"rate_per_cm2_s": rounded(log_uniform(rng, 1.0, 60.0), 2),
                            "pixel_pitch_um": 13}
    hot, bloom = rng.random() < 0.3, rng.random() < 0.2
    if hot and not generator:
        detector["hot_fraction"] = rounded(log_uniform(rng, 1e-5, 3e-4), 2)
        detector["hot_median_e_per_s"] = 500
    if bloom and not generator:
        detector["saturation"] = "bloom"
    if detector:
        out["detector"] = detector
    return out, sigma


def electrons_per_s(c, v_mag):
    area = 0.25 * math.pi * c["aperture_m"] ** 2 * (1.0 - c["obscuration"])
    return (c["photon_flux_v0_per_s_m2"] * area * c["throughput"] * c["quantum_efficiency"]
            * 10.0 ** (-0.4 * v_mag))


def background_e(c, exposure_s):
    sky = electrons_per_s(c, c["background_mag_arcsec2"]) * c["pixel_scale_arcsec"] ** 2
    return (sky + c["dark_current_e_per_s"]) * exposure_s


def noise_e(c, exposure_s):
    return math.sqrt(background_e(c, exposure_s) + c["read_noise_e"] ** 2)


def full_e(c):
    """Charge that fills a pixel or the converter."""
    return min(c["full_well_e"], (2 ** c["bits"] - 1 - c["offset_dn"]) * c["gain_e_per_dn"])


def magnitude_of(c, exposure_s, sigma, length, snr):
    """V at which a source of that streak length has this SNR."""
    s2 = sigma * sigma + 1.0 / 12.0
    area = 4.0 * math.pi * s2 * math.sqrt(1.0 + length * length / (4.0 * math.pi * s2))
    return 2.5 * math.log10(electrons_per_s(c, 0.0) * exposure_s
                            / (snr * noise_e(c, exposure_s) * math.sqrt(area)))


def stars_in(c, v_limit, catalogue):
    v = min(max(v_limit, 7.0), DEEPEST[catalogue])
    low = min(int(v), 10)
    part = v - low
    count = COUNTS[low] ** (1.0 - part) * COUNTS[low + 1] ** part
    return count / SQUARE_DEGREES * (c["width_px"] * c["pixel_scale_arcsec"] / 3600.0) ** 2


def area_for(v_mag, albedo, range_km, phase):
    """Cross-section of a diffuse sphere that is so bright (Lambert's phase law)."""
    law = 2.0 / (3.0 * math.pi ** 2) * (math.sin(phase) + (math.pi - phase) * math.cos(phase))
    return 10.0 ** (-0.4 * (v_mag - SUN_V)) * (1e3 * range_km) ** 2 / (albedo * law)


def instrument(rng, sky, strategy, rate, catalogue, generator):
    """Camera, clock and star streaks that leave enough stars in the field for an attitude."""
    least, most = MOTIONS[rng.choice(len(MOTIONS), p=MOTION_SHARES)]
    for _ in range(3000):
        c, sigma = camera(rng, generator)
        period = float(rng.choice([0.25, 0.5, 1.0, 2.0]))
        exposure = rounded(period * rng.uniform(0.05, 0.6), 2)
        pixel_rad = math.radians(c["pixel_scale_arcsec"] / 3600.0)
        moved = rate * exposure / pixel_rad
        streak = 0.0 if strategy == "stare" else moved
        limit = magnitude_of(c, exposure, sigma, streak, 6.0)
        stars = stars_in(c, limit, catalogue)
        if not least <= moved <= most or not 25.0 <= stars <= 1500.0 or limit > 17.0:
            continue
        # a sky that fills the converter shows no stars
        if background_e(c, exposure) > 0.5 * full_e(c):
            continue
        # the target's way through a field that is not followed
        if strategy == "stare" and rate * 20.0 / pixel_rad > c["width_px"]:
            continue
        if sky == "crowded" and not 9.0 < limit < 15.5:
            continue
        return c, sigma, period, exposure, streak, moved, limit
    return None


def modules(rng, c, sky, period, exposure, limit, strategy, leo):
    true_jitter = 0.0 if rng.random() < 0.25 else rounded(rng.uniform(0.05, 1.0), 2)
    modelled = bool(rng.random() < 0.5)
    platform = {
        "drift_arcsec_per_s": [rounded(x, 2) for x in rng.normal(0.0, 3.0, 3)],
        "jitter_low_px_rms": rounded(rng.uniform(0.0, 0.6), 2), "jitter_low_cutoff_hz": 0.05,
        "jitter_high_px_rms": true_jitter,
        # above what the plant follows within an exposure: the frame's PSF is wider by it
        "jitter_high_band_hz": [5, 200],
    }
    imgproc = {"type": "standard", "delay_s": {"frame": rounded(0.15 * period, 3)}}
    if modelled:
        imgproc["jitter_px"] = rounded(true_jitter / math.sqrt(2.0), 3)  # per axis; the mount's is radial
    control = {"type": "standard", "delay_s": {"tracks": rounded(0.2 * period, 3)},
               "command_latency_s": rounded(0.05 * period, 3), "exposure_s": exposure}
    if strategy != "track":
        control["strategy"] = strategy
    if strategy == "rate":
        control["compensate_attitude"] = False
    if strategy == "stare":
        control["stare_time_s"] = 0.5 * DURATION_S
    return {
        "gimbal": {"type": "second_order", "delay_s": {"los_command": rounded(0.05 * period, 3)},
                   "platform": platform},
        "scenegen": {"type": "opencl",
                     "star_limit_v_mag": rounded(limit + (1.0 if sky == "crowded" else 0.5), 3)},
        "obsgen": {"type": "statistical", "calibration_file": ""},
        "imgproc": imgproc,
        "tracker": {"type": "ekf", **({"motion": "orbit"} if leo else {})},
        "control": control,
    }


def scene(seed, number, catalogue="default", generator=False, attempt=0):
    """The scenario number `number` of a seed, files by absolute paths."""
    rng = np.random.default_rng([seed, number, attempt])
    kind = KINDS[(number + seed) % len(KINDS)]
    made = None
    while made is None:
        place = geometry(rng, kind)
        sky, strategy = str(rng.choice(SKIES)), str(rng.choice(STRATEGIES))
        made = instrument(rng, sky, strategy, place["rate"], catalogue, generator)
    c, sigma, period, exposure, streak, moved, limit = made
    # in a stare the target is the streak
    v = magnitude_of(c, exposure, sigma, moved if strategy == "stare" else 0.0,
                     log_uniform(rng, 8.0, 150.0))
    albedo = rounded(rng.uniform(0.1, 0.4), 2)
    area = rounded(area_for(v, albedo, place["range_km"], place["phase"]))
    field_deg = c["width_px"] * c["pixel_scale_arcsec"] / 3600.0
    u = place["direction"]
    across = np.cross(u, [0.0, 0.0, 1.0] if abs(u[2]) < 0.8 else [1.0, 0.0, 0.0])
    across /= np.linalg.norm(across)
    turn = rng.uniform(0.0, 2.0 * math.pi)
    x_axis = math.cos(turn) * across + math.sin(turn) * np.cross(u, across)
    offset = rounded(field_deg * rng.uniform(0.0, 0.25), 3)
    mods = modules(rng, c, sky, period, exposure, limit, strategy, "leo" in kind.split("-")[1])
    mods["obsgen"]["calibration_file"] = CALIBRATION
    faint = {"faint_stars": "statistical", "faint_limit_v_mag": max(rounded(limit + 1.0, 3), 6.0)}
    target = place["target"][1] or str(place["target"][0])
    observer = place["observer"][1] or str(place["observer"][0])
    return {
        "boresight": 1,
        "name": f"random_{seed}_{number}",
        "description": f"Scene {number} of seed {seed}: {kind}, {observer} looks at {target}, "
                       f"strategy {strategy}, {sky} sky, stars move {streak:.1f} px, "
                       f"V {v:.1f}.",
        "epoch_utc": place["when"].strftime("%Y-%m-%dT%H:%M:%SZ"),
        "duration_s": DURATION_S,
        "tick_rate_hz": 6000,
        "seed": hex(0x1000 * (seed + 1) + number),
        "world": {
            "star_catalogue": catalogue,
            "earth_orientation": "builtin",
            **(faint if sky == "crowded" else {}),
            "objects": [{"name": target, "area_m2": area, "albedo": albedo,
                         "orbit": {"source": "sgp4", "elements_file": ELEMENTS,
                                   "norad": place["target"][0]}}],
        },
        "observers": [{
            "name": "observer",
            "orbit": {"source": "sgp4", "elements_file": ELEMENTS, "norad": place["observer"][0]},
            "sensors": [{
                "name": "telescope",
                "x_axis_gcrf": [round(float(x), 6) for x in x_axis],
                "camera": c,
                "exposure": {"exposure_s": exposure, "period_s": period},
                "cue": {"object": target, "offset_deg": offset,
                        "offset_axis": str(rng.choice(["x", "y"])),
                        "sigma_deg": rounded(max(offset, 0.05 * field_deg), 3),
                        "rate_sigma_arcsec_per_s": rounded(
                            max(0.01 * math.degrees(place["rate"]) * 3600.0, 0.3), 2),
                        "v_mag": rounded(v, 3), "v_mag_sigma": 1},
                "modules": mods,
            }],
        }],
        "record": {"frames": "none"},
    }


def refused(boresight, path):
    """What `boresight check` has against a scenario; empty: nothing."""
    said = subprocess.run([boresight, "check", path, "--quiet"], capture_output=True, text=True,
                          timeout=300)
    return (said.stderr.strip() or f"exit code {said.returncode}") if said.returncode else ""


def write(folder, seed, number, boresight=None, catalogue="default", generator=False):
    """Writes a scene and returns its path."""
    os.makedirs(folder, exist_ok=True)
    path = os.path.join(folder, f"random_{seed}_{number}.json")
    why = ""
    for attempt in range(20):
        made = scene(seed, number, catalogue, generator, attempt)
        with open(path, "w", encoding="utf-8") as file:
            json.dump(made, file, indent=4)
            file.write("\n")
        why = refused(boresight, path) if boresight else ""
        if not why:
            return path
    raise RuntimeError(f"{path}: refused 20 times, at last: {why}")


def main():
    parser = argparse.ArgumentParser(description="Writes random scenarios.")
    parser.add_argument("--seed", type=int, required=True)
    parser.add_argument("--count", type=int, default=10)
    parser.add_argument("--out", required=True)
    parser.add_argument("--boresight", help="program that each scene must pass the check of")
    parser.add_argument("--catalogue", choices=sorted(DEEPEST), default="default")
    parser.add_argument("--generator", action="store_true",
                        help="leave out what the observation generator does not model")
    args = parser.parse_args()
    for number in range(args.count):
        path = write(args.out, args.seed, number, args.boresight, args.catalogue, args.generator)
        with open(path, encoding="utf-8") as file:
            print(path, json.load(file)["description"], sep=": ")
    return 0


if __name__ == "__main__":
    sys.exit(main())
