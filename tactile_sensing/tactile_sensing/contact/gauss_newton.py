"""One load fitted to one frame: start, gather, Gauss-Newton; all compiled."""

import numpy as np

from tactile_common.errors import ConfigurationError
from tactile_common.kernels import njit
from tactile_sensing.contact.variable_projection import (
    best_forces,
    chi_square,
    normal_of_forces,
    normal_of_place,
    place_step,
    TUKEY,
    tukey_weights,
    weigh,
)
from tactile_sensing.half_space import line_model, point_model
from tactile_sensing.half_space.layers import sensor_of

POINT, LINE = 1, 2  # as in contact.ContactType
STEPS = 3  # Gauss-Newton steps; from the start they reach the Cramer-Rao bound
MAX_STEPS = 10  # where the place has not settled by then: shear beyond friction, outliers
SETTLED = 0.005  # step after which none is needed [depths]; what it leaves is its square
CONVERGED = 0.05  # longest last step of a place that is told; much noise keeps it moving a little
STEP_BOUND = 1.0  # longest step [depths of the shallowest layer]
SQUARED, CHI, USED, LAST_STEP, ITERATIONS, OK = range(6)  # of what `fit_frame` says


@njit(error_model='numpy')
def make_work(layers, most, nodes):
    """Memory for `fit_frame` with at most so many tactels of so many nodes."""
    return (np.empty((6, most)), np.empty((5, most)), np.empty((2, nodes, most)),
            np.zeros(layers, dtype=np.int64), np.zeros(5), np.zeros(6))


@njit(error_model='numpy')
def _evaluate(kind, points, ends, layers, nodes, theta, of_forces, columns, kept):
    """
    Derivatives over the noise at the gathered tactels: by the forces, then by the place.

    What the forces have kept of a place is used for the derivatives by it.
    """
    for i in range(2, 5) if of_forces else range(2):
        columns[i][:ends[-1]] = 0.0
    cos, sin = np.cos(theta[1]), np.sin(theta[1])
    begin = 0
    for k in range(ends.size):
        end = ends[k]
        x, y = points[0][begin:end], points[1][begin:end]
        by_q0, by_q1 = columns[0][begin:end], columns[1][begin:end]
        one, two, three = columns[2][begin:end], columns[3][begin:end], columns[4][begin:end]
        depth, noise = layers[k, 0], layers[k, 1]
        gz, gx, gy = layers[k, 2], layers[k, 3], layers[k, 4]
        for j in range(nodes.shape[0]):
            shape, q = kept[0, j][begin:end], kept[1, j][begin:end]
            scale = nodes[j, 2] / noise
            if kind == POINT:  # the load moved back, in place of the part of the tactel
                a, b = theta[0] - nodes[j, 0], theta[1] - nodes[j, 1]
                if of_forces:
                    point_model.add_forces(
                        x, y, a, b, depth, gz, gx, gy, scale, shape, q, one, two, three)
                else:
                    point_model.add_place(x, y, a, b, theta[2], theta[3], theta[4], depth,
                                          gz, gx, gy, shape, q, by_q0, by_q1)
            else:
                rho = theta[0] - nodes[j, 0] * cos - nodes[j, 1] * sin
                if of_forces:
                    line_model.add_forces(
                        x, y, cos, sin, rho, depth, scale, shape, q, one, two)
                else:
                    along = nodes[j, 1] * cos - nodes[j, 0] * sin
                    line_model.add_place(x, y, cos, sin, rho, along, theta[2], theta[3], depth,
                                         shape, q, by_q0, by_q1)
        begin = end


@njit(error_model='numpy')
def _turn_upright(theta, matrix):
    """
    Turn a line so that yaw is in (-pi/2, pi/2].

    A half turn exchanges the two normals of a line: rho and the shear change their signs.
    """
    turns = np.ceil(theta[1] / np.pi - 0.5)
    theta[1] -= turns * np.pi
    if turns % 2.0 != 0.0:
        for i in (0, 3):
            theta[i] = -theta[i]
            for j in range(5):
                matrix[i, j] = -matrix[i, j]
                matrix[j, i] = -matrix[j, i]


@njit(error_model='numpy')
def _begin(kind, stress, sensor, layers, points, ends, theta):
    """Start of the place into theta, tactels into points; their number, and theta[1] as length."""
    x, y, pitch_x, pitch_y, component, _, window = sensor
    noise = layers[:, 1]
    if kind == POINT:
        row, column, v, w = point_model.start(stress, component, noise)
        if row < 0:
            return 0, 1.0
        theta[0], theta[1] = x[column] + w * pitch_x, y[row] + v * pitch_y
        return point_model.gather(
            stress, x, y, noise, row, column, v, w, window, points, ends), 1.0
    theta[0], theta[1] = line_model.start(stress, x, y, component, noise)
    if np.isnan(theta[0]):
        return 0, 1.0
    return line_model.gather(stress, x, y, noise, component, points, ends), (
        0.5 * np.hypot(x[-1] - x[0], y[-1] - y[0]))


