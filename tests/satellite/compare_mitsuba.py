#!/usr/bin/env python3
"""Light of satellites against Mitsuba 3: direct sunlight with shadows, Lambertian surfaces.

Usage, from the repository root: compare_mitsuba.py PRINT_FLUX [GEOMETRIES] [SATELLITE...]

Skipped (exit code 77) where the Python package mitsuba is missing.
"""
import json
import math
import os
import subprocess
import sys
import tempfile

SATELLITES = ["gps_iif", "inmarsat_gx_like", "starlink_v1_5", "envisat_like", "hubble_like", "iss_like"]
TOLERANCE = 5e-3
SIDE, SAMPLES = 256, 16


def shapes(triangles, folder):
    """A twosided diffuse mesh for each reflectance, as OBJ files."""
    out = {}
    for number, albedo in enumerate(sorted({t[0] for t in triangles})):
        path = os.path.join(folder, f"{number}.obj")
        with open(path, "w", encoding="utf-8") as file:
            count = 0
            for t in triangles:
                if t[0] == albedo:
                    for k in (1, 4, 7):
                        file.write(f"v {t[k]} {t[k + 1]} {t[k + 2]}\n")
                    file.write(f"f {count + 1} {count + 2} {count + 3}\n")
                    count += 3
        out[f"m{number}"] = {
            "type": "obj", "filename": path, "face_normals": True,
            # one-sided: plates have a facet for each side
            "bsdf": {"type": "diffuse", "reflectance": {"type": "rgb", "value": [albedo] * 3}}}
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


def main():
    try:
        import mitsuba as mi
    except ImportError:
        print("skipped: the Python package mitsuba is not installed")
        sys.exit(77)
    mi.set_variant("scalar_rgb")
    program = sys.argv[1]
    geometries = sys.argv[2] if len(sys.argv) > 2 else "20"
    worst = 0.0
    for name in sys.argv[3:] or SATELLITES:
        lines = subprocess.run([program, f"scenarios/satellites/{name}.json", geometries], check=True,
                               capture_output=True, text=True).stdout.splitlines()
        cases = [json.loads(line) for line in lines]
        largest = max(case["flux"] for case in cases)
        differences = []
        for case in cases:
            with tempfile.TemporaryDirectory() as folder:
                there = render(mi, case, folder)
            # relative to itself, or to a tenth of the brightest: thin crescents are noise in a picture
            differences.append((there - case["flux"]) / max(case["flux"], 0.1 * largest))
        print(f"{name:24} {len(cases)} geometries: largest difference {max(map(abs, differences)):.2%}, "
              f"mean {sum(differences) / len(differences):+.3%}")
        worst = max(worst, max(map(abs, differences)))
    if not worst <= TOLERANCE:
        sys.exit(f"difference {worst:.2%} (allowed: {TOLERANCE:.2%})")


if __name__ == "__main__":
    main()
