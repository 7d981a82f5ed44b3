"""Least-squares fits of point and line loads to many frames (chapters 2 and 3)."""

from collections.abc import Sequence

import numpy as np

from tactile_common.errors import ConfigurationError
from tactile_common.kernels import njit
from tactile_sensing.contact.gauss_newton import FIT, fit_load, make_tactels, POINT
from tactile_sensing.contact.variable_projection import TUKEY
from tactile_sensing.half_space.layers import Layer, Sensor, sensor_of
from tactile_sensing.types.array import TactelArray


@njit(cache=True, error_model='numpy')
def _fit_frames(kind, stress, x, y, pitch_x, pitch_y, nodes, window, polynomials, closed, layers,
                forces, model_error, tukey, fits):
    """Fit every frame of stress (N, layers, rows, columns), see `fit_load`."""
    sensor = Sensor(x, y, pitch_x, pitch_y, nodes, window, polynomials, closed)
    most = stress.shape[1] * stress.shape[2] * stress.shape[3]
    if kind == POINT:
        side = int(2.0 * sensor.window) + 2
        most = stress.shape[1] * min(side, stress.shape[2]) * min(side, stress.shape[3])
    tactels, layers = make_tactels(most, sensor.nodes.size), layers.copy()
    for f in range(stress.shape[0]):
        fit = fits[f]
        if fit_load(kind, stress[f], sensor, layers, forces, model_error, tukey, 0.0, tactels,
                    fit):
            for i in range(5):
                for j in range(i):
                    fit.normal[j, i] = fit.normal[i, j]
        else:
            fit.vector[:] = np.nan
            fit.normal[:] = np.nan
            fit.squared_error = fit.chi_square = np.nan
            fit.last_step = np.inf


def fit_loads(kind: int, stress: np.ndarray, array: TactelArray, layers: Sequence[Layer], *,
              shear: bool = True, window: float | None = None, model_error: float = 0.07,
              robust: bool = False, tactel_points: int = 1) -> np.ndarray:
    """
    Fit one load to every frame by Gauss-Newton, in one compiled loop.

    A point's is the frictional load of chapter 2, (2.2) and (2.5), fitted to the tactels around
    the peak of any number of layers: model 1 is one 'zz' layer, model 2 two of them, model 3 a
    'zz' and an 'xz' layer; no sign of the shear needs to be known. A line's is (3.1) with shear
    across it, fitted to every tactel of the 'zz' layers.

    Parameters
    ----------
    kind : int
        ContactType.POINT or ContactType.LINE.
    stress : ndarray, shape (N, layers, rows, columns)
        Pressure of a 'zz' layer, -tau_xz and -tau_yz of the others [Pa]; tactels that are not
        finite have weight 0.
    array : TactelArray
    layers : sequence of Layer
        At least one 'zz'.
    shear : bool
        False fits the place and the normal force alone.
    window, tactel_points
        As for `layers.sensor_of`.
    model_error : float
        Allowance for what the model leaves out, as a fraction of the modelled stress.
    robust : bool
        With Tukey's biweights, for tactels that are wrong without a word.

    Returns
    -------
    ndarray of gauss_newton.FIT, shape (N,)
        The leading 5x5, 4x4 (line) or 3x3 (without shear) of `normal` is the Fisher information
        of (a, b, force, shear_x, shear_y), or of (rho, yaw, force, shear). Where the fit did not
        work, `converged` is false, the numbers are NaN and `last_step` is infinite.

    Raises
    ------
    ConfigurationError
        Wrong shape of stress, no 'zz' layer, or an option out of its range.
    """
    layers, stress = tuple(layers), np.ascontiguousarray(stress, dtype=np.float64)
    if stress.ndim != 4 or stress.shape[1:] != (len(layers), *array.shape):
        raise ConfigurationError(f'stress has the shape {stress.shape}, must be '
                                 f'(N, {len(layers)}, {array.rows}, {array.columns})')
    sensor, table = sensor_of(array, layers, tactel_points, window)
    forces = 1 + int(shear) * (2 if kind == POINT else 1)
    fits = np.zeros(len(stress), FIT)
    _fit_frames(int(kind), stress, *sensor, table, forces, float(model_error),
                TUKEY if robust else np.inf, fits)
    return fits
