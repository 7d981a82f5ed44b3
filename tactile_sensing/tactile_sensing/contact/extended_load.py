"""
Pressure of loads with a patch, and of lines that end within the pad; all compiled.

A *source* is a point, or a line without ends, seen from its own axes: v across it, w along. What
a line lacks beyond its ends, the integral of points along it, is taken off.
"""

import math
from typing import NamedTuple

import numpy as np

from tactile_common.kernels import FAST, njit
from tactile_sensing.contact.gauss_newton import END, MODEL, POINT, START, VARIANCE, X, Y
from tactile_sensing.half_space.kernels import FORCE, Q0, Q1, SHEAR_X, SHEAR_Y
from tactile_sensing.half_space.layers import half_sides
from tactile_sensing.skin import kernels
from tactile_sensing.skin.kernels import F, G

PATCH, BEGINS, ENDS = 1, 2, 4  # bits of a load's extras
BEYOND = 6.0  # depths beyond the pad from where nothing of a line is seen


class Source(NamedTuple):
    """Axes of a source: v = x cos + y sin - rho, w = depends_on_w (y cos - x sin - at)."""

    cos: float
    sin: float
    rho: float  # [m]
    at: float  # place along the line [m]
    depends_on_w: float  # 1 for a point, 0 for a line


@njit(error_model='numpy')
def source_of(kind, load):
    """Source of a whole load."""
    if kind == POINT:
        return Source(1.0, 0.0, load.a, load.b, 1.0)
    return Source(math.cos(load.yaw), math.sin(load.yaw), load.rho, 0.0, 0.0)


@njit(error_model='numpy')
def along_chord(sensor, rho, yaw):
    """Where a line enters and leaves the pad, along itself from the origin's foot [m]."""
    half_x, half_y = half_sides(sensor)
    cos, sin = math.cos(yaw), math.sin(yaw)
    first, last = -np.inf, np.inf
    # x = rho cos - along sin, y = rho sin + along cos, both within the halves.
    for place, slope, half in ((rho * cos, -sin, half_x), (rho * sin, cos, half_y)):
        if abs(slope) > 1e-12:
            one, other = (-half - place) / slope, (half - place) / slope
            first, last = max(first, min(one, other)), min(last, max(one, other))
    return first, last


@njit(error_model='numpy')
def lacking_part(bit, sensor, load, depth):
    """What a line lacks before it begins (bit BEGINS) or behind its end (ENDS): from, to [m]."""
    first, last = along_chord(sensor, load.rho, load.yaw)
    if bit == BEGINS:
        return first - BEYOND * depth, load.start
    return load.end, last + BEYOND * depth


@njit(error_model='numpy')
def _add_source(begin, end, dx, dy, source, load, shape, slope, centre, scale, at, by):
    """Add to some tactels' rows a source's pressure, and its derivatives."""
    cos, sin, rho, place, depends_on_w = source
    force, shear_v, shear_w = load.force, load.shear_x, load.shear_y
    for i in range(begin, end):
        x, y = at[X, i] + dx, at[Y, i] + dy
        v, along = x * cos + y * sin - rho, y * cos - x * sin
        w = depends_on_w * (along - place)
        f, g, df, dg, by_f, by_g = kernels.all_at(shape, slope, centre, v * v + w * w)
        across = shear_v * v + shear_w * w
        common = force * df + across * dg
        by_v, by_w = common * v + shear_v * g, common * w + shear_w * g
        by[Q0, i] -= scale * by_v
        by[Q1, i] += scale * ((1.0 - depends_on_w) * by_v * along - depends_on_w * by_w)
        by[FORCE, i] += scale * f
        by[SHEAR_X, i] += scale * g * v
        by[SHEAR_Y, i] += scale * g * w
        by[VARIANCE, i] += scale * (force * by_f + across * by_g)
        by[MODEL, i] += scale * (force * f + across * g)


