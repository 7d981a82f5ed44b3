"""
Approximate the pressure of point and line loads on a skin by polynomials, for the compiled fit.

Under a point load, a tactel measures P f(s) + (Qx u + Qy v) g(s), where s = u^2 + v^2 is its
squared distance. Under a line load, u is its distance and Q the shear across the line. The
inverse transforms of `pressure_transforms` give f and g. Here they are approximated by
polynomials in t = c^2 / (s + c^2), where c is some depths; these are smooth and valid at any
distance. The mean over a tactel's area and the extent of a load are factors of the transform.

The mean over a square depends on direction. For a point its mean over all directions is used,
which is correct to the third order of the side. A line also has the next term, with cos(4 yaw).
Tactels that are too large for this are split into squares.
"""

from functools import lru_cache

import numpy as np
import scipy

from tactile_sensing.types.skin import Skin

DEGREE = 12  # of the polynomials in t
SPREAD_DEGREE = 7  # of the polynomials in the variance of the load's patch
CENTRE = 2.0  # c [depths]
# Largest variance of a load's patch along one axis [depths^2]: Hertz pressure with a radius of 1.5
# depths (radius^2 / 5), or with a half width of 1.34 depths (half width^2 / 4).
MAX_VARIANCE = 0.45
LARGEST_SIDE = 0.9  # largest side of a square with the approximated mean [depths]
REACH = 40.0  # the pressure is fitted up to this distance, and to 0 at infinity [depths]
_NODES = 160
TRACTION, SHEAR = 0, 1  # rows of the conditions at the surface of the skin


