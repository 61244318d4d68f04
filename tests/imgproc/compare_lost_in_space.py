#!/usr/bin/env python3
"""Other lost-in-space solvers on the fields of test_imgproc_lost_in_space_rates.

Usage: compare_lost_in_space.py LISTS, with LISTS as its argument lists=LISTS writes them. It needs
cedar-solve (tetra3) and tetra3rs, from PyPI. Both use their own, complete catalogues.
"""
import sys
import time

import numpy
import tetra3
import tetra3rs

SIDE = 1024
SCALE_ERROR = 0.055


def fields(path):
    """The fields of a file: side, deg; direction of the boresight; x, y and flux, brightest first."""
    with open(path, encoding="utf-8") as file:
        lines = iter(file)
        for line in lines:
            words = line.split()
            side = float(words[1])
            x, y, z, w = map(float, words[2:6])
            items = [tuple(map(float, next(lines).split())) for _ in range(int(words[6]))]
            items.sort(key=lambda item: -item[2])
            # third row of the matrix of q_cam_from_gcrf
            axis = numpy.array([2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)])
            yield side, axis, numpy.array(items)


def report(name, database, solve, path):
    """Prints the share solved within 5 px, wrong ones, and the processor time."""
    solved, wrong, spent = 0, 0, []
    for side, axis, items in fields(path):
        begin = time.process_time()
        found = solve(database, side, items)
        spent.append(1e3 * (time.process_time() - begin))
        if found is None:
            continue
        ra, dec = numpy.radians(found)
        to = numpy.array([numpy.cos(dec) * numpy.cos(ra), numpy.cos(dec) * numpy.sin(ra), numpy.sin(dec)])
        # either sign of the axis: their cameras may look along -z
        off = numpy.degrees(numpy.arcsin(numpy.linalg.norm(numpy.cross(axis, to)))) * SIDE / side
        right = off < 5 and axis @ to > 0
        solved += right
        wrong += not right
    print(f"{name}: {solved} of {len(spent)} solved, {wrong} wrong, median {numpy.median(spent):.2f} ms, "
          f"worst {max(spent):.0f} ms of processor time")


def solve_tetra3(database, side, items):
    result = database.solve_from_centroids(
        items[:, 1::-1], (SIDE, SIDE), fov_estimate=side, fov_max_error=SCALE_ERROR * side,
        solve_timeout=5000, match_threshold=1e-5)
    return (result["RA"], result["Dec"]) if result["RA"] is not None else None


def solve_tetra3rs(database, side, items):
    centred = items - numpy.array([(SIDE - 1) / 2, (SIDE - 1) / 2, 0])
    result = database.solve_from_centroids(
        centred, fov_estimate_deg=side, image_width=SIDE, image_height=SIDE,
        fov_max_error_deg=SCALE_ERROR * side)
    return (result.ra_deg, result.dec_deg) if result else None


def main(path):
    side = next(fields(path))[0]
    report("tetra3 (cedar-solve)", tetra3.Tetra3("default_database"), solve_tetra3, path)
    database = tetra3rs.SolverDatabase.generate_from_gaia(max_fov_deg=side * 1.06, min_fov_deg=side * 0.94)
    report("tetra3rs", database, solve_tetra3rs, path)


if __name__ == "__main__":
    main(sys.argv[1])
