#!/usr/bin/env python3
"""Light of satellites against Mitsuba 3: direct sunlight with shadows, by seven reflectance models.

Usage, from the repository root: compare_mitsuba.py PRINT_FLUX [GEOMETRIES] [SATELLITE...]
                                 compare_mitsuba.py --images PRINT_FLUX [GEOMETRIES] [SATELLITE...]

With --images resolved images are compared, by Lambert's law: the difference in units of the noise that the image
would have with 10,000 electrons in its brightest pixel and 5 electrons of read noise. Mitsuba's own noise is that of two
renderings with different seeds. The pixels that differ most are traced by rays in double precision too (trace_rays,
beside PRINT_FLUX).

The models are written here from their publications, and Mitsuba calls them. Skipped (exit code 77)
where the Python package mitsuba is missing.
"""
import bisect
import json
import math
import os
import subprocess
import sys
import tempfile

SATELLITES = ["gps_iif", "inmarsat_gx_like", "starlink_v1_5", "envisat_like", "hubble_like", "iss_like"]
TOLERANCE = 5e-3
SIDE, SAMPLES = 256, 16
IMAGE_SIDE, IMAGE_SAMPLES = 64, 16384  # as in print_flux.c
IMAGE_TOLERANCE_SIGMA = 0.1
# Mitsuba counts in single precision and starts rays to the Sun some 1e-4 of the coordinates away from a surface: at
# grazing incidence borders of shadows move by a tenth of a pixel. The pixels that differ most are traced again.
TRACED, RAYS = 40, 256
# incidence and reflection of the table, degrees
TABLE_IN = list(range(0, 90, 10))
TABLE_OUT = list(range(-88, 90, 4))


def schlick(f0, cosine):
    return f0 + (1 - f0) * (1 - cosine) ** 5


def lambert(_wi, _wo, diffuse):
    return diffuse / math.pi


def phong(wi, wo, diffuse, specular=0.5, exponent=20.0):
    """Lafortune and Willems (1994): about the mirror direction."""
    mirror = (-wi[0], -wi[1], wi[2])
    cosine = max(sum(a * b for a, b in zip(mirror, wo)), 0.0)
    return diffuse / math.pi + specular * (exponent + 2) / (2 * math.pi) * cosine ** exponent


def half_vector(wi, wo):
    h = [a + b for a, b in zip(wi, wo)]
    length = math.sqrt(sum(x * x for x in h))
    return [x / length for x in h]


def dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def ashikhmin_shirley(wi, wo, rd, rs=0.2, n=30.0):
    """Ashikhmin and Shirley (2000), equations 4 and 5 with equal exponents."""
    h = half_vector(wi, wo)
    k = dot(h, wi)
    specular = (n + 1) / (8 * math.pi) * h[2] ** n / (k * max(wi[2], wo[2])) * schlick(rs, k)
    diffuse = (28 * rd / (23 * math.pi) * (1 - rs) * (1 - (1 - wi[2] / 2) ** 5) * (1 - (1 - wo[2] / 2) ** 5))
    return specular + diffuse


def smith_lambda(cosine, alpha):
    tan2 = (1 - cosine * cosine) / (cosine * cosine)
    return (math.sqrt(1 + alpha * alpha * tan2) - 1) / 2


def cook_torrance(wi, wo, diffuse, f0=0.5, alpha=0.35):
    """Walter et al. (2007) with the height-correlated masking of Heitz (2014), equation 99."""
    h = half_vector(wi, wo)
    tan2 = (1 - h[2] ** 2) / h[2] ** 2
    d = alpha ** 2 / (math.pi * h[2] ** 4 * (alpha ** 2 + tan2) ** 2)
    g = 1 / (1 + smith_lambda(wi[2], alpha) + smith_lambda(wo[2], alpha))
    under = (1 - schlick(f0, wi[2])) * (1 - schlick(f0, wo[2]))
    return schlick(f0, dot(h, wi)) * d * g / (4 * wi[2] * wo[2]) + diffuse / math.pi * under


def cosine_space(wi, wo):
    """Direction cosines of the observer and of the mirror direction."""
    return (wo[0], wo[1]), (-wi[0], -wi[1])


def binomial(wi, wo, _diffuse, b=(-0.4, -0.7), c=(-1.2, -0.8), base=3.0, first=1):
    """Greynolds (2015), without terms in V."""
    beta, beta0 = cosine_space(wi, wo)
    d = math.hypot(beta[0] - beta0[0], beta[1] - beta0[1])
    log = sum(x * d ** i for i, x in enumerate(b))
    log += 0.5 * sum(x * math.log10(1 + base ** (first + i) * d * d) for i, x in enumerate(c))
    return 10 ** log


