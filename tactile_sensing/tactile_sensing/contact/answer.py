"""
From the readings of one image to what is said of them; compiled.

Entry points take a Sensor as plain tuples: numba types a named one anew, in Python, at each call.
"""

import math
from typing import NamedTuple

import numpy as np

from tactile_common.kernels import njit
from tactile_sensing.contact.hypotheses import search
from tactile_sensing.contact.misfit import LOUD
from tactile_sensing.contact.noise import hidden_scale, noise_of_image
from tactile_sensing.contact.records import Readings
from tactile_sensing.contact.refusal import BAD_FIT, has_second_hill, NO_CONTACT
from tactile_sensing.contact.reported import grade_forces, reported
from tactile_sensing.image import survey
from tactile_sensing.skin.bumps import Pad, POINT, WIDTH
from tactile_sensing.types.contact import ContactType, Reason

FEWEST = 6  # tactels
CUT_OFF = 4  # equal readings at the top that may be cut off
DETECTION = 5.0  # standard deviations
QUIETER = 0.9  # of the noise that an image seemed to have: worth another fit
LOW_SNR, DEAD_TACTELS = int(Reason.LOW_SNR), int(Reason.DEAD_TACTELS)
FEW_TACTELS, SATURATED = int(Reason.FEW_TACTELS), int(Reason.SATURATED)
TWO_CONTACTS, SKIN_MISMATCH = int(Reason.TWO_CONTACTS), int(Reason.SKIN_MISMATCH)
NONE, IS_POINT, IS_LINE, OTHER = (int(kind) for kind in (
    ContactType.NONE, ContactType.POINT, ContactType.LINE, ContactType.OTHER))


class Sensor(NamedTuple):
    """What is known of the readings beforehand, by layers (L,)."""

    pad: Pad
    main: int  # layer of the pressure
    noise: np.ndarray  # standard deviation of a tactel; 0: not known
    full: np.ndarray  # full scale, infinite if there is none
    floor: np.ndarray  # at or below it a reading is only known to be below it; or -infinite
    scatter: float  # of the gains; 0: not known
    calibrated: bool  # whether readings are pressures
    force_std: float  # of all forces in common, relative
    min_snr: float  # dB; a weaker load is no answer


class Look(NamedTuple):
    """What an image shows before anything is fitted."""

    moments: tuple  # of the main layer, see `image.moments_of`
    noise: np.ndarray  # (L,)
    full: np.ndarray  # (L,)
    type: int  # NONE or OTHER, if nothing is to be fitted
    reasons: int  # SATURATED, DEAD_TACTELS, and why nothing is to be fitted
    loaded: bool  # whether there is something to be fitted


class Answer(NamedTuple):
    """What a fit says of an image."""

    moments: tuple  # of the main layer, see `image.moments_of`
    type: int
    valid: bool
    force_valid: bool
    reasons: int
    kind: int  # POINT or LINE
    power: bool  # whether the load was fitted without a skin
    blunt: bool  # whether it has a patch
    ends: bool  # whether a line has ends
    iterations: int
    residual: float  # RMS of the errors [standard deviations of the noise]
    snr: float  # dB
    values: np.ndarray  # (7,), of `types.contact.PARAMETERS`
    covariance: np.ndarray  # (7, 7)
    start: float  # of a line [m], as in Contact.msg
    end: float
    patch: float  # m


def plain(sensor: Sensor) -> tuple:
    """Sensor as the entry points take it."""
    return tuple(sensor.pad), *sensor[1:]


@njit(error_model='numpy')
def _look(frame: np.ndarray, sensor: Sensor, saturated: int) -> tuple[Look, float]:
    """See `look`."""
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
    See what is in an image before anything is fitted.

    Parameters
    ----------
    frame : ndarray, shape (layers, rows, columns)
        NaN where there is no reading.
    sensor : tuple
        See `plain`.
    saturated : int
        Tactels that have no reading since they are at full scale.

    Returns
    -------
    Look
    """
    return _look(frame, Sensor(Pad(*sensor[0]), *sensor[1:]), saturated)[0]


@njit(error_model='numpy')
def _nothing(seen: Look, kind: int, reasons: int) -> Answer:
    """Answer for an image to which nothing is fitted."""
    return Answer(seen.moments, kind, False, False, reasons, POINT, False, False, False, 0, np.nan,
                  np.nan, np.full(7, np.nan), np.full((7, 7), np.nan), np.nan, np.nan, np.nan)


@njit(cache=True, error_model='numpy')
def answer(frame: np.ndarray, sensor: tuple, saturated: int, kinds: np.ndarray) -> Answer:
    """
    Fit a load to an image, and say what it is or why it is none.

    Parameters
    ----------
    frame, sensor, saturated
        As for `look`.
    kinds : ndarray of int
        As in `hypotheses.search`.

    Returns
    -------
    Answer
    """
    known = Sensor(Pad(*sensor[0]), *sensor[1:])
    pad, main, size, shape = known.pad, known.main, frame[0].size, frame.shape
    seen, top = _look(frame, known, saturated)
    noise, reasons = seen.noise[main], seen.reasons
    if not seen.loaded:
        return _nothing(seen, seen.type, reasons)
    if top < noise * 10.0 ** (known.min_snr / 20.0):  # whatever a fit would say
        return _nothing(seen, NONE, reasons | LOW_SNR)
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
    if one.evidence == -np.inf:
        return _nothing(seen, OTHER, reasons | why)
    fit, beliefs, kind = one.fit, one.beliefs, OTHER
    snr = 20.0 * math.log10(max(fit.model.max(), 1e-300) / noise)
    if not why & ~SKIN_MISMATCH and snr < known.min_snr:
        why |= LOW_SNR
    if why & (NO_CONTACT | LOW_SNR):
        kind = NONE
    elif not why & (BAD_FIT | TWO_CONTACTS):
        kind = IS_POINT if beliefs.kind == POINT else IS_LINE
    valid, patch, start, end = not why & ~SKIN_MISMATCH, np.nan, np.nan, np.nan
    forces = valid and known.calibrated and not beliefs.power
    values, covariance = np.full(7, np.nan), np.full((7, 7), np.nan)
    if valid:
        if one.residual.silent or one.residual.loudest > 2.0 * LOUD:
            why |= DEAD_TACTELS
        values, covariance, start, end = reported(
            pad, beliefs.kind, fit.theta, beliefs.ends, one.covariance)
        grade_forces(values, covariance, forces, known.force_std)
    if forces:
        spread = math.sqrt(fit.theta[WIDTH]) if beliefs.patch else 0.0
        patch = pad.depths[0] * spread * (math.sqrt(5.0) if beliefs.kind == POINT else 2.0)
    return Answer(seen.moments, kind, valid, forces, reasons | why, beliefs.kind, beliefs.power,
                  beliefs.patch, beliefs.ends, fit.iterations, one.residual.rms, snr, values,
                  covariance, start, end, patch)
