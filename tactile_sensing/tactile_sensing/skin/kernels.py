"""Pressure of a sharp point load for compiled loops, by the polynomials of `kernel`."""

import numpy as np

from tactile_common.kernels import njit
from tactile_sensing.skin.bumps import shape_of, TERMS
from tactile_sensing.skin.kernel import CENTRE


def sharp_point(polynomials: np.ndarray, depth: float) -> np.ndarray:
    """Return the coefficients (TERMS,) for a normal point load, highest power of t first."""
    shape, slope = np.zeros((2, TERMS)), np.zeros((2, TERMS))
    shape_of(polynomials, depth, 0, 0.0, 0.0, shape, slope)
    return shape[0]


@njit(error_model='numpy')
def centre_of(depth: float) -> float:
    """Return c^2 of the polynomials' t = c^2 / (s + c^2) [m^2]."""
    return (CENTRE * depth) ** 2
