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
import math
from typing import NamedTuple

import numpy as np

from tactile_common.kernels import FAST, njit
from tactile_sensing.contact.beliefs import beliefs_of, HALF_SPACE
from tactile_sensing.contact.fit import Beliefs, Readings
from tactile_sensing.contact.misfit import fit_and_judge, LOUD, Misfit
from tactile_sensing.contact.refusal import DOUBT, EXTRA, is_nothing, refusal
from tactile_sensing.skin.bumps import (
    BEGIN,
    END,
    EXPONENT,
    LINE,
    Pad,
    POINT,
    Q0,
    Q1,
    WIDTH,
)
from tactile_sensing.skin.kernel import MAX_VARIANCE
from tactile_sensing.types.contact import Reason

EXCESS = 3.0  # standard deviations of chi-square that a sharp load may leave
SHOWN = 0.9  # probability of a patch that is then fitted
MUCH = 15.0  # standard deviations of one tactel that neither a patch nor drift explains
WRONG_SKIN = 0.05  # share of the pressure that is left beyond noise: more is a wrong skin
EXTRAPOLATED = 0.25  # share of the pressure above full scale: its shape is not seen
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


def fitted(image, kind, power, guess, *, ends=False, robust=True, patch=False, base=False,
           start=None):
    """Fit one hypothesis, from a first guess or from the parameters of a simpler one."""
    pad = image.pad
    beliefs = beliefs_of(pad.half_x, pad.half_y, pad.pitch, pad.depths.size, image.scatter, kind,
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
    if patch:
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
    found = [one for one in (fitted(image, kind, power, guess) for kind in kinds)
             if one.evidence > -math.inf]
    if not found:
        return None
    best = _best(found)
    if best.misfit.hidden > SHOWN:
        best = _best([best, fitted(image, best.kind, power, guess, patch=True,
                                   start=best.theta)])
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
        if pad.depths.size > 1 or not (why or wrong_skin) or is_nothing(image, best):
            return best, why
        mismatch = Reason.SKIN_MISMATCH
    free = _search_robust(image, guess, kinds, True)
    return free, (refusal(image, free) if free else Reason.BAD_FIT) | mismatch
