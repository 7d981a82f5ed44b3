"""Fitted load into the numbers of an estimate, and their covariance; all compiled."""

import math

import numpy as np

from tactile_common.kernels import njit
from tactile_sensing.half_space.line import chord_length

chord = njit(error_model='numpy')(chord_length)
# What is said of a frame, beside its type and reasons.
VALUES = 12
(A, B, YAW, FORCE, SHEAR_X, SHEAR_Y, LINE_FORCE,
 SNR, RESIDUAL, WINDOWED, COUNT, HAS_SHEAR) = range(VALUES)


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
def tell_point(theta, cov, values, covariance):
    """Point (a, b, P, Qx, Qy) into the values of an estimate."""
    rows = (A, B, FORCE, SHEAR_X, SHEAR_Y)
    for i in range(5):
        values[rows[i]] = theta[i]
        for j in range(5):
            covariance[rows[i], rows[j]] = cov[i, j]


@njit(error_model='numpy')
def tell_line(theta, cov, with_shear, half_x, half_y, values, covariance):
    """Line (rho, yaw, force, shear) into the values of an estimate: forces on the pad."""
    rho, yaw, force, shear = theta[0], theta[1], theta[2], theta[3]
    cos, sin = math.cos(yaw), math.sin(yaw)
    length, step = chord(rho, yaw, half_x, half_y), 1e-6
    by_rho = (chord(rho + step, yaw, half_x, half_y) - length) / step
    by_yaw = (chord(rho, yaw + step, half_x, half_y) - length) / step
    values[A], values[B], values[YAW] = rho / cos, 0.0, yaw
    values[FORCE], values[LINE_FORCE] = force * length, force
    change = np.zeros((7, 4))
    change[A, 0], change[A, 1] = 1.0 / cos, rho * sin / cos**2
    change[YAW, 1] = 1.0
    change[FORCE, 0], change[FORCE, 1], change[FORCE, 2] = force * by_rho, force * by_yaw, length
    change[LINE_FORCE, 2] = 1.0
    told = np.array([A, YAW, FORCE, LINE_FORCE, SHEAR_X, SHEAR_Y])
    count = 4
    if with_shear:
        count = 6
        values[SHEAR_X], values[SHEAR_Y] = shear * length * cos, shear * length * sin
        change[SHEAR_X, 0], change[SHEAR_X, 3] = shear * cos * by_rho, cos * length
        change[SHEAR_X, 1] = shear * (cos * by_yaw - sin * length)
        change[SHEAR_Y, 0], change[SHEAR_Y, 3] = shear * sin * by_rho, sin * length
        change[SHEAR_Y, 1] = shear * (sin * by_yaw + cos * length)
    for i in told[:count]:
        for j in told[:count]:
            total = 0.0
            for k in range(4):
                for m in range(4):
                    total += change[i, k] * cov[k, m] * change[j, m]
            covariance[i, j] = total
