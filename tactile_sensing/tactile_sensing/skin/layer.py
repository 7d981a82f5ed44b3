"""
An elastic layer bonded to a rigid base, in wave numbers: the exact solution.

Papkovich-Neuber potentials phi and psi, harmonic, give 2 G u_r = d(phi + z psi')/dr and so on; at
every wave number k they are A e^(-kz) + B e^(k(z - h)) and C e^(-kz) + D e^(k(z - h)), and four
conditions, two at the loaded surface and two at the base, give A to D. The Hankel transform of
order 0 (normal load) or 1 (shear) turns the result into the stress below a point load, the
Fourier transform into that below a line.
"""

import numpy as np

from tactile_sensing.types.skin import Skin

TRACTION, SHEAR = 0, 1  # rows of the conditions at the surface


def pressure_transforms(k: np.ndarray, skin: Skin) -> tuple[np.ndarray, np.ndarray]:
    """
    Transform of the pressure at the tactels over that of the load at the surface.

    Parameters
    ----------
    k : ndarray, shape (N,)
        Wave numbers [1/m], positive.
    skin : Skin

    Returns
    -------
    normal, shear : ndarray, shape (N,)
        For a normal load; for a tangential one, which gives the part that is odd about it.
    """
    kd = k * skin.depth
    if skin.is_half_space:  # (2.2) and (3.1)
        return (1.0 + kd) * np.exp(-kd), kd * np.exp(-kd)
    # In units of the thickness; columns are the potentials A, B, C, D.
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
