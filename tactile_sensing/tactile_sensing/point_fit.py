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
        """Inverse of the information; NaN where the fit did not work or has none."""
        scale = 1.0 / np.sqrt(np.diagonal(self.information, axis1=-2, axis2=-1))
        outer = scale[..., :, None] * scale[..., None, :]
        unit = self.information * outer
        bad = ~np.isfinite(unit).all(axis=(-2, -1), keepdims=True)
        # Singular to rounding counts as none; of a unit diagonal the determinant tells.
        bad |= ~(np.linalg.det(np.where(bad, 0.0, unit)) > SINGULAR**2)[..., None, None]
        inverse = np.linalg.inv(np.where(bad, np.eye(unit.shape[-1]), unit))
        return np.where(bad, np.nan, inverse * outer)


@njit(cache=True, error_model='numpy')
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


@njit(cache=True, error_model='numpy')
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


@njit(cache=True, error_model='numpy')
def _start(stress, component, noise):
    """Row and column of the peak, and how far its vertex is off: (r, c, along y, along x)."""
    k, r, c = _peak(stress, component, noise)
    if k < 0:
        return -1, -1, 0.0, 0.0
    return r, c, _vertex(stress[k, :, c], r), _vertex(stress[k, r], c)


@njit(cache=True, error_model='numpy')
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


# Rows of their own, indexed from 0, or these loops could not be vectorised.
@njit(cache=True, error_model='numpy', fastmath=_FAST)
def _add_forces(x, y, a, b, depth, gz, gx, gy, scale, by_force, by_qx, by_qy):
    """Add one layer's derivatives by (P, Qx, Qy), see `_add_position`."""
    dd = depth * depth
    scale *= 1.5 / np.pi * dd
    for i in range(x.size):
        u = x[i] - a
        v = y[i] - b
        q = 1.0 / (u * u + v * v + dd)
        shape = scale * q * q * np.sqrt(q) * (gz + gx * u + gy * v)
        by_force[i] += shape * depth
        by_qx[i] += shape * u
        by_qy[i] += shape * v


@njit(cache=True, error_model='numpy', fastmath=_FAST)
def _add_position(x, y, a, b, force, qx, qy, depth, gz, gx, gy, scale, by_a, by_b):
    """
    Add one layer's derivatives by (a, b), from equations (2.2) and (2.5).

    The component is (gz + gx x' + gy y') times the pressure.
    """
    dd = depth * depth
    scale *= 1.5 / np.pi * dd
    for i in range(x.size):
        u = x[i] - a
        v = y[i] - b
        q = 1.0 / (u * u + v * v + dd)
        shape = scale * q * q * np.sqrt(q)
        load = force * depth + qx * u + qy * v
        lever = gz + gx * u + gy * v
        by = 5.0 * q * load * lever
        by_a[i] += shape * (by * u - qx * lever - gx * load)
        by_b[i] += shape * (by * v - qy * lever - gy * load)


@njit(cache=True, error_model='numpy')
def _evaluate(points, ends, layers, nodes, theta, forces, columns):
    """Derivatives over the noise at the gathered tactels: by the forces, or by the position."""
    for i in range(2, 5) if forces else range(2):
        columns[i][:ends[-1]] = 0.0
    begin = 0
    for k in range(ends.size):
        end = ends[k]
        x, y = points[0][begin:end], points[1][begin:end]
        depth, noise = layers[k, 0], layers[k, 1]
        gz, gx, gy = layers[k, 2], layers[k, 3], layers[k, 4]
        for j in range(nodes.shape[0]):
            a, b = theta[0] - nodes[j, 0], theta[1] - nodes[j, 1]
            scale = nodes[j, 2] / noise
            if forces:
                _add_forces(x, y, a, b, depth, gz, gx, gy, scale, columns[2][begin:end],
                            columns[3][begin:end], columns[4][begin:end])
            else:
                _add_position(x, y, a, b, theta[2], theta[3], theta[4], depth, gz, gx, gy,
                              scale, columns[0][begin:end], columns[1][begin:end])
        begin = end


