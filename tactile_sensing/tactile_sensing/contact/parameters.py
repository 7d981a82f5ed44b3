"""Fitted load into the numbers of an estimate, and their covariance; all compiled."""

import math
from typing import Any

import numpy as np

from tactile_common.kernels import njit
from tactile_sensing.contact.extended_load import along_chord, BEGINS, ENDS
from tactile_sensing.contact.gauss_newton import END, START
from tactile_sensing.half_space.kernels import FORCE, Q0, Q1, SHEAR_X
from tactile_sensing.half_space.line import chord_length
from tactile_sensing.types.contact import ROW

FORCE_MISMATCH = 0.03  # relative difference of the two force estimates that is allowed for

chord: Any = njit(error_model='numpy')(chord_length)
# Rows of an estimate's covariance for the parameters of a point's fit, and for what `_line_map`
# makes of a line's: without shear the first five.
POINT_ROWS = (ROW.x, ROW.y, ROW.normal_force, ROW.shear_force_x, ROW.shear_force_y)
FORCE_ROWS = (ROW.normal_force, ROW.shear_force_x, ROW.shear_force_y, ROW.line_force)
LINE_ROWS = (ROW.x, ROW.y, ROW.yaw, ROW.normal_force, ROW.line_force,
             ROW.shear_force_x, ROW.shear_force_y)
LINE_PARAMETERS = Q0, Q1, FORCE, SHEAR_X, START, END


@njit(error_model='numpy')
def copy_record(source, i, target, j):
    """
    Copy one record of an array into another array of the type, by words.

    Numba's own assignment, number by number, compiles to a thousand instructions.
    """
    source_words, target_words = source.view(np.int64), target.view(np.int64)
    words = source_words.size // source.size
    for word in range(words):
        target_words[j * words + word] = source_words[i * words + word]


@njit(error_model='numpy')
def invert(matrix, n, inverse):
    """Inverse of normal equations (lower triangle, n by n); False if singular."""
    factor = np.zeros((n, n))
    for i in range(n):  # Cholesky, of a unit diagonal: m, rad and N differ by orders
        if not matrix[i, i] > 0.0:
            return False
        for j in range(i + 1):
            total = matrix[i, j] / np.sqrt(matrix[i, i] * matrix[j, j])
            for k in range(j):
                total -= factor[i, k] * factor[j, k]
            if i > j:
                factor[i, j] = total / factor[j, j]
            elif total > 1e-12:
                factor[i, i] = np.sqrt(total)
            else:
                return False
    solution = np.zeros(n)
    for column in range(n):
        for i in range(n):
            solution[i] = 1.0 if i == column else 0.0
            for k in range(i):
                solution[i] -= factor[i, k] * solution[k]
            solution[i] /= factor[i, i]
        for i in range(n - 1, -1, -1):
            for k in range(i + 1, n):
                solution[i] -= factor[k, i] * solution[k]
            solution[i] /= factor[i, i]
        for i in range(n):
            inverse[i, column] = solution[i] / np.sqrt(matrix[i, i] * matrix[column, column])
    return True


@njit(error_model='numpy')
def write_point(load, cov, estimate):
    """Point into an estimate."""
    estimate.x, estimate.y, estimate.normal_force = load.a, load.b, load.force
    estimate.shear_force_x, estimate.shear_force_y = load.shear_x, load.shear_y
    for i in range(5):
        for j in range(5):
            estimate.covariance[POINT_ROWS[i], POINT_ROWS[j]] = cov[i, j]


@njit(error_model='numpy')
def _loaded_length(sensor, rho, yaw, start, end):
    """Length of a line on the pad, from where it begins to its end [m]."""
    first, last = along_chord(sensor, rho, yaw)
    return max(min(last, end) - max(first, start), 0.0)


