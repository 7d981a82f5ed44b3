"""Exact averages over tactels and their derivatives: what tests compare quadratures with."""

import numpy as np

from tactile_sensing.thesis import line, point


def point_average_jacobian(component: str, x: np.ndarray, y: np.ndarray, a: float, b: float,
                           normal_force: float, shear_x: float, shear_y: float, depth: float,
                           size_x: float, size_y: float) -> np.ndarray:
    """
    Derivatives of `point.average` by (a, b, normal_force, shear_x, shear_y).

    Returns
    -------
    ndarray
        Shape (..., 5): [Pa/m, Pa/m, Pa/N, Pa/N, Pa/N].
    """
    i, j = point._powers(component)
    corners = point._corners(x - a, y - b, size_x, size_y)
    u1, u2, v1, v2 = corners
    # Moving the load is moving both borders the other way: integrals along the borders.
    by_a = _border(i, j, normal_force, shear_x, shear_y, u1, v1, v2, depth) \
        - _border(i, j, normal_force, shear_x, shear_y, u2, v1, v2, depth)
    by_b = _border(j, i, normal_force, shear_y, shear_x, v1, u1, u2, depth) \
        - _border(j, i, normal_force, shear_y, shear_x, v2, u1, u2, depth)
    columns = np.broadcast_arrays(
        by_a, by_b, depth * point._over_rectangle(i, j, *corners, depth),
        point._over_rectangle(i + 1, j, *corners, depth),
        point._over_rectangle(i, j + 1, *corners, depth))
    return point._scale(i, j, depth) / (size_x * size_y) * np.stack(columns, axis=-1)


def line_average(x: np.ndarray, y: np.ndarray, rho: float, yaw: float, line_force: float,
                 line_shear: float, depth: float, size_x: float, size_y: float) -> np.ndarray:
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
        v = line.signed_distance(x + shift_x, y + shift_y, rho, yaw)
        first, last = v - 0.5 * side * projection, v + 0.5 * side * projection
        total = total + weight * (
            _integral(last, line_force, line_shear, depth)
            - _integral(first, line_force, line_shear, depth))
    return total / (side * projection)


def line_average_jacobian(x: np.ndarray, y: np.ndarray, rho: float, yaw: float,
                                line_force: float, line_shear: float, depth: float, size_x: float,
                                size_y: float) -> np.ndarray:
    """
    Derivatives of `line_average` by (rho, yaw, line_force, line_shear).

    Returns
    -------
    ndarray
        Shape (..., 4): [Pa/m, Pa/rad, Pa/(N/m), Pa/(N/m)].
    """
    rest = depth, size_x, size_y
    by_force = line_average(x, y, rho, yaw, 1.0, 0.0, *rest)
    by_shear = line_average(x, y, rho, yaw, 0.0, 1.0, *rest)
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
        v = line.signed_distance(x + shift_x, y + shift_y, rho, yaw)
        ends = v - 0.5 * side * projection, v + 0.5 * side * projection
        first, last = (line._flamant(end, line_force, line_shear, depth) for end in ends)
        mean = (_integral(ends[1], line_force, line_shear, depth)
                - _integral(ends[0], line_force, line_shear, depth)) / (side * projection)
        slope = (last - first) / (side * projection)
        by_rho = by_rho - weight * slope
        # The lever of the rotation grows along the side: integrated by parts.
        by_yaw = by_yaw + weight * (
            slope * line._along(x + shift_x, y + shift_y, yaw)
            + turn / projection * (0.5 * (first + last) - mean))
    return np.stack([by_rho, by_yaw, by_force, by_shear], axis=-1)


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
                line.signed_distance(*corner, rho, yaw), line._along(*corner, yaw))
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


def _border(i, j, normal_force, across, along, u, v1, v2, d):
    """Integral over v of u^i v^j (P d + across u + along v) s^(-5/2) at one u."""
    c = u**2 + d**2

    def integral(k):
        return _line_antiderivative(k, v2, c) - _line_antiderivative(k, v1, c)

    return u**i * ((normal_force * d + across * u) * integral(j) + along * integral(j + 1))


def _line_antiderivative(k, v, c):
    """Antiderivative over v of v^k (v^2 + c)^(-5/2), k <= 2."""
    s = v**2 + c
    if k == 0:
        return v * (3.0 * c + 2.0 * v**2) / (3.0 * c**2 * s**1.5)
    if k == 1:
        return -1.0 / (3.0 * s**1.5)
    return v**3 / (3.0 * c * s**1.5)
