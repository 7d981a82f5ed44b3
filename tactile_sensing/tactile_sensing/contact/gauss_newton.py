"""One load fitted to one frame: start, gather, Gauss-Newton; all compiled."""

from itertools import accumulate
from typing import Any, NamedTuple

import numpy as np

from tactile_common.kernels import njit
from tactile_sensing.contact.initial_guess import (
    gather_pressure,
    gather_window,
    guess_line,
    guess_point,
    VALUE,
    X,
    Y,
)
from tactile_sensing.contact.variable_projection import (
    best_forces,
    chi_square,
    normal_of_forces,
    normal_of_place,
    place_step,
    scatter_weights,
    tukey_weights,
    weigh,
)
from tactile_sensing.half_space import kernels
from tactile_sensing.half_space.kernels import FORCE, LOAD, LOAD_OFFSETS, Q0, Q1, SHEAR_X, SHEAR_Y
from tactile_sensing.skin import kernels as skin_kernels
from tactile_sensing.types.contact import ContactType

POINT, LINE = int(ContactType.POINT), int(ContactType.LINE)
RESIDUAL, WEIGHTED, ROOT, WEIGHT = range(VALUE + 1, VALUE + 5)  # further rows of `Tactels.at`
VARIANCE, START, END, MODEL = range(SHEAR_Y + 1, SHEAR_Y + 5)  # further rows of `Tactels.by`
PARAMETERS = MODEL  # of a load with everything that `ladder` adds
STEPS = 3  # Gauss-Newton steps; from the start they reach the Cramer-Rao bound
MAX_STEPS = 10  # where the place has not settled by then: shear beyond friction, outliers
SETTLED = 0.005  # step after which none is needed [depths]; what it leaves is its square
CONVERGED = 0.05  # longest last step of a place that is told; much noise keeps it moving a little
STEP_BOUND = 1.0  # longest step [depths of the shallowest layer]

# A fitted load, LOAD's fields, with its normal equations (lower triangle, rows as `vector`; right
# side), the sum of (residual / noise)^2, that of residual^2 / (noise^2 + (model error)^2), tactels
# used, length of the last step [m] (of a line at the pad's border), steps, and whether the force
# is positive, the place where it can be and the last step short. What makes it more than sharp
# and whole (extras, see `ladder`): the variance of its patch along an axis [m^2], and where a line
# begins and ends along itself, from the foot of the sensor's origin [m]. Then the covariance, if
# the load is regular, of all these parameters; and how far it moved when shear was left out.
_RESULT: dict[str, Any] = {
    'normal': ('f8', (5, 5)), 'right': ('f8', (5,)), 'squared_error': 'f8', 'chi_square': 'f8',
    'used': 'i8', 'last_step': 'f8', 'iterations': 'i8', 'converged': 'b1', 'regular': 'b1',
    'variance': 'f8', 'start': 'f8', 'end': 'f8', 'extras': 'i8',
    'cov': ('f8', (PARAMETERS, PARAMETERS)), 'moved': ('f8', (5,))}
