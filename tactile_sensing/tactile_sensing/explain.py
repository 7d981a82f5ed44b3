"""
One frame explained as a point or as a line, with as little as explains it; all compiled.

Fit with shear; take off a drift of the baseline that the border shows; leave out tactels that
contradict all others; fit without shear where shear is not significant; then judge.
"""

import math

from numba import njit
import numpy as np

from tactile_sensing import line_model, point_model
from tactile_sensing.contact import ContactType, Reason
from tactile_sensing.load_fit import fit_frame, ITERATIONS, LINE, OK, POINT, SQUARED, STEPS, USED
from tactile_sensing.separable_fit import TUKEY

SHEAR_EVIDENCE = 6.0, 10.8  # chi-square of (Qx, Qy) of a point, and of a line's shear
DRIFT_EVIDENCE = 4.0  # standard errors of the border's median that are a drift
MAX_DRIFT = 0.1  # of the peak; more is a load of its own
MIN_BORDER = 8  # live tactels that a median is taken of
OUTLIER = 5.0  # standard deviations, model error included, that no tactel may be off
MAX_OUTLIERS = 0.25  # of the loaded tactels; more is a contact of another kind
MAX_OUTLIERS_AROUND = 3  # of the eight around one; likewise
MIN_TACTELS = 15, 24  # of a point around the peak, of a line: three to eight for each parameter
WINDOW = 2.0  # half side of the window of the second force estimate of a point [depths]
SECOND_CONTACT = 0.15  # of the peak, left over elsewhere, that makes a second contact
ELSEWHERE = 2.0  # depths from the load that are elsewhere
DETECTION = 5.0  # standard deviations
FORCE_MISMATCH = 0.03  # relative difference of the two force estimates that is told
DEPTH_STEPS = 0.05, 0.02, 0.01  # relative differences by which the depth is searched

# What is said of a frame, beside its type and reasons.
VALUES = 12
(A, B, YAW, FORCE, SHEAR_X, SHEAR_Y, LINE_FORCE,
 SNR, RESIDUAL, WINDOWED, COUNT, HAS_SHEAR) = range(VALUES)

_NONE, _OTHER = int(ContactType.NONE), int(ContactType.OTHER)
_LOW_SNR, _OFF_PAD, _FEW = int(Reason.LOW_SNR), int(Reason.OFF_PAD), int(Reason.FEW_TACTELS)
_LOST, _BAD_FIT = int(Reason.NOT_CONVERGED), int(Reason.BAD_FIT)
_TWO, _DEAD = int(Reason.TWO_CONTACTS), int(Reason.DEAD_TACTELS)
_MISMATCH = int(Reason.FORCE_MISMATCH)


@njit(error_model='numpy')
def _model(kind, x, y, theta, layer, nodes):
    """Stress that a tactel measures under a load [Pa]."""
    total = 0.0
    for j in range(nodes.shape[0]):
        if kind == POINT:
            total += nodes[j, 2] * point_model.stress_at(
                x + nodes[j, 0], y + nodes[j, 1], theta, layer)
        else:
            total += nodes[j, 2] * line_model.stress_at(
                x + nodes[j, 0], y + nodes[j, 1], theta, layer[0])
    return total


@njit(error_model='numpy')
def _remains(kind, stress, grid, layers, component, nodes, theta, left, model):
    """What the load leaves of every layer that shows it, and the load; NaN elsewhere."""
    x, y = grid[0], grid[1]
    for k in range(stress.shape[0]):
        if kind == LINE and component[k] != 0:
            left[k] = np.nan
            continue
        for r in range(stress.shape[1]):
            for c in range(stress.shape[2]):
                expected = _model(kind, x[c], y[r], theta, layers[k], nodes)
                model[k, r, c] = expected
                left[k, r, c] = stress[k, r, c] - expected


@njit(error_model='numpy')
def _border_median(image, ring):
    """Median and number of the live tactels at the border."""
    rows, columns = image.shape
    n = 0
    for r in range(rows):
        step = 1 if r == 0 or r == rows - 1 else max(columns - 1, 1)
        for c in range(0, columns, step):
            if np.isfinite(image[r, c]):
                ring[n] = image[r, c]
                n += 1
    return (np.median(ring[:n]) if n >= MIN_BORDER else 0.0), n


