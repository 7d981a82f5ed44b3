"""
Stress below point and line loads for compiled loops: the formulas of `point` and `line`.

A *load* is any record with the fields of LOAD, a *layer* one of `layers.LAYER`. Every tactel's
x and y are arrays of their own, or the loops could not be vectorised.
"""

import math
from typing import Any

import numpy as np

from tactile_common.kernels import FAST, njit

# Place and forces of a load; fields with one offset are names for the same number. A point has
# (a, b) [m], force, shear_x and shear_y [N]; a line rho [m], yaw [rad], force and shear across
# it per length [N/m], and 0.
LOAD_OFFSETS = {'a': 0, 'b': 8, 'rho': 0, 'yaw': 8, 'force': 16, 'shear_x': 24, 'shear_y': 32,
                'shear': 24, 'vector': 0}
_FIELDS: Any = {
    'names': [*LOAD_OFFSETS], 'offsets': [*LOAD_OFFSETS.values()],
    'formats': ['f8'] * (len(LOAD_OFFSETS) - 1) + [('f8', (5,))]}
LOAD = np.dtype(_FIELDS)
# Rows of a load's vector, and of its normal equations; Q0, Q1 are (a, b) or (rho, yaw).
Q0, Q1, FORCE, SHEAR_X, SHEAR_Y = range(5)


@njit(error_model='numpy')
def point_stress(x, y, load, layer):
    """Stress of a layer at one place [Pa]."""
    u, v, depth = x - load.a, y - load.b, layer.depth
    q = 1.0 / (u * u + v * v + depth * depth)
    return 1.5 / np.pi * depth * depth * q * q * np.sqrt(q) * (
        load.force * depth + load.shear_x * u + load.shear_y * v) * (
            layer.gz + layer.gx * u + layer.gy * v)


@njit(error_model='numpy', fastmath=FAST)
def add_point_forces(x, y, a, b, layer, scale, shape, q, by_force, by_shear_x, by_shear_y):
    """Add one layer's derivatives by the forces; shape and q are kept for `add_point_place`."""
    depth, gz, gx, gy = layer.depth, layer.gz, layer.gx, layer.gy
    dd = depth * depth
    scale *= 1.5 / np.pi * dd
    for i in range(x.size):
        u = x[i] - a
        v = y[i] - b
        q[i] = 1.0 / (u * u + v * v + dd)
        shape[i] = scale * q[i] * q[i] * np.sqrt(q[i])
        lever = shape[i] * (gz + gx * u + gy * v)
        by_force[i] += lever * depth
        by_shear_x[i] += lever * u
        by_shear_y[i] += lever * v


@njit(error_model='numpy', fastmath=FAST)
def add_point_place(x, y, a, b, load, layer, shape, q, by_a, by_b):
    """Add one layer's derivatives by (a, b)."""
    depth, gz, gx, gy = layer.depth, layer.gz, layer.gx, layer.gy
    force, shear_x, shear_y = load.force, load.shear_x, load.shear_y
    for i in range(x.size):
        u = x[i] - a
        v = y[i] - b
        lifted = force * depth + shear_x * u + shear_y * v
        lever = gz + gx * u + gy * v
        by = 5.0 * q[i] * lifted * lever
        by_a[i] += shape[i] * (by * u - shear_x * lever - gx * lifted)
        by_b[i] += shape[i] * (by * v - shear_y * lever - gy * lifted)


@njit(error_model='numpy')
def line_stress(x, y, cos, sin, load, layer):
    """Pressure at one place [Pa]; cos and sin are those of yaw."""
    v, depth = x * cos + y * sin - load.rho, layer.depth
    q = 1.0 / (v * v + depth * depth)
    return 2.0 / np.pi * depth * depth * q * q * (load.force * depth + load.shear * v)


@njit(error_model='numpy', fastmath=FAST)
def add_line_forces(x, y, cos, sin, rho, layer, scale, shape, q, by_force, by_shear):
    """Add one layer's derivatives by the forces; shape and q are kept for `add_line_place`."""
    depth = layer.depth
    dd = depth * depth
    scale *= 2.0 / np.pi * dd
    for i in range(x.size):
        v = x[i] * cos + y[i] * sin - rho
        q[i] = 1.0 / (v * v + dd)
        shape[i] = scale * q[i] * q[i]
        by_force[i] += shape[i] * depth
        by_shear[i] += shape[i] * v


@njit(error_model='numpy', fastmath=FAST)
def add_line_place(x, y, cos, sin, rho, along, load, layer, shape, q, by_rho, by_yaw):
    """
    Add one layer's derivatives by (rho, yaw).

    A part of a tactel that lies `along` the line from its centre has that much more lever.
    """
    depth, force, shear = layer.depth, load.force, load.shear
    for i in range(x.size):
        v = x[i] * cos + y[i] * sin - rho
        by = shape[i] * (4.0 * v * (force * depth + shear * v) * q[i] - shear)
        by_rho[i] += by
        by_yaw[i] -= by * (y[i] * cos - x[i] * sin + along)


@njit(cache=True, nogil=True, error_model='numpy')
def add_point(pressure, x, y, depth, px, py, load):
    """Add the pressure of a point load [N] at (px, py): (2.2) without shear."""
    factor = 1.5 / math.pi * depth**3 * load
    for r in range(len(y)):
        from_row = (y[r] - py)**2 + depth * depth
        for c in range(len(x)):
            squared = (x[c] - px)**2 + from_row
            pressure[r, c] += factor / (squared * squared * math.sqrt(squared))


@njit(cache=True, nogil=True, error_model='numpy')
def add_segment(pressure, x, y, depth, x0, y0, x1, y1, load0, load1):
    """
    Add the pressure of a line load that runs from load0 to load1 [N/m] along a segment.

    The integral of 3 / (2 pi) d^3 q(u) / (u^2 + c^2)^(5/2), u along the segment from the foot
    of the tactel, c^2 the square of its distance from the line plus that of the depth.
    """
    length = math.hypot(x1 - x0, y1 - y0)
    tx, ty = (x1 - x0) / length, (y1 - y0) / length
    slope = (load1 - load0) / length
    factor = 1.5 / math.pi * depth**3
    for r in range(len(y)):
        for c in range(len(x)):
            dx, dy = x[c] - x0, y[r] - y0
            foot = dx * tx + dy * ty
            c2 = (dx * ty - dy * tx)**2 + depth * depth
            u0, u1 = -foot, length - foot
            s0, s1 = 1.0 / (u0 * u0 + c2), 1.0 / (u1 * u1 + c2)
            r0, r1 = math.sqrt(s0), math.sqrt(s1)
            constant = (u1 * r1 * (s1 + 2.0 / c2) - u0 * r0 * (s0 + 2.0 / c2)) / c2
            linear = r0 * s0 - r1 * s1
            pressure[r, c] += factor / 3.0 * (
                (load0 + slope * foot) * constant + slope * linear)
