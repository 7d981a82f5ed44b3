"""Estimated surface at a contact, and the interface of surface estimators."""
from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from enum import IntEnum
from typing import Any

import numpy as np

from tactile_shape.types.surface_matrix import SurfaceMatrix


class Kind(IntEnum):
    """Simplest surface that explains the contacts; the numbers are those of SurfacePatch.msg."""

    NONE = 0
    PLANE = 1
    CYLINDER = 2
    SPHERE = 3
    GENERAL = 4


PRIOR_CURVATURE = 100.0  # 1/m, standard deviation of the prior
# A curvature counts as seen up to this standard deviation: 0.13 mm at the end of a patch of 20 mm
# [1/m]; or up to this share of itself.
MAX_CURVATURE_STD, RELATIVE = 2.5, 0.1
# Standard deviation of a normal's direction per axis: a robot that repeats to 0.02 mm turns a pad
# of 40 mm by as much [rad].
NORMAL_NOISE = 5e-4
_MAX_COORDINATE = 1e6  # m; a contact with a larger one is invalid
_LENGTH_ERROR = 1e-3  # largest difference of a usable normal's length from 1


def certain_enough(variance: np.ndarray, curvature: np.ndarray) -> np.ndarray:
    """Return which curvatures are seen, from their variances."""
    return variance < np.maximum(MAX_CURVATURE_STD, RELATIVE * np.abs(curvature))**2


def _nan(*shape: int) -> Any:
    return field(default_factory=lambda: np.full(shape, np.nan))


@dataclass(frozen=True, eq=False)
class Patch:
    """Second-order surface at the newest contact; SI units, in the frame of the positions."""

    kind: Kind
    valid: bool
    reason: str  # why it is invalid, one line; empty if valid
    method: str = ''  # 'local_quadric' or 'surface_matrix'
    # Contact frame: origin on the surface, x and y principal directions, z inward normal.
    frame: np.ndarray = _nan(4, 4)
    # Principal curvatures along x and y, the larger in magnitude first, positive if convex [1/m].
    curvature: np.ndarray = _nan(2)
    # True if the path determines the curvature; if not, its value comes from the prior.
    seen: np.ndarray = field(default_factory=lambda: np.zeros(2, bool))
    covariance: np.ndarray = _nan(2, 2)  # of the curvatures; the prior's for an unseen one
    extent: float = 0.0  # length of the path used [m]
    samples: int = 0  # contacts used
    residual: float = float('nan')  # RMS in standard deviations; NaN without redundancy
    matrix: np.ndarray | None = None  # S, if a method knows more than frame and curvature

    @property
    def origin(self) -> np.ndarray:
        """Contact point on the fitted surface, ndarray (3,) [m]."""
        return self.frame[:3, 3]

    @property
    def directions(self) -> np.ndarray:
        """Principal directions as rows, ndarray (2, 3)."""
        return self.frame[:3, :2].T

    @property
    def surface_matrix(self) -> np.ndarray:
        """S in the frame of the positions, ndarray (4, 4); NaN if there is no patch."""
        if self.matrix is not None:
            return self.matrix
        if not np.isfinite(self.curvature).all():
            return np.full((4, 4), np.nan)
        local = SurfaceMatrix.from_curvature(np.diag(self.curvature))
        return local.in_frame(np.linalg.inv(self.frame)).matrix

    def sheet(self, places: np.ndarray) -> np.ndarray:
        """
        Return points (N, 3) of the patch over places (N, 2) of its tangent plane [m].

        Their heights solve z (1 + n_z) / 2 = u' K u / 2 with n_xy = -K u: exact for plane, sphere
        and cylinder, however large the arc. They are NaN beyond the border, where the surface is
        perpendicular to the tangent plane.
        """
        slope = places * self.curvature
        with np.errstate(invalid='ignore'):
            upright = np.sqrt(1.0 - (slope**2).sum(axis=1))
        z = (slope * places).sum(axis=1) / (1.0 + upright)
        return self.origin + np.column_stack([places, z]) @ self.frame[:3, :3].T


class SurfaceEstimator(ABC):
    """
    Estimator of the surface at the newest contact of a path; time and memory are bounded.

    `reset` forgets the path after a loss of contact. `add` takes a contact (3,) [m] and the
    object's inward unit normal (3,), in the object's frame. `estimate` returns the Patch at the
    newest contact; invalid, with a reason, if it is unknown.
    """

    method: str

    @abstractmethod
    def reset(self) -> None: ...  # noqa: D102

    @abstractmethod
    def add(self, position: np.ndarray, normal: np.ndarray) -> None: ...  # noqa: D102

    @abstractmethod
    def estimate(self) -> Patch: ...  # noqa: D102

    def update(self, position: np.ndarray, normal: np.ndarray) -> Patch:
        """Add a contact and return the Patch there; it is invalid if the contact is unusable."""
        # NaN also fails these comparisons.
        length = np.sqrt(normal @ normal) if np.abs(normal).max() < 2.0 else 0.0
        if not (np.abs(position).max() < _MAX_COORDINATE and abs(length - 1.0) < _LENGTH_ERROR):
            return self.refused('contact is not finite or its normal not of length 1')
        self.add(position, normal / length)
        return self.estimate()

    def refused(self, reason: str, **known: Any) -> Patch:
        """Return an invalid Patch with its reason and the values that are known nevertheless."""
        return Patch(Kind.NONE, False, reason, self.method, **known)
