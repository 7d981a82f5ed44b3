"""
Image of a load on an array, and its derivatives by the parameters of the load; compiled.

A *bump* is the pressure P f(s) + (Q . offset) g(s), where s is the squared distance from a point
or a line. The force P of a line may grow linearly along it; near its ends this is approximate. On
a known skin, f and g are the polynomials of `skin.kernel`; the only unknown of their shape is the
variance of the load's patch. On an unknown skin, f = p / (1 - b + b p) and g = f / w, where
p = (1 + s / w^2)^-n (line: n - 1/2). With b = 0, this is exact for a half-space, with w the depth
and n = 5/2. The half width at half height and the exponent n are then unknowns. They cover depth,
bone, bluntness and the area of the tactels together. The bump of a point may also be elongated, as
under a finger, and any bump blunt (b > 0), as under a broad object.
"""

from collections.abc import Callable
import math
from typing import NamedTuple

import numpy as np

from tactile_common.kernels import FAST, njit, to_fixed_tuple
from tactile_sensing.skin.kernel import CENTRE, DEGREE

POINT, LINE, TWO, PLATE = 1, 2, 3, 4
BEYOND = 8.0  # a line is invisible from this distance outside the pad [depths]
LOG2 = math.log(2.0)
TERMS = DEGREE + 1  # of a polynomial
MANTISSA, BIAS = 52, 1023  # of a double: bits, exponent of 1


class Parameters(NamedTuple):
    """
    Places of the parameters of a load; those of different loads may share one.

    Directions and distances along a line are from the foot of the origin. SHEAR_U of a line is
    the shear across it.
    """

    Q0: int = 0  # x of a point, distance rho of a line or of a border of a plate [m]
    Q1: int = 1  # y of a point [m]; yaw of a line, or of a border with the plate on its left [rad]
    BEGIN: int = 2  # end of a line, or of a plate, along it [m]
    END: int = 3  # other end of a line [m]
    SHARE: int = 4  # of the load on the second of TWO; of the pressure high on a PLATE's borders
    WIDTH: int = 5  # known skin: variance of the patch [depths^2]; else log of the half width [m]
    EXPONENT: int = 6  # log n
    FORCE: int = 7  # of a point [N], of a line [N/m]
    SHEAR_U: int = 8
    SHEAR_V: int = 9
    BASE: int = 10  # baseline of the first layer; the others follow
    Q2: int = 2  # x and y of the second of TWO points [m]
    Q3: int = 3
    # Stretch: s = (1 - LONG_X) u^2 + (1 + LONG_X) v^2 - 2 LONG_XY u v
    LONG_X: int = 2
    LONG_XY: int = 3
    BLUNT: int = 4  # b
    TAPER: int = 9  # growth of a line's force along it, over half the pad's diagonal [N/m]


P = Parameters()


def _interpolated(function: Callable, degree: int) -> tuple[float, ...]:
    """Return a polynomial for a function on [0, 1], highest power first."""
    chebyshev = np.polynomial.Chebyshev.interpolate(function, degree, [0.0, 1.0])
    power = chebyshev.convert(kind=np.polynomial.Polynomial)
    return tuple(power.convert(domain=[-1.0, 1.0]).coef[::-1].tolist())


LOG2_OF, TWO_TO = _interpolated(lambda x: np.log2(1.0 + x), 11), _interpolated(np.exp2, 6)


class Pad(NamedTuple):
    """Tactels and skin of a sensor."""

    x: np.ndarray  # centres of the columns [m]
    y: np.ndarray  # centres of the rows [m]
    half_x: float  # half of the extent along x, outer borders of the tactels included [m]
    half_y: float  # the same along y [m]
    pitch: float  # geometric mean of both pitches [m]
    nodes: np.ndarray  # (N, 3): quadrature over a tactel: offset from its centre [m], weight
    depths: np.ndarray  # (layers,) [m]; 0: unknown skin
    levers: np.ndarray  # (layers, 3): component = (gz + gx x' + gy y') times the pressure
    polynomials: np.ndarray  # (layers, *shape of `skin.kernel.polynomials`); empty: unknown skin