@njit(error_model='numpy')
def _take_off_drift(stress, left, model, layers, ring, evidence):
    """Subtract from every layer the drift of its border, if there is one; whether there was."""
    found = False
    for k in range(stress.shape[0]):
        median, n = _border_median(left[k], ring)
        enough = evidence * 1.2533 * layers[k, 1] / np.sqrt(max(n, 1))
        largest = max(model[k].max(), -model[k].min())
        if enough < abs(median) <= MAX_DRIFT * largest:
            for r in range(stress.shape[1]):
                for c in range(stress.shape[2]):
                    stress[k, r, c] -= median
            found = True
    return found


@njit(error_model='numpy')
def _is_off(left, model, noise, model_error):
    allowed = model_error * model
    return left * left > OUTLIER * OUTLIER * (noise * noise + allowed * allowed)


@njit(error_model='numpy')
def _any_off(left, model, layers, model_error):
    for k in range(left.shape[0]):
        for r in range(left.shape[1]):
            for c in range(left.shape[2]):
                if _is_off(left[k, r, c], model[k, r, c], layers[k, 1], model_error):
                    return True
    return False


@njit(error_model='numpy')
def _leave_out_outliers(stress, left, model, layers, model_error):
    """Set scattered tactels that contradict the load to NaN; False if they are no outliers."""
    off = loaded = 0
    for k in range(left.shape[0]):
        for r in range(left.shape[1]):
            for c in range(left.shape[2]):
                wrong = _is_off(left[k, r, c], model[k, r, c], layers[k, 1], model_error)
                off += wrong
                loaded += wrong or abs(model[k, r, c]) > OUTLIER * layers[k, 1]
                if not wrong:
                    continue
                around = 0
                for i in range(max(r - 1, 0), min(r + 2, left.shape[1])):
                    for j in range(max(c - 1, 0), min(c + 2, left.shape[2])):
                        around += _is_off(
                            left[k, i, j], model[k, i, j], layers[k, 1], model_error)
                if around - 1 > MAX_OUTLIERS_AROUND:
                    return False
    if off > MAX_OUTLIERS * loaded:
        return False
    for k in range(left.shape[0]):
        for r in range(left.shape[1]):
            for c in range(left.shape[2]):
                if _is_off(left[k, r, c], model[k, r, c], layers[k, 1], model_error):
                    stress[k, r, c] = np.nan
    return True


@njit(error_model='numpy')
def _inverse(matrix, n, inverse):
    """Inverse of the normal equations (lower triangle, n by n); False if singular."""
    factor = np.zeros((n, n))
    for i in range(n):  # Cholesky, of a unit diagonal: m, rad and N differ by orders
        if not matrix[i, i] > 0.0:
            return False
        for j in range(i + 1):
            total = matrix[i, j] / np.sqrt(matrix[i, i] * matrix[j, j])
            for k in range(j):
                total -= factor[i, k] * factor[j, k]
            if i > j:
                factor[i, j] = total / factor[j, j]
            elif total > 1e-12:
                factor[i, i] = np.sqrt(total)
            else:
                return False
    for column in range(n):
        solution = np.zeros(n)
        solution[column] = 1.0
        for i in range(n):
            for k in range(i):
                solution[i] -= factor[i, k] * solution[k]
            solution[i] /= factor[i, i]
        for i in range(n - 1, -1, -1):
            for k in range(i + 1, n):
                solution[i] -= factor[k, i] * solution[k]
            solution[i] /= factor[i, i]
        for i in range(n):
            inverse[i, column] = solution[i] / np.sqrt(matrix[i, i] * matrix[column, column])
    return True


@njit(error_model='numpy')
def _shear_shows(kind, theta, fit, cov):
    """Whether the shear is more than noise, by the scatter that the fit leaves."""
    forces = 3 if kind == POINT else 2
    spread = max(1.0, fit[SQUARED] / max(fit[USED] - 2.0 - forces, 1.0))
    if kind == LINE:
        return theta[3] * theta[3] > SHEAR_EVIDENCE[1] * spread * cov[3, 3]
    xx, xy, yy = cov[3, 3], cov[4, 3], cov[4, 4]
    qx, qy = theta[3], theta[4]
    # The form Q' C^-1 Q, without dividing by a determinant that may be zero.
    return yy * qx * qx - 2.0 * xy * qx * qy + xx * qy * qy > (
        SHEAR_EVIDENCE[0] * spread * (xx * yy - xy * xy))


