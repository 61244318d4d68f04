#!/usr/bin/env python3
"""Closed loop around a tumbling satellite: image processing hands over from a point to a silhouette, its centre of mass is
estimated to 3 % of the apparent size, and the track is never lost.

    test_inspection.py build/boresight          the approach from 1.5 km to 0.2 km, one seed; from 300 m with a model of the
                                                target on board
    test_inspection.py build/boresight 20       from 300 m to 27 m with 20 seeds and attitudes of the target, without and
                                                with a model on board, and scenarios/inspection.json as shipped, with
                                                another attitude, and with both (./dev slow)
"""
import json
import os
import sqlite3
import subprocess
import sys
import tempfile

import numpy as np
from astropy.io import fits

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
SCENARIO = os.path.join(ROOT, "scenarios", "inspection.json")
NEAR = {"/duration_s": 300, "/observers/0/orbit/offset_rtn_m": [0, -1500, 0],
        "/observers/0/burns": [{"time_s": 20, "dv_rtn_mps": [0, 4.95, 0]}],
        "/observers/0/sensors/0/exposure/exposure_s": 2e-4,
        "/observers/0/sensors/0/modules/control/exposure_schedule": [{"time_s": 150, "exposure_s": 1e-4}]}


LAST = {**NEAR, "/observers/0/orbit/offset_rtn_m": [0, -300, 0],
        "/observers/0/burns": [{"time_s": 20, "dv_rtn_mps": [0, 0.99, 0]}],
        "/observers/0/sensors/0/exposure/exposure_s": 1e-4,
        "/observers/0/sensors/0/modules/control/exposure_schedule": [{"time_s": 150, "exposure_s": 5e-5}]}


# image processing knows the target, as in scenarios/inspection_client.json
MODEL = {"/observers/0/sensors/0/modules/imgproc/extended/target_model": "satellites/inspection_client.json"}


def run(program, folder, seed, changes):
    words = [program, "run", SCENARIO, "--out", folder, "--set", f"/seed={json.dumps(hex(seed))}"]
    for key, value in changes.items():
        words += ["--set", f"{key}={json.dumps(value)}"]
    subprocess.run(words, check=True, capture_output=True)


def tumbling(seed):
    """Another attitude at the start and other rates for each seed; the first: as shipped."""
    if seed == 1:
        return {}
    draw = np.random.default_rng(seed)
    target = "/world/objects/0/attitude/0/"
    return {target + "rotation_deg": [round(v, 1) for v in draw.uniform(-180.0, 180.0, 3)],
            target + "rate_body_deg_per_s": [round(v, 2) for v in draw.uniform(-1.5, 1.5, 3)]}


def rows(folder, query):
    with sqlite3.connect(os.path.join(folder, "run.sqlite")) as store:
        return store.execute(query).fetchall()


def judge(folder):
    """Errors of the centre of mass, of detections and of the target's track, over the apparent size; sizes; ranges over
    the true ones and their deviation; frames without the target from its first track on."""
    found = rows(folder, "SELECT s.size_px, e.x_px - s.x_px, e.y_px - s.y_px, e.range_m / s.range_m,"
                         " (e.range_m - s.range_m) / e.range_sigma_m, s.phase_deg FROM shapes s"
                         " JOIN extended_targets e USING (sensor, exposure_id)")
    several = rows(folder, "SELECT count(*) - count(DISTINCT exposure_id) FROM extended_targets")[0][0]
    tracked = rows(folder, "SELECT f.exposure_id, f.target_id FROM track_frames f ORDER BY f.exposure_id")
    first = next((i for i, row in enumerate(tracked) if row[1]), len(tracked))
    targets = {row[1] for row in tracked[first:]}
    lost = sum(row[1] == 0 for row in tracked[first:])
    value = np.array(found, dtype=float)
    return {"error": np.hypot(value[:, 1], value[:, 2]) / value[:, 0], "size": value[:, 0], "range": value[:, 3],
            "range_deviation": value[:, 4], "phase": value[:, 5], "several": several, "first": first, "lost": lost,
            "targets": len(targets), "frames": len(tracked)}


