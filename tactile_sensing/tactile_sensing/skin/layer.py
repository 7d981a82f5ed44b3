"""
Exact solution for an elastic layer that is bonded to a rigid base, in wave numbers.

The harmonic Papkovich-Neuber potentials phi and psi give 2 G u_r = d(phi + z psi')/dr and so on.
At every wave number k they are A e^(-kz) + B e^(k(z - h)) and C e^(-kz) + D e^(k(z - h)). Four
conditions determine A to D: two at the loaded surface, two at the base. The Hankel transform of
order 0 (normal load) or 1 (shear) of the result is the stress under a point load, its Fourier
transform the stress under a line load.
"""

import numpy as np

from tactile_sensing.types.skin import Skin

TRACTION, SHEAR = 0, 1  # rows of the conditions at the surface


def pressure_transforms(k: np.ndarray, skin: Skin) -> tuple[np.ndarray, np.ndarray]:
    """
    Return the transform of the pressure at the tactels over that of the load at the surface.

    Parameters
    ----------
    k : ndarray, shape (N,)
        Wave numbers [1/m], positive.
    skin : Skin

    Returns
    -------
    normal, shear : ndarray, shape (N,)
        For a normal load, whose pressure is even about it; for a shear load: odd.
    """
    kd = k * skin.depth
    if skin.is_half_space:  # (2.2) and (3.1)
        return (1.0 + kd) * np.exp(-kd), kd * np.exp(-kd)
    # In units of the thickness; columns: coefficients A, B, C, D.
    kh, nu, depth = k * skin.thickness, skin.poisson, skin.depth / skin.thickness
    down, zero = np.exp(-kh), np.zeros_like(kh)
    one = zero + 1.0
    surface_pressure = [kh, kh * down, 2.0 * (1.0 - nu) * one, -2.0 * (1.0 - nu) * down]
    surface_shear = [-kh, kh * down, (2.0 * nu - 1.0) * one, (2.0 * nu - 1.0) * down]
    base_radial = [down, one, down, one]
    base_normal = [-kh * down, kh, -(kh + 3.0 - 4.0 * nu) * down, kh - (3.0 - 4.0 * nu)]
    matrix = np.stack([np.stack(row, -1) for row in (
        surface_pressure, surface_shear, base_radial, base_normal)], -2)
    loads = np.zeros((kh.size, 4, 2))
    loads[:, TRACTION, 0] = loads[:, SHEAR, 1] = 1.0
    a, b, c, d = np.moveaxis(np.linalg.solve(matrix, loads), 1, 0)
    kz = (kh * depth)[:, None]
    up, kh = np.exp(kz - kh[:, None]), kh[:, None]
    pressure = np.exp(-kz) * (kh * a + (kz + 2.0 * (1.0 - nu)) * c) + up * (
        kh * b + (kz - 2.0 * (1.0 - nu)) * d)
    return pressure[:, 0], pressure[:, 1]
