"""A run of the scene of skewed_scene.py, its tables, and the motion of what is in it by sgp4."""
import json
import os
import unittest

import numpy as np

import figures
import optics
import runs
from optics import columns
from skewed_scene import ELEMENTS, NORAD, OBSERVER, OFFSET_RTN_M, TICKS, scenario


class SkewedRun(unittest.TestCase):
    SOURCE, BINNING = "image", 2

    @classmethod
    def setUpClass(cls):
        cls.folder = runs.scratch()
        cls.out = os.path.join(cls.folder, "run")
        path = scenario(cls.folder)
        cls.manifest = runs.run(path, cls.out, f"{runs.SENSOR}/observation_source={cls.SOURCE}",
                                f"{runs.SENSOR}/exposure/binning={cls.BINNING}")
        with open(path, encoding="utf-8") as file:
            cls.scene = json.load(file)
        cls.sensor = cls.scene["observers"][0]["sensors"][0]
        cls.eye = figures.Orbit(ELEMENTS, OBSERVER, cls.scene["epoch_utc"])
        cls.target = figures.Orbit(ELEMENTS, NORAD, cls.scene["epoch_utc"])
        cls.camera = optics.Camera(cls.sensor["camera"])
        cls.db = runs.database(cls.out)
        cls.tables = {row[0]: cls.db.execute(f'SELECT * FROM "{row[0]}" ORDER BY rowid').fetchall()
                      for row in cls.db.execute('SELECT "table" FROM tables').fetchall()}
        cls.exposures = cls.tables["exposures"]
        cls.los = cls.by_tick("los_truth")
        cls.in_frame = {name: {e["exposure_id"]: [] for e in cls.exposures} for name in ("truth", "detections", "tracks")}
        for name, frames in cls.in_frame.items():
            for row in cls.tables[name]:
                frames[row["exposure_id"]].append(row)

    @classmethod
    def by_tick(cls, name):
        return {row["tick"]: row for row in cls.tables[name]}

    def close(self, found, expected, tolerance, *words):
        self.assertLessEqual(np.max(np.abs(np.asarray(found, float) - np.asarray(expected, float))), tolerance, words)

    @classmethod
    def velocity(cls, orbit, seconds, step=0.5):
        """Of the positions: SGP4's own velocity is off by some cm/s."""
        return (orbit.position(seconds + step) - orbit.position(seconds - step)) / (2 * step)

    @classmethod
    def rtn(cls, position, velocity):
        """The axes R, T, N as rows."""
        r, n = position / np.linalg.norm(position), np.cross(position, velocity)
        n = n / np.linalg.norm(n)
        return np.array([r, np.cross(n, r), n])

    @classmethod
    def neighbour(cls, seconds):
        place = cls.target.position(seconds)
        return place + OFFSET_RTN_M @ cls.rtn(place, cls.velocity(cls.target, seconds))

    def earth(self, exposure):
        return columns(exposure, "velocity_bary", tail="_mps") - columns(exposure, "observer_gcrf", tail="_mps")

    def seen_from(self, exposure, place, seconds):
        """Geometric direction with light time, where and when the light left: docs/reference/conventions.md, Light."""
        here, delay = columns(exposure, "observer_gcrf", tail="_m"), 0.0
        for _ in range(4):
            there = place(seconds - delay)
            line = there - self.earth(exposure) * delay - here
            delay = np.linalg.norm(line) / optics.LIGHT_MPS
        return line / np.linalg.norm(line), there, np.linalg.norm(line)

    def apparent_path(self, exposure, place, seconds):
        """Apparent directions of an orbit at instants of an exposure: a parabola through three of them."""
        corners, seen = (seconds[0], exposure["mid_s"], seconds[-1]), []
        for s in corners:
            moved = dict(zip(exposure.keys(), exposure))
            moved.update(zip((f"observer_gcrf_{k}_m" for k in "xyz"), self.eye.position(s)))
            seen.append(optics.apparent(moved, self.seen_from(moved, place, s)[0]))
        weights = np.array([[np.prod([(s - corners[j]) / (corners[i] - corners[j]) for j in range(3) if j != i])
                             for i in range(3)] for s in seconds])
        return weights @ np.array(seen)

    def tracking(self):
        """Exposures from the second frame in mode track on."""
        begun = min(row["tick"] for row in self.tables["control"] if row["mode"] == "track")
        return [e for e in self.exposures if e["start_tick"] > begun + TICKS]
