"""
One frame explained as a point or as a line, with as little as explains it; all compiled.

Fit with shear; take off a drift of the baseline; leave out tactels that
contradict all others; fit without shear where shear is not significant; then judge.
"""

import math

import numpy as np

from tactile_common.kernels import njit
from tactile_sensing.contact.gauss_newton import (
    fit_frame,
    ITERATIONS,
    LINE,
    OK,
    POINT,
    SQUARED,
    USED,
)
from tactile_sensing.contact.goodness_of_fit import (
    compare,
    lacks_load,
    second_contact,
    sums_of_squares,
    window_ratio,
)
from tactile_sensing.contact.outliers import (
    any_off,
    at_depth,
    fit_depth,
    leave_out_outliers,
    take_off_drift,
)
from tactile_sensing.contact.parameters import (
    chord,
    COUNT,
    FORCE,
    HAS_SHEAR,
    invert,
    LINE_FORCE,
    RESIDUAL,
    SNR,
    tell_line,
    tell_point,
    WINDOWED,
)
from tactile_sensing.contact.variable_projection import TUKEY
from tactile_sensing.types.contact import ContactType, Reason

# Chi-square that shear must reach: two for each force (Akaike) is the least expected error
# where shear is usual; a line is located three times better without, so there it must be plain.
SHEAR_EVIDENCE = 4.0, 20.0
DRIFT_LOOKS = 3  # each leaves a part of the drift that it found
MIN_TACTELS = 15, 24  # of a point around the peak, of a line: three to eight for each parameter
SECOND_CONTACT = 0.15  # of the peak, left over elsewhere, that makes a second contact
BORDER_STD = 0.1  # depths; a load under the outermost tactels must be located better than that
DETECTION = 5.0  # standard deviations
FORCE_MISMATCH = 0.03  # relative difference of the two force estimates that is told

_NONE, _OTHER = int(ContactType.NONE), int(ContactType.OTHER)
_LOW_SNR, _OFF_PAD, _FEW = int(Reason.LOW_SNR), int(Reason.OFF_PAD), int(Reason.FEW_TACTELS)
_LOST, _BAD_FIT = int(Reason.NOT_CONVERGED), int(Reason.BAD_FIT)
_TWO, _DEAD = int(Reason.TWO_CONTACTS), int(Reason.DEAD_TACTELS)
_MISMATCH = int(Reason.FORCE_MISMATCH)


@njit(error_model='numpy')
def make_buffers(layers, rows, columns):
    """Memory for `explain`."""
    shape = (layers, rows, columns)
    return (np.empty(shape), np.empty(shape), np.empty(shape), np.empty(rows * columns),
            np.zeros((layers, 6)), np.zeros((5, 5)), (np.zeros(5), np.zeros(5)),
            (np.zeros(5), np.zeros((5, 5)), np.zeros(6)))


@njit(error_model='numpy')
def _mend(kind, stress, sensor, layers, forces, model_error, buffers, work):
    """Fit with shear, without drift and outliers; 0 or DEAD_TACTELS, or BAD_FIT."""
    _, left, model, unloaded, _, _, _, found = buffers
    for look in range(DRIFT_LOOKS + 1):
        if not fit_frame(kind, stress, sensor, layers, forces, model_error, np.inf, work, found):
            return _BAD_FIT
        compare(kind, stress, sensor, layers, found[0], left, model)
        if look == DRIFT_LOOKS or not take_off_drift(
                stress, left, model, layers, unloaded, look == 0):
            break
    if not any_off(left, model, layers, model_error):
        return 0
    outliers = False
    if fit_frame(kind, stress, sensor, layers, forces, model_error, TUKEY, work, found):
        compare(kind, stress, sensor, layers, found[0], left, model)
        outliers = leave_out_outliers(stress, left, model, layers, model_error)
    if not fit_frame(kind, stress, sensor, layers, forces, model_error, np.inf, work, found):
        return _BAD_FIT
    return _DEAD if outliers else 0


