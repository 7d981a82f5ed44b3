"""What an estimator says about the surface at a contact."""
from abc import ABC, abstractmethod
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


PRIOR_CURVATURE = 100.0  # 1/m, standard deviation before anything is touched


def usable_normal(position: np.ndarray, normal: np.ndarray) -> np.ndarray | None:
    """Normal scaled to length 1; None if a contact is not finite or the length far from it."""
    # NaN fails these comparisons as well.
    if not (np.abs(position).max() < 1e6 and np.abs(normal).max() < 2.0):
        return None
    length = np.sqrt(normal @ normal)
    return normal / length if abs(length - 1.0) < 1e-3 else None


def certain_enough(variance: np.ndarray, curvature: np.ndarray, std: float) -> np.ndarray:
    """Whether variances are below those of a standard deviation, or of a tenth of the value."""
    return variance < np.maximum(std, 0.1 * np.abs(curvature))**2


def _nan(*shape: int) -> Any:
    return field(default_factory=lambda: np.full(shape, np.nan))


@dataclass(frozen=True, eq=False)
class Patch:
    """Second-order surface at the newest contact; SI, in the frame of the positions given."""

    kind: Kind
    valid: bool
    reason: str  # why not valid, one line; empty if valid
    method: str  # 'local_quadric' or 'surface_matrix'
    # Contact frame: origin on the surface, x and y principal directions, z the inward normal.
    frame: np.ndarray = _nan(4, 4)
    # Principal curvatures along x and y, the larger in magnitude first, positive if convex [1/m].
    curvature: np.ndarray = _nan(2)
    # Whether the path could see each; where not, the value is a prior, not a measurement.
    seen: np.ndarray = field(default_factory=lambda: np.zeros(2, bool))
    covariance: np.ndarray = _nan(2, 2)  # of the curvatures; of an unseen one, the prior's
    extent: float = 0.0  # length of the path that was used [m]
    samples: int = 0  # contacts used
    residual: float = float('nan')  # RMS in standard deviations; NaN where none is left over
    matrix: np.ndarray | None = None  # S, of a method that has more than frame and curvature tell

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
        Points (M, N, 3) of the patch over a rectangle of its tangent plane about the contact.

        The length [m] goes along a direction (3,), as near as the tangent plane allows, else
        along x; `steps` is (M, N). NaN where the surface would have turned upright.
        """
        axes = self.frame[:3, :3]
        x, y = (1.0, 0.0) if direction is None else np.asarray(direction) @ axes[:, :2]
        turn = np.array([[x, y], [-y, x]]) / np.hypot(x, y)
        along, across = (0.5 * side * np.linspace(-1.0, 1.0, count)
                         for side, count in zip((length, width), steps, strict=True))
        u = np.stack(np.meshgrid(along, across, indexing='ij'), axis=-1) @ turn
        z = height(np.diag(self.curvature), u)
        return self.origin + u @ axes[:, :2].T + z[..., None] * axes[:, 2]


def refusal(reason: str, method: str = '', **known: Any) -> Patch:
    """Patch that is not valid, and why, with what is known all the same."""
    return Patch(Kind.NONE, False, reason, method, **known)


class SurfaceEstimator(ABC):
    """Surface at the newest of the contacts of a path; time and memory do not grow."""

    method: str

    @abstractmethod
    def reset(self) -> None:
        """Forget the path: contact was lost."""

    @abstractmethod
    def add(self, position: np.ndarray, normal: np.ndarray) -> bool:
        """
        Add a contact (3,) [m] with the object's inward unit normal (3,), both at rest with it.

        False, and it is left out, if it is not finite or the normal's length not 1.
        """

    @abstractmethod
    def estimate(self) -> Patch:
        """Patch at the newest contact; what cannot be estimated is not valid, with its reason."""

    def update(self, position: np.ndarray, normal: np.ndarray) -> Patch:
        """Add a contact and return the Patch there; of an unusable contact, one not valid."""
        if self.add(position, normal):
            return self.estimate()
        return self.refused('contact is not finite or its normal not of length 1')

    def refused(self, reason: str, **known: Any) -> Patch:
        """Patch of this method that is not valid, as `refusal`."""
        return refusal(reason, self.method, **known)
