"""What tactels are off beside noise, as a share of the pressure: gains, or the model; compiled."""

import math

import numpy as np

from tactile_common.kernels import FAST, njit
from tactile_sensing.contact.extended_fit import choose_parameters, dot
from tactile_sensing.contact.gauss_newton import MODEL, POINT, RESIDUAL, ROOT, WEIGHT, WEIGHTED
from tactile_sensing.contact.parameters import invert
from tactile_sensing.half_space.kernels import FORCE, SHEAR_X, SHEAR_Y

EVIDENCE = 2.0  # standard deviations from which on scatter has a part in the weights
LEAST_FREEDOM, FEW = 3.0, 3.0  # tactels that tell it, beside those that the fit follows
USUAL = 0.07  # of the pressure: scatter by which tactels are weighed to find it


@njit(error_model='numpy')
def _product(weights, tactels, equations, product):
    """Sums of products of the rows in use (lower triangle)."""
    for i in range(equations.count):
        row = tactels.by[equations.active[i]]
        for j in range(i + 1):
            product[i, j] = product[j, i] = dot(
                row, tactels.by[equations.active[j]], weights)


@njit(error_model='numpy')
def _between(inverse, middle, count, result):
    """Multiply a matrix by the inverse from both sides, into the result."""
    half = np.empty((count, count))
    for i in range(count):
        for j in range(count):
            half[i, j] = 0.0
            for k in range(count):
                half[i, j] += inverse[i, k] * middle[k, j]
    for i in range(count):
        for j in range(count):
            result[i, j] = 0.0
            for k in range(count):
                result[i, j] += half[i, k] * inverse[k, j]


@njit(error_model='numpy', fastmath=FAST)
def _take_told(one, other, weights, to_find, by_form, by_inverse, told):
    """Take from what each tactel tells what the derivatives by two parameters tell already."""
    for i in range(told.size):
        told[i] += one[i] * other[i] * weights[i] * (by_form - 2.0 * by_inverse * to_find[i])


@njit(error_model='numpy')
def _weigh_tactels(load, tactels, n):
    """Share of gains in the variance of tactels, and weights to find it by; evidence for more."""
    at, by = tactels.at, tactels.by
    by_force, by_x, by_y = by[FORCE], by[SHEAR_X], by[SHEAR_Y]
    residual, weights, share, to_find = at[RESIDUAL], at[WEIGHT], at[WEIGHTED], at[ROOT]
    excess = variance = 0.0
    for i in range(n):
        model = load.force * by_force[i] + load.shear_x * by_x[i] + load.shear_y * by_y[i]
        share[i] = model * model * weights[i]
        to_find[i] = share[i] / (1.0 + USUAL * USUAL * share[i])
        excess += to_find[i] * (residual[i] * residual[i] * weights[i] - 1.0)
        variance += to_find[i] * to_find[i]
    return excess, math.sqrt(2.0 * variance)


@njit(error_model='numpy')
def measure_scatter(kind, layers, forces, memory):
    """
    Find what tactels are off beside noise, as a share of the pressure, from what a load leaves.

    A quadratic form of what is left has a mean that is linear in the variance of the share. The
    fit follows what it finds, which takes from the form what the derivatives of the load tell;
    and few tactels tell the variance badly, so that claims by it have to be wider. Where it is
    evident, it goes into state.found, for another fit; else what it does to the covariance into
    state.by_gains, of a point. The rows of the last fit are still there.
    """
    load, tactels, state, equations = (
        memory.fits[0], memory.tactels, memory.state[0], memory.equations[0])
    known, n, at, by = state.scatter, layers[-1].end, memory.tactels.at, memory.tactels.by
    state.found, state.by_gains[:] = known, 0.0
    excess, deviation = _weigh_tactels(load, tactels, n)
    if not (kind == POINT and known == 0.0) and excess < EVIDENCE * deviation:
        return
    residual, weights, share, to_find = at[RESIDUAL], at[WEIGHT], at[WEIGHTED], at[ROOT]
    choose_parameters(forces, load.extras, equations)
    count, active, inverse = equations.count, equations.active, equations.inverse
    _product(weights[:n], tactels, equations, equations.matrix)
    if not invert(equations.matrix, count, inverse):
        return
    told = by[MODEL]  # by each tactel, of the mean of the form
    for i in range(n):
        told[i] = to_find[i] * weights[i]
    _product(told[:n], tactels, equations, equations.matrix)
    _between(inverse, equations.matrix, count, state.by_gains)
    told[:n] = to_find[:n]
    for i in range(count):
        for j in range(i + 1):
            times = 1.0 if i == j else 2.0
            _take_told(by[active[i]], by[active[j]], weights, to_find,
                       times * state.by_gains[i, j], times * inverse[i, j], told[:n])
    excess = slope = square = 0.0
    for i in range(n):
        excess += to_find[i] * residual[i] * residual[i] * weights[i] - told[i]
        slope += told[i] * share[i]
        square += told[i] * told[i]
    state.by_gains[:] = 0.0
    if not slope > 0.0:
        return
    deviation = math.sqrt(2.0 * square)
    more, total, squares = max(excess, 0.0) / slope, 0.0, 0.0
    for i in range(n):
        part = told[i] * (1.0 + more * share[i])
        total += part
        squares += part * part
    freedom = max(total * total / squares - count, LEAST_FREEDOM)
    # In the mean over what the variance may be; and few tactels may hide some, the more the more
    # they show.
    shown = min(excess / deviation, EVIDENCE)
    more = shown / EVIDENCE * freedom / (freedom - 2.0) * more + (
        (FEW / freedom * max(1.0 + 2.0 * shown, 0.0)) ** 2 * deviation / slope)
    if excess > EVIDENCE * deviation:
        state.found = math.sqrt(known * known + more)
    elif kind == POINT and known == 0.0:
        for i in range(n):
            told[i] = more * share[i] * weights[i]
        _product(told[:n], tactels, equations, equations.matrix)
        _between(inverse, equations.matrix, count, state.by_gains)
        state.by_gains[2 + forces:] = 0.0  # what is no parameter of every load
        state.by_gains[:, 2 + forces:] = 0.0
