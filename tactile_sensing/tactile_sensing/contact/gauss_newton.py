"""One load fitted to one frame: start, gather, Gauss-Newton; all compiled."""

from typing import Any, NamedTuple

import numpy as np

from tactile_common.kernels import njit
from tactile_sensing.contact.initial_guess import (
    gather_pressure,
    gather_window,
    guess_line,
    guess_point,
)
from tactile_sensing.contact.variable_projection import (
    best_forces,
    chi_square,
    Derivatives,
    normal_of_forces,
    normal_of_place,
    place_step,
    tukey_weights,
    weigh,
)
from tactile_sensing.half_space import kernels
from tactile_sensing.half_space.kernels import LOAD, LOAD_OFFSETS, Q0, SHEAR_X, SHEAR_Y
from tactile_sensing.types.contact import ContactType

POINT, LINE = int(ContactType.POINT), int(ContactType.LINE)
STEPS = 3  # Gauss-Newton steps; from the start they reach the Cramer-Rao bound
MAX_STEPS = 10  # where the place has not settled by then: shear beyond friction, outliers
SETTLED = 0.005  # step after which none is needed [depths]; what it leaves is its square
CONVERGED = 0.05  # longest last step of a place that is told; much noise keeps it moving a little
STEP_BOUND = 1.0  # longest step [depths of the shallowest layer]

# A fitted load, LOAD's fields, with its normal equations (lower triangle; rows as `vector`), the
# sum of (residual / noise)^2, that of residual^2 / (noise^2 + (model error)^2), tactels used,
# length of the last step [m] (of a line at the pad's border), steps, and whether the force is
# positive, the place where it can be and the last step short.
_RESULT: dict[str, Any] = {
    'normal': ('f8', (5, 5)), 'squared_error': 'f8', 'chi_square': 'f8', 'used': 'i8',
    'last_step': 'f8', 'iterations': 'i8', 'converged': 'b1'}
_FIELDS: Any = {
    'names': [*LOAD_OFFSETS, *_RESULT],
    'formats': [*(LOAD[name] for name in LOAD_OFFSETS), *_RESULT.values()],
    'offsets': [*LOAD_OFFSETS.values(), 40, 240, 248, 256, 264, 272, 280]}
FIT = np.dtype(_FIELDS)


class Tactels(NamedTuple):
    """Memory of `fit_load`: gathered tactels, and what is known at each; values over the noise."""

    x: np.ndarray
    y: np.ndarray
    value: np.ndarray
    residual: np.ndarray
    weighted: np.ndarray
    root: np.ndarray  # of the weight
    by: Derivatives
    shape: np.ndarray  # (nodes, most): what the derivatives by the forces keep for those by place
    q: np.ndarray  # likewise
    ends: np.ndarray  # (layers,): where each layer's tactels end
    vector: np.ndarray  # right side of the normal equations


@njit(error_model='numpy')
def make_tactels(layers, most, nodes):
    """Memory for `fit_load` with at most so many tactels of so many nodes."""
    rows, by = np.empty((6, most)), np.empty((5, most))
    return Tactels(rows[0], rows[1], rows[2], rows[3], rows[4], rows[5],
                   Derivatives(by[0], by[1], by[2], by[3], by[4]), np.empty((nodes, most)),
                   np.empty((nodes, most)), np.zeros(layers, dtype=np.int64), np.zeros(5))


