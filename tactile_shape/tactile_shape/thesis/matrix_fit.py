"""The thesis' estimator: ten surface parameters from points and normals (4.32 to 4.37)."""
from dataclasses import dataclass

import numpy as np

from tactile_common.errors import SurfaceError
from tactile_shape.types.surface_matrix import PARAMETERS, SurfaceMatrix

_NO_UNIT = [PARAMETERS.index(name) for name in ('c14', 'c24', 'c34')]
_KNOWN = PARAMETERS.index('c44')  # 0: the contact lies at the origin


@dataclass(frozen=True, eq=False)
class MatrixFit:
    """Surface matrix in the current contact frame, and what of it the data saw."""

    surface: SurfaceMatrix | None  # None where not even a normal was seen; unseen directions are 0
    parameters: np.ndarray  # (10,), as PARAMETERS; c44 is 0 by definition of the frame
    rank: int  # independent combinations seen of the nine other parameters
    unseen: np.ndarray  # (9 - rank, 10), combinations, of length 1, that the contacts cannot see
    unseen_names: tuple[str, ...]  # parameters with a share in these
    covariance: np.ndarray  # (10, 10), of what was seen, from residuals, else `normal_noise`
    residual: float  # RMS of the normals' residuals [rad]


def fit_matrix(points: np.ndarray, normals: np.ndarray, *, position_noise: float = 0.0,
               normal_noise: float = 0.0) -> MatrixFit:
    """
    Fit a surface matrix to points and normals by 2 L S X = n.

    Exact for plane, cylinder and sphere. On any other quadric 2 L S X is not of length 1 away
    from the origin, so that unit normals leave an error of third order.

    Parameters
    ----------
    points, normals : ndarray, shape (N, 3)
        In the contact frame of which the surface is wanted: z inward, the origin a contact.
    position_noise : float, optional
        Standard deviation of a coordinate [m]: directions that the points' spread shows no
        clearer than that are not seen.
    normal_noise : float, optional
        Standard deviation of a normal's component [rad].
    """
    # Lengths in units of the spread: else curvatures and normals are not to be compared.
    unit = max(np.abs(points).max(), 1e-12)
    matrix = design_matrix(points / unit)
    left, values, right = np.linalg.svd(matrix, full_matrices=True)
    # What rounding, or noise, leaves of a singular value.
    floor = max(1e-12 * values[0], 2.0 * np.sqrt(len(points)) * position_noise / unit)
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
    try:
        surface = SurfaceMatrix.from_parameters(scaled * scale)
    except SurfaceError:
        surface = None
    return MatrixFit(
        surface, scaled * scale, rank, unseen,
        tuple(name for name, share in zip(PARAMETERS, shares, strict=True) if share),
        covariance * np.outer(scale, scale), float(2.0 * np.sqrt(np.mean(rest**2))))


def design_matrix(points: np.ndarray) -> np.ndarray:
    """A of (4.32) without the known c44: rows 3 i to 3 i + 2 give S y_i, y_i of points (N, 3)."""
    matrix = np.zeros((len(points), 3, 9))
    x, y, z = points.T
    for row, columns in enumerate(((0, 1, 2, 3), (1, 4, 5, 6), (2, 5, 7, 8))):
        for column, values in zip(columns, (x, y, z, 1.0), strict=True):
            matrix[:, row, column] = values
    return matrix.reshape(-1, 9)
