"""
From stress to a contact, frame by frame; all compiled.

`estimate_frame` is the whole algorithm: preprocess, try the likelier model, and the other one
where that does not convince. `estimate_as` fits one model, with as little as explains the frame,
and says what is known of it.
"""

import math
from typing import NamedTuple

import numpy as np

from tactile_common.kernels import njit
from tactile_sensing.contact.gauss_newton import FIT, fit_load, LINE, make_tactels, POINT, Tactels
from tactile_sensing.contact.goodness_of_fit import (
    beyond_sight,
    compare,
    find_scatter,
    refute,
)
from tactile_sensing.contact.ladder import BEGINS, ENDS, limits_of, PATCH, ROWS
from tactile_sensing.contact.model_selection import (
    climb,
    fit_without_idle_shear,
    likelier_model,
    overrules,
    UNCONVINCING,
)
from tactile_sensing.contact.outliers import (
    any_off,
    fit_depth,
    fit_despite_faults,
    scale_depths,
)
from tactile_sensing.contact.parameters import (
    compare_forces,
    forget_forces,
    write_line,
    write_point,
)
from tactile_sensing.contact.preprocessing import preprocess
from tactile_sensing.half_space.layers import LAYER, Sensor
from tactile_sensing.skin.kernels import TERMS
from tactile_sensing.types.contact import ContactType, ESTIMATE, Reason

ANY_MODEL, PENDING = 0, -1  # rules.model, estimate.type
# How contacts are estimated, see EstimatorConfig; model: ANY_MODEL, POINT or LINE.
RULES = np.dtype([('min_snr', 'f8'), ('model_error', 'f8'), ('max_chi_square', 'f8'),
                  ('gain_spread', 'f8'), ('fit_depth', '?'), ('model', 'i8'), ('fit', '?')])

_OTHER, _BAD_FIT = int(ContactType.OTHER), int(Reason.BAD_FIT)
_LOW_SNR, _OFF_PAD = int(Reason.LOW_SNR), int(Reason.OFF_PAD)
_DEAD, _MISMATCH = int(Reason.DEAD_TACTELS), int(Reason.FORCE_MISMATCH)


class Memory(NamedTuple):
    """What the stages hand on to each other; of one frame and one model at a time."""

    stress: np.ndarray  # (layers, rows, columns): the frame, mended
    left: np.ndarray  # likewise: what the load leaves of it
    model: np.ndarray  # likewise: stress under the load
    unloaded: np.ndarray  # (rows * columns,)
    layers: np.ndarray  # of LAYER, at the depth that was found
    tactels: Tactels
    fit: np.ndarray  # of FIT, shape (1,)
    cov: np.ndarray  # (8, 8), of the fit's parameters: its vector, and the extras of `ladder`
    regular: np.ndarray  # bool, shape (1,): whether there is such a covariance
    slope: np.ndarray  # (5,): how the load moves with the depth
    moved: np.ndarray  # (5,): how it moves when shear is left out
    estimates: np.ndarray  # of ESTIMATE, shape (2,): of the first model and of the second
    hidden: np.ndarray  # (5,): how it moves with a patch that hardly shows
    scatter: np.ndarray  # (1,): what tactels are off beside noise, as a share of the pressure
    excess: np.ndarray  # (1,): squared error over what is expected, at least 1
    second: np.ndarray  # bool, (1,): whether what seemed an outlier is a contact
    # What `ladder` needs: a load and a covariance to return to, and room.
    saved: np.ndarray
    saved_cov: np.ndarray
    saved_moved: np.ndarray
    cov_with_shear: np.ndarray
    rows: np.ndarray
    weights: np.ndarray
    active: np.ndarray
    matrix: np.ndarray
    right: np.ndarray
    inverse: np.ndarray
    step: np.ndarray
    kept_load: np.ndarray
    tip_shapes: np.ndarray
    source: np.ndarray
    censored: np.ndarray  # (layers, rows, columns): tactels only known to be below the floor
    any_censored: np.ndarray  # bool, shape (1,)


