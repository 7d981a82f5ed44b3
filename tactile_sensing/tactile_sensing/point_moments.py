"""
Point contact from moments: the closed forms of the thesis and its iteration (2.3, 2.4).

Baselines that every faster or better estimator is compared with. Moments are those of the
published images, compression positive (M0 = +P); against the thesis every moment changes
its sign and no result does.
"""

from dataclasses import dataclass, replace
from enum import IntFlag
import math

import numpy as np

from tactile_sensing.errors import ConfigurationError
from tactile_sensing.moments import image_moments, Moments

MAX_STEPS = 30  # the thesis needs fewer than 10; more only helps the slow approach at a border
SMALLEST_MASK = 1.5  # half side of the smallest mask [pitches]
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
    """
    Point contact from moments.

    a, b [m]; normal_force, shear_force_x, shear_force_y [N]; flags; iterations of
    `compensated`, 0 for a closed form; mask, the half side of its last window [m].
    """

    a: float
    b: float
    normal_force: float
    shear_force_x: float
    shear_force_y: float
    flags: MomentFlag = MomentFlag(0)
    iterations: int = 0
    mask: float = NAN


NOTHING = PointMoments(NAN, NAN, NAN, NAN, NAN, MomentFlag.NO_FORCE)


def one_layer(moments, depth, peak):
    """
    Point contact from one layer of pressure, (2.3): model 1.

    The thesis takes the signs of the shear from the peaks of compression and tension;
    where tension is not measured, sign(centroid - peak) gives the same.

    Parameters
    ----------
    moments : Moments
        Of the pressure, up to the second order; of area-averaging tactels after
        `without_averaging`.
    depth : float
        Depth of the tactels [m].
    peak : (float, float)
        Position of the largest pressure [m], see `peak_position`.

    Returns
    -------
    PointMoments
        Flagged where a discriminant is negative, as noise makes it under little shear.

    Raises
    ------
    ConfigurationError
        The depth is not a positive length.
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
    return _finite_or_nothing(PointMoments(*position, moments.m0, *shear, flags))


def two_layers(first, second, depths):
    """
    Point contact from two layers of pressure, (2.4): model 2.

    M0 is that of the first, shallower layer, which loses less at the border.

    Parameters
    ----------
    first, second : Moments
        Of the two layers; the zeroth and first orders are used.
    depths : (float, float)
        Their depths [m], increasing.

    Returns
    -------
    PointMoments

    Raises
    ------
    ConfigurationError
        The depths are not positive and increasing.
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


def normal_and_shear(
        normal, shear_x, depth, *, shear_y=None, min_shear_ratio=MIN_SHEAR_RATIO):
    """
    Point contact from pressure and shear stress in one layer, (2.6) corrected: model 3.

    With Table 2.3, a = (Mx - d SM0) / M0, b = SMy / SM0 and Qy = (My - b M0) / d; print
    has My in place of Mx in a, SMx / M0 for b and Mx in Qy.

    Parameters
    ----------
    normal : Moments
        Of the pressure; the zeroth and first orders are used.
    shear_x : Moments
        Of the 'xz' layer, likewise.
    depth : float
        Depth of both layers [m].
    shear_y : Moments, optional
        Of the 'yz' layer. Then b = (My - d SM0) / M0 as for a, and nothing is singular.
    min_shear_ratio : float
        Without it, b is singular where |Qx| is at most this fraction of P.

    Returns
    -------
    PointMoments

    Raises
    ------
    ConfigurationError
        The depth is not a positive length.
    """
    _require_depth(depth)
    if not (_has_force(normal) and _finite(shear_x) and (shear_y is None or _finite(shear_y))):
        return NOTHING
    flags = MomentFlag(0)
    if shear_y is not None:
        force_y = shear_y.m0
        b = (normal.my - depth * force_y) / normal.m0
    elif abs(shear_x.m0) > min_shear_ratio * normal.m0:
        b = shear_x.my / shear_x.m0
        force_y = (normal.my - b * normal.m0) / depth
    else:
        flags = MomentFlag.SINGULAR
        b, force_y = normal.my / normal.m0, 0.0
    a = (normal.mx - depth * shear_x.m0) / normal.m0
    return _finite_or_nothing(PointMoments(a, b, normal.m0, shear_x.m0, force_y, flags))


