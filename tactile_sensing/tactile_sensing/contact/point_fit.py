"""Least-squares fit of a frictional point load to tactile images (chapter 2)."""

from dataclasses import dataclass

import numpy as np

from tactile_common.errors import ConfigurationError
from tactile_sensing.contact.gauss_newton import fit_loads, POINT
from tactile_sensing.contact.variable_projection import SINGULAR


@dataclass(frozen=True)
class PointFit:
    """
    Fitted point load; of a batch, every attribute has a leading axis of N.

    Where the fit did not work, `converged` is false and, unless a fit was reached that
    merely still moved, the parameters are NaN and `last_step` is infinite.

    Attributes
    ----------
    a, b : float
        Point of contact [m].
    normal_force, shear_force_x, shear_force_y : float
        P, Qx and Qy, as the object exerts them on the skin [N].
    information : ndarray, shape (5, 5), or (3, 3) without shear
        Fisher information of the parameters in this order.
    squared_error : float
        Sum of (residual / noise)^2.
    chi_square : float
        Sum of residual^2 / (noise^2 + (model_error * model)^2).
    used : int
        Tactels used, all layers together.
    last_step : float
        Movement of the point in the last step [m].
    iterations : int
        Steps done.
    converged : bool
        Positive force, point within the window and a last step that leaves nothing to find.
    """

    a: float
    b: float
    normal_force: float
    shear_force_x: float
    shear_force_y: float
    information: np.ndarray
    squared_error: float
    chi_square: float
    used: int
    last_step: float
    iterations: int
    converged: bool

    @property
    def covariance(self):
        """Inverse of the information; NaN where the fit did not work or has none."""
        scale = 1.0 / np.sqrt(np.diagonal(self.information, axis1=-2, axis2=-1))
        outer = scale[..., :, None] * scale[..., None, :]
        unit = self.information * outer
        bad = ~np.isfinite(unit).all(axis=(-2, -1), keepdims=True)
        # Singular to rounding counts as none; of a unit diagonal the determinant tells.
        bad |= ~(np.linalg.det(np.where(bad, 0.0, unit)) > SINGULAR**2)[..., None, None]
        inverse = np.linalg.inv(np.where(bad, np.eye(unit.shape[-1]), unit))
        return np.where(bad, np.nan, inverse * outer)


def fit_point(stress, array, layers, *, shear=True, window=None, model_error=0.07,
              robust=False, tactel_points=1):
    """
    Fit a frictional point load to the tactels around the peak by Gauss-Newton.

    The models of chapter 2, equations (2.2) and (2.5), with any number of layers: model 1 is
    one 'zz' layer, model 2 two of them, model 3 a 'zz' and an 'xz' layer. No sign of the
    shear needs to be known.

    Parameters
    ----------
    stress : ndarray, shape (layers, rows, columns)
        Pressure of a 'zz' layer, -tau_xz and -tau_yz of the others [Pa]; tactels that are not
        finite have weight 0.
    array : TactelArray
        Geometry of the tactels.
    layers : sequence of Layer
        What each layer measures; at least one 'zz'.
    shear : bool
        False fits (a, b, P) alone, with Qx = Qy = 0.
    window : float, optional
        Half side of the square of tactels used, centred on the peak [pitches]; by default
        4.5, or 1.9 mean depths of the layers where that is more.
    model_error : float
        Allowance for what the model leaves out, as a fraction of the modelled stress.
    robust : bool
        With Tukey's biweights, for tactels that are wrong without a word.
    tactel_points : int
        1: tactels sample a point; 2 or 3: they average over their area, by so many Gauss
        points along each side.

    Returns
    -------
    PointFit

    Raises
    ------
    ConfigurationError
        Wrong shape of stress, no 'zz' layer, or an option out of its range.
    """
    stress = np.ascontiguousarray(stress, dtype=np.float64)[None]
    theta, information, out = fit_loads(
        POINT, stress, array, layers, shear=shear, window=window, model_error=model_error,
        robust=robust, tactel_points=tactel_points)
    squared, chi, used, last_step, iterations, converged = out[0].tolist()
    return PointFit(*theta[0].tolist(), information[0], squared, chi, int(used), last_step,
                    int(iterations), converged > 0.0)


def fit_points(stress, array, layers, **options):
    """
    Fit every frame of a batch as `fit_point` does, in one compiled loop.

    Parameters
    ----------
    stress : ndarray, shape (N, layers, rows, columns)
        As in `fit_point`, and so are the other parameters.

    Returns
    -------
    PointFit
        Of arrays of shape (N,) and (N, 5, 5) or (N, 3, 3).

    Raises
    ------
    ConfigurationError
        As `fit_point`.
    """
    stress = np.ascontiguousarray(stress, dtype=np.float64)
    if stress.ndim != 4:
        raise ConfigurationError(f'stress has {stress.ndim} dimensions, must have 4')
    theta, information, out = fit_loads(
        POINT, stress, array, layers, **{'shear': True, **options})
    return PointFit(*theta.T, information, out[:, 0], out[:, 1], out[:, 2].astype(int), out[:, 3],
                    out[:, 4].astype(int), out[:, 5] > 0.0)
