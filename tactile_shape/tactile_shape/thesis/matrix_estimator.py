"""The thesis' estimator for a stream of contacts: ten parameters from the last few of them."""
from collections import deque
from typing import Any

import numpy as np

from tactile_common.errors import SurfaceError
from tactile_shape.local_surface.local_quadric import LocalQuadricConfig
from tactile_shape.thesis.matrix_fit import fit_matrix, MatrixFit
from tactile_shape.types.patch import (
    certain_enough,
    Kind,
    NORMAL_NOISE,
    Patch,
    PRIOR_CURVATURE,
    SurfaceEstimator,
)
from tactile_shape.types.surface_matrix import PARAMETERS
from tactile_shape.types.tangent import tangent_frame

_CURVATURE = [PARAMETERS.index(name) for name in ('c11', 'c12', 'c22')]


class MatrixEstimator(SurfaceEstimator):
    """
    Estimates the surface matrix at each new contact of a path.

    The fit uses some contacts, at least 4, spread over a window; the thesis uses 5.
    """

    method = 'surface_matrix'

    def __init__(self, config: LocalQuadricConfig | None = None, contacts: int = 6):
        self.config = config or LocalQuadricConfig()
        self._spacing = self.config.window / (contacts - 1)
        self._kept: deque[np.ndarray] = deque(maxlen=contacts)  # position and normal, (6,)
        self.reset()

    def reset(self) -> None:  # noqa: D102
        self._kept.clear()
        self._newest: np.ndarray | None = None

    def add(self, position: np.ndarray, normal: np.ndarray) -> None:  # noqa: D102
        self._newest = np.concatenate([position, normal])
        if not self._kept or (
                np.linalg.norm(position - self._kept[-1][:3]) >= self._spacing):
            self._kept.append(self._newest)

    def estimate(self) -> Patch:
        """Return the patch at the newest contact; invalid if any parameter is unseen."""
        if self._newest is None:
            return self.refused('no contact yet')
        contacts = list(self._kept)
        if contacts[-1] is not self._newest:
            contacts = [*contacts[1 - (self._kept.maxlen or 0):], self._newest]
        positions, normals = np.split(np.array(contacts), 2, axis=1)
        axes, origin = tangent_frame(normals[-1]), positions[-1]
        frame = np.eye(4)
        frame[:3, :3], frame[:3, 3] = axes, origin
        fit = fit_matrix(
            (positions - origin) @ axes, normals @ axes,
            position_noise=self.config.position_noise, normal_noise=NORMAL_NOISE)
        steps = np.linalg.norm(np.diff(positions, axis=0), axis=1)
        known: dict[str, Any] = {'extent': float(steps.sum()), 'samples': len(contacts),
                                 'residual': fit.residual / NORMAL_NOISE}
        try:
            local = fit.surface.normalised()
            curvature, directions = local.curvatures()
        except SurfaceError:
            return self.refused('the fitted surface has no normal at the contact', **known)
        pose = frame.copy()
        pose[:3, :3] = axes @ directions
        covariance, seen = _certainty(fit, directions)
        seen &= certain_enough(np.diag(covariance), curvature)
        back = np.linalg.inv(frame)
        known |= {'frame': pose, 'curvature': curvature, 'covariance': covariance, 'seen': seen,
                  'matrix': local.in_frame(back).matrix}
        if fit.rank < 9:
            # With noise, missing parameters bias all others, so none may be used.
            return self.refused(
                f'{len(contacts)} contacts see {fit.rank} of 9 parameters, not all of '
                + ', '.join(fit.unseen_names), **known)
        if not seen.all():
            return self.refused('the contacts are too near to each other, or too noisy, to show '
                                'curvature', **known)
        return Patch(Kind.GENERAL, True, '', self.method, **known)


def _certainty(fit: MatrixFit, directions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the covariance of the principal curvatures, and which of them are seen."""
    gradient = np.zeros((2, 10))
    for row, (x, y, _) in zip(gradient, directions.T[:2], strict=True):
        row[_CURVATURE] = -2.0 * np.array([x * x, 2.0 * x * y, y * y])
    blind = np.linalg.norm(gradient @ fit.unseen.T, axis=1)
    covariance = gradient @ fit.covariance @ gradient.T
    return covariance + np.diag(blind * 0.5 * PRIOR_CURVATURE)**2, blind < 0.1