@njit(error_model='numpy')
def _derivatives(kind, sensor, layers, load, of_forces, tactels):
    """By the forces, or by the place with what those by the forces have kept of it."""
    n, by, nodes = tactels.ends[-1], tactels.by, sensor.nodes
    if of_forces:
        by.force[:n] = 0.0
        by.shear_x[:n] = 0.0
        by.shear_y[:n] = 0.0
    else:
        by.q0[:n] = 0.0
        by.q1[:n] = 0.0
    cos, sin = np.cos(load.yaw), np.sin(load.yaw)
    begin = 0
    for k in range(layers.size):
        end, layer = tactels.ends[k], layers[k]
        x, y = tactels.x[begin:end], tactels.y[begin:end]
        by_q0, by_q1 = by.q0[begin:end], by.q1[begin:end]
        by_force, by_x, by_y = by.force[begin:end], by.shear_x[begin:end], by.shear_y[begin:end]
        for j in range(nodes.size):
            node = nodes[j]
            shape, q = tactels.shape[j][begin:end], tactels.q[j][begin:end]
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
    """
    Turn a line so that yaw is in (-pi/2, pi/2].

    A half turn exchanges the two normals of a line: rho and the shear change their signs.
    """
    turns = np.ceil(load.yaw / np.pi - 0.5)
    load.yaw -= turns * np.pi
    if turns % 2.0 != 0.0:
        load.rho, load.shear = -load.rho, -load.shear
        for i in (Q0, SHEAR_X):
            for j in range(5):
                matrix[i, j] = -matrix[i, j]
                matrix[j, i] = -matrix[j, i]


@njit(error_model='numpy')
def _begin(kind, stress, sensor, layers, tactels, load):
    """First guess into the load, and tactels gathered: their number, and q1 as a length."""
    x, y = sensor.x, sensor.y
    if kind == POINT:
        row, column, v, w = guess_point(stress, layers)
        if row < 0:
            return 0, 1.0
        load.a, load.b = x[column] + w * sensor.pitch_x, y[row] + v * sensor.pitch_y
        return gather_window(stress, sensor, layers, row, column, v, w, tactels), 1.0
    load.rho, load.yaw = guess_line(stress, sensor, layers)
    if np.isnan(load.rho):
        return 0, 1.0
    return gather_pressure(stress, sensor, layers, tactels), (
        0.5 * np.hypot(x[-1] - x[0], y[-1] - y[0]))


@njit(error_model='numpy')
def _shallowest(layers):
    depth = np.inf
    for k in range(layers.size):
        depth = min(depth, layers[k].depth)
    return depth


@njit(error_model='numpy')
def _weigh_forces(tactels, load, n, model_error, tukey):
    """Tukey's weights of what the last load leaves, on the values and derivatives by forces."""
    by = tactels.by
    for i in range(n):
        tactels.residual[i] = tactels.value[i] - (
            by.force[i] * load.force + by.shear_x[i] * load.shear_x
            + by.shear_y[i] * load.shear_y)
        tactels.weighted[i] = tactels.value[i]
    tukey_weights(tactels.value, tactels.residual, n, model_error, tukey, tactels.root)
    weigh((tactels.weighted, by.force, by.shear_x, by.shear_y), tactels.root, n)


@njit(error_model='numpy')
def fit_load(kind, stress, sensor, layers, forces, model_error, tukey, tactels, fit):
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
    tactels : Tactels
        From `make_tactels`.
    fit : record of FIT
        Result.

    Returns
    -------
    bool
        False where it did not work: the load and its normal equations are of no use.
    """
    matrix, vector, by = fit.normal, tactels.vector, tactels.by
    fit.squared_error = fit.chi_square = 0.0
    fit.iterations, fit.last_step, fit.converged = 0, np.inf, False
    n, lever = _begin(kind, stress, sensor, layers, tactels, fit)
    fit.used = n
    if n <= 2 + forces:
        return False
    start_0, start_1 = fit.a, fit.b
    depth, robust = _shallowest(layers), tukey < np.inf
    for iteration in range(MAX_STEPS + 1):
        _derivatives(kind, sensor, layers, fit, True, tactels)
        if forces < 3:
            by.shear_y[:n] = 0.0
        if forces < 2:
            by.shear_x[:n] = 0.0
        data, weighing = tactels.value, robust and iteration > 0
        if weighing:
            _weigh_forces(tactels, fit, n, model_error, tukey)
            data = tactels.weighted
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
            weigh((by.q0, by.q1), tactels.root, n)
        normal_of_place(data, by, fit, n, tactels.residual, matrix, vector)
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
    fit.squared_error, fit.chi_square = chi_square(data, tactels.residual, n, model_error)
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
