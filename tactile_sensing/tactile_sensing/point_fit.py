"""Least-squares fit of a frictional point load to tactile images, as one compiled kernel."""

from dataclasses import dataclass
from functools import lru_cache
import math

from numba import njit
import numpy as np

from tactile_sensing.errors import ConfigurationError

STEPS = 3  # Gauss-Newton steps; from the peak they reach the Cramer-Rao bound
WINDOW = 4.5  # least half side of the fitted window [pitches]: 9x9 tactels
WINDOW_DEPTHS = 1.9  # the same in mean depths of the layers: deeper ones see further
STEP_BOUND = 1.0  # longest step of the point [depths of the shallowest layer]
CONVERGED = 0.1  # longest last step of a fit that has converged, likewise
SINGULAR = 1e-12  # smallest pivot of normal equations with a unit diagonal
COMPONENTS = ('zz', 'xz', 'yz')

# Reassociation lets the sums be vectorised; NaN and infinity keep their meaning.
_FAST = {'reassoc', 'contract', 'nsz', 'arcp'}
# Gauss-Legendre nodes for the average over a tactel [tactel sides] and their weights.
_NODES = {1: ((0.0,), (1.0,)),
          2: ((-math.sqrt(1 / 12), math.sqrt(1 / 12)), (0.5, 0.5)),
          3: ((-math.sqrt(0.15), 0.0, math.sqrt(0.15)), (5 / 18, 8 / 18, 5 / 18))}


@dataclass(frozen=True)
class Layer:
    """
    One layer of tactels.

    Parameters
    ----------
    component : str
        Measured stress: 'zz' (pressure), 'xz' or 'yz' (shear).
    depth : float
        Depth below the surface of the skin [m].
    noise_std : float
        Standard deviation of one tactel [Pa].

    Raises
    ------
    ConfigurationError
        Unknown component, or a depth or noise that is not positive.
    """

    component: str
    depth: float
    noise_std: float

    def __post_init__(self):
        if self.component not in COMPONENTS:
            raise ConfigurationError(
                f'component is {self.component!r}, must be one of {", ".join(COMPONENTS)}')
        for name, unit in (('depth', 'm'), ('noise_std', 'Pa')):
            value = getattr(self, name)
            if not (isinstance(value, (int, float, np.floating))
                    and math.isfinite(value) and value > 0):
                raise ConfigurationError(f'{name} is {value!r}, must be positive [{unit}]')


@dataclass(frozen=True)
class PointFit:
    """
    Fitted point load; of a batch, every attribute has a leading axis of N.

    Where the fit did not work, `converged` is false and, unless a fit was reached that
    merely still moved, the parameters are NaN and `last_step` is infinite.

    Attributes
    ----------
    a, b : float
        Point of contact [m].
    normal_force, shear_force_x, shear_force_y : float
        P, Qx and Qy, as the object exerts them on the skin [N].
    information : ndarray, shape (5, 5), or (3, 3) without shear
        Fisher information of the parameters in this order.
    squared_error : float
        Sum of (residual / noise)^2.
    chi_square : float
        Sum of residual^2 / (noise^2 + (model_error * model)^2).
    used : int
        Tactels used, all layers together.
    last_step : float
        Movement of the point in the last step [m].
    iterations : int
        Steps done.
    converged : bool
        Positive force, point within the window and a last step below CONVERGED.
    """

    a: float
    b: float
    normal_force: float
    shear_force_x: float
    shear_force_y: float
    information: np.ndarray
    squared_error: float
    chi_square: float
    used: int
    last_step: float
    iterations: int
    converged: bool

    @property
    def covariance(self):
        """Inverse of the information; NaN where the fit did not work."""
        scale = 1.0 / np.sqrt(np.diagonal(self.information, axis1=-2, axis2=-1))
        outer = scale[..., :, None] * scale[..., None, :]
        unit = self.information * outer
        bad = ~np.isfinite(unit).all(axis=(-2, -1), keepdims=True)
        inverse = np.linalg.inv(np.where(bad, np.eye(unit.shape[-1]), unit))
        return np.where(bad, np.nan, inverse * outer)


