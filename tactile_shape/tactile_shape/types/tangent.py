"""Tangent frames and principal axes."""
import math
from typing import NamedTuple

import numpy as np


def tangent_frame(normal: np.ndarray) -> np.ndarray:
    """Return a right-handed frame (3, 3) whose third column is a unit normal (3,)."""
    x, y, z = normal
    # Frisvad's basis after Duff et al.: smooth except at z = 0, without division by zero.
    sign = 1.0 if z >= 0.0 else -1.0
    a = -1.0 / (sign + z)
    b = x * y * a
    return np.array([[1.0 + sign * x * x * a, b, x],
                     [sign * b, sign + y * y * a, y],
                     [-sign * x, -y, z]])


class Principal(NamedTuple):
    """Principal curvatures [1/m] or eigenvalues, and the angle of the first direction [rad]."""

    first: float
    second: float
    heading: float


def principal_curvatures(k11: float, k12: float, k22: float) -> Principal:
    """Return the eigenvalues of a symmetric 2 x 2 matrix, larger magnitude first, and angle."""
    mean, half = 0.5 * (k11 + k22), 0.5 * (k11 - k22)
    radius, heading = math.hypot(half, k12), 0.5 * math.atan2(k12, half)
    if abs(mean - radius) > abs(mean + radius):
        return Principal(mean - radius, mean + radius, heading + 0.5 * math.pi)
    return Principal(mean + radius, mean - radius, heading)


def turn_about_z(heading: float) -> np.ndarray:
    """Return the rotation (3, 3) about z that turns x to a heading [rad]."""
    c, s = math.cos(heading), math.sin(heading)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
