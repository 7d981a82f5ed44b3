"""The thesis' estimator: ten surface parameters from points and normals (4.32 to 4.37)."""
from collections import deque
from dataclasses import dataclass
from typing import Any

import numpy as np

from tactile_common.errors import SurfaceError
from tactile_shape.local_surface.local_quadric import LocalQuadricConfig
from tactile_shape.types.patch import (
    certain_enough,
    Kind,
    NORMAL_NOISE,
    Patch,
    PRIOR_CURVATURE,
    SurfaceEstimator,
)
from tactile_shape.types.surface_matrix import PARAMETERS, SurfaceMatrix
from tactile_shape.types.tangent import tangent_frame

_CURVATURE = [PARAMETERS.index(name) for name in ('c11', 'c12', 'c22')]
_NO_UNIT = [PARAMETERS.index(name) for name in ('c14', 'c24', 'c34')]
_KNOWN = PARAMETERS.index('c44')  # 0: the contact lies at the origin
SAME_POINT = 1e-12  # m; contacts nearer to each other than this count as one
PRECISION = 1e-12  # least singular value above rounding errors, as a share of the largest one


@dataclass(frozen=True, eq=False)
class MatrixFit:
    """Parameters in the current contact frame, and which of them the data determine."""

    parameters: np.ndarray  # (10,), as PARAMETERS; unseen directions are 0, and c44 by definition
    rank: int  # number of seen independent combinations of the other nine parameters
    unseen: np.ndarray  # (9 - rank, 10), combinations of length 1 that the contacts do not show
    unseen_names: tuple[str, ...]  # parameters in these combinations
    covariance: np.ndarray  # (10, 10), of the seen part, from residuals and `normal_noise`
    residual: float  # RMS of the normals' residuals [rad]

    @property
    def surface(self) -> SurfaceMatrix:
        """The matrix of the parameters; SurfaceError if not even a normal was seen."""
        return SurfaceMatrix.from_parameters(self.parameters)


def fit_matrix(points: np.ndarray, normals: np.ndarray, *, position_noise: float = 0.0,
               normal_noise: float = 0.0) -> MatrixFit:
    """
    Fit a surface matrix to points and normals by 2 L S X = n.

    The fit is exact for plane, cylinder and sphere. On any other quadric 2 L S X has not length 1
    away from the origin, so that unit normals leave a third-order error.

    Parameters
    ----------
    points, normals : ndarray, shape (N, 3)
        Contacts in the contact frame of the wanted surface: z inward, the origin is a contact.
    position_noise : float, optional
        Standard deviation of a coordinate [m]: directions in which the points spread less count as
        unseen.
    normal_noise : float, optional
        Standard deviation of a normal's component [rad].
    """
    # Lengths are in units of the spread, so that curvatures and normals are comparable.
    unit = max(np.abs(points).max(), SAME_POINT)
    matrix = design_matrix(points / unit)
    left, values, right = np.linalg.svd(matrix, full_matrices=True)
    # Smallest singular value above rounding errors and noise.
    floor = max(PRECISION * values[0], 2.0 * np.sqrt(len(points)) * position_noise / unit)
    rank = int(np.count_nonzero(values > floor))
    scale = np.full(10, 1.0 / unit)
    scale[_NO_UNIT] = 1.0
    scale[_KNOWN] = unit
    keep = right[:rank] / values[:rank, None]
    target = 0.5 * normals.reshape(-1)
    scaled = np.zeros(10)
    scaled[:_KNOWN] = keep.T @ (left[:, :rank].T @ target)
    rest = target - matrix @ scaled[:_KNOWN]
    spare = len(target) - rank
    variance = max(rest @ rest / spare if spare > 0 else 0.0, (0.5 * normal_noise)**2)
    covariance = np.zeros((10, 10))
    covariance[:_KNOWN, :_KNOWN] = variance * keep.T @ keep
    unseen = np.zeros((9 - rank, 10))
    unseen[:, :_KNOWN] = right[rank:]
    shares = np.any(np.abs(unseen) > 0.1, axis=0).tolist()
    return MatrixFit(
        scaled * scale, rank, unseen,
        tuple(name for name, share in zip(PARAMETERS, shares, strict=True) if share),
        covariance * np.outer(scale, scale), float(2.0 * np.sqrt(np.mean(rest**2))))


def design_matrix(points: np.ndarray) -> np.ndarray:
    """Return A of (4.32) without the known c44, three rows for each of the points (N, 3)."""
    matrix = np.zeros((len(points), 3, 9))
    x, y, z = points.T
    for row, columns in enumerate(((0, 1, 2, 3), (1, 4, 5, 6), (2, 5, 7, 8))):
        for column, values in zip(columns, (x, y, z, 1.0), strict=True):
            matrix[:, row, column] = values
    return matrix.reshape(-1, 9)


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
