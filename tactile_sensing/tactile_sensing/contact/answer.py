"""
Compute the answers for images from their readings; compiled.

Entry points take a Sensor as plain tuples, because numba determines the type of a named tuple in
Python at each call.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from tactile_common.kernels import njit
from tactile_sensing.contact.beliefs import ENDS, PATCH, POWER
from tactile_sensing.contact.hypotheses import search
from tactile_sensing.contact.misfit import LOUD
from tactile_sensing.contact.noise import hidden_scale, noise_of_image
from tactile_sensing.contact.records import Readings
from tactile_sensing.contact.refusal import BAD_FIT, has_second_hill, NO_CONTACT
from tactile_sensing.contact.reported import report
from tactile_sensing.image import survey
from tactile_sensing.skin.bumps import Pad, POINT
from tactile_sensing.types.contact import ContactType, Reason

FEWEST = 6  # tactels
CUT_OFF = 4  # this number of equal highest readings may be saturated
DETECTION = 5.0  # standard deviations
QUIETER = 0.9  # fit again if the residual noise is below this share of the assumed noise
LOW_SNR, DEAD_TACTELS = int(Reason.LOW_SNR), int(Reason.DEAD_TACTELS)
FEW_TACTELS, SATURATED = int(Reason.FEW_TACTELS), int(Reason.SATURATED)
TWO_CONTACTS, SKIN_MISMATCH = int(Reason.TWO_CONTACTS), int(Reason.SKIN_MISMATCH)
NONE, IS_POINT, IS_LINE, OTHER = (int(kind) for kind in (
    ContactType.NONE, ContactType.POINT, ContactType.LINE, ContactType.OTHER))


class Sensor(NamedTuple):
    """Known properties of the readings; arrays have one value per layer (L,)."""

    pad: Pad
    main: int  # index of the pressure layer
    noise: np.ndarray  # standard deviation of a tactel; 0: unknown
    full: np.ndarray  # full scale; infinite: none
    floor: np.ndarray  # a reading at or below it is an upper bound only; -infinite: none
    scatter: float  # relative standard deviation of the gains; 0: unknown
    calibrated: bool  # whether readings are pressures
    force_std: float  # relative standard deviation that all forces have in common
    min_snr: float  # a weaker load is not valid [dB]


class Look(NamedTuple):
    """Properties of an image that need no fit."""

    moments: tuple  # of the main layer, see `image.moments_of`
    noise: np.ndarray  # (L,)
    full: np.ndarray  # (L,)
    type: int  # NONE or OTHER, if there is no load to fit
    reasons: int  # SATURATED, DEAD_TACTELS, and why there is no load to fit
    loaded: bool  # whether there is a load to fit


def plain(sensor: Sensor) -> tuple:
    """Convert a Sensor to the plain tuples that the entry points take."""
    return tuple(sensor.pad), *sensor[1:]


@njit(error_model='numpy')
def _look(frame: np.ndarray, sensor: Sensor, saturated: int) -> tuple[Look, float]:
    """Return the result of `look`, and the highest reading of the main layer."""
    main, full, noise = sensor.main, sensor.full.copy(), sensor.noise.copy()
    seen = survey(frame, main, full, sensor.pad)
    for k in range(noise.size):
        if not noise[k] > 0.0:
            noise[k] = noise_of_image(frame[k], True)
    clipped = seen.clipped + saturated
    if full[main] == np.inf and CUT_OFF <= seen.highest <= 0.25 * frame[main].size:
        full[main] = hidden_scale(frame[main], noise[main])
        clipped += seen.highest * (full[main] < np.inf)
    why, kind = 0, OTHER if clipped > 0 else NONE
    if seen.live < FEWEST:
        why = FEW_TACTELS
    elif seen.top < DETECTION * noise[main] and (
            seen.total < DETECTION * noise[main] * math.sqrt(seen.live)):
        why = BAD_FIT if clipped > 0 else NO_CONTACT
    return Look(seen.moments, noise, full, kind, why | SATURATED * (clipped > 0) | DEAD_TACTELS * (
        seen.missing > saturated), why == 0), seen.top


@njit(cache=True, error_model='numpy')
def look(frame: np.ndarray, sensor: tuple, saturated: int) -> Look:
    """
    Examine an image before anything is fitted.

    Parameters
    ----------
    frame : ndarray, shape (layers, rows, columns)
        Readings; NaN: no reading.
    sensor : tuple
        Result of `plain`.
    saturated : int
        Number of tactels that are NaN because they are at full scale.

    Returns
    -------
    Look
    """
    return _look(frame, Sensor(Pad(*sensor[0]), *sensor[1:]), saturated)[0]


@njit(error_model='numpy', inline='always')
def _answer(frame: np.ndarray, known: Sensor, saturated: int, kinds: np.ndarray,
            record: Any) -> int:
    """Write the answer for one image; return the options of the fit (see `beliefs`)."""
    pad, main, size, shape = known.pad, known.main, frame[0].size, frame.shape
    seen, top = _look(frame, known, saturated)
    noise = seen.noise[main]
    record.type, record.reasons = seen.type, seen.reasons
    for k in range(6):
        record.moments[k] = seen.moments[k]
    if not seen.loaded:
        return 0
    if top < noise * 10.0 ** (known.min_snr / 20.0):  # a fit cannot reach min_snr
        record.type, record.reasons = NONE, seen.reasons | LOW_SNR
        return 0
    readings = Readings(frame.ravel(), np.repeat(seen.noise ** 2, size),
                        np.repeat(seen.full, size), np.repeat(known.floor, size))
    for again in range(2):
        one, why = search(pad, readings, known.scatter, kinds)
        if again or one.evidence == -np.inf or known.noise[main] > 0.0:
            break
        left = (readings.value - one.fit.model).reshape(shape)
        quieter = noise_of_image(left[main], False)
        if not quieter < QUIETER * noise:
            break
        noise = quieter
        readings.noise2[:] = quieter ** 2
    if why & BAD_FIT and has_second_hill(frame[main], noise):
        why |= TWO_CONTACTS
    record.type, record.reasons = OTHER, seen.reasons | why
    if one.evidence == -np.inf:
        return 0
    fit, beliefs = one.fit, one.beliefs
    record.iterations = fit.iterations
    record.snr = 20.0 * math.log10(max(fit.model.max(), 1e-300) / noise)
    record.residual = one.residual.rms
    if not why & ~SKIN_MISMATCH and record.snr < known.min_snr:
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
        report(pad, one, known.force_std, record)
    record.reasons = seen.reasons | why
    return POWER * beliefs.power + PATCH * beliefs.patch + ENDS * beliefs.ends


@njit(cache=True, error_model='numpy')
def answer(frames: np.ndarray, sensor: tuple, saturated: int, kinds: np.ndarray,
           records: np.ndarray) -> int:
    """
    Fit a load to every image; write the load, or the reasons why there is none.

    Parameters
    ----------
    frames : ndarray, shape (N, layers, rows, columns)
    sensor, saturated
        As for `look`.
    kinds : ndarray of int
        As in `hypotheses.search`.
    records : ndarray of types.contact.RECORD, shape (N,)
        Output: fields that are not written keep their values.

    Returns
    -------
    int
        Options of the last fit, see `beliefs`.
    """
    known, options = Sensor(Pad(*sensor[0]), *sensor[1:]), 0
    for i in range(len(frames)):
        options = _answer(frames[i], known, saturated, kinds, records[i])
    return options
