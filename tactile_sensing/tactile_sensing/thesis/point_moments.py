"""
Point contact from moments: the closed forms of the thesis (2.3, 2.4, 2.6) and its iteration (2.7).

They are the reference for comparisons with other estimators. Moments are those of the published
images, compression positive (M0 = +P). All moments have the opposite sign of those in the thesis;
the results are the same.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
import math
from typing import Any

import numpy as np

from tactile_common.errors import ConfigurationError
from tactile_sensing.image import image_moments
from tactile_sensing.types.array import TactelArray
from tactile_sensing.types.contact import Reason
from tactile_sensing.types.moments import Moments

MIN_SHEAR_RATIO = 1e-3  # |Qx| / P, up to which b = SMy / SM0 of (2.6) is singular
MAX_STEPS = 30  # the thesis needs fewer than 10; near a border the convergence is slower
SMALLEST_MASK = 1.5  # half side of the smallest mask [pitches]
SETTLED = 1e-6  # converged if the last step is smaller along both axes [m]


@dataclass(frozen=True)
class PointMoments:
    """
    Point contact that was computed from moments.

    Reasons: BAD_FIT, if M0 is not positive or a result is not finite: all parameters are NaN.
    OFF_PAD, if the mask of the iteration left the pad. NOT_CONVERGED, if the iteration did not
    converge, or (2.6) is singular because Qx is about 0: then Qy is 0 and b the centroid.
    """

    a: float  # [m]
    b: float
    normal_force: float  # [N]
    shear_force_x: float
    shear_force_y: float
    reasons: Reason = Reason(0)
    iterations: int = 0  # of `compensated`


NOTHING = PointMoments(math.nan, math.nan, math.nan, math.nan, math.nan, Reason.BAD_FIT)


def basic(images: np.ndarray, array: TactelArray, layers: Sequence[Any], *,
          averaging: bool = False) -> PointMoments:
    """
    Compute a point contact by the closed form for the layers, from moments of the whole images.

    Parameters
    ----------
    images : ndarray, shape (layers, rows, columns)
        One image per layer [Pa], finite.
    array : TactelArray
    layers : sequence
        Objects with `component` and `depth` [m]: one 'zz' (2.3); two 'zz' with increasing depth
        (2.4); or 'zz', 'xz' and optionally 'yz' with the same depth (2.6).
    averaging : bool
        True: tactels average over their area. False: they sample their centre.

    Raises
    ------
    ConfigurationError
        If the layers are others.
    """
    moments = [image_moments(image, array) for image in images]
    if averaging:
        moments = [without_averaging(m, array.pitch_x, array.pitch_y) for m in moments]
    return closed_form(moments, layers, peak_position(images[0], array))


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
    if estimate.reasons & Reason.BAD_FIT:
        return estimate
    peak, components = peak_position(images[0], array), [layer.component for layer in layers]
    for step in range(1, MAX_STEPS + 1):
        x, y = estimate.a, estimate.b
        mask = min(array.half_width_x - abs(x), array.half_width_y - abs(y))
        if mask < SMALLEST_MASK * max(array.pitch_x, array.pitch_y):
            return replace(
                estimate, reasons=estimate.reasons | Reason.OFF_PAD, iterations=step)
        moments = window_moments(images, array, x, y, mask)
        if averaging:
            moments = [without_averaging(m, array.pitch_x, array.pitch_y) for m in moments]
        moved = closed_form(
            [_compensate(m, layer, mask) for m, layer in zip(moments, layers, strict=True)],
            layers, (peak[0] - x, peak[1] - y))
        if moved.reasons & Reason.BAD_FIT:  # the mask has lost the contact
            break
        k0, k1 = compensation_factors(mask, layers[0].depth)
        move_x = moved.a * (k1 / k0 if 'xz' in components else 1.0)
        move_y = moved.b * (k1 / k0 if 'yz' in components else 1.0)
        estimate = replace(moved, a=x + move_x, b=y + move_y, iterations=step)
        if max(abs(move_x), abs(move_y)) < SETTLED:
            return estimate
    return replace(estimate, reasons=estimate.reasons | Reason.NOT_CONVERGED)


def closed_form(moments: Sequence[Moments], layers: Sequence[Any],
                peak: tuple[float, float]) -> PointMoments:
    """
    Compute a point contact by the closed form for the given layers, see `basic`.

    Parameters
    ----------
    moments : sequence of Moments
        One per layer; for area-averaging tactels, after `without_averaging`.
    layers : sequence
        As for `basic`.
    peak : (float, float)
        Position of the largest pressure [m], see `peak_position`. The thesis determines the signs
        of the shear in (2.3) from the peaks of compression and tension. Tension is not measured,
        but sign(centroid - peak) is the same.
    """
    form = form_of(layers)
    if form is None:
        given = ', '.join(f'{layer.component}@{layer.depth}' for layer in layers)
        raise ConfigurationError(f'layers are {given or "none"}, must be zz, two of zz, or zz '
                                 'with xz and yz at one depth')
    if not all(moment.m0 > 0.0 for moment, layer in zip(moments, layers, strict=True)
               if layer.component == 'zz'):
        return NOTHING
    found = form(moments, [layer.depth for layer in layers], peak)
    return found if all(map(math.isfinite, (
        found.a, found.b, found.normal_force, found.shear_force_x,
        found.shear_force_y))) else NOTHING


def form_of(layers: Sequence[Any]) -> Callable | None:
    """
    Return the closed form for layers; None if there is none.

    Raises a ConfigurationError if a depth is not a positive length.
    """
    for layer in layers:
        if not 0.0 < layer.depth < math.inf:
            raise ConfigurationError(f'depth is {layer.depth!r}, must be a positive length [m]')
    components, depths = [layer.component for layer in layers], [it.depth for it in layers]
    if components == ['zz']:
        return _one_layer
    if components == ['zz', 'zz'] and depths[0] < depths[1]:
        return _two_layers
    if components in (['zz', 'xz'], ['zz', 'xz', 'yz']) and len(set(depths)) == 1:
        return _normal_and_shear
    return None


def _one_layer(moments: Sequence[Moments], depths: Sequence[float],
               peak: tuple[float, float]) -> PointMoments:
    """Solve one layer of pressure, (2.3); a root that noise makes imaginary is set to 0."""
    m, depth = moments[0], depths[0]
    position, shear = [], []
    for first, second, at in ((m.mx, m.mxx, peak[0]), (m.my, m.myy, peak[1])):
        width = depth * m.m0
        discriminant = width * width + first * first - m.m0 * second  # may overflow to infinity
        root = math.sqrt(max(discriminant, 0.0))
        lever = math.copysign(root, first / m.m0 - at)  # d Q
        shear.append(lever / depth)
        position.append((first - lever) / m.m0)
    (a, b), (shear_x, shear_y) = position, shear
    return PointMoments(a, b, m.m0, shear_x, shear_y)


def _two_layers(moments: Sequence[Moments], depths: Sequence[float],
                peak: tuple[float, float]) -> PointMoments:
    """Solve two layers of pressure, (2.4); M0 of the shallower one loses less at the border."""
    (first, second), span = moments, depths[1] - depths[0]
    return PointMoments(
        a=(first.mx * depths[1] - second.mx * depths[0]) / (first.m0 * span),
        b=(first.my * depths[1] - second.my * depths[0]) / (first.m0 * span),
        normal_force=first.m0,
        shear_force_x=(second.mx - first.mx) / span,
        shear_force_y=(second.my - first.my) / span)


def _normal_and_shear(moments: Sequence[Moments], depths: Sequence[float],
                      peak: tuple[float, float]) -> PointMoments:
    """
    Solve pressure and shear stress in one layer, (2.6) corrected.

    With Table 2.3, a = (Mx - d SM0) / M0, b = SMy / SM0 and Qy = (My - b M0) / d. In print, a has
    My instead of Mx, b is SMx / M0, and Qy has Mx. With 'yz', b = (My - d SM0) / M0 as for a, and
    the equations are never singular.
    """
    (normal, shear_x, *shear_y), depth, reasons = moments, depths[0], Reason(0)
    a = (normal.mx - depth * shear_x.m0) / normal.m0
    if shear_y:
        force_y = shear_y[0].m0
        b = (normal.my - depth * force_y) / normal.m0
    elif not abs(shear_x.m0) <= MIN_SHEAR_RATIO * normal.m0:
        b = shear_x.my / shear_x.m0
        force_y = (normal.my - b * normal.m0) / depth
    else:
        reasons = Reason.NOT_CONVERGED
        b, force_y = normal.my / normal.m0, 0.0
    return PointMoments(a, b, normal.m0, shear_x.m0, force_y, reasons)


def without_averaging(moments: Moments, size_x: float, size_y: float) -> Moments:
    """
    Subtract side^2 / 12 M0 from the second moments (Sheppard's correction).

    Area-averaging tactels with these sides [m] add this term; the discriminants of (2.3) are then
    negative if |Q| < P side / (sqrt(12) d). Apply it before any compensation.
    """
    return replace(
        moments, mxx=moments.mxx - size_x**2 / 12.0 * moments.m0,
        myy=moments.myy - size_y**2 / 12.0 * moments.m0)


def peak_position(pressure: np.ndarray, array: TactelArray) -> tuple[float, float]:
    """
    Return the position (x, y) of the largest pressure [m]; all pressures must be finite.

    It is the vertex of the parabola through the tactel and its neighbours along each axis.
    """
    row, column = np.unravel_index(np.argmax(pressure), pressure.shape)
    return (array.x[column] + array.pitch_x * _vertex(pressure[row, :], column),
            array.y[row] + array.pitch_y * _vertex(pressure[:, column], row))


def _vertex(line: np.ndarray, peak: Any) -> float:
    """Return the offset of the vertex from the peak [tactels], at most half; 0: unknown."""
    if not 0 < peak < line.size - 1:
        return 0.0
    left, middle, right = line[peak - 1:peak + 2]
    curvature = left - 2.0 * middle + right
    return 0.5 * (left - right) / curvature if -math.inf < curvature < 0.0 else 0.0


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


def _compensate(moments: Moments, layer: Any, mask: float) -> Moments:
    k0, k1 = compensation_factors(mask, layer.depth)
    if layer.component != 'zz':
        k0 = k1
    return Moments(moments.m0 / k0, moments.mx / k1, moments.my / k1,
                   moments.mxx / k1, moments.myy / k1, moments.mxy / k1)


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