@njit(error_model='numpy')
def _at_depth(layers, factor, scaled):
    """Layers with all depths multiplied."""
    for k in range(layers.shape[0]):
        scaled[k, 0] = layers[k, 0] * factor
        scaled[k, 1], scaled[k, 2] = layers[k, 1], layers[k, 2]
        scaled[k, 3], scaled[k, 4] = layers[k, 3] / factor, layers[k, 4] / factor


@njit(error_model='numpy')
def _fit_depth(kind, stress, grid, layers, scaled, component, nodes, forces, window, model_error,
               work, theta, matrix, fit, slope):
    """
    Factor on all depths that leaves least, and its variance over the noise.

    The squared error is a parabola about its least; three fits give it. `slope` is how theta
    moves with the factor.
    """
    factor, variance = 1.0, np.inf
    for step in DEPTH_STEPS:
        errors = np.empty(3)
        for i in range(3):
            _at_depth(layers, factor + (i - 1) * step, scaled)
            if not fit_frame(kind, stress, grid, scaled, component, nodes, forces, window,
                             model_error, STEPS, np.inf, work, theta, matrix, fit):
                return np.nan, np.inf
            errors[i] = fit[SQUARED]
            for j in range(5):  # at last the difference of the outer two
                slope[j] = theta[j] - (slope[j] if i == 2 else 0.0) if i != 1 else slope[j]
        for j in range(5):
            slope[j] /= 2.0 * step
        curvature = (errors[0] - 2.0 * errors[1] + errors[2]) / step**2
        if not curvature > 0.0:
            return np.nan, np.inf
        variance = 2.0 / curvature
        move = -(errors[2] - errors[0]) / (2.0 * step) / curvature
        factor += min(max(move, -0.15), 0.15)
    return factor, variance


@njit(error_model='numpy')
def _second_contact(left, x, y, kind, theta, depth, threshold):
    """Whether something beyond noise is left over away from the load, over 3x3 tactels."""
    rows, columns = left.shape
    cos, sin = math.cos(theta[1]), math.sin(theta[1])
    for r in range(rows):
        for c in range(columns):
            if kind == POINT:
                away = math.hypot(x[c] - theta[0], y[r] - theta[1])
            else:
                away = abs(x[c] * cos + y[r] * sin - theta[0])
            if away <= ELSEWHERE * depth:
                continue
            total = 0.0
            for i in range(max(r - 1, 0), min(r + 2, rows)):
                for j in range(max(c - 1, 0), min(c + 2, columns)):
                    if np.isfinite(left[i, j]):
                        total += left[i, j]
            if total > 9.0 * threshold:
                return True
    return False


@njit(error_model='numpy')
def chord(rho, yaw, half_x, half_y):
    """Length of a line within the pad [m], see `line.chord_length`."""
    cos, sin = math.cos(yaw), math.sin(yaw)
    enter, leave = -np.inf, np.inf
    for position, slope, half in ((rho * cos, -sin, half_x), (rho * sin, cos, half_y)):
        if abs(slope) < 1e-12:
            if abs(position) > half:
                return 0.0
            continue
        one, other = (-half - position) / slope, (half - position) / slope
        enter, leave = max(enter, min(one, other)), min(leave, max(one, other))
    return max(leave - enter, 0.0)


@njit(error_model='numpy')
def _tell_point(theta, cov, values, covariance):
    """Point into the values of an estimate."""
    rows = (A, B, FORCE, SHEAR_X, SHEAR_Y)
    for i in range(5):
        values[rows[i]] = theta[i]
        for j in range(5):
            covariance[rows[i], rows[j]] = cov[i, j]


