"""
Line contact on an elastic half-space: pressure, derivatives and geometry (chapter 3).

Places x, y [m] have any broadcastable shapes; a line has rho, its signed distance from the origin
along its normal [m], yaw, right-handed about +z, 0 along +y [rad], and forces per length [N/m];
depth is that of the tactels [m]. Compression is positive, as in the published images, -sigma_zz.
"""

import math

import numpy as np


def signed_distance(x: np.ndarray, y: np.ndarray, rho: float, yaw: float) -> np.ndarray:
    """Distance of points from a line [m], positive on its right (+x side at yaw 0)."""
    return x * np.cos(yaw) + y * np.sin(yaw) - rho


def pressure(x: np.ndarray, y: np.ndarray, rho: float, yaw: float, line_force: float,
             depth: float) -> np.ndarray:
    """Pressure below an infinite line load [Pa], equation (3.1)."""
    v = signed_distance(x, y, rho, yaw)
    return 2.0 * line_force * depth**3 / (np.pi * (v**2 + depth**2) ** 2)


def stress_with_shear(x: np.ndarray, y: np.ndarray, rho: float, yaw: float, line_force: float,
                      line_shear: float, depth: float) -> np.ndarray:
    """
    Pressure below an infinite line load with shear across it (Flamant) [Pa].

    Equation (3.1) with the shear it leaves out, (2 / pi) d^2 (P d + Q v) / (v^2 + d^2)^2; that of
    the object on the skin, along the normal (cos yaw, sin yaw). Shear along the line adds none.
    """
    return _flamant(signed_distance(x, y, rho, yaw), line_force, line_shear, depth)


def stress_with_shear_jacobian(x: np.ndarray, y: np.ndarray, rho: float, yaw: float,
                               line_force: float, line_shear: float, depth: float) -> np.ndarray:
    """Derivatives of `stress_with_shear` by (rho, yaw, line_force, line_shear), (..., 4)."""
    v = signed_distance(x, y, rho, yaw)
    slope = _flamant_slope(v, line_force, line_shear, depth)
    return np.stack([
        -slope, slope * _along(x, y, yaw),
        _flamant(v, 1.0, 0.0, depth), _flamant(v, 0.0, 1.0, depth)], axis=-1)


def peak_pressure(line_force: float, depth: float) -> float:
    """Pressure right under a line load [Pa], from equation (3.1) at v = 0."""
    return 2.0 * line_force / (np.pi * depth)


def chord_length(rho: float, yaw: float, half_width_x: float, half_width_y: float) -> float:
    """
    Length of a line within a rectangle centred on the origin [m]; 0 if it misses.

    The strip that (3.2) assumes, 2L / cos(yaw), is the case of a line that leaves
    through the two sides y = +-L.
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


def _along(x: np.ndarray, y: np.ndarray, yaw: float) -> np.ndarray:
    """Derivative of the signed distance by yaw: position along the line [m]."""
    return y * np.cos(yaw) - x * np.sin(yaw)


def _flamant(v: np.ndarray, line_force: float, line_shear: float,
             depth: float) -> np.ndarray:
    return 2.0 / np.pi * depth**2 * (line_force * depth + line_shear * v) \
        / (v**2 + depth**2) ** 2


def _flamant_slope(v: np.ndarray, line_force: float, line_shear: float,
                   depth: float) -> np.ndarray:
    """Derivative of `_flamant` by v."""
    s = v**2 + depth**2
    return 2.0 / np.pi * depth**2 / s**2 * (
        line_shear - 4.0 * v * (line_force * depth + line_shear * v) / s)