def maxwell_beard(wi, wo, rd, rv=0.15, f0=0.3, sigma=0.35, tau=0.3, omega=0.5):
    """Westlund and Meyer (2002), with the masking of Torrance and Sparrow (1967)."""
    h = half_vector(wi, wo)
    tilt, beta = math.acos(min(h[2], 1.0)), math.acos(min(dot(h, wi), 1.0))
    slopes = sigma ** 2 / (math.pi * math.cos(tilt) ** 4 * (sigma ** 2 + math.tan(tilt) ** 2) ** 2)
    so = (1 + tilt / omega * math.exp(-2 * beta / tau)) / (1 + tilt / omega)
    g = min(1.0, 2 * h[2] * wi[2] / math.cos(beta), 2 * h[2] * wo[2] / math.cos(beta))
    first = schlick(f0, math.cos(beta)) * slopes * so * g / (4 * wi[2] * wo[2])
    return first + rd / math.pi + 2 * rv / math.pi / (wi[2] + wo[2])


def table_entry(theta_in, theta_out):
    """The value that the table's file holds: a lobe about the mirror direction on a base."""
    d = math.sin(math.radians(theta_out)) - math.sin(math.radians(theta_in))
    return 0.05 + 0.4 / (1 + 8 * d * d) * (1 + 0.2 * math.sin(math.radians(theta_in)))


def table_row(theta_in, sin_out):
    """Interpolated in the logarithm over the direction cosine, constant beyond the ends."""
    sines = [math.sin(math.radians(x)) for x in TABLE_OUT]
    if sin_out <= sines[0] or sin_out >= sines[-1]:
        return math.log10(table_entry(theta_in, TABLE_OUT[0 if sin_out < 0 else -1]))
    k = bisect.bisect_right(sines, sin_out)
    u = (sin_out - sines[k - 1]) / (sines[k] - sines[k - 1])
    low, high = (math.log10(table_entry(theta_in, TABLE_OUT[i])) for i in (k - 1, k))
    return low + u * (high - low)


def in_plane(sin_in, sin_out):
    """Between rows: values at the same distance from the mirror direction."""
    sines = [math.sin(math.radians(x)) for x in TABLE_IN]
    k = min(bisect.bisect_right(sines, sin_in), len(sines) - 1)
    u = min(max((sin_in - sines[k - 1]) / (sines[k] - sines[k - 1]), 0.0), 1.0)
    low, high = (table_row(TABLE_IN[i], sines[i] + sin_out - sin_in) for i in (k - 1, k))
    return 10 ** (low + u * (high - low))


def table(wi, wo, _diffuse):
    """The pair of directions in the plane of incidence with the same D and V, in both orders."""
    beta, beta0 = cosine_space(wi, wo)
    d = math.hypot(beta[0] - beta0[0], beta[1] - beta0[1])
    v = beta[0] * beta0[0] + beta[1] * beta0[1]
    total = math.sqrt(max(d * d + 4 * v, 0.0))
    small, large = (total - d) / 2, min((total + d) / 2, 1.0)
    there = in_plane(small, large) if small >= 0 else in_plane(-small, -large)
    return (there + in_plane(large, small)) / 2


MODELS = [lambert, phong, ashikhmin_shirley, cook_torrance, binomial, maxwell_beard, table]


def write_table(path):
    with open(path, "w", encoding="utf-8") as file:
        for i in TABLE_IN:
            for o in TABLE_OUT:
                file.write(f"{i} 180 {o} 0 {table_entry(i, o):.12e}\n")


def make_class(mi):
    """A surface of Mitsuba that asks one of the models. Facets are plane and the Sun is far away: values repeat."""
    class Surface(mi.BSDF):
        def __init__(self, properties):
            mi.BSDF.__init__(self, properties)
            self.model = MODELS[int(properties["number"])]
            self.diffuse = float(properties["diffuse"])
            self.known = {}
            flags = mi.BSDFFlags.GlossyReflection | mi.BSDFFlags.FrontSide
            self.m_components = [flags]
            self.m_flags = flags

        def sample(self, _context, _interaction, _sample1, _sample2, _active=True):
            raise NotImplementedError("only direct light of the Sun")

        def pdf(self, _context, _interaction, _wo, _active=True):
            return 0.0

        def eval_pdf(self, context, interaction, wo, active=True):
            return self.eval(context, interaction, wo, active), 0.0

        def eval(self, _context, interaction, wo, _active=True):
            wi = interaction.wi
            if not (wi[2] > 0.0 and wo[2] > 0.0):
                return mi.Color3f(0.0)
            key = (wi[0], wi[1], wi[2], wo[0], wo[1], wo[2])
            if key not in self.known:
                self.known[key] = self.model((wi[0], wi[1], wi[2]), (wo[0], wo[1], wo[2]), self.diffuse) * wo[2]
            return mi.Color3f(self.known[key])

        def to_string(self):
            return "Surface[]"

    return Surface


