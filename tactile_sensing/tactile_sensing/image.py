"""Properties of a pressure image that need no model."""

import math
from typing import Any

import numpy as np

from tactile_common.kernels import njit
from tactile_sensing.types.array import TactelArray
from tactile_sensing.types.moments import Moments


@njit(cache=True, error_model='numpy')
def moments_of(pressure: Any, x: Any, y: Any, threshold: float) -> tuple:
    """Return the sums M0, Mx, My, Mxx, Myy, Mxy of the pressure (rows, columns); NaN is 0."""
    m0 = mx = my = mxx = myy = mxy = 0.0
    for r in range(y.size):
        for c in range(x.size):
            value = pressure[r, c]
            if math.isfinite(value) and value >= threshold:
                m0 += value
                mx += value * x[c]
                my += value * y[r]
                mxx += value * x[c] * x[c]
                myy += value * y[r] * y[r]
                mxy += value * x[c] * y[r]
    return m0, mx, my, mxx, myy, mxy


@njit(error_model='numpy')
def without_spikes(values: np.ndarray) -> np.ndarray:
    """Limit positive values (rows, columns) to their highest neighbour; others and NaN are 0."""
    rows, columns = values.shape
    limited = np.zeros((rows, columns))
    for r in range(rows):
        for c in range(columns):
            if values[r, c] > 0.0:  # false for NaN
                around = 0.0
                for i in range(max(r - 1, 0), min(r + 2, rows)):
                    for j in range(max(c - 1, 0), min(c + 2, columns)):
                        if (i != r or j != c) and values[i, j] > around:
                            around = values[i, j]
                limited[r, c] = min(values[r, c], around)
    return limited


def image_moments(
        pressure: np.ndarray, array: TactelArray, *, threshold: float = 0.0) -> Moments:
    """
    Compute the moments of a pressure image (rows, columns) [Pa].

    NaN and values below the threshold [Pa] count as zero. The threshold is the only preprocessing
    of the thesis (3.5).
    """
    sums = moments_of(np.asarray(pressure, dtype=float), array.x, array.y,
                      threshold if threshold > 0.0 else -math.inf)
    cell = array.pitch_x * array.pitch_y
    return Moments(*(cell * value for value in sums))