@njit(cache=True)
def _peak(stress, component, noise):
    """Layer, row and column of the largest pressure over its noise; layer -1 if none."""
    best = 0.0
    layer = row = column = -1
    for k in range(stress.shape[0]):
        if component[k] != 0:
            continue
        level = best * noise[k]
        for r in range(stress.shape[1]):
            for c in range(stress.shape[2]):
                if level < stress[k, r, c] < np.inf:  # false for NaN
                    level = stress[k, r, c]
                    layer, row, column = k, r, c
        best = max(best, level / noise[k])
    return layer, row, column


@njit(cache=True)
def _vertex(line, peak):
    """How far the vertex of a row of tactels is off its peak [pitches]; 0 where unknown."""
    if line.size < 3:
        return 0.0
    middle = min(max(peak, 1), line.size - 2)
    left, right = line[middle - 1], line[middle + 1]
    if not (left > 0.0 and line[middle] > 0.0 and right > 0.0):  # false for NaN
        return 0.0
    # Without shear pressure^(-2/5) is a parabola in x and in y, so its vertex is exact.
    f = (left / line[middle]) ** -0.4
    h = (right / line[middle]) ** -0.4
    curvature = f + h - 2.0
    if not 0.0 < curvature < np.inf:
        return 0.0
    return min(max(middle - peak + 0.5 * (f - h) / curvature, -0.5), 0.5)


@njit(cache=True)
def _start(stress, component, noise):
    """Row and column of the peak, and how far its vertex is off: (r, c, along y, along x)."""
    k, r, c = _peak(stress, component, noise)
    if k < 0:
        return -1, -1, 0.0, 0.0
    return r, c, _vertex(stress[k, :, c], r), _vertex(stress[k, r], c)


@njit(cache=True)
def _gather(stress, x, y, noise, row, column, v, w, window, points, ends):
    """Finite tactels of the window into points (x, y, value / noise); ends per layer."""
    # Relative to the peak, so that whole-tactel shifts cannot change the window.
    r0 = max(row + int(np.ceil(v - window)), 0)
    r1 = min(row + int(np.floor(v + window)) + 1, stress.shape[1])
    c0 = max(column + int(np.ceil(w - window)), 0)
    c1 = min(column + int(np.floor(w + window)) + 1, stress.shape[2])
    n = 0
    for k in range(stress.shape[0]):
        for r in range(r0, r1):
            for c in range(c0, c1):
                value = stress[k, r, c]
                if np.isfinite(value):
                    points[0, n] = x[c]
                    points[1, n] = y[r]
                    points[2, n] = value / noise[k]
                    n += 1
        ends[k] = n
    return n


@njit(cache=True, fastmath=_FAST)
def _add_forces(points, begin, end, a, b, depth, gz, gx, gy, scale, columns):
    """Add one layer's derivatives by (P, Qx, Qy) to columns 2 to 4, see `_add_columns`."""
    dd = depth * depth
    scale *= 1.5 / np.pi * dd
    for i in range(begin, end):
        u = points[0, i] - a
        v = points[1, i] - b
        q = 1.0 / (u * u + v * v + dd)
        shape = scale * q * q * np.sqrt(q) * (gz + gx * u + gy * v)
        columns[2, i] += shape * depth
        columns[3, i] += shape * u
        columns[4, i] += shape * v


@njit(cache=True, fastmath=_FAST)
def _add_columns(points, begin, end, a, b, force, qx, qy, depth, gz, gx, gy, scale, columns):
    """
    Add one layer's derivatives by (a, b) to columns 0 and 1, from equations (2.2) and (2.5).

    The component is (gz + gx x' + gy y') times the pressure.
    """
    dd = depth * depth
    scale *= 1.5 / np.pi * dd
    for i in range(begin, end):
        u = points[0, i] - a
        v = points[1, i] - b
        q = 1.0 / (u * u + v * v + dd)
        shape = scale * q * q * np.sqrt(q)
        load = force * depth + qx * u + qy * v
        lever = gz + gx * u + gy * v
        by = 5.0 * q * load * lever
        columns[0, i] += shape * (by * u - qx * lever - gx * load)
        columns[1, i] += shape * (by * v - qy * lever - gy * load)


