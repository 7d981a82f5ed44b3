"""What a load leaves of a frame, and whether that refutes it; all compiled."""

import math

import numpy as np

from tactile_common.kernels import njit
from tactile_sensing.contact.extended_load import draw, PATCH
from tactile_sensing.contact.gauss_newton import LINE, POINT
from tactile_sensing.contact.parameters import chord
from tactile_sensing.contact.preprocessing import DETECTION
from tactile_sensing.half_space.kernels import line_stress, point_stress, Q0, Q1
from tactile_sensing.half_space.layers import first_pressure_layer, half_sides, PRESSURE
from tactile_sensing.skin import kernels
from tactile_sensing.skin.kernels import sharp_top
from tactile_sensing.types.contact import ContactType, Reason

ELSEWHERE = 2.0  # depths from the load that are elsewhere
FORCE_WINDOW = 2.0  # half side of the window of the second force estimate of a point [depths]
# Tactels of a point around the peak, of a line: three to eight for each parameter.
MIN_POINT_TACTELS, MIN_LINE_TACTELS = 15, 24
SECOND_CONTACT = 0.15  # of the peak, left over elsewhere, that makes a second contact
LARGEST_PATCH = 0.95  # of the largest variance; more is none of the patches that are known
BORDER_STD = 0.1  # depths; a load under the outermost tactels must be located better than that

_NONE, _OTHER = int(ContactType.NONE), int(ContactType.OTHER)
_LOW_SNR, _OFF_PAD, _FEW = int(Reason.LOW_SNR), int(Reason.OFF_PAD), int(Reason.FEW_TACTELS)
_LOST, _BAD_FIT = int(Reason.NOT_CONVERGED), int(Reason.BAD_FIT)


@njit(error_model='numpy')
def _measured(kind, x, y, cos, sin, load, layer, nodes):
    """Stress that a tactel measures under a load [Pa]."""
    total = 0.0
    for j in range(nodes.size):
        node = nodes[j]
        if kind == POINT:
            total += node.weight * point_stress(x + node.x, y + node.y, load, layer)
        else:
            total += node.weight * line_stress(x + node.x, y + node.y, cos, sin, load, layer)
    return total


@njit(error_model='numpy')
def compare(kind, sensor, layers, load, memory):
    """Load into model, and what it leaves; NaN in left for layers that do not show a line."""
    stress, left, model = memory.stress, memory.left, memory.model
    if load.extras or not sensor.closed:
        draw(kind, sensor, layers, load, model)
        for k in range(layers.size):
            for r in range(stress.shape[1]):
                for c in range(stress.shape[2]):
                    left[k, r, c] = stress[k, r, c] - model[k, r, c]
        return
    cos, sin = math.cos(load.yaw), math.sin(load.yaw)
    for k in range(layers.size):
        if kind == LINE and layers[k].component != PRESSURE:
            left[k], model[k] = np.nan, 0.0
            continue
        for r in range(stress.shape[1]):
            for c in range(stress.shape[2]):
                expected = _measured(
                    kind, sensor.x[c], sensor.y[r], cos, sin, load, layers[k], sensor.nodes)
                model[k, r, c] = expected
                left[k, r, c] = stress[k, r, c] - expected


@njit(error_model='numpy')
def _sums_of_squares(left, model, layers, model_error, scatter):
    """
    Squared error, chi-square with the allowance of the model's error, and live tactels.

    The last is the squared error by the weights of a fit that knows of scatter.
    """
    squared = chi = weighted = 0.0
    count = 0
    for k in range(layers.size):
        noise = layers[k].noise
        for r in range(left.shape[1]):
            for c in range(left.shape[2]):
                rest = left[k, r, c] / noise
                if np.isfinite(rest):
                    allowed = model_error * model[k, r, c] / noise
                    squared += rest * rest
                    chi += rest * rest / (1.0 + allowed * allowed)
                    off = scatter * model[k, r, c] / noise
                    weighted += rest * rest / (1.0 + off * off)
                    count += 1
    return squared, chi, count, weighted


