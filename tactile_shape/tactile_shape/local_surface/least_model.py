"""Compiled choice of the least surface: plane, sphere, cylinder or general, by chi-square."""
import math
from typing import NamedTuple

import numpy as np

from tactile_common.kernels import njit
from tactile_shape.types.patch import Kind

PLANE, CYLINDER, SPHERE, GENERAL = (
    int(kind) for kind in (Kind.PLANE, Kind.CYLINDER, Kind.SPHERE, Kind.GENERAL))
# Chi-square exceeded by 1 % of samples with 1, 2 and 3 degrees of freedom.
LEVELS = np.array([0.0, 6.635, 9.210, 11.345])
_HEADINGS = 48


@njit(cache=True)
def principal_curvatures(c11, c12, c22):
    """Eigenvalues of a symmetric 2 x 2, the larger first, and the first direction's angle."""
    mean, half = 0.5 * (c11 + c22), 0.5 * (c11 - c22)
    radius = math.hypot(half, c12)
    return mean + radius, mean - radius, 0.5 * math.atan2(c12, half)


class _Cylinder(NamedTuple):
    gain: float  # chi-square that it takes away
    curvature: float
    heading: float  # of that curvature [rad]


@njit(cache=True)
def _cylinder(information, right, heading):
    c, s = math.cos(heading), math.sin(heading)
    d0, d1, d2 = c * c, c * s, s * s
    r11, r12, r22 = right
    slope = d0 * r11 + d1 * r12 + d2 * r22
    bend = (d0 * (information[0, 0] * d0 + 2.0 * information[0, 1] * d1
                  + 2.0 * information[0, 2] * d2)
            + d1 * (information[1, 1] * d1 + 2.0 * information[1, 2] * d2)
            + information[2, 2] * d2 * d2)
    return _Cylinder(slope * slope / bend, slope / bend, heading)


@njit(cache=True)
def _best_cylinder(information, right):
    """Best cylinder of any heading: the best of a grid, then by golden section."""
    best = _cylinder(information, right, 0.0)
    width = math.pi / _HEADINGS
    for i in range(1, _HEADINGS):
        other = _cylinder(information, right, i * width)
        if other.gain > best.gain:
            best = other
    low, high = best.heading - width, best.heading + width
    for _ in range(40):
        left, right_of_it = low + 0.382 * (high - low), low + 0.618 * (high - low)
        if (_cylinder(information, right, left).gain
                > _cylinder(information, right, right_of_it).gain):
            high = right_of_it
        else:
            low = left
    return _cylinder(information, right, 0.5 * (low + high))


@njit(cache=True)
def least_model(information, right, count):
    """
    Least of plane, sphere, cylinder and general whose chi-square is no worse than chance.

    `information` and `right` are of (K11, K12, K22); `count` of them were seen, K22 last.
    Returns kind and the curvature of that model.
    """
    full = np.linalg.solve(information, right)
    most = full @ right
    if most < LEVELS[count]:
        return PLANE, np.zeros(3)
    best = _best_cylinder(information, right)
    c, s = math.cos(best.heading), math.sin(best.heading)
    cylinder = best.curvature * np.array([c * c, c * s, s * s])
    if count < 3:
        # A cylinder tells the curvature across the path from the other two, as long as it leans
        # little on what was not seen.
        if c * c > 0.5:
            return CYLINDER, cylinder
        return GENERAL, full
    slope = right[0] + right[2]  # along K11 and K22 alike
    bend = information[0, 0] + 2.0 * information[0, 2] + information[2, 2]
    sphere_gap, cylinder_gap = most - slope * slope / bend, most - best.gain
    if sphere_gap < LEVELS[2] and sphere_gap < cylinder_gap + LEVELS[1]:
        return SPHERE, slope / bend * np.array([1.0, 0.0, 1.0])
    if cylinder_gap < LEVELS[1]:
        return CYLINDER, cylinder
    return GENERAL, full


@njit(cache=True)
def curvature_covariance(kind, information, k1, heading):
    """Covariance of the principal curvatures, of what a model fixes the data's; variances."""
    covariance = np.linalg.inv(information)
    c, s = math.cos(heading), math.sin(heading)
    along, across = np.array([c * c, 2 * c * s, s * s]), np.array([s * s, -2 * c * s, c * c])
    v11, v12, v22 = (along @ covariance @ along, along @ covariance @ across,
                     across @ covariance @ across)
    seen = np.array([v11, v22])
    if kind == SPHERE:
        bend = information[0, 0] + 2.0 * information[0, 2] + information[2, 2]
        return np.full((2, 2), 1.0 / bend), seen
    if kind == CYLINDER:
        d = np.array([c * c, c * s, s * s])
        e = k1 * np.array([-2 * c * s, c * c - s * s, 2 * c * s])
        dd, de, ee = d @ information @ d, d @ information @ e, e @ information @ e
        v11 = 1.0 / (dd - de * de / ee) if ee > 0.0 else 1.0 / dd
        v12 = 0.0
    elif kind == PLANE:
        v12 = 0.0
    return np.array([[v11, v12], [v12, v22]]), seen
