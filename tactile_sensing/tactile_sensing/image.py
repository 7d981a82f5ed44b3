"""What a picture of the pressure tells by itself."""

import math
from typing import Any, NamedTuple

import numpy as np

from tactile_common.kernels import njit
from tactile_sensing.types.array import TactelArray
from tactile_sensing.types.moments import Moments


@njit(cache=True, error_model='numpy')
def moments_of(pressure: Any, x: Any, y: Any, threshold: float) -> tuple:
    """Sums of pressure (rows, columns) over M0, Mx, My, Mxx, Myy, Mxy; NaN counts as 0."""
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


def image_moments(
        pressure: np.ndarray, array: TactelArray, *, threshold: float = 0.0) -> Moments:
    """
    Moments of a pressure image (rows, columns) [Pa]; NaN counts as zero.

    So do values below the threshold [Pa], the thesis' only preprocessing (3.5).
    """
    sums = moments_of(np.asarray(pressure, dtype=float), array.x, array.y,
                      threshold if threshold > 0.0 else -math.inf)
    cell = array.pitch_x * array.pitch_y
    return Moments(*(cell * value for value in sums))


class Survey(NamedTuple):
    """What is seen of an image before anything is fitted."""

    moments: tuple  # of the main layer, see `moments_of`
    top: float  # highest pressure of the main layer
    total: float  # sum of its readings
    live: int  # tactels of it that are read
    highest: int  # tactels of it at the top
    clipped: int  # tactels of all layers at or above full scale
    missing: int  # tactels of all layers that are not read


@njit(cache=True, error_model='numpy')
def survey(frame: Any, main: int, full: Any, pad: Any) -> Survey:
    """
    See what is in an image before anything is fitted.

    The frame (layers, rows, columns) is NaN where there is no reading; `main` is the layer that is
    looked at, `full` the full scale of each (layers,), infinite if there is none.
    """
    top, total, live, highest, clipped, missing = -np.inf, 0.0, 0, 0, 0, 0
    for k in range(frame.shape[0]):
        for value in frame[k].flat:
            if np.isnan(value):
                missing += 1
                continue
            clipped += value >= full[k]
            if k == main:
                total, live = total + value, live + 1
                if value > top:
                    top, highest = value, 0
                highest += value == top
    return Survey(moments_of(frame[main], pad.x, pad.y, -np.inf), top, total, live, highest,
                  clipped, missing)