@njit(cache=True, error_model='numpy')
def _best_forces(matrix, vector, theta, inverse):
    """Forces into theta, and the inverse of their block of the matrix; False if singular."""
    # Scaled to a unit diagonal: tangential columns are smaller by orders of magnitude.
    if not (matrix[2, 2] > 0.0 and matrix[3, 3] > 0.0 and matrix[4, 4] > 0.0):
        return False
    f = 1.0 / np.sqrt(matrix[2, 2])
    x = 1.0 / np.sqrt(matrix[3, 3])
    y = 1.0 / np.sqrt(matrix[4, 4])
    fx, fy, xy = f * x * matrix[3, 2], f * y * matrix[4, 2], x * y * matrix[4, 3]
    det = 1.0 + 2.0 * fx * fy * xy - fx * fx - fy * fy - xy * xy
    if not SINGULAR < det < np.inf:
        return False
    ff, xx, yy = f * f * (1.0 - xy * xy) / det, x * x * (1.0 - fy * fy) / det, (
        y * y * (1.0 - fx * fx) / det)
    fx, fy, xy = f * x * (fy * xy - fx) / det, f * y * (fx * xy - fy) / det, (
        x * y * (fx * fy - xy) / det)
    inverse[0], inverse[1], inverse[2], inverse[3], inverse[4], inverse[5] = (
        ff, xx, yy, fx, fy, xy)
    theta[2] = ff * vector[2] + fx * vector[3] + fy * vector[4]
    theta[3] = fx * vector[2] + xx * vector[3] + xy * vector[4]
    theta[4] = fy * vector[2] + xy * vector[3] + yy * vector[4]
    return True


@njit(cache=True, error_model='numpy')
def _position_step(matrix, vector, inverse):
    """Gauss-Newton step of (a, b) with the forces eliminated; infinite if singular."""
    ff, xx, yy, fx, fy, xy = (
        inverse[0], inverse[1], inverse[2], inverse[3], inverse[4], inverse[5])
    fa, xa, ya = matrix[2, 0], matrix[3, 0], matrix[4, 0]
    fb, xb, yb = matrix[2, 1], matrix[3, 1], matrix[4, 1]
    f, x, y = ff * fa + fx * xa + fy * ya, fx * fa + xx * xa + xy * ya, (
        fy * fa + xy * xa + yy * ya)
    aa = matrix[0, 0] - f * fa - x * xa - y * ya
    ab = matrix[1, 0] - f * fb - x * xb - y * yb
    bb = matrix[1, 1] - ff * fb * fb - xx * xb * xb - yy * yb * yb - 2.0 * (
        fx * fb * xb + fy * fb * yb + xy * xb * yb)
    det = aa * bb - ab * ab
    if not (aa > SINGULAR * matrix[0, 0] and bb > SINGULAR * matrix[1, 1]
            and det > SINGULAR * aa * bb):
        return np.inf, np.inf
    return (bb * vector[0] - ab * vector[1]) / det, (aa * vector[1] - ab * vector[0]) / det


@njit(cache=True, error_model='numpy', fastmath=_FAST)
def _normal_of_forces(values, by_force, by_qx, by_qy, n, matrix, vector):
    """Normal equations of the forces alone, lower triangle."""
    ff = fx = xx = fy = xy = yy = f = x = y = 0.0
    for i in range(n):
        value, jf, jx, jy = values[i], by_force[i], by_qx[i], by_qy[i]
        ff += jf * jf
        fx += jf * jx
        xx += jx * jx
        fy += jf * jy
        xy += jx * jy
        yy += jy * jy
        f += jf * value
        x += jx * value
        y += jy * value
    matrix[2, 2] = ff
    matrix[3, 2], matrix[3, 3] = fx, xx
    matrix[4, 2], matrix[4, 3], matrix[4, 4] = fy, xy, yy
    vector[2], vector[3], vector[4] = f, x, y


@njit(cache=True, error_model='numpy', fastmath=_FAST)
def _normal_of_position(values, by_a, by_b, by_force, by_qx, by_qy, theta, n, rest,
                        matrix, vector):
    """Complete the normal equations with (a, b) at the best forces; residuals into rest."""
    force, qx, qy = theta[2], theta[3], theta[4]
    aa = ab = bb = fa = fb = xa = xb = ya = yb = a = b = 0.0
    for i in range(n):
        ja, jb, jf, jx, jy = by_a[i], by_b[i], by_force[i], by_qx[i], by_qy[i]
        error = values[i] - (jf * force + jx * qx + jy * qy)
        rest[i] = error
        aa += ja * ja
        ab += ja * jb
        bb += jb * jb
        fa += jf * ja
        fb += jf * jb
        xa += jx * ja
        xb += jx * jb
        ya += jy * ja
        yb += jy * jb
        a += ja * error
        b += jb * error
    matrix[0, 0] = aa
    matrix[1, 0], matrix[1, 1] = ab, bb
    matrix[2, 0], matrix[2, 1] = fa, fb
    matrix[3, 0], matrix[3, 1] = xa, xb
    matrix[4, 0], matrix[4, 1] = ya, yb
    vector[0], vector[1] = a, b


