"""Line contact on an elastic half-space: pressure, derivatives and geometry (chapter 3)."""

import math

import numpy as np


def signed_distance(x: np.ndarray, y: np.ndarray, rho: float, yaw: float) -> np.ndarray:
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


def pressure(x: np.ndarray, y: np.ndarray, rho: float, yaw: float, line_force: float,
             depth: float) -> np.ndarray:
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


def pressure_jacobian(x: np.ndarray, y: np.ndarray, rho: float, yaw: float, line_force: float,
                      depth: float) -> np.ndarray:
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


def stress_with_shear(x: np.ndarray, y: np.ndarray, rho: float, yaw: float, line_force: float,
                      line_shear: float, depth: float) -> np.ndarray:
    """
    Pressure below an infinite line load with shear across it (Flamant), compression positive.

    Equation (3.1) with the shear it leaves out,
    (2 / pi) d^2 (P d + Q v) / (v^2 + d^2)^2. Shear along the line adds no pressure.

    Parameters
    ----------
    x, y, rho, yaw, line_force, depth
        As for `pressure`.
    line_shear : float
        Shear force per length of the object on the skin, along the normal of the line
        (cos yaw, sin yaw) [N/m].

    Returns
    -------
    ndarray
        Pressure [Pa], of the broadcast shape of x and y; negative is tension.
    """
    return _flamant(signed_distance(x, y, rho, yaw), line_force, line_shear, depth)


def stress_with_shear_jacobian(x: np.ndarray, y: np.ndarray, rho: float, yaw: float,
                               line_force: float, line_shear: float, depth: float) -> np.ndarray:
    """
    Derivatives of `stress_with_shear` by (rho, yaw, line_force, line_shear).

    Returns
    -------
    ndarray
        Shape (..., 4): [Pa/m, Pa/rad, Pa/(N/m), Pa/(N/m)].
    """
    v = signed_distance(x, y, rho, yaw)
    slope = _flamant_slope(v, line_force, line_shear, depth)
    return np.stack([
        -slope, slope * _along(x, y, yaw),
        _flamant(v, 1.0, 0.0, depth), _flamant(v, 0.0, 1.0, depth)], axis=-1)


def average_with_shear(x: np.ndarray, y: np.ndarray, rho: float, yaw: float, line_force: float,
                       line_shear: float, depth: float, size_x: float,
                       size_y: float) -> np.ndarray:
    """
    Exact average of `stress_with_shear` over rectangles size_x by size_y [m] at (x, y).

    What an area-averaging tactel measures: the pressure depends on v alone, and its second
    antiderivative (P v - Q d) atan(v / d) / pi is taken at the four corners. Where a side
    is so nearly along the line that the difference cancels, Gauss-Legendre across it.

    Returns
    -------
    ndarray
        Pressure [Pa], of the broadcast shape of x and y.
    """
    nodes = _cancelling_nodes(yaw, depth, size_x, size_y)
    if nodes is None:
        return _corner_sum(
            lambda v, _: _second_integral(v, line_force, line_shear, depth),
            x, y, rho, yaw, size_x, size_y)
    side, projection, _, points, weights = nodes
    total = 0.0
    for (shift_x, shift_y), weight in zip(points, weights, strict=True):
        v = signed_distance(x + shift_x, y + shift_y, rho, yaw)
        first, last = v - 0.5 * side * projection, v + 0.5 * side * projection
        total = total + weight * (
            _integral(last, line_force, line_shear, depth)
            - _integral(first, line_force, line_shear, depth))
    return total / (side * projection)


def average_with_shear_jacobian(x: np.ndarray, y: np.ndarray, rho: float, yaw: float,
                                line_force: float, line_shear: float, depth: float, size_x: float,
                                size_y: float) -> np.ndarray:
    """
    Derivatives of `average_with_shear` by (rho, yaw, line_force, line_shear).

    Returns
    -------
    ndarray
        Shape (..., 4): [Pa/m, Pa/rad, Pa/(N/m), Pa/(N/m)].
    """
    rest = depth, size_x, size_y
    by_force = average_with_shear(x, y, rho, yaw, 1.0, 0.0, *rest)
    by_shear = average_with_shear(x, y, rho, yaw, 0.0, 1.0, *rest)
    nodes = _cancelling_nodes(yaw, depth, size_x, size_y)
    if nodes is None:
        by_rho = -_corner_sum(
            lambda v, _: _integral(v, line_force, line_shear, depth),
            x, y, rho, yaw, size_x, size_y)
        by_yaw = _corner_sum(
            lambda v, along: along * _integral(v, line_force, line_shear, depth),
            x, y, rho, yaw, size_x, size_y)
        by_yaw -= 2.0 / np.tan(2.0 * yaw) * (line_force * by_force + line_shear * by_shear)
        return np.stack([by_rho, by_yaw, by_force, by_shear], axis=-1)
    side, projection, turn, points, weights = nodes
    by_rho = by_yaw = 0.0
    for (shift_x, shift_y), weight in zip(points, weights, strict=True):
        v = signed_distance(x + shift_x, y + shift_y, rho, yaw)
        ends = v - 0.5 * side * projection, v + 0.5 * side * projection
        first, last = (_flamant(end, line_force, line_shear, depth) for end in ends)
        mean = (_integral(ends[1], line_force, line_shear, depth)
                - _integral(ends[0], line_force, line_shear, depth)) / (side * projection)
        slope = (last - first) / (side * projection)
        by_rho = by_rho - weight * slope
        # The lever of the rotation grows along the side: integrated by parts.
        by_yaw = by_yaw + weight * (
            slope * _along(x + shift_x, y + shift_y, yaw)
            + turn / projection * (0.5 * (first + last) - mean))
    return np.stack([by_rho, by_yaw, by_force, by_shear], axis=-1)