def shapes(triangles, folder, own=True):
    """A mesh for each surface, as an OBJ file. One-sided: plates have a facet for each side."""
    out = {}
    for number, surface in enumerate(sorted({tuple(t[0]) for t in triangles})):
        path = os.path.join(folder, f"{number}.obj")
        with open(path, "w", encoding="utf-8") as file:
            count = 0
            for t in triangles:
                if tuple(t[0]) == surface:
                    for k in (1, 4, 7):
                        file.write(f"v {t[k]} {t[k + 1]} {t[k + 2]}\n")
                    file.write(f"f {count + 1} {count + 2} {count + 3}\n")
                    count += 3
        out[f"m{number}"] = {
            "type": "obj", "filename": path, "face_normals": True,
            "bsdf": {"type": "satellite_surface", "number": surface[0], "diffuse": surface[1]} if own else
            {"type": "diffuse", "reflectance": {"type": "rgb", "value": [surface[1]] * 3}}}
    return out


def render(mi, case, folder):
    """Intensity over irradiance, m^2/sr, from an orthographic picture."""
    points = [t[k:k + 3] for t in case["triangles"] for k in (1, 4, 7)]
    radius = 1.001 * max(math.sqrt(sum(x * x for x in p)) for p in points)
    eye, sun = case["eye"], case["sun"]
    up = [0, 0, 1] if abs(eye[2]) < 0.9 else [1, 0, 0]
    origin = [4 * radius * x for x in eye]
    transform = mi.ScalarTransform4f().look_at(origin=origin, target=[0, 0, 0], up=up)
    transform = transform @ mi.ScalarTransform4f().scale([radius, radius, 1])
    scene = {"type": "scene", "integrator": {"type": "direct", "emitter_samples": 1, "bsdf_samples": 0},
             "sensor": {"type": "orthographic", "to_world": transform, "near_clip": 0.1 * radius,
                        "far_clip": 10 * radius,
                        "film": {"type": "hdrfilm", "width": SIDE, "height": SIDE, "pixel_format": "luminance",
                                 "rfilter": {"type": "box"}},
                        "sampler": {"type": "stratified", "sample_count": SAMPLES}},
             "sun": {"type": "directional", "direction": [-x for x in sun],
                     "irradiance": {"type": "rgb", "value": [1, 1, 1]}}}
    scene.update(shapes(case["triangles"], folder))
    image = mi.render(mi.load_dict(scene))
    pixels = [float(x) for x in image.array]
    return sum(pixels) / len(pixels) * (2 * radius) ** 2


def compare(mi, program, name, geometries, first):
    """The largest difference of a satellite whose materials start with one of the models."""
    with tempfile.TemporaryDirectory() as folder:
        path = os.path.join(folder, "table.csv")
        write_table(path)
        lines = subprocess.run([program, f"scenarios/satellites/{name}.json", geometries, first, path], check=True,
                               capture_output=True, text=True).stdout.splitlines()
        cases = [json.loads(line) for line in lines]
        largest = max(case["flux"] for case in cases)
        differences = []
        for number, case in enumerate(cases):
            there = render(mi, case, folder)
            # relative to itself, or to a tenth of the brightest: thin crescents are noise in a picture
            differences.append((there - case["flux"]) / max(case["flux"], 0.1 * largest))
            if abs(differences[-1]) > TOLERANCE:
                print(f"  geometry {number}: {differences[-1]:+.2%}, estimated error of curved surfaces "
                      f"{case['error'] / case['flux']:.2%}")
    used = sorted({MODELS[t[0][0]].__name__ for case in cases for t in case["triangles"]})
    print(f"{name:18} {len(cases)} geometries, {', '.join(used)}: largest difference "
          f"{max(map(abs, differences)):.2%}, mean {sum(differences) / len(differences):+.3%}", flush=True)
    return max(map(abs, differences)), used


def camera(mi, case):
    """Mitsuba's perspective camera in the place of the image's."""
    transform = mi.ScalarTransform4f().look_at(origin=[case["range"] * x for x in case["eye"]], target=[0, 0, 0],
                                               up=[-x for x in case["down"]])
    return {"type": "perspective", "fov": 2 * math.degrees(math.atan(IMAGE_SIDE / 2 * case["scale"])),
            "to_world": transform, "near_clip": 0.5 * case["range"], "far_clip": 2 * case["range"],
            "film": {"type": "hdrfilm", "width": IMAGE_SIDE, "height": IMAGE_SIDE, "pixel_format": "luminance",
                     "rfilter": {"type": "box"}},
            "sampler": {"type": "stratified", "sample_count": IMAGE_SAMPLES}}