@njit(cache=True, fastmath=_FAST)
def _dot(u, v, n):
    total = 0.0
    for i in range(n):
        total += u[i] * v[i]
    return total


@njit(cache=True)
def _evaluate(points, ends, layers, nodes, theta, forces, columns):
    """Derivatives over the noise at the gathered tactels: by the forces, or by the position."""
    first, last = (2, 5) if forces else (0, 2)
    columns[first:last, :ends[-1]] = 0.0
    begin = 0
    for k in range(ends.size):
        depth, noise = layers[k, 0], layers[k, 1]
        gz, gx, gy = layers[k, 2], layers[k, 3], layers[k, 4]
        for j in range(nodes.shape[0]):
            a, b = theta[0] - nodes[j, 0], theta[1] - nodes[j, 1]
            scale = nodes[j, 2] / noise
            if forces:
                _add_forces(points, begin, ends[k], a, b, depth, gz, gx, gy, scale, columns)
            else:
                _add_columns(points, begin, ends[k], a, b, theta[2], theta[3], theta[4],
                             depth, gz, gx, gy, scale, columns)
        begin = ends[k]


@njit(cache=True)
def _solve(matrix, vector, first, last, step):
    """Solve the block [first, last) scaled to a unit diagonal by Cholesky; False if singular."""
    # m and N differ by many orders of magnitude, hence the scaling.
    scale = np.empty(5)
    lower = np.empty((5, 5))
    for i in range(first, last):
        if not 0.0 < matrix[i, i] < np.inf:
            return False
        scale[i] = 1.0 / np.sqrt(matrix[i, i])
    for i in range(first, last):
        total = vector[i] * scale[i]
        for j in range(first, i + 1):
            element = matrix[i, j] * scale[i] * scale[j]
            for m in range(first, j):
                element -= lower[i, m] * lower[j, m]
            if i == j:
                if not element > SINGULAR:
                    return False
                lower[i, i] = np.sqrt(element)
            else:
                lower[i, j] = element / lower[j, j]
                total -= lower[i, j] * step[j]
        step[i] = total / lower[i, i]
    for i in range(last - 1, first - 1, -1):
        for j in range(i + 1, last):
            step[i] -= lower[j, i] * step[j]
        step[i] /= lower[i, i]
    for i in range(first, last):
        step[i] *= scale[i]
    return True


@njit(cache=True)
def _normal(columns, rest, n, first, last, matrix, vector):
    """Normal equations of the columns [first, last)."""
    for i in range(first, last):
        for j in range(first, i + 1):
            matrix[i, j] = matrix[j, i] = _dot(columns[i], columns[j], n)
        vector[i] = _dot(columns[i], rest, n)


@njit(cache=True, fastmath=_FAST)
def _residual(values, columns, theta, n, rest):
    for i in range(n):
        rest[i] = values[i] - (
            columns[2, i] * theta[2] + columns[3, i] * theta[3] + columns[4, i] * theta[4])


@njit(cache=True, fastmath=_FAST)
def _chi_square(values, rest, n, model_error):
    """Squared error and chi-square with the model-error allowance."""
    squared = chi = 0.0
    for i in range(n):
        error = rest[i] * rest[i]
        allowed = model_error * (values[i] - rest[i])
        squared += error
        chi += error / (1.0 + allowed * allowed)
    return squared, chi


