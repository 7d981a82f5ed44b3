"""What is believed of a load before its image is seen."""

from functools import lru_cache
import math

import numpy as np

from tactile_sensing.contact.fit import Beliefs
from tactile_sensing.skin.bumps import (
    BASE,
    BEGIN,
    END,
    EXPONENT,
    FORCE,
    POINT,
    Q0,
    Q1,
    SHEAR_U,
    SHEAR_V,
    WIDTH,
)
from tactile_sensing.skin.kernel import MAX_VARIANCE

HALF_SPACE = 2.5  # exponent of a point's bump on a half-space
SHEAR = 0.3, 0.15  # standard deviation of a component of Q / P, on a known skin and on any other
# Scatter of the gains where it is not known: sharp tier, robust tier, free tier.
SCATTER = 0.05, 0.1, 0.05
UNSEEN = 0.0, 0.01  # d that a fit has absorbed: of a sharp load on a known skin, of any other


@lru_cache(maxsize=256)
def beliefs_of(half_x, half_y, pitch, layers, scatter, kind, power, ends, robust, patch, base):
    """Priors and bounds of a load of a kind; of which parameters are fitted."""
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
