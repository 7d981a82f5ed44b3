"""
Pressure of point and line loads on a skin for compiled loops: the polynomials of `kernel`.

A *shape* (2, DEGREE + 1) has the polynomials of f and g, highest power first, in SI units, for
one kind of load, one layer and one variance of the patch; a *kernel* is the same as tuples. The
pressure is force f(s) + (shear . offset) g(s), s the squared distance.
"""

import math

from tactile_common.kernels import FAST, njit, to_fixed_tuple
from tactile_sensing.skin.kernel import CENTRE, DEGREE, MAX_VARIANCE

F, G = 0, 1  # rows of a shape
TERMS = DEGREE + 1
POINT_ROW, LINE_ROW, LINE_TURNED_ROW = range(3)  # of `kernel.polynomials`


@njit(error_model='numpy')
def centre_of(depth):
    """c^2 of the polynomials' t = c^2 / (s + c^2) [m^2]."""
    return (CENTRE * depth) ** 2


@njit(error_model='numpy')
def largest_variance(depth):
    """Largest variance of a patch along an axis that the polynomials know [m^2]."""
    return MAX_VARIANCE * depth * depth


@njit(error_model='numpy')
def make_shape(polynomials, depth, row, yaw, variance, shape, slope):
    """Shape at the variance of a patch [m^2], and its derivative by it; yaw is that of a line."""
    relative, turned = variance / (depth * depth), math.cos(4.0 * yaw)
    scale = 1.0 / depth if row == LINE_ROW else 1.0 / (depth * depth)
    for part in range(2):
        if part == G:
            scale /= depth
        for j in range(DEGREE + 1):
            value = by = 0.0
            for i in range(polynomials.shape[1] - 1, -1, -1):
                coefficient = polynomials[row, i, part, j]
                if row == LINE_ROW:
                    coefficient += turned * polynomials[LINE_TURNED_ROW, i, part, j]
                by = by * relative + value
                value = value * relative + coefficient
            shape[part, DEGREE - j] = scale * value
            slope[part, DEGREE - j] = scale * by / (depth * depth)


@njit(error_model='numpy')
def _fill(polynomials, power, depth, row, yaw, scale, shape):
    """Coefficients of one power of the variance."""
    turned = math.cos(4.0 * yaw) if row == LINE_ROW else 0.0
    for part in range(2):
        if part == G:
            scale /= depth
        for j in range(DEGREE + 1):
            shape[part, DEGREE - j] = scale * (polynomials[row, power, part, j] + (
                turned * polynomials[LINE_TURNED_ROW, power, part, j]))


@njit(error_model='numpy')
def make_first_slope(polynomials, depth, row, yaw, slope):
    """Derivative of the shape of a load without a patch by the variance of one."""
    scale = 1.0 / depth**3 if row == LINE_ROW else 1.0 / depth**4
    _fill(polynomials, 1, depth, row, yaw, scale, slope)


@njit(cache=True, error_model='numpy')
def make_sharp_shape(polynomials, depth, row, yaw, shape):
    """Shape of a load without a patch; yaw is that of a line."""
    scale = 1.0 / depth if row == LINE_ROW else 1.0 / (depth * depth)
    _fill(polynomials, 0, depth, row, yaw, scale, shape)


@njit(error_model='numpy')
def sharp_top(polynomials, depth):
    """Pressure above a sharp line load of 1 N/m [Pa]."""
    return polynomials[LINE_ROW, 0, F, :].sum() / depth


@njit(error_model='numpy')
def coefficients_of(shape):
    """A shape as two tuples: loops over them unroll, so that those over tactels are vectorised."""
    return to_fixed_tuple(shape[F], TERMS), to_fixed_tuple(shape[G], TERMS)


@njit(error_model='numpy', fastmath=FAST)
def polynomial(coefficients, t):
    """Value and derivative."""
    value = by = 0.0
    for coefficient in coefficients:
        by = by * t + value
        value = value * t + coefficient
    return value, by


