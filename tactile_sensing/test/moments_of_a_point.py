"""Moments of a point load in closed form (Tables 2.1 to 2.3): what tests compare with."""

import numpy as np

from tactile_sensing.thesis import point
from tactile_sensing.types.moments import Moments


def rectangle_moments(x_limits: tuple[float, float], y_limits: tuple[float, float], a: float,
                      b: float, normal_force: float, shear_x: float, shear_y: float, depth: float,
                      *, component: str = 'zz') -> Moments:
    """
    Exact moments of a component over a rectangle, about the origin of the sensor frame.

    Definition (2.1) with Table 2.1, in closed form for any finite window.

    Parameters
    ----------
    x_limits, y_limits : (float, float)
        Lower and upper border of the rectangle [m].
    a, b, normal_force, shear_x, shear_y, depth, component
        As for `stress`.

    Returns
    -------
    Moments
    """
    i, j = point._powers(component)
    limits = x_limits[0] - a, x_limits[1] - a, y_limits[0] - b, y_limits[1] - b

    def about_contact(p, q):
        return point._scale(i, j, depth) * (
            normal_force * depth * point._over_rectangle(i + p, j + q, *limits, depth)
            + shear_x * point._over_rectangle(i + p + 1, j + q, *limits, depth)
            + shear_y * point._over_rectangle(i + p, j + q + 1, *limits, depth))

    c00, c10, c01 = about_contact(0, 0), about_contact(1, 0), about_contact(0, 1)
    return Moments(
        m0=c00, mx=c10 + a * c00, my=c01 + b * c00,
        mxx=about_contact(2, 0) + 2.0 * a * c10 + a**2 * c00,
        myy=about_contact(0, 2) + 2.0 * b * c01 + b**2 * c00,
        mxy=about_contact(1, 1) + a * c01 + b * c10 + a * b * c00)


def plane_moments(a: float, b: float, normal_force: float, shear_x: float, shear_y: float,
                  depth: float, *, component: str = 'zz') -> Moments:
    """
    Moments over the infinite plane: Tables 2.2 and 2.3, compression positive.

    With Mxy = a b P + d (a Qy + b Qx), which Table 2.2 leaves out. The second moments of
    the shear stresses do not exist and are NaN.

    Returns
    -------
    Moments
    """
    point._powers(component)
    p, qx, qy, d = normal_force, shear_x, shear_y, depth
    if component == 'xz':
        return Moments(qx, d * p + a * qx, b * qx, np.nan, np.nan, np.nan)
    if component == 'yz':
        return Moments(qy, a * qy, d * p + b * qy, np.nan, np.nan, np.nan)
    return Moments(
        m0=p, mx=d * qx + a * p, my=d * qy + b * p,
        mxx=2.0 * a * d * qx + p * (d**2 + a**2), myy=2.0 * b * d * qy + p * (d**2 + b**2),
        mxy=a * b * p + d * (a * qy + b * qx))