def normalised(folder):
    """Mean square of the errors of the place over their standard deviations, for one component; with right covariances 1."""
    found = rows(folder, "SELECT d.x_px - s.x_px, d.y_px - s.y_px, d.cov_xx_px2, d.cov_xy_px2, d.cov_yy_px2 FROM shapes s"
                         " JOIN extended_targets e USING (sensor, exposure_id)"
                         " JOIN detections d ON d.sensor = e.sensor AND d.exposure_id = e.exposure_id AND d.item = e.item")
    x, y, xx, xy, yy = np.array(found, dtype=float).T
    return float(np.mean((yy * x**2 - 2.0 * xy * x * y + xx * y**2) / (xx * yy - xy**2)) / 2.0)


def figures(result):
    e = result["error"]
    return {"frames": result["frames"], "extended": len(e), "rms_%": round(100 * float(np.sqrt(np.mean(e**2))), 2),
            "median_%": round(100 * float(np.median(e)), 2), "p95_%": round(100 * float(np.percentile(e, 95)), 2),
            "max_%": round(100 * float(e.max()), 2), "above_3_%": int(np.count_nonzero(e > 0.03)), "largest_px": round(float(result["size"].max())),
            "first": result["first"], "lost": result["lost"], "tracks": result["targets"], "several": result["several"]}


def turned(q, v):
    """Vectors turned by a quaternion x, y, z, w."""
    axis = np.array(q[:3])
    return v + 2.0 * np.cross(axis, np.cross(axis, v) + q[3] * v)


def first_part(parts, eye, ways):
    """Number of the part, from 1, that each ray from `eye` meets first, 0: none; boxes and plates in the body frame."""
    nearest, number = np.full(len(ways), np.inf), np.zeros(len(ways), int)
    for k, part in enumerate(parts):
        half = np.array(part["size_m"]) / 2
        half[2] = 1e-6 if part["kind"] == "plate" else half[2]
        centre = np.array(part["position_m"])
        with np.errstate(divide="ignore"):
            ends = np.stack([(centre + sign * half - eye) / ways for sign in (-1, 1)])
        enter, leave = ends.min(axis=0).max(axis=1), ends.max(axis=0).min(axis=1)
        hit = (enter <= leave) & (enter > 0) & (enter < nearest)
        nearest[hit], number[hit] = enter[hit], k + 1
    return number


# the frames of `labels`: not square, so that no width stands for a height
WIDTH, HEIGHT = 512, 440


