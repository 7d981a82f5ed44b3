"""
Compiled normal equations of a plane, sphere, cylinder or general surface at a contact.

In a tangent frame with inward normal n and u = (x, y), any plane, sphere or cylinder satisfies

    -n_xy = b + K u    and    z (1 + n_z) / 2 = a + b u + u' K u / 2

however large the arc. Both are linear in the height a, the slope b and the curvature K.
"""
from typing import NamedTuple

import numpy as np

from tactile_common.kernels import njit


class Noise(NamedTuple):
    """Standard deviations of one contact; of the normal [rad], else [m]."""

    position: float
    location: float  # of what moves along the surface
    normal: float
    height: float  # beyond that of position


class Cells(NamedTuple):
    """Contacts in a tangent frame."""

    u: np.ndarray  # (m, 2) [m]
    z: np.ndarray  # (m,) [m]
    n: np.ndarray  # (m, 3)
    weights: np.ndarray  # (m,), independent samples in each row


class NormalEquations(NamedTuple):
    """Of (a, b1, b2, K11, K12, K22): matrix (6, 6), right side (6,), its square weighted."""

    matrix: np.ndarray
    right: np.ndarray
    square: float


class CurvatureEquations(NamedTuple):
    """Of K alone: K = information^-1 right, and height and slope (a, b1, b2) = flat - lift K."""

    information: np.ndarray  # (3, 3)
    right: np.ndarray  # (3,)
    flat: np.ndarray  # (3,)
    lift: np.ndarray  # (3, 3)
    rest: float  # chi-square with K = 0


@njit(cache=True)
def equations(cells, noise, curvature, doubt, model_error):
    """
    NormalEquations of Cells with a Noise.

    Parameters
    ----------
    curvature : ndarray, shape (3,)
        K11, K12, K22: with them, a displacement along the surface is an error of the normal.
    doubt : ndarray, shape (3,)
        Their variances, since what is not known of K makes errors as well.
    model_error : float
        What the model leaves out, over the third-order term |K u|^3 of normal and height.
    """
    matrix, right, square = np.zeros((6, 6)), np.zeros(6), 0.0
    row = np.zeros((3, 6))
    slide = noise.position**2 + noise.location**2
    k11, k12, k22 = curvature
    d11, d12, d22 = doubt
    q11, q12, q22 = k11 * k11 + k12 * k12, k12 * (k11 + k22), k12 * k12 + k22 * k22
    r11 = noise.normal**2 + slide * (q11 + d11 + d12)
    r22 = noise.normal**2 + slide * (q22 + d12 + d22)
    r12 = slide * q12
    row[0, 0] = row[1, 1] = row[2, 2] = 1.0
    for i in range(len(cells.z)):
        x, y = cells.u[i]
        z, (nx, ny, nz), weight = cells.z[i], cells.n[i], cells.weights[i]
        up, lean = max(nz, 0.1), nx**2 + ny**2
        upright = 0.5 * (1.0 + up)
        # Along the surface, height and slope move together and cancel up to the second order.
        left_over = 0.5 * (1.0 - up) / up
        variance = (noise.position**2 * (lean + upright**2) + noise.height**2
                    + noise.location**2 * lean * left_over**2)
        turn = (k11 * x + k12 * y)**2 + (k12 * x + k22 * y)**2
        variance += weight * (model_error * turn * z)**2
        unlike = weight * model_error**2 * turn**3
        s11, s22 = r11 + unlike, r22 + unlike
        determinant = s11 * s22 - r12 * r12
        row[0, 1], row[0, 2] = x, y
        row[0, 3], row[0, 4], row[0, 5] = 0.5 * x * x, x * y, 0.5 * y * y
        row[1, 3], row[1, 4] = x, y
        row[2, 4], row[2, 5] = x, y
        w00 = weight / variance
        w11, w12, w22 = (
            weight * s22 / determinant, -weight * r12 / determinant, weight * s11 / determinant)
        t0, t1, t2 = z * 0.5 * (1.0 + nz), -nx, -ny
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
    return NormalEquations(matrix, right, square)


@njit(cache=True)
def curvature_equations(cells, noise, curvature, doubt, model_error, count, prior):
    """CurvatureEquations, see `equations`; the first `count` of K are seen, else the prior's."""
    matrix, right, square = equations(cells, noise, curvature, doubt, model_error)
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
    return CurvatureEquations(information, reduced, flat, lift, rest)
