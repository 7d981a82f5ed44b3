"""
Compiled kernel of `local_quadric`: weighted least squares, then the least sufficient model.

In a tangent frame with inward normal n and u = (x, y), any plane, sphere or cylinder satisfies

    -n_xy = b + K u    and    z (1 + n_z) / 2 = a + b u + u' K u / 2

however large the arc. Both are linear in the height a, the slope b and the curvature K.
"""
import math
from pathlib import Path
from typing import NamedTuple
import zlib

import numpy as np

from tactile_common.kernels import njit
from tactile_shape.local_surface import least_model as least_model_module
from tactile_shape.local_surface.least_model import (
    curvature_covariance,
    CYLINDER,
    GENERAL,
    least_model,
    principal_curvatures,
)

PASSES = 3  # weights depend on K: by the third pass they no longer change
# A path's breadth counts where its variance is that many times the variance of noise.
CLEAR = 9.0
# Share of its third order that a general surface may depart from a second-order one; makes far
# contacts count less.
MODEL_ERROR = 0.1
ENOUGH = 10  # cells whose residuals tell their noise
_HEIGHTS_SPENT = 2.0  # of the six parameters, what the heights alone have paid for, about


class Fit(NamedTuple):
    """
    What `solve` returns.

    Attributes
    ----------
    kind : int
        0 where the path is too short to see any curvature.
    axes : ndarray, shape (3, 3)
        Tangent frame turned so that x is the path's direction.
    height, slope : float, ndarray (2,)
        a, b of that model, in that frame.
    principal, heading : ndarray (2,), float
        Principal curvatures and the angle of the first.
    covariance : ndarray, shape (2, 2)
        Of the principal curvatures.
    seen : ndarray, shape (2,)
        Variance of each as the data alone tell it.
    along : float
        Variance of the curvature along the path.
    residual : float
        RMS in standard deviations.
    scatter : float
        Standard deviation of positions about the surface, or what was told if it is larger [m].
    """

    kind: int
    axes: np.ndarray
    height: float
    slope: np.ndarray
    principal: np.ndarray
    heading: float
    covariance: np.ndarray
    seen: np.ndarray
    along: float
    residual: float
    scatter: float


