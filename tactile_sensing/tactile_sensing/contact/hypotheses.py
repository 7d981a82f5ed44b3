"""
Which load explains an image: the least first, and more only where that leaves something.

1. *Sharp*: a point or a line on the known skin, Gaussian noise. Most images of a calibrated skin
   end here.
2. *Robust*: the same with outliers, scatter and baseline, and with a patch or ends where the
   evidence is for them.
3. *Free*: width and exponent of the bump are fitted too: place and direction on any skin.

An image that the best of these does not explain is refused.
"""

from dataclasses import dataclass
from functools import lru_cache
import math
from typing import NamedTuple

import numpy as np

from tactile_common.kernels import FAST, njit
from tactile_sensing.contact.fit import Beliefs, NU, Readings
from tactile_sensing.contact.misfit import fit_and_judge, LOUD, Misfit
from tactile_sensing.skin.bumps import (
    BASE,
    BEGIN,
    chord,
    END,
    EXPONENT,
    FORCE,
    LINE,
    loaded_chord,
    Pad,
    POINT,
    Q0,
    Q1,
    SHEAR_U,
    SHEAR_V,
    WIDTH,
)
from tactile_sensing.skin.kernel import MAX_VARIANCE
from tactile_sensing.types.contact import Reason

HALF_SPACE = 2.5  # exponent of a point's bump on a half-space
SHEAR = 0.3, 0.15  # standard deviation of a component of Q / P, on a known skin and on any other
# Scatter of the gains where it is not known: sharp tier, robust tier, free tier.
SCATTER = 0.05, 0.1, 0.05
UNSEEN = 0.0, 0.01  # d that a fit has absorbed: of a sharp load on a known skin, of any other
EXCESS = 3.0  # standard deviations of chi-square that a sharp load may leave
DOUBT = 3.0  # standard deviations of what a sharp load leaves that call for more
SHOWN = 0.9  # probability of a patch that is then fitted
MUCH = 15.0  # standard deviations of one tactel that neither a patch nor drift explains
RIVAL = 50.0  # log evidence by which no patch makes up for the wrong kind
EXTRA = 3.0  # log evidence that an extra must bring
WRONG_SKIN = 0.05  # share of the pressure that is left beyond noise: more is a wrong skin
# Significance of d, and the share of the pressure that may then be left, else it is refused.
WRONG = (6.0, 0.12), (3.0, 0.15), (2.0, 0.2), (-math.inf, 0.5)
NOISY = 0.1  # share of tactels that are off by more than noise: no few of them are broken
# Standard deviations of one tactel: of all, more is no drift; of two, more is no noise.
DRIFTED, PLAIN = 20.0, 8.0
EXTRAPOLATED = 0.25  # share of the pressure above full scale: its shape is not seen
HILL, SADDLE, RISE = 0.2, 0.3, 6.0  # a second hill: of the first; of itself; of the noise
SECOND = 7.0  # standard deviations of a second load, and
APART = 0.05  # its pressure away from the first, relative to its peak, and
EXTRA_LOAD = 0.4  # its pressure, relative to that of the first
SHORTEST = 3.0  # pitches of a line on the pad
DISTINCT, ROUND = 4.0, 1.2  # half length over half width of what is no point, and no line
STRIPS = 3  # rows or columns: fewer see a point at most
LONG = 2.0  # half length over half width of what is tried as a line first


class Image(NamedTuple):
    """One image of one sensor."""

    pad: Pad
    readings: Readings
    scatter: float = 0.0  # of the gains; 0: not known


@dataclass
class Hypothesis:
    """One kind of load, fitted; `fit_and_judge` describes what comes from it."""

    kind: int
    power: bool  # whether the skin is not known
    has_ends: bool  # whether a line begins and ends
    has_patch: bool  # whether the load on a known skin is blunt
    beliefs: Beliefs
    theta: np.ndarray
    model: np.ndarray
    covariance: np.ndarray
    evidence: float
    scatter: float
    iterations: int
    misfit: Misfit