@njit(error_model='numpy')
def make_memory(layers, rows, columns, nodes):
    """Memory for frames of one shape."""
    shape = (layers, rows, columns)
    most = layers * rows * columns
    return Memory(
        np.empty(shape), np.empty(shape), np.empty(shape), np.empty(rows * columns),
        np.zeros(layers, LAYER), make_tactels(layers, most, nodes), np.zeros(1, FIT),
        np.zeros((8, 8)), np.zeros(1, np.bool_), np.zeros(5), np.zeros(5), np.zeros(2, ESTIMATE),
        np.zeros(5), np.zeros(1), np.ones(1), np.zeros(1, np.bool_), np.zeros(1, FIT),
        np.zeros((8, 8)), np.zeros(5), np.zeros((8, 8)), np.empty((ROWS, most)), np.empty(most),
        np.zeros(8, np.int64), np.zeros((8, 8)), np.zeros(8), np.zeros((8, 8)), np.zeros(8),
        np.zeros(8), np.zeros((2, 2, TERMS)), np.zeros(1, FIT), np.zeros(shape, np.bool_),
        np.zeros(1, np.bool_))


@njit(cache=True, error_model='numpy')
def estimate_frames(stress, x, y, pitch_x, pitch_y, nodes, window, polynomials, closed, layers,
                    rules, reasons, saturated, calibrated, estimates):
    """
    Estimate every frame, see `estimate_frame`.

    Parameters
    ----------
    stress : ndarray, shape (N, layers, rows, columns)
        [Pa]; preprocessed in place.
    x, y, pitch_x, pitch_y, nodes, window, polynomials, closed, layers
        From `layers.sensor_of`, with the given noise and full scale; the last frame's noise
        stays in `layers`. One by one: a named tuple from Python costs some microseconds.
    rules : ndarray of RULES, shape (1,)
    reasons, saturated, calibrated : int, int, bool
        Reasons that hold of the pictures anyway, tactels that the driver has left out at full
        scale, and whether the unit is Pa.
    estimates : ndarray of contact.ESTIMATE, shape (N,)
        On entry of nothing; type PENDING if rules.fit is false and there is a load.
    """
    sensor = Sensor(x, y, pitch_x, pitch_y, nodes, window, polynomials, closed)
    memory = make_memory(layers.size, stress.shape[2], stress.shape[3], nodes.size)
    for f in range(stress.shape[0]):
        memory.estimates[0] = estimates[f]
        best = estimate_frame(
            stress[f], sensor, layers, rules[0], reasons, saturated, calibrated, memory)
        if not calibrated:
            forget_forces(memory.estimates[best])
        estimates[f] = memory.estimates[best]


@njit(error_model='numpy')
def estimate_frame(stress, sensor, layers, rules, reasons, saturated, calibrated, memory):
    """Estimate one frame; returns which of the two estimates in the memory holds."""
    first, second = memory.estimates[0], memory.estimates[1]
    if not preprocess(stress, sensor, layers, reasons, saturated, calibrated, memory.censored,
                      first):
        return 0
    memory.any_censored[0] = memory.censored.any()
    if not rules.fit:
        first.type = PENDING
        return 0
    memory.estimates[1] = memory.estimates[0]
    model = rules.model
    if rules.model == ANY_MODEL:
        model = likelier_model(stress, sensor, layers)
    estimate_as(model, stress, sensor, layers, rules, memory, first)
    if rules.model != ANY_MODEL or not first.reasons & UNCONVINCING:
        return 0
    other = POINT + LINE - model
    estimate_as(other, stress, sensor, layers, rules, memory, second)
    if overrules(first, second, rules.min_snr):
        second.reasons |= first.reasons & _LOW_SNR
        return 1
    return 0


