"""
Second-order surfaces as symmetric 4 x 4 matrices (thesis, sections 4.3.1 and 4.3.2).

The convention is X' S X = 0 with X = [x, y, z, 1]'. At the origin of a contact frame, z is the
object's *inward* unit normal and c34 = 1/2. So the first three components of 2 S X are the inward
normal. They have unit length at the origin; for plane, sphere and cylinder they have unit length
on the whole surface. Curvature is positive for a convex object. The matrices of sphere and
cylinder as printed in the thesis are these times -2 r; its plane is not symmetric.
"""
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from tactile_common.errors import SurfaceError
from tactile_shape.types.tangent import principal_curvatures, tangent_frame, turn_about_z

# Row and column of each of the ten parameters, in the order of (4.33).
ROWS, COLUMNS = np.triu_indices(4)
PARAMETERS = tuple(
    f'c{row + 1}{column + 1}' for row, column in zip(ROWS, COLUMNS, strict=True))


@dataclass(frozen=True, eq=False)
class SurfaceMatrix:
    """
    A second-order surface in some frame.

    Raises
    ------
    SurfaceError
        The matrix is not 4 x 4, not finite, not symmetric, or has no term in x, y or z.
    """

    matrix: np.ndarray  # S of X' S X = 0; lengths in m

    def __post_init__(self) -> None:
        matrix = np.array(self.matrix, dtype=float)
        if matrix.shape != (4, 4):
            raise SurfaceError(f'surface matrix has shape {matrix.shape}, must be (4, 4)')
        if not np.isfinite(matrix).all():
            raise SurfaceError('surface matrix: a number is not finite')
        off = np.abs(matrix - matrix.T).max()
        if off > 1e-9 * np.abs(matrix).max():  # more than rounding
            raise SurfaceError(
                f'surface matrix is not symmetric: entries differ by {off:.3g}; use half of '
                'each coefficient on both sides of the diagonal')
        if not np.abs(matrix[:3]).max() > 0.0:
            raise SurfaceError('surface matrix is degenerate: it has no term in x, y or z')
        object.__setattr__(self, 'matrix', 0.5 * (matrix + matrix.T))

    @classmethod
    def from_curvature(cls, curvature: ArrayLike) -> 'SurfaceMatrix':
        """
        Return the quadric z = u' K u / 2 + ... in its contact frame, K (2, 2) symmetric [1/m].

        The coefficient of z^2 is half the larger curvature. This is exact for plane, sphere and
        cylinder, and otherwise keeps the quadric near the reduced form of `Patch.sheet`.
        """
        curvature = np.array(curvature, dtype=float)
        matrix = np.zeros((4, 4))
        matrix[:2, :2] = -0.5 * curvature
        matrix[2, 3] = matrix[3, 2] = 0.5
        matrix[2, 2] = -0.5 * principal_curvatures(
            curvature[0, 0], curvature[0, 1], curvature[1, 1]).first
        return cls(matrix)

    @classmethod
    def from_parameters(cls, parameters: ArrayLike) -> 'SurfaceMatrix':
        """Return the surface with the ten parameters in the order of `PARAMETERS` (4.33)."""
        matrix = np.zeros((4, 4))
        matrix[ROWS, COLUMNS] = matrix[COLUMNS, ROWS] = np.asarray(parameters, dtype=float)
        return cls(matrix)

    def in_frame(self, transform: ArrayLike) -> 'SurfaceMatrix':
        """
        Return the surface in another frame (4.8).

        `transform` (4, 4) maps coordinates of the other frame to this one.
        """
        transform = np.asarray(transform, dtype=float)
        return SurfaceMatrix(transform.T @ self.matrix @ transform)

    def normalised(self) -> 'SurfaceMatrix':
        """Return the same surface, scaled so that its normal at the origin has length 1 (4.12)."""
        length = np.linalg.norm(2.0 * self.matrix[3, :3])
        if not length > 0.0:
            raise SurfaceError('surface has no normal at the origin')
        return SurfaceMatrix(self.matrix / length)

    def curvatures(self) -> tuple[np.ndarray, np.ndarray]:
        """
        Return the principal curvatures at the origin, the larger in magnitude first [1/m].

        Also returns the frame (3, 3): the two principal directions and the inward normal.
        Raises a SurfaceError if the normal is undefined: at the apex of a cone, the centre of a
        sphere.
        """
        matrix = self.normalised().matrix
        tangent = tangent_frame(2.0 * matrix[3, :3])
        along = tangent[:, :2]
        local = -2.0 * along.T @ matrix[:3, :3] @ along
        first, second, heading = principal_curvatures(local[0, 0], local[0, 1], local[1, 1])
        return np.array([first, second]), tangent @ turn_about_z(heading)
