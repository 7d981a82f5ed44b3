"""Point contact from moments of a moving window: the iteration of section 2.4 (2.7)."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from tactile_common.errors import ConfigurationError
from tactile_sensing.thesis.point_moments import (
    basic,
    checked_images,
    closed_form,
    MomentFlag,
    peak_position,
    PointMoments,
    without_averaging,
)
from tactile_sensing.types.array import TactelArray
from tactile_sensing.types.moments import Moments

MAX_STEPS = 30  # the thesis needs fewer than 10; more only helps the slow approach at a border
MOMENT_ORDERS = (0, 0), (1, 0), (0, 1), (2, 0), (0, 2), (1, 1)  # of x and y, as in Moments
SMALLEST_MASK = 1.5  # half side of the smallest mask [pitches]


def compensation_factors(half_side: float, depth: float) -> tuple[float, float]:
    """
    Compensation factors (2.7) in closed form: (K0, K1).

    What a square mask of half side n centred on the contact sees of the moments over the
    plane (the limit in print is n to infinity). With u = n / d and r = sqrt(1 + 2 u^2),
    K0 = (2 / pi) [atan(u^2 / r) + 2 u^2 / ((1 + u^2) r)] for M0 of the pressure and
    K1 = (2 / pi) [atan(u^2 / r) - u^2 / ((1 + u^2) r)] for Mx, My, Mxx, Myy about the
    centre of the mask, and for SM0 and the first moments of the shear.
    """
    u2 = (half_side / depth)**2
    r = np.sqrt(1.0 + 2.0 * u2)
    angle, rest = np.arctan(u2 / r), u2 / ((1.0 + u2) * r)
    return 2.0 / np.pi * (angle + 2.0 * rest), 2.0 / np.pi * (angle - rest)


def compensated(images: np.ndarray, array: TactelArray, layers: Sequence[Any], *,
                averaging: bool = False, printed: bool = False, tolerance: float = 1e-6,
                max_steps: int = MAX_STEPS) -> PointMoments:
    """
    Closed form of the layers given, with the iteration of section 2.4.

    Moments are taken again in the largest square mask on the pad centred on the last
    estimate, about its centre, and divided by the `compensation_factors`, until the
    estimate moves by less than `tolerance`. Tactels on the border of the mask count with
    the part of their area within.

    With a shear layer, d SM0 = Mx - a M0 holds on any window without factors. In print it is
    divided by them all the same, which overshoots K0 / K1 times: nearer to the border than
    about 2.3 d that is more than twice, and the iteration leaves the solution again.

    Parameters
    ----------
    images, array, layers, averaging
        As for `basic`.
    printed : bool
        With the factors as in print, where there is a shear layer.
    tolerance : float
        Largest last movement along either axis [m].
    max_steps : int
        At least 1.

    Raises
    ------
    ConfigurationError
        As for `basic`, or a tolerance or number of steps that is not positive.
    """
    if not tolerance > 0.0:
        raise ConfigurationError(f'tolerance is {tolerance!r}, must be positive [m]')
    if max_steps < 1:
        raise ConfigurationError(f'max_steps is {max_steps!r}, must be at least 1')
    images = checked_images(images, array, layers)
    peak = peak_position(images[0], array)
    estimate = basic(images, array, layers, averaging=averaging)
    if estimate.flags & MomentFlag.NO_FORCE:
        return estimate
    for step in range(1, max_steps + 1):
        x, y = estimate.a, estimate.b
        mask = min(array.half_width_x - abs(x), array.half_width_y - abs(y))
        if mask < SMALLEST_MASK * max(array.pitch_x, array.pitch_y):
            return replace(
                estimate, flags=estimate.flags | MomentFlag.OFF_PAD, iterations=step)
        moved = from_window(
            window_moments(images, array, x, y, mask), array, layers, mask,
            (peak[0] - x, peak[1] - y), averaging=averaging, printed=printed)
        if moved.flags & MomentFlag.NO_FORCE:  # the mask has lost the contact
            break
        estimate = replace(moved, a=x + moved.a, b=y + moved.b, iterations=step, mask=mask)
        if max(abs(moved.a), abs(moved.b)) < tolerance:
            return estimate
    return replace(estimate, flags=estimate.flags | MomentFlag.NOT_CONVERGED)


def window_moments(
        images: np.ndarray, array: TactelArray, x: float, y: float, mask: float) -> list[Moments]:
    """
    Moments about (x, y) of the part of each image within |x' - x|, |y' - y| <= mask [m].

    The images (layers, rows, columns) are finite.
    """
    weight_x, arm_x = window_arms(array.x - x, array.pitch_x, mask)
    weight_y, arm_y = window_arms(array.y - y, array.pitch_y, mask)
    return [Moments(*(
        float((weight_y * arm_y**q) @ image @ (weight_x * arm_x**p))
        for p, q in MOMENT_ORDERS)) for image in images]


def from_window(moments: Sequence[Moments], array: TactelArray, layers: Sequence[Any],
                mask: float, peak: tuple[float, float], *, averaging: bool = False,
                printed: bool = False) -> PointMoments:
    """
    Point contact, about the centre of a window, from the moments within it.

    Parameters
    ----------
    moments : sequence of Moments
        From `window_moments`, one for each layer.
    mask : float
        Half side of the window [m]; infinite: nothing to compensate.
    peak : (float, float)
        Position of the largest pressure about the centre of the window [m].
    """
    if averaging:
        moments = [without_averaging(m, array.pitch_x, array.pitch_y) for m in moments]
    if mask == np.inf:
        return closed_form(moments, layers, peak)
    moments = [_compensate(m, layer, mask) for m, layer in zip(moments, layers, strict=True)]
    found = closed_form(moments, layers, peak)
    return found if printed else _without_overshoot(found, layers, mask)


def window_arms(centres: np.ndarray, pitch: float, mask: float) -> tuple:
    """Length of every tactel within [-mask, mask] and the centre of that part."""
    first = np.clip(centres - 0.5 * pitch, -mask, mask)
    last = np.clip(centres + 0.5 * pitch, -mask, mask)
    return last - first, 0.5 * (first + last)


def _compensate(moments: Moments, layer: Any, mask: float) -> Moments:
    k0, k1 = compensation_factors(mask, layer.depth)
    if layer.component != 'zz':
        k0 = k1
    return Moments(moments.m0 / k0, moments.mx / k1, moments.my / k1,
                   moments.mxx / k1, moments.myy / k1, moments.mxy / k1)


def _without_overshoot(moved: PointMoments, layers: Sequence[Any], mask: float) -> PointMoments:
    """Position relative to the mask where a shear layer gives it without factors."""
    components = [layer.component for layer in layers]
    k0, k1 = compensation_factors(mask, layers[0].depth)
    return replace(
        moved, a=moved.a * (k1 / k0 if 'xz' in components else 1.0),
        b=moved.b * (k1 / k0 if 'yz' in components else 1.0))