def check_parts(out, coco):
    """The plane of parts against rays through the pixels, and the parts of COCO against the plane."""
    with open(SCENARIO, encoding="utf-8") as file:
        parts = json.load(file)["world"]["objects"][0]["shape"]["parts"]
    assert rows(out, "SELECT number, id, object, part FROM parts") == [
        (k + 1, 0, "target", part["name"]) for k, part in enumerate(parts)]
    found = rows(out, "SELECT s.x_px, s.y_px, s.range_m, s.q_body_from_gcrf_x, s.q_body_from_gcrf_y, s.q_body_from_gcrf_z,"
                      " s.q_body_from_gcrf_w, e.q_cam_from_gcrf_mid_x, e.q_cam_from_gcrf_mid_y, e.q_cam_from_gcrf_mid_z,"
                      " e.q_cam_from_gcrf_mid_w, f.fits_index FROM shapes s JOIN exposures e USING (sensor, exposure_id)"
                      " JOIN frames f USING (sensor, exposure_id)")
    row_, column = np.mgrid[0:HEIGHT, 0:WIDTH]
    scale = 120 * np.pi / 648000

    def direction(x, y):
        return np.stack([(x - (WIDTH - 1) / 2) * scale, (y - (HEIGHT - 1) / 2) * scale, np.ones_like(x, float)], axis=-1)

    with open(os.path.join(coco, "annotations.json"), encoding="utf-8") as file:
        boxes = [a["shape"]["parts"] for a in json.load(file)["annotations"] if a["category_id"] == 1]
    seen = set()
    with fits.open(os.path.join(out, "parts.fits")) as masks:
        for row, labelled in zip(found[::3], boxes[::3]):
            mask, to_cam = masks[row[11]].data, np.array(row[7:11])
            back = to_cam * [-1, -1, -1, 1]
            place = direction(np.array([row[0]]), np.array([row[1]]))[0]
            eye = turned(row[3:7], turned(back, -place / np.linalg.norm(place) * row[2]))
            ways = turned(row[3:7], turned(back, direction(column.ravel(), row_.ravel())))
            truth = first_part(parts, eye, ways).reshape(mask.shape)
            # a border is right to 0.35 px: pixels whose neighbours all have one part are exact
            inside = np.ones(mask.shape, bool)
            for shift in ((0, 1), (1, 0), (0, -1), (-1, 0), (1, 1), (1, -1), (-1, 1), (-1, -1)):
                inside &= np.roll(truth, shift, (0, 1)) == truth
            assert np.array_equal(mask[inside], truth[inside]) and np.count_nonzero(truth) > 500
            assert np.count_nonzero(mask != truth) < 0.35 * np.count_nonzero(~inside)
            seen |= set(np.unique(truth))
            assert {p["number"] for p in labelled} == set(np.unique(mask)) - {0}
            for part in labelled:
                rows_, columns = np.nonzero(mask == part["number"])
                assert part["name"] == parts[part["number"] - 1]["name"] and part["area"] == len(rows_)
                assert part["bbox"] == [columns.min(), rows_.min(), np.ptp(columns) + 1, np.ptp(rows_) + 1]
                assert part["segmentation"]
    assert seen == {0, 1, 2, 3, 4, 5}


def check_stars(out):
    """No star shines through the target: noise-free light of the stars where its parts cover the pixel."""
    hidden = rows(out, "SELECT count(*) FROM truth WHERE kind = 'star' AND occulted = 1")[0][0]
    covered = []
    with fits.open(os.path.join(out, "parts.fits")) as masks, fits.open(os.path.join(out, "stars.fits")) as stars:
        for mask, light in zip(masks[1:], stars[1:]):
            parts = {(f, x, y) for f, x, y in rows(out, "SELECT f.fits_index, t.x_mid_px, t.y_mid_px FROM truth t JOIN frames f"
                                                        " USING (sensor, exposure_id) WHERE t.kind = 'star' AND t.occulted = 1")
                     if masks[f].header["FRAMEID"] == mask.header["FRAMEID"]}
            for _, x, y in parts:
                column, row = round(x), round(y)
                # a contact within 0.7 px of the pixel's centre may be on either side
                near = mask.data[row - 1:row + 2, column - 1:column + 2]
                assert near.any()
                if near.all():
                    covered.append(light.data[row, column])
            for x, y in rows(out, "SELECT t.x_mid_px, t.y_mid_px FROM truth t WHERE t.kind = 'star' AND t.occulted = 0"
                                  f" AND t.exposure_id = {mask.header['FRAMEID']} AND t.in_field = 1"):
                column, row = round(x), round(y)
                if 1 <= row < HEIGHT - 1 and 1 <= column < WIDTH - 1:
                    assert not mask.data[row - 1:row + 2, column - 1:column + 2].all()
    assert hidden >= 5 and len(covered) >= 5 and max(covered) < 1e-9, (hidden, covered)


