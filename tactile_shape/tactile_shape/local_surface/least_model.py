"""Choice of the least surface: plane, sphere, cylinder or general, by chi-square."""
import math

import numpy as np

from tactile_shape.types.patch import Kind
from tactile_shape.types.tangent import Principal

# Chi-square exceeded by 1 % of samples with 1, 2 and 3 degrees of freedom.
LEVELS = (0.0, 6.635, 9.210, 11.345)
_ALIKE = np.array([1.0, 0.0, 1.0])  # of (K11, K12, K22): a sphere's


def along(heading: float) -> np.ndarray:
    """(K11, K12, K22) of the curvature 1 along a heading [rad] and none across."""
    c, s = math.cos(heading), math.sin(heading)
    return np.array([c * c, c * s, s * s])


def _gain(information: np.ndarray, right: np.ndarray, form: np.ndarray) -> float:
    """Chi-square that a curvature of a form (3,) takes away."""
    return (form @ right)**2 / (form @ information @ form)


def _best_cylinder(information: np.ndarray, right: np.ndarray) -> float:
    """
    Heading of the cylinder that takes away most chi-square [rad].

    With t the tangent of the heading it takes away p(t)^2 / q(t): at its largest
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
    Least of plane, sphere, cylinder and general whose chi-square is no worse than chance.

    Parameters
    ----------
    information, right : ndarray, shapes (3, 3) and (3,)
        Of (K11, K12, K22).
    count : int
        How many of them were seen, K22 last.

    Returns
    -------
    kind, curvature : Kind, ndarray (3,)
    """
    full = np.linalg.solve(information, right)
    most = full @ right
    if most < LEVELS[count]:
        return Kind.PLANE, np.zeros(3)
    form = along(_best_cylinder(information, right))
    cylinder = form @ right / (form @ information @ form) * form
    if count < 3:
        # A cylinder tells the curvature across the path from the other two, as long as it leans
        # little on what was not seen.
        return (Kind.CYLINDER, cylinder) if form[0] > 0.5 else (Kind.GENERAL, full)
    sphere_gap = most - _gain(information, right, _ALIKE)
    cylinder_gap = most - _gain(information, right, form)
    if sphere_gap < LEVELS[2] and sphere_gap < cylinder_gap + LEVELS[1]:
        return Kind.SPHERE, _ALIKE @ right / (_ALIKE @ information @ _ALIKE) * _ALIKE
    return (Kind.CYLINDER, cylinder) if cylinder_gap < LEVELS[1] else (Kind.GENERAL, full)


def curvature_covariance(kind: Kind, information: np.ndarray,
                         found: Principal) -> tuple[np.ndarray, np.ndarray]:
    """
    Covariance (2, 2) of the principal curvatures, and their variances (2,) by the data alone.

    What a model fixes has in the covariance what the data alone say.
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
