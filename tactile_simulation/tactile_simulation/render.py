"""Pressure on a tactile array that is indented by a rigid edge."""
from functools import lru_cache
import math

import numpy as np

from tactile_common.kernels import FAST, njit
from tactile_sensing.half_space.kernels import add_point, add_segment
from tactile_sensing.skin import kernels
from tactile_sensing.skin.kernel import polynomials
from tactile_sensing.skin.pressure import split_tactel
from tactile_sensing.types.array import TactelArray
from tactile_simulation.sensor import Skin

# Chords up to this length are replaced by a point load at their middle; longer ones are
# integrated in closed form [depths of the skin].
SHORT = 0.125
# Loads farther from the pad than this add less than 1e-4 of the peak [depths].
REACH = 8.0
PANEL = 0.8  # length of edge represented by three Gauss points [depths]
_POINTS = np.array([-math.sqrt(0.6), 0.0, math.sqrt(0.6)])
_WEIGHTS = np.array([5.0, 8.0, 5.0]) / 18.0


def render(points, array: TactelArray, skin: Skin,
           solid: np.ndarray | None = None, area: float = 0.0) -> tuple[np.ndarray, float]:
    """
    Return the pressure under a rigid edge that indents the skin, and its force.

    The load per length is `stiffness` times the indentation. The pressure is the superposition of
    finite line loads. In a half-space with point tactels, the point load (2.2) without shear is
    integrated along each chord in closed form. With a backing, or tactels that average over an
    area, the pressure of `skin.kernel` is integrated with Gauss points.

    Parameters
    ----------
    points : np.ndarray
        Polyline of the edge in the sensor frame [m], shape `(M, 3)`; it indents where z < 0.
    array : TactelArray
    skin : Skin
    solid : np.ndarray, optional
        Which chords have material, shape `(M - 1,)`; default all.
    area : float
        Side of the square over which a tactel averages [pitches]; 0: it samples its centre.

    Returns
    -------
    pressure : np.ndarray
        At the tactels [Pa], shape `(rows, columns)`, compression positive.
    force : float
        Normal force [N] of the loads within the rectangle of the array.
    """
    points = np.ascontiguousarray(points, dtype=np.float64)
    if solid is None:
        solid = np.ones(len(points) - 1, np.bool_)
    if area == 0.0 and skin.layer.is_half_space:
        pressure = _pressure(points, solid, array.x, array.y, skin.depth, skin.stiffness)
    else:
        shape, nodes = _point_shape(skin, area * array.pitch_x, area * array.pitch_y)
        pressure = _skin_pressure(
            points, solid, array.x, array.y, nodes, shape, skin.depth, skin.stiffness)
    return pressure, force_on(
        points, solid, array.half_width_x, array.half_width_y, skin.stiffness)


@lru_cache(maxsize=16)
def _point_shape(skin, size_x, size_y):
    """Return a point load's shape (see `skin.kernels`) and a tactel's sample points (N, 2)."""
    side, nodes = 0.0, np.zeros((1, 2))
    if size_x > 0.0 and size_y > 0.0:
        side, nodes = split_tactel(size_x, size_y, skin.depth)
    return kernels.sharp_point(polynomials(skin.layer, side), skin.depth), nodes


@njit(cache=True)
def _loaded_part(start, end, half_x, half_y):
    """Return the shares of a chord where it enters and leaves a rectangle below the surface."""
    first, last = 0.0, 1.0
    # Each row requires position + share * slope <= 0.
    for axis, sign, bound in (
            (0, 1.0, half_x), (0, -1.0, half_x), (1, 1.0, half_y), (1, -1.0, half_y),
            (2, 1.0, 0.0)):
        position = sign * start[axis] - bound
        slope = sign * (end[axis] - start[axis])
        if slope > 0.0:
            last = min(last, -position / slope)
        elif slope < 0.0:
            first = max(first, -position / slope)
        elif position > 0.0:
            return 0.0, 0.0
    return first, last


@njit(cache=True)
def _length(start, end):
    return math.sqrt(
        (end[0] - start[0])**2 + (end[1] - start[1])**2 + (end[2] - start[2])**2)


@njit(cache=True, nogil=True)
def force_on(points, solid, half_x, half_y, stiffness):
    force = 0.0
    for n in range(len(points) - 1):
        if not solid[n]:
            continue
        start, end = points[n], points[n + 1]
        first, last = _loaded_part(start, end, half_x, half_y)
        if last > first:
            middle = 0.5 * (first + last)
            indentation = -(start[2] + middle * (end[2] - start[2]))
            force += stiffness * indentation * (last - first) * _length(start, end)
    return force


@njit(cache=True, nogil=True, error_model='numpy')
def _pressure(points, solid, x, y, depth, stiffness):
    pressure = np.zeros((len(y), len(x)))
    far_x = abs(x[0]) + REACH * depth
    far_y = abs(y[0]) + REACH * depth
    for n in range(len(points) - 1):
        if not solid[n]:
            continue
        start, end = points[n], points[n + 1]
        first, last = _loaded_part(start, end, far_x, far_y)
        if last <= first:
            continue
        length = _length(start, end)
        x0, y0, z0 = start + first * (end - start)
        x1, y1, z1 = start + last * (end - start)
        plan = math.hypot(x1 - x0, y1 - y0)
        # Load per horizontal length, so that an inclined chord carries its whole load.
        share = stiffness * length * (last - first)
        if plan <= SHORT * depth:
            add_point(pressure, x, y, depth, 0.5 * (x0 + x1), 0.5 * (y0 + y1),
                      -0.5 * (z0 + z1) * share)
        else:
            add_segment(pressure, x, y, depth, x0, y0, x1, y1,
                        -z0 * share / plan, -z1 * share / plan)
    return pressure


@njit(error_model='numpy', fastmath=FAST)
def _add_source(pressure, x, y, nodes, of_f, centre, px, py, load):
    """Add the pressure of a point load [N]."""
    for j in range(nodes.shape[0]):
        dx, dy = nodes[j, 0] - px, nodes[j, 1] - py
        for r in range(y.size):
            row, v = pressure[r], y[r] + dy
            for c in range(x.size):
                u = x[c] + dx
                row[c] += load * kernels.value_of(of_f, centre / (u * u + v * v + centre))


@njit(cache=True, nogil=True, error_model='numpy')
def _skin_pressure(points, solid, x, y, nodes, shape, depth, stiffness):
    pressure = np.zeros((len(y), len(x)))
    of_f = kernels.coefficients_of(shape)
    centre, part = kernels.centre_of(depth), 1.0 / nodes.shape[0]
    far_x = abs(x[0]) + REACH * depth
    far_y = abs(y[0]) + REACH * depth
    for n in range(len(points) - 1):
        if not solid[n]:
            continue
        start, end = points[n], points[n + 1]
        first, last = _loaded_part(start, end, far_x, far_y)
        if last <= first:
            continue
        length = _length(start, end)
        short = length * (last - first) <= SHORT * depth
        count = max(1, int(math.ceil(length * (last - first) / (PANEL * depth))))
        for i in range(count):
            for j in range(3):
                if short and j != 1:
                    continue
                along = first + (i + 0.5 + 0.5 * _POINTS[j]) * (last - first) / count
                share = (1.0 if short else _WEIGHTS[j]) * (last - first) * length / count
                _add_source(
                    pressure, x, y, nodes, of_f, centre,
                    start[0] + along * (end[0] - start[0]), start[1] + along * (end[1] - start[1]),
                    -(start[2] + along * (end[2] - start[2])) * stiffness * share * part)
    return pressure
