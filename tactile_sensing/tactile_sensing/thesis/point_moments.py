"""
Point contact from moments: the closed forms of the thesis (2.3, 2.4, 2.6).

They are the reference for comparisons with other estimators. Moments are those of the published
images, compression positive (M0 = +P). All moments have the opposite sign of those in the thesis;
the results are the same.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from enum import IntFlag
import math
from typing import Any

import numpy as np

from tactile_common.errors import ConfigurationError
from tactile_sensing.image import image_moments
from tactile_sensing.types.array import TactelArray
from tactile_sensing.types.moments import Moments

NAN = float('nan')
MIN_SHEAR_RATIO = 1e-3  # |Qx| / P, up to which b = SMy / SM0 of (2.6) is singular


class MomentFlag(IntFlag):
    """Problems of a closed form; 0 if there are none."""

    NO_FORCE = 1  # M0 is not positive or something is not finite: all parameters are NaN
    NEGATIVE_DISCRIMINANT_X = 2  # (2.3): shear_force_x is set to 0, a to the centroid
    NEGATIVE_DISCRIMINANT_Y = 4  # (2.3): shear_force_y is set to 0, b to the centroid
    SINGULAR = 8  # (2.6) with Qx about 0: shear_force_y is set to 0, b to the centroid
    OFF_PAD = 16  # the iteration's mask left the pad: the last estimate is returned
    NOT_CONVERGED = 32  # the iteration did not converge, or lost the contact


@dataclass(frozen=True)
class PointMoments:
    """Point contact that was computed from moments."""

    a: float  # [m]
    b: float
    normal_force: float  # [N]
    shear_force_x: float
    shear_force_y: float
    flags: MomentFlag = MomentFlag(0)
    iterations: int = 0  # of `compensated`


NOTHING = PointMoments(NAN, NAN, NAN, NAN, NAN, MomentFlag.NO_FORCE)


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
    """Solve one layer of pressure, (2.3); if shear is low, noise can make a root imaginary."""
    m, depth, flags = moments[0], depths[0], MomentFlag(0)
    position, shear = [], []
    for first, second, at, flag in (
            (m.mx, m.mxx, peak[0], MomentFlag.NEGATIVE_DISCRIMINANT_X),
            (m.my, m.myy, peak[1], MomentFlag.NEGATIVE_DISCRIMINANT_Y)):
        width = depth * m.m0
        discriminant = width * width + first * first - m.m0 * second  # may overflow to infinity
        if discriminant < 0.0:
            flags |= flag
            discriminant = 0.0
        lever = math.copysign(math.sqrt(discriminant), first / m.m0 - at)  # d Q
        shear.append(lever / depth)
        position.append((first - lever) / m.m0)
    (a, b), (shear_x, shear_y) = position, shear
    return PointMoments(a, b, m.m0, shear_x, shear_y, flags)


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
    (normal, shear_x, *shear_y), depth, flags = moments, depths[0], MomentFlag(0)
    a = (normal.mx - depth * shear_x.m0) / normal.m0
    if shear_y:
        force_y = shear_y[0].m0
        b = (normal.my - depth * force_y) / normal.m0
    elif not abs(shear_x.m0) <= MIN_SHEAR_RATIO * normal.m0:
        b = shear_x.my / shear_x.m0
        force_y = (normal.my - b * normal.m0) / depth
    else:
        flags = MomentFlag.SINGULAR
        b, force_y = normal.my / normal.m0, 0.0
    return PointMoments(a, b, normal.m0, shear_x.m0, force_y, flags)


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