@njit(error_model='numpy')
def coefficients_of(shape: np.ndarray) -> tuple[float, ...]:
    """Convert coefficients to a tuple, so that loops over them unroll and tactels vectorise."""
    return to_fixed_tuple(shape, TERMS)


@njit(error_model='numpy', fastmath=FAST)
def value_of(coefficients: tuple[float, ...], t: float) -> float:
    """Evaluate a polynomial, highest power first."""
    value = 0.0
    for coefficient in coefficients:
        value = value * t + coefficient
    return value


# Tactels are computed in blocks of constant size, so that loops over them vectorise. Rows of the
# work array of a block, at one node: U, V distances from the load; ALONG the line; S squared
# distance s, half its derivatives by u, v; f and g, their derivatives by s, by log w, by n, by b;
# T; derivatives by BEGIN and END; temporary values; GROWS: ALONG in half diagonals of the pad, 0
# for a point.
BLOCK = 64
(U, V, ALONG, S, SU, SV, F, G, FS, GS, FW, GW, FN, GN, FB, GB, T, F0, G0, F1, G1, FIRST, LAST,
 AT_FIRST, AT_LAST, POWER, GROWS, SCRATCH) = range(0, 28 * BLOCK, BLOCK)


@njit(error_model='numpy', fastmath=FAST)
def _from_load(part: np.ndarray, places: np.ndarray, dx: float, dy: float, line: bool, cos: float,
               sin: float, theta: np.ndarray, half: float) -> None:
    """Fill rows U to SV and GROWS at a node of the tactels at places (2, BLOCK) [m]."""
    for i in range(BLOCK):
        x, y = places[0, i] + dx, places[1, i] + dy
        if line:
            u, part[ALONG + i] = x * cos + y * sin - theta[P.Q0], y * cos - x * sin
            part[GROWS + i] = part[ALONG + i] / half
            part[U + i], part[SU + i], part[S + i] = u, u, u * u
        else:
            u, v = x - theta[P.Q0], y - theta[P.Q1]
            by_u = (1.0 - theta[P.LONG_X]) * u - theta[P.LONG_XY] * v
            by_v = (1.0 + theta[P.LONG_X]) * v - theta[P.LONG_XY] * u
            part[U + i], part[V + i], part[S + i] = u, v, by_u * u + by_v * v
            part[SU + i], part[SV + i] = by_u, by_v


@njit(error_model='numpy', fastmath=FAST)
def _power_of(base: float, n: float) -> tuple[float, float]:
    """
    Return the natural log of a base, which is at least 1, and base^-n.

    The polynomials are within 3e-10. Functions of the C library would not vectorise.
    """
    bits = np.float64(base).view(np.int64)
    exponent = (bits >> MANTISSA) - BIAS
    part = np.int64(bits - (exponent << MANTISSA)).view(np.float64) - 1.0
    log2 = exponent + value_of(LOG2_OF, part)
    down = max(-n * log2, 1.0 - BIAS)
    whole = math.floor(down)
    two = np.int64((np.int64(whole) + BIAS) << MANTISSA).view(np.float64)
    return LOG2 * log2, two * value_of(TWO_TO, down - whole)


@njit(error_model='numpy', fastmath=FAST)
def _power_bumps(part: np.ndarray, w: float, n: float, blunt: float) -> None:
    """Fill rows F to GB for a bump on an unknown skin."""
    inverse = 1.0 / (w * w)
    for i in range(BLOCK):
        base = 1.0 + part[S + i] * inverse
        log, power = _power_of(base, n)
        q, left = 1.0 / base, 1.0 / (1.0 - blunt + blunt * power)
        f, slope = power * left, (1.0 - blunt) * power * left * left
        fs, fw, fn = -n * slope * q * inverse, 2.0 * n * slope * (1.0 - q), -log * slope
        fb = f * left * (1.0 - power)
        part[F + i], part[G + i] = f, f / w
        part[FS + i], part[GS + i] = fs, fs / w
        part[FW + i], part[GW + i] = fw, (fw - f) / w
        part[FN + i], part[GN + i] = fn, fn / w
        part[FB + i], part[GB + i] = fb, fb / w


