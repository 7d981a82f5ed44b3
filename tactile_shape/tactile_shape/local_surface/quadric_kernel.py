"""Compiled kernel of `local_quadric`: weighted least squares, then the least sufficient model."""
import math
from typing import NamedTuple

import numpy as np

from tactile_common.kernels import njit
from tactile_shape.local_surface.least_model import (
    curvature_covariance,
    CYLINDER,
    GENERAL,
    least_model,
    principal_curvatures,
)
from tactile_shape.local_surface.normal_equations import Cells, curvature_equations, Noise

PASSES = 3  # weights depend on K: by the third pass they no longer change
# A path's breadth counts where its variance is that many times the variance of noise.
CLEAR = 9.0
# Share of its third order that a general surface may depart from a second-order one; makes far
# contacts count less.
MODEL_ERROR = 0.1
ENOUGH = 10  # cells whose residuals tell their noise
_HEIGHTS_SPENT = 2.0  # of the six parameters, what the heights alone have paid for, about


class Fit(NamedTuple):
    """Least model of contacts; height and slope in the frame `axes`."""

    kind: int  # 0 where the path is too short to see any curvature
    axes: np.ndarray  # (3, 3), tangent frame turned so that x is the path's direction
    height: float  # a [m]
    slope: np.ndarray  # b, (2,)
    principal: np.ndarray  # (2,), principal curvatures [1/m]
    heading: float  # of the first [rad]
    covariance: np.ndarray  # (2, 2), of the principal curvatures
    seen: np.ndarray  # (2,), variance of each as the data alone tell it
    along: float  # variance of the curvature along the path
    residual: float  # RMS in standard deviations
    scatter: float  # standard deviation of positions about the surface, at least that told [m]


@njit(cache=True)
def _path_frame(points, weights, origin, axes, spread_noise):
    """Tangent frame with x along the path, and how many of K11, K12, K22 the path can see."""
    u = (points - origin) @ axes
    total = weights.sum()
    mx, my = (weights * u[:, 0]).sum() / total, (weights * u[:, 1]).sum() / total
    x, y = u[:, 0] - mx, u[:, 1] - my
    large, small, turn = principal_curvatures(
        (weights * x * x).sum() / total, (weights * x * y).sum() / total,
        (weights * y * y).sum() / total)
    c, s = math.cos(turn), math.sin(turn)
    turned = axes @ np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    fuzz = CLEAR * spread_noise**2 * len(weights) / total + 1e-24
    return turned, 0 if large < fuzz else 2 if small < fuzz else 3


@njit(cache=True)
def _position_noise(cells, flat, curvature, told):
    """Standard deviation of positions [m], from the heights' residuals if that is the larger."""
    if len(cells.z) < ENOUGH:
        return told
    total = 0.0
    height, slope_x, slope_y = flat
    k11, k12, k22 = curvature
    for i in range(len(cells.z)):
        x, y = cells.u[i]
        bend = 0.5 * (k11 * x * x + k22 * y * y) + k12 * x * y
        residual = (0.5 * cells.z[i] * (1.0 + cells.n[i, 2]) - height - slope_x * x
                    - slope_y * y - bend)
        total += cells.weights[i] * residual**2
    return max(told, math.sqrt(total / (len(cells.z) - _HEIGHTS_SPENT)))


@njit(cache=True)
def _excess(found, freedom):
    """Chi-square per degree of freedom, at least 1 as what is unexplained is noise, and RMS."""
    if freedom < 1:
        return 1.0, math.nan
    explained = (found.right * np.linalg.solve(found.information, found.right)).sum()
    left = max(found.rest - explained, 0.0) / freedom
    return max(1.0, left), math.sqrt(left)


@njit(cache=True)
def _weighted(cells, noise, count, prior):
    """CurvatureEquations with the weights that K itself gives, and the noise found with them."""
    curvature, doubt, told = np.zeros(3), np.zeros(3), noise.position
    found = curvature_equations(cells, noise, curvature, doubt, 0.0, count, prior)
    for _ in range(PASSES - 1 if count else 0):
        covariance = np.linalg.inv(found.information)
        curvature, doubt = covariance @ found.right, np.diag(covariance).copy()
        position = _position_noise(cells, found.flat - found.lift @ curvature, curvature, told)
        noise = Noise(position, noise.location, noise.normal, noise.height)
        found = curvature_equations(cells, noise, curvature, doubt, 0.0, count, prior)
    return found, noise, doubt


@njit(cache=True)
def solve(points, normals, weights, origin, axes, noise, prior):
    """
    Fit of the least model to points and normals (m, 3), each the mean of `weights` (m,) samples.

    Parameters
    ----------
    origin, axes : ndarray, shapes (3,) and (3, 3)
        Tangent frame: columns x, y and the inward normal.
    noise : Noise
        Of one sample; what it has along the surface may fake a path's breadth.
    prior : float
        Standard deviation of curvature before anything was touched [1/m].
    """
    spread = math.sqrt(noise.position**2 + noise.location**2)
    axes, count = _path_frame(points, weights, origin, axes, spread)
    local = (points - origin) @ axes
    cells = Cells(local[:, :2].copy(), local[:, 2].copy(), normals @ axes, weights)
    found, noise, doubt = _weighted(cells, noise, count, prior)
    kind, curvature, residual, information = 0, np.zeros(3), math.nan, found.information
    if count:
        freedom = 3 * len(weights) - 3 - count
        excess, residual = _excess(found, freedom)
        kind, curvature = least_model(found.information / excess, found.right / excess, count)
        if kind == GENERAL:
            for _ in range(2):
                found = curvature_equations(
                    cells, noise, curvature, doubt, MODEL_ERROR, count, prior)
                curvature = np.linalg.solve(found.information, found.right)
            excess, residual = _excess(found, freedom)
        information = found.information / excess
    k11, k12, k22 = curvature
    k1, k2, heading = principal_curvatures(k11, k12, k22)
    if abs(k2) > abs(k1):
        k1, k2, heading = k2, k1, heading + 0.5 * math.pi
    if kind == CYLINDER:
        k2 = 0.0
    elif kind != GENERAL:
        heading = 0.0
    flat = found.flat - found.lift @ curvature
    # What was not seen cannot be known better by calling it a cylinder.
    covariance, seen = curvature_covariance(
        kind if count == 3 else GENERAL, information, k1, heading)
    along = np.linalg.inv(information)[0, 0]
    return Fit(kind, axes, flat[0], flat[1:], np.array([k1, k2]), heading, covariance, seen,
               along, residual, noise.position)
