"""
From stress to a contact, frame by frame; all compiled.

`estimate_frame` is the whole algorithm: preprocess, try the likelier model, and the other one
where that does not convince. `estimate_as` fits one model, with as little as explains the frame,
and says what is known of it.
"""

import math

import numpy as np

from tactile_common.kernels import njit
from tactile_sensing.contact.extended_load import PATCH
from tactile_sensing.contact.gauss_newton import fit_load, LINE, POINT
from tactile_sensing.contact.goodness_of_fit import beyond_sight, compare, refute
from tactile_sensing.contact.hills import has_second_hill
from tactile_sensing.contact.ladder import climb
from tactile_sensing.contact.memory import make_memory
from tactile_sensing.contact.model_selection import (
    fit_without_idle_shear,
    likelier_model,
    overrules,
    UNCONVINCING,
)
from tactile_sensing.contact.noise import lower_noise, measure_noise
from tactile_sensing.contact.outliers import (
    any_off,
    fit_depth,
    fit_despite_faults,
    is_cut_off,
    leave_out_top,
    leave_out_worst,
    scale_depths,
    take_off_drift,
)
from tactile_sensing.contact.parameters import (
    compare_forces,
    copy_record,
    forget_forces,
    widen,
    widen_forces,
    write_line,
    write_point,
)
from tactile_sensing.contact.preprocessing import preprocess
from tactile_sensing.contact.scatter import measure_scatter
from tactile_sensing.half_space.kernels import FORCE
from tactile_sensing.half_space.layers import first_pressure_layer, Sensor
from tactile_sensing.types.contact import ContactType, Reason

MOST_LOOKS = 5  # with the noise that the last load has left, or without readings that are cut off
MOST_DRIFTS = 3  # each leaves a part of the drift that it found
MOST_FAULTS = 3  # tactels that are left out beside the end of a line, or beside a patch
ANY_MODEL, PENDING = 0, -1  # rules.model, estimate.type
# How contacts are estimated, see EstimatorConfig; model: ANY_MODEL, POINT or LINE.
RULES = np.dtype([('min_snr', 'f8'), ('model_error', 'f8'), ('max_chi_square', 'f8'),
                  ('gain_spread', 'f8'), ('force_std', 'f8'), ('fit_depth', '?'), ('model', 'i8'),
                  ('fit', '?')])

_OTHER, _BAD_FIT = int(ContactType.OTHER), int(Reason.BAD_FIT)
_LOW_SNR, _OFF_PAD = int(Reason.LOW_SNR), int(Reason.OFF_PAD)
_TWO, _SATURATED = int(Reason.TWO_CONTACTS), int(Reason.SATURATED)
_DEAD = int(Reason.DEAD_TACTELS)


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
        copy_record(estimates, f, memory.estimates, 0)
        best = estimate_frame(
            stress[f], sensor, layers, rules[0], reasons, saturated, calibrated, memory)
        if memory.estimates[best].reasons & _BAD_FIT and has_second_hill(
                stress[f], sensor, layers):
            memory.estimates[best].reasons |= _TWO
        if not calibrated:
            forget_forces(memory.estimates[best])
        elif rules[0].force_std > 0.0:
            widen_forces(memory.estimates[best], rules[0].force_std)
        copy_record(memory.estimates, best, estimates, f)