@njit(error_model='numpy')
def _tell_line(theta, cov, with_shear, half_x, half_y, values, covariance):
    """Line into the values of an estimate: forces are those on the pad."""
    rho, yaw, force, shear = theta[0], theta[1], theta[2], theta[3]
    cos, sin = math.cos(yaw), math.sin(yaw)
    length, step = chord(rho, yaw, half_x, half_y), 1e-6
    by_rho = (chord(rho + step, yaw, half_x, half_y) - length) / step
    by_yaw = (chord(rho, yaw + step, half_x, half_y) - length) / step
    values[A], values[B], values[YAW] = rho / cos, 0.0, yaw
    values[FORCE], values[LINE_FORCE] = force * length, force
    change = np.zeros((7, 4))
    change[A, 0], change[A, 1] = 1.0 / cos, rho * sin / cos**2
    change[YAW, 1] = 1.0
    change[FORCE, 0], change[FORCE, 1], change[FORCE, 2] = force * by_rho, force * by_yaw, length
    change[LINE_FORCE, 2] = 1.0
    told = np.array([A, YAW, FORCE, LINE_FORCE, SHEAR_X, SHEAR_Y])
    if with_shear:
        values[SHEAR_X], values[SHEAR_Y] = shear * length * cos, shear * length * sin
        change[SHEAR_X, 0], change[SHEAR_X, 3] = shear * cos * by_rho, cos * length
        change[SHEAR_X, 1] = shear * (cos * by_yaw - sin * length)
        change[SHEAR_Y, 0], change[SHEAR_Y, 3] = shear * sin * by_rho, sin * length
        change[SHEAR_Y, 1] = shear * (sin * by_yaw + cos * length)
    count = 6 if with_shear else 4
    for i in told[:count]:
        for j in told[:count]:
            total = 0.0
            for k in range(4):
                for m in range(4):
                    total += change[i, k] * cov[k, m] * change[j, m]
            covariance[i, j] = total