def peak_pressure(line_force: float, depth: float) -> float:
    """Pressure right under a line load [Pa], from equation (3.1) at v = 0."""
    return 2.0 * line_force / (np.pi * depth)


def chord_length(rho: float, yaw: float, half_width_x: float, half_width_y: float) -> float:
    """
    Length of a line within a rectangle centred on the origin [m]; 0 if it misses.

    The strip that (3.2) assumes, 2L / cos(yaw), is the case of a line that leaves
    through the two sides y = +-L. (`contact.parameters` compiles it as well, as if it were @njit.)
    """
    cos, sin = math.cos(yaw), math.sin(yaw)
    enter, leave = -math.inf, math.inf
    for position, slope, half in ((rho * cos, -sin, half_width_x), (rho * sin, cos, half_width_y)):
        if abs(slope) < 1e-12:
            if abs(position) > half:
                return 0.0
            continue
        one, other = (-half - position) / slope, (half - position) / slope
        enter, leave = max(enter, min(one, other)), min(leave, max(one, other))
    return max(leave - enter, 0.0)


def yaw_from_thesis(alpha: float) -> float:
    """
    Convert the thesis' edge angle to yaw, and back [rad].

    The thesis turns +y towards +x, a left-handed rotation about +z; yaw is right-handed.
    """
    return -alpha


def _along(x, y, yaw):
    """Derivative of the signed distance by yaw: position along the line [m]."""
    return y * np.cos(yaw) - x * np.sin(yaw)


def _flamant(v, line_force, line_shear, depth):
    return 2.0 / np.pi * depth**2 * (line_force * depth + line_shear * v) \
        / (v**2 + depth**2) ** 2


def _flamant_slope(v, line_force, line_shear, depth):
    """Derivative of `_flamant` by v."""
    s = v**2 + depth**2
    return 2.0 / np.pi * depth**2 / s**2 * (
        line_shear - 4.0 * v * (line_force * depth + line_shear * v) / s)


def _integral(v, line_force, line_shear, depth):
    """Antiderivative of `_flamant` by v."""
    return (line_force * np.arctan(v / depth)
            + (line_force * v - line_shear * depth) * depth / (v**2 + depth**2)) / np.pi


def _second_integral(v, line_force, line_shear, depth):
    """Antiderivative of `_integral` by v."""
    return (line_force * v - line_shear * depth) * np.arctan(v / depth) / np.pi


def _corner_sum(function, x, y, rho, yaw, size_x, size_y):
    """Mean over the rectangle of the mixed derivative of function(v, along)."""
    total = 0.0
    for sign_x in (-1.0, 1.0):
        for sign_y in (-1.0, 1.0):
            corner = x + 0.5 * sign_x * size_x, y + 0.5 * sign_y * size_y
            total = total + sign_x * sign_y * function(
                signed_distance(*corner, rho, yaw), _along(*corner, yaw))
    return total / (size_x * size_y * np.cos(yaw) * np.sin(yaw))


def _cancelling_nodes(yaw, depth, size_x, size_y):
    """
    Nodes across the side that is nearly along the line; None if none is.

    Returns (other side, its projection on the normal, derivative of `_along` on it, nodes
    as shifts (x, y), weights).
    """
    cos, sin = np.cos(yaw), np.sin(yaw)
    across_x, across_y = abs(size_x * cos), abs(size_y * sin)
    if min(across_x, across_y) > 0.05 * depth:
        return None
    abscissas, weights = np.polynomial.legendre.leggauss(4)
    if across_x >= across_y:
        points = [(0.0, 0.5 * size_y * t) for t in abscissas]
        return size_x, cos, -sin, points, 0.5 * weights
    points = [(0.5 * size_x * t, 0.0) for t in abscissas]
    return size_y, sin, cos, points, 0.5 * weights