def render_image(mi, case, folder, seed):
    scene = {"type": "scene", "integrator": {"type": "direct", "emitter_samples": 1, "bsdf_samples": 0},
             "sensor": camera(mi, case),
             "sun": {"type": "directional", "direction": [-x for x in case["sun"]],
                     "irradiance": {"type": "rgb", "value": [1, 1, 1]}}}
    scene.update(shapes(case["triangles"], folder, own=False))
    return [float(x) for x in mi.render(mi.load_dict(scene), seed=seed).array]


def trace_rays(program, case, pixels):
    """Radiance of some pixels by rays in double precision through the same triangles."""
    triangles = case["triangles"]
    scene = [*case["sun"], *case["eye"], *case["down"], case["range"], case["scale"], IMAGE_SIDE, len(pixels)]
    for i in pixels:
        scene += [i % IMAGE_SIDE, i // IMAGE_SIDE]
    scene.append(len(triangles))
    for t in triangles:
        scene += [t[0][1], *t[1:]]
    tracer = os.path.join(os.path.dirname(program), "trace_rays")
    result = subprocess.run([tracer, str(RAYS)], input=" ".join(map(repr, scene)), check=True, capture_output=True,
                            text=True)
    return [float(x) for x in result.stdout.split()]


def compare_image(mi, program, case, folder):
    """RMS over the lit pixels in sigma: of the difference, of Mitsuba's noise, of the difference with the worst pixels
    traced by rays; largest differences from Mitsuba and from the rays; difference of the sums."""
    one, two = (render_image(mi, case, folder, seed) for seed in (1, 2))
    ours = case["radiance"]
    there = [(a + b) / 2 for a, b in zip(one, two)]
    electrons = 1e4 / max(there)
    differences, noise = {}, []
    for i, value in enumerate(there):
        if value > 0 or ours[i] > 0:
            sigma = math.sqrt(value * electrons + 25) / electrons
            differences[i] = (ours[i] - value) / sigma
            noise.append((one[i] - two[i]) / 2 / sigma)
    worst = sorted(differences, key=lambda i: -abs(differences[i]))[:TRACED]
    mixed = dict(differences)
    for i, value in zip(worst, trace_rays(program, case, worst)):
        mixed[i] = (ours[i] - value) * electrons / math.sqrt(value * electrons + 25)
    rms = [math.sqrt(sum(x * x for x in v) / len(v)) for v in (differences.values(), noise, mixed.values())]
    return (*rms, max(map(abs, differences.values())), max(abs(mixed[i]) for i in worst), sum(ours) / sum(there) - 1)


def compare_images(mi, program, geometries, names):
    worst = 0.0
    for name in names:
        with tempfile.TemporaryDirectory() as folder:
            path = os.path.join(folder, "table.csv")
            write_table(path)
            lines = subprocess.run([program, f"scenarios/satellites/{name}.json", geometries, "lambert", path, "image"],
                                   check=True, capture_output=True, text=True).stdout.splitlines()
            for number, line in enumerate(lines):
                rms, own, mixed, most, traced, total = compare_image(mi, program, json.loads(line), folder)
                print(f"{name:18} geometry {number}: difference rms {rms:.3f} sigma, largest {most:.2f}; Mitsuba's "
                      f"noise {own:.3f}; with the {TRACED} worst pixels by rays {mixed:.3f}, these up to {traced:.2f}; "
                      f"sum {total:+.3%}", flush=True)
                worst = max(worst, math.sqrt(max(mixed ** 2 - own ** 2, 0.0)))
    print(f"largest rms difference without Mitsuba's noise: {worst:.3f} sigma")
    return worst


def main():
    try:
        import mitsuba as mi
    except ImportError:
        print("skipped: the Python package mitsuba is not installed")
        sys.exit(77)
    mi.set_variant("scalar_rgb")
    mi.register_bsdf("satellite_surface", make_class(mi))
    if sys.argv[1] == "--images":
        geometries, names = sys.argv[3] if len(sys.argv) > 3 else "2", sys.argv[4:] or SATELLITES
        worst = compare_images(mi, sys.argv[2], geometries, names)
        if not worst <= IMAGE_TOLERANCE_SIGMA:
            sys.exit(f"difference {worst:.2f} sigma (allowed: {IMAGE_TOLERANCE_SIGMA:g} sigma)")
        return
    program = sys.argv[1]
    geometries = sys.argv[2] if len(sys.argv) > 2 else "20"
    names = sys.argv[3:] or SATELLITES
    worst, seen = 0.0, set()
    for number, name in enumerate(names):
        for first in ("lambert", str((3 * number + 1) % len(MODELS))):
            difference, used = compare(mi, program, name, geometries, first)
            worst = max(worst, difference)
            seen.update(used)
    if names == SATELLITES and len(seen) < len(MODELS):
        sys.exit(f"only the models {sorted(seen)} were compared")
    if not worst <= TOLERANCE:
        sys.exit(f"difference {worst:.2%} (allowed: {TOLERANCE:.2%})")


if __name__ == "__main__":
    main()
