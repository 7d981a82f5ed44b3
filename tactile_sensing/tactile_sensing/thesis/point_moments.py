"""
Point contact from moments: the closed forms of the thesis (2.3, 2.4, 2.6).

Baselines that every faster or better estimator is compared with. Moments are those of the
published images, compression positive (M0 = +P); against the thesis every moment changes
its sign and no result does.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import IntFlag
import math
from typing import Any

import numpy as np

from tactile_common.errors import ConfigurationError
from tactile_sensing.image import image_moments
from tactile_sensing.types.array import TactelArray
from tactile_sensing.types.moments import Moments

MIN_SHEAR_RATIO = 1e-3  # |Qx| / P below which b = SMy / SM0 of (2.6) is singular
NAN = float('nan')


class MomentFlag(IntFlag):
    """What a closed form could not do; 0 if everything is as derived."""

    NO_FORCE = 1  # M0 is not positive or something is not finite: all parameters are NaN
    NEGATIVE_DISCRIMINANT_X = 2  # (2.3): shear_force_x is set to 0, a to the centroid
    NEGATIVE_DISCRIMINANT_Y = 4  # likewise shear_force_y and b
    SINGULAR = 8  # (2.6) with Qx about 0: shear_force_y is set to 0, b to the centroid
    OFF_PAD = 16  # the iteration's mask left the pad: the last estimate on it stands
    NOT_CONVERGED = 32  # the iteration moved after the last step, or lost the contact


@dataclass(frozen=True)
class PointMoments:
    """Point contact from moments."""

    a: float  # [m]
    b: float
    normal_force: float  # [N]
    shear_force_x: float
    shear_force_y: float
    flags: MomentFlag = MomentFlag(0)
    iterations: int = 0  # of `compensated`
    mask: float = NAN  # half side of its last window [m]


NOTHING = PointMoments(NAN, NAN, NAN, NAN, NAN, MomentFlag.NO_FORCE)


def one_layer(moments: Moments, depth: float, peak: tuple[float, float]) -> PointMoments:
    """
    Point contact from one layer of pressure, (2.3): model 1.

    The thesis takes the signs of the shear from the peaks of compression and tension;
    where tension is not measured, sign(centroid - peak) gives the same.

    Flagged where a discriminant is negative, as noise makes it under little shear.

    Parameters
    ----------
    moments : Moments
        Of the pressure; of area-averaging tactels after `without_averaging`.
    depth : float
        Of the tactels [m]; a ConfigurationError where it is not positive.
    peak : (float, float)
        Position of the largest pressure [m], see `peak_position`.
    """
    _require_depth(depth)
    if not _has_force(moments, second_order=True) or not np.all(np.isfinite(peak)):
        return NOTHING
    flags = MomentFlag(0)
    position, shear = [], []
    for first, second, at, flag in (
            (moments.mx, moments.mxx, peak[0], MomentFlag.NEGATIVE_DISCRIMINANT_X),
            (moments.my, moments.myy, peak[1], MomentFlag.NEGATIVE_DISCRIMINANT_Y)):
        width = depth * moments.m0
        discriminant = width * width + first * first - moments.m0 * second
        if discriminant < 0.0:
            flags |= flag
            discriminant = 0.0
        lever = math.copysign(math.sqrt(discriminant), first / moments.m0 - at)  # d Q
        shear.append(lever / depth)
        position.append((first - lever) / moments.m0)
    (a, b), (shear_x, shear_y) = position, shear
    return _finite_or_nothing(PointMoments(a, b, moments.m0, shear_x, shear_y, flags))


def two_layers(
        first: Moments, second: Moments, depths: tuple[float, float]) -> PointMoments:
    """
    Point contact from two layers of pressure, (2.4): model 2.

    M0 is that of the first, shallower layer, which loses less at the border. Raises a
    ConfigurationError where the depths [m] are not positive and increasing.
    """
    _require_depth(depths[0])
    _require_depth(depths[1])
    span = depths[1] - depths[0]
    if not span > 0.0:
        raise ConfigurationError(
            f'depths are {depths[0]!r} and {depths[1]!r}, must increase [m]')
    if not (_has_force(first) and _has_force(second)):
        return NOTHING
    return _finite_or_nothing(PointMoments(
        a=(first.mx * depths[1] - second.mx * depths[0]) / (first.m0 * span),
        b=(first.my * depths[1] - second.my * depths[0]) / (first.m0 * span),
        normal_force=first.m0,
        shear_force_x=(second.mx - first.mx) / span,
        shear_force_y=(second.my - first.my) / span))


def normal_and_shear(normal: Moments, shear_x: Moments, depth: float, *,
                     shear_y: Moments | None = None) -> PointMoments:
    """
    Point contact from pressure and shear stress in one layer, (2.6) corrected: model 3.

    With Table 2.3, a = (Mx - d SM0) / M0, b = SMy / SM0 and Qy = (My - b M0) / d; print
    has My in place of Mx in a, SMx / M0 for b and Mx in Qy.

    Parameters
    ----------
    normal, shear_x : Moments
        Of the pressure and of the 'xz' layer; the zeroth and first orders are used.
    depth : float
        Of all layers [m]; a ConfigurationError where it is not positive.
    shear_y : Moments, optional
        Of the 'yz' layer. Then b = (My - d SM0) / M0 as for a, and nothing is singular.
    """
    _require_depth(depth)
    if not (_has_force(normal) and _finite(shear_x) and (shear_y is None or _finite(shear_y))):
        return NOTHING
    flags = MomentFlag(0)
    if shear_y is not None:
        force_y = shear_y.m0
        b = (normal.my - depth * force_y) / normal.m0
    elif abs(shear_x.m0) > MIN_SHEAR_RATIO * normal.m0:
        b = shear_x.my / shear_x.m0
        force_y = (normal.my - b * normal.m0) / depth
    else:
        flags = MomentFlag.SINGULAR
        b, force_y = normal.my / normal.m0, 0.0
    a = (normal.mx - depth * shear_x.m0) / normal.m0
    return _finite_or_nothing(PointMoments(a, b, normal.m0, shear_x.m0, force_y, flags))


def without_averaging(moments: Moments, size_x: float, size_y: float) -> Moments:
    """
    Moments with side^2 / 12 M0 taken off the second ones (Sheppard's correction).

    Area-averaging tactels of these sides [m] add it, which makes the discriminants of (2.3)
    negative whenever |Q| < P side / (sqrt(12) d). To be applied before any compensation.
    """
    return replace(
        moments, mxx=moments.mxx - size_x**2 / 12.0 * moments.m0,
        myy=moments.myy - size_y**2 / 12.0 * moments.m0)


def peak_position(pressure: np.ndarray, array: TactelArray) -> tuple[float, float]:
    """
    Position (x, y) of the largest pressure [m]; NaN where no tactel is finite.

    The vertex of the parabola through the tactel and its neighbours along each axis.
    """
    image = np.asarray(pressure, dtype=float)
    live = np.isfinite(image)
    if not live.any():
        return NAN, NAN
    row, column = np.unravel_index(np.argmax(np.where(live, image, -np.inf)), image.shape)
    return (array.x[column] + array.pitch_x * _vertex(image[row, :], column),
            array.y[row] + array.pitch_y * _vertex(image[:, column], row))


def basic(images: np.ndarray, array: TactelArray, layers: Sequence[Any], *,
          averaging: bool = False) -> PointMoments:
    """
    Closed form of the layers given, from the moments of the whole images.

    Parameters
    ----------
    images : ndarray, shape (layers, rows, columns)
        One image per layer [Pa]; tactels that are not finite count as zero.
    array : TactelArray
    layers : sequence
        Objects with `component` and `depth` [m]: one 'zz' (2.3), two 'zz' of increasing
        depth (2.4), or 'zz', 'xz' and, where measured, 'yz' of one depth (2.6).
    averaging : bool
        The tactels average over their area instead of sampling at their centre.

    Raises
    ------
    ConfigurationError
        No closed form for these layers, or an image of another shape.
    """
    images = checked_images(images, array, layers)
    moments = [image_moments(image, array) for image in images]
    if averaging:
        moments = [without_averaging(m, array.pitch_x, array.pitch_y) for m in moments]
    return closed_form(moments, layers, peak_position(images[0], array))


def closed_form(moments: Sequence[Moments], layers: Sequence[Any],
                peak: tuple[float, float]) -> PointMoments:
    components = tuple(layer.component for layer in layers)
    if components == ('zz',):
        return one_layer(moments[0], layers[0].depth, peak)
    if components == ('zz', 'zz'):
        return two_layers(moments[0], moments[1], (layers[0].depth, layers[1].depth))
    if components in (('zz', 'xz'), ('zz', 'xz', 'yz')) \
            and all(layer.depth == layers[0].depth for layer in layers):
        normal, shear_x, *shear_y = moments
        return normal_and_shear(
            normal, shear_x, layers[0].depth, shear_y=shear_y[0] if shear_y else None)
    given = ', '.join(f'{layer.component}@{layer.depth}' for layer in layers)
    raise ConfigurationError(
        f'layers are {given or "none"}, must be zz, two of zz, or zz with xz and yz at one depth')


def _vertex(line: np.ndarray, peak: Any) -> float:
    """How far the vertex is off the peak [tactels], at most half; 0 where unknown."""
    if not 0 < peak < line.size - 1:
        return 0.0
    left, middle, right = line[peak - 1:peak + 2]
    curvature = left - 2.0 * middle + right
    if not (math.isfinite(curvature) and curvature < 0.0):
        return 0.0
    return 0.5 * (left - right) / curvature


def checked_images(images: np.ndarray, array: TactelArray,
                   layers: Sequence[Any]) -> np.ndarray:
    images = np.asarray(images, dtype=float)
    expected = (len(layers), *array.shape)
    if images.shape != expected:
        raise ConfigurationError(f'images have shape {images.shape}, must be {expected}')
    return np.where(np.isfinite(images), images, 0.0)


def _has_force(moments: Moments, *, second_order: bool = False) -> bool:
    return moments.m0 > 0.0 and _finite(moments) and (
        not second_order or (math.isfinite(moments.mxx) and math.isfinite(moments.myy)))


def _finite(moments: Moments) -> bool:
    return all(math.isfinite(value) for value in (moments.m0, moments.mx, moments.my))


def _finite_or_nothing(estimate: PointMoments) -> PointMoments:
    """The estimate, or NOTHING where huge or tiny moments overflow a quotient."""
    return estimate if all(math.isfinite(value) for value in (
        estimate.a, estimate.b, estimate.shear_force_x, estimate.shear_force_y)) else NOTHING


def _require_depth(depth: float) -> None:
    if not (math.isfinite(depth) and depth > 0.0):
        raise ConfigurationError(f'depth is {depth!r}, must be a positive length [m]')
