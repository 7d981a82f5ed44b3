"""Tangent frames, principal axes and the reduced form of a surface over its tangent plane."""
import numpy as np
from numpy.typing import ArrayLike


def tangent_frame(normal: np.ndarray) -> np.ndarray:
    """Right-handed frame (3, 3) whose third column is a unit normal (3,)."""
    x, y, z = normal
    # Frisvad's basis after Duff et al.: smooth but for the sign, and no division by zero.
    sign = 1.0 if z >= 0.0 else -1.0
    a = -1.0 / (sign + z)
    b = x * y * a
    return np.array([[1.0 + sign * x * x * a, b, x],
                     [sign * b, sign + y * y * a, y],
                     [-sign * x, -y, z]])


def principal_axes(curvature: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """
    Principal curvatures of K (2, 2), the larger in magnitude first.

    Also returns the rotation (3, 3) about z that brings x and y to the principal directions.
    """
    values, vectors = np.linalg.eigh(0.5 * (curvature + np.transpose(curvature)))
    if abs(values[1]) >= abs(values[0]):
        values, vectors = values[::-1], vectors[:, ::-1]
    x, y = vectors[:, 0] if vectors[0, 0] >= 0.0 else -vectors[:, 0]
    return values, np.array([[x, -y, 0.0], [y, x, 0.0], [0.0, 0.0, 1.0]])


def height(curvature: ArrayLike, points: ArrayLike) -> np.ndarray:
    """
    Height z over the tangent plane of the reduced form: z (1 + n_z) / 2 = u' K u / 2, n_xy = -K u.

    K is (2, 2) [1/m], points u are (..., 2) [m]. It is exact for plane, sphere and cylinder
    however large the arc, and NaN beyond the surface's border, where it would stand upright.
    """
    points = np.asarray(points, dtype=float)
    slope = points @ np.asarray(curvature, dtype=float)
    with np.errstate(invalid='ignore'):
        upright = np.sqrt(1.0 - (slope**2).sum(axis=-1))
    return (slope * points).sum(axis=-1) / (1.0 + upright)