def compensation_factors(half_side, depth):
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


def without_averaging(moments, size_x, size_y):
    """
    Moments with side^2 / 12 M0 taken off the second ones (Sheppard's correction).

    Area-averaging tactels of these sides [m] add it, which makes the discriminants of (2.3)
    negative whenever |Q| < P side / (sqrt(12) d). To be applied before any compensation.
    """
    return replace(
        moments, mxx=moments.mxx - size_x**2 / 12.0 * moments.m0,
        myy=moments.myy - size_y**2 / 12.0 * moments.m0)


def peak_position(pressure, array):
    """
    Position (x, y) of the largest pressure [m]; NaN where no tactel is finite.

    The vertex of the parabola through the tactel and its neighbours along each axis.
    """
    image = np.asarray(pressure, dtype=float)
    if not np.isfinite(image).any():
        return NAN, NAN
    row, column = np.unravel_index(
        np.argmax(np.where(np.isfinite(image), image, -np.inf)), image.shape)
    return (array.x[column] + array.pitch_x * _vertex(image[row, :], column),
            array.y[row] + array.pitch_y * _vertex(image[:, column], row))


def basic(images, array, layers, *, averaging=False):
    """
    Closed form of the layers given, from the moments of the whole images.

    Parameters
    ----------
    images : ndarray, shape (layers, rows, columns)
        One image per layer [Pa]; tactels that are not finite count as zero.
    array : TactelArray
        Geometry of the tactels.
    layers : sequence
        Objects with `component` and `depth` [m]: one 'zz' (2.3), two 'zz' of increasing
        depth (2.4), or 'zz', 'xz' and, where measured, 'yz' of one depth (2.6).
    averaging : bool
        The tactels average over their area instead of sampling at their centre.

    Returns
    -------
    PointMoments

    Raises
    ------
    ConfigurationError
        No closed form for these layers, or an image of another shape.
    """
    images = _checked(images, array, layers)
    moments = [image_moments(image, array) for image in images]
    if averaging:
        moments = [without_averaging(m, array.pitch_x, array.pitch_y) for m in moments]
    return _closed_form(moments, layers, peak_position(images[0], array))


