"""Tangent frames, principal axes and the reduced form of a surface over its tangent plane."""
import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike


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


def principal(k11: float, k12: float, k22: float) -> Principal:
    """Return the eigenvalues of a symmetric 2 x 2 matrix, larger first, and the first angle."""
    mean, half = 0.5 * (k11 + k22), 0.5 * (k11 - k22)
    radius = math.hypot(half, k12)
    return Principal(mean + radius, mean - radius, 0.5 * math.atan2(k12, half))


def principal_curvatures(k11: float, k12: float, k22: float) -> Principal:
    """Do the same as `principal`, but with the eigenvalue larger in magnitude first."""
    found = principal(k11, k12, k22)
    if abs(found.second) > abs(found.first):
        return Principal(found.second, found.first, found.heading + 0.5 * math.pi)
    return found


def turn_about_z(heading: float) -> np.ndarray:
    """Return the rotation (3, 3) about z that turns x to a heading [rad]."""
    c, s = math.cos(heading), math.sin(heading)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def height(curvature: ArrayLike, points: ArrayLike) -> np.ndarray:
    """
    Return the height over the tangent plane: z (1 + n_z) / 2 = u' K u / 2, n_xy = -K u.

    K is (2, 2) [1/m], the points u are (..., 2) [m]. This reduced form is exact for plane, sphere
    and cylinder, however large the arc. It is NaN beyond the border, where the surface is
    perpendicular to the tangent plane.
    """
    points = np.asarray(points, dtype=float)
    slope = points @ np.asarray(curvature, dtype=float)
    with np.errstate(invalid='ignore'):
        upright = np.sqrt(1.0 - (slope**2).sum(axis=-1))
    return (slope * points).sum(axis=-1) / (1.0 + upright)