@njit(error_model='numpy')
def write_line(load, cov, with_shear, sensor, estimate):
    """Line into an estimate: the middle of what is loaded on the pad, and the forces there."""
    rho, yaw, force, shear = load.rho, load.yaw, load.force, load.shear
    start, end = -np.inf, np.inf
    if load.extras & BEGINS:
        estimate.start = start = load.start
    if load.extras & ENDS:
        estimate.end = end = load.end
    cos, sin, step = math.cos(yaw), math.sin(yaw), 1e-6
    length = _loaded_length(sensor, rho, yaw, start, end)
    by_rho = (_loaded_length(sensor, rho + step, yaw, start, end) - length) / step
    by_yaw = (_loaded_length(sensor, rho, yaw + step, start, end) - length) / step
    by_start = (_loaded_length(sensor, rho, yaw, start + step, end) - length) / step
    by_end = (_loaded_length(sensor, rho, yaw, start, end + step) - length) / step
    first, last = along_chord(sensor, rho, yaw)
    middle = 0.5 * (max(first, start) + min(last, end)) if length > 0.0 else 0.0
    estimate.x, estimate.y = rho * cos - middle * sin, rho * sin + middle * cos
    estimate.yaw = yaw
    estimate.normal_force, estimate.line_force = force * length, force
    if with_shear:
        estimate.shear_force_x = shear * length * cos
        estimate.shear_force_y = shear * length * sin
    change = np.array((  # by the parameters of LINE_PARAMETERS, in the order of LINE_ROWS
        (cos, -middle * cos, 0.0, 0.0, 0.0, 0.0),  # across the edge
        (sin, -middle * sin, 0.0, 0.0, 0.0, 0.0),
        (0.0, 1.0, 0.0, 0.0, 0.0, 0.0),
        (force * by_rho, force * by_yaw, length, 0.0, force * by_start, force * by_end),
        (0.0, 0.0, 1.0, 0.0, 0.0, 0.0),
        (shear * cos * by_rho, shear * (cos * by_yaw - sin * length), 0.0, cos * length,
         shear * cos * by_start, shear * cos * by_end),
        (shear * sin * by_rho, shear * (sin * by_yaw + cos * length), 0.0, sin * length,
         shear * sin * by_start, shear * sin * by_end)))
    told = 7 if with_shear else 5
    for i in range(told):
        for j in range(told):
            total = 0.0
            for k in range(6):
                for m in range(6):
                    total += change[i, k] * change[j, m] * cov[
                        LINE_PARAMETERS[k], LINE_PARAMETERS[m]]
            estimate.covariance[LINE_ROWS[i], LINE_ROWS[j]] = total


@njit(error_model='numpy')
def forget_forces(estimate):
    """Make every force NaN, their covariance, and the patch: no gain is known."""
    estimate.normal_force = estimate.line_force = estimate.patch = np.nan
    estimate.shear_force_x = estimate.shear_force_y = np.nan
    for row in FORCE_ROWS:
        for i in range(estimate.covariance.shape[0]):
            estimate.covariance[row, i] = estimate.covariance[i, row] = np.nan


@njit(error_model='numpy')
def widen(fit, state, depth_variance):
    """Add to a covariance shear and a patch that may be there, the depth, and more noise."""
    moved, hidden, slope = fit.moved, state.hidden, state.slope
    fit.cov[:] *= state.excess
    for i in range(5):
        for j in range(5):
            fit.cov[i, j] += moved[i] * moved[j] + hidden[i] * hidden[j] + state.by_gains[i, j] + (
                state.excess * depth_variance * slope[i] * slope[j])


@njit(error_model='numpy')
def widen_forces(estimate, std):
    """Add to the covariance of forces what all of them are off by in common, as a share."""
    forces = (estimate.normal_force, estimate.shear_force_x, estimate.shear_force_y,
              estimate.line_force)
    for i in range(len(forces)):
        for j in range(len(forces)):
            estimate.covariance[FORCE_ROWS[i], FORCE_ROWS[j]] += std * std * forces[i] * forces[j]


@njit(error_model='numpy')
def compare_forces(ratio, relative_std, estimate):
    """Add to the covariance of a force what the pressure that is seen says otherwise."""
    off, covariance = ratio - 1.0, estimate.covariance
    if abs(off) > FORCE_MISMATCH + 3.0 * relative_std:  # one of the two is wrong by as much
        covariance[ROW.normal_force, ROW.normal_force] += (off * estimate.normal_force) ** 2
        covariance[ROW.line_force, ROW.line_force] += (off * estimate.line_force) ** 2
