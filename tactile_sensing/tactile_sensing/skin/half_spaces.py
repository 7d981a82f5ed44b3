"""
Pressure of point and segment loads in a skin that half-spaces approximate; compiled.

A half-space has a closed form for a segment of a line load.
"""

from functools import lru_cache
import math
from typing import Any

import numpy as np

from tactile_common.kernels import njit
from tactile_sensing.skin.pressure import SkinPressure
from tactile_sensing.types.skin import Skin

DEPTHS = 1.0, 1.5, 3.0  # depths of the tactels in the half-spaces [depths in the skin]
REACH = 6.0  # the pressure is fitted up to this distance from a line [depths]
# Depth of the tactels in a half-space [m], and weight of the half-space.
HALF_SPACE = np.dtype([('depth', 'f8'), ('weight', 'f8')])


@lru_cache(maxsize=16)
def half_spaces(skin: Skin) -> np.ndarray:
    """
    Return half-spaces whose weighted sum approximates the pressure of a skin under normal loads.

    Under a line, the error is within 1 % of the peak if the thickness is at least two depths, and
    within 2.5 % otherwise. The result is HALF_SPACE records (3,), read-only; the first has the
    depth of the tactels.
    """
    found = np.zeros(len(DEPTHS), HALF_SPACE)
    found['depth'] = np.multiply(DEPTHS, skin.depth)
    if skin.is_half_space:
        found['weight'][0] = 1.0
    else:
        x, y = np.linspace(0.0, REACH * skin.depth, 61), np.zeros(1)
        images = [SkinPressure(Skin(depth)).line(x, y, 0.0, 0.0, 1.0) for depth in found['depth']]
        measured = SkinPressure(skin).line(x, y, 0.0, 0.0, 1.0)
        found['weight'] = np.linalg.lstsq(np.stack(images, -1), measured, rcond=None)[0]
    found.flags.writeable = False
    return found


@njit(cache=True, nogil=True, error_model='numpy')
def add_point(pressure: Any, x: Any, y: Any, depth: float, px: float, py: float,
              load: float) -> None:
    """Add the pressure of a point load [N] at (px, py) [m]: (2.2) without shear."""
    factor = 1.5 / math.pi * depth**3 * load
    for r in range(len(y)):
        from_row = (y[r] - py)**2 + depth * depth
        for c in range(len(x)):
            squared = (x[c] - px)**2 + from_row
            pressure[r, c] += factor / (squared * squared * math.sqrt(squared))


@njit(cache=True, nogil=True, error_model='numpy')
def add_segment(pressure: Any, x: Any, y: Any, depth: float, x0: float, y0: float, x1: float,
                y1: float, load0: float, load1: float) -> None:
    """
    Add the pressure of a segment whose line load changes linearly from load0 to load1 [N/m].

    It is the integral of 3 / (2 pi) d^3 q(u) / (u^2 + c^2)^(5/2). Here u is the position along the
    segment from the foot of the tactel, and c^2 is its squared distance from the line plus d^2.
    """
    length = math.hypot(x1 - x0, y1 - y0)
    tx, ty = (x1 - x0) / length, (y1 - y0) / length
    slope = (load1 - load0) / length
    factor = 1.5 / math.pi * depth**3
    for r in range(len(y)):
        for c in range(len(x)):
            dx, dy = x[c] - x0, y[r] - y0
            foot = dx * tx + dy * ty
            c2 = (dx * ty - dy * tx)**2 + depth * depth
            u0, u1 = -foot, length - foot
            s0, s1 = 1.0 / (u0 * u0 + c2), 1.0 / (u1 * u1 + c2)
            r0, r1 = math.sqrt(s0), math.sqrt(s1)
            constant = (u1 * r1 * (s1 + 2.0 / c2) - u0 * r0 * (s0 + 2.0 / c2)) / c2
            linear = r0 * s0 - r1 * s1
            pressure[r, c] += factor / 3.0 * (
                (load0 + slope * foot) * constant + slope * linear)
