"""
Least squares for loads whose forces enter linearly: variable projection and Gauss-Newton.

A load has two parameters of place, q0 and q1, and up to three forces. The model at every
tactel is the sum of force times `columns[2:]`; `columns[:2]` are the derivatives by place.
Everything is over the noise of a tactel. The best forces for each place come from a solve of
their own, which needs no start and saves a step.

The loops run over rows of their own, indexed from 0, or they could not be vectorised.
"""

import numpy as np

from tactile_common.kernels import FAST, njit

SINGULAR = 1e-12  # smallest pivot of normal equations with a unit diagonal
TUKEY = 4.685  # scales at which a tactel loses all weight: 95 % efficient without outliers


@njit(error_model='numpy')
def best_forces(matrix, vector, theta, inverse):
    """Forces into theta, and the inverse of their block of the matrix; False if singular."""
    # Scaled to a unit diagonal: tangential columns are smaller by orders of magnitude.
    if not (matrix[2, 2] > 0.0 and matrix[3, 3] > 0.0 and matrix[4, 4] > 0.0):
        return False
    f = 1.0 / np.sqrt(matrix[2, 2])
    x = 1.0 / np.sqrt(matrix[3, 3])
    y = 1.0 / np.sqrt(matrix[4, 4])
    fx, fy, xy = f * x * matrix[3, 2], f * y * matrix[4, 2], x * y * matrix[4, 3]
    det = 1.0 + 2.0 * fx * fy * xy - fx * fx - fy * fy - xy * xy
    if not SINGULAR < det < np.inf:
        return False
    ff, xx, yy = f * f * (1.0 - xy * xy) / det, x * x * (1.0 - fy * fy) / det, (
        y * y * (1.0 - fx * fx) / det)
    fx, fy, xy = f * x * (fy * xy - fx) / det, f * y * (fx * xy - fy) / det, (
        x * y * (fx * fy - xy) / det)
    inverse[0], inverse[1], inverse[2], inverse[3], inverse[4], inverse[5] = (
        ff, xx, yy, fx, fy, xy)
    theta[2] = ff * vector[2] + fx * vector[3] + fy * vector[4]
    theta[3] = fx * vector[2] + xx * vector[3] + xy * vector[4]
    theta[4] = fy * vector[2] + xy * vector[3] + yy * vector[4]
    return True


@njit(error_model='numpy')
def place_step(matrix, vector, inverse):
    """Gauss-Newton step of (q0, q1) with the forces eliminated; infinite if singular."""
    ff, xx, yy, fx, fy, xy = (
        inverse[0], inverse[1], inverse[2], inverse[3], inverse[4], inverse[5])
    fa, xa, ya = matrix[2, 0], matrix[3, 0], matrix[4, 0]
    fb, xb, yb = matrix[2, 1], matrix[3, 1], matrix[4, 1]
    f, x, y = ff * fa + fx * xa + fy * ya, fx * fa + xx * xa + xy * ya, (
        fy * fa + xy * xa + yy * ya)
    aa = matrix[0, 0] - f * fa - x * xa - y * ya
    ab = matrix[1, 0] - f * fb - x * xb - y * yb
    bb = matrix[1, 1] - ff * fb * fb - xx * xb * xb - yy * yb * yb - 2.0 * (
        fx * fb * xb + fy * fb * yb + xy * xb * yb)
    det = aa * bb - ab * ab
    if not (aa > SINGULAR * matrix[0, 0] and bb > SINGULAR * matrix[1, 1]
            and det > SINGULAR * aa * bb):
        return np.inf, np.inf
    return (bb * vector[0] - ab * vector[1]) / det, (aa * vector[1] - ab * vector[0]) / det


@njit(error_model='numpy', fastmath=FAST)
def normal_of_forces(values, one, two, three, n, matrix, vector):
    """Normal equations of the forces alone, lower triangle."""
    ff = fx = xx = fy = xy = yy = f = x = y = 0.0
    for i in range(n):
        value, jf, jx, jy = values[i], one[i], two[i], three[i]
        ff += jf * jf
        fx += jf * jx
        xx += jx * jx
        fy += jf * jy
        xy += jx * jy
        yy += jy * jy
        f += jf * value
        x += jx * value
        y += jy * value
    matrix[2, 2] = ff
    matrix[3, 2], matrix[3, 3] = fx, xx
    matrix[4, 2], matrix[4, 3], matrix[4, 4] = fy, xy, yy
    vector[2], vector[3], vector[4] = f, x, y


@njit(error_model='numpy', fastmath=FAST)
def normal_of_place(values, by_q0, by_q1, one, two, three, theta, n, rest, matrix, vector):
    """Complete the normal equations with the place, at the best forces; residuals into rest."""
    force, qx, qy = theta[2], theta[3], theta[4]
    aa = ab = bb = fa = fb = xa = xb = ya = yb = a = b = 0.0
    for i in range(n):
        ja, jb, jf, jx, jy = by_q0[i], by_q1[i], one[i], two[i], three[i]
        error = values[i] - (jf * force + jx * qx + jy * qy)
        rest[i] = error
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
    matrix[0, 0] = aa
    matrix[1, 0], matrix[1, 1] = ab, bb
    matrix[2, 0], matrix[2, 1] = fa, fb
    matrix[3, 0], matrix[3, 1] = xa, xb
    matrix[4, 0], matrix[4, 1] = ya, yb
    vector[0], vector[1] = a, b


@njit(error_model='numpy', fastmath=FAST)
def chi_square(values, rest, n, model_error):
    """Squared error and chi-square with the model-error allowance."""
    squared = chi = 0.0
    for i in range(n):
        error = rest[i] * rest[i]
        allowed = model_error * (values[i] - rest[i])
        squared += error
        chi += error / (1.0 + allowed * allowed)
    return squared, chi


@njit(error_model='numpy')
def tukey_weights(values, rest, n, model_error, tukey, roots):
    """Square roots of the biweights of the residuals, about their median absolute value."""
    for i in range(n):
        allowed = model_error * (values[i] - rest[i])
        roots[i] = abs(rest[i]) / np.sqrt(1.0 + allowed * allowed)
    scale = tukey * max(1.0, np.median(roots[:n]) / 0.6745)
    for i in range(n):
        roots[i] = max(1.0 - (roots[i] / scale) ** 2, 0.0)


@njit(error_model='numpy')
def weigh(rows, roots, n):
    """Multiply rows by the square roots of the weights, in place."""
    for row in rows:
        for i in range(n):
            row[i] *= roots[i]
