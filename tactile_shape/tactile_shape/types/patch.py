"""What an estimator says about the surface at a contact."""
from dataclasses import dataclass, field
from enum import IntEnum
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from tactile_shape.types.surface_matrix import SurfaceMatrix
from tactile_shape.types.tangent import height


class Kind(IntEnum):
    """Least surface that explains the contacts; the numbers of SurfacePatch.msg."""

    NONE = 0
    PLANE = 1
    CYLINDER = 2
    SPHERE = 3
    GENERAL = 4


RELATIVE = 0.1  # uncertainty with which a curvature still counts as seen
_FAR = 1e6  # m; no contact is there
_LENGTH = 1e-3  # largest difference of a normal's length from 1


def usable_normal(position: np.ndarray, normal: np.ndarray) -> np.ndarray | None:
    """Normal scaled to length 1; None if a contact is not finite or the length far from it."""
    # NaN fails these comparisons as well.
    if not (np.abs(position).max() < _FAR and np.abs(normal).max() < 2.0):
        return None
    length = np.sqrt(normal @ normal)
    return normal / length if abs(length - 1.0) < _LENGTH else None


def certain_enough(variance: np.ndarray, curvature: np.ndarray, std: float) -> np.ndarray:
    """Whether variances are below those of a standard deviation, or of a tenth of the value."""
    return variance < np.maximum(std, RELATIVE * np.abs(curvature))**2


def _nan(*shape: int) -> Any:
    return field(default_factory=lambda: np.full(shape, np.nan))


@dataclass(frozen=True, eq=False)
class Patch:
    """
    Second-order surface at the newest contact; SI, in the frame of the positions given.

    Attributes
    ----------
    kind : Kind
    valid : bool
    reason : str
        Why not valid, one line; empty if valid.
    method : str
        'local_quadric' or 'surface_matrix'.
    frame : ndarray, shape (4, 4)
        Contact frame: origin on the surface, x and y principal directions, z the inward normal.
    curvature : ndarray, shape (2,)
        Principal curvatures along x and y [1/m], the larger in magnitude first, positive for a
        convex object.
    seen : ndarray of bool, shape (2,)
        Whether the path could see each; where false the value is a prior, not a measurement.
    covariance : ndarray, shape (2, 2)
        Of the curvatures [1/m^2]; of an unseen one, the prior's.
    extent : float
        Length of the path that was used [m].
    samples : int
        Contacts used.
    residual : float
        RMS of the residuals in standard deviations; NaN where none is left over.
    matrix : ndarray, shape (4, 4), optional
        Surface matrix, of a method that has more of it than frame and curvature tell.
    """

    kind: Kind
    valid: bool
    reason: str
    method: str
    frame: np.ndarray = _nan(4, 4)
    curvature: np.ndarray = _nan(2)
    seen: np.ndarray = field(default_factory=lambda: np.zeros(2, bool))
    covariance: np.ndarray = _nan(2, 2)
    extent: float = 0.0
    samples: int = 0
    residual: float = float('nan')
    matrix: np.ndarray | None = None

    @property
    def origin(self) -> np.ndarray:
        """Contact on the fitted surface, ndarray (3,) [m]."""
        return self.frame[:3, 3]

    @property
    def directions(self) -> np.ndarray:
        """Principal directions, a row each, ndarray (2, 3)."""
        return self.frame[:3, :2].T

    @property
    def surface_matrix(self) -> np.ndarray:
        """S in the frame of the positions, ndarray (4, 4); NaN where there is no patch."""
        if self.matrix is not None:
            return self.matrix
        if not np.isfinite(self.curvature).all():
            return np.full((4, 4), np.nan)
        local = SurfaceMatrix.from_curvature(np.diag(self.curvature))
        rotation, origin = self.frame[:3, :3], self.origin
        back = np.eye(4)
        back[:3, :3], back[:3, 3] = rotation.T, -rotation.T @ origin
        return local.in_frame(back).matrix

    def sheet(self, length: float, width: float, direction: ArrayLike | None = None,
              steps: tuple[int, int] = (21, 5)) -> np.ndarray:
        """
        Points of the patch over a rectangle of its tangent plane.

        Parameters
        ----------
        length, width : float
            Sides of the rectangle, the contact in its middle [m].
        direction : array_like, shape (3,), optional
            Of the length, as near as the tangent plane allows; x of the frame if missing.
        steps : (int, int), optional
            Points along the two sides.

        Returns
        -------
        ndarray, shape (*steps, 3)
            NaN where the surface would have turned upright.
        """
        axes = self.frame[:3, :3]
        x, y = (1.0, 0.0) if direction is None else np.asarray(direction) @ axes[:, :2]
        turn = np.array([[x, y], [-y, x]]) / np.hypot(x, y)
        along, across = (0.5 * side * np.linspace(-1.0, 1.0, count)
                         for side, count in zip((length, width), steps, strict=True))
        u = np.stack(np.meshgrid(along, across, indexing='ij'), axis=-1) @ turn
        z = height(np.diag(self.curvature), u)
        return self.origin + u @ axes[:, :2].T + z[..., None] * axes[:, 2]


def refusal(reason: str, method: str = '', **known) -> Patch:
    """Patch that is not valid, and why, with what is known all the same."""
    return Patch(Kind.NONE, False, reason, method, **known)
