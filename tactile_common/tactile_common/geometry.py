"""Angles and vectors."""
from typing import Any

import numpy as np

from tactile_common.kernels import njit


@njit(cache=True)
def wrap_angle(angle: Any) -> Any:
    """Wrap an angle, or an array of angles, to within half a turn [rad]; kernels may call it."""
    return np.arctan2(np.sin(angle), np.cos(angle))


def cross(a: Any, b: Any) -> np.ndarray:
    """Return the cross product (3,) of two vectors (3,); numpy's takes many times longer."""
    (ax, ay, az), (bx, by, bz) = np.asarray(a).tolist(), np.asarray(b).tolist()
    return np.array([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx])