_WORDS = [-(-np.dtype(form).itemsize // 8) for form in _RESULT.values()]
_OFFSETS = [LOAD.itemsize + 8 * n for n in accumulate(_WORDS, initial=0)]
_FIELDS: Any = {
    'names': [*LOAD_OFFSETS, *_RESULT],
    'formats': [*(LOAD[name] for name in LOAD_OFFSETS), *_RESULT.values()],
    'offsets': [*LOAD_OFFSETS.values(), *_OFFSETS[:-1]], 'itemsize': _OFFSETS[-1]}
FIT = np.dtype(_FIELDS)


class Tactels(NamedTuple):
    """Memory of `fit_load`: few arrays with named rows, as every array costs whoever gets it."""

    at: np.ndarray  # rows X, Y [m]; VALUE, RESIDUAL, WEIGHTED over the noise; ROOT of the WEIGHT
    by: np.ndarray  # derivatives over the noise, rows as in `kernels.LOAD.vector` and further
    kept: np.ndarray  # (3, nodes, most): what those by the forces keep for those by the place


@njit(error_model='numpy')
def make_tactels(most, nodes):
    """Memory for `fit_load` with at most so many tactels of so many nodes."""
    return Tactels(np.empty((WEIGHT + 1, most)), np.empty((MODEL + 1, most)),
                   np.empty((3, nodes, most)))


@njit(error_model='numpy')
def _skin_derivatives(kind, sensor, layers, load, of_forces, tactels):
    """By the forces, or by the place with what those by the forces have kept of it."""
    at, by, kept = tactels
    cos, sin = np.cos(load.yaw), np.sin(load.yaw)
    begin = 0
    for k in range(layers.size):
        layer, end, centre = layers[k], layers[k].end, skin_kernels.centre_of(layers[k].depth)
        x, y = at[X][begin:end], at[Y][begin:end]
        by_q0, by_q1 = by[Q0][begin:end], by[Q1][begin:end]
        by_force, by_x, by_y = by[FORCE][begin:end], by[SHEAR_X][begin:end], by[SHEAR_Y][begin:end]
        kernel = skin_kernels.coefficients_of(layer.load)
        for j in range(sensor.nodes.size):
            node = sensor.nodes[j]
            # Rows of their own, or the loops could not be vectorised.
            scale, part = node.weight / layer.noise, (
                kept[0, j][begin:end], kept[1, j][begin:end], kept[2, j][begin:end])
            if kind == POINT:
                a, b = load.a - node.x, load.b - node.y
                if of_forces:
                    skin_kernels.add_point_forces(
                        x, y, a, b, kernel, centre, scale, part, by_force, by_x, by_y)
                else:
                    skin_kernels.add_point_place(x, y, a, b, load, part, by_q0, by_q1)
            else:
                rho = load.rho - node.x * cos - node.y * sin
                if of_forces:
                    skin_kernels.add_line_forces(
                        x, y, cos, sin, rho, kernel, centre, scale, part, by_force, by_x)
                else:
                    along = node.y * cos - node.x * sin
                    skin_kernels.add_line_place(
                        x, y, cos, sin, rho, along, load, part, by_q0, by_q1)
        begin = end


@njit(error_model='numpy')
def _derivatives(kind, sensor, layers, load, of_forces, tactels):
    """The same by the closed forms of a half-space, where they serve."""
    nodes = sensor.nodes
    at, by, kept = tactels
    for i in range(FORCE, SHEAR_Y + 1) if of_forces else range(Q0, Q1 + 1):
        by[i][:layers[-1].end] = 0.0
    if not sensor.closed:
        _skin_derivatives(kind, sensor, layers, load, of_forces, tactels)
        return
    cos, sin = np.cos(load.yaw), np.sin(load.yaw)
    begin = 0
    for k in range(layers.size):
        end, layer = layers[k].end, layers[k]
        x, y = at[X][begin:end], at[Y][begin:end]
        by_q0, by_q1 = by[Q0][begin:end], by[Q1][begin:end]
        by_force, by_x, by_y = by[FORCE][begin:end], by[SHEAR_X][begin:end], by[SHEAR_Y][begin:end]
        for j in range(nodes.size):
            node = nodes[j]
            shape, q = kept[0, j][begin:end], kept[1, j][begin:end]
            scale = node.weight / layer.noise
            if kind == POINT:  # the load moved back, in place of the part of the tactel
                a, b = load.a - node.x, load.b - node.y
                if of_forces:
                    kernels.add_point_forces(
                        x, y, a, b, layer, scale, shape, q, by_force, by_x, by_y)
                else:
                    kernels.add_point_place(x, y, a, b, load, layer, shape, q, by_q0, by_q1)
            else:
                rho = load.rho - node.x * cos - node.y * sin
                if of_forces:
                    kernels.add_line_forces(
                        x, y, cos, sin, rho, layer, scale, shape, q, by_force, by_x)
                else:
                    along = node.y * cos - node.x * sin
                    kernels.add_line_place(
                        x, y, cos, sin, rho, along, load, layer, shape, q, by_q0, by_q1)
        begin = end


@njit(error_model='numpy')
def _turn_upright(load, matrix):
    """Turn a line so that yaw is in (-pi/2, pi/2]; a half turn exchanges its two normals."""
    turns = np.ceil(load.yaw / np.pi - 0.5)
    load.yaw -= turns * np.pi
    if turns % 2.0 != 0.0:
        load.rho, load.shear = -load.rho, -load.shear
        for i in (Q0, SHEAR_X):
            for j in range(5):
                matrix[i, j] = -matrix[i, j]
                matrix[j, i] = -matrix[j, i]


@njit(error_model='numpy')
def _begin(kind, stress, sensor, layers, at, load):
    """First guess into the load, and tactels gathered: their number, and q1 as a length."""
    x, y = sensor.x, sensor.y
    if kind == POINT:
        row, column, v, w = guess_point(stress, layers)
        if row < 0:
            return 0, 1.0
        load.a, load.b = x[column] + w * sensor.pitch_x, y[row] + v * sensor.pitch_y
        return gather_window(stress, sensor, layers, row, column, v, w, at), 1.0
    load.rho, load.yaw = guess_line(stress, sensor, layers)
    if np.isnan(load.rho):
        return 0, 1.0
    return gather_pressure(stress, sensor, layers, at), (
        0.5 * np.hypot(x[-1] - x[0], y[-1] - y[0]))


@njit(error_model='numpy')
def _shallowest(layers):
    depth = np.inf
    for k in range(layers.size):
        depth = min(depth, layers[k].depth)
    return depth


@njit(error_model='numpy')
def _weigh_forces(at, by, load, n, model_error, tukey, scatter):
    """Weights, of what the last load leaves, on the values and derivatives by forces."""
    values, residual, weighted = at[VALUE], at[RESIDUAL], at[WEIGHTED]
    by_force, by_x, by_y = by[FORCE], by[SHEAR_X], by[SHEAR_Y]
    for i in range(n):
        residual[i] = values[i] - (
            by_force[i] * load.force + by_x[i] * load.shear_x + by_y[i] * load.shear_y)
        weighted[i] = values[i]
    if tukey < np.inf:
        tukey_weights(values, residual, n, model_error, tukey, at[ROOT])
    else:
        scatter_weights(values, residual, n, scatter, at[ROOT])
    weigh((weighted, by_force, by_x, by_y), at[ROOT], n)


@njit(error_model='numpy')
def fit_load(kind, stress, sensor, layers, forces, model_error, tukey, scatter, tactels, fit):
    """
    Fit a load to one frame.

    Parameters
    ----------
    kind : int
        POINT or LINE.
    stress : ndarray, shape (layers, rows, columns)
    sensor, layers
        From `layers.sensor_of`, with the noise.
    forces : int
        Force parameters in use: 1 (no shear), 2 (line) or 3 (point).
    model_error : float
        Allowance of chi-square and of the weights.
    tukey : float
        Scales at which a tactel has lost all weight (Tukey's biweight); infinite: all are equal.
    scatter : float
        Standard deviation of what tactels are off beside noise, as a fraction of the pressure: of
        their gains. Those under the load then have less weight.
    tactels : Tactels
    fit : record of FIT
        Result.

    Returns
    -------
    bool
        False where it did not work: the load and its normal equations are of no use.
    """
    at, by, _ = tactels
    matrix, vector = fit.normal, fit.right
    fit.variance, fit.extras = 0.0, 0
    fit.squared_error = fit.chi_square = 0.0
    fit.iterations, fit.last_step, fit.converged = 0, np.inf, False
    n, lever = _begin(kind, stress, sensor, layers, at, fit)
    fit.used = n
    if n <= 2 + forces:
        return False
    start_0, start_1 = fit.a, fit.b
    depth, robust = _shallowest(layers), tukey < np.inf
    for iteration in range(MAX_STEPS + 1):
        if not sensor.closed and (iteration == 0 or kind == LINE):
            for k in range(layers.size):
                skin_kernels.make_sharp_shape(
                    sensor.polynomials[k], layers[k].depth, kind - 1, fit.yaw,
                    layers[k].load)
        _derivatives(kind, sensor, layers, fit, True, tactels)
        if forces < 3:
            by[SHEAR_Y][:n] = 0.0
        if forces < 2:
            by[SHEAR_X][:n] = 0.0
        data, weighing = at[VALUE], iteration > 0 and (robust or scatter > 0.0)
        if weighing:
            _weigh_forces(at, by, fit, n, model_error, tukey, scatter)
            data = at[WEIGHTED]
        normal_of_forces(data, by, n, matrix, vector)
        if forces < 3:
            matrix[SHEAR_Y, SHEAR_Y] = 1.0
        if forces < 2:
            matrix[SHEAR_X, SHEAR_X] = 1.0
        inverse, regular = best_forces(matrix, vector, fit)
        if not regular:
            return False
        _derivatives(kind, sensor, layers, fit, False, tactels)
        if weighing:
            weigh((by[Q0], by[Q1]), at[ROOT], n)
        normal_of_place(data, by, fit, n, at[RESIDUAL], matrix, vector)
        if iteration >= (MAX_STEPS if robust else STEPS) and (
                fit.last_step <= SETTLED * depth or iteration >= MAX_STEPS):
            break
        step_0, step_1 = place_step(matrix, vector, inverse)
        length = np.hypot(step_0, lever * step_1)
        if not length < np.inf:
            return False
        shorter = min(1.0, STEP_BOUND * depth / length) if length > 0.0 else 1.0
        fit.a += shorter * step_0
        fit.b += shorter * step_1
        fit.last_step = shorter * length
        fit.iterations = iteration + 1
    at[WEIGHT][:n] = 1.0  # they are in the rows
    fit.squared_error, fit.chi_square = chi_square(data, at[RESIDUAL], n, model_error)
    if not (fit.squared_error < np.inf and fit.force > 0.0):
        return False
    if kind == POINT:
        if not (abs(fit.a - start_0) <= sensor.window * sensor.pitch_x
                and abs(fit.b - start_1) <= sensor.window * sensor.pitch_y):
            return False
    else:
        _turn_upright(fit, matrix)
    fit.converged = fit.last_step <= CONVERGED * depth
    return True