def labels(program, folder):
    """Truth and labels of the target at 60 m against its pixels: centroid of light, box, masks, COCO and SatNet."""
    out = os.path.join(folder, "labels")
    run(program, out, 7, {**NEAR, "/observers/0/sensors/0/camera/width_px": WIDTH,
                          "/observers/0/sensors/0/camera/height_px": HEIGHT, "/duration_s": 24, "/observers/0/orbit/offset_rtn_m": [0, -60, 0],
                          "/observers/0/burns": [], "/observers/0/sensors/0/exposure/exposure_s": 3e-5,
                          "/observers/0/sensors/0/modules/control/exposure_schedule": [],
                          "/record": {"frames": "extensions", "planes": ["stars", "segmentation", "parts"]}})
    coco, satnet = (os.path.join(folder, name) for name in ("coco", "satnet"))
    subprocess.run([program, "export", out, "--coco", coco, "--satnet", satnet], check=True, capture_output=True)
    check_parts(out, coco)
    check_stars(out)
    truth = rows(out, "SELECT s.exposure_id, s.item, s.x_px, s.y_px, s.x_light_px, s.y_light_px, s.x0_px, s.y0_px, s.x1_px,"
                      " s.y1_px, s.size_px, f.fits_index, t.x_chief_px, t.range_m FROM shapes s"
                      " JOIN frames f USING (sensor, exposure_id) JOIN truth t USING (sensor, exposure_id, item)")
    assert len(truth) >= 8
    light = np.array(rows(out, "SELECT d.v_mag - t.v_mag, d.flux_e / t.electrons FROM extended_targets e JOIN detections d USING"
                               " (sensor, exposure_id, item) JOIN truth t ON t.exposure_id = e.exposure_id AND t.kind = 'object'"))
    # one part in a hundred: what the threshold of the silhouette adds and leaves out
    assert len(light) >= 8 and np.abs(light - [0.0, 1.0]).max() < 0.02, light
    with open(os.path.join(coco, "annotations.json"), encoding="utf-8") as file:
        boxes = [a for a in json.load(file)["annotations"] if a["category_id"] == 1]
    assert len(boxes) == len(truth)
    with fits.open(os.path.join(out, "frames.fits")) as frames, fits.open(os.path.join(out, "segmentation.fits")) as masks:
        for row, box in zip(truth, boxes):
            item, (x, y, x_light, y_light, x0, y0, x1, y1, size) = row[1], row[2:11]
            image = frames[row[11]].data.astype(float) - 100.0
            rows_, columns = np.nonzero(masks[row[11]].data == item)
            light = image[rows_, columns]
            # what the mask leaves out: light below the sky's noise; saturation would show as well
            assert abs(np.sum(light * columns) / light.sum() - x_light) < 0.05
            assert abs(np.sum(light * rows_) / light.sum() - y_light) < 0.05
            # the PSF widens the box by 2.5 sigma or so; parts that are not lit narrow it
            assert x0 - 6 < columns.min() and columns.max() < x1 + 6 and y0 - 6 < rows_.min() and rows_.max() < y1 + 6
            assert abs(x - row[12]) < 1e-3 and x0 < x < x1 and y0 < y < y1
            # of a body of 4.7 m, foreshortened
            assert 0.25 < size * 120 * np.pi / 648000 * row[13] / 4.71 < 1.03
            assert abs(box["bbox"][2] - (x1 - x0) - 1.0) < 1e-6 and abs(box["shape"]["size_px"] - size) < 1e-9
            assert abs(box["shape"]["x_centre_of_mass"] - x - 0.5) < 1e-9 and len(box["segmentation"]) >= 1
    name = sorted(os.listdir(os.path.join(satnet, "Annotations")))[0]
    with open(os.path.join(satnet, "Annotations", name), encoding="utf-8") as file:
        target = [o for o in json.load(file)["data"]["objects"] if o["class_id"] == 1][0]
    # the same parts as COCO's, in fractions of the image
    for ours, theirs in zip(target["shape"]["parts"], boxes[0]["shape"]["parts"], strict=True):
        assert [ours[k] for k in ("name", "number", "area")] == [theirs[k] for k in ("name", "number", "area")]
        assert np.allclose([WIDTH, HEIGHT] * 2 * np.array(ours["bbox"]), theirs["bbox"], rtol=0, atol=1e-9)
        for polygon, px in zip(ours["segmentation"], theirs["segmentation"], strict=True):
            assert np.allclose([WIDTH, HEIGHT] * np.reshape(polygon, (-1, 2)), np.reshape(px, (-1, 2)), rtol=0, atol=1e-9)
    assert len(target["shape"]["parts"]) >= 2
    assert abs(target["shape"]["x_centre_of_mass"] * WIDTH - truth[0][2] - 0.5) < 1e-6
    assert abs(target["shape"]["y_centre_of_mass"] * HEIGHT - truth[0][3] - 0.5) < 1e-6
    assert abs(np.linalg.norm(target["shape"]["q_body_from_gcrf"]) - 1.0) < 1e-9


