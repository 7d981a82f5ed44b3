"""
Least squares for loads whose forces enter linearly: variable projection and Gauss-Newton.

A load (`half_space.kernels.LOAD`) has two parameters of place, q0 and q1, and up to three
forces. The model at every tactel is the sum of each force times the derivative by it. Everything
is over the noise of a tactel; of normal equations the lower triangle is used. The best forces
for each place come from a solve of their own, which needs no start and saves a step.

The loops run over rows of their own, indexed from 0, or they could not be vectorised.
"""

from typing import NamedTuple

import numpy as np

from tactile_common.kernels import FAST, njit
from tactile_sensing.half_space.kernels import FORCE, Q0, Q1, SHEAR_X, SHEAR_Y

SINGULAR = 1e-12  # smallest pivot of normal equations with a unit diagonal
TUKEY = 4.685  # scales at which a tactel loses all weight: 95 % efficient without outliers


class ForceInverse(NamedTuple):
    """Inverse of the forces' block of the normal equations: force, shear x and y."""

    ff: float
    xx: float
    yy: float
    fx: float
    fy: float
    xy: float


SINGULAR_BLOCK = ForceInverse(np.inf, np.inf, np.inf, 0.0, 0.0, 0.0)


@njit(error_model='numpy')
def best_forces(matrix, vector, load):
    """Forces into a load; the inverse of their block, and whether there is one."""
    # Scaled to a unit diagonal: tangential columns are smaller by orders of magnitude.
    if not (matrix[FORCE, FORCE] > 0.0 and matrix[SHEAR_X, SHEAR_X] > 0.0
            and matrix[SHEAR_Y, SHEAR_Y] > 0.0):
        return SINGULAR_BLOCK, False
    f = 1.0 / np.sqrt(matrix[FORCE, FORCE])
    x = 1.0 / np.sqrt(matrix[SHEAR_X, SHEAR_X])
    y = 1.0 / np.sqrt(matrix[SHEAR_Y, SHEAR_Y])
    fx, fy, xy = f * x * matrix[SHEAR_X, FORCE], f * y * matrix[SHEAR_Y, FORCE], (
        x * y * matrix[SHEAR_Y, SHEAR_X])
    det = 1.0 + 2.0 * fx * fy * xy - fx * fx - fy * fy - xy * xy
    if not SINGULAR < det < np.inf:
        return SINGULAR_BLOCK, False
    ff, xx, yy = f * f * (1.0 - xy * xy) / det, x * x * (1.0 - fy * fy) / det, (
        y * y * (1.0 - fx * fx) / det)
    fx, fy, xy = f * x * (fy * xy - fx) / det, f * y * (fx * xy - fy) / det, (
        x * y * (fx * fy - xy) / det)
    by_force, by_x, by_y = vector[FORCE], vector[SHEAR_X], vector[SHEAR_Y]
    load.force = ff * by_force + fx * by_x + fy * by_y
    load.shear_x = fx * by_force + xx * by_x + xy * by_y
    load.shear_y = fy * by_force + xy * by_x + yy * by_y
    return ForceInverse(ff, xx, yy, fx, fy, xy), True


@njit(error_model='numpy')
def place_step(matrix, vector, forces):
    """Gauss-Newton step of (q0, q1) with the forces eliminated; infinite if singular."""
    ff, xx, yy, fx, fy, xy = forces
    fa, xa, ya = matrix[FORCE, Q0], matrix[SHEAR_X, Q0], matrix[SHEAR_Y, Q0]
    fb, xb, yb = matrix[FORCE, Q1], matrix[SHEAR_X, Q1], matrix[SHEAR_Y, Q1]
    f, x, y = ff * fa + fx * xa + fy * ya, fx * fa + xx * xa + xy * ya, (
        fy * fa + xy * xa + yy * ya)
    aa = matrix[Q0, Q0] - f * fa - x * xa - y * ya
    ab = matrix[Q1, Q0] - f * fb - x * xb - y * yb
    bb = matrix[Q1, Q1] - ff * fb * fb - xx * xb * xb - yy * yb * yb - 2.0 * (
        fx * fb * xb + fy * fb * yb + xy * xb * yb)
    det = aa * bb - ab * ab
    if not (aa > SINGULAR * matrix[Q0, Q0] and bb > SINGULAR * matrix[Q1, Q1]
            and det > SINGULAR * aa * bb):
        return np.inf, np.inf
    return (bb * vector[Q0] - ab * vector[Q1]) / det, (aa * vector[Q1] - ab * vector[Q0]) / det