def pressure_transforms(k: np.ndarray, skin: Skin) -> tuple[np.ndarray, np.ndarray]:
    """
    Return the transform of the pressure at the tactels over that of the load at the surface.

    This is the exact solution for an elastic layer that is bonded to a rigid base. The harmonic
    Papkovich-Neuber potentials phi and psi give 2 G u_r = d(phi + z psi')/dr and so on. At every
    wave number k they are A e^(-kz) + B e^(k(z - h)) and C e^(-kz) + D e^(k(z - h)). Four
    conditions determine A to D: two at the loaded surface, two at the base. The Hankel transform
    of order 0 (normal load) or 1 (shear) of the result is the stress under a point load, its
    Fourier transform the stress under a line load.

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


@lru_cache(maxsize=1)
def _quadrature() -> tuple[np.ndarray, np.ndarray]:
    """Return wave numbers and weights of the inverse transforms [1/depth]."""
    nodes, weights = np.polynomial.legendre.leggauss(20)
    k = (np.arange(45)[:, None] + 0.5 + 0.5 * nodes) / 1.5  # up to 30: e^-30 is negligible
    return k.ravel(), np.tile(weights / 3.0, 45)


@lru_cache(maxsize=1)
def _transforms() -> np.ndarray:
    """
    Return the matrices that map transforms at the wave numbers to coefficients.

    Shape (2, 2, DEGREE + 1, wave numbers): point and line; f and g; powers of t.
    """
    j0, j1 = scipy.special.j0, scipy.special.j1
    k, weights = _quadrature()
    nearest = CENTRE**2 / (REACH**2 + CENTRE**2)
    t = nearest + (1.0 - nearest) * 0.5 * (
        1.0 + np.cos(np.pi * (np.arange(_NODES) + 0.5) / _NODES))
    r = CENTRE * np.sqrt(1.0 / t - 1.0)
    kr = np.multiply.outer(r, k)
    values = np.stack([j0(kr) * k / (2.0 * np.pi), j1(kr) * k / (2.0 * np.pi) / r[:, None],
                       np.cos(kr) / np.pi, np.sin(kr) / np.pi / r[:, None]]) * weights
    values = values.reshape(2, 2, _NODES, k.size)
    lever = np.stack([np.ones(_NODES), np.minimum(r, 5.0)])  # g is multiplied by a distance
    basis = np.polynomial.chebyshev.chebvander(2.0 * t - 1.0, DEGREE)
    at_infinity = np.polynomial.chebyshev.chebvander(np.array([-1.0]), DEGREE)
    # Column i: coefficients of the Chebyshev polynomial i in 2 t - 1, by powers of t.
    powers = np.stack([np.pad(
        np.polynomial.Chebyshev.basis(i, domain=[0.0, 1.0]).convert(
            kind=np.polynomial.Polynomial).coef, (0, DEGREE - i)) for i in range(DEGREE + 1)], -1)
    result = np.empty((2, 2, DEGREE + 1, k.size))
    for i in range(2):
        weighted = np.concatenate([basis * lever[i][:, None], 10.0 * at_infinity])
        solve = powers @ np.linalg.pinv(weighted)[:, :_NODES] * lever[i]
        result[:, i] = solve @ values[:, i]
    return result


def square_mean(k: np.ndarray, side: float) -> tuple[np.ndarray, np.ndarray]:
    """Transform the mean over a square; return its mean over yaw and its cos(4 yaw) term."""
    turn = np.pi / 2.0 * (np.arange(32) + 0.5) / 32
    half = np.multiply.outer(0.5 * side * k, np.stack([np.cos(turn), np.sin(turn)]) / np.pi)
    mean = np.sinc(half).prod(axis=-2)
    return mean.mean(axis=-1), 2.0 * (mean * np.cos(4.0 * turn)).mean(axis=-1)


def patch_transforms(k: np.ndarray, variance: float) -> tuple[np.ndarray, np.ndarray]:
    """
    Return the transforms of Hertz pressures over a disc and over a strip.

    The variance is that along each axis of the disc (radius^2 / 5), or across the strip
    (half width^2 / 4).
    """
    if variance == 0.0:
        return np.ones_like(k), np.ones_like(k)
    disc, strip = k * np.sqrt(5.0 * variance), k * np.sqrt(4.0 * variance)
    small = disc < 0.02
    safe = np.where(small, 1.0, disc)
    of_disc = np.where(small, 1.0 - disc**2 / 10.0,
                       3.0 * (np.sin(safe) - safe * np.cos(safe)) / safe**3)
    return of_disc, 2.0 * scipy.special.j1(strip) / strip


@lru_cache(maxsize=64)
def _polynomials(depth_over_thickness: float, poisson: float, side: float) -> np.ndarray:
    k, _ = _quadrature()
    skin = Skin(1.0, np.inf if depth_over_thickness == 0.0 else 1.0 / depth_over_thickness,
                poisson)
    mean, part = square_mean(k, side)
    loads = np.stack(pressure_transforms(k, skin))  # (2, wave numbers)
    variances = MAX_VARIANCE * 0.5 * (
        1.0 - np.cos(np.pi * np.arange(SPREAD_DEGREE + 1) / SPREAD_DEGREE))
    disc, strip = np.stack([patch_transforms(k, variance) for variance in variances], axis=1)
    factors = np.stack([disc * mean, strip * mean, strip * part])
    at_variances = np.einsum(
        'abck,bk,avk->vabc', _transforms()[[0, 1, 1]], loads, factors, optimize=True)
    powers = np.linalg.inv(np.vander(variances, SPREAD_DEGREE + 1, increasing=True))
    coefficients = np.einsum('pv,vabc->apbc', powers, at_variances)
    coefficients.flags.writeable = False
    return coefficients


def polynomials(skin: Skin, side: float = 0.0) -> np.ndarray:
    """
    Return the coefficients of f and g in units of the depth.

    Parameters
    ----------
    skin : Skin
    side : float
        Side of the squares over which tactels average [m]; 0: they sample points.

    Returns
    -------
    ndarray, shape (3, SPREAD_DEGREE + 1, 2, DEGREE + 1), read-only
        Axis 0: point, line, and the factor of cos(4 yaw) of a line. Axis 1: powers of the patch's
        variance [depths^2]. Axis 2: f and g. Axis 3: powers of t.
        Divide f by depth^2 (line: depth) and g by depth^3 (line: depth^2).
    """
    return _polynomials(round(skin.depth / skin.thickness, 12), round(skin.poisson, 12),
                        round(side / skin.depth, 12))
