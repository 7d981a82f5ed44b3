"""Reasons to refuse the load that explains an image best; compiled."""

import math

import numpy as np

from tactile_common.kernels import njit
from tactile_sensing.contact.errors import cost_of_error
from tactile_sensing.contact.fit import APART
from tactile_sensing.contact.records import Hypothesis, Readings
from tactile_sensing.skin.bumps import chord, LINE, loaded_chord, P, Pad, POINT
from tactile_sensing.types.contact import Reason

BAD_FIT, NO_CONTACT, OFF_PAD = int(Reason.BAD_FIT), int(Reason.NO_CONTACT), int(Reason.OFF_PAD)
TWO_CONTACTS, DEAD_TACTELS = int(Reason.TWO_CONTACTS), int(Reason.DEAD_TACTELS)
DOUBT = 3.0  # a sharp load with a higher significance of d is not sufficient
# Refused: significance of d above the first value and residual share above the second. Of a line,
# only the residual across it counts here: its force may vary along it.
WRONG = (6.0, 0.12), (3.0, 0.15), (2.0, 0.2)
SHAPED = 0.5  # factor of these shares for elongated or blunt bumps: they fit tilted corners too
MOST = 0.5  # a larger residual share is refused
NOISY = 0.1  # a larger share of tactels beyond noise is not explained by broken tactels
# Larger readings, in standard deviations of a tactel: of all tactels, no drift; of two, no noise.
DRIFTED, PLAIN = 20.0, 8.0
# Height of a second hill: share of the first. Its rise: share of its height, multiple of noise.
HILL, SADDLE, RISE = 0.2, 0.3, 6.0
SHORTEST = 3.0  # shortest line on the pad [pitches]
ROUNDING = 1e-9  # a parameter that is nearer to its bound is at it


@njit(error_model='numpy')
def has_second_hill(image: np.ndarray, noise: float) -> bool:
    """
    Return whether the readings (rows, columns) have two hills with a saddle between them.

    Tactels are visited from the highest down; each joins the hill of its higher neighbours. Where
    two hills meet, the lower one counts if it rises far enough above this saddle.
    """
    rows, columns = image.shape
    flat = np.where(np.isfinite(image.ravel()), image.ravel(), -np.inf)
    order = np.argsort(-flat)
    hill = np.full(flat.size, -1)  # index of its highest tactel
    for t in order:
        if not flat[t] > 0.0:
            break
        r, c = t // columns, t % columns
        hill[t] = t
        for i in range(max(r - 1, 0), min(r + 2, rows)):
            for j in range(max(c - 1, 0), min(c + 2, columns)):
                other = hill[i * columns + j]
                if other < 0 or other == hill[t]:
                    continue
                top, low = max(flat[hill[t]], flat[other]), min(flat[hill[t]], flat[other])
                rise = low - flat[t]
                if low > HILL * top and rise > max(SADDLE * low, RISE * noise):
                    return True
                higher = hill[t] if flat[hill[t]] >= flat[other] else other
                lower = hill[t] if higher == other else other
                for k in range(flat.size):
                    if hill[k] == lower:
                        hill[k] = higher
    return False


@njit(error_model='numpy')
def is_nothing(readings: Readings, one: Hypothesis) -> bool:
    """
    Return whether a baseline and at most one hot tactel explain an image as well as a load.

    A hot tactel is as likely as a load, and may be any tactel. Like the force of a load, its
    reading and the baseline are uniform up to the highest reading, which is positive. It may be
    hot under the load too; if the load has no baseline, there is none.
    """
    fit, drifts = one.fit, one.beliefs.active[-1] >= P.BASE
    middle, peak = drifts * np.nanmedian(readings.value), np.nanmax(readings.value)
    hot = (0.375 * peak * readings.value.size) ** 2  # 3/8: density of Student t at its middle
    logs, product, gain, information = 0.0, 1.0, 1.0, 0.0
    for t in range(readings.value.size):
        if readings.value[t] > readings.floor[t]:  # false for NaN
            noise2, loaded = readings.noise2[t], 1.0
            cost = cost_of_error(readings.value[t] - middle, noise2)
            if fit.kept[t]:
                loaded = max(cost_of_error(fit.error[t], fit.variance[t]), hot)
            else:  # saturated: a probability, no density
                cost /= noise2
            product, gain = product * cost, max(gain, cost / loaded)
            information += 1.0 / noise2
            if not 1e-100 < product < 1e100:  # saves logarithms: one for many tactels
                logs, product = logs + math.log(product), 1.0
    logs += math.log(product) + drifts * math.log(information * peak ** 2) - math.log(gain)
    return -0.5 * logs > fit.evidence