def compensated(
        images, array, layers, *, averaging=False, printed=False, tolerance=1e-6,
        max_steps=MAX_STEPS):
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
        Largest number of steps, at least 1.

    Returns
    -------
    PointMoments

    Raises
    ------
    ConfigurationError
        As for `basic`, or a tolerance or number of steps that is not positive.
    """
    if not tolerance > 0.0:
        raise ConfigurationError(f'tolerance is {tolerance!r}, must be positive [m]')
    if max_steps < 1:
        raise ConfigurationError(f'max_steps is {max_steps!r}, must be at least 1')
    images = _checked(images, array, layers)
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
        moments = [_mask_moments(image, array, x, y, mask) for image in images]
        if averaging:
            moments = [without_averaging(m, array.pitch_x, array.pitch_y) for m in moments]
        moments = [_compensate(m, layer, mask) for m, layer in zip(moments, layers, strict=True)]
        moved = _closed_form(moments, layers, (peak[0] - x, peak[1] - y))
        if moved.flags & MomentFlag.NO_FORCE:  # the mask has lost the contact
            break
        if not printed:
            moved = _without_overshoot(moved, layers, mask)
        estimate = replace(moved, a=x + moved.a, b=y + moved.b, iterations=step, mask=mask)
        if max(abs(moved.a), abs(moved.b)) < tolerance:
            return estimate
    return replace(estimate, flags=estimate.flags | MomentFlag.NOT_CONVERGED)


def _closed_form(moments, layers, peak):
    components = tuple(layer.component for layer in layers)
    if components == ('zz',):
        return one_layer(moments[0], layers[0].depth, peak)
    if components == ('zz', 'zz'):
        return two_layers(*moments, (layers[0].depth, layers[1].depth))
    if components in (('zz', 'xz'), ('zz', 'xz', 'yz')) \
            and all(layer.depth == layers[0].depth for layer in layers):
        return normal_and_shear(
            *moments[:2], layers[0].depth, shear_y=moments[2] if len(moments) > 2 else None)
    given = ', '.join(f'{layer.component}@{layer.depth}' for layer in layers)
    raise ConfigurationError(
        f'layers are {given or "none"}, must be zz, two of zz, or zz with xz and yz at one depth')


def _mask_moments(image, array, x, y, mask):
    """Moments about (x, y) of the part of an image within |x' - x|, |y' - y| <= mask."""
    weight_x, arm_x = _overlap(array.x - x, array.pitch_x, mask)
    weight_y, arm_y = _overlap(array.y - y, array.pitch_y, mask)
    by_column, by_row = weight_y @ image * weight_x, image @ weight_x * weight_y
    return Moments(
        m0=float(by_column.sum()), mx=float(by_column @ arm_x), my=float(by_row @ arm_y),
        mxx=float(by_column @ arm_x**2), myy=float(by_row @ arm_y**2),
        mxy=float((weight_y * arm_y) @ image @ (weight_x * arm_x)))


def _overlap(centres, pitch, mask):
    """Length of every tactel within [-mask, mask] and the centre of that part."""
    first = np.clip(centres - 0.5 * pitch, -mask, mask)
    last = np.clip(centres + 0.5 * pitch, -mask, mask)
    return last - first, 0.5 * (first + last)


def _compensate(moments, layer, mask):
    k0, k1 = compensation_factors(mask, layer.depth)
    if layer.component != 'zz':
        k0 = k1
    return Moments(moments.m0 / k0, moments.mx / k1, moments.my / k1,
                   moments.mxx / k1, moments.myy / k1, moments.mxy / k1)


def _without_overshoot(moved, layers, mask):
    """Position relative to the mask where a shear layer gives it without factors."""
    components = [layer.component for layer in layers]
    k0, k1 = compensation_factors(mask, layers[0].depth)
    return replace(
        moved, a=moved.a * (k1 / k0 if 'xz' in components else 1.0),
        b=moved.b * (k1 / k0 if 'yz' in components else 1.0))


def _vertex(line, peak):
    """How far the vertex is off the peak [tactels], at most half; 0 where unknown."""
    if not 0 < peak < line.size - 1:
        return 0.0
    left, middle, right = line[peak - 1:peak + 2]
    curvature = left - 2.0 * middle + right
    if not (math.isfinite(curvature) and curvature < 0.0):
        return 0.0
    return 0.5 * (left - right) / curvature


def _checked(images, array, layers):
    images = np.asarray(images, dtype=float)
    expected = (len(layers), *array.shape)
    if images.shape != expected:
        raise ConfigurationError(f'images have shape {images.shape}, must be {expected}')
    return np.where(np.isfinite(images), images, 0.0)


def _has_force(moments, *, second_order=False):
    return moments.m0 > 0.0 and _finite(moments) and (
        not second_order or (math.isfinite(moments.mxx) and math.isfinite(moments.myy)))


def _finite(moments):
    return all(math.isfinite(value) for value in (moments.m0, moments.mx, moments.my))


def _finite_or_nothing(estimate):
    """The estimate, or NOTHING where huge or tiny moments overflow a quotient."""
    return estimate if all(math.isfinite(value) for value in (
        estimate.a, estimate.b, estimate.shear_force_x, estimate.shear_force_y)) else NOTHING


def _require_depth(depth):
    if not (math.isfinite(depth) and depth > 0.0):
        raise ConfigurationError(f'depth is {depth!r}, must be a positive length [m]')