@njit(error_model='numpy', inline='always')
def estimate_frame(stress, sensor, layers, rules, reasons, saturated, calibrated, memory):
    """Estimate one frame; returns which of the two estimates in the memory holds."""
    first = memory.estimates[0]
    if not preprocess(stress, sensor, layers, reasons, saturated, calibrated, memory.censored,
                      first):
        return 0
    memory.state[0].any_censored = memory.censored.any()
    if not rules.fit:
        first.type = PENDING
        return 0
    copy_record(memory.estimates, 0, memory.estimates, 2)
    best, ceiling, main = 0, np.inf, first_pressure_layer(layers)
    for _ in range(MOST_LOOKS):  # not one after the other: it would be compiled twice
        copy_record(memory.estimates, 2, memory.estimates, 0)
        copy_record(memory.estimates, 2, memory.estimates, 1)
        memory.noise[:] = np.inf
        best = _estimate_as_likelier(stress, sensor, layers, rules, memory)
        found = memory.estimates[best]
        if ceiling < np.inf:  # this was without the highest readings
            if found.reasons & UNCONVINCING or not is_cut_off(
                    memory.top, memory.model[main], ceiling):
                copy_record(memory.estimates, 3, memory.estimates, best)
            else:
                found.reasons |= _SATURATED
            break
        if lower_noise(layers, memory.noise):
            continue
        # Rounded readings of a point that are cut off may look like those of a blunt one.
        if found.type == POINT and found.extras & PATCH and not found.reasons & _SATURATED:
            ceiling = leave_out_top(stress[main], memory.top)
        if ceiling == np.inf:
            break
        copy_record(memory.estimates, best, memory.estimates, 3)
    return best


@njit(error_model='numpy', inline='always')
def _estimate_as_likelier(stress, sensor, layers, rules, memory):
    """Estimate as the likelier kind, and as the other; returns which of the two holds."""
    first, second = memory.estimates[0], memory.estimates[1]
    model = rules.model
    if rules.model == ANY_MODEL:
        model = likelier_model(stress, sensor, layers)
    for attempt in range(2):  # likewise
        estimate_as(
            model, stress, sensor, layers, rules, memory, memory.estimates[attempt])
        if rules.model != ANY_MODEL or not first.reasons & UNCONVINCING:
            return 0
        model = POINT + LINE - model
    if overrules(first, second, rules.min_snr):
        second.reasons |= first.reasons & _LOW_SNR
        return 1
    return 0


@njit(error_model='numpy', inline='always')
def estimate_as(kind, measured, sensor, layers, rules, memory, estimate):
    """Estimate a frame as one kind of load: its type and reasons, or those of a refusal."""
    fit, state, forces = memory.fits[0], memory.state[0], 3 if kind == POINT else 2
    for k in range(measured.shape[0]):
        for r in range(measured.shape[1]):
            for c in range(measured.shape[2]):
                memory.stress[k, r, c] = measured[k, r, c]
    state.scatter, state.second, state.hidden[:] = rules.gain_spread, False, 0.0
    ladder = sensor.polynomials.size > 0 and not rules.fit_depth
    # Faults are looked for above the ladder: a blunt load is no row of broken tactels. Then
    # below it, and at last, one by one, by what it has found: the end of a line is none, either.
    left_out = shear = False
    look = drifts = 0
    while look < 2 + MOST_FAULTS:
        copy_record(memory.fits, 0, memory.fits, 3)
        fitted, found, depth_variance = _fit_mended(
            kind, sensor, layers, forces, look == 1, rules, memory)
        left_out |= found
        if look == 1 and not found:  # no other frame than before
            fitted = True
            copy_record(memory.fits, 3, memory.fits, 0)
            compare(kind, sensor, memory.layers, fit, memory)
        elif fitted:
            fitted, shear = _fit_least(kind, sensor, forces, ladder, memory)
        if look > 0 and fit.extras:
            state.second = False
        if fitted and drifts < MOST_DRIFTS and take_off_drift(
                memory.layers, drifts == 0, math.sqrt(_excess(fit, forces)), memory):
            drifts += 1
            continue
        if not (fitted and any_off(memory.left, memory.model, memory.layers, rules)):
            break
        if look > 0:
            if not (fit.extras and leave_out_worst(sensor, memory.layers, rules, memory)):
                break
            left_out = True
        look += 1
    by_noise = 0.0
    if fitted:
        measure_noise(layers, memory)
    if not fitted:
        estimate.type, missed = _OTHER, _BAD_FIT
    else:
        # What scatter nobody told may be a wrong model: forces are compared as by noise alone.
        by_noise = fit.cov[FORCE, FORCE] / fit.force ** 2 * _excess(fit, forces)
        shear = _weigh_scatter(kind, sensor, forces, shear, rules, memory)
        estimate.type, missed = refute(kind, sensor, memory.layers, rules, memory, estimate)
    if not missed:
        if not ladder or fit.extras & PATCH:
            state.hidden[:] = 0.0
        widen(fit, state, depth_variance)
        if beyond_sight(kind, sensor, memory.layers[0].depth, fit, fit.cov):
            missed = _OFF_PAD
    estimate.reasons |= missed
    if missed:
        return
    estimate.has_shear, estimate.extras = shear, fit.extras
    if kind == POINT:
        write_point(fit, fit.cov, estimate)
        estimate.patch = math.sqrt(5.0 * fit.variance)
    else:
        write_line(fit, fit.cov, shear, sensor, estimate)
        estimate.patch = 2.0 * math.sqrt(fit.variance)
    compare_forces(state.ratio, math.sqrt(by_noise), estimate)
    estimate.reasons |= _DEAD if left_out else 0