@njit(error_model='numpy')
def _without_load(pad: Pad, readings: Readings) -> int:
    """
    Return the reason to refuse an image that no load explains better than a baseline.

    Something clearly presses if it shows on all tactels, or on two neighbours.
    """
    rows, columns = pad.y.size, pad.x.size
    reading = readings.value[:rows * columns] / math.sqrt(readings.noise2[0])
    base = np.nanmedian(reading)
    high = (reading - base > PLAIN).reshape(rows, columns)
    if abs(base) > DRIFTED or (high[1:] & high[:-1]).any() or (high[:, 1:] & high[:, :-1]).any():
        return BAD_FIT
    return NO_CONTACT | DEAD_TACTELS * high.any()


@njit(error_model='numpy')
def _bad_fit(pad: Pad, readings: Readings, one: Hypothesis) -> int:
    """
    Return BAD_FIT for a rival or too large a residual; TWO_CONTACTS too if there are two hills.

    A bump of free shape that is as wide or as blunt as its bound may be anything broad: its
    residual counts as significant.
    """
    significance = one.misfit.significance
    theta, bound = one.fit.theta, one.beliefs.high - ROUNDING
    if one.beliefs.power and (theta[P.WIDTH] > bound[P.WIDTH] or theta[P.BLUNT] > bound[P.BLUNT]):
        significance = np.inf
    factor = SHAPED if one.beliefs.shaped else 1.0
    left = one.residual.left
    across = math.sqrt(max(left ** 2 - one.misfit.along ** 2, 0.0))
    wrong = one.beliefs.kind > LINE or one.misfit.apart > APART
    wrong |= one.residual.loud > NOISY or left > MOST
    for least, share in WRONG:
        wrong |= significance > least and across > factor * share
    if not wrong:
        return 0
    size = pad.x.size * pad.y.size
    image = readings.value[:size].reshape(pad.y.size, pad.x.size)
    return BAD_FIT | TWO_CONTACTS * has_second_hill(image, math.sqrt(readings.noise2[0]))


@njit(error_model='numpy')
def refusal(pad: Pad, readings: Readings, one: Hypothesis) -> int:
    """Return the reason to refuse a hypothesis; 0 if there is none."""
    theta = one.fit.theta
    if one.fit.evidence == -np.inf:
        return BAD_FIT
    if is_nothing(readings, one):
        return _without_load(pad, readings)
    wrong = _bad_fit(pad, readings, one)
    if wrong:
        return wrong
    if one.beliefs.kind == POINT:
        return OFF_PAD * (abs(theta[P.Q0]) > pad.half_x or abs(theta[P.Q1]) > pad.half_y)
    low, high = chord(pad.half_x, pad.half_y, theta[P.Q0], theta[P.Q1])
    if high - low < SHORTEST * pad.pitch:
        return OFF_PAD
    return BAD_FIT * too_short(pad, theta, one.beliefs.ends)


@njit(error_model='numpy')
def too_short(pad: Pad, theta: np.ndarray, ends: bool) -> bool:
    """Return whether a load on the pad is too short to be a line."""
    first, last = loaded_chord(pad, theta, ends)
    return last - first < SHORTEST * pad.pitch