@njit(error_model='numpy', fastmath=FAST)
def _integrals(shape, slope, centre, v, first, last):
    """
    Integrals from first to last along w of what `kernels.all_at` returns.

    Those of the powers of t = c^2 / (v^2 + w^2 + c^2) follow from each other, by parts.
    """
    across = centre + v * v
    root, highest = math.sqrt(across), centre / across
    at_first, at_last = centre / (across + first * first), centre / (across + last * last)
    first_part, last_part = first * at_first, last * at_last
    power = centre / root * (math.atan(last / root) - math.atan(first / root))
    degree, length = shape.shape[1] - 1, last - first
    f, g = shape[F, degree] * length, shape[G, degree] * length
    by_f, by_g = slope[F, degree] * length, slope[G, degree] * length
    df = dg = 0.0
    for n in range(1, degree + 1):
        f += shape[F, degree - n] * power
        g += shape[G, degree - n] * power
        by_f += slope[F, degree - n] * power
        by_g += slope[G, degree - n] * power
        power = highest * (last_part - first_part + (2.0 * n - 1.0) * power) / (2.0 * n)
        df += n * shape[F, degree - n] * power
        dg += n * shape[G, degree - n] * power
        first_part *= at_first
        last_part *= at_last
    return f, g, -2.0 / centre * df, -2.0 / centre * dg, by_f, by_g


@njit(error_model='numpy', fastmath=FAST)
def _take_off(begin, end, dx, dy, line, load, first, last, shape, slope, centre, scale, at, by):
    """Take a part of a line [m] off some tactels' rows; what its tip does, `_add_tip` adds."""
    force, shear = load.force, load.shear
    for i in range(begin, end):
        x, y = at[X, i] + dx, at[Y, i] + dy
        v, along = x * line.cos + y * line.sin - line.rho, y * line.cos - x * line.sin
        f, g, df, dg, by_f, by_g = _integrals(
            shape, slope, centre, v, first - along, last - along)
        by_v = (force * df + shear * v * dg) * v + shear * g
        by[Q0, i] += scale * by_v
        by[Q1, i] -= scale * by_v * along
        by[FORCE, i] -= scale * f
        by[SHEAR_X, i] -= scale * g * v
        by[VARIANCE, i] -= scale * (force * by_f + shear * v * by_g)
        by[MODEL, i] -= scale * (force * f + shear * v * g)


@njit(error_model='numpy', fastmath=FAST)
def _add_tip(begin, end, dx, dy, line, load, tip, turns, shape, centre, scale, at, row, by_yaw):
    """Add the pressure of a metre of line at its tip: the derivative by an end, and its turn."""
    for i in range(begin, end):
        x, y = at[X, i] + dx, at[Y, i] + dy
        v, w = x * line.cos + y * line.sin - line.rho, y * line.cos - x * line.sin - tip
        t = centre / (v * v + w * w + centre)
        f = g = 0.0
        for j in range(shape.shape[1]):
            f = f * t + shape[F, j]
            g = g * t + shape[G, j]
        value = scale * (load.force * f + load.shear * v * g)
        row[i] += value
        by_yaw[i] += turns * (v + line.rho) * value


@njit(error_model='numpy')
def shape_load(kind, sensor, load, tips, layers):
    """Shapes of a load with a patch, and of the tips of a line."""
    for k in range(layers.size):
        layer, of_layer = layers[k], sensor.polynomials[k]
        kernels.make_shape(of_layer, layer.depth, kind - 1, load.yaw, load.variance, layer.load,
                           layer.load_slope)
        if tips:
            kernels.make_shape(of_layer, layer.depth, kernels.POINT_ROW, 0.0, load.variance,
                               layer.tip, layer.tip_slope)


