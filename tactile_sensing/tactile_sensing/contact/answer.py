"""From the readings of one image to what is said of them; compiled."""

import math
from typing import NamedTuple

import numpy as np

from tactile_common.kernels import njit
from tactile_sensing.contact.fit import Readings
from tactile_sensing.contact.hypotheses import search
from tactile_sensing.contact.misfit import LOUD
from tactile_sensing.contact.noise import hidden_scale, noise_of_image
from tactile_sensing.contact.refusal import BAD_FIT, has_second_hill, NO_CONTACT
from tactile_sensing.contact.reported import reported
from tactile_sensing.image import Survey, survey
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


class Look(NamedTuple):
    """What an image shows before anything is fitted."""

    seen: Survey
    noise: np.ndarray  # (L,)
    full: np.ndarray  # (L,)
    reasons: int  # SATURATED, DEAD_TACTELS
    why: int  # reason why nothing is to be fitted, 0 if there is a load


class Answer(NamedTuple):
    """What a fit says of an image."""

    type: int
    valid: bool
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


@njit(cache=True, error_model='numpy')
def look(frame, sensor, saturated):
    """
    See what is in an image before anything is fitted.

    Parameters
    ----------
    frame : ndarray, shape (layers, rows, columns)
        NaN where there is no reading.
    sensor : Sensor
    saturated : int
        Tactels that have no reading since they are at full scale.

    Returns
    -------
    Look
    """
    main, full, noise = sensor.main, sensor.full.copy(), sensor.noise.copy()
    seen = survey(frame, main, full, sensor.pad)
    for k in range(noise.size):
        if not noise[k] > 0.0:
            noise[k] = noise_of_image(frame[k], True)
    clipped = seen.clipped + saturated
    if full[main] == np.inf and CUT_OFF <= seen.highest <= 0.25 * frame[main].size:
        full[main] = hidden_scale(frame[main], noise[main])
        clipped += seen.highest * (full[main] < np.inf)
    why = 0
    if seen.live < FEWEST:
        why = FEW_TACTELS
    elif seen.top < DETECTION * noise[main] and (
            seen.total < DETECTION * noise[main] * math.sqrt(seen.live)):
        why = BAD_FIT if clipped > 0 else NO_CONTACT
    return Look(seen, noise, full, SATURATED * (clipped > 0) | DEAD_TACTELS * (
        seen.missing > saturated), why)


@njit(cache=True, error_model='numpy')
def answer(frame, sensor, seen, kinds, min_snr):
    """
    Fit a load to an image, and say what it is or why it is none.

    Parameters
    ----------
    frame : ndarray, shape (layers, rows, columns)
    sensor : Sensor
    seen : Look
    kinds : ndarray of int
        As in `hypotheses.search`.
    min_snr : float
        A weaker load is no answer [dB].

    Returns
    -------
    Answer
        Its reasons are those of the fit alone.
    """
    pad, main, size, shape = sensor.pad, sensor.main, frame[0].size, frame.shape
    readings = Readings(frame.ravel(), np.repeat(seen.noise ** 2, size),
                        np.repeat(seen.full, size), np.repeat(sensor.floor, size))
    noise = seen.noise[main]
    for again in range(2):
        one, why = search(pad, readings, sensor.scatter, kinds)
        if again or one.evidence == -np.inf or sensor.noise[main] > 0.0:
            break
        left = (readings.value - one.fit.model).reshape(shape)
        quieter = noise_of_image(left[main], False)
        if not quieter < QUIETER * noise:
            break
        noise = quieter
        readings.noise2[:] = quieter ** 2
    if why & BAD_FIT and has_second_hill(frame[main], noise):
        why |= TWO_CONTACTS
    snr, fit, beliefs = np.nan, one.fit, one.beliefs
    kind, values, covariance = OTHER, np.full(7, np.nan), np.full((7, 7), np.nan)
    start, end, patch, valid = np.nan, np.nan, np.nan, False
    if one.evidence > -np.inf:
        snr = 20.0 * math.log10(max(fit.model.max(), 1e-300) / noise)
        if not why & ~SKIN_MISMATCH and snr < min_snr:
            why |= LOW_SNR
        valid = not why & ~SKIN_MISMATCH
        if why & (NO_CONTACT | LOW_SNR):
            kind = NONE
        elif not why & (BAD_FIT | TWO_CONTACTS):
            kind = IS_POINT if beliefs.kind == POINT else IS_LINE
    if valid:
        if one.residual.silent or one.residual.loudest > 2.0 * LOUD:
            why |= DEAD_TACTELS
        values, covariance, start, end = reported(
            pad, beliefs.kind, fit.theta, beliefs.ends, one.covariance)
        spread = math.sqrt(fit.theta[WIDTH]) if beliefs.patch else 0.0
        patch = pad.depths[0] * spread * (math.sqrt(5.0) if beliefs.kind == POINT else 2.0)
    return Answer(kind, valid, why, beliefs.kind, beliefs.power, beliefs.patch, beliefs.ends,
                  fit.iterations, one.residual.rms, snr, values, covariance, start, end, patch)
