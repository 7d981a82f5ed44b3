"""What an estimator says about the surface at a contact."""
from dataclasses import dataclass, field
from enum import IntEnum

import numpy as np

from tactile_shape.surface_matrix import SurfaceMatrix


class Kind(IntEnum):
    """Least surface that explains the contacts; the numbers of SurfacePatch.msg."""

    NONE = 0
    PLANE = 1
    CYLINDER = 2
    SPHERE = 3
    GENERAL = 4


def _nan(*shape):
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

    @property
    def surface_matrix(self):
        """S in the frame of the positions, ndarray (4, 4); NaN where there is no patch."""
        if not np.isfinite(self.curvature).all():
            return np.full((4, 4), np.nan)
        local = SurfaceMatrix.from_curvature(np.diag(self.curvature))
        rotation, origin = self.frame[:3, :3], self.frame[:3, 3]
        back = np.eye(4)
        back[:3, :3], back[:3, 3] = rotation.T, -rotation.T @ origin
        return local.in_frame(back).matrix
