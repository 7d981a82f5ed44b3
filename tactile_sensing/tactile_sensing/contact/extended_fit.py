"""Loads with a patch or ends fitted by Levenberg and Marquardt, from where they are; compiled."""

import math

import numpy as np

from tactile_common.kernels import FAST, njit
from tactile_sensing.contact.extended_load import add_rows, BEGINS, ENDS, PATCH
from tactile_sensing.contact.gauss_newton import (
    CONVERGED,
    END,
    MODEL,
    PARAMETERS,
    POINT,
    RESIDUAL,
    START,
    VALUE,
    VARIANCE,
    WEIGHT,
)
from tactile_sensing.contact.parameters import invert
from tactile_sensing.half_space.layers import half_sides
from tactile_sensing.skin import kernels

STEPS = 15  # most of them
HOPELESS = 9.0  # chi-square per tactel: another load, or several
SLOW = 0.98  # of it, of which a step may leave no more
SETTLED = 0.003  # a step after which none is needed [depths]
LARGEST_DAMPING = 1e4

# Normal equations (lower triangle) of the parameters in use, which are these rows of
# `Tactels.by`; their inverse, a step, and the values before it.
EQUATIONS = np.dtype([
    ('count', 'i8'), ('active', 'i8', (PARAMETERS,)), ('matrix', 'f8', (PARAMETERS, PARAMETERS)),
    ('right', 'f8', (PARAMETERS,)), ('inverse', 'f8', (PARAMETERS, PARAMETERS)),
    ('step', 'f8', (PARAMETERS,)), ('before', 'f8', (PARAMETERS,))])


@njit(error_model='numpy')
def choose_parameters(forces, extras, equations):
    """Put the parameters in use into the equations."""
    active, count = equations.active, 2 + forces
    for row in range(count):
        active[row] = row
    for bit, row in ((PATCH, VARIANCE), (BEGINS, START), (ENDS, END)):
        if extras & bit:
            active[count] = row
            count += 1
    equations.count = count


@njit(error_model='numpy', fastmath=FAST)
def dot(one, other, weights):
    """Weighted scalar product."""
    total = 0.0
    for i in range(weights.size):
        total += one[i] * other[i] * weights[i]
    return total


@njit(error_model='numpy')
def set_up(tactels, n, scatter, equations):
    """Normal equations of n tactels, by weights that know of scatter; returns chi-square."""
    at, by, active = tactels.at, tactels.by, equations.active
    values, residual, weights, model = at[VALUE], at[RESIDUAL], at[WEIGHT][:n], by[MODEL]
    for i in range(n):
        off = scatter * model[i]
        residual[i] = values[i] - model[i]
        weights[i] = 1.0 / (1.0 + off * off)
    for i in range(equations.count):
        row = by[active[i]]
        equations.right[i] = dot(row, residual, weights)
        for j in range(i + 1):
            equations.matrix[i, j] = dot(row, by[active[j]], weights)
    return dot(residual, residual, weights)


@njit(error_model='numpy')
def _get(load, row):
    if row == VARIANCE:
        return load.variance
    if row == START:
        return load.start
    return load.end if row == END else load.vector[row]


@njit(error_model='numpy')
def _set(load, row, value):
    if row == VARIANCE:
        load.variance = value
    elif row == START:
        load.start = value
    elif row == END:
        load.end = value
    else:
        load.vector[row] = value


@njit(error_model='numpy')
def _bound_step(kind, sensor, load, equations, depth):
    """Shorten a step to where the model holds; its length [m], an end's counted as a quarter."""
    half_x, half_y = half_sides(sensor)
    lever = 1.0 if kind == POINT else math.hypot(half_x, half_y)
    step, active, count = equations.step, equations.active, equations.count
    length = math.hypot(step[0], lever * step[1])
    for i in range(count):
        if active[i] >= START:
            length = max(length, 0.25 * abs(step[i]))  # an end may be far off
    shorter = min(1.0, depth / length) if length > 0.0 else 1.0
    length *= shorter
    largest = kernels.largest_variance(depth)
    for i in range(count):
        step[i] *= shorter
        if active[i] == VARIANCE:
            step[i] = min(max(load.variance + step[i], 0.0), largest) - load.variance
            length = max(length, depth * abs(step[i]) / largest)
    return length


@njit(error_model='numpy')
def _find_step(equations, damping):
    """Damped step; False where there is none."""
    matrix, inverse, count = equations.matrix, equations.inverse, equations.count
    for i in range(count):
        matrix[i, i] *= 1.0 + damping
    if not invert(matrix, count, inverse):
        return False
    for i in range(count):
        equations.step[i] = 0.0
        for j in range(count):
            equations.step[i] += inverse[i, j] * equations.right[j]
    return True


@njit(error_model='numpy')
def _evaluate(kind, sensor, layers, load, memory):
    """Normal equations of a load with its extras; returns chi-square."""
    add_rows(kind, sensor, layers, load, load.extras & (BEGINS | ENDS), memory.tactels)
    return set_up(
        memory.tactels, layers[-1].end, memory.state[0].scatter, memory.equations[0])


@njit(error_model='numpy', inline='always')
def _descend(kind, sensor, layers, load, memory):
    """Steps to the least chi-square, which is returned, and the length of the last; or NaN."""
    equations, depth = memory.equations[0], layers[0].depth
    active, before = equations.active, equations.before
    chi, damping = _evaluate(kind, sensor, layers, load, memory), 1e-3
    for _ in range(STEPS):
        if not _find_step(equations, damping):
            return np.nan, np.inf
        length = _bound_step(kind, sensor, load, equations, depth)
        for i in range(equations.count):
            before[i] = _get(load, active[i])
            _set(load, active[i], before[i] + equations.step[i])
        load.iterations += 1
        new = _evaluate(kind, sensor, layers, load, memory)
        enough = SETTLED * depth
        if new <= chi * (1.0 + 1e-9):
            hopeless = new > HOPELESS * layers[-1].end and new > SLOW * chi
            chi, damping = new, 0.1 * damping
            if hopeless:
                break
        else:
            if not new < np.inf or damping > LARGEST_DAMPING:
                return np.nan, np.inf
            damping, enough = max(10.0 * damping, 1e-2), 0.1 * enough
            for i in range(equations.count):
                _set(load, active[i], before[i])
            chi = _evaluate(kind, sensor, layers, load, memory)
        if length <= enough:
            break
    return chi, length


@njit(error_model='numpy')
def fit_extended(kind, sensor, layers, forces, extras, memory):
    """
    Fit a load with extras, from where it is, to the tactels that the last fit gathered.

    The load, the first of memory.fits, gets its squared error, and its covariance if it is
    regular. Returns whether it worked.
    """
    load, equations = memory.fits[0], memory.equations[0]
    load.extras, load.regular = extras, False
    load.vector[2 + forces:] = 0.0
    choose_parameters(forces, extras, equations)
    chi, length = _descend(kind, sensor, layers, load, memory)
    if not (load.force > 0.0 and chi < np.inf):
        return False
    load.squared_error, load.converged = chi, length <= CONVERGED * layers[0].depth
    load.regular = invert(equations.matrix, equations.count, equations.inverse)
    load.cov[:] = 0.0
    for i in range(equations.count):
        for j in range(equations.count):
            load.cov[equations.active[i], equations.active[j]] = equations.inverse[i, j]
    return True
