"""
Pressure of loads with a patch, and of lines that end within the pad; all compiled.

A *source* is a point, or a line without ends, seen from its own axes: v across it, w along. What
a line lacks beyond its ends is taken off as points along it, by Gauss' integration.
"""

import math
from typing import NamedTuple

import numpy as np

from tactile_common.kernels import FAST, njit
from tactile_sensing.contact.gauss_newton import END, MODEL, POINT, START, VARIANCE, X, Y
from tactile_sensing.half_space.kernels import FORCE, Q0, Q1, SHEAR_X, SHEAR_Y
from tactile_sensing.half_space.layers import half_sides
from tactile_sensing.skin import kernels

PATCH, BEGINS, ENDS = 1, 2, 4  # bits of a load's extras
PANEL = 0.8  # of the integral along what a line lacks [depths]
BEYOND = 6.0  # depths beyond the pad from where nothing of a line is seen
_ABSCISSAS = np.array([-math.sqrt(0.6), 0.0, math.sqrt(0.6)])
_WEIGHTS = np.array([5.0, 8.0, 5.0]) / 18.0


class Source(NamedTuple):
    """Axes of a source: v = x cos + y sin - rho, w = depends_on_w (y cos - x sin - at)."""

    cos: float
    sin: float
    rho: float  # [m]
    at: float  # place along the line [m]
    depends_on_w: float  # 1 for a point, 0 for a line
    turns: float  # 1 where q1 is the direction of a line, 0 where it is a place along w


@njit(error_model='numpy')
def source_of(kind, load):
    """Source of a whole load."""
    if kind == POINT:
        return Source(1.0, 0.0, load.a, load.b, 1.0, 0.0)
    return Source(math.cos(load.yaw), math.sin(load.yaw), load.rho, 0.0, 0.0, 1.0)


@njit(error_model='numpy')
def point_of_line(line, at):
    """Source at one place along a line."""
    return Source(line.cos, line.sin, line.rho, at, 1.0, 1.0)


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
def panels_of(first, last, depth):
    """Number of panels of an integral."""
    return max(1, int(math.ceil((last - first) / (PANEL * depth))))


@njit(error_model='numpy')
def gauss_point(i, first, last, count):
    """Place of the i-th of Gauss' points on so many panels, and its share of the length."""
    length = (last - first) / count
    return first + (i // 3 + 0.5 + 0.5 * _ABSCISSAS[i % 3]) * length, length * _WEIGHTS[i % 3]


@njit(error_model='numpy')
def _add_source(begin, end, dx, dy, source, load, shape, slope, centre, scale, at, by):
    """Add to some tactels' rows a source's pressure, and its derivatives."""
    cos, sin, rho, place, depends_on_w, turns = source
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
        by[Q1, i] += scale * (
            turns * (by_v * along - by_w * (v + rho)) - (1.0 - turns) * by_w)
        by[FORCE, i] += scale * f
        by[SHEAR_X, i] += scale * g * v
        by[SHEAR_Y, i] += scale * g * w
        by[VARIANCE, i] += scale * (force * by_f + across * by_g)
        by[MODEL, i] += scale * (force * f + across * g)


@njit(error_model='numpy')
def _add_tip(begin, end, dx, dy, source, load, shape, centre, scale, at, row):
    """Add the pressure of a metre of line at one place: the derivative by an end."""
    for i in range(begin, end):
        x, y = at[X, i] + dx, at[Y, i] + dy
        v = x * source.cos + y * source.sin - source.rho
        w = y * source.cos - x * source.sin - source.at
        f, g, _, _, _, _ = kernels.all_at(shape, shape, centre, v * v + w * w)
        row[i] += scale * (load.force * f + load.shear * v * g)


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
    """Pressure of a load and its derivatives over the noise, at the gathered tactels."""
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
            if not tips:
                continue
            for bit, row, sign in ((BEGINS, START, -1.0), (ENDS, END, 1.0)):
                first, last = along_chord(sensor, load.rho, load.yaw)
                tip = first if bit == BEGINS else last
                if load.extras & bit:
                    tip = load.start if bit == BEGINS else load.end
                    first, last = lacking_part(bit, sensor, load, layer.depth)
                    count = panels_of(first, last, layer.depth)
                    for i in range(3 * count):
                        place, length = gauss_point(i, first, last, count)
                        _add_source(begin, end, node.x, node.y, point_of_line(whole, place), load,
                                    layer.tip, layer.tip_slope, centre, -scale * length, at, by)
                _add_tip(begin, end, node.x, node.y, point_of_line(whole, tip), load, layer.tip,
                         centre, sign * scale, at, by[row])
        begin = end


@njit(error_model='numpy', fastmath=FAST)
def _add_row(x, y, source, load, kernel, centre, scale, pressure):
    """Add the pressure of a source to a row of tactels at y."""
    cos, sin, rho, place, depends_on_w, _ = source
    force, shear_v, shear_w = load.force, load.shear_x, load.shear_y
    for i in range(x.size):
        v = x[i] * cos + y * sin - rho
        w = depends_on_w * (y * cos - x[i] * sin - place)
        f, g = kernels.values_at(kernel, centre, v * v + w * w)
        pressure[i] += scale * (force * f + (shear_v * v + shear_w * w) * g)


@njit(error_model='numpy')
def _add_picture(sensor, source, load, shape, layer, scale, picture):
    """Add the pressure of a source to a layer's picture."""
    kernel, centre = kernels.coefficients_of(shape), kernels.centre_of(layer.depth)
    for j in range(sensor.nodes.size):
        node = sensor.nodes[j]
        x = sensor.x + node.x
        for r in range(sensor.y.size):
            _add_row(x, sensor.y[r] + node.y, source, load, kernel, centre, scale * node.weight,
                     picture[r])


@njit(error_model='numpy')
def draw(kind, sensor, layers, load, model):
    """Picture of a load with all that it has."""
    shape_load(kind, sensor, load, load.extras & (BEGINS | ENDS) != 0, layers)
    model[:] = 0.0
    whole = source_of(kind, load)
    for k in range(layers.size):
        layer = layers[k]
        _add_picture(sensor, whole, load, layer.load, layer, 1.0, model[k])
        for bit in (BEGINS, ENDS):
            if load.extras & bit:
                first, last = lacking_part(bit, sensor, load, layer.depth)
                count = panels_of(first, last, layer.depth)
                for i in range(3 * count):
                    place, length = gauss_point(i, first, last, count)
                    _add_picture(sensor, point_of_line(whole, place), load, layer.tip, layer,
                                 -length, model[k])
