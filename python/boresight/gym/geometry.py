"""Directions of pixels, and line-of-sight commands in camera axes."""
from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

Vector = npt.NDArray[np.float64]


def gcrf_of_cam(q_cam_from_gcrf: Any, vector: Any) -> Vector:
    """A vector in camera axes in GCRF axes, by the conjugate of a quaternion (x, y, z, w)."""
    q, v = np.asarray(q_cam_from_gcrf, np.float64), np.asarray(vector, np.float64)
    u, w = -q[:3], q[3]
    return np.asarray(v + 2.0 * np.cross(u, np.cross(u, v) + w * v))


def cam_of_gcrf(q_cam_from_gcrf: Any, vector: Any) -> Vector:
    """A vector in GCRF axes in camera axes."""
    q = np.asarray(q_cam_from_gcrf, np.float64)
    return gcrf_of_cam([-q[0], -q[1], -q[2], q[3]], vector)


def tilted(q_cam_from_gcrf: Any, x_rad: float, y_rad: float) -> Vector:
    """Direction in GCRF of a point beside the boresight: angles along camera +x and +y."""
    v = gcrf_of_cam(q_cam_from_gcrf, [np.tan(x_rad), np.tan(y_rad), 1.0])
    return np.asarray(v / np.linalg.norm(v))
