"""Where a fit starts, and which tactels it uses: peak, vertex, principal axis; all compiled."""

import numpy as np

from tactile_common.kernels import njit
from tactile_sensing.half_space.layers import PRESSURE

SPIKE = 0.05  # share of a tactel that one of those around it has, unless it is stuck
MIN_AROUND = 3  # live tactels around one that tell
X, Y, VALUE = range(3)  # rows of `gauss_newton.Tactels.at`
START_LEVEL = 0.25  # tactels above this fraction of the peak give the principal axis


@njit(error_model='numpy')
def is_spike(image, row, column):
    """Whether a tactel stands alone, as no load under a skin makes it."""
    highest = -np.inf
    around = 0
    for r in range(max(row - 1, 0), min(row + 2, image.shape[0])):
        for c in range(max(column - 1, 0), min(column + 2, image.shape[1])):
            if np.isfinite(image[r, c]) and (r != row or c != column):
                around += 1
                highest = max(highest, image[r, c])
    return around >= MIN_AROUND and highest < SPIKE * image[row, column]


@njit(error_model='numpy')
def peak(stress, layers):
    """Layer, row and column of the largest pressure over its noise; layer -1 if none."""
    best = 0.0
    layer = row = column = -1
    for k in range(stress.shape[0]):
        if layers[k].component != PRESSURE:
            continue
        level = best * layers[k].noise
        for r in range(stress.shape[1]):
            for c in range(stress.shape[2]):
                # False for NaN.
                if level < stress[k, r, c] < np.inf and not is_spike(stress[k], r, c):
                    level = stress[k, r, c]
                    layer, row, column = k, r, c
        best = max(best, level / layers[k].noise)
    return layer, row, column


@njit(error_model='numpy')
def _vertex(line, peak):
    """How far the vertex of a row of tactels is off its peak [pitches]; 0 where unknown."""
    if line.size < 3:
        return 0.0
    middle = min(max(peak, 1), line.size - 2)
    left, right = line[middle - 1], line[middle + 1]
    if not (left > 0.0 and line[middle] > 0.0 and right > 0.0):  # false for NaN
        return 0.0
    # Without shear pressure^(-2/5) is a parabola in x and in y, so its vertex is exact.
    f = (left / line[middle]) ** -0.4
    h = (right / line[middle]) ** -0.4
    curvature = f + h - 2.0
    if not 0.0 < curvature < np.inf:
        return 0.0
    return min(max(middle - peak + 0.5 * (f - h) / curvature, -0.5), 0.5)


@njit(error_model='numpy')
def guess_point(stress, layers):
    """Row and column of the peak, and how far its vertex is off: (r, c, along y, along x)."""
    k, r, c = peak(stress, layers)
    if k < 0:
        return -1, -1, 0.0, 0.0
    return r, c, _vertex(stress[k, :, c], r), _vertex(stress[k, r], c)


@njit(error_model='numpy')
def guess_line(stress, sensor, layers):
    """Principal axis of the tactels above START_LEVEL of the peak: (rho, yaw)."""
    layer, row, column = peak(stress, layers)
    if layer < 0:
        return np.nan, np.nan
    x, y, image = sensor.x, sensor.y, stress[layer]
    highest = image[row, column]
    level = START_LEVEL * highest
    m = mx = my = mxx = myy = mxy = 0.0
    for r in range(image.shape[0]):
        for c in range(image.shape[1]):
            w = min(image[r, c], highest) - level  # a stuck tactel pulls no more than others
            if 0.0 < w < np.inf:
                m += w
                mx += w * x[c]
                my += w * y[r]
                mxx += w * x[c] * x[c]
                myy += w * y[r] * y[r]
                mxy += w * x[c] * y[r]
    mx /= m
    my /= m
    yaw = -0.5 * np.arctan2(
        2.0 * (mxy / m - mx * my), (myy / m - my * my) - (mxx / m - mx * mx))
    return mx * np.cos(yaw) + my * np.sin(yaw), yaw


@njit(error_model='numpy')
def gather_window(stress, sensor, layers, row, column, v, w, at):
    """Finite tactels of all layers around a point; their number."""
    # Relative to the peak, so that whole-tactel shifts cannot change the window.
    r0 = max(row + int(np.ceil(v - sensor.window)), 0)
    r1 = min(row + int(np.floor(v + sensor.window)) + 1, stress.shape[1])
    c0 = max(column + int(np.ceil(w - sensor.window)), 0)
    c1 = min(column + int(np.floor(w + sensor.window)) + 1, stress.shape[2])
    n = 0
    for k in range(stress.shape[0]):
        n = _gather(stress[k], sensor, layers[k].noise, r0, r1, c0, c1, at, n)
        layers[k].end = n
    return n


@njit(error_model='numpy')
def gather_pressure(stress, sensor, layers, at):
    """Finite tactels of the pressure layers; their number."""
    n = 0
    for k in range(stress.shape[0]):
        if layers[k].component == PRESSURE:
            n = _gather(stress[k], sensor, layers[k].noise, 0, stress.shape[1], 0,
                        stress.shape[2], at, n)
        layers[k].end = n
    return n


@njit(error_model='numpy')
def _gather(image, sensor, noise, r0, r1, c0, c1, at, n):
    for r in range(r0, r1):
        for c in range(c0, c1):
            value = image[r, c]
            if np.isfinite(value):
                at[X, n] = sensor.x[c]
                at[Y, n] = sensor.y[r]
                at[VALUE, n] = value / noise
                n += 1
    return n
