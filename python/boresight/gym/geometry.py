"""Directions of pixels, and line-of-sight commands in camera axes."""
from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

Vector = npt.NDArray[np.float64]


def cross(a: Vector, b: Vector) -> Vector:
    """Cross product of vectors [..., 3]; numpy.cross takes longer for few of them."""
    out = np.empty(np.broadcast(a, b).shape)
    for k in range(3):
        i, j = (k + 1) % 3, (k + 2) % 3
        out[..., k] = a[..., i] * b[..., j] - a[..., j] * b[..., i]
    return out


def gcrf_of_cam(q_cam_from_gcrf: Any, vector: Any) -> Vector:
    """Vectors [..., 3] in camera axes in GCRF axes, by the conjugates of quaternions [..., 4]
    (x, y, z, w)."""
    q, v = np.asarray(q_cam_from_gcrf, np.float64), np.asarray(vector, np.float64)
    u, w = -q[..., :3], q[..., 3:]
    return np.asarray(v + 2.0 * cross(u, cross(u, v) + w * v))


def cam_of_gcrf(q_cam_from_gcrf: Any, vector: Any) -> Vector:
    """A vector in GCRF axes in camera axes."""
    q = np.asarray(q_cam_from_gcrf, np.float64)
    return gcrf_of_cam([-q[0], -q[1], -q[2], q[3]], vector)


def tilted(q_cam_from_gcrf: Any, x_rad: float, y_rad: float) -> Vector:
    """Direction in GCRF of a point beside the boresight: angles along camera +x and +y."""
    v = gcrf_of_cam(q_cam_from_gcrf, [np.tan(x_rad), np.tan(y_rad), 1.0])
    return np.asarray(v / np.linalg.norm(v))