@njit(error_model='numpy', fastmath=FAST)
def value_of(coefficients, t):
    """Value alone."""
    value = 0.0
    for coefficient in coefficients:
        value = value * t + coefficient
    return value


@njit(error_model='numpy', fastmath=FAST)
def at_distance(kernel, centre, squared):
    """Values f and g, and twice their derivatives by the squared distance."""
    of_f, of_g = kernel
    t = centre / (squared + centre)
    f, df = polynomial(of_f, t)
    g, dg = polynomial(of_g, t)
    by = -2.0 * t * t / centre
    return f, g, by * df, by * dg


@njit(error_model='numpy', fastmath=FAST)
def all_at(shape, slope, centre, squared):
    """
    Values f and g, twice their derivatives by the squared distance, and those by the variance.

    For loops that are seldom run: from arrays, which compiles to little code.
    """
    t = centre / (squared + centre)
    f = g = df = dg = by_f = by_g = 0.0
    for j in range(shape.shape[1]):
        df = df * t + f
        f = f * t + shape[F, j]
        dg = dg * t + g
        g = g * t + shape[G, j]
        by_f = by_f * t + slope[F, j]
        by_g = by_g * t + slope[G, j]
    by = -2.0 * t * t / centre
    return f, g, by * df, by * dg, by_f, by_g


@njit(error_model='numpy', fastmath=FAST)
def values_at(kernel, centre, squared):
    """Values f and g alone."""
    of_f, of_g = kernel
    t = centre / (squared + centre)
    return value_of(of_f, t), value_of(of_g, t)


@njit(error_model='numpy', fastmath=FAST)
def add_point_forces(x, y, a, b, kernel, centre, scale, kept, by_force, by_shear_x, by_shear_y):
    """Add one layer's derivatives by the forces; `kept` rows are for `add_point_place`."""
    levers, slopes, lever_slopes = kept
    for i in range(x.size):
        u = x[i] - a
        v = y[i] - b
        f, g, df, dg = at_distance(kernel, centre, u * u + v * v)
        levers[i] = scale * g
        slopes[i] = scale * df
        lever_slopes[i] = scale * dg
        by_force[i] += scale * f
        by_shear_x[i] += scale * g * u
        by_shear_y[i] += scale * g * v


@njit(error_model='numpy', fastmath=FAST)
def add_point_place(x, y, a, b, load, kept, by_a, by_b):
    """Add one layer's derivatives by (a, b)."""
    force, shear_x, shear_y = load.force, load.shear_x, load.shear_y
    levers, slopes, lever_slopes = kept
    for i in range(x.size):
        u = x[i] - a
        v = y[i] - b
        by = force * slopes[i] + (shear_x * u + shear_y * v) * lever_slopes[i]
        by_a[i] -= by * u + shear_x * levers[i]
        by_b[i] -= by * v + shear_y * levers[i]


@njit(error_model='numpy', fastmath=FAST)
def add_line_forces(x, y, cos, sin, rho, kernel, centre, scale, kept, by_force, by_shear):
    """Add one layer's derivatives by the forces; `kept` rows are for `add_line_place`."""
    levers, slopes, lever_slopes = kept
    for i in range(x.size):
        v = x[i] * cos + y[i] * sin - rho
        f, g, df, dg = at_distance(kernel, centre, v * v)
        levers[i] = scale * g
        slopes[i] = scale * df
        lever_slopes[i] = scale * dg
        by_force[i] += scale * f
        by_shear[i] += scale * g * v


@njit(error_model='numpy', fastmath=FAST)
def add_line_place(x, y, cos, sin, rho, along, load, kept, by_rho, by_yaw):
    """Add one layer's derivatives by (rho, yaw), see `half_space.kernels.add_line_place`."""
    force, shear = load.force, load.shear
    levers, slopes, lever_slopes = kept
    for i in range(x.size):
        v = x[i] * cos + y[i] * sin - rho
        by = -(force * slopes[i] + shear * v * lever_slopes[i]) * v - shear * levers[i]
        by_rho[i] += by
        by_yaw[i] -= by * (y[i] * cos - x[i] * sin + along)
