"""
Search for the simplest load that explains an image; compiled.

The next tier runs only if the one before leaves a residual:

1. *Sharp*: a point or a line on the known skin, Gaussian noise. Most images of a calibrated skin
   end here.
2. *Robust*: the same with outliers, scatter and baseline; with a patch or ends if the evidence
   supports them. Two points are a rival: if they are likelier, the image is refused.
3. *Free*: width and exponent of the bump are fitted too. Place and direction need no skin. A
   plate is a rival too.
4. *Elongated*: the bump of a point may also be longer in one direction, as under a finger.
5. *Blunt*: the bump of a point or a line may also be flat at its top, as under a broad object.

If the best of them does not explain the image, the image is refused.
"""

import math
from typing import NamedTuple

import numpy as np

from tactile_common.kernels import njit
from tactile_sensing.contact.fit import (
    APART,
    BASELINE,
    beliefs_of,
    BLUNTED,
    ELONGATED,
    ENDS,
    fit_load,
    HALF_SPACE,
    PATCH,
    POWER,
    ROBUST,
    TAPERED,
    unfitted,
)
from tactile_sensing.contact.misfit import judge, LOUD, residual_of, shows_taper
from tactile_sensing.contact.records import Beliefs, Hypothesis, Misfit, Readings
from tactile_sensing.contact.refusal import BAD_FIT, DOUBT, is_nothing, OFF_PAD, refusal, too_short
from tactile_sensing.image import moments_of, without_spikes
from tactile_sensing.skin.bumps import LINE, P, Pad, PLATE, POINT, TWO
from tactile_sensing.skin.kernel import MAX_VARIANCE
from tactile_sensing.types.contact import Reason

EXCESS = 3.0  # largest excess of chi-square for a sharp load [standard deviations]
SHOWN = 0.5  # a patch of higher probability is fitted
MUCH = 15.0  # a larger error of a tactel is neither a patch nor drift [standard deviations]
LACK = 0.05  # a larger residual beyond noise is an error of the model [share of the pressure]
EXTRAPOLATED = 0.25  # with a larger share of the pressure above full scale the shape is unknown
STRIPS = 3  # rows or columns; fewer show no direction
FIRST_PATCH = 0.1  # start value of the variance of a patch [depths^2]
LONG = 2.0  # half length over half width above which a line is tried first
SKIN_MISMATCH, FEW_TACTELS = int(Reason.SKIN_MISMATCH), int(Reason.FEW_TACTELS)


class Guess(NamedTuple):
    """Start values of a fit."""

    x: float  # centre [m]
    y: float
    across: float  # direction across the load [rad]
    width: float  # half width [m]
    length: float  # half length [m]


@njit(error_model='numpy')
def first_guess(pad: Pad, reading: np.ndarray) -> Guess:
    """Guess the load from the second moments of the tactels above 0.3 of the peak."""
    rows, columns = pad.y.size, pad.x.size
    smooth = without_spikes(reading[:rows * columns].copy().reshape(rows, columns))
    total, mx, my, mxx, myy, mxy = moments_of(smooth - 0.3 * smooth.max(), pad.x, pad.y, 0.0)
    if not total > 0.0:
        return Guess(0.0, 0.0, 0.0, pad.pitch, pad.pitch)
    x, y = mx / total, my / total
    xx, yy, xy = mxx / total - x * x, myy / total - y * y, mxy / total - x * y
    mean, half = 0.5 * (xx + yy), math.hypot(0.5 * (xx - yy), xy)
    return Guess(x, y, 0.5 * math.atan2(-2.0 * xy, yy - xx),
                 max(math.sqrt(max(mean - half, 0.0)), 0.4 * pad.pitch),
                 math.sqrt(max(mean + half, 0.25 * pad.pitch * pad.pitch)))


@njit(error_model='numpy')
def _cold_start(pad: Pad, kind: int, power: bool, guess: Guess) -> np.ndarray:
    """Return the parameters (parameters,) of a first guess; forces are 0."""
    theta, width = np.zeros(P.BASE + pad.depths.size), guess.width
    if kind == POINT:
        theta[P.Q0], theta[P.Q1] = guess.x, guess.y
    elif kind == TWO:
        x, y = -math.sin(guess.across) * guess.length, math.cos(guess.across) * guess.length
        theta[P.Q0], theta[P.Q1], theta[P.Q2], theta[P.Q3], theta[P.SHARE] = (
            guess.x - x, guess.y - y, guess.x + x, guess.y + y, 0.5)
    elif kind == PLATE:
        yaw, size, other = guess.across, guess.width, guess.length
        u = guess.x * math.cos(yaw) + guess.y * math.sin(yaw)
        v = guess.y * math.cos(yaw) - guess.x * math.sin(yaw)
        while u < 0.0 or v < 0.0:  # the load is inside: turn by a right angle
            yaw, size, other, u, v = yaw + 0.5 * math.pi, other, size, v, -u
        # A uniform load begins 3^(1/2) standard deviations before its middle.
        theta[P.Q0], theta[P.Q1] = u - math.sqrt(3.0) * size, yaw
        theta[P.BEGIN], theta[P.SHARE], width = v - math.sqrt(3.0) * other, 0.5, pad.pitch
    else:
        cos, sin = math.cos(guess.across), math.sin(guess.across)
        theta[P.Q0], theta[P.Q1] = guess.x * cos + guess.y * sin, guess.across
        middle = guess.y * cos - guess.x * sin
        theta[P.BEGIN], theta[P.END] = middle - 1.6 * guess.length, middle + 1.6 * guess.length
    if power:
        theta[P.WIDTH], theta[P.EXPONENT] = math.log(width), math.log(HALF_SPACE)
    return theta


