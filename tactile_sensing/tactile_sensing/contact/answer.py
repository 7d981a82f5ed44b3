"""
Compute the answers for images from their readings; compiled.

The entry point takes a KnownSensor as plain tuples, because numba determines the type of a named
tuple in Python at each call.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from tactile_common.kernels import njit
from tactile_sensing.contact.fit import ENDS, PATCH, POWER
from tactile_sensing.contact.hypotheses import search
from tactile_sensing.contact.misfit import LOUD
from tactile_sensing.contact.noise import (
    hidden_floor,
    hidden_scale,
    noise_of_image,
    noise_of_rounding,
)
from tactile_sensing.contact.records import Hypothesis, Readings
from tactile_sensing.contact.refusal import BAD_FIT, DEAD_TACTELS, NO_CONTACT, TWO_CONTACTS
from tactile_sensing.image import moments_of
from tactile_sensing.skin.bumps import chord, loaded_chord, P, Pad, POINT
from tactile_sensing.types.contact import ContactType, Reason, ROW

FEWEST = 6  # tactels
DETECTION = 5.0  # standard deviations
MIN_SNR = 16.0  # a weaker load is not valid: its kind is uncertain [dB]
STEP = 1e-6  # of a parameter, by which the length of a line is differentiated [m, rad]
QUIETER = 0.9  # fit again if the residual noise is below this share of the assumed noise
LOW_SNR, FEW_TACTELS = int(Reason.LOW_SNR), int(Reason.FEW_TACTELS)
SATURATED, SKIN_MISMATCH = int(Reason.SATURATED), int(Reason.SKIN_MISMATCH)
NONE, IS_POINT, IS_LINE, OTHER = (int(kind) for kind in (
    ContactType.NONE, ContactType.POINT, ContactType.LINE, ContactType.OTHER))
X, Y, YAW, NORMAL, SHEAR_X, SHEAR_Y, PER_LENGTH = ROW


class KnownSensor(NamedTuple):
    """Known properties of the readings; arrays have one value per layer (L,), pressure first."""

    pad: Pad
    noise: np.ndarray  # standard deviation of a tactel; 0: unknown
    full: np.ndarray  # full scale; infinite: none
    floor: np.ndarray  # a reading at or below it is an upper bound only; -infinite: none
    scatter: float  # relative standard deviation of the gains; 0: unknown
    calibrated: bool  # whether readings are pressures
    force_std: float  # relative standard deviation that all forces have in common


@njit(error_model='numpy')
def _examine(frame: np.ndarray, known: KnownSensor, saturated: int, noise: np.ndarray,
             full: np.ndarray, floor: np.ndarray, record: Any) -> float:
    """
    Write the fields that need no fit; return the highest reading, or 0 without a load to fit.

    Unknown values of `noise` and `full` (layers,) are replaced by those that the image shows. The
    noise is at least that of rounding, and `floor` (layers,) at least the one in the image.
    """
    pad, pressure, clipped, missing = known.pad, frame[0], saturated, 0
    for k in range(noise.size):
        if not noise[k] > 0.0:
            noise[k] = noise_of_image(frame[k], True)
        noise[k] = max(noise[k], noise_of_rounding(frame[k]))
        for value in frame[k].flat:
            missing += np.isnan(value)
            clipped += value >= full[k]
    moments = moments_of(pressure, pad.x, pad.y, -np.inf)
    for k in range(6):
        record.moments[k] = moments[k]
    top, live = np.nanmax(pressure), np.isfinite(pressure).sum()
    highest = (pressure == top).sum()
    if full[0] == np.inf and 1 < highest <= 0.25 * pressure.size and top > 0.0:
        full[0] = hidden_scale(pressure, noise[0])
        clipped += highest * (full[0] < np.inf)
    record.type = OTHER if clipped > 0 else NONE
    why = 0
    if live < FEWEST:
        why = FEW_TACTELS
    elif top < DETECTION * noise[0] and moments[0] < DETECTION * noise[0] * math.sqrt(live):
        why = BAD_FIT if clipped > 0 else NO_CONTACT
    elif (pressure == np.nanmin(pressure)).sum() > 1:
        floor[0] = max(floor[0], hidden_floor(pressure, noise[0]))
    record.reasons = why | SATURATED * (clipped > 0) | DEAD_TACTELS * (missing > saturated)
    return 0.0 if why else top


@njit(error_model='numpy')
def _write_point(theta: np.ndarray, values: np.ndarray, change: np.ndarray) -> None:
    for row, parameter in ((X, P.Q0), (Y, P.Q1), (NORMAL, P.FORCE), (SHEAR_X, P.SHEAR_U),
                           (SHEAR_Y, P.SHEAR_V)):
        values[row], change[row, parameter] = theta[parameter], 1.0


@njit(error_model='numpy')
def _write_line(pad: Pad, theta: np.ndarray, ends: bool, values: np.ndarray,
                change: np.ndarray) -> tuple[float, float]:
    """
    Write the parameters of a line and their derivatives; return its start and end.

    The line's place is the middle of its loaded part on the pad; its forces are those on the pad.
    """
    rho, yaw, shear = theta[P.Q0], theta[P.Q1], theta[P.SHEAR_U]
    first, last = loaded_chord(pad, theta, ends)
    middle, length = 0.5 * (first + last), last - first
    grown = middle / math.hypot(pad.half_x, pad.half_y)
    force = theta[P.FORCE] + theta[P.TAPER] * grown
    cos, sin = math.cos(yaw), math.sin(yaw)
    turns = math.ceil(yaw / math.pi - 0.5)
    values[X], values[Y] = rho * cos - middle * sin, rho * sin + middle * cos
    values[YAW], values[PER_LENGTH] = yaw - math.pi * turns, force
    values[NORMAL] = force * length
    values[SHEAR_X], values[SHEAR_Y] = shear * length * cos, shear * length * sin
    # A turn about the centre of the pad moves the middle across the line, away from its +x.
    change[X, P.Q0], change[X, P.Q1] = cos, -cos * middle
    change[Y, P.Q0], change[Y, P.Q1] = sin, -sin * middle
    change[YAW, P.Q1] = change[PER_LENGTH, P.FORCE] = 1.0
    change[PER_LENGTH, P.TAPER] = grown
    change[NORMAL, P.FORCE], change[NORMAL, P.TAPER] = length, length * grown
    change[SHEAR_X, P.SHEAR_U], change[SHEAR_Y, P.SHEAR_U] = length * cos, length * sin
    for parameter in (P.Q0, P.Q1, P.BEGIN, P.END):
        near = theta.copy()
        near[parameter] += STEP
        low, high = loaded_chord(pad, near, ends)
        by_length = (max(high - low, 0.0) - length) / STEP
        change[NORMAL, parameter] = force * by_length
        change[SHEAR_X, parameter] = shear * cos * by_length
        change[SHEAR_Y, parameter] = shear * sin * by_length
    change[SHEAR_X, P.Q1] -= shear * length * sin
    change[SHEAR_Y, P.Q1] += shear * length * cos
    start = end = np.nan
    if ends:
        begin, stop, sign = theta[P.BEGIN], theta[P.END], 1.0
        if turns % 2:
            begin, stop, sign = -stop, -begin, -1.0
        low, high = chord(pad.half_x, pad.half_y, sign * rho, values[YAW])
        if begin > low:
            start = begin
        if stop < high:
            end = stop
    return start, end


@njit(error_model='numpy')
def _report(pad: Pad, one: Hypothesis, force_std: float, record: Any) -> None:
    """
    Write the parameters of a valid contact and their covariance to a record.

    The forces are written only if they are valid. `force_std` is the relative standard deviation
    that all of them have in common.
    """
    theta, beliefs = one.fit.theta, one.beliefs
    values, change = np.full(7, np.nan), np.zeros((7, theta.size))
    if beliefs.kind == POINT:
        _write_point(theta, values, change)
    else:
        record.start, record.end = _write_line(pad, theta, beliefs.ends, values, change)
    change = change[:, beliefs.active]
    covariance = change @ one.covariance @ change.T
    for i in range(7):
        for j in range(7):
            if i >= NORMAL and j >= NORMAL:
                covariance[i, j] += force_std**2 * values[i] * values[j]
            known = record.force_valid or max(i, j) < NORMAL
            if known and not np.isnan(values[i] + values[j]):
                record.covariance[i, j] = covariance[i, j]
    record.x, record.y, record.yaw = values[X], values[Y], values[YAW]
    if record.force_valid:
        record.normal_force, record.line_force = values[NORMAL], values[PER_LENGTH]
        record.shear_force_x, record.shear_force_y = values[SHEAR_X], values[SHEAR_Y]
        spread = math.sqrt(theta[P.WIDTH]) if beliefs.patch else 0.0
        width = math.sqrt(5.0) if beliefs.kind == POINT else 2.0
        record.patch = pad.depths[0] * spread * width


@njit(error_model='numpy', inline='always')
def _answer(frame: np.ndarray, known: KnownSensor, saturated: int, kinds: np.ndarray,
            record: Any) -> int:
    """Write the answer for one image; return the options of the fit (see `fit.beliefs_of`)."""
    pad, size, shape = known.pad, frame[0].size, frame.shape
    noises, full, floor = known.noise.copy(), known.full.copy(), known.floor.copy()
    top = _examine(frame, known, saturated, noises, full, floor, record)
    noise, seen = noises[0], record.reasons
    if top == 0.0 or kinds.size == 0:
        return 0
    if top < noise * 10.0 ** (MIN_SNR / 20.0):  # a fit cannot reach it
        record.type, record.reasons = NONE, seen | LOW_SNR
        return 0
    readings = Readings(frame.ravel(), np.repeat(noises ** 2, size), np.repeat(full, size),
                        np.repeat(floor, size))
    for again in range(2):
        one, why = search(pad, readings, known.scatter, kinds)
        if again or one.fit.evidence == -np.inf or known.noise[0] > 0.0:
            break
        left = (readings.value - one.fit.model).reshape(shape)
        quieter = max(noise_of_image(left[0], False), noise_of_rounding(frame[0]))
        if not quieter < QUIETER * noise:
            break
        noise = quieter
        readings.noise2[:size] = quieter ** 2
    record.type, record.reasons = OTHER, seen | why
    if one.fit.evidence == -np.inf:
        return 0
    fit, beliefs = one.fit, one.beliefs
    record.iterations = fit.iterations
    record.snr = 20.0 * math.log10(max(fit.model.max(), 1e-300) / noise)
    record.residual = one.residual.rms
    if not why & ~SKIN_MISMATCH and record.snr < MIN_SNR:
        why |= LOW_SNR
    if why & (NO_CONTACT | LOW_SNR):
        record.type = NONE
    elif not why & (BAD_FIT | TWO_CONTACTS):
        record.type = IS_POINT if beliefs.kind == POINT else IS_LINE
    record.valid = not why & ~SKIN_MISMATCH
    record.force_valid = record.valid and known.calibrated and not beliefs.power
    if record.valid:
        if one.residual.silent or one.residual.loudest > 2.0 * LOUD:
            why |= DEAD_TACTELS
        _report(pad, one, known.force_std, record)
    record.reasons = seen | why
    return POWER * beliefs.power + PATCH * beliefs.patch + ENDS * beliefs.ends


@njit(cache=True, error_model='numpy')
def answer(frames: np.ndarray, sensor: tuple, saturated: int, kinds: np.ndarray,
           records: np.ndarray) -> int:
    """
    Fit a load to every image; write the load, or the reasons why there is none.

    Parameters
    ----------
    frames : ndarray, shape (N, layers, rows, columns)
        Readings; NaN: no reading.
    sensor : tuple
        A KnownSensor as plain tuples.
    saturated : int
        Number of tactels that are NaN because they are at full scale.
    kinds : ndarray of int
        As in `hypotheses.search`; empty: nothing is fitted.
    records : ndarray of types.contact.RECORD, shape (N,)
        Output: fields that are not written keep their values.

    Returns
    -------
    int
        Options of the last fit, see `fit.beliefs_of`.
    """
    known, options = KnownSensor(Pad(*sensor[0]), *sensor[1:]), 0
    for i in range(len(frames)):
        options = _answer(frames[i], known, saturated, kinds, records[i])
    return options
