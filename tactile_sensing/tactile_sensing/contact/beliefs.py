"""Priors and bounds of a load; compiled."""

import math

import numpy as np

from tactile_common.kernels import njit
from tactile_sensing.contact.records import Beliefs
from tactile_sensing.skin.bumps import (
    BASE,
    BEGIN,
    BLUNT,
    END,
    EXPONENT,
    FORCE,
    LINE,
    LONG_X,
    LONG_XY,
    Pad,
    PLATE,
    POINT,
    Q0,
    Q1,
    Q2,
    Q3,
    SHARE,
    SHEAR_U,
    SHEAR_V,
    TWO,
    WIDTH,
)
from tactile_sensing.skin.kernel import MAX_VARIANCE

HALF_SPACE = 2.5  # exponent of a point's bump on a half-space
SHEAR = 0.3, 0.15  # standard deviation of a component of Q / P: known skin, unknown skin
TAPER_SPREAD = 0.5  # standard deviation of taper / force of a line
LONGER, LONGEST = 0.2, 0.6  # standard deviation and largest value of LONG_X and LONG_XY
BLUNTER, BLUNTEST = 0.3, 0.75  # the same of BLUNT
SCATTER = 0.05  # assumed scatter of unknown gains
# Options, see `Beliefs`
POWER, ENDS, ROBUST, PATCH, BASELINE, TAPERED, ELONGATED, BLUNTED = 1, 2, 4, 8, 16, 32, 64, 128
# Log odds of a usual point or a line that crosses the pad: against an elongated or blunt one, two
# points, a line that ends or a border of a plate, which has two.
RARE = 3.0
APART = 0.055  # a higher unexplained pressure away from the load is a second load [of its peak]


@njit(error_model='numpy')
def widest(pad: Pad) -> float:
    """Return the largest half width of a bump that the pad can still recognise [m]."""
    side = min(pad.half_x, pad.half_y)
    if side <= pad.pitch:
        side = max(pad.half_x, pad.half_y)
    return 0.45 * max(side, 1.5 * pad.pitch)


@njit(error_model='numpy')
def beliefs_of(pad: Pad, scatter: float, kind: int, options: int) -> Beliefs:
    """Return the priors and bounds of a load; `options` is a sum of the constants above."""
    power, ends, robust = options & POWER > 0, options & ENDS > 0, options & ROBUST > 0
    patch, shaped = options & PATCH > 0, options & (ELONGATED + BLUNTED) > 0
    count = BASE + pad.depths.size
    mean, information, step = np.zeros(count), np.zeros(count), np.ones(count)
    low, high, fitted = np.full(count, -np.inf), np.full(count, np.inf), np.zeros(count, np.bool_)
    fitted[Q0] = fitted[Q1] = fitted[FORCE] = fitted[SHEAR_U] = True
    fitted[SHEAR_V] = kind != LINE or options & TAPERED > 0  # that of a line is its taper
    reach = math.hypot(pad.half_x, pad.half_y)
    information[Q0] = reach ** -2
    step[Q0] = step[Q1] = step[BEGIN] = step[END] = 0.6 * pad.pitch
    volume, flat = 0.0, 0
    if kind == POINT or kind == TWO:
        information[Q1] = reach ** -2
        high[Q0], high[Q1] = 1.25 * pad.half_x, 1.25 * pad.half_y
        low[Q0], low[Q1] = -high[Q0], -high[Q1]
    else:
        information[Q1] = (2.0 * math.pi) ** -2
        low[Q0], high[Q0] = -1.25 * reach, 1.25 * reach
        step[Q1] = 0.15
    if kind > LINE:
        fitted[Q2] = fitted[Q3] = fitted[SHARE] = True
        information[Q2] = information[Q3] = reach ** -2
        low[Q2], high[Q2], low[Q3], high[Q3] = low[Q0], high[Q0], low[Q1], high[Q1]
        low[SHARE], high[SHARE], step[SHARE] = APART, 1.0 - APART, 0.2
        volume += RARE if kind == TWO else 2.0 * RARE
        flat += 1
    if ends:
        fitted[BEGIN] = fitted[END] = True
        low[BEGIN] = low[END] = -1.5 * reach
        high[BEGIN] = high[END] = 1.5 * reach
        volume += 2.0 * math.log(2.0 * reach) + RARE
        flat += 2
    if power:
        fitted[WIDTH] = fitted[EXPONENT] = True
        mean[WIDTH], information[WIDTH] = math.log(1.2 * pad.pitch), 0.8 ** -2
        mean[EXPONENT], information[EXPONENT] = math.log(HALF_SPACE), 0.5 ** -2
        low[WIDTH], high[WIDTH] = math.log(0.3 * pad.pitch), math.log(widest(pad))
        low[EXPONENT], high[EXPONENT] = math.log(1.7), math.log(12.0)
        step[WIDTH], step[EXPONENT] = 0.25, 0.2
        volume += RARE * shaped
        if options & BLUNTED:
            fitted[BLUNT], information[BLUNT], step[BLUNT] = True, BLUNTER ** -2, 0.2
            low[BLUNT], high[BLUNT] = 0.0, BLUNTEST
        if options & ELONGATED and kind == POINT:
            for p in (LONG_X, LONG_XY):
                fitted[p], information[p], step[p] = True, LONGER ** -2, 0.2
                low[p], high[p] = -LONGEST, LONGEST
    elif patch:
        fitted[WIDTH], low[WIDTH], high[WIDTH], step[WIDTH] = True, 0.0, MAX_VARIANCE, 0.1
        volume += math.log(MAX_VARIANCE)
        flat += 1
    fitted[BASE:] = options & BASELINE > 0
    if kind == PLATE:
        fitted[END] = fitted[EXPONENT] = fitted[SHEAR_U] = fitted[SHEAR_V] = False
    gain, spread = (scatter, 0.5) if scatter > 0.0 else (SCATTER, 1.0)
    volume -= 0.5 * math.log(2.0 * math.pi) * flat
    return Beliefs(kind, power, shaped, ends, patch, robust, mean, information, low, high, step,
                   np.flatnonzero(fitted), volume, scatter, gain, spread)