@njit(error_model='numpy', fastmath=FAST)
def _with_slope(coefficients: tuple[float, ...], t: float) -> tuple[float, float]:
    """Evaluate a polynomial, highest power first, and its derivative."""
    value = slope = 0.0
    for coefficient in coefficients:
        slope = slope * t + value
        value = value * t + coefficient
    return value, slope


@njit(error_model='numpy', fastmath=FAST)
def _skin_bumps(part: np.ndarray, shape: np.ndarray, slope: np.ndarray, centre: float,
                wide: bool) -> None:
    """Fill rows F to GW for a bump on a known skin; FW to GB only if `wide`."""
    f, g = coefficients_of(shape[0]), coefficients_of(shape[1])
    for i in range(BLOCK):
        t = centre / (part[S + i] + centre)
        by = -t * t / centre
        part[F + i], fs = _with_slope(f, t)
        part[G + i], gs = _with_slope(g, t)
        part[T + i], part[FS + i], part[GS + i] = t, by * fs, by * gs
    if wide:
        part[FN:T] = 0.0
        fw, gw = coefficients_of(slope[0]), coefficients_of(slope[1])
        for i in range(BLOCK):
            part[FW + i], part[GW + i] = value_of(fw, part[T + i]), value_of(gw, part[T + i])


@njit(error_model='numpy', fastmath=FAST)
def _power_part(q: float, u: float) -> tuple[float, float, float]:
    """
    Return the share of a line (n = 5/2) up to u, and its derivatives by q = 1 + v^2 and by u.

    u and v are in units of w.
    """
    r = q + u * u
    root = r ** 0.5  # vectorises, other than `math.sqrt`
    r25 = r * r * root
    return (0.25 * u * (3.0 * q + 2.0 * u * u) / (r * root), -0.375 * u * q / r25,
            0.75 * q * q / r25)


@njit(cache=True, error_model='numpy')
def shape_of(polynomials: np.ndarray, depth: float, row: int, yaw: float, relative: float,
             shape: np.ndarray, slope: np.ndarray) -> None:
    """Write the polynomials of f and g, highest power first, and their slope by `relative`."""
    turned = math.cos(4.0 * yaw) if row == 1 else 0.0
    scale = 1.0 / depth if row == 1 else 1.0 / (depth * depth)
    for part in range(2):
        if part == 1:
            scale /= depth
        for j in range(DEGREE + 1):
            value = by = 0.0
            for i in range(polynomials.shape[1] - 1, -1, -1):
                coefficient = polynomials[row, i, part, j]
                if row == 1:
                    coefficient += turned * polynomials[2, i, part, j]
                by = by * relative + value
                value = value * relative + coefficient
            shape[part, DEGREE - j] = scale * value
            slope[part, DEGREE - j] = scale * by


def sharp_point(polynomials: np.ndarray, depth: float) -> np.ndarray:
    """Return the coefficients (TERMS,) for a normal point load, highest power of t first."""
    shape, slope = np.zeros((2, TERMS)), np.zeros((2, TERMS))
    shape_of(polynomials, depth, 0, 0.0, 0.0, shape, slope)
    return shape[0]


@njit(cache=True, error_model='numpy')
def chord(half_x: float, half_y: float, rho: float, yaw: float) -> tuple[float, float]:
    """Return where a line enters and leaves a pad, along it from the foot of the origin [m]."""
    cos, sin = math.cos(yaw), math.sin(yaw)
    first, last = -np.inf, np.inf
    for place, slope, half in ((rho * cos, -sin, half_x), (rho * sin, cos, half_y)):
        if abs(slope) > 1e-12:
            one, other = (-half - place) / slope, (half - place) / slope
            first, last = max(first, min(one, other)), min(last, max(one, other))
        elif abs(place) > half:
            return 0.0, -1.0
    return first, last


