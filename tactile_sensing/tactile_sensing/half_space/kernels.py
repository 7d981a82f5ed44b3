"""Add the pressure of point and line loads on a half-space to an image; compiled."""

import math
from typing import Any

from tactile_common.kernels import njit


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
