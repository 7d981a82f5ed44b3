"""
Error model of `fit`: Student-t errors, scatter of the gains, bounded readings; compiled.

The normal equations are solved by Cholesky.
"""

import math
from typing import Any

import numpy as np

from tactile_common.kernels import FAST, njit
from tactile_sensing.contact.records import Beliefs, Fit

NU = 4.0  # degrees of freedom of the errors
# Covariance of a fit, if the errors are Gaussian, over the inverse of J'WJ at this NU.
SANDWICH = 1.1378
GRID = np.geomspace(1e-4, 0.5, 10)  # values of the scatter g
GRID_STEP = math.log(GRID[1] / GRID[0])
GRID.flags.writeable = False
NEIGHBOURS = 0.1  # share of a neighbour's squared pressure that scatters at a tactel
DEAD = 0.01  # prior probability that a tactel is dead: it reads only noise
MOST = math.exp(200.0)  # largest exponential of a dead tactel: most loaded ones need no other
LIT = 0.02  # squared pressure over noise variance, above which the scatter is visible


@njit(error_model='numpy', fastmath=FAST)
def spread_of(model: np.ndarray, rows: int, columns: int, square: np.ndarray) -> None:
    """Write to `square` the squared pressure that multiplies g^2 in the variance of a tactel."""
    near = NEIGHBOURS * model * model
    square[:] = model * model
    for first in range(0, model.size, columns):
        r, last = first // columns % rows, first + columns - 1
        for i in range(first, last + 1 if r > 0 else first):
            square[i] += near[i - columns]
        for i in range(first, last + 1 if r < rows - 1 else first):
            square[i] += near[i + columns]
        for i in range(first, last):
            square[i] += near[i + 1]
        for i in range(first, last):
            square[i + 1] += near[i]


@njit(error_model='numpy', fastmath=FAST)
def weigh(error: np.ndarray, variance: np.ndarray, kept: np.ndarray, robust: bool,
          weight: np.ndarray) -> None:
    """Write the weights of the errors; 0 for tactels that are not kept."""
    for t in range(error.size):
        if not kept[t]:
            weight[t] = 0.0
        elif robust:
            weight[t] = (NU + 1.0) / (NU * variance[t] + error[t] * error[t])
        else:
            weight[t] = 1.0 / variance[t]


@njit(error_model='numpy')
def cost_of_error(error: float, variance: float) -> float:
    """Return the inverse squared likelihood of an error, without constants."""
    part = 1.0 + error * error / (NU * variance)
    return variance * part * part * part * part * part


@njit(error_model='numpy')
def cost_of_dead(reading: float, noise2: float) -> float:
    """Return the inverse squared likelihood of the reading of a dead tactel."""
    exponent = reading * reading / noise2
    return noise2 * (math.exp(exponent) if exponent < 200.0 else MOST) / DEAD ** 2


@njit(error_model='numpy')
def censored(error: float, deviation: float, above: bool) -> tuple[float, float]:
    """
    Return the error and weight of a censored reading for a step of Newton's method.

    The reading is only known to be beyond a bound; the bound lies `error` above the expected
    value. The likelihood is the probability of the normal distribution beyond the bound.
    """
    z = -error / deviation if above else error / deviation
    if z > 8.0:  # no information
        return 0.0, 0.0
    hazard = math.exp(-0.5 * z * z) / (1.2533141373155003 * math.erfc(-0.7071067811865476 * z))
    slope = hazard + z
    return (1.0 if above else -1.0) * deviation / slope, hazard * slope / deviation ** 2


@njit(error_model='numpy')
def log_likelihood(error: np.ndarray, variance: np.ndarray, kept: np.ndarray,
                   dead: np.ndarray) -> float:
    """
    Return the log likelihood of the errors, without constants.

    `dead` (tactels,) is `cost_of_dead` of each reading; of the two, the likelier counts.
    """
    total, product = 0.0, 1.0
    for t in range(error.size):
        if not kept[t]:
            continue
        product *= min(cost_of_error(error[t], variance[t]), dead[t])
        if not 1e-100 < product < 1e100:  # saves logarithms: one for many tactels
            total += math.log(product)
            product = 1.0
    return -0.5 * (total + math.log(product))


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


@njit(error_model='numpy')
def marginal_scatter(fit: Fit, noise2: np.ndarray, prior: np.ndarray, beliefs: Beliefs,
                     whole: bool) -> tuple[float, float]:
    """
    Return the scatter g (RMS over its posterior) and the log of the integral over g.

    The log posterior of log g is approximated by the parabola through the highest point of a grid
    and its two neighbours. If `whole`, the parameters are integrated out at each g; otherwise
    they are taken as known.
    """
    lit = fit.square > LIT * noise2
    dark, some = fit.kept & ~lit, np.flatnonzero(lit & fit.kept)
    constant = log_likelihood(fit.error, noise2, dark, np.full(noise2.size, np.inf))
    few, error, every = fit.rows[:, some], fit.error[some], np.ones(some.size, np.bool_)
    weight, dead, base = np.empty(some.size), np.empty(some.size), np.diag(prior)
    for t in range(some.size):
        dead[t] = cost_of_dead(fit.model[some[t]] + error[t], noise2[some[t]])
    if whole:
        weigh(fit.error, noise2, dark, True, fit.weight)
        base += normal_equations(fit.rows, fit.weight, fit.error)[0]
    logs = np.full(GRID.size, -np.inf)
    for k in range(GRID.size):
        g, determinant = GRID[k], 0.0
        variance = noise2[some] + g * g * fit.square[some]
        if whole:
            weigh(error, variance, every, True, weight)
            determinant = factor_of(base + normal_equations(few, weight, error)[0])[1]
        if determinant == determinant:
            logs[k] = (constant + log_likelihood(error, variance, every, dead)
                       - 0.5 * determinant
                       - 0.5 * (math.log(g / beliefs.gain) / beliefs.gain_spread) ** 2)
    return _parabola(logs)


@njit(error_model='numpy')
def _parabola(logs: np.ndarray) -> tuple[float, float]:
    """Return the scatter and the log integral of a posterior; `logs`: its logarithm at GRID."""
    near: Any = min(max(logs.argmax(), 1), GRID.size - 2)
    slope = 0.5 * (logs[near + 1] - logs[near - 1])
    bend = logs[near - 1] - 2.0 * logs[near] + logs[near + 1]
    if not bend < 0.0:  # no maximum inside the grid
        return GRID[logs.argmax()], logs.max()
    shift = min(max(-slope / bend, -1.5), 1.5)
    variance = -1.0 / bend  # of log g, in squared grid steps
    return (GRID[near] * math.exp(GRID_STEP * shift + GRID_STEP**2 * variance),
            logs[near] + (slope + 0.5 * bend * shift) * shift + 0.5 * math.log(variance))