@njit(error_model='numpy')
def explain(kind, measured, grid, given_layers, component, nodes, window, rules, buffers, work,
            theta, values, covariance):
    """
    Explain a frame as one kind of load.

    Parameters
    ----------
    kind : int
        POINT or LINE.
    measured : ndarray, shape (layers, rows, columns)
        Conditioned frame.
    grid, given_layers, component, nodes, window, work
        As for `load_fit.fit_frame`.
    rules : (min_snr, model_error, max_chi_square, fit_depth)
    buffers : tuple of ndarray
        From `make_buffers`.
    theta : ndarray, shape (5,)
        Memory for the fit's parameters.
    values, covariance : ndarray, shape (VALUES,), (7, 7)
        Where the estimate is written; on entry all NaN.

    Returns
    -------
    kind, reasons : int
        ContactType, and Reason other than what has been left out before; the estimate holds
        if none but DEAD_TACTELS and FORCE_MISMATCH is given.
    """
    min_snr, model_error, max_chi_square, fit_depth = rules
    stress, left, model, ring, matrix, fit, cov, layers, slope = buffers
    for i in range(measured.size):
        stress.flat[i] = measured.flat[i]
    _at_depth(given_layers, 1.0, layers)
    main = 0
    while component[main] != 0:
        main += 1
    forces = 3 if kind == POINT else 2
    reasons = 0

    for attempt in range(4):  # a drift, and what the looks before have left of it
        if not fit_frame(kind, stress, grid, layers, component, nodes, forces, window,
                         model_error, STEPS, np.inf, work, theta, matrix, fit):
            return _OTHER, _BAD_FIT
        _remains(kind, stress, grid, layers, component, nodes, theta, left, model)
        if attempt == 3 or not _take_off_drift(
                stress, left, model, layers, ring, 0.0 if attempt else DRIFT_EVIDENCE):
            break
    if _any_off(left, model, layers, model_error) and fit_frame(
            kind, stress, grid, layers, component, nodes, forces, window, model_error, STEPS,
            TUKEY, work, theta, matrix, fit):
        _remains(kind, stress, grid, layers, component, nodes, theta, left, model)
        if _leave_out_outliers(stress, left, model, layers, model_error):
            reasons |= _DEAD
    variance = 0.0
    if fit_depth:
        factor, variance = _fit_depth(
            kind, stress, grid, given_layers, layers, component, nodes, forces, window,
            model_error, work, theta, matrix, fit, slope)
        if np.isnan(factor):
            return _OTHER, _BAD_FIT
        _at_depth(given_layers, factor, layers)
    if reasons or fit_depth:
        if not fit_frame(kind, stress, grid, layers, component, nodes, forces, window,
                         model_error, STEPS, np.inf, work, theta, matrix, fit):
            return _OTHER, _BAD_FIT
    known = _inverse(matrix, 2 + forces, cov)
    shear = known and _shear_shows(kind, theta, fit, cov)
    if not shear:
        forces //= 2  # one: no literal, of which a second kernel would be compiled
        if not fit_frame(kind, stress, grid, layers, component, nodes, forces, window,
                         model_error, STEPS, np.inf, work, theta, matrix, fit):
            return _OTHER, _BAD_FIT
    if fit[USED] < MIN_TACTELS[0 if kind == POINT else 1]:
        return _OTHER, _BAD_FIT | _FEW

    # Evidence, over all live tactels.
    depth, noise = layers[main, 0], layers[main, 1]
    _remains(kind, stress, grid, layers, component, nodes, theta, left, model)
    x, y = grid[0], grid[1]
    chi = squared = seen = expected = 0.0
    count = 0
    for k in range(stress.shape[0]):
        for r in range(stress.shape[1]):
            for c in range(stress.shape[2]):
                rest = left[k, r, c] / layers[k, 1]
                if not np.isfinite(rest):
                    continue
                allowed = model_error * model[k, r, c] / layers[k, 1]
                squared += rest * rest
                chi += rest * rest / (1.0 + allowed * allowed)
                count += 1
                if k == main and (kind == LINE or (
                        abs(x[c] - theta[0]) <= WINDOW * depth
                        and abs(y[r] - theta[1]) <= WINDOW * depth)):
                    seen += stress[k, r, c]
                    expected += model[k, r, c]
    peak = model[main].max()
    freedom = max(count - (5 if kind == POINT else 3), 1)
    if not (peak > 0.0 and np.isfinite(chi + squared)):
        return _OTHER, _BAD_FIT
    top = 2.0 * theta[2] / (np.pi * depth) if kind == LINE else peak
    values[SNR] = 20.0 * math.log10(top / noise)
    values[RESIDUAL] = math.sqrt(squared / freedom)
    values[COUNT] = fit[ITERATIONS]

    weak = values[SNR] < min_snr
    if weak and kind == POINT:  # noise has peaks, but hardly ridges: a line is judged first
        return _NONE, _LOW_SNR
    if _second_contact(left[main], x, y, kind, theta, depth,
                       max(DETECTION * noise / 3.0, SECOND_CONTACT * peak)):
        return _OTHER, _BAD_FIT | _TWO
    if chi > max_chi_square * freedom:
        return _OTHER, _BAD_FIT
    if weak:
        return _NONE, _LOW_SNR
    half_x, half_y = 0.5 * x.size * grid[2], 0.5 * y.size * grid[3]
    if kind == POINT:
        off_pad = abs(theta[0]) > half_x or abs(theta[1]) > half_y
    else:
        off_pad = not (abs(theta[0]) <= half_x * math.cos(theta[1])
                       and chord(theta[0], theta[1], half_x, half_y) > 0.0)
    # Shear that does not show may be there all the same: the covariance is that with shear.
    rank = 5 if kind == POINT else 4
    if fit[OK] == 0.0 or not known:
        return kind, _LOST | (_OFF_PAD if off_pad else 0)
    if off_pad:
        return kind, _OFF_PAD
    for i in range(rank):
        for j in range(rank):  # what the depth does not know, theta does not either
            cov[i, j] = (cov[i, j] + variance * slope[i] * slope[j]) * max(
                1.0, squared / freedom)
    values[HAS_SHEAR] = shear
    if kind == POINT:
        _tell_point(theta, cov, values, covariance)
    else:
        _tell_line(theta, cov, shear, half_x, half_y, values, covariance)
    values[WINDOWED] = values[FORCE] * seen / expected if expected > 0.0 else np.nan
    if abs(values[WINDOWED] - values[FORCE]) > (
            FORCE_MISMATCH * values[FORCE] + 3.0 * math.sqrt(covariance[FORCE, FORCE])):
        reasons |= _MISMATCH
    return kind, reasons


@njit(error_model='numpy')
def make_buffers(layers, rows, columns):
    """Memory for `explain`."""
    shape = (layers, rows, columns)
    return (np.empty(shape), np.empty(shape), np.empty(shape), np.empty(2 * (rows + columns)),
            np.zeros((5, 5)), np.zeros(6), np.zeros((5, 5)), np.zeros((layers, 5)), np.zeros(5))
