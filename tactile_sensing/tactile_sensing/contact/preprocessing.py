"""What is done to a frame before anything is fitted to it; all compiled."""

import math

import numpy as np

from tactile_common.kernels import njit
from tactile_sensing.contact.noise import DIRECTIONS, noise_of
from tactile_sensing.half_space.layers import first_pressure_layer, PRESSURE
from tactile_sensing.types.contact import ContactType, Reason

MIN_LIVE = 15  # tactels; three for each parameter of a point
DETECTION = 5.0  # standard deviations
IMPOSSIBLE = 1e12  # Pa; a tactel that reports more, or no number, is not read
SILENT = 3.0  # standard deviations below its floor at which a tactel tells nothing
# Times as many equal readings at the top as just below it, and as of any other number: cut off.
STEEP, FREQUENT = 3, 2
UNLIKELY = 0.01  # that chance makes readings equal which are meant to be
EQUAL = 1e-9  # of the peak
ROUNDING = 3.5  # standard deviations; no count is more, as noise is never less than rounding
LOADED = 0.1  # of the peak

_NONE, _OTHER = int(ContactType.NONE), int(ContactType.OTHER)
_NO_CONTACT, _FEW = int(Reason.NO_CONTACT), int(Reason.FEW_TACTELS)
_BAD_FIT, _UNCALIBRATED = int(Reason.BAD_FIT), int(Reason.UNCALIBRATED)
_SATURATED, _DEAD = int(Reason.SATURATED), int(Reason.DEAD_TACTELS)


@njit(error_model='numpy')
def drop_unusable(image, full_scale, floor, both_signs, censored):
    """
    Set to NaN, in place, what cannot be read: impossible or saturated.

    Marks as censored what is only known to be below the floor (none if that is 0). Returns how
    many are impossible, saturated and censored.
    """
    missing = saturated = below = 0
    for r in range(image.shape[0]):
        for c in range(image.shape[1]):
            value = image[r, c]
            censored[r, c] = False
            if not abs(value) < IMPOSSIBLE:
                image[r, c] = np.nan
                missing += 1
            elif full_scale > 0.0 and (
                    value >= full_scale or (both_signs and value <= -full_scale)):
                image[r, c] = np.nan
                saturated += 1
            elif floor != 0.0 and value <= floor:
                censored[r, c] = True
                below += 1
    return missing, saturated, below


@njit(error_model='numpy')
def _is_exact(image, peak):
    """Whether neighbours below the peak are never equal: neither rounding nor symmetry shows."""
    rows, columns = image.shape
    for dr, dc in DIRECTIONS:
        for r in range(rows - dr):
            for c in range(max(0, -dc), columns - max(0, dc)):
                value = image[r, c]
                if value != 0.0 and value < peak and (
                        abs(value - image[r + dr, c + dc]) < EQUAL * peak):
                    return False
    return True


@njit(error_model='numpy')
def hidden_ceiling(image, noise):
    """
    Full scale that nobody told, at which readings show to be cut off; infinite: they do not.

    Then the highest are equal, which noise never makes them. Where readings are rounded, they are
    more than rounding makes equal elsewhere, and than those that are lower by it or by noise.
    """
    peak, count = DETECTION * noise, 0
    for value in image.flat:
        if value > peak:  # false for NaN
            peak, count = value, 0
        count += value == peak
    if count < 2:
        return np.inf
    if _is_exact(image, peak):
        return peak
    lower = image.ravel()[((image > LOADED * peak) & (image < peak)).ravel()]
    if lower.size < count or count <= STEEP * (lower > peak - ROUNDING * noise).sum():
        return np.inf
    lower.sort()
    same, most, rounded = 1, 1, peak - lower[-1]
    for i in range(1, lower.size):
        gap = lower[i] - lower[i - 1]
        if gap > EQUAL * peak:
            same, rounded = 1, min(rounded, gap)
        else:
            same += 1
            most = max(most, same)
    chance = (0.4 * rounded / noise) ** (count - 1)  # at most, of so many equal readings
    return peak if count > FREQUENT * most or count > most and chance < UNLIKELY else np.inf


@njit(error_model='numpy')
def mean_below(z):
    """How far the mean of a standard normal variable known to be below z is below zero."""
    if z < -25.0:  # where the distribution's value underflows
        return -z - 1.0 / z
    return math.exp(-0.5 * z * z) / (1.2533141373155003 * math.erfc(-0.7071067811865476 * z))


