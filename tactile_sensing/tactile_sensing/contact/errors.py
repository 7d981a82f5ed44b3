"""
How far readings are off: Student-t errors, scatter of the gains, bounds of a reading; compiled.

See `fit`, which these serve.
"""

import math
from typing import Any

import numpy as np

from tactile_common.kernels import FAST, njit
from tactile_sensing.contact.normal_equations import add_normal, factor_of
from tactile_sensing.contact.records import Beliefs, Fit

NU = 4.0  # degrees of freedom of the errors
# Covariance of a fit under Gaussian errors, over the inverse of J'WJ at this NU.
SANDWICH = 1.1378
GRID = np.geomspace(1e-4, 0.5, 10)  # of the scatter g
GRID_STEP = math.log(GRID[1] / GRID[0])
GRID.flags.writeable = False
NEIGHBOURS = 0.1  # share of the scatter that a tactel has from each neighbour's pressure
LIT = 0.02  # of the noise's variance: pressure whose scatter may show


@njit(error_model='numpy', fastmath=FAST)
def spread_of(model: np.ndarray, rows: int, columns: int, square: np.ndarray) -> None:
    """Squared pressure whose share scatters at every tactel: its own and its neighbours'."""
    for i in range(model.size):
        square[i] = model[i] * model[i]
    for i in range(model.size):
        near = NEIGHBOURS * model[i] * model[i]
        r, c = i // columns % rows, i % columns
        if r > 0:
            square[i - columns] += near
        if r < rows - 1:
            square[i + columns] += near
        if c > 0:
            square[i - 1] += near
        if c < columns - 1:
            square[i + 1] += near


@njit(error_model='numpy', fastmath=FAST)
def weigh(error: np.ndarray, variance: np.ndarray, kept: np.ndarray, robust: bool,
          weight: np.ndarray) -> None:
    """Weights of the errors; 0 of tactels that are not kept."""
    for t in range(error.size):
        if not kept[t]:
            weight[t] = 0.0
        elif robust:
            weight[t] = (NU + 1.0) / (NU * variance[t] + error[t] * error[t])
        else:
            weight[t] = 1.0 / variance[t]


@njit(error_model='numpy')
def censored(error: float, deviation: float, above: bool) -> tuple[float, float]:
    """
    Error and weight of a reading that is only known to be beyond a bound, by Newton's method.

    Its log likelihood is that of the normal distribution beyond the bound, which lies `error`
    above what is expected.
    """
    z = -error / deviation if above else error / deviation
    if z > 8.0:  # it tells nothing
        return 0.0, 0.0
    hazard = math.exp(-0.5 * z * z) / (1.2533141373155003 * math.erfc(-0.7071067811865476 * z))
    slope = hazard + z
    return (1.0 if above else -1.0) * deviation / slope, hazard * slope / deviation ** 2


@njit(error_model='numpy')
def log_likelihood(error: np.ndarray, variance: np.ndarray, kept: np.ndarray,
                   robust: bool) -> float:
    """Sum of the logarithms of the errors' densities, without constants."""
    total, product = 0.0, 1.0
    for t in range(error.size):
        if not kept[t]:
            continue
        u = error[t] * error[t] / variance[t]
        if robust:
            part = 1.0 + u / NU
            product *= variance[t] * part * part * part * part * part
        else:
            product *= variance[t]
            total += u
        if not 1e-100 < product < 1e100:  # one logarithm for many tactels
            total += math.log(product)
            product = 1.0
    return -0.5 * (total + math.log(product))


@njit(error_model='numpy')
def marginal_scatter(fit: Fit, noise2: np.ndarray, prior: np.ndarray, beliefs: Beliefs,
                     whole: bool) -> tuple[float, float]:
    """
    Scatter g, root mean square over its posterior, and log of the integral over it.

    The posterior of log g is the parabola through the highest point of a grid and its neighbours.
    Only if whole, the parameters are integrated over at each g; else they are taken as known.
    """
    n = fit.rows.shape[0]
    lit = fit.square > LIT * noise2
    dark = fit.kept & ~lit
    constant = log_likelihood(fit.error, noise2, dark, True)
    some = np.flatnonzero(lit & fit.kept)
    few, base, matrix = np.empty((n, some.size)), np.zeros((n, n)), np.zeros((n, n))
    error, variance = fit.error[some], np.empty(some.size)
    weight, every = np.empty(some.size), np.ones(some.size, np.bool_)
    right, factor = np.zeros(n), np.zeros((n, n))
    if whole:
        weigh(fit.error, noise2, dark, True, fit.weight)
        add_normal(fit.rows, fit.weight, fit.error, base, right)
        for i in range(n):
            base[i, i] += prior[i]
            for t in range(some.size):
                few[i, t] = fit.rows[i, some[t]]
    logs = np.full(GRID.size, -np.inf)
    for k in range(GRID.size):
        g, determinant = GRID[k], 0.0
        for t in range(some.size):
            variance[t] = noise2[some[t]] + g * g * fit.square[some[t]]
        if whole:
            weigh(error, variance, every, True, weight)
            matrix[:] = base
            add_normal(few, weight, error, matrix, right)
            determinant = factor_of(matrix, factor)
        if determinant == determinant:
            logs[k] = (constant + log_likelihood(error, variance, every, True)
                       - 0.5 * determinant
                       - 0.5 * (math.log(g / beliefs.gain) / beliefs.gain_spread) ** 2)
    return _parabola(logs)


@njit(error_model='numpy')
def _parabola(logs: np.ndarray) -> tuple[float, float]:
    """Scatter and log of the integral of a posterior, given at the GRID as logarithms."""
    near: Any = min(max(logs.argmax(), 1), GRID.size - 2)
    slope = 0.5 * (logs[near + 1] - logs[near - 1])
    bend = logs[near - 1] - 2.0 * logs[near] + logs[near + 1]
    if not bend < 0.0:  # nothing was found, or at one end
        return GRID[logs.argmax()], logs.max()
    shift = min(max(-slope / bend, -1.5), 1.5)
    variance = -1.0 / bend  # as a Gaussian of log g, in steps of the grid
    return (GRID[near] * math.exp(GRID_STEP * shift + GRID_STEP**2 * variance),
            logs[near] + (slope + 0.5 * bend * shift) * shift + 0.5 * math.log(variance))
