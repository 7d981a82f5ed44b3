"""Choice of the simplest surface by chi-square: plane, sphere, cylinder or general."""
import math

import numpy as np

from tactile_shape.types.patch import Kind
from tactile_shape.types.tangent import Principal

# Values of chi-square that 1 % of samples exceed, for 1, 2 and 3 degrees of freedom.
LEVELS = (0.0, 6.635, 9.210, 11.345)
_ALIKE = np.array([1.0, 0.0, 1.0])  # (K11, K12, K22) of a sphere


def along(heading: float) -> np.ndarray:
    """Return (K11, K12, K22) for curvature 1 along a heading [rad] and 0 across it."""
    c, s = math.cos(heading), math.sin(heading)
    return np.array([c * c, c * s, s * s])


def _gain(information: np.ndarray, right: np.ndarray, form: np.ndarray) -> float:
    """Return the reduction of chi-square by the best curvature of a form (3,)."""
    return (form @ right)**2 / (form @ information @ form)


def _best_cylinder(information: np.ndarray, right: np.ndarray) -> float:
    """
    Return the heading of the cylinder that reduces chi-square most [rad].

    With t the tangent of the heading, the reduction is p(t)^2 / q(t). At its maximum
    2 p' q = p q', a polynomial of degree 4.
    """
    p, i = right[::-1], information
    q = np.array([i[2, 2], 2.0 * i[1, 2], i[1, 1] + 2.0 * i[0, 2], 2.0 * i[0, 1], i[0, 0]])
    stationary = (2.0 * np.convolve(p[:2] * [2.0, 1.0], q)
                  - np.convolve(p, q[:4] * [4.0, 3.0, 2.0, 1.0]))
    headings = [0.5 * math.pi, *np.arctan(np.roots(stationary[1:]).real).tolist()]
    return max(headings, key=lambda heading: _gain(information, right, along(heading)))


def least_model(information: np.ndarray, right: np.ndarray,
                count: int) -> tuple[Kind, np.ndarray]:
    """
    Choose the simplest of plane, sphere, cylinder and general that chi-square does not reject.

    `information` (3, 3) and `right` (3,) are the normal equations of (K11, K12, K22), of which the
    first `count` were seen. Returns the kind and the curvature (3,).
    """
    full = np.linalg.solve(information, right)
    most = full @ right
    if most < LEVELS[count]:
        return Kind.PLANE, np.zeros(3)
    form = along(_best_cylinder(information, right))
    cylinder = form @ right / (form @ information @ form) * form
    if count < 3:
        # A cylinder gives the curvature across the path from the other two, provided that it
        # depends little on the unseen element.
        return (Kind.CYLINDER, cylinder) if form[0] > 0.5 else (Kind.GENERAL, full)
    sphere_gap = most - _gain(information, right, _ALIKE)
    cylinder_gap = most - _gain(information, right, form)
    if sphere_gap < LEVELS[2] and sphere_gap < cylinder_gap + LEVELS[1]:
        return Kind.SPHERE, _ALIKE @ right / (_ALIKE @ information @ _ALIKE) * _ALIKE
    return (Kind.CYLINDER, cylinder) if cylinder_gap < LEVELS[1] else (Kind.GENERAL, full)


def curvature_covariance(kind: Kind, information: np.ndarray,
                         found: Principal) -> tuple[np.ndarray, np.ndarray]:
    """
    Return the covariance (2, 2) of the principal curvatures and their variances (2,).

    The variances come from the data alone. The covariance also uses them for curvatures that the
    model fixes.
    """
    covariance = np.linalg.inv(information)
    form, across = along(found.heading), along(found.heading + 0.5 * math.pi)
    both = np.array([form, across]) * [1.0, 2.0, 1.0]
    free = both @ covariance @ both.T
    seen = np.diag(free).copy()
    if kind == Kind.SPHERE:
        return np.full((2, 2), 1.0 / (_ALIKE @ information @ _ALIKE)), seen
    if kind == Kind.GENERAL:
        return free, seen
    if kind == Kind.CYLINDER:
        c, s = math.cos(found.heading), math.sin(found.heading)
        turn = found.first * np.array([-2.0 * c * s, c * c - s * s, 2.0 * c * s])
        both = np.array([form, turn])  # per curvature and per angle
        (kk, ka), (_, aa) = both @ information @ both.T
        seen_of_it = 1.0 / (kk - ka * ka / aa) if aa > 0.0 else 1.0 / kk
        return np.diag([seen_of_it, seen[1]]), seen
    return np.diag(seen), seen
