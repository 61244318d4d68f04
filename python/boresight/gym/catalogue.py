"""Targets of a constellation: their catalogued positions, from element sets by SGP4."""
from __future__ import annotations

import csv
import datetime
import io
import pathlib
from typing import Any, Dict, List, NamedTuple, Sequence, Tuple

import numpy as np
import numpy.typing as npt

from ..errors import ArgumentError
from ..program import execute, work_folder

Array = npt.NDArray[np.float64]
EARTH_RADIUS_M = 6378137.0  # WGS 84
STEP_S = 10.0               # of the table of positions


class Catalogue(NamedTuple):
    """Positions of targets, GCRF, in metres, in a table of STEP_S seconds."""
    names: List[str]
    norad: npt.NDArray[np.int64]
    positions_m: Array  # [targets, times, 3]

    def at(self, time_s: float) -> Array:
        """Positions at a time since the epoch [targets, 3], by cubic interpolation (error below
        1 m for geostationary satellites)."""
        k = int(np.clip(time_s / STEP_S, 1, self.positions_m.shape[1] - 3))
        t = time_s / STEP_S - k
        p = [self.positions_m[:, k + j] for j in (-1, 0, 1, 2)]
        weights = (-t * (t - 1) * (t - 2) / 6, (t + 1) * (t - 1) * (t - 2) / 2,
                   -(t + 1) * t * (t - 2) / 2, (t + 1) * t * (t - 1) / 6)  # of Lagrange
        return np.asarray(sum(w * q for w, q in zip(weights, p)))


def geostationary(elements_file: pathlib.Path, count: int) -> List[Tuple[str, str, str]]:
    """`count` element sets near the geostationary ring, evenly from a file of three-line sets."""
    lines = elements_file.read_text(encoding="utf-8").splitlines()
    found = [(a.strip(), b, c) for a, b, c in zip(lines, lines[1:], lines[2:])
             if b.startswith("1 ") and c.startswith("2 ")
             and 1.002 < float(c[52:63]) < 1.0035 and float("0." + c[26:33]) < 0.01]
    if len(found) < count:
        raise ArgumentError(f"{elements_file} has {len(found)} geostationary satellites, fewer than "
                            f"{count}")
    return [found[k * len(found) // count] for k in range(count)]


def propagated(sets: Sequence[Tuple[str, str, str]], epoch_utc: str,
               duration_s: float) -> Catalogue:
    """The catalogue of some element sets, over a run (`boresight propagate`)."""
    start = datetime.datetime.fromisoformat(epoch_utc.rstrip("Z"))
    stop = start + datetime.timedelta(seconds=duration_s + 10 * STEP_S)
    with work_folder() as folder:
        file = folder / "targets.tle"
        file.write_text("".join(f"{a}\n{b}\n{c}\n" for a, b, c in sets), encoding="utf-8")
        text = execute(["propagate", "--elements", str(file), "--start", epoch_utc, "--stop",
                        stop.isoformat() + "Z", "--step", str(STEP_S), "--frame", "gcrf"])
    rows: Dict[int, List[Any]] = {}
    for row in csv.DictReader(io.StringIO(text)):
        rows.setdefault(int(row["norad"]), []).append(
            [1e3 * float(row[axis]) for axis in ("x_km", "y_km", "z_km")])
    norad = [int(b[2:7]) for _, b, _ in sets]
    return Catalogue([a for a, _, _ in sets], np.array(norad, np.int64),
                     np.array([rows[n] for n in norad]))


def visible(eye_m: Array, targets_m: Array, sun_m: Array, sun_keep_out_deg: float = 30.0,
            limb_km: float = 100.0) -> npt.NDArray[np.bool_]:
    """Whether targets [n, 3] are in sunlight, clear of the Earth and of the Sun for an eye."""
    sight = targets_m - eye_m
    distance = np.linalg.norm(sight, axis=1)
    unit = sight / distance[:, None]
    nearest = np.clip(-(unit @ eye_m), 0, distance)  # way to the point nearest to the Earth
    clear = np.linalg.norm(eye_m + nearest[:, None] * unit, axis=1) > (EARTH_RADIUS_M
                                                                       + 1e3 * limb_km)
    sun = sun_m / np.linalg.norm(sun_m)
    away = unit @ sun < np.cos(np.radians(sun_keep_out_deg))
    along = targets_m @ sun
    across = np.linalg.norm(targets_m - along[:, None] * sun, axis=1)
    return np.asarray(clear & away & ~((along < 0) & (across < EARTH_RADIUS_M)))