@njit(error_model='numpy')
def loaded_chord(pad: Pad, theta: np.ndarray, ends: bool) -> tuple[float, float]:
    """Return where the loaded part of a line on the pad begins and ends, as `chord`."""
    first, last = chord(pad.half_x, pad.half_y, theta[P.Q0], theta[P.Q1])
    if ends:
        first, last = max(first, theta[P.BEGIN]), min(last, theta[P.END])
    return first, last


@njit(error_model='numpy', fastmath=FAST)
def _end_power(part: np.ndarray, w: float, begin: float, end: float) -> None:
    """Limit the power bumps of a line to the part from begin to end."""
    for i in range(BLOCK):
        q = 1.0 + part[S + i] / (w * w)
        a, b = (begin - part[ALONG + i]) / w, (end - part[ALONG + i]) / w
        sa, qa, ua = _power_part(q, a)
        sb, qb, ub = _power_part(q, b)
        share, by_q = sb - sa, qb - qa
        by_w = -2.0 * (q - 1.0) * by_q - ub * b + ua * a
        f, g = part[F + i], part[G + i]
        part[F0 + i], part[G0 + i] = -f * ua / w, -g * ua / w
        part[F1 + i], part[G1 + i] = f * ub / w, g * ub / w
        part[FW + i] = part[FW + i] * share + f * by_w
        part[GW + i] = part[GW + i] * share + g * by_w
        part[FS + i] = part[FS + i] * share + f * by_q / (w * w)
        part[GS + i] = part[GS + i] * share + g * by_q / (w * w)
        for row in (FN, GN, FB, GB):
            part[row + i] *= share
        part[F + i], part[G + i] = f * share, g * share


@njit(error_model='numpy', fastmath=FAST)
def _end_skin(part: np.ndarray, tip: np.ndarray, tip_slope: np.ndarray, centre: float,
              begin: float, end: float) -> None:
    """
    Fill rows F to GW and F0 to G1 for a line from begin to end on a known skin.

    They are integrals of a point's bump along the line. Integration by parts gives a recursion
    over the powers of t = c^2 / (u^2 + w^2 + c^2).
    """
    part[F:GROWS] = 0.0
    f_tip, g_tip = coefficients_of(tip[0]), coefficients_of(tip[1])
    for i in range(BLOCK):
        low, high = begin - part[ALONG + i], end - part[ALONG + i]
        across = centre + part[S + i]
        root = across ** 0.5
        part[T + i] = centre / across
        part[AT_FIRST + i], part[AT_LAST + i] = (
            centre / (across + low * low), centre / (across + high * high))
        part[F0 + i], part[G0 + i] = -value_of(f_tip, part[AT_FIRST + i]), -value_of(
            g_tip, part[AT_FIRST + i])
        part[F1 + i], part[G1 + i] = value_of(f_tip, part[AT_LAST + i]), value_of(
            g_tip, part[AT_LAST + i])
        part[FIRST + i], part[LAST + i] = low * part[AT_FIRST + i], high * part[AT_LAST + i]
        part[POWER + i] = centre / root * math.atan2((high - low) * root, across + high * low)
        part[F + i] = tip[0, DEGREE] * (high - low)
        part[G + i] = tip[1, DEGREE] * (high - low)
        part[FW + i] = tip_slope[0, DEGREE] * (high - low)
        part[GW + i] = tip_slope[1, DEGREE] * (high - low)
    for n in range(1, DEGREE + 1):
        f, g = tip[0, DEGREE - n], tip[1, DEGREE - n]
        fw, gw = tip_slope[0, DEGREE - n], tip_slope[1, DEGREE - n]
        for i in range(BLOCK):
            power = part[POWER + i]
            part[F + i] += f * power
            part[G + i] += g * power
            part[FW + i] += fw * power
            part[GW + i] += gw * power
            power = part[T + i] * (
                part[LAST + i] - part[FIRST + i] + (2.0 * n - 1.0) * power) / (2.0 * n)
            part[FS + i] -= n * f * power / centre
            part[GS + i] -= n * g * power / centre
            part[FIRST + i] *= part[AT_FIRST + i]
            part[LAST + i] *= part[AT_LAST + i]
            part[POWER + i] = power


