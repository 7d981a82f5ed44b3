"""
Second-order surfaces as symmetric 4 x 4 matrices (thesis, sections 4.3.1 and 4.3.2).

One convention throughout: X' S X = 0 with X = [x, y, z, 1]', z the object's *inward* unit normal
at the origin of a contact frame, and c34 = 1/2 there, so that the first three components of
2 S X are the inward normal, of unit length at the origin; for plane, sphere and cylinder they
are of unit length on the whole surface. Curvature is positive for a convex object. The thesis'
printed matrices of sphere and cylinder are these times -2 r; its plane is not symmetric.
"""
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from tactile_common.errors import SurfaceError
from tactile_shape.types.tangent import principal_axes, tangent_frame

# Order of the ten parameters (4.33): row and column of each in the matrix.
ROWS, COLUMNS = np.triu_indices(4)
PARAMETERS = tuple(
    f'c{row + 1}{column + 1}' for row, column in zip(ROWS, COLUMNS, strict=True))
_SYMMETRY = 1e-9  # largest relative difference of two halves that rounding explains
_BISECTIONS = 110  # until the interval of a multiplier is as narrow as its numbers allow
_NEARLY = 1.0 - 1e-10  # how near to the end of that interval


@dataclass(frozen=True, eq=False)
class SurfaceMatrix:
    """
    A second-order surface in some frame.

    Raises
    ------
    SurfaceError
        Not 4 x 4, not finite, not symmetric, or without any term in x, y or z.
    """

    matrix: np.ndarray  # S of X' S X = 0; lengths in m

    def __post_init__(self) -> None:
        matrix = np.array(self.matrix, dtype=float)
        if matrix.shape != (4, 4):
            raise SurfaceError(f'surface matrix has shape {matrix.shape}, must be (4, 4)')
        if not np.isfinite(matrix).all():
            raise SurfaceError('surface matrix: a number is not finite')
        off = np.abs(matrix - matrix.T).max()
        if off > _SYMMETRY * np.abs(matrix).max():
            raise SurfaceError(
                f'surface matrix is not symmetric: entries differ by {off:.3g}; use half of '
                'each coefficient on both sides of the diagonal')
        if not np.abs(matrix[:3]).max() > 0.0:
            raise SurfaceError('surface matrix is degenerate: it has no term in x, y or z')
        object.__setattr__(self, 'matrix', 0.5 * (matrix + matrix.T))

    @classmethod
    def from_curvature(cls, curvature: ArrayLike) -> 'SurfaceMatrix':
        """
        Quadric of z = u' K u / 2 + ... in its contact frame, K (2, 2) symmetric [1/m].

        Its coefficient of z^2 is half the larger curvature, which is exact for plane, sphere and
        cylinder, and keeps the quadric near the reduced form of `height` otherwise.
        """
        curvature = np.array(curvature, dtype=float)
        if curvature.shape != (2, 2):
            raise SurfaceError(f'curvature has shape {curvature.shape}, must be (2, 2)')
        matrix = np.zeros((4, 4))
        matrix[:2, :2] = -0.5 * curvature
        matrix[2, 3] = matrix[3, 2] = 0.5
        if np.isfinite(curvature).all():
            principal = np.linalg.eigvalsh(0.5 * (curvature + curvature.T))
            matrix[2, 2] = -0.5 * principal[np.argmax(np.abs(principal))]
        else:
            matrix[0, 0] = np.nan  # refused with the others by the constructor
        return cls(matrix)

    @classmethod
    def from_parameters(cls, parameters: ArrayLike) -> 'SurfaceMatrix':
        """Surface of the ten parameters in the order of `PARAMETERS` (4.33)."""
        matrix = np.zeros((4, 4))
        matrix[ROWS, COLUMNS] = matrix[COLUMNS, ROWS] = np.asarray(parameters, dtype=float)
        return cls(matrix)

    def in_frame(self, transform: ArrayLike) -> 'SurfaceMatrix':
        """Return the surface in another frame, by the transform (4, 4) from that to this (4.8)."""
        transform = np.asarray(transform, dtype=float)
        if transform.shape != (4, 4) or not np.isfinite(transform).all():
            raise SurfaceError('transform: must be 4 x 4 and finite')
        return SurfaceMatrix(transform.T @ self.matrix @ transform)

    def normalised(self, point: ArrayLike = (0.0, 0.0, 0.0)) -> 'SurfaceMatrix':
        """Return the same surface scaled so that the normal at a point has length 1."""
        length = np.linalg.norm(self.gradient(np.asarray(point, dtype=float)))
        if not length > 0.0:
            raise SurfaceError(f'surface has no normal at {np.asarray(point).tolist()}')
        return SurfaceMatrix(self.matrix / length)

    def value(self, points: ArrayLike) -> np.ndarray:
        """X' S X at points (..., 3): 0 on the surface, positive inside the object."""
        x = _homogeneous(points)
        return np.einsum('...i,ij,...j', x, self.matrix, x)

    def gradient(self, points: ArrayLike) -> np.ndarray:
        """Normal 2 L S X (4.12) at points (..., 3), not scaled to length 1."""
        return 2.0 * _homogeneous(points) @ self.matrix[:, :3]

    def normal(self, points: ArrayLike) -> np.ndarray:
        """
        Inward unit normal at points (..., 3).

        SurfaceError where there is none: the apex of a cone, the centre of a sphere.
        """
        gradient = self.gradient(points)
        length = np.linalg.norm(gradient, axis=-1, keepdims=True)
        if not (length > 0.0).all():
            raise SurfaceError('surface has no normal at one of the points')
        return gradient / length

    def curvatures(self, point: ArrayLike = (0.0, 0.0, 0.0)) -> tuple[np.ndarray, np.ndarray]:
        """
        Principal curvatures at a point of the surface, the larger in magnitude first [1/m].

        Also returns the frame (3, 3): the two principal directions and the inward normal.
        SurfaceError where there is no normal.
        """
        point = np.asarray(point, dtype=float)
        tangent = tangent_frame(self.normal(point))
        along = tangent[:, :2]
        steepness = np.linalg.norm(self.gradient(point))
        local = -2.0 / steepness * along.T @ self.matrix[:3, :3] @ along
        curvature, turn = principal_axes(local)
        return curvature, tangent @ turn

    def distance(self, points: ArrayLike) -> np.ndarray:
        """
        Signed Euclidean distance of points (..., 3) from the surface [m], positive outside.

        The nearest point x solves (I + m A) x = p - m b for A = S[:3, :3], b = S[:3, 3] with the
        one multiplier m that keeps I + m A positive definite and X' S X = 0; there X' S X falls
        as m grows, so that bisection finds it.
        """
        points = np.asarray(points, dtype=float)
        bends, axes = np.linalg.eigh(self.matrix[:3, :3])
        offset = self.matrix[:3, 3] @ axes
        flat = points.reshape(-1, 3) @ axes
        # A surface that is flat one way has no end there: far beyond any foot instead.
        far = 1e6 * (1.0 + np.abs(flat).max(initial=0.0)) / np.abs(self.matrix[:3]).max()
        ends = [-_NEARLY / bends[2] if bends[2] * far > 1.0 else -far,
                -_NEARLY / bends[0] if -bends[0] * far > 1.0 else far]
        low, high = np.full(len(flat), ends[0]), np.full(len(flat), ends[1])

        def foot_of(multiplier: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            foot = (flat - multiplier[:, None] * offset) / (1.0 + multiplier[:, None] * bends)
            return foot, foot**2 @ bends + 2.0 * foot @ offset + self.matrix[3, 3]

        for _ in range(_BISECTIONS):
            middle = 0.5 * (low + high)
            _, rest = foot_of(middle)
            inside = rest > 0.0
            low, high = np.where(inside, middle, low), np.where(inside, high, middle)
        foot, rest = foot_of(0.5 * (low + high))
        square = ((foot - flat)**2).sum(axis=-1)
        # At a centre of symmetry the multiplier runs into an end: all of a circle is as near.
        for stuck, bend in ((low == ends[0], bends[2]), (high == ends[1], bends[0])):
            if bend != 0.0:
                square += np.where(stuck, np.maximum(0.0, -rest / bend), 0.0)
        outside = self.value(points).reshape(-1) < 0.0
        return (np.where(outside, 1.0, -1.0) * np.sqrt(square)).reshape(points.shape[:-1])


def _homogeneous(points: ArrayLike) -> np.ndarray:
    points = np.asarray(points, dtype=float)
    return np.concatenate([points, np.ones((*points.shape[:-1], 1))], axis=-1)
