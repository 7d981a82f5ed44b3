"""Line contact on an elastic half-space: pressure, derivatives and geometry (chapter 3)."""

import numpy as np


def signed_distance(x, y, rho, yaw):
    """
    Signed distance of points from a line, positive on its right (+x side at yaw 0).

    Parameters
    ----------
    x, y : ndarray
        Points in the sensor frame [m], any broadcastable shapes.
    rho : float
        Signed distance of the line from the origin along its normal [m].
    yaw : float
        Direction of the line, right-handed about +z, 0 along +y [rad].
    """
    return x * np.cos(yaw) + y * np.sin(yaw) - rho


def pressure(x, y, rho, yaw, line_force, depth):
    """
    Pressure at a depth below an infinite line load, compression positive.

    Equation (3.1) with the sign of the published images, -sigma_zz.

    Parameters
    ----------
    x, y : ndarray
        Tactel positions in the sensor frame [m].
    rho, yaw : float
        The line, see `signed_distance` [m, rad].
    line_force : float
        Normal force per length [N/m].
    depth : float
        Depth of the tactels below the surface of the skin [m].

    Returns
    -------
    ndarray
        Pressure [Pa], of the broadcast shape of x and y.
    """
    v = signed_distance(x, y, rho, yaw)
    return 2.0 * line_force * depth**3 / (np.pi * (v**2 + depth**2) ** 2)


def pressure_jacobian(x, y, rho, yaw, line_force, depth):
    """
    Derivatives of `pressure` by (rho, yaw, line_force).

    Returns
    -------
    ndarray
        Shape (..., 3): [Pa/m, Pa/rad, Pa/(N/m)].
    """
    v = signed_distance(x, y, rho, yaw)
    shape = 2.0 * depth**3 / (np.pi * (v**2 + depth**2) ** 2)
    by_distance = -4.0 * line_force * shape * v / (v**2 + depth**2)
    by_yaw = by_distance * (y * np.cos(yaw) - x * np.sin(yaw))
    return np.stack([-by_distance, by_yaw, shape], axis=-1)


def peak_pressure(line_force, depth):
    """Pressure right under a line load [Pa], from equation (3.1) at v = 0."""
    return 2.0 * line_force / (np.pi * depth)


def chord_length(rho, yaw, half_width_x, half_width_y):
    """
    Length of a line within a rectangle centred on the origin [m]; 0 if it misses.

    The strip that (3.2) assumes, 2L / cos(yaw), is the case of a line that leaves
    through the two sides y = +-L.
    """
    foot = np.array([rho * np.cos(yaw), rho * np.sin(yaw)])
    direction = np.array([-np.sin(yaw), np.cos(yaw)])
    enter, leave = -np.inf, np.inf
    for position, slope, half in zip(foot, direction, (half_width_x, half_width_y), strict=True):
        if abs(slope) < 1e-12:
            if abs(position) > half:
                return 0.0
            continue
        first, second = sorted(((-half - position) / slope, (half - position) / slope))
        enter, leave = max(enter, first), min(leave, second)
    return max(leave - enter, 0.0)


def yaw_from_thesis(alpha):
    """
    Convert the thesis' edge angle to yaw, and back [rad].

    The thesis turns +y towards +x, a left-handed rotation about +z; yaw is right-handed.
    """
    return -alpha