@njit(error_model='numpy')
def _shear_shows(kind, found, forces, cov):
    """Whether the shear is more than noise, by the scatter that the fit leaves."""
    theta, _, fit = found
    spread = max(1.0, fit[SQUARED] / max(fit[USED] - 2.0 - forces, 1.0))
    if kind == LINE:
        return theta[3] * theta[3] > SHEAR_EVIDENCE[1] * spread * cov[3, 3]
    xx, xy, yy = cov[3, 3], cov[4, 3], cov[4, 4]
    qx, qy = theta[3], theta[4]
    # The form Q' C^-1 Q, without dividing by a determinant that may be zero.
    return yy * qx * qx - 2.0 * xy * qx * qy + xx * qy * qy > (
        SHEAR_EVIDENCE[0] * spread * (xx * yy - xy * xy))


@njit(error_model='numpy')
def explain(kind, measured, sensor, given_layers, rules, buffers, work, values, covariance):
    """
    Explain a frame as one kind of load.

    Parameters
    ----------
    kind : int
        POINT or LINE.
    measured : ndarray, shape (layers, rows, columns)
        Conditioned frame.
    sensor, given_layers, work
        As for `load_fit.fit_frame`.
    rules : (min_snr, model_error, max_chi_square, depth is to be found)
    buffers : tuple of ndarray
        From `make_buffers`.
    values, covariance : ndarray, shape (VALUES,), (7, 7)
        Where the estimate is written; on entry all NaN.

    Returns
    -------
    kind, reasons : int
        ContactType, and Reason other than what has been left out before; the estimate holds
        if none but DEAD_TACTELS and FORCE_MISMATCH is given.
    """
    _, model_error, _, any_depth = rules
    stress, _, _, _, layers, cov, (slope, moved), found = buffers
    for i in range(measured.size):
        stress.flat[i] = measured.flat[i]
    at_depth(given_layers, 1.0, layers)
    forces = 3 if kind == POINT else 2
    reasons, variance = 0, 0.0
    for mended in (False, True):  # faults do not show at a wrong depth, nor the depth with faults
        if any_depth:
            factor, variance = fit_depth(kind, stress, sensor, given_layers, layers, forces,
                                         model_error, work, found, slope)
            if np.isnan(factor):
                return _OTHER, _BAD_FIT
            at_depth(given_layers, factor, layers)
        if not mended:
            reasons = _mend(kind, stress, sensor, layers, forces, model_error, buffers, work)
            if reasons == _BAD_FIT:
                return _OTHER, _BAD_FIT
    if any_depth and not fit_frame(
            kind, stress, sensor, layers, forces, model_error, np.inf, work, found):
        return _OTHER, _BAD_FIT
    known = invert(found[1], 2 + forces, cov)
    shear = known and _shear_shows(kind, found, forces, cov)
    if not shear:
        for i in range(5):
            moved[i] = found[0][i]
        if not fit_frame(
                kind, stress, sensor, layers, forces // 2, model_error, np.inf, work, found):
            return _OTHER, _BAD_FIT
    for i in range(5):  # how far it matters that shear which does not show may still be there
        moved[i] = 0.0 if shear else moved[i] - found[0][i]
    found_kind, why = _judge(kind, sensor, rules, known, buffers, values)
    if why:
        return found_kind, why
    # The covariance is that with shear, with what the depth does not know, and with more noise
    # than expected.
    n = 2 + forces
    for i in range(n):
        for j in range(n):
            cov[i, j] = moved[i] * moved[j] + max(1.0, values[RESIDUAL] ** 2) * (
                cov[i, j] + variance * slope[i] * slope[j])
    if _beyond_sight(kind, found[0], sensor, layers, cov):
        return kind, _OFF_PAD
    values[HAS_SHEAR] = shear
    if kind == POINT:
        tell_point(found[0], cov, values, covariance)
    else:
        tell_line(found[0], cov, shear, *_half_sides(sensor), values, covariance)
    if _windowed(values, covariance):
        reasons |= _MISMATCH
    return kind, reasons


@njit(error_model='numpy')
def _beyond_sight(kind, theta, sensor, layers, cov):
    """Whether a load at the border, which shows one flank only, may as well be off the pad."""
    half_x, half_y = _half_sides(sensor)
    last_x, last_y = half_x - sensor[2], half_y - sensor[3]
    if kind == POINT:
        inside = abs(theta[0]) <= last_x and abs(theta[1]) <= last_y
        variance = max(cov[0, 0], cov[1, 1])
    else:
        inside = abs(theta[0]) <= last_x * math.cos(theta[1])
        variance = cov[0, 0]
    return not inside and variance > (BORDER_STD * layers[0, 0]) ** 2


@njit(error_model='numpy')
def _windowed(values, covariance):
    """Second force estimate into the values; whether it disagrees, and then how far, is told."""
    off = values[WINDOWED] - 1.0
    values[WINDOWED] *= values[FORCE]
    disagrees = abs(off) * values[FORCE] > (
        FORCE_MISMATCH * values[FORCE] + 3.0 * math.sqrt(covariance[FORCE, FORCE]))
    if disagrees:  # one of the two is wrong by as much
        for i in (FORCE, LINE_FORCE):
            covariance[i, i] += (off * values[i]) ** 2
    return disagrees


@njit(error_model='numpy')
def _half_sides(sensor):
    return 0.5 * sensor[0].size * sensor[2], 0.5 * sensor[1].size * sensor[3]


@njit(error_model='numpy')
def _judge(kind, sensor, rules, known, buffers, values):
    """Type and reasons of a refusal, reasons 0 if there is none; and the evidence, in values."""
    min_snr, model_error, max_chi_square, _ = rules
    x, y, component = sensor[0], sensor[1], sensor[4]
    stress, left, model, _, layers, _, _, (theta, _, fit) = buffers
    if fit[USED] < MIN_TACTELS[0 if kind == POINT else 1]:
        return _OTHER, _BAD_FIT | _FEW
    main = 0
    while component[main] != 0:
        main += 1
    depth, noise = layers[main, 0], layers[main, 1]
    compare(kind, stress, sensor, layers, theta, left, model)
    squared, chi, count = sums_of_squares(left, model, layers, model_error)
    peak = model[main].max()
    if not (peak > 0.0 and np.isfinite(chi + squared)):
        return _OTHER, _BAD_FIT
    freedom = max(count - (5 if kind == POINT else 3), 1)
    top = 2.0 * theta[2] / (np.pi * depth) if kind == LINE else peak
    values[SNR] = 20.0 * math.log10(top / noise)
    values[RESIDUAL] = math.sqrt(squared / freedom)
    values[COUNT] = fit[ITERATIONS]
    values[WINDOWED] = window_ratio(kind, left[main], model[main], x, y, theta, depth)

    weak = values[SNR] < min_snr
    if weak and kind == POINT:  # noise has peaks, but hardly ridges: a line is judged first
        return _NONE, _LOW_SNR
    if second_contact(kind, left[main], x, y, theta, depth,
                      max(DETECTION * noise / 3.0, SECOND_CONTACT * peak)):
        return _OTHER, _BAD_FIT | _TWO
    if chi > max_chi_square * freedom or lacks_load(
            left[main], max(DETECTION * noise / 3.0, SECOND_CONTACT * peak)):
        return _OTHER, _BAD_FIT
    if weak:
        return _NONE, _LOW_SNR
    half_x, half_y = _half_sides(sensor)
    if kind == POINT:
        off_pad = abs(theta[0]) > half_x or abs(theta[1]) > half_y
    else:
        off_pad = not (abs(theta[0]) <= half_x * math.cos(theta[1])
                       and chord(theta[0], theta[1], half_x, half_y) > 0.0)
    lost = fit[OK] == 0.0 or not known
    return kind, (_LOST if lost else 0) | (_OFF_PAD if off_pad else 0)
