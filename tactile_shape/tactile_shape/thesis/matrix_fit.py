"""The thesis' fit of ten surface parameters to points and normals (4.32 to 4.37)."""
from dataclasses import dataclass

import numpy as np

from tactile_shape.types.surface_matrix import PARAMETERS, SurfaceMatrix

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
    """
    Return A of (4.32) without the known c44: rows 3 i to 3 i + 2 give S y_i.

    The y_i are the homogeneous points of `points` (N, 3).
    """
    matrix = np.zeros((len(points), 3, 9))
    x, y, z = points.T
    for row, columns in enumerate(((0, 1, 2, 3), (1, 4, 5, 6), (2, 5, 7, 8))):
        for column, values in zip(columns, (x, y, z, 1.0), strict=True):
            matrix[:, row, column] = values
    return matrix.reshape(-1, 9)