@njit(error_model='numpy')
def fit_frame(kind, stress, sensor, layers, forces, model_error, tukey, work, found):
    """
    Fit a load to one frame.

    Parameters
    ----------
    kind : int
        POINT: theta is (a, b, P, Qx, Qy); LINE: (rho, yaw, force, shear across, 0).
    stress : ndarray, shape (layers, rows, columns)
    sensor : tuple
        From `sensor_of`.
    layers : ndarray, shape (layers, 6)
        From `sensor_of`, with the noise.
    forces : int
        Force parameters in use: 1 (no shear), 2 (line) or 3 (point).
    model_error : float
        Allowance of chi-square and of the weights.
    tukey : float
        Scales at which a tactel has lost all weight (Tukey's biweight); infinite: all are equal.
    work : tuple
        From `make_work`.
    found : (theta, matrix, out), ndarray of shape (5,), (5, 5), (6,)
        Results: parameters, normal equations (lower triangle), SQUARED ... OK.

    Returns
    -------
    bool
        False where it did not work: theta and matrix are of no use.
    """
    points, columns, kept, ends, vector, inverse = work
    theta, matrix, out = found
    out[:] = 0.0
    out[LAST_STEP] = np.inf
    n, lever = _begin(kind, stress, sensor, layers, points, ends, theta)
    out[USED] = n
    if n <= 2 + forces:
        return False
    start_0, start_1 = theta[0], theta[1]
    values, rest, weighted, roots = points[2], points[3], points[4], points[5]
    by_q0, by_q1, one, two, three = (
        columns[0], columns[1], columns[2], columns[3], columns[4])
    nodes, depth, robust = sensor[5], layers[:, 0].min(), tukey < np.inf
    for iteration in range(MAX_STEPS + 1):
        _evaluate(kind, points, ends, layers, nodes, theta, True, columns, kept)
        if forces < 3:
            three[:n] = 0.0
        if forces < 2:
            two[:n] = 0.0
        data, weighing = values, robust and iteration > 0
        if weighing:
            for i in range(n):
                rest[i] = values[i] - (one[i] * theta[2] + two[i] * theta[3] + three[i] * theta[4])
                weighted[i] = values[i]
            tukey_weights(values, rest, n, model_error, tukey, roots)
            weigh((weighted, one, two, three), roots, n)
            data = weighted
        normal_of_forces(data, one, two, three, n, matrix, vector)
        if forces < 3:
            matrix[4, 4] = 1.0
        if forces < 2:
            matrix[3, 3] = 1.0
        if not best_forces(matrix, vector, theta, inverse):
            return False
        _evaluate(kind, points, ends, layers, nodes, theta, False, columns, kept)
        if weighing:
            weigh((by_q0, by_q1), roots, n)
        normal_of_place(
            data, by_q0, by_q1, one, two, three, theta, n, rest, matrix, vector)
        if iteration >= (MAX_STEPS if robust else STEPS) and (
                out[LAST_STEP] <= SETTLED * depth or iteration >= MAX_STEPS):
            break
        step_0, step_1 = place_step(matrix, vector, inverse)
        length = np.hypot(step_0, lever * step_1)
        if not length < np.inf:
            return False
        shorter = min(1.0, STEP_BOUND * depth / length) if length > 0.0 else 1.0
        theta[0] += shorter * step_0
        theta[1] += shorter * step_1
        out[LAST_STEP] = shorter * length
        out[ITERATIONS] = iteration + 1
    out[SQUARED], out[CHI] = chi_square(data, rest, n, model_error)
    if not (out[SQUARED] < np.inf and theta[2] > 0.0):
        return False
    if kind == POINT:
        if not (abs(theta[0] - start_0) <= sensor[6] * sensor[2]
                and abs(theta[1] - start_1) <= sensor[6] * sensor[3]):
            return False
    else:
        _turn_upright(theta, matrix)
    out[OK] = 1.0 if out[LAST_STEP] <= CONVERGED * depth else 0.0
    return True


@njit(cache=True, error_model='numpy')
def _fit_frames(kind, stress, sensor, layers, forces, model_error, tukey, theta, information,
               out):
    """Fit every frame of stress (N, layers, rows, columns), see `fit_frame`."""
    most = stress.shape[1] * stress.shape[2] * stress.shape[3]
    if kind == POINT:
        side = int(2.0 * sensor[6]) + 2
        most = stress.shape[1] * min(side, stress.shape[2]) * min(side, stress.shape[3])
    work = make_work(stress.shape[1], most, sensor[5].shape[0])
    matrix = np.zeros((5, 5))
    for f in range(stress.shape[0]):
        if fit_frame(kind, stress[f], sensor, layers, forces, model_error, tukey, work,
                     (theta[f], matrix, out[f])):
            for i in range(2 + forces):
                for j in range(i + 1):
                    information[f, i, j] = information[f, j, i] = matrix[i, j]
        else:
            theta[f] = information[f] = out[f, SQUARED] = out[f, CHI] = np.nan
            out[f, LAST_STEP] = np.inf


def fit_loads(kind, stress, array, layers, *, shear, window=None, model_error=0.07,
              robust=False, tactel_points=1):
    """
    Fit one load to every frame: parameters (N, 5), Fisher information and what `fit_frame` says.

    Behind `point_fit` and `line_fit`, which say what the arguments mean.

    Raises
    ------
    ConfigurationError
        Wrong shape of stress, no 'zz' layer, or an option out of its range.
    """
    layers = tuple(layers)
    if stress.shape[1:] != (len(layers), *array.shape):
        raise ConfigurationError(
            f'stress has the shape {stress.shape[1:]} per frame, must be '
            f'{(len(layers), *array.shape)}')
    sensor, table = sensor_of(array, layers, tactel_points, window)
    forces = 1 + int(shear) * (2 if kind == POINT else 1)
    count = len(stress)
    theta = np.empty((count, 5))
    information = np.empty((count, 2 + forces, 2 + forces))
    out = np.empty((count, 6))
    _fit_frames(kind, stress, sensor, table, forces, float(model_error),
                TUKEY if robust else np.inf, theta, information, out)
    return theta, information, out
