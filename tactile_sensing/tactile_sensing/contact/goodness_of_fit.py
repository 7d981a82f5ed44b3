"""What a load leaves of a frame, and what that says; all compiled."""

import math

import numpy as np

from tactile_common.kernels import njit
from tactile_sensing.contact.gauss_newton import LINE, POINT
from tactile_sensing.half_space import line_model, point_model

ELSEWHERE = 2.0  # depths from the load that are elsewhere
FORCE_WINDOW = 2.0  # half side of the window of the second force estimate of a point [depths]


@njit(error_model='numpy')
def _measured(kind, x, y, cos, sin, theta, layer, nodes):
    """Stress that a tactel measures under a load [Pa]."""
    total = 0.0
    for j in range(nodes.shape[0]):
        if kind == POINT:
            total += nodes[j, 2] * point_model.stress_at(
                x + nodes[j, 0], y + nodes[j, 1], theta, layer)
        else:
            total += nodes[j, 2] * line_model.stress_at(
                x + nodes[j, 0], y + nodes[j, 1], cos, sin, theta, layer[0])
    return total


@njit(error_model='numpy')
def compare(kind, stress, sensor, layers, theta, left, model):
    """Load into model, and what it leaves; NaN in left for layers that do not show a line."""
    x, y, _, _, component, nodes, _ = sensor
    cos, sin = math.cos(theta[1]), math.sin(theta[1])
    for k in range(stress.shape[0]):
        if kind == LINE and component[k] != 0:
            left[k], model[k] = np.nan, 0.0
            continue
        for r in range(stress.shape[1]):
            for c in range(stress.shape[2]):
                expected = _measured(kind, x[c], y[r], cos, sin, theta, layers[k], nodes)
                model[k, r, c] = expected
                left[k, r, c] = stress[k, r, c] - expected


@njit(error_model='numpy')
def sums_of_squares(left, model, layers, model_error):
    """Squared error, chi-square with the allowance of the model's error, and live tactels."""
    squared = chi = 0.0
    count = 0
    for k in range(left.shape[0]):
        noise = layers[k, 1]
        for r in range(left.shape[1]):
            for c in range(left.shape[2]):
                rest = left[k, r, c] / noise
                if np.isfinite(rest):
                    allowed = model_error * model[k, r, c] / noise
                    squared += rest * rest
                    chi += rest * rest / (1.0 + allowed * allowed)
                    count += 1
    return squared, chi, count


@njit(error_model='numpy')
def window_ratio(kind, left, model, x, y, theta, depth):
    """
    Pressure seen over pressure expected, in a window around a point or on the whole pad.

    The zeroth moment and its compensation factor (2.7), for any window and any gaps.
    """
    seen = expected = 0.0
    for r in range(left.shape[0]):
        for c in range(left.shape[1]):
            if np.isfinite(left[r, c]) and (kind == LINE or (
                    abs(x[c] - theta[0]) <= FORCE_WINDOW * depth
                    and abs(y[r] - theta[1]) <= FORCE_WINDOW * depth)):
                seen += left[r, c] + model[r, c]
                expected += model[r, c]
    return seen / expected if expected > 0.0 else np.nan


@njit(error_model='numpy')
def _sum_around(image, row, column):
    """Sum of the live ones of 3x3 tactels."""
    total = 0.0
    for r in range(max(row - 1, 0), min(row + 2, image.shape[0])):
        for c in range(max(column - 1, 0), min(column + 2, image.shape[1])):
            if np.isfinite(image[r, c]):
                total += image[r, c]
    return total


@njit(error_model='numpy')
def lacks_load(left, threshold):
    """Whether less than the load is seen somewhere, by a threshold, over 3x3 tactels."""
    for r in range(left.shape[0]):
        for c in range(left.shape[1]):
            # Of nine whose mean is below, one is.
            if left[r, c] < -threshold and _lowest_around(left, r, c) < -9.0 * threshold:
                return True
    return False


@njit(error_model='numpy')
def _lowest_around(image, row, column):
    """Least of the sums over 3x3 tactels that a tactel is part of."""
    lowest = np.inf
    for r in range(max(row - 1, 0), min(row + 2, image.shape[0])):
        for c in range(max(column - 1, 0), min(column + 2, image.shape[1])):
            lowest = min(lowest, _sum_around(image, r, c))
    return lowest


@njit(error_model='numpy')
def second_contact(kind, left, x, y, theta, depth, threshold):
    """Whether more than a threshold is left over away from the load, over 3x3 tactels."""
    rows, columns = left.shape
    highest = 0.0
    for rest in left.flat:
        if rest > highest:  # false for NaN
            highest = rest
    if highest <= threshold:  # then so is every mean
        return False
    cos, sin = math.cos(theta[1]), math.sin(theta[1])
    for r in range(rows):
        for c in range(columns):
            if kind == POINT:
                away = math.hypot(x[c] - theta[0], y[r] - theta[1])
            else:
                away = abs(x[c] * cos + y[r] * sin - theta[0])
            if away <= ELSEWHERE * depth:
                continue
            if _sum_around(left, r, c) > 9.0 * threshold:
                return True
    return False