# Functions that call a fit are inlined: otherwise numba optimises the fit again for each caller.
# For the same reason a tier calls fit and `judge` at one place, and options are no literals.
@njit(error_model='numpy', inline='always')
def _fitted(pad: Pad, readings: Readings, scatter: float, kind: int, options: int,
            theta: np.ndarray) -> Hypothesis:
    """
    Fit one hypothesis; `_judged` adds its misfit and covariance.

    A line whose residual shows a taper is fitted again with it, and kept if it is likelier.
    """
    beliefs = beliefs_of(pad, scatter, kind, options)
    fit = unfitted(theta, readings.noise2, beliefs.active.size)
    for option in (0, TAPERED):
        if option and (kind != LINE or not shows_taper(fit)):
            break
        others = beliefs_of(pad, scatter, kind, options + option)
        other = fit_load(pad, readings, others, fit.theta)
        if not option or other.evidence > fit.evidence:
            beliefs, fit = others, other
    return Hypothesis(beliefs, fit, residual_of(fit, readings), Misfit(0.0, 0.0, 0.0, 0.0),
                      np.zeros((0, 0)))


@njit(error_model='numpy', inline='always')
def _judged(pad: Pad, readings: Readings, one: Hypothesis) -> Hypothesis:
    """Return the hypothesis with its misfit and covariance."""
    misfit, covariance = judge(pad, one.fit, readings, one.beliefs)
    return Hypothesis(one.beliefs, one.fit, one.residual, misfit, covariance)


@njit(error_model='numpy')
def _is_noise(one: Hypothesis) -> bool:
    """Return whether the residual of a load is no larger than noise."""
    left = one.residual
    return (one.fit.evidence > -np.inf and left.loudest < LOUD and left.excess < EXCESS
            and left.extrapolated < EXTRAPOLATED)


@njit(error_model='numpy')
def _nothing(readings: Readings, beliefs: Beliefs) -> Hypothesis:
    """Return a hypothesis without a fit."""
    fit = unfitted(np.zeros(beliefs.mean.size), readings.noise2, beliefs.active.size)
    return Hypothesis(beliefs, fit, residual_of(fit, readings), Misfit(0.0, 0.0, 0.0, 0.0),
                      np.zeros((0, 0)))


@njit(error_model='numpy')
def _other_skin(one: Hypothesis) -> bool:
    """Return whether the residual of a load on the known skin indicates another skin."""
    left = one.residual
    return (one.misfit.significance > DOUBT and left.left > LACK
            or left.extrapolated > EXTRAPOLATED)


@njit(error_model='numpy', inline='always')
def _search_sharp(pad: Pad, readings: Readings, scatter: float, guess: Guess,
                  kinds: np.ndarray) -> tuple[Hypothesis, bool]:
    """Fit sharp loads on the known skin; return the last, and whether it explains the image."""
    for kind in kinds:
        sharp = _cold_start(pad, kind, False, guess)
        for extra in range(3):  # nothing, a patch, a baseline
            theta = sharp.copy()
            theta[P.WIDTH] = FIRST_PATCH * (extra == 1)
            one = _fitted(pad, readings, scatter, kind,
                          PATCH * (extra == 1) + BASELINE * (extra == 2), theta)
            if _is_noise(one):
                one = _judged(pad, readings, one)
                if one.misfit.significance < DOUBT and one.misfit.hidden < SHOWN:
                    return one, True
            if extra == 0:
                if one.fit.evidence == -np.inf or one.residual.loudest > MUCH:
                    break
                sharp = one.fit.theta
        else:
            break  # the kind is right
    return one, False


@njit(error_model='numpy')
def _unexplained(one: Hypothesis, rival: int) -> bool:
    """
    Return whether a load leaves more than noise and the usual scatter of the gains.

    If a patch is fitted, an error of the model up to `LACK` is accepted. The scatter of the gains
    may hide a point behind a line, and two points behind either, but hardly a line behind a point.
    """
    wrong = one.misfit.significance > 2.0 and (
        one.residual.left > LACK or not one.beliefs.patch)
    scattered = one.fit.scatter > 2.0 * one.beliefs.gain or one.misfit.hidden > SHOWN
    return wrong or scattered and not (one.beliefs.kind == POINT and rival == LINE)