@njit(cache=True)
def equations(u, z, n, weights, noise, curvature, doubt, model_error):
    """
    Normal equations of (a, b1, b2, K11, K12, K22).

    Parameters
    ----------
    u : ndarray, shape (m, 2)
    z : ndarray, shape (m,)
    n : ndarray, shape (m, 3)
    weights : ndarray, shape (m,)
        Independent samples in each row.
    noise : ndarray, shape (4,)
        Standard deviations of position, of what moves along the surface, of normal, of height
        beyond that of position.
    curvature : ndarray, shape (3,)
        K11, K12, K22: with them, a displacement along the surface is an error of the normal.
    doubt : ndarray, shape (3,)
        Variances of K11, K12, K22, since what is not known of K makes errors as well.
    model_error : float
        What the model leaves out, over the third-order term |K u|^3 of a normal, and over the
        same of height.

    Returns
    -------
    matrix : ndarray, shape (6, 6)
    right : ndarray, shape (6,)
    square : float
        Weighted sum of the squared right-hand sides.
    """
    matrix, right, square = np.zeros((6, 6)), np.zeros(6), 0.0
    row = np.zeros((3, 6))
    slide = noise[0]**2 + noise[1]**2
    k11, k12, k22 = curvature
    q11, q12, q22 = k11 * k11 + k12 * k12, k12 * (k11 + k22), k12 * k12 + k22 * k22
    r11 = noise[2]**2 + slide * (q11 + doubt[0] + doubt[1])
    r22 = noise[2]**2 + slide * (q22 + doubt[1] + doubt[2])
    r12 = slide * q12
    row[0, 0] = row[1, 1] = row[2, 2] = 1.0
    for i in range(len(z)):
        x, y, up = u[i, 0], u[i, 1], max(n[i, 2], 0.1)
        lean = n[i, 0]**2 + n[i, 1]**2
        upright = 0.5 * (1.0 + up)
        # Along the surface, height and slope move together and cancel up to the second order.
        left_over = 0.5 * (1.0 - up) / up
        variance = (noise[0]**2 * (lean + upright**2) + noise[3]**2
                    + noise[1]**2 * lean * left_over**2)
        turn = (k11 * x + k12 * y)**2 + (k12 * x + k22 * y)**2
        variance += weights[i] * (model_error * turn * z[i])**2
        unlike = weights[i] * model_error**2 * turn**3
        s11, s22 = r11 + unlike, r22 + unlike
        determinant = s11 * s22 - r12 * r12
        row[0, 1], row[0, 2] = x, y
        row[0, 3], row[0, 4], row[0, 5] = 0.5 * x * x, x * y, 0.5 * y * y
        row[1, 3], row[1, 4] = x, y
        row[2, 4], row[2, 5] = x, y
        w00 = weights[i] / variance
        w11, w12, w22 = (weights[i] * s22 / determinant, -weights[i] * r12 / determinant,
                         weights[i] * s11 / determinant)
        t0, t1, t2 = z[i] * 0.5 * (1.0 + n[i, 2]), -n[i, 0], -n[i, 1]
        for p in range(6):
            a0 = w00 * row[0, p]
            a1 = w11 * row[1, p] + w12 * row[2, p]
            a2 = w12 * row[1, p] + w22 * row[2, p]
            right[p] += a0 * t0 + a1 * t1 + a2 * t2
            for q in range(p, 6):
                matrix[p, q] += a0 * row[0, q] + a1 * row[1, q] + a2 * row[2, q]
        square += w00 * t0 * t0 + w11 * t1 * t1 + 2.0 * w12 * t1 * t2 + w22 * t2 * t2
    for p in range(6):
        for q in range(p):
            matrix[p, q] = matrix[q, p]
    return matrix, right, square


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
def _curvature_equations(u, z, n, weights, noise, curvature, doubt, model_error, count, prior):
    """
    Normal equations of K alone, height and slope eliminated; parameters as of `equations`.

    Of K11, K12, K22 the first `count` are seen; of the others there is a prior.

    Returns
    -------
    information, reduced : ndarray, shapes (3, 3) and (3,)
        K = information^-1 reduced.
    flat, lift : ndarray, shapes (3,) and (3, 3)
        (a, b1, b2) = flat - lift K.
    rest : float
        Chi-square with K = 0.
    """
    matrix, right, square = equations(
        u, z, n, weights, noise, curvature, doubt, model_error)
    first = np.linalg.inv(matrix[:3, :3].copy())
    flat, lift = first @ right[:3].copy(), first @ matrix[:3, 3:].copy()
    information = matrix[3:, 3:] - matrix[3:, :3].copy() @ lift
    reduced = right[3:] - matrix[3:, :3].copy() @ flat
    information[count:, :] = 0.0
    information[:, count:] = 0.0
    reduced[count:] = 0.0
    for p in range(count, 3):
        information[p, p] = 1.0 / prior**2
    rest = square - (right[:3] * flat).sum()
    return information, reduced, flat, lift, rest


@njit(cache=True)
def _position_noise(u, z, n, weights, flat, curvature, told):
    """Standard deviation of positions [m], from the heights' residuals if that is the larger."""
    if len(z) < ENOUGH:
        return told
    total = 0.0
    for i in range(len(z)):
        x, y = u[i]
        bend = 0.5 * (curvature[0] * x * x + curvature[2] * y * y) + curvature[1] * x * y
        residual = 0.5 * z[i] * (1.0 + n[i, 2]) - flat[0] - flat[1] * x - flat[2] * y - bend
        total += weights[i] * residual**2
    return max(told, math.sqrt(total / (len(z) - _HEIGHTS_SPENT)))


