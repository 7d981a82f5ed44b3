"""Normal equations of a fit and their solution by Cholesky; compiled."""

import math

import numpy as np

from tactile_common.kernels import FAST, njit


@njit(error_model='numpy')
def factor_of(matrix: np.ndarray) -> tuple[np.ndarray, float]:
    """
    Return the Cholesky factor of a positive definite matrix, and its log determinant or NaN.

    The matrix is first scaled to a unit diagonal, because m, rad and N differ by orders.
    """
    factor, total = np.zeros_like(matrix), 0.0
    for i in range(matrix.shape[0]):
        if not matrix[i, i] > 0.0:
            return factor, np.nan
        for j in range(i + 1):
            value = matrix[i, j] / math.sqrt(matrix[i, i] * matrix[j, j])
            for k in range(j):
                value -= factor[i, k] * factor[j, k]
            if i > j:
                factor[i, j] = value / factor[j, j]
            elif value > 1e-13:
                factor[i, i] = math.sqrt(value)
            else:
                return factor, np.nan
        total += math.log(factor[i, i] * factor[i, i] * matrix[i, i])
    return factor, total


@njit(error_model='numpy')
def inverse_of(matrix: np.ndarray) -> tuple[np.ndarray, float]:
    """Return the inverse of a positive definite matrix, and its log determinant or NaN."""
    factor, total = factor_of(matrix)
    half = np.zeros_like(matrix)  # inverse of the factor of the unscaled matrix
    for c in range(0 if np.isnan(total) else matrix.shape[0]):
        half[c, c] = 1.0 / factor[c, c]
        for i in range(c + 1, matrix.shape[0]):
            for k in range(c, i):
                half[i, c] -= factor[i, k] * half[k, c]
            half[i, c] /= factor[i, i]
        half[:, c] /= math.sqrt(matrix[c, c])
    return half.T @ half, total


@njit(error_model='numpy', fastmath=FAST)
def _dot(one: np.ndarray, other: np.ndarray) -> float:
    total = 0.0
    for t in range(one.size):
        total += one[t] * other[t]
    return total


@njit(error_model='numpy')
def normal_equations(rows: np.ndarray, weight: np.ndarray,
                     error: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return J'WJ (lower triangle only) and J'We, where J' is `rows` (n, tactels)."""
    n, weighted = rows.shape[0], np.empty(weight.size)
    matrix, right = np.zeros((n, n)), np.empty(n)
    for i in range(n):
        for t in range(weight.size):
            weighted[t] = rows[i, t] * weight[t]
        right[i] = _dot(weighted, error)
        for j in range(i + 1):
            matrix[i, j] = _dot(weighted, rows[j])
    return matrix, right