@njit(error_model='numpy')
def add_rows(kind, sensor, layers, load, tips, tactels):
    """
    Pressure of a load and its derivatives over the noise, at the gathered tactels.

    Tips, bits of extras, are the ends by which derivatives are wanted; where the load has none as
    yet, by one where the line enters or leaves the pad.
    """
    at, by = tactels.at, tactels.by
    shape_load(kind, sensor, load, tips, layers)
    by[:, :layers[-1].end] = 0.0
    whole = source_of(kind, load)
    begin = 0
    for k in range(layers.size):
        layer, end, centre = layers[k], layers[k].end, kernels.centre_of(layers[k].depth)
        for j in range(sensor.nodes.size):
            node = sensor.nodes[j]
            scale = node.weight / layer.noise
            _add_source(begin, end, node.x, node.y, whole, load, layer.load, layer.load_slope,
                        centre, scale, at, by)
            for bit, row, sign in ((BEGINS, START, -1.0), (ENDS, END, 1.0)):
                if not tips & bit:
                    continue
                first, last = along_chord(sensor, load.rho, load.yaw)
                tip, turns = first if bit == BEGINS else last, 0.0
                if load.extras & bit:
                    first, last = lacking_part(bit, sensor, load, layer.depth)
                    tip, turns = last if bit == BEGINS else first, 1.0
                    _take_off(begin, end, node.x, node.y, whole, load, first, last, layer.tip,
                              layer.tip_slope, centre, scale, at, by)
                _add_tip(begin, end, node.x, node.y, whole, load, tip, turns, layer.tip, centre,
                         sign * scale, at, by[row], by[Q1])
        begin = end


@njit(error_model='numpy', fastmath=FAST)
def _add_row(x, y, source, load, kernel, centre, scale, pressure):
    """Add the pressure of a source to a row of tactels at y."""
    cos, sin, rho, place, depends_on_w = source
    force, shear_v, shear_w = load.force, load.shear_x, load.shear_y
    for i in range(x.size):
        v = x[i] * cos + y * sin - rho
        w = depends_on_w * (y * cos - x[i] * sin - place)
        f, g = kernels.values_at(kernel, centre, v * v + w * w)
        pressure[i] += scale * (force * f + (shear_v * v + shear_w * w) * g)


@njit(error_model='numpy')
def _add_picture(sensor, source, load, layer, picture):
    """Add the pressure of a source to a layer's picture."""
    kernel, centre = kernels.coefficients_of(layer.load), kernels.centre_of(layer.depth)
    for j in range(sensor.nodes.size):
        node = sensor.nodes[j]
        x = sensor.x + node.x
        for r in range(sensor.y.size):
            _add_row(
                x, sensor.y[r] + node.y, source, load, kernel, centre, node.weight, picture[r])


@njit(error_model='numpy')
def _take_off_picture(sensor, line, load, first, last, layer, picture):
    """Take the pressure of a part of a line off a layer's picture."""
    centre, shape = kernels.centre_of(layer.depth), layer.tip
    for j in range(sensor.nodes.size):
        node = sensor.nodes[j]
        for r in range(sensor.y.size):
            for c in range(sensor.x.size):
                x, y = sensor.x[c] + node.x, sensor.y[r] + node.y
                v, along = x * line.cos + y * line.sin - line.rho, y * line.cos - x * line.sin
                f, g, _, _, _, _ = _integrals(
                    shape, shape, centre, v, first - along, last - along)
                picture[r, c] -= node.weight * (load.force * f + load.shear * v * g)


@njit(error_model='numpy')
def draw(kind, sensor, layers, load, model):
    """Picture of a load with all that it has."""
    shape_load(kind, sensor, load, load.extras & (BEGINS | ENDS), layers)
    model[:] = 0.0
    whole = source_of(kind, load)
    for k in range(layers.size):
        _add_picture(sensor, whole, load, layers[k], model[k])
        for bit in (BEGINS, ENDS):
            if load.extras & bit:
                first, last = lacking_part(bit, sensor, load, layers[k].depth)
                _take_off_picture(sensor, whole, load, first, last, layers[k], model[k])
