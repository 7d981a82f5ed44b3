"""Reference for tests: loads integrated by quadrature over tactels, windows and the plane."""

import numpy as np
import point_load as point

from tactile_sensing.thesis import line
from tactile_sensing.types.moments import Moments

NODES, WEIGHTS = np.polynomial.legendre.leggauss(12)


def point_average(component, x, y, a, b, normal_force, shear_x, shear_y, depth, size_x, size_y):
    """Return the mean of `point.stress` over rectangles size_x by size_y [m] about (x, y)."""
    return _average(lambda u, v: point.stress(
        component, u, v, a, b, normal_force, shear_x, shear_y, depth), x, y, size_x, size_y)


def line_average(x, y, rho, yaw, line_force, line_shear, depth, size_x, size_y):
    """Return the mean of `line.pressure` over rectangles size_x by size_y [m] about (x, y)."""
    return _average(lambda u, v: line.pressure(u, v, rho, yaw, line_force, depth, line_shear),
                    x, y, size_x, size_y)


def _average(stress, x, y, size_x, size_y):
    return sum(0.25 * weight_x * weight_y * stress(x + 0.5 * size_x * s, y + 0.5 * size_y * t)
               for s, weight_x in zip(NODES, WEIGHTS, strict=True)
               for t, weight_y in zip(NODES, WEIGHTS, strict=True))


def window_moments(x_limits, y_limits, load, depth, component='zz'):
    """Return the moments of a point load (a, b, P, Qx, Qy) over a rectangle (2.1)."""
    nodes, weights = np.polynomial.legendre.leggauss(200)
    (x1, x2), (y1, y2) = x_limits, y_limits
    x = 0.5 * (x1 + x2) + 0.5 * (x2 - x1) * nodes
    y = 0.5 * (y1 + y2) + 0.5 * (y2 - y1) * nodes[:, None]
    return _sums(x, y, 0.25 * (x2 - x1) * (y2 - y1) * weights * weights[:, None] * point.stress(
        component, x, y, *load, depth))


def all_moments(load, depth, component='zz'):
    """Return moments over the plane by x = a + d tan(t), without those that converge slowly."""
    nodes, weights = np.polynomial.legendre.leggauss(400)
    tan, weights = np.tan(0.5 * np.pi * nodes), 0.5 * np.pi * weights
    weights = depth * weights * (1.0 + tan**2)
    x, y = load[0] + depth * tan, load[1] + depth * tan[:, None]
    return _sums(x, y, weights * weights[:, None] * point.stress(component, x, y, *load, depth))


def _sums(x, y, weighted):
    return Moments(*((weighted * x**p * y**q).sum() for p, q in (
        (0, 0), (1, 0), (0, 1), (2, 0), (0, 2), (1, 1))))


def plane_moments(a, b, normal_force, shear_x, shear_y, depth, component='zz'):
    """
    Return the moments over the infinite plane: Tables 2.2 and 2.3, compression positive.

    With Mxy = a b P + d (a Qy + b Qx), which Table 2.2 leaves out. The second moments of
    the shear stresses do not exist and are NaN.
    """
    p, qx, qy, d = normal_force, shear_x, shear_y, depth
    if component == 'xz':
        return Moments(qx, d * p + a * qx, b * qx, np.nan, np.nan, np.nan)
    if component == 'yz':
        return Moments(qy, a * qy, d * p + b * qy, np.nan, np.nan, np.nan)
    return Moments(
        m0=p, mx=d * qx + a * p, my=d * qy + b * p,
        mxx=2.0 * a * d * qx + p * (d**2 + a**2), myy=2.0 * b * d * qy + p * (d**2 + b**2),
        mxy=a * b * p + d * (a * qy + b * qx))