@njit(error_model='numpy')
def estimate_as(kind, measured, sensor, layers, rules, memory, estimate):
    """Estimate a frame as one kind of load: its type and reasons, or those of a refusal."""
    fit, cov, forces = memory.fit[0], memory.cov, 3 if kind == POINT else 2
    memory.stress[:] = measured
    memory.scatter[0] = rules.gain_spread
    memory.second[0] = False
    memory.hidden[:] = 0.0
    ladder = sensor.polynomials.size > 0 and not rules.fit_depth
    # Faults are looked for above the ladder: a blunt load is no row of broken tactels.
    fitted, left_out, depth_variance = _fit_mended(
        kind, sensor, layers, forces, not ladder, rules, memory)
    shear = False
    if fitted:
        fitted, shear = _fit_least(kind, sensor, forces, ladder, memory)
    if fitted and ladder and any_off(memory.left, memory.model, memory.layers, rules):
        fitted, left_out, depth_variance = _fit_mended(
            kind, sensor, layers, forces, True, rules, memory)
        if fitted:
            fitted, shear = _fit_least(kind, sensor, forces, ladder, memory)
    if not fitted:
        estimate.type, missed = _OTHER, _BAD_FIT
    else:
        shear = _weigh_scatter(kind, sensor, forces, shear, rules, memory)
        estimate.type, missed = refute(kind, sensor, memory.layers, rules, memory, estimate)
    if not missed:
        hidden = memory.hidden
        if not ladder or fit.extras & PATCH:
            hidden[:] = 0.0
        _widen(cov, memory.moved, hidden, depth_variance, memory.slope, memory.excess[0])
        if beyond_sight(kind, sensor, memory.layers[0].depth, fit, cov):
            missed = _OFF_PAD
    estimate.reasons |= missed
    if missed:
        return
    estimate.has_shear, estimate.extras = shear, fit.extras
    if kind == POINT:
        write_point(fit, cov, estimate)
        estimate.patch = math.sqrt(5.0 * fit.variance)
    else:
        first, last, _, _ = limits_of(sensor, fit, 0.0)
        if fit.extras & BEGINS:
            estimate.start = first = fit.start
        if fit.extras & ENDS:
            estimate.end = last = fit.end
        write_line(fit, cov, shear, first, last, sensor, estimate)
        estimate.patch = 2.0 * math.sqrt(fit.variance)
    disagrees = compare_forces(estimate)
    estimate.reasons |= (_DEAD if left_out else 0) | (_MISMATCH if disagrees else 0)


@njit(error_model='numpy')
def _fit_least(kind, sensor, forces, ladder, memory):
    """From a fit with shear to the least load that explains the frame, and what it leaves."""
    fitted, shear = fit_without_idle_shear(kind, sensor, memory.layers, forces, 0, memory)
    if fitted:
        if ladder:
            shear = climb(kind, sensor, memory.layers, forces, shear, memory)
        compare(kind, sensor, memory.layers, memory.fit[0], memory)
    return fitted, shear


@njit(error_model='numpy')
def _weigh_scatter(kind, sensor, forces, shear, rules, memory):
    """Fit again where tactels are off by a share of the pressure; returns whether with shear."""
    fit, scatter = memory.fit[0], memory.scatter
    found = find_scatter(memory.left, memory.model, memory.layers, scatter[0], 2 + forces)
    if found <= scatter[0]:
        return shear
    scatter[0] = found
    if not fit.extras and not fit_load(kind, memory.stress, sensor, memory.layers, forces,
                                       rules.model_error, np.inf, found, memory.tactels, fit):
        return shear
    _, shear = fit_without_idle_shear(kind, sensor, memory.layers, forces, fit.extras, memory)
    compare(kind, sensor, memory.layers, fit, memory)
    return shear


@njit(error_model='numpy')
def _fit_mended(kind, sensor, given_layers, forces, mend, rules, memory):
    """
    Fit at the given depth, or at that which the frame shows, despite faults of the sensor.

    Returns what `fit_despite_faults` does, and the variance of the factor on the depth, 0 for the
    given one.
    """
    layers, stress, fit = memory.layers, memory.stress, memory.fit[0]
    scale_depths(given_layers, 1.0, layers)
    if not rules.fit_depth:
        fitted, left_out = fit_despite_faults(kind, sensor, layers, forces, mend, rules, memory)
        return fitted, left_out, 0.0
    fitted, left_out, variance = False, False, 0.0
    for mended in (False, True):  # faults do not show at a wrong depth, nor the depth with faults
        factor, variance = fit_depth(kind, stress, sensor, given_layers, layers, forces,
                                     rules, memory.tactels, fit, memory.slope)
        if np.isnan(factor):
            return False, left_out, variance
        scale_depths(given_layers, factor, layers)
        if not mended:
            fitted, left_out = fit_despite_faults(
                kind, sensor, layers, forces, mend, rules, memory)
            if not fitted:
                return False, left_out, variance
    fitted = fit_load(kind, stress, sensor, layers, forces, rules.model_error, np.inf,
                      rules.gain_spread, memory.tactels, fit)
    return fitted, left_out, variance


@njit(error_model='numpy')
def _widen(cov, moved, hidden, depth_variance, slope, excess):
    """Add to a covariance shear and a patch that may be there, the depth, and more noise."""
    for i in range(5):
        for j in range(5):
            cov[i, j] = moved[i] * moved[j] + hidden[i] * hidden[j] + excess * (
                cov[i, j] + depth_variance * slope[i] * slope[j])