@njit(error_model='numpy', fastmath=FAST)
def _accumulate(part: np.ndarray, line: bool, ends: bool, wide: bool, lever: np.ndarray,
                turned: float, node: float, theta: np.ndarray, half: float,
                sums: np.ndarray) -> None:
    """
    Add the contribution of a node to the derivatives and, in the row of BASE, the image.

    The derivatives in the rows of WIDTH, EXPONENT and BLUNT are those by log w, n and b.
    """
    shear_u, shear_v = theta[P.SHEAR_U], theta[P.SHEAR_V]
    rho, gz, gx, gy = theta[P.Q0], lever[0], lever[1], lever[2]
    for i in range(BLOCK):
        u, v = part[U + i], part[V + i]
        share = node * (gz + gx * u + gy * v)
        force = theta[P.FORCE] + theta[P.TAPER] * part[GROWS + i]
        across = shear_u * u + shear_v * v
        common = 2.0 * (force * part[FS + i] + across * part[GS + i])
        value = force * part[F + i] + across * part[G + i]
        by_u = share * (common * part[SU + i] + shear_u * part[G + i])
        sums[P.BASE * BLOCK + i] += share * value
        sums[P.Q0 * BLOCK + i] -= by_u + node * gx * value
        if line:
            sums[P.Q1 * BLOCK + i] += by_u * part[ALONG + i] + node * turned * u * value
            sums[P.Q1 * BLOCK + i] += node * gx * value * part[ALONG + i]
            sums[P.Q1 * BLOCK + i] -= share * part[F + i] * theta[P.TAPER] * (u + rho) / half
            sums[P.TAPER * BLOCK + i] += share * part[F + i] * part[GROWS + i]
        else:
            sums[P.Q1 * BLOCK + i] -= share * (common * part[SV + i] + shear_v * part[G + i])
            sums[P.Q1 * BLOCK + i] -= node * gy * value
            sums[P.SHEAR_V * BLOCK + i] += share * part[G + i] * v
        sums[P.FORCE * BLOCK + i] += share * part[F + i]
        sums[P.SHEAR_U * BLOCK + i] += share * part[G + i] * u
    for i in range(BLOCK if wide else 0):
        u, v = part[U + i], part[V + i]
        share = node * (gz + gx * u + gy * v)
        force = theta[P.FORCE] + theta[P.TAPER] * part[GROWS + i]
        across = shear_u * u + shear_v * v
        sums[P.WIDTH * BLOCK + i] += share * (force * part[FW + i] + across * part[GW + i])
        sums[P.EXPONENT * BLOCK + i] += share * (force * part[FN + i] + across * part[GN + i])
        sums[P.BLUNT * BLOCK + i] += share * (force * part[FB + i] + across * part[GB + i])
        if not line:
            by_s = share * (force * part[FS + i] + across * part[GS + i])
            sums[P.LONG_X * BLOCK + i] += by_s * (v * v - u * u)
            sums[P.LONG_XY * BLOCK + i] -= 2.0 * by_s * u * v
    if ends:
        for i in range(BLOCK):
            across = shear_u * part[U + i]
            share = node * (gz + gx * part[U + i])
            force = theta[P.FORCE] + theta[P.TAPER] * part[GROWS + i]
            first = share * (force * part[F0 + i] + across * part[G0 + i])
            last = share * (force * part[F1 + i] + across * part[G1 + i])
            sums[P.Q1 * BLOCK + i] += (first + last) * (part[U + i] + rho)
            sums[P.BEGIN * BLOCK + i] += first
            sums[P.END * BLOCK + i] += last


