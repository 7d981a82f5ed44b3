"""
Frictional point contact on an elastic half-space: stress, averages and moments (chapter 2).

The point of contact is (a, b); normal_force P presses into the skin, shear_x and shear_y
(Qx, Qy) are the tangential forces of the object on the skin [N]. Every component has the
sign of the published images: 'zz' is -sigma_zz, 'xz' is -tau_xz and 'yz' is -tau_yz.

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
    Stress at a depth below a frictional point load, compression positive.

    Equation (2.2) for 'zz'. For the shear (2.5) with x' in place of the printed x,
    which makes it (x' / d) times the pressure.

    Parameters
    ----------
    component : str
        'zz', 'xz' or 'yz'.
    x, y : ndarray
        Positions in the sensor frame [m], any broadcastable shapes.
    a, b : float
        Point of contact [m].
    normal_force, shear_x, shear_y : float
        P, Qx and Qy [N].
    depth : float
        Depth of the tactels below the surface of the skin [m].

    Returns
    -------
    ndarray
        Stress [Pa], of the broadcast shape of x and y.

    Raises
    ------
    ConfigurationError
        Unknown component.
    """
    i, j = _powers(component)
    u, v = x - a, y - b
    force = normal_force * depth + shear_x * u + shear_y * v
    return _scale(i, j, depth) * u**i * v**j * force * (u**2 + v**2 + depth**2)**-2.5


def stress_jacobian(component: str, x: np.ndarray, y: np.ndarray, a: float, b: float,
                    normal_force: float, shear_x: float, shear_y: float,
                    depth: float) -> np.ndarray:
    """
    Derivatives of `stress` by (a, b, normal_force, shear_x, shear_y).

    Returns
    -------
    ndarray
        Shape (..., 5): [Pa/m, Pa/m, Pa/N, Pa/N, Pa/N].
    """
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
    """
    Exact average of `stress` over rectangles size_x by size_y [m] centred on (x, y).

    What an area-averaging tactel measures; the other parameters as for `stress`.

    Returns
    -------
    ndarray
        Stress [Pa], of the broadcast shape of x and y.
    """
    i, j = _powers(component)
    corners = _corners(x - a, y - b, size_x, size_y)
    total = (normal_force * depth * _over_rectangle(i, j, *corners, depth)
             + shear_x * _over_rectangle(i + 1, j, *corners, depth)
             + shear_y * _over_rectangle(i, j + 1, *corners, depth))
    return _scale(i, j, depth) / (size_x * size_y) * total


def average_jacobian(component: str, x: np.ndarray, y: np.ndarray, a: float, b: float,
                     normal_force: float, shear_x: float, shear_y: float, depth: float,
                     size_x: float, size_y: float) -> np.ndarray:
    """
    Derivatives of `average` by (a, b, normal_force, shear_x, shear_y).

    Returns
    -------
    ndarray
        Shape (..., 5): [Pa/m, Pa/m, Pa/N, Pa/N, Pa/N].
    """
    i, j = _powers(component)
    corners = _corners(x - a, y - b, size_x, size_y)
    u1, u2, v1, v2 = corners
    # Moving the load is moving both borders the other way: integrals along the borders.
    by_a = _border(i, j, normal_force, shear_x, shear_y, u1, v1, v2, depth) \
        - _border(i, j, normal_force, shear_x, shear_y, u2, v1, v2, depth)
    by_b = _border(j, i, normal_force, shear_y, shear_x, v1, u1, u2, depth) \
        - _border(j, i, normal_force, shear_y, shear_x, v2, u1, u2, depth)
    columns = np.broadcast_arrays(
        by_a, by_b, depth * _over_rectangle(i, j, *corners, depth),
        _over_rectangle(i + 1, j, *corners, depth), _over_rectangle(i, j + 1, *corners, depth))
    return _scale(i, j, depth) / (size_x * size_y) * np.stack(columns, axis=-1)


def _powers(component):
    try:
        return COMPONENTS[component]
    except (KeyError, TypeError):
        raise ConfigurationError(
            f'component is {component!r}, must be one of {", ".join(COMPONENTS)}') from None


def _scale(i, j, depth):
    return 1.5 / np.pi * depth**(2 - i - j)


def _corners(u, v, size_x, size_y) -> tuple[Any, Any, Any, Any]:
    return u - 0.5 * size_x, u + 0.5 * size_x, v - 0.5 * size_y, v + 0.5 * size_y


def _over_rectangle(i, j, u1, u2, v1, v2, d):
    """Integral of u^i v^j s^(-5/2) over [u1, u2] x [v1, v2]."""
    return (_antiderivative(i, j, u2, v2, d) - _antiderivative(i, j, u1, v2, d)
            - _antiderivative(i, j, u2, v1, d) + _antiderivative(i, j, u1, v1, d))


def _antiderivative(i, j, u, v, d):
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