@njit(error_model='numpy')
def _excess(fit, forces):
    """Squared error over what is expected, at least 1."""
    return max(1.0, fit.squared_error / max(fit.used - 2.0 - forces, 1.0))


@njit(error_model='numpy', inline='always')
def _fit_least(kind, sensor, forces, ladder, memory):
    """From a fit with shear to the least load that explains the frame, and what it leaves."""
    fitted, shear = fit_without_idle_shear(
        kind, sensor, memory.layers, forces, memory.fits[0].extras, memory)
    if fitted:
        if ladder:
            shear = climb(kind, sensor, memory.layers, forces, shear, memory)
        measure_scatter(kind, memory.layers, forces if shear else forces // 2, memory)
        compare(kind, sensor, memory.layers, memory.fits[0], memory)
    return fitted, shear


@njit(error_model='numpy', inline='always')
def _weigh_scatter(kind, sensor, forces, shear, rules, memory):
    """Fit again where tactels are off by a share of the pressure; returns whether with shear."""
    fit, state, known = memory.fits[0], memory.state[0], memory.state[0].scatter
    if state.found <= known:
        return shear
    state.scatter, fitted, with_shear = state.found, True, shear
    copy_record(memory.fits, 0, memory.fits, 1)
    if not fit.extras:
        fitted = fit_load(kind, memory.stress, sensor, memory.layers, forces, rules.model_error,
                          np.inf, state.scatter, memory.tactels, fit)
    if fitted:
        fitted, with_shear = fit_without_idle_shear(
            kind, sensor, memory.layers, forces, fit.extras, memory)
    if not fitted:
        state.scatter = known
        copy_record(memory.fits, 1, memory.fits, 0)
        return shear
    compare(kind, sensor, memory.layers, fit, memory)
    return with_shear


@njit(error_model='numpy', inline='always')
def _fit_mended(kind, sensor, given_layers, forces, mend, rules, memory):
    """
    Fit at the given depth, or at that which the frame shows, despite faults of the sensor.

    Returns what `fit_despite_faults` does, and the variance of the factor on the depth, 0 for the
    given one.
    """
    layers, stress, fit = memory.layers, memory.stress, memory.fits[0]
    scale_depths(given_layers, 1.0, layers)
    if not rules.fit_depth:
        fitted, left_out = fit_despite_faults(kind, sensor, layers, forces, mend, rules, memory)
        return fitted, left_out, 0.0
    fitted, left_out, variance = False, False, 0.0
    for mended in (False, True):  # faults do not show at a wrong depth, nor the depth with faults
        factor, variance = fit_depth(kind, stress, sensor, given_layers, layers, forces,
                                     rules, memory.tactels, fit, memory.state[0].slope)
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
