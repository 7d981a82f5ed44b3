"""Least-squares fit of a line load to tactile images (chapter 3)."""

from dataclasses import dataclass

import numpy as np

from tactile_common.errors import ConfigurationError
from tactile_sensing.contact.gauss_newton import fit_loads, LINE
from tactile_sensing.half_space.layers import Layer


@dataclass(frozen=True)
class LineFit:
    """
    Fitted line load; of a batch, every attribute has a leading axis of N.

    Where the fit did not work, the parameters are NaN and `converged` is false.

    Attributes
    ----------
    rho, yaw, line_force, line_shear : float
        Normal form of the line [m, rad], force and shear across it per length [N/m], see
        `line.stress_with_shear`. Yaw is in (-pi/2, pi/2].
    information : ndarray, shape (4, 4), or (3, 3) without shear
        Fisher information of the parameters in this order.
    squared_error : float
        Sum of (residual / noise)^2.
    chi_square : float
        Sum of residual^2 / (noise^2 + (model_error * model)^2).
    used : int
        Tactels used.
    last_step : float
        Movement of the line at the pad's border in the last step [m].
    iterations : int
        Steps done.
    converged : bool
        Positive force and a last step that leaves nothing to find.
    """

    rho: float
    yaw: float
    line_force: float
    line_shear: float
    information: np.ndarray
    squared_error: float
    chi_square: float
    used: int
    last_step: float
    iterations: int
    converged: bool


def fit_line(pressure, array, depth, noise_std, **options):
    """
    Fit a line load to every valid tactel by Gauss-Newton.

    Parameters
    ----------
    pressure : ndarray, shape (rows, columns)
        Pressure [Pa]; tactels that are not finite have weight 0.
    array : TactelArray
        Geometry of the tactels.
    depth : float
        Depth of the tactels [m].
    noise_std : float
        Standard deviation of one tactel [Pa].
    shear : bool
        Whether to fit the shear across the line; by default it is 0.
    model_error, robust, tactel_points
        As in `point_fit.fit_point`.

    Returns
    -------
    LineFit

    Raises
    ------
    ConfigurationError
        Wrong shape of pressure, or a number out of its range.
    """
    theta, information, out = _fit(np.asarray(pressure)[None], array, depth, noise_std, options)
    squared, chi, used, last_step, iterations, converged = out[0].tolist()
    return LineFit(*theta[0, :4].tolist(), information[0], squared, chi, int(used), last_step,
                   int(iterations), converged > 0.0)


def fit_lines(pressure, array, depth, noise_std, **options):
    """
    Fit every frame of a batch as `fit_line` does, in one compiled loop.

    Parameters
    ----------
    pressure : ndarray, shape (N, rows, columns)
        As in `fit_line`, and so are the other parameters.

    Returns
    -------
    LineFit
        Of arrays of shape (N,) and (N, 3, 3) or (N, 4, 4).

    Raises
    ------
    ConfigurationError
        As `fit_line`.
    """
    theta, information, out = _fit(np.asarray(pressure), array, depth, noise_std, options)
    return LineFit(*theta[:, :4].T, information, out[:, 0], out[:, 1], out[:, 2].astype(int),
                   out[:, 3], out[:, 4].astype(int), out[:, 5] > 0.0)


def _fit(pressure, array, depth, noise_std, options):
    if pressure.ndim != 3:
        raise ConfigurationError(f'pressure has the shape {pressure.shape[1:]} per frame, '
                                 'must be rows and columns')
    stress = np.ascontiguousarray(pressure, dtype=np.float64)[:, None]
    return fit_loads(LINE, stress, array, (Layer('zz', depth, noise_std),),
                     **{'shear': False, **options})
