"""
Frictional point contact on an elastic half-space: stress, averages and moments (chapter 2).

The point of contact is (a, b) [m]; normal_force P presses into the skin, shear_x and shear_y
(Qx, Qy) are the tangential forces of the object on the skin [N], depth that of the tactels [m].
Places x, y in the sensor frame [m] have any broadcastable shapes. Every component has the sign of
the published images: 'zz' is -sigma_zz, 'xz' is -tau_xz and 'yz' is -tau_yz; an unknown one
raises a ConfigurationError.

With u = x - a, v = y - b and s = u^2 + v^2 + d^2 every component is a sum of terms
u^i v^j s^(-5/2). Their integrals over rectangles are elementary, hence the averages over
tactels and the moments of finite windows are exact.
"""

from typing import Any

import numpy as np

from tactile_common.errors import ConfigurationError

# Powers (i, j) of (u / d)^i (v / d)^j that turn the pressure into the component.
COMPONENTS = {'zz': (0, 0), 'xz': (1, 0), 'yz': (0, 1)}


def stress(component: str, x: np.ndarray, y: np.ndarray, a: float, b: float, normal_force: float,
           shear_x: float, shear_y: float, depth: float) -> np.ndarray:
    """
    Stress below a frictional point load [Pa], compression positive.

    Equation (2.2) for 'zz'. For the shear (2.5) with x' in place of the printed x,
    which makes it (x' / d) times the pressure.
    """
    i, j = _powers(component)
    u, v = x - a, y - b
    force = normal_force * depth + shear_x * u + shear_y * v
    return _scale(i, j, depth) * u**i * v**j * force * (u**2 + v**2 + depth**2)**-2.5


def stress_jacobian(component: str, x: np.ndarray, y: np.ndarray, a: float, b: float,
                    normal_force: float, shear_x: float, shear_y: float,
                    depth: float) -> np.ndarray:
    """Derivatives of `stress` by (a, b, normal_force, shear_x, shear_y), shape (..., 5)."""
    i, j = _powers(component)
    u, v = np.broadcast_arrays(x - a, y - b)
    s = u**2 + v**2 + depth**2
    shape = _scale(i, j, depth) * s**-2.5
    lever = u**i * v**j
    force = normal_force * depth + shear_x * u + shear_y * v
    common = -5.0 * lever * force / s
    by_u = shape * (common * u + lever * shear_x + i * force)
    by_v = shape * (common * v + lever * shear_y + j * force)
    kernel = shape * lever
    return np.stack([-by_u, -by_v, kernel * depth, kernel * u, kernel * v], axis=-1)


def average(component: str, x: np.ndarray, y: np.ndarray, a: float, b: float, normal_force: float,
            shear_x: float, shear_y: float, depth: float, size_x: float,
            size_y: float) -> np.ndarray:
    """Exact mean of `stress` over rectangles size_x by size_y [m] about (x, y): area tactels."""
    i, j = _powers(component)
    corners = _corners(x - a, y - b, size_x, size_y)
    total = (normal_force * depth * _over_rectangle(i, j, *corners, depth)
             + shear_x * _over_rectangle(i + 1, j, *corners, depth)
             + shear_y * _over_rectangle(i, j + 1, *corners, depth))
    return _scale(i, j, depth) / (size_x * size_y) * total


def _powers(component: str) -> tuple[int, int]:
    try:
        return COMPONENTS[component]
    except (KeyError, TypeError):
        raise ConfigurationError(
            f'component is {component!r}, must be one of {", ".join(COMPONENTS)}') from None


def _scale(i: int, j: int, depth: float) -> float:
    return 1.5 / np.pi * depth**(2 - i - j)


def _corners(u: Any, v: Any, size_x: float, size_y: float) -> tuple[Any, Any, Any, Any]:
    return u - 0.5 * size_x, u + 0.5 * size_x, v - 0.5 * size_y, v + 0.5 * size_y


def _over_rectangle(i: int, j: int, u1: Any, u2: Any, v1: Any, v2: Any, d: float) -> Any:
    """Integral of u^i v^j s^(-5/2) over [u1, u2] x [v1, v2]."""
    return (_antiderivative(i, j, u2, v2, d) - _antiderivative(i, j, u1, v2, d)
            - _antiderivative(i, j, u2, v1, d) + _antiderivative(i, j, u1, v1, d))


def _antiderivative(i: int, j: int, u: Any, v: Any, d: float) -> Any:
    """Function whose mixed derivative d^2 / du dv is u^i v^j s^(-5/2), i + j <= 4."""
    if j > i:
        return _antiderivative(j, i, v, u, d)
    cu, cv = u**2 + d**2, v**2 + d**2
    r = np.sqrt(cu + v**2)
    order = i, j
    if order == (0, 0):
        return np.arctan(u * v / (d * r)) / (3.0 * d**3) \
            + u * v * (r**2 + d**2) / (3.0 * d**2 * r * cu * cv)
    if order == (1, 0):
        return -v / (3.0 * cu * r)
    if order == (1, 1):
        return 1.0 / (3.0 * r)
    if order == (2, 0):
        return np.arctan(u * v / (d * r)) / (3.0 * d) - u * v / (3.0 * cu * r)
    if order == (2, 1):
        return (u / r - np.arcsinh(u / np.sqrt(cv))) / 3.0
    if order == (3, 0):
        return -u**2 * v / (3.0 * cu * r) - 2.0 / 3.0 * np.arcsinh(v / np.sqrt(cu))
    if order == (2, 2):
        return (u * v / r - d * np.arctan(u * v / (d * r))) / 3.0
    if order == (3, 1):
        return -(r + cv / r) / 3.0
    if order == (4, 0):
        return v * np.arcsinh(u / np.sqrt(cv)) - d * np.arctan(u * v / (d * r)) \
            - u**3 * v / (3.0 * cu * r)
    raise ValueError(f'order is {order}, must be at most 4')
