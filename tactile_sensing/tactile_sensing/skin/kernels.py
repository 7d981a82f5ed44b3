"""Pressure of a sharp point load for compiled loops, by the polynomials of `kernel`."""

import numpy as np

from tactile_common.kernels import FAST, njit, to_fixed_tuple
from tactile_sensing.skin.bumps import shape_of
from tactile_sensing.skin.kernel import CENTRE, DEGREE

TERMS = DEGREE + 1


def sharp_point(polynomials: np.ndarray, depth: float) -> np.ndarray:
    """Return the coefficients (TERMS,) for a normal point load, highest power of t first."""
    shape, slope = np.zeros((2, TERMS)), np.zeros((2, TERMS))
    shape_of(polynomials, depth, 0, 0.0, 0.0, shape, slope)
    return shape[0]


@njit(error_model='numpy')
def centre_of(depth: float) -> float:
    """Return c^2 of the polynomials' t = c^2 / (s + c^2) [m^2]."""
    return (CENTRE * depth) ** 2


@njit(error_model='numpy')
def coefficients_of(shape: np.ndarray) -> tuple[float, ...]:
    """Convert coefficients to a tuple, so that loops over them unroll and tactels vectorise."""
    return to_fixed_tuple(shape, TERMS)


@njit(error_model='numpy', fastmath=FAST)
def value_of(coefficients: tuple[float, ...], t: float) -> float:
    """Evaluate a polynomial, highest power first."""
    value = 0.0
    for coefficient in coefficients:
        value = value * t + coefficient
    return value