@njit(cache=True, error_model='numpy', fastmath=_FAST)
def _chi_square(values, rest, n, model_error):
    """Squared error and chi-square with the model-error allowance."""
    squared = chi = 0.0
    for i in range(n):
        error = rest[i] * rest[i]
        allowed = model_error * (values[i] - rest[i])
        squared += error
        chi += error / (1.0 + allowed * allowed)
    return squared, chi


@njit(cache=True, error_model='numpy')
def _fit(stress, x, y, pitch, layers, component, nodes, window, last, model_error, steps,
         points, columns, ends, vector, inverse, theta, matrix, out):
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
    values, rest = points[2], points[3]
    by_a, by_b, by_force, by_qx, by_qy = (
        columns[0], columns[1], columns[2], columns[3], columns[4])
    bound = STEP_BOUND * layers[:, 0].min()
    theta[0], theta[1] = start_x, start_y
    for iteration in range(steps + 1):
        # The forces enter linearly: the best ones for each position come from a solve of
        # their own (variable projection), which needs no start and saves a step.
        _evaluate(points, ends, layers, nodes, theta, True, columns)
        if last == 3:  # no shear
            by_qx[:n] = 0.0
            by_qy[:n] = 0.0
        _normal_of_forces(values, by_force, by_qx, by_qy, n, matrix, vector)
        if last == 3:
            matrix[3, 3] = matrix[4, 4] = 1.0
        if not _best_forces(matrix, vector, theta, inverse):
            return False
        _evaluate(points, ends, layers, nodes, theta, False, columns)
        _normal_of_position(values, by_a, by_b, by_force, by_qx, by_qy, theta, n, rest,
                            matrix, vector)
        if iteration == steps:
            break
        step_a, step_b = _position_step(matrix, vector, inverse)
        length = np.sqrt(step_a * step_a + step_b * step_b)
        if not length < np.inf:
            return False
        shorter = min(1.0, bound / length) if length > 0.0 else 1.0
        theta[0] += shorter * step_a
        theta[1] += shorter * step_b
        out[3] = shorter * length
        out[4] = iteration + 1
    out[0], out[1] = _chi_square(values, rest, n, model_error)
    if not (out[0] < np.inf and theta[2] > 0.0 and abs(theta[0] - start_x) <= window * pitch_x
            and abs(theta[1] - start_y) <= window * pitch_y):
        return False
    out[5] = 1.0 if out[3] <= CONVERGED * layers[:, 0].min() else 0.0
    return True


@njit(cache=True, error_model='numpy')
def _fit_all(stress, x, y, pitch, layers, component, nodes, window, last, model_error, steps,
             theta, information, out):
    """Fit every frame of stress (N, layers, rows, columns)."""
    side = int(2.0 * window) + 2
    most = stress.shape[1] * min(side, stress.shape[2]) * min(side, stress.shape[3])
    points = np.empty((4, most))
    columns = np.empty((5, most))
    ends = np.zeros(stress.shape[1], dtype=np.int64)
    matrix = np.zeros((5, 5))
    vector, inverse = np.zeros(5), np.zeros(6)
    for f in range(stress.shape[0]):
        out[f] = 0.0
        out[f, 3] = np.inf
        if _fit(stress[f], x, y, pitch, layers, component, nodes, window, last, model_error,
                steps, points, columns, ends, vector, inverse, theta[f], matrix, out[f]):
            for i in range(last):
                for j in range(i + 1):
                    information[f, i, j] = information[f, j, i] = matrix[i, j]
        else:
            theta[f] = np.nan
            information[f] = np.nan
            out[f, 0] = out[f, 1] = np.nan
            out[f, 3] = np.inf


@lru_cache(maxsize=64)
def _layer_arrays(layers):
    """Depth, noise and lever coefficients (layers, 5), components, mean depth."""
    rows = []
    for layer in layers:
        lever = {'zz': (1.0, 0.0, 0.0), 'xz': (0.0, 1.0 / layer.depth, 0.0),
                 'yz': (0.0, 0.0, 1.0 / layer.depth)}[layer.component]
        rows.append((layer.depth, layer.noise_std, *lever))
    component = np.array([COMPONENTS.index(layer.component) for layer in layers])
    if not (component == 0).any():
        raise ConfigurationError("layers have no 'zz', must have at least one to start from")
    table = np.array(rows, dtype=np.float64)
    return table, component, float(table[:, 0].mean())


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
    table, component, depth = _layer_arrays(layers)
    if window is None:
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