@njit(cache=True)
def _excess(information, reduced, rest, freedom):
    """Chi-square per degree of freedom, at least 1: what no surface explains is noise."""
    if freedom < 1:
        return 1.0, math.nan
    left = max(rest - (reduced * np.linalg.solve(information, reduced)).sum(), 0.0) / freedom
    return max(1.0, left), math.sqrt(left)


def _compile(version):
    # Numba keys its cache by this file and the values of the closure: with the source of the
    # other file in it, an edit there is noticed.
    @njit(cache=True)
    def solve(points, normals, weights, origin, axes, noise, spread_noise, prior):
        if version < 0:  # never: keeps it in the closure
            weights = weights + version
        axes, count = _path_frame(points, weights, origin, axes, spread_noise)
        local, n = (points - origin) @ axes, normals @ axes
        u, z = local[:, :2].copy(), local[:, 2].copy()
        kind, residual, curvature, doubt = 0, math.nan, np.zeros(3), np.zeros(3)
        noise, told = noise.copy(), noise[0]
        information, reduced, flat, lift, rest = _curvature_equations(
            u, z, n, weights, noise, curvature, doubt, 0.0, count, prior)
        for _ in range(PASSES - 1 if count else 0):
            covariance = np.linalg.inv(information)
            curvature, doubt = covariance @ reduced, np.diag(covariance).copy()
            noise[0] = _position_noise(
                u, z, n, weights, flat - lift @ curvature, curvature, told)
            information, reduced, flat, lift, rest = _curvature_equations(
                u, z, n, weights, noise, curvature, doubt, 0.0, count, prior)
        if count:
            excess, residual = _excess(information, reduced, rest, 3 * len(z) - 3 - count)
            kind, curvature = least_model(information / excess, reduced / excess, count)
            if kind == GENERAL:
                for _ in range(2):
                    information, reduced, flat, lift, rest = _curvature_equations(
                        u, z, n, weights, noise, curvature, doubt, MODEL_ERROR, count, prior)
                    curvature = np.linalg.solve(information, reduced)
                excess, residual = _excess(information, reduced, rest, 3 * len(z) - 3 - count)
            information = information / excess
        k1, k2, heading = principal_curvatures(curvature[0], curvature[1], curvature[2])
        if abs(k2) > abs(k1):
            k1, k2, heading = k2, k1, heading + 0.5 * math.pi
        if kind == CYLINDER:
            k2 = 0.0
        elif kind != GENERAL:
            heading = 0.0
        flat = flat - lift @ curvature
        # What was not seen cannot be known better by calling it a cylinder.
        covariance, seen = curvature_covariance(
            kind if count == 3 else GENERAL, information, k1, heading)
        along = np.linalg.inv(information)[0, 0]
        return (kind, axes, flat[0], flat[1:], np.array([k1, k2]), heading, covariance, seen,
                along, residual, noise[0])

    return solve


_solve = _compile(zlib.crc32(Path(least_model_module.__file__).read_bytes()))


def solve(points, normals, weights, origin, axes, noise, spread_noise, prior):
    """
    Fit the least model to contacts in a tangent frame.

    Parameters
    ----------
    points, normals : ndarray, shape (m, 3)
    weights : ndarray, shape (m,)
        Independent samples that each row is the mean of.
    origin, axes : ndarray, shapes (3,) and (3, 3)
        Tangent frame: columns x, y and the inward normal.
    noise : ndarray, shape (4,)
        As of `equations`.
    spread_noise : float
        Standard deviation of one sample along the surface [m]: what may fake a path's breadth.
    prior : float
        Standard deviation of curvature before anything was touched [1/m].

    Returns
    -------
    Fit
    """
    return Fit(*_solve(points, normals, weights, origin, axes, noise, spread_noise, prior))