@njit(cache=True)
def _fit(stress, x, y, pitch, layers, component, nodes, window, last, model_error, steps,
         points, columns, ends, theta, matrix, out):
    """Variable projection, then Gauss-Newton, from the peak; False where it did not work."""
    row, column, v, w = _start(stress, component, layers[:, 1])
    if row < 0:
        return False
    pitch_x, pitch_y = pitch
    start_x, start_y = x[column] + w * pitch_x, y[row] + v * pitch_y
    n = _gather(stress, x, y, layers[:, 1], row, column, v, w, window, points, ends)
    out[2] = n
    if n <= last:
        return False
    rest = points[3]
    values = points[2]
    bound = STEP_BOUND * layers[:, 0].min()
    vector = np.zeros(5)
    step = np.zeros(5)
    theta[:] = 0.0
    theta[0], theta[1] = start_x, start_y
    for iteration in range(steps + 1):
        # The forces enter linearly: the best ones for each position come from a solve of
        # their own (variable projection), which needs no start and saves a step.
        _evaluate(points, ends, layers, nodes, theta, True, columns)
        _normal(columns, values, n, 2, last, matrix, vector)
        if not _solve(matrix, vector, 2, last, theta):
            return False
        _evaluate(points, ends, layers, nodes, theta, False, columns)
        _residual(values, columns, theta, n, rest)
        _normal(columns, rest, n, 0, 2, matrix, vector)
        for i in range(2, last):
            for j in range(2):
                matrix[i, j] = matrix[j, i] = _dot(columns[i], columns[j], n)
            vector[i] = 0.0  # of the best forces
        if iteration == steps:
            break
        if not _solve(matrix, vector, 0, last, step):
            return False
        length = np.hypot(step[0], step[1])
        if not length < np.inf:
            return False
        shorter = min(1.0, bound / length) if length > 0.0 else 1.0
        theta[0] += shorter * step[0]
        theta[1] += shorter * step[1]
        out[3] = shorter * length
        out[4] = iteration + 1
    out[0], out[1] = _chi_square(values, rest, n, model_error)
    if not (out[0] < np.inf and theta[2] > 0.0 and abs(theta[0] - start_x) <= window * pitch_x
            and abs(theta[1] - start_y) <= window * pitch_y):
        return False
    out[5] = 1.0 if out[3] <= CONVERGED * layers[:, 0].min() else 0.0
    return True


@njit(cache=True)
def _fit_all(stress, x, y, pitch, layers, component, nodes, window, last, model_error, steps,
             theta, information, out):
    """Fit every frame of stress (N, layers, rows, columns)."""
    side = int(2.0 * window) + 2
    most = stress.shape[1] * min(side, stress.shape[2]) * min(side, stress.shape[3])
    points = np.empty((4, most))
    columns = np.empty((5, most))
    ends = np.zeros(stress.shape[1], dtype=np.int64)
    matrix = np.zeros((5, 5))
    for f in range(stress.shape[0]):
        out[f] = 0.0
        out[f, 3] = np.inf
        if _fit(stress[f], x, y, pitch, layers, component, nodes, window, last, model_error,
                steps, points, columns, ends, theta[f], matrix, out[f]):
            information[f] = matrix[:last, :last]
        else:
            theta[f] = np.nan
            information[f] = np.nan
            out[f, 0] = out[f, 1] = np.nan
            out[f, 3] = np.inf


@lru_cache(maxsize=64)
def _layer_arrays(layers):
    """Depth, noise and lever coefficients of each layer (layers, 5), and its component."""
    rows = []
    for layer in layers:
        lever = {'zz': (1.0, 0.0, 0.0), 'xz': (0.0, 1.0 / layer.depth, 0.0),
                 'yz': (0.0, 0.0, 1.0 / layer.depth)}[layer.component]
        rows.append((layer.depth, layer.noise_std, *lever))
    component = np.array([COMPONENTS.index(layer.component) for layer in layers])
    if not (component == 0).any():
        raise ConfigurationError("layers have no 'zz', must have at least one to start from")
    return np.array(rows, dtype=np.float64), component


@lru_cache(maxsize=64)
def _node_array(tactel_points, pitch_x, pitch_y):
    """Points that stand for a tactel's area: offsets along x and y [m] and weight, (n^2, 3)."""
    if tactel_points not in _NODES:
        raise ConfigurationError(f'tactel_points is {tactel_points!r}, must be 1, 2 or 3')
    nodes = list(zip(*_NODES[tactel_points], strict=True))
    return np.array([(p * pitch_x, q * pitch_y, u * w) for p, u in nodes for q, w in nodes])