@njit(cache=True, error_model='numpy')
def add_rows(kind: int, power: bool, ends: bool, wide: bool, nodes: np.ndarray, pad: Pad,
             theta: np.ndarray, by: np.ndarray, model: np.ndarray) -> None:
    """
    Compute the image of a load and its derivatives.

    Parameters
    ----------
    kind : int
        POINT or LINE.
    power, ends, wide : bool
        Whether the skin is unknown; whether a line has ends; whether derivatives by the shape of
        the bump are needed.
    nodes : ndarray, shape (N, 3)
        Quadrature over a tactel, as `Pad.nodes`.
    pad : Pad
    theta : ndarray, shape (parameters,)
    by : ndarray, shape (parameters, layers * rows * columns)
        Output: derivatives by every parameter.
    model : ndarray, shape (layers * rows * columns,)
        Output: the image, without the baselines.
    """
    rows, columns = pad.y.size, pad.x.size
    size = rows * columns
    part, sums = np.empty(SCRATCH), np.empty((P.BASE + 1) * BLOCK)
    part[V:V + BLOCK] = part[GROWS:GROWS + BLOCK] = 0.0
    places = np.zeros((2, (size + BLOCK - 1) // BLOCK * BLOCK))
    for r in range(rows):
        for c in range(columns):
            places[0, r * columns + c], places[1, r * columns + c] = pad.x[c], pad.y[r]
    shape, slope, tip, tip_slope = np.empty((4, 2, TERMS))
    line, half = kind == LINE, math.hypot(pad.half_x, pad.half_y)
    cos, sin, w, n, height = 1.0, 0.0, 1.0, 1.0, 1.0
    if line:
        cos, sin = math.cos(theta[P.Q1]), math.sin(theta[P.Q1])
    if power:
        n = math.exp(theta[P.EXPONENT])
        height = (2.0 - theta[P.BLUNT]) / (1.0 - theta[P.BLUNT])  # 1 / p at half height
        w = math.exp(theta[P.WIDTH]) / math.sqrt(height ** (1.0 / n) - 1.0)
    for k in range(pad.depths.size):
        depth = pad.depths[k]
        centre, reach = (CENTRE * depth) ** 2, BEYOND * depth + half
        begin, end = max(theta[P.BEGIN], -reach), min(theta[P.END], reach)
        if not power:
            ratio = (pad.depths[0] / depth) ** 2  # all layers have the same patch
            shape_of(pad.polynomials[k], depth, kind - 1, theta[P.Q1], ratio * theta[P.WIDTH],
                     shape, slope)
            slope *= ratio
            if ends:
                shape_of(pad.polynomials[k], depth, 0, 0.0, ratio * theta[P.WIDTH], tip, tip_slope)
                tip_slope *= ratio
        lever, turned = pad.levers[k].copy(), 0.0
        if line:  # keep the shear component across the line
            turned = lever[2] * cos - lever[1] * sin
            lever[1], lever[2] = lever[1] * cos + lever[2] * sin, 0.0
        by[P.BASE:, k * size:(k + 1) * size] = 0.0
        by[P.BASE + k, k * size:(k + 1) * size] = 1.0
        for first in range(0, size, BLOCK):
            sums[:] = 0.0
            for j in range(len(nodes)):
                dx, dy, node = nodes[j, 0], nodes[j, 1], nodes[j, 2]
                _from_load(part, places[:, first:first + BLOCK], dx, dy, line, cos, sin, theta,
                           half)
                if ends and not power:
                    _end_skin(part, tip, tip_slope, centre, begin, end)
                elif power:
                    _power_bumps(part, w, n - 0.5 * line, theta[P.BLUNT])
                    if ends:
                        _end_power(part, w, theta[P.BEGIN], theta[P.END])
                else:
                    _skin_bumps(part, shape, slope, centre, wide)
                _accumulate(part, line, ends, wide, lever, turned, node, theta, half, sums)
            begins, count = k * size + first, min(BLOCK, size - first)
            for i in range(count):
                for p in range(P.BASE):
                    by[p, begins + i] = sums[p * BLOCK + i]
                model[begins + i] = sums[P.BASE * BLOCK + i]
    if power:  # w depends on n and b
        narrower = 0.5 / (n * (1.0 - height ** (-1.0 / n)))  # -d(log w) / d(log height)
        by[P.EXPONENT] = n * by[P.EXPONENT] + narrower * math.log(height) * by[P.WIDTH]
        by[P.BLUNT] -= narrower * (height - 2.0 + 1.0 / height) * by[P.WIDTH]


@njit(cache=True, error_model='numpy')
def add_rows_of_two(power: bool, wide: bool, nodes: np.ndarray, pad: Pad, theta: np.ndarray,
                    by: np.ndarray, model: np.ndarray) -> None:
    """Compute the image of TWO points and its derivatives; parameters as of `add_rows`."""
    one, load, share = np.zeros_like(by), theta.copy(), theta[P.SHARE]
    load[P.LONG_X] = load[P.LONG_XY] = load[P.BLUNT] = 0.0
    add_rows(POINT, power, False, wide, nodes, pad, load, one, model)
    alone = model.copy()
    load[P.Q0], load[P.Q1] = theta[P.Q2], theta[P.Q3]
    add_rows(POINT, power, False, wide, nodes, pad, load, by, model)
    by[P.Q2], by[P.Q3] = share * by[P.Q0], share * by[P.Q1]
    by[P.Q0], by[P.Q1] = (1.0 - share) * one[P.Q0], (1.0 - share) * one[P.Q1]
    by[P.SHARE] = model - alone
    for row in range(P.WIDTH, by.shape[0]):
        by[row] = (1.0 - share) * one[row] + share * by[row]
    model[:] = (1.0 - share) * alone + share * model


@njit(error_model='numpy', fastmath=FAST)
def _border(u: float, share: float) -> tuple[float, float, float]:
    """
    Return the pressure at a distance u inside a plate's border; its derivatives by u and share.

    It is that of lines (n = 3) from the border on, and of one on the border; u is in units of w.
    """
    inside, _, line = _power_part(1.0, u)
    more = line / 0.75 - 0.5 - inside
    slope = (1.0 - share - share * u / (0.15 * (1.0 + u * u))) * line
    return 0.5 + inside + share * more, slope, more


@njit(cache=True, error_model='numpy', fastmath=FAST)
def add_rows_of_plate(nodes: np.ndarray, pad: Pad, theta: np.ndarray, by: np.ndarray,
                      model: np.ndarray) -> None:
    """Compute the image of a PLATE on an unknown skin, a product over two borders, and `by`."""
    cos, sin = math.cos(theta[P.Q1]), math.sin(theta[P.Q1])
    share, force = theta[P.SHARE], theta[P.FORCE]
    inverse, columns = math.sqrt(2.0 ** 0.4 - 1.0) * math.exp(-theta[P.WIDTH]), pad.x.size
    by[:P.BASE], by[P.BASE:] = 0.0, 1.0
    for j in range(len(nodes)):
        dx, dy, node = nodes[j, 0], nodes[j, 1], nodes[j, 2]
        for r in range(pad.y.size):
            for c in range(columns):
                t, x, y = r * columns + c, pad.x[c] + dx, pad.y[r] + dy
                across, along = x * cos + y * sin, y * cos - x * sin
                u, v = (across - theta[P.Q0]) * inverse, (along - theta[P.BEGIN]) * inverse
                f, fu, more_u = _border(u, share)
                g, gv, more_v = _border(v, share)
                fu, gv = node * force * fu * g, node * force * gv * f
                by[P.FORCE, t] += node * f * g
                by[P.Q0, t] -= fu * inverse
                by[P.BEGIN, t] -= gv * inverse
                by[P.Q1, t] += (fu * along - gv * across) * inverse
                by[P.WIDTH, t] -= fu * u + gv * v
                by[P.SHARE, t] += node * force * (more_u * g + f * more_v)
    model[:] = force * by[P.FORCE]
