"""Normal equations of a fit and their solution by Cholesky; compiled."""

import math

import numpy as np

from tactile_common.kernels import FAST, njit


@njit(error_model='numpy')
def factor_of(matrix: np.ndarray, factor: np.ndarray) -> float:
    """
    Write the Cholesky factor of a positive definite matrix; return its log determinant, or NaN.

    The matrix is first scaled to a unit diagonal, because m, rad and N differ by orders.
    """
    total = 0.0
    for i in range(matrix.shape[0]):
        if not matrix[i, i] > 0.0:
            return np.nan
        for j in range(i + 1):
            value = matrix[i, j] / math.sqrt(matrix[i, i] * matrix[j, j])
            for k in range(j):
                value -= factor[i, k] * factor[j, k]
            if i > j:
                factor[i, j] = value / factor[j, j]
            elif value > 1e-13:
                factor[i, i] = math.sqrt(value)
            else:
                return np.nan
        total += math.log(factor[i, i] * factor[i, i] * matrix[i, i])
    return total


@njit(error_model='numpy')
def solve(matrix: np.ndarray, right: np.ndarray, inverse: np.ndarray,
          solution: np.ndarray) -> float:
    """Write inverse and solution of a positive definite system; return its log determinant."""
    n = right.size
    factor = np.zeros((n, n))
    total = factor_of(matrix, factor)
    if np.isnan(total):
        return np.nan
    column = np.zeros(n)
    for c in range(n):
        column[:] = 0.0
        column[c] = 1.0
        for i in range(c, n):
            for k in range(c, i):
                column[i] -= factor[i, k] * column[k]
            column[i] /= factor[i, i]
        for i in range(n - 1, -1, -1):
            for k in range(i + 1, n):
                column[i] -= factor[k, i] * column[k]
            column[i] /= factor[i, i]
        for i in range(n):
            inverse[i, c] = column[i] / math.sqrt(matrix[i, i] * matrix[c, c])
    for i in range(n):
        solution[i] = 0.0
        for k in range(n):
            solution[i] += inverse[i, k] * right[k]
    return total


@njit(error_model='numpy', fastmath=FAST)
def _dot(one: np.ndarray, other: np.ndarray) -> float:
    total = 0.0
    for t in range(one.size):
        total += one[t] * other[t]
    return total


@njit(error_model='numpy')
def add_normal(rows: np.ndarray, weight: np.ndarray, error: np.ndarray, matrix: np.ndarray,
               right: np.ndarray) -> None:
    """Add J'WJ (lower triangle only) and J'We, where J' is `rows` (n, tactels)."""
    weighted = np.empty(weight.size)
    for i in range(rows.shape[0]):
        for t in range(weight.size):
            weighted[t] = rows[i, t] * weight[t]
        right[i] += _dot(weighted, error)
        for j in range(i + 1):
            matrix[i, j] += _dot(weighted, rows[j])
