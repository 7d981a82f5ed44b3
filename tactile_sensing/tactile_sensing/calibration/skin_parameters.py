"""
What presses of a ball have in common: the skin as numbers that a fit steps through, and the patch.

The numbers are the logarithm of the depth, depth over thickness, and Poisson's ratio.
"""

from collections.abc import Sequence
import math

import numpy as np

from tactile_sensing.types.skin import Skin

STEPS = 1e-3, 1e-3, 5e-3  # for derivatives
ASSUMED_POISSON, POISSON_STD = 0.45, 0.1  # of a soft skin, before the presses tell it


def skin_of(theta: np.ndarray) -> Skin:
    """Skin of the three numbers."""
    depth, ratio = math.exp(theta[0]), min(max(theta[1], 0.0), 1.0)
    return Skin(depth, depth / ratio if ratio > 1e-3 else math.inf, min(max(theta[2], 0.0), 0.5))


def parameters_of(skin: Skin) -> np.ndarray:
    """Return the three numbers of a skin."""
    return np.array([math.log(skin.depth), skin.depth / skin.thickness, skin.poisson])


def moved_skins(theta: np.ndarray, free: Sequence[int]) -> list[tuple[Skin, float]]:
    """Skins with one of the free numbers a step further, and that step."""
    moved = []
    for k in free:
        sign = -1.0 if (k == 1 and theta[1] > 0.99) or (k == 2 and theta[2] > 0.49) else 1.0
        other = theta.copy()
        other[k] += sign * STEPS[k]
        moved.append((skin_of(other), sign * STEPS[k]))
    return moved


def allow_for_poisson(covariance: np.ndarray, step: np.ndarray) -> np.ndarray:
    """
    Covariance of a fit of everything, about one with an assumed Poisson's ratio.

    The step is what would lead from that to the ratio that presses and assumption make likeliest:
    not large enough to be told, but what was fitted is off by what follows from it.
    """
    follows = covariance[:, 2] / covariance[2, 2]
    return covariance + step[2]**2 * np.outer(follows, follows)


def patch_radius(patch: float, ball_radius: float, level: float, skin: Skin) -> float:
    """Radius of the patch of a ball [m], by Hertz' law of its force over the usual one."""
    return min(patch * ball_radius * level ** (1 / 3), 0.95 * ball_radius, 1.4 * skin.depth)


def levels(forces: np.ndarray) -> np.ndarray:
    """Forces over the usual one, (N,)."""
    forces = np.maximum(forces, 1e-12)
    return np.clip(forces / np.median(forces), 0.05, 20.0)
