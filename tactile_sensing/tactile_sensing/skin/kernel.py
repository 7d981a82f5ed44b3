"""
Pressure of point and line loads on a skin, as polynomials that a compiled fit evaluates.

A tactel measures P f(s) + (Qx u + Qy v) g(s) under a point load, s = u^2 + v^2
its squared distance; likewise under a line load, u its distance and Q the shear across. The
inverse transforms of `layer.pressure_transforms` give f and g, and here they become polynomials in
t = c^2 / (s + c^2), c some depths: smooth, and without an end. What an area tactel averages, and
what an extended load spreads, are factors of the transform.

The mean over a square depends on direction. For a point its mean over all directions is used,
right to the third order of the side; a line has the next term as well, that with cos(4 yaw).
Tactels too large for that are split.
"""

from functools import lru_cache

import numpy as np

from tactile_sensing.skin.layer import pressure_transforms
from tactile_sensing.types.skin import Skin

DEGREE = 12  # of the polynomials in t
SPREAD_DEGREE = 7  # of those in the variance of the load's patch
CENTRE = 2.0  # c [depths]
# Largest variance along one axis of the patch of a load [depths^2]: Hertz' of a radius of 1.5
# depths (radius^2 / 5), or of a half width of 1.34 depths (half width^2 / 4).
MAX_VARIANCE = 0.45
LARGEST_SIDE = 0.9  # of a square over which the mean may be taken as round [depths]
REACH = 40.0  # the pressure is fitted to this distance, and to none at infinity [depths]
_NODES = 160


@lru_cache(maxsize=1)
def _quadrature() -> tuple[np.ndarray, np.ndarray]:
    """Wave numbers and weights of the inverse transforms [1/depth]."""
    nodes, weights = np.polynomial.legendre.leggauss(20)
    k = (np.arange(45)[:, None] + 0.5 + 0.5 * nodes) / 1.5  # to 30: e^-30 is nothing
    return k.ravel(), np.tile(weights / 3.0, 45)


@lru_cache(maxsize=1)
def _transforms() -> np.ndarray:
    """
    From transforms at the wave numbers to coefficients.

    Returns arrays (2, 2, DEGREE + 1, wave numbers): of point and line, for f and g.
    """
    from scipy.special import j0, j1  # of 35 MB, which only a fit needs
    k, weights = _quadrature()
    nearest = CENTRE**2 / (REACH**2 + CENTRE**2)
    t = nearest + (1.0 - nearest) * 0.5 * (
        1.0 + np.cos(np.pi * (np.arange(_NODES) + 0.5) / _NODES))
    r = CENTRE * np.sqrt(1.0 / t - 1.0)
    kr = np.multiply.outer(r, k)
    values = np.stack([j0(kr) * k / (2.0 * np.pi), j1(kr) * k / (2.0 * np.pi) / r[:, None],
                       np.cos(kr) / np.pi, np.sin(kr) / np.pi / r[:, None]]) * weights
    values = values.reshape(2, 2, _NODES, k.size)
    lever = np.stack([np.ones(_NODES), np.minimum(r, 5.0)])  # g stands beside a distance
    basis = np.polynomial.chebyshev.chebvander(2.0 * t - 1.0, DEGREE)
    at_infinity = np.polynomial.chebyshev.chebvander(np.array([-1.0]), DEGREE)
    # Columns: coefficients of the powers of t of every Chebyshev polynomial in 2 t - 1.
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
    """Transform of the mean over a square: its mean over directions, and that of cos(4 yaw)."""
    turn = np.pi / 2.0 * (np.arange(32) + 0.5) / 32
    half = np.multiply.outer(0.5 * side * k, np.stack([np.cos(turn), np.sin(turn)]) / np.pi)
    mean = np.sinc(half).prod(axis=-2)
    return mean.mean(axis=-1), 2.0 * (mean * np.cos(4.0 * turn)).mean(axis=-1)


def patch_transforms(k: np.ndarray, variance: float) -> tuple[np.ndarray, np.ndarray]:
    """
    Transforms of Hertz' pressures over a disc and over a strip.

    Both have the variance along each axis, or across: radius^2 / 5, half width^2 / 4.
    """
    if variance == 0.0:
        return np.ones_like(k), np.ones_like(k)
    from scipy.special import j1
    disc, strip = k * np.sqrt(5.0 * variance), k * np.sqrt(4.0 * variance)
    small = disc < 0.02
    safe = np.where(small, 1.0, disc)
    of_disc = np.where(small, 1.0 - disc**2 / 10.0,
                       3.0 * (np.sin(safe) - safe * np.cos(safe)) / safe**3)
    return of_disc, 2.0 * j1(strip) / strip


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
    Coefficients of f and g in units of the depth.

    Parameters
    ----------
    skin : Skin
    side : float
        Of the squares over which tactels average [m]; 0: they sample points.

    Returns
    -------
    ndarray, shape (3, SPREAD_DEGREE + 1, 2, DEGREE + 1), read-only
        Of point, line, and what a line has more times cos(4 yaw); powers of the patch's variance
        [depths^2]; f and g; powers of t.
        f is over depth^2 (line: depth), g over depth^3 (depth^2).
    """
    return _polynomials(round(skin.depth / skin.thickness, 12), round(skin.poisson, 12),
                        round(side / skin.depth, 12))