@njit(error_model='numpy', fastmath=FAST)
def normal_of_forces(values, by, n, matrix, vector):
    """Normal equations of the forces alone."""
    by_force, by_x, by_y = by[FORCE], by[SHEAR_X], by[SHEAR_Y]
    ff = fx = xx = fy = xy = yy = f = x = y = 0.0
    for i in range(n):
        value, jf, jx, jy = values[i], by_force[i], by_x[i], by_y[i]
        ff += jf * jf
        fx += jf * jx
        xx += jx * jx
        fy += jf * jy
        xy += jx * jy
        yy += jy * jy
        f += jf * value
        x += jx * value
        y += jy * value
    matrix[FORCE, FORCE] = ff
    matrix[SHEAR_X, FORCE], matrix[SHEAR_X, SHEAR_X] = fx, xx
    matrix[SHEAR_Y, FORCE], matrix[SHEAR_Y, SHEAR_X], matrix[SHEAR_Y, SHEAR_Y] = fy, xy, yy
    vector[FORCE], vector[SHEAR_X], vector[SHEAR_Y] = f, x, y


@njit(error_model='numpy', fastmath=FAST)
def normal_of_place(values, by, load, n, residual, matrix, vector):
    """Complete the normal equations with the place, at the best forces; leaves the residuals."""
    by_q0, by_q1 = by[Q0], by[Q1]
    by_force, by_x, by_y = by[FORCE], by[SHEAR_X], by[SHEAR_Y]
    force, qx, qy = load.force, load.shear_x, load.shear_y
    aa = ab = bb = fa = fb = xa = xb = ya = yb = a = b = 0.0
    for i in range(n):
        ja, jb, jf, jx, jy = by_q0[i], by_q1[i], by_force[i], by_x[i], by_y[i]
        error = values[i] - (jf * force + jx * qx + jy * qy)
        residual[i] = error
        aa += ja * ja
        ab += ja * jb
        bb += jb * jb
        fa += jf * ja
        fb += jf * jb
        xa += jx * ja
        xb += jx * jb
        ya += jy * ja
        yb += jy * jb
        a += ja * error
        b += jb * error
    matrix[Q0, Q0] = aa
    matrix[Q1, Q0], matrix[Q1, Q1] = ab, bb
    matrix[FORCE, Q0], matrix[FORCE, Q1] = fa, fb
    matrix[SHEAR_X, Q0], matrix[SHEAR_X, Q1] = xa, xb
    matrix[SHEAR_Y, Q0], matrix[SHEAR_Y, Q1] = ya, yb
    vector[Q0], vector[Q1] = a, b


@njit(error_model='numpy', fastmath=FAST)
def chi_square(values, residual, n, model_error):
    """Squared error and chi-square with the model-error allowance."""
    squared = chi = 0.0
    for i in range(n):
        error = residual[i] * residual[i]
        allowed = model_error * (values[i] - residual[i])
        squared += error
        chi += error / (1.0 + allowed * allowed)
    return squared, chi


@njit(error_model='numpy')
def tukey_weights(values, residual, n, model_error, tukey, roots):
    """Square roots of the biweights of the residuals, about their median absolute value."""
    for i in range(n):
        allowed = model_error * (values[i] - residual[i])
        roots[i] = abs(residual[i]) / np.sqrt(1.0 + allowed * allowed)
    scale = tukey * max(1.0, np.median(roots[:n]) / 0.6745)
    for i in range(n):
        roots[i] = max(1.0 - (roots[i] / scale) ** 2, 0.0)


@njit(error_model='numpy', fastmath=FAST)
def scatter_weights(values, residual, n, scatter, roots):
    """Square roots of the weights of tactels that are off by a share of the pressure as well."""
    for i in range(n):
        off = scatter * (values[i] - residual[i])
        roots[i] = 1.0 / np.sqrt(1.0 + off * off)


@njit(error_model='numpy')
def weigh(rows, roots, n):
    """Multiply rows by the square roots of the weights, in place."""
    for row in rows:
        for i in range(n):
            row[i] *= roots[i]