@njit(error_model='numpy')
def _window_ratio(kind, left, model, sensor, load, depth):
    """
    Pressure seen over expected in a window around a point, or of a line on the whole pad.

    The zeroth moment and its compensation factor (2.7), for any window and any gaps.
    """
    seen = expected = 0.0
    for r in range(left.shape[0]):
        for c in range(left.shape[1]):
            if np.isfinite(left[r, c]) and (kind == LINE or (
                    abs(sensor.x[c] - load.a) <= FORCE_WINDOW * depth
                    and abs(sensor.y[r] - load.b) <= FORCE_WINDOW * depth)):
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
def _lacks_load(left, threshold):
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
def _second_contact(kind, left, sensor, load, depth, threshold):
    """Whether more than a threshold is left over away from the load, over 3x3 tactels."""
    x, y = sensor.x, sensor.y
    rows, columns = left.shape
    highest = 0.0
    for rest in left.flat:
        if rest > highest:  # false for NaN
            highest = rest
    if highest <= threshold:  # then so is every mean
        return False
    cos, sin = math.cos(load.yaw), math.sin(load.yaw)
    for r in range(rows):
        for c in range(columns):
            if kind == POINT:
                away = math.hypot(x[c] - load.a, y[r] - load.b)
            else:
                away = abs(x[c] * cos + y[r] * sin - load.rho)
            if away <= ELSEWHERE * depth:
                continue
            if _sum_around(left, r, c) > 9.0 * threshold:
                return True
    return False


@njit(error_model='numpy')
def refute(kind, sensor, layers, rules, memory, estimate):
    """
    Hold the load that was fitted to a frame against what it leaves.

    The estimate, a `contact.ESTIMATE` record, gets the evidence: snr, residual, iterations.
    Returns ContactType and Reason; no reason if it stands.
    """
    left, model, fit, state = memory.left, memory.model, memory.fits[0], memory.state[0]
    if fit.used < (MIN_POINT_TACTELS if kind == POINT else MIN_LINE_TACTELS):
        return _OTHER, _BAD_FIT | _FEW
    main = first_pressure_layer(layers)
    depth, noise = layers[main].depth, layers[main].noise
    squared, chi, count, weighted = _sums_of_squares(
        left, model, layers, math.hypot(rules.model_error, rules.gain_spread), state.scatter)
    peak = model[main].max()
    if not (peak > 0.0 and np.isfinite(chi + squared)):
        return _OTHER, _BAD_FIT
    freedom = max(count - (5 if kind == POINT else 3), 1)
    if fit.extras & PATCH and fit.variance > LARGEST_PATCH * kernels.largest_variance(depth):
        return _OTHER, _BAD_FIT
    top = peak
    if kind == LINE:  # on a line that only passes by, too
        top = 2.0 * fit.force / (np.pi * depth) if sensor.closed else (
            fit.force * sharp_top(sensor.polynomials[main], depth))
    estimate.snr = 20.0 * math.log10(top / noise)
    estimate.residual = math.sqrt(squared / freedom)
    state.excess = max(1.0, weighted / freedom)
    estimate.iterations = fit.iterations
    state.ratio = _window_ratio(kind, left[main], model[main], sensor, fit, depth)

    weak = estimate.snr < rules.min_snr
    if weak and kind == POINT:  # noise has peaks, but hardly ridges: a line is judged first
        return _NONE, _LOW_SNR
    threshold = max(DETECTION * noise / 3.0, SECOND_CONTACT * peak)
    if state.second or _second_contact(kind, left[main], sensor, fit, depth, threshold):
        return _OTHER, _BAD_FIT
    if chi > rules.max_chi_square * freedom or _lacks_load(left[main], threshold):
        return _OTHER, _BAD_FIT
    if weak:
        return _NONE, _LOW_SNR
    lost = not (fit.converged and fit.regular)
    return kind, (_LOST if lost else 0) | (_OFF_PAD if _off_pad(kind, sensor, fit) else 0)


@njit(error_model='numpy')
def _off_pad(kind, sensor, load):
    half_x, half_y = half_sides(sensor)
    if kind == POINT:
        return abs(load.a) > half_x or abs(load.b) > half_y
    return not _crosses(load, half_x, half_y)


@njit(error_model='numpy')
def _crosses(line, half_x, half_y):
    """Whether a line has a chord in a rectangle, of at least half of its shorter side."""
    return chord(line.rho, line.yaw, half_x, half_y) >= min(half_x, half_y)


@njit(error_model='numpy')
def beyond_sight(kind, sensor, depth, load, cov):
    """Whether a load at the border, which shows one flank only, may as well be off the pad."""
    half_x, half_y = half_sides(sensor)
    last_x, last_y = half_x - sensor.pitch_x, half_y - sensor.pitch_y
    if kind == POINT:
        inside = abs(load.a) <= last_x and abs(load.b) <= last_y
        variance = max(cov[Q0, Q0], cov[Q1, Q1])
    else:
        inside = _crosses(load, last_x, last_y)
        variance = cov[Q0, Q0]
    return not inside and variance > (BORDER_STD * depth) ** 2
