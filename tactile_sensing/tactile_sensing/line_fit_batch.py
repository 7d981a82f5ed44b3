"""Fit of a line load to many tactile images in one compiled loop, see `line_fit`."""

from numba import njit
import numpy as np

from tactile_sensing.errors import ConfigurationError
from tactile_sensing.line_fit import _fit, LineFit, STEPS


@njit(cache=True)
def _fit_all(images, x, y, depth, noise, model_error, steps, out, information):
    for i in range(images.shape[0]):
        rho, yaw, force, normal, squared, chi, used, last = _fit(
            images[i], x, y, depth, noise, model_error, steps)
        out[i, 0], out[i, 1], out[i, 2] = rho, yaw, force
        out[i, 3], out[i, 4], out[i, 5], out[i, 6] = squared, chi, used, last
        information[i] = normal


def fit_lines(pressure, array, depth, noise_std, *, model_error=0.07, steps=STEPS):
    """
    Fit a line load to every frame of a batch as `line_fit.fit_line` does.

    Parameters
    ----------
    pressure : ndarray, shape (N, rows, columns)
        Pressure [Pa]; the other parameters as in `line_fit.fit_line`.

    Returns
    -------
    LineFit
        Of arrays of shape (N,) and (N, 3, 3).

    Raises
    ------
    ConfigurationError
        Wrong shape of pressure.
    """
    images = np.ascontiguousarray(pressure, dtype=np.float64)
    if images.ndim != 3 or images.shape[1:] != array.shape:
        raise ConfigurationError(
            f'pressure has the shape {images.shape}, must be (N, {array.rows}, {array.columns})')
    out = np.empty((len(images), 7))
    information = np.empty((len(images), 3, 3))
    _fit_all(images, array.x, array.y, float(depth), float(noise_std), float(model_error),
             int(steps), out, information)
    rho, yaw, force, squared, chi, used, last = out.T
    turns = np.where(np.isfinite(yaw), np.ceil(yaw / np.pi - 0.5), 0.0)
    sign = np.where(turns % 2, -1.0, 1.0)  # odd: the other normal of the same line
    flip = np.stack([sign, np.ones_like(sign), np.ones_like(sign)], axis=1)
    return LineFit(rho * sign, yaw - turns * np.pi, force,
                   information * flip[:, :, None] * flip[:, None, :], squared, chi,
                   used.astype(int), last)