@njit(cache=True, error_model='numpy', fastmath=FAST)
def first_guess(pad, reading):
    """
    Where to start: centre x, y, direction across, half width and half length of the load [m].

    From the second moments of the tactels above .3 of the peak; no tactel alone is a peak.
    """
    rows, columns = pad.y.size, pad.x.size
    smooth, peak = np.zeros((rows, columns)), 0.0
    for r in range(rows):
        for c in range(columns):
            here, around = reading[r * columns + c], 0.0
            for i in range(max(r - 1, 0), min(r + 2, rows)):
                for j in range(max(c - 1, 0), min(c + 2, columns)):
                    if (i != r or j != c) and reading[i * columns + j] > around:
                        around = reading[i * columns + j]
            if here > 0.0:
                smooth[r, c] = min(here, around)
                peak = max(peak, smooth[r, c])
    total = mx = my = mxx = myy = mxy = 0.0
    for r in range(rows):
        for c in range(columns):
            weight = smooth[r, c] - 0.3 * peak
            if weight > 0.0:
                x, y = pad.x[c], pad.y[r]
                total += weight
                mx += weight * x
                my += weight * y
                mxx += weight * x * x
                myy += weight * y * y
                mxy += weight * x * y
    if not total > 0.0:
        return 0.0, 0.0, 0.0, pad.pitch, pad.pitch
    x, y = mx / total, my / total
    xx, yy, xy = mxx / total - x * x, myy / total - y * y, mxy / total - x * y
    mean, half = 0.5 * (xx + yy), math.hypot(0.5 * (xx - yy), xy)
    across = 0.5 * math.atan2(-2.0 * xy, yy - xx)
    return (x, y, across, max(math.sqrt(max(mean - half, 0.0)), 0.4 * pad.pitch),
            math.sqrt(max(mean + half, 0.25 * pad.pitch * pad.pitch)))


@njit(cache=True, error_model='numpy')
def _nothing(reading, noise2):
    """Evidence that there is nothing but a baseline."""
    finite = np.isfinite(reading)
    base, total, information = np.median(reading[finite]), 0.0, 0.0
    for t in range(reading.size):
        if finite[t]:
            u = (reading[t] - base) ** 2 / noise2[t]
            total += (NU + 1.0) * math.log1p(u / NU) + math.log(noise2[t])
            information += 1.0 / noise2[t]
    return -0.5 * total - 0.5 * math.log(information)