@njit(error_model='numpy', inline='always')
def _search_robust(pad: Pad, readings: Readings, scatter: float, guess: Guess, kinds: np.ndarray,
                   power: bool, shape: int, best: Hypothesis) -> Hypothesis:
    """
    Find the load with the greatest evidence; `best` is returned if no fit works.

    In the steps before 0 a kind is fitted, the second only if the first leaves a residual. Only if
    the evidence asks for it, a patch is added to the better of them (0), and a line with ends is
    fitted (1), except in the last two tiers, which have an option `shape`. If the best leaves a
    residual that does not refuse it, two points are fitted (2), and in the free tiers a plate (3):
    if one of them is likelier, the scatter of the gains hides a load that is neither.
    """
    short = -np.inf  # evidence of a line too short to be one: this is a point
    for step in range(-kinds.size, 4 if power else 3):
        kind, ends, patch = kinds[min(step, -1)], step == 1, step == 0
        if step == -1 and best.fit.evidence > -np.inf and not _unexplained(best, kind):
            continue
        if patch and not best.misfit.hidden > SHOWN or ends and shape:
            continue
        if step > 0:
            kind = LINE if ends else TWO if step == 2 else PLATE
            if not ((kinds == LINE).any() and _unexplained(best, kind)):
                continue
            if kind > LINE and refusal(pad, readings, best) & BAD_FIT:
                break
        theta = _cold_start(pad, kind, power, guess)
        if patch:
            kind, theta = best.beliefs.kind, best.fit.theta.copy()
            theta[P.WIDTH] = FIRST_PATCH
        one = _fitted(pad, readings, scatter, kind, ROBUST + BASELINE + POWER * power
                      + shape * (kind <= LINE) + ENDS * ends + PATCH * patch, theta)
        least, share = best.fit.evidence, one.fit.theta[P.SHARE]
        if kind > LINE:
            least = max(least, short)
            if kind == TWO and min(share, 1.0 - share) <= APART:
                continue  # the evidence asks for less than a second load
        if ends and too_short(pad, one.fit.theta, ends):
            short = max(short, one.fit.evidence)
        elif one.fit.evidence > least:
            best = one if kind > LINE else _judged(pad, readings, one)
        if step == -1 and best.fit.evidence == -np.inf:
            break
    return best


@njit(error_model='numpy')
def _order(pad: Pad, guess: Guess, kinds: np.ndarray) -> np.ndarray:
    """Return the kinds to try, the likelier first."""
    if min(pad.x.size, pad.y.size) < STRIPS:  # no direction is visible
        return np.array([POINT])
    if kinds.size > 1 and guess.length > LONG * guess.width:
        return np.array([LINE, POINT])
    return kinds


@njit(error_model='numpy', inline='always')
def search(pad: Pad, readings: Readings, scatter: float,
           kinds: np.ndarray) -> tuple[Hypothesis, int]:
    """
    Find the simplest load that explains an image.

    Parameters
    ----------
    pad : Pad
    readings : Readings
    scatter : float
        Relative standard deviation of the gains; 0: unknown.
    kinds : ndarray of int
        POINT, LINE or both, in this order.

    Returns
    -------
    Hypothesis
        Its evidence is -infinite if no fit works.
    int
        Reasons to refuse it; 0 if there are none. SKIN_MISMATCH is set if only a bump of free
        shape explains the image although the skin is known.
    """
    guess, only_lines = first_guess(pad, readings.value), not (kinds == POINT).any()
    kinds, known = _order(pad, guess, kinds), pad.depths[0] > 0.0
    nothing = _nothing(readings, beliefs_of(pad, scatter, kinds[0], POWER * (not known)))
    one, explains, why = nothing, False, BAD_FIT
    if only_lines and kinds[0] == POINT:
        return nothing, FEW_TACTELS
    if known:
        one, explains = _search_sharp(pad, readings, scatter, guess, kinds)
        if explains:
            why = refusal(pad, readings, one)
    refused, free = False, not known
    for power, shape in (
            (False, 0), (True, 0), (True, ELONGATED), (True, ELONGATED + BLUNTED)):
        if explains or not (free if power else known):
            continue
        if shape and not why & BAD_FIT or shape == ELONGATED and kinds[0] != POINT:
            continue
        other = _search_robust(pad, readings, scatter, guess, kinds[:1] if shape else kinds, power,
                               shape, nothing)
        if power and (shape or not refused) and other.fit.evidence <= one.fit.evidence:
            continue
        one = other
        why = refusal(pad, readings, one) | SKIN_MISMATCH * (power and known)
        if not power and pad.depths.size == 1 and not is_nothing(readings, one):
            refused = why & ~OFF_PAD > 0 or _other_skin(one)
            free = refused or one.fit.scatter > one.beliefs.gain or (
                one.beliefs.patch and one.fit.theta[P.WIDTH] >= MAX_VARIANCE)
    return one, why
