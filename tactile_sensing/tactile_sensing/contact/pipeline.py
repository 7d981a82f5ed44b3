"""
From stress to a contact, frame by frame; all compiled.

`estimate_frame` is the whole algorithm: preprocess, try the likelier model, and the other one
where that does not convince. `estimate_as` fits one model, with as little as explains the frame,
and says what is known of it.
"""

from typing import NamedTuple

import numpy as np

from tactile_common.kernels import njit
from tactile_sensing.contact.gauss_newton import FIT, fit_load, LINE, make_tactels, POINT, Tactels
from tactile_sensing.contact.goodness_of_fit import beyond_sight, refute
from tactile_sensing.contact.model_selection import (
    fit_without_idle_shear,
    likelier_model,
    overrules,
    UNCONVINCING,
)
from tactile_sensing.contact.outliers import fit_depth, fit_despite_faults, scale_depths
from tactile_sensing.contact.parameters import compare_forces, write_line, write_point
from tactile_sensing.contact.preprocessing import preprocess
from tactile_sensing.half_space.layers import LAYER, Sensor
from tactile_sensing.types.contact import ContactType, ESTIMATE, Reason

ANY_MODEL, PENDING = 0, -1  # rules.model, estimate.type
# How contacts are estimated, see EstimatorConfig; model: ANY_MODEL, POINT or LINE.
RULES = np.dtype([('min_snr', 'f8'), ('model_error', 'f8'), ('max_chi_square', 'f8'),
                  ('fit_depth', '?'), ('model', 'i8'), ('fit', '?')])

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
    cov: np.ndarray  # (5, 5), of the fit's parameters
    regular: np.ndarray  # bool, shape (1,): whether there is such a covariance
    slope: np.ndarray  # (5,): how the load moves with the depth
    moved: np.ndarray  # (5,): how it moves when shear is left out
    estimates: np.ndarray  # of ESTIMATE, shape (2,): of the first model and of the second


@njit(error_model='numpy')
def make_memory(layers, rows, columns, nodes):
    """Memory for frames of one shape."""
    shape = (layers, rows, columns)
    return Memory(np.empty(shape), np.empty(shape), np.empty(shape), np.empty(rows * columns),
                  np.zeros(layers, LAYER), make_tactels(layers, layers * rows * columns, nodes),
                  np.zeros(1, FIT), np.zeros((5, 5)), np.zeros(1, np.bool_), np.zeros(5),
                  np.zeros(5), np.zeros(2, ESTIMATE))


@njit(cache=True, error_model='numpy')
def estimate_frames(stress, x, y, pitch_x, pitch_y, nodes, window, layers, rules, reasons,
                    saturated, calibrated, estimates):
    """
    Estimate every frame, see `estimate_frame`.

    Parameters
    ----------
    stress : ndarray, shape (N, layers, rows, columns)
        [Pa]; preprocessed in place.
    x, y, pitch_x, pitch_y, nodes, window, layers
        From `layers.sensor_of`, with the given noise and full scale; the last frame's noise
        stays in `layers`. One by one: a named tuple from Python costs some microseconds.
    rules : ndarray of RULES, shape (1,)
    reasons, saturated, calibrated : int, int, bool
        Reasons that hold of the pictures anyway, tactels that the driver has left out at full
        scale, and whether the unit is Pa.
    estimates : ndarray of contact.ESTIMATE, shape (N,)
        On entry of nothing; type PENDING if rules.fit is false and there is a load.
    """
    sensor = Sensor(x, y, pitch_x, pitch_y, nodes, window)
    memory = make_memory(layers.size, stress.shape[2], stress.shape[3], nodes.size)
    for f in range(stress.shape[0]):
        memory.estimates[0] = estimates[f]
        best = estimate_frame(
            stress[f], sensor, layers, rules[0], reasons, saturated, calibrated, memory)
        estimates[f] = memory.estimates[best]


@njit(error_model='numpy')
def estimate_frame(stress, sensor, layers, rules, reasons, saturated, calibrated, memory):
    """Estimate one frame; returns which of the two estimates in the memory holds."""
    first, second = memory.estimates[0], memory.estimates[1]
    if not preprocess(stress, sensor, layers, reasons, saturated, calibrated, first):
        return 0
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
    fitted, left_out, depth_variance = _fit_mended(
        kind, sensor, layers, forces, rules, memory)
    shear = False
    if fitted:
        fitted, shear = fit_without_idle_shear(
            kind, sensor, memory.layers, forces, rules, memory)
    if not fitted:
        estimate.type, missed = _OTHER, _BAD_FIT
    else:
        estimate.type, missed = refute(kind, sensor, memory.layers, rules, memory, estimate)
    if not missed:
        _widen(cov, 2 + forces, memory.moved, depth_variance, memory.slope, estimate.residual)
        if beyond_sight(kind, sensor, memory.layers[0].depth, fit, cov):
            missed = _OFF_PAD
    estimate.reasons |= missed
    if missed:
        return
    estimate.has_shear = shear
    if kind == POINT:
        write_point(fit, cov, estimate)
    else:
        write_line(fit, cov, shear, sensor, estimate)
    disagrees = compare_forces(estimate)
    estimate.reasons |= (_DEAD if left_out else 0) | (_MISMATCH if disagrees else 0)


@njit(error_model='numpy')
def _fit_mended(kind, sensor, given_layers, forces, rules, memory):
    """
    Fit at the given depth, or at that which the frame shows, despite faults of the sensor.

    Returns what `fit_despite_faults` does, and the variance of the factor on the depth, 0 for the
    given one.
    """
    layers, stress, fit = memory.layers, memory.stress, memory.fit[0]
    scale_depths(given_layers, 1.0, layers)
    if not rules.fit_depth:
        fitted, left_out = fit_despite_faults(kind, sensor, layers, forces, rules, memory)
        return fitted, left_out, 0.0
    fitted, left_out, variance = False, False, 0.0
    for mended in (False, True):  # faults do not show at a wrong depth, nor the depth with faults
        factor, variance = fit_depth(kind, stress, sensor, given_layers, layers, forces,
                                     rules.model_error, memory.tactels, fit, memory.slope)
        if np.isnan(factor):
            return False, left_out, variance
        scale_depths(given_layers, factor, layers)
        if not mended:
            fitted, left_out = fit_despite_faults(kind, sensor, layers, forces, rules, memory)
            if not fitted:
                return False, left_out, variance
    fitted = fit_load(kind, stress, sensor, layers, forces, rules.model_error, np.inf,
                      memory.tactels, fit)
    return fitted, left_out, variance


@njit(error_model='numpy')
def _widen(cov, n, moved, depth_variance, slope, residual):
    """Add to a covariance shear that may be there, the depth, and more noise than expected."""
    for i in range(n):
        for j in range(n):
            cov[i, j] = moved[i] * moved[j] + max(1.0, residual ** 2) * (
                cov[i, j] + depth_variance * slope[i] * slope[j])