@njit(cache=True, error_model='numpy')
def has_second_hill(image, noise):
    """
    Whether the readings (rows, columns) have a second hill, with a saddle before the first.

    From the highest tactel down, each joins its higher neighbours; where two hills meet, the
    lower one counts if it rises far enough from there.
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


@lru_cache(maxsize=256)
def _beliefs(half_x, half_y, pitch, layers, scatter, kind, power, ends, robust, patch, base):
    """What is believed of a load of a kind before the image is seen."""
    count = BASE + layers
    mean, information = np.zeros(count), np.zeros(count)
    low, high = np.full(count, -np.inf), np.full(count, np.inf)
    step, active = np.ones(count), np.zeros(count, bool)
    active[[Q0, Q1, FORCE, SHEAR_U]] = True
    active[SHEAR_V] = kind == POINT
    reach = math.hypot(half_x, half_y)
    information[[Q0, Q1]] = reach ** -2, (reach if kind == POINT else 2.0 * math.pi) ** -2
    step[[Q0, Q1, BEGIN, END]] = 0.6 * pitch
    flat = 2
    if kind == POINT:
        low[[Q0, Q1]] = -1.25 * half_x, -1.25 * half_y
        high[[Q0, Q1]] = 1.25 * half_x, 1.25 * half_y
        volume = math.log(4.0 * half_x * half_y)
    else:
        low[Q0], high[Q0] = -1.25 * reach, 1.25 * reach
        step[Q1] = 0.15
        volume = math.log(2.0 * math.pi * (half_x + half_y))
    if ends:
        active[[BEGIN, END]] = True
        low[[BEGIN, END]], high[[BEGIN, END]] = -1.5 * reach, 1.5 * reach
        volume += 2.0 * math.log(2.0 * reach)
        flat += 2
    if power:
        active[[WIDTH, EXPONENT]] = True
        mean[WIDTH], information[WIDTH] = math.log(1.2 * pitch), 0.8 ** -2
        mean[EXPONENT], information[EXPONENT] = math.log(HALF_SPACE), 0.5 ** -2
        low[WIDTH], high[WIDTH] = math.log(0.3 * pitch), math.log(widest(half_x, half_y, pitch))
        low[EXPONENT], high[EXPONENT] = math.log(1.7), math.log(12.0)
        step[WIDTH], step[EXPONENT] = 0.25, 0.2
    elif patch:
        active[WIDTH], low[WIDTH], high[WIDTH], step[WIDTH] = True, 0.0, MAX_VARIANCE, 0.1
        volume += math.log(MAX_VARIANCE)
        flat += 1
    active[BASE:] = base
    gain, spread = (scatter, 0.5) if scatter > 0.0 else (SCATTER[robust + power], 1.0)
    return Beliefs(mean, information, low, high, step, np.flatnonzero(active),
                   volume - 0.5 * math.log(2.0 * math.pi) * flat, SHEAR[power], scatter,
                   gain, spread, UNSEEN[power or patch], robust)


def widest(half_x, half_y, pitch):
    """Largest half width of a bump that shows to be one [m]."""
    sides = [half for half in (half_x, half_y) if half > pitch]
    return 0.45 * max(min(sides, default=pitch), 1.5 * pitch)


def fitted(image, kind, power, guess, *, ends=False, robust=True, patch=False, base=False,
           start=None):
    """Fit one hypothesis, from a first guess or from the parameters of a simpler one."""
    pad = image.pad
    beliefs = _beliefs(pad.half_x, pad.half_y, pad.pitch, pad.depths.size, image.scatter, kind,
                       power, ends, robust, patch, base or robust)
    cx, cy, across, width, length = guess
    begin = np.zeros(beliefs.mean.size)
    if start is not None:
        begin[:] = start
    else:
        if kind == POINT:
            begin[Q0], begin[Q1] = cx, cy
        else:
            begin[Q0] = cx * math.cos(across) + cy * math.sin(across)
            begin[Q1] = across
        if power:
            begin[WIDTH], begin[EXPONENT] = math.log(width), math.log(HALF_SPACE)
    if ends and not patch:
        middle = cy * math.cos(begin[Q1]) - cx * math.sin(begin[Q1])
        begin[BEGIN], begin[END] = middle - 1.6 * length, middle + 1.6 * length
    if patch and not begin[WIDTH]:
        begin[WIDTH] = 0.1
    theta, model, covariance, evidence, scatter, iterations, misfit = fit_and_judge(
        kind, power, pad, image.readings, begin, start is not None and (patch or not ends),
        beliefs)
    return Hypothesis(kind, power, ends, patch, beliefs, theta, model, covariance,
                      evidence - EXTRA * (ends + patch), scatter, iterations, misfit)


def _unexplained(one):
    """Whether a load leaves more than noise and the usual scatter."""
    return (one.misfit.significance > 2.0 or one.misfit.second > 5.0
            or one.scatter > 2.0 * one.beliefs.gain or one.misfit.hidden > SHOWN)


def _best(hypotheses):
    return max(hypotheses, key=lambda one: one.evidence)


def _search_sharp(image, guess, kinds):
    """Find a sharp load that explains an image of a known skin to within noise, or None."""
    for kind in kinds:
        sharp = fitted(image, kind, False, guess, robust=False)
        if _is_noise(sharp):
            return sharp
        if sharp.evidence == -math.inf or sharp.misfit.loudest > MUCH:
            continue
        for extra in ('patch', 'base'):
            one = fitted(image, kind, False, guess, robust=False, start=sharp.theta,
                         **{extra: True})
            if _is_noise(one):
                return one
    return None


def _is_noise(one):
    """Whether what a load leaves is noise."""
    misfit = one.misfit
    return (one.evidence > -math.inf and misfit.loudest < LOUD and misfit.excess < EXCESS
            and misfit.significance < DOUBT and misfit.extrapolated < EXTRAPOLATED
            and misfit.hidden < SHOWN)


def _search_robust(image, guess, kinds, power):
    """Find the load of the greatest evidence, with whatever nuisances it needs."""
    found = []
    for kind in kinds:
        one = fitted(image, kind, power, guess)
        if one.evidence == -math.inf:
            continue
        found.append(one)
    if not found:
        return None
    best = _best(found)
    for one in found if _unexplained(best) else ():
        if one.misfit.hidden > SHOWN and one.evidence > best.evidence - RIVAL:
            best = _best([best, fitted(image, one.kind, power, guess, patch=True,
                                       start=one.theta)])
    line = next((one for one in found if one.kind == LINE), None)
    if not line or not _unexplained(best):
        return best
    best = _best([best, fitted(image, LINE, power, guess, ends=True, start=line.theta)])
    if best.has_ends and best.misfit.hidden > SHOWN:
        best = _best([best, fitted(image, LINE, power, guess, ends=True, patch=True,
                                   start=best.theta)])
    return best


def search(image, kinds=(POINT, LINE)):
    """
    Find the least load that explains an image.

    Returns the Hypothesis and why it is no answer, Reason(0) if it is one; with the answer of a
    free bump on a known skin comes SKIN_MISMATCH.
    """
    pad = image.pad
    guess = first_guess(pad, image.readings.value[:pad.x.size * pad.y.size])
    if min(pad.x.size, pad.y.size) < STRIPS:  # no direction is seen
        kinds = (POINT,)
    elif len(kinds) > 1 and guess[4] > LONG * guess[3]:
        kinds = (LINE,) if guess[4] > DISTINCT * guess[3] else (LINE, POINT)
    elif len(kinds) > 1 and guess[4] < ROUND * guess[3]:
        kinds = (POINT,)
    mismatch = Reason(0)
    if pad.depths[0] > 0.0:  # the skin is known
        sharp = _search_sharp(image, guess, kinds)
        if sharp is not None:
            return sharp, refusal(image, sharp)
        best = _search_robust(image, guess, kinds, False)
        if best is None:
            return None, Reason.BAD_FIT
        why, misfit = refusal(image, best), best.misfit
        wrong_skin = (misfit.significance > DOUBT and misfit.left > WRONG_SKIN
                      or misfit.extrapolated > EXTRAPOLATED
                      or best.has_patch and best.theta[WIDTH] >= MAX_VARIANCE)
        if pad.depths.size > 1 or not (why or wrong_skin) or _is_nothing(image, best):
            return best, why
        mismatch = Reason.SKIN_MISMATCH
    free = _search_robust(image, guess, kinds, True)
    return free, (refusal(image, free) if free else Reason.BAD_FIT) | mismatch


def _is_nothing(image, one):
    """Whether a baseline alone explains an image as well as a load."""
    return _nothing(image.readings.value, image.readings.noise2) > one.evidence - EXTRA


def _presses(image):
    """Whether something plainly presses: a plate, or what no load explains on two neighbours."""
    rows, columns = image.pad.y.size, image.pad.x.size
    noise = math.sqrt(image.readings.noise2[0])
    reading = image.readings.value[:rows * columns].reshape(rows, columns) / noise
    base = np.nanmedian(reading)
    high = reading - base > PLAIN
    return abs(base) > DRIFTED or (high[1:] & high[:-1]).any() or (
        high[:, 1:] & high[:, :-1]).any()


def refusal(image, one):
    """Why a hypothesis is no answer; Reason(0) if it is one."""
    theta, misfit, pad = one.theta, one.misfit, image.pad
    if one.beliefs.robust and _is_nothing(image, one):
        return Reason.BAD_FIT if _presses(image) else Reason.NO_CONTACT
    if misfit.loud > NOISY:
        return Reason.BAD_FIT
    if misfit.second > SECOND or misfit.extra > EXTRA_LOAD or misfit.apart > APART:
        return Reason.BAD_FIT
    allowed = next(share for significance, share in WRONG if misfit.significance > significance)
    if misfit.left > allowed or (misfit.significance > DOUBT and one.power
                                 and theta[EXPONENT] < math.log(1.71)):
        return Reason.BAD_FIT
    if one.power and theta[WIDTH] > math.log(0.98 * widest(pad.half_x, pad.half_y, pad.pitch)):
        return Reason.BAD_FIT
    if one.kind == POINT:
        off = abs(theta[Q0]) > pad.half_x or abs(theta[Q1]) > pad.half_y
    else:
        first, last, _ = loaded_chord(pad, theta, one.has_ends)
        low, high = chord(pad, theta[Q0], theta[Q1])
        off = high - low < SHORTEST * pad.pitch
        if not off and last - first < SHORTEST * pad.pitch:  # rather a blob
            return Reason.BAD_FIT
    return Reason.OFF_PAD if off else Reason(0)