def main():
    program = os.path.abspath(sys.argv[1])
    seeds = int(sys.argv[2]) if len(sys.argv) > 2 else 0
    cases = [(seed, {**LAST, **tumbling(seed)}, 90, 100) for seed in range(1, seeds + 1)]
    # with the attitude of seed 101 the panels reflect nothing in four frames at 380 px
    cases += [(1, {}, 400, 390), (101, tumbling(101), 400, 390)] if seeds else [(1, NEAR, 30, 40)]
    known = [(seed, {**changes, **MODEL}, frames, size_px) for seed, changes, frames, size_px in cases]
    # without a model 9 of its 100 frames are above 3 %
    cases += known if seeds else [(206, {**LAST, **tumbling(206), **MODEL}, 90, 100)]
    errors, errors_known = [], []
    with tempfile.TemporaryDirectory() as folder:
        if not seeds:
            labels(program, folder)
        for seed, changes, frames, size_px in cases:
            out = os.path.join(folder, "run")
            run(program, out, seed, changes)
            result = judge(out)
            shown = figures(result)
            print(json.dumps({"seed": seed, **shown}), flush=True)
            with_model = MODEL.items() <= changes.items()
            (errors_known if with_model else errors).append(result["error"])
            if with_model:
                # measured: 0.4 to 1.1 % and up to 3.5 % of the frames (docs/results/closed_loop.md); the largest twice
                assert shown["rms_%"] <= 2.0 and shown["above_3_%"] <= 0.07 * shown["extended"], "fit of the model"
                assert 0.05 < normalised(out) < 2.0, "covariance of the fit"
            assert shown["lost"] == 0 and shown["tracks"] == 1, "the target was lost"
            assert shown["several"] == 0 and shown["rms_%"] <= 3.0, "centre of mass"
            assert shown["extended"] > frames and shown["first"] < 10 and shown["largest_px"] > size_px
            # the known size has a standard deviation for usual aspects; an array seen end on is beyond it
            assert np.median(np.abs(result["range_deviation"])) < 4.0, "range from the size"
            # over a whole approach many aspects show: 0.7 to 1.3 for the attitudes as shipped and of seeds 2
            # to 7, 2.5 for that of seed 101
            square = np.mean(result["range_deviation"]**2)
            assert frames < 400 or 0.4 < square < 3.0, f"range from the size: mean square {square:.2f}"
            subprocess.run(["rm", "-r", out], check=True)
    for name, found in (("outline", errors), ("model on board", errors_known)):
        e = np.concatenate(found)
        print(f"centre of mass, {name}: {100 * np.sqrt(np.mean(e**2)):.2f} % of the apparent size (RMS), "
              f"{100 * np.percentile(e, 95):.2f} % (95th percentile), {np.count_nonzero(e > 0.03)} of {len(e)} frames above "
              f"3 %, {len(found)} runs")


if __name__ == "__main__":
    main()