def _run(stress, array, layers, shear, window, model_error, steps, tactel_points):
    layers = tuple(layers)
    if stress.shape[1:] != (len(layers), *array.shape):
        raise ConfigurationError(
            f'stress has the shape {stress.shape[1:]} per frame, must be '
            f'{(len(layers), *array.shape)}')
    table, component = _layer_arrays(layers)
    if window is None:
        depth = table[:, 0].mean()
        window = max(WINDOW, WINDOW_DEPTHS * depth / min(array.pitch_x, array.pitch_y))
    if not 1.0 <= window < 1e6:
        raise ConfigurationError(f'window is {window!r}, must be at least 1 [pitches]')
    nodes = _node_array(tactel_points, array.pitch_x, array.pitch_y)
    count, last = len(stress), 5 if shear else 3
    theta = np.empty((count, 5))
    information = np.empty((count, last, last))
    out = np.empty((count, 6))
    _fit_all(stress, array.x, array.y, (float(array.pitch_x), float(array.pitch_y)), table,
             component, nodes, float(window), last, float(model_error), int(steps), theta,
             information, out)
    return theta, information, out


def fit_point(stress, array, layers, *, shear=True, window=None, model_error=0.07,
              steps=STEPS, tactel_points=1):
    """
    Fit a frictional point load to the tactels around the peak by Gauss-Newton.

    The models of chapter 2, equations (2.2) and (2.5), with any number of layers: model 1 is
    one 'zz' layer, model 2 two of them, model 3 a 'zz' and an 'xz' layer. No sign of the
    shear needs to be known.

    Parameters
    ----------
    stress : ndarray, shape (layers, rows, columns)
        Pressure of a 'zz' layer, -tau_xz and -tau_yz of the others [Pa]; tactels that are not
        finite have weight 0.
    array : TactelArray
        Geometry of the tactels.
    layers : sequence of Layer
        What each layer measures; at least one 'zz'.
    shear : bool
        False fits (a, b, P) alone, with Qx = Qy = 0.
    window : float, optional
        Half side of the square of tactels used, centred on the peak [pitches]; by default
        WINDOW or WINDOW_DEPTHS, whichever is more.
    model_error : float
        Allowance for what the model leaves out, as a fraction of the modelled stress.
    steps : int
        Gauss-Newton steps.
    tactel_points : int
        1: tactels sample a point; 2 or 3: they average over their area, by so many Gauss
        points along each side.

    Returns
    -------
    PointFit

    Raises
    ------
    ConfigurationError
        Wrong shape of stress, no 'zz' layer, or an option out of its range.
    """
    stress = np.ascontiguousarray(stress, dtype=np.float64)[None]
    theta, information, out = _run(
        stress, array, layers, shear, window, model_error, steps, tactel_points)
    squared, chi, used, last_step, iterations, converged = out[0].tolist()
    return PointFit(*theta[0].tolist(), information[0], squared, chi, int(used), last_step,
                    int(iterations), converged > 0.0)


def fit_points(stress, array, layers, *, shear=True, window=None, model_error=0.07,
               steps=STEPS, tactel_points=1):
    """
    Fit every frame of a batch as `fit_point` does, in one compiled loop.

    Parameters
    ----------
    stress : ndarray, shape (N, layers, rows, columns)
        As in `fit_point`, and so are the other parameters.

    Returns
    -------
    PointFit
        Of arrays of shape (N,) and (N, 5, 5) or (N, 3, 3).

    Raises
    ------
    ConfigurationError
        As `fit_point`.
    """
    stress = np.ascontiguousarray(stress, dtype=np.float64)
    if stress.ndim != 4:
        raise ConfigurationError(f'stress has {stress.ndim} dimensions, must have 4')
    theta, information, out = _run(
        stress, array, layers, shear, window, model_error, steps, tactel_points)
    return PointFit(*theta.T, information, out[:, 0], out[:, 1], out[:, 2].astype(int), out[:, 3],
                    out[:, 4].astype(int), out[:, 5] > 0.0)