@njit(error_model='numpy')
def fill_censored(stress, model, layers, censored):
    """
    Give censored tactels the mean of what they may have measured under a load, in place.

    That is the step of expectation of a fit of Tobin's model, of which the fit to what it fills
    in is the maximisation. Where they must be below the floor they tell nothing, and become NaN.
    """
    for k in range(layers.size):
        noise, floor = layers[k].noise, layers[k].floor
        if floor == 0.0:
            continue
        for r in range(stress.shape[1]):
            for c in range(stress.shape[2]):
                if censored[k, r, c]:
                    z = (floor - model[k, r, c]) / noise
                    stress[k, r, c] = (
                        np.nan if z > SILENT else model[k, r, c] - noise * mean_below(z))


@njit(error_model='numpy')
def _survey(image, sensor, calibrated, estimate):
    """Moments of the pressure (NaN as zero) into the estimate; live tactels, sum and peak."""
    x, y, area = sensor.x, sensor.y, sensor.pitch_x * sensor.pitch_y
    m0 = mx = my = mxx = myy = mxy = 0.0
    live = 0
    peak = -np.inf
    for r in range(image.shape[0]):
        row = row_x = row_xx = 0.0
        for c in range(image.shape[1]):
            value = image[r, c]
            if value == value:  # not NaN
                live += 1
                peak = max(peak, value)
                row += value
                row_x += value * x[c]
                row_xx += value * x[c] * x[c]
        m0 += row
        mx += row_x
        mxx += row_xx
        my += row * y[r]
        myy += row * y[r] * y[r]
        mxy += row_x * y[r]
    if live == 0 and calibrated:
        area = np.nan
    estimate.m0, estimate.mx, estimate.my = m0 * area, mx * area, my * area
    estimate.mxx, estimate.myy, estimate.mxy = mxx * area, myy * area, mxy * area
    return live, m0, peak


@njit(error_model='numpy')
def preprocess(stress, sensor, layers, reasons, saturated, calibrated, censored, estimate):
    """
    Make a frame ready, in place, and set its layers' noise.

    What is only known to be below a floor is marked, and as long as no load is known has the mean
    that noise has there. Its moments, type and reasons go into the estimate; returns whether
    anything is to be fitted. For the parameters see `pipeline.estimate_frames`.
    """
    missing, at_full_scale = 0, 0
    for k in range(layers.size):
        layer = layers[k]
        gone, full, below = drop_unusable(
            stress[k], layer.full_scale, layer.floor, layer.component != PRESSURE, censored[k])
        layer.noise = noise_of(stress[k], layer.given_noise, layer.floor, censored[k])
        if layer.component == PRESSURE:
            ceiling = hidden_ceiling(stress[k], layer.noise)
            for r in range(stress.shape[1]) if ceiling < np.inf else range(0):
                for c in range(stress.shape[2]):
                    if stress[k, r, c] >= ceiling:
                        stress[k, r, c] = np.nan
                        full += 1
        # Noise that is only seen in the picture may be its pattern: then what is read counts.
        if below > 0 and layer.given_noise > 0.0:
            mean = -layer.noise * mean_below(layer.floor / layer.noise)
            for r in range(stress.shape[1]):
                for c in range(stress.shape[2]):
                    if censored[k, r, c]:
                        stress[k, r, c] = mean
        missing += gone
        at_full_scale += full
    if at_full_scale > 0 or (missing > 0 and saturated > 0):
        reasons |= _SATURATED
    if missing > saturated:
        reasons |= _DEAD
    main = first_pressure_layer(layers)
    live, total, highest = _survey(stress[main], sensor, calibrated, estimate)
    noise = layers[main].noise
    kind, missed = _NONE, 0
    if not calibrated:
        reasons |= _UNCALIBRATED
    if live < MIN_LIVE:
        missed = _FEW
    elif highest < DETECTION * noise and total < DETECTION * noise * np.sqrt(live):
        missed = _NO_CONTACT
        if at_full_scale + saturated > 0:  # the loaded tactels are the ones that are missing
            kind, missed = _OTHER, _BAD_FIT
    estimate.type, estimate.reasons = kind, reasons | missed
    return missed == 0
