"""Point contact from moments of a moving window: the iteration of section 2.4 (2.7)."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from tactile_sensing.thesis.point_moments import (
    basic,
    closed_form,
    MomentFlag,
    peak_position,
    PointMoments,
    without_averaging,
)
from tactile_sensing.types.array import TactelArray
from tactile_sensing.types.moments import Moments

MAX_STEPS = 30  # the thesis needs fewer than 10; near a border the convergence is slower
SMALLEST_MASK = 1.5  # half side of the smallest mask [pitches]
SETTLED = 1e-6  # converged if the last step is smaller along both axes [m]


def compensation_factors(half_side: float, depth: float) -> tuple[float, float]:
    """
    Return the compensation factors (2.7) in closed form, (K0, K1).

    They are the shares of the moments over the plane that a square mask of half side n, centred
    on the contact, contains (the limit in print is n to infinity). With u = n / d and
    r = sqrt(1 + 2 u^2),
    K0 = (2 / pi) [atan(u^2 / r) + 2 u^2 / ((1 + u^2) r)] for M0 of the pressure, and
    K1 = (2 / pi) [atan(u^2 / r) - u^2 / ((1 + u^2) r)] for Mx, My, Mxx, Myy about the
    centre of the mask, and for SM0 and the first moments of the shear.
    """
    u2 = (half_side / depth)**2
    r = np.sqrt(1.0 + 2.0 * u2)
    angle, rest = np.arctan(u2 / r), u2 / ((1.0 + u2) * r)
    return 2.0 / np.pi * (angle + 2.0 * rest), 2.0 / np.pi * (angle - rest)


def compensated(images: np.ndarray, array: TactelArray, layers: Sequence[Any], *,
                averaging: bool = False) -> PointMoments:
    """
    Estimate a point by the closed form and the iteration of section 2.4; arguments as for `basic`.

    Each step uses the largest square mask on the pad that is centred on the last estimate. The
    moments in it, about its centre, are divided by the `compensation_factors`. This is repeated
    until the estimate converges. A tactel on the border of the mask counts with its area inside.

    With a shear layer, d SM0 = Mx - a M0 holds in any window without factors. In print it is
    divided by them nevertheless, so that a step is too large by K0 / K1. Closer to the border than
    about 2.3 d this is more than 2, and the iteration diverges. Here such steps are scaled by
    K1 / K0.
    """
    estimate = basic(images, array, layers, averaging=averaging)
    if estimate.flags & MomentFlag.NO_FORCE:
        return estimate
    peak = peak_position(images[0], array)
    for step in range(1, MAX_STEPS + 1):
        x, y = estimate.a, estimate.b
        mask = min(array.half_width_x - abs(x), array.half_width_y - abs(y))
        if mask < SMALLEST_MASK * max(array.pitch_x, array.pitch_y):
            return replace(
                estimate, flags=estimate.flags | MomentFlag.OFF_PAD, iterations=step)
        moments = window_moments(images, array, x, y, mask)
        if averaging:
            moments = [without_averaging(m, array.pitch_x, array.pitch_y) for m in moments]
        moved = closed_form(
            [_compensate(m, layer, mask) for m, layer in zip(moments, layers, strict=True)],
            layers, (peak[0] - x, peak[1] - y))
        if moved.flags & MomentFlag.NO_FORCE:  # the mask has lost the contact
            break
        components = [layer.component for layer in layers]
        k0, k1 = compensation_factors(mask, layers[0].depth)
        move_x = moved.a * (k1 / k0 if 'xz' in components else 1.0)
        move_y = moved.b * (k1 / k0 if 'yz' in components else 1.0)
        estimate = replace(moved, a=x + move_x, b=y + move_y, iterations=step)
        if max(abs(move_x), abs(move_y)) < SETTLED:
            return estimate
    return replace(estimate, flags=estimate.flags | MomentFlag.NOT_CONVERGED)


def window_moments(
        images: np.ndarray, array: TactelArray, x: float, y: float, mask: float) -> list[Moments]:
    """Return the moments about (x, y) of each image within |x' - x|, |y' - y| <= mask [m]."""
    weight_x, arm_x = _within(array.x - x, array.pitch_x, mask)
    weight_y, arm_y = _within(array.y - y, array.pitch_y, mask)
    return [Moments(*(  # p, q: orders of x and y, as in Moments
        float((weight_y * arm_y**q) @ image @ (weight_x * arm_x**p))
        for p, q in ((0, 0), (1, 0), (0, 1), (2, 0), (0, 2), (1, 1)))) for image in images]


def _within(centres: np.ndarray, pitch: float, mask: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the length of each tactel's part within [-mask, mask], and its centre."""
    first = np.clip(centres - 0.5 * pitch, -mask, mask)
    last = np.clip(centres + 0.5 * pitch, -mask, mask)
    return last - first, 0.5 * (first + last)


def _compensate(moments: Moments, layer: Any, mask: float) -> Moments:
    k0, k1 = compensation_factors(mask, layer.depth)
    if layer.component != 'zz':
        k0 = k1
    return Moments(moments.m0 / k0, moments.mx / k1, moments.my / k1,
                   moments.mxx / k1, moments.myy / k1, moments.mxy / k1)
