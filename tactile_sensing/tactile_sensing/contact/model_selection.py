"""Which model explains a frame, and whether it needs shear; all compiled."""

import numpy as np

from tactile_common.kernels import njit
from tactile_sensing.contact.extended_fit import fit_extended
from tactile_sensing.contact.gauss_newton import fit_load, LINE, PARAMETERS, POINT
from tactile_sensing.contact.initial_guess import peak
from tactile_sensing.contact.parameters import copy_record, invert
from tactile_sensing.half_space.kernels import SHEAR_X, SHEAR_Y
from tactile_sensing.types.contact import Reason

# Chi-square that shear must reach: two for each force (Akaike) is the least expected error
# where shear is usual; a line is located three times better without, so there it must be plain.
POINT_SHEAR_EVIDENCE, LINE_SHEAR_EVIDENCE = 4.0, 20.0
LINE_LENGTH = 1.0  # standard deviation along the ridge [depths] that makes a line the first guess
CONTRADICTION = 1.5  # dB above min_snr that a second model needs to overrule a weak first

_LOW_SNR = int(Reason.LOW_SNR)
UNCONVINCING = int(Reason.BAD_FIT | Reason.LOW_SNR)


@njit(error_model='numpy')
def _ridge_shape(image, x, y, level):
    """Spread [m^2] and elongation, see `Moments`, of the tactels at or above a level."""
    m = mx = my = mxx = myy = mxy = 0.0
    for r in range(image.shape[0]):
        for c in range(image.shape[1]):
            value = image[r, c]
            if value >= level:  # false for NaN
                value = min(value, 2.0 * level)  # a stuck tactel counts as the peak
                m += value
                mx += value * x[c]
                my += value * y[r]
                mxx += value * x[c] * x[c]
                myy += value * y[r] * y[r]
                mxy += value * x[c] * y[r]
    if not m > 0.0:
        return 0.0, np.nan
    cxx, cyy, cxy = mxx / m - (mx / m)**2, myy / m - (my / m)**2, mxy / m - mx * my / m**2
    mean, half = 0.5 * (cxx + cyy), np.hypot(0.5 * (cxx - cyy), cxy)
    return cxx + cyy, (mean + half) / (mean - half) if mean > half else np.nan


@njit(error_model='numpy')
def likelier_model(stress, sensor, layers):
    """The model to try first: how far the tactels above half the peak spread."""
    layer, row, column = peak(stress, layers)
    if layer < 0:
        return POINT
    image = stress[layer]
    spread, elongation = _ridge_shape(image, sensor.x, sensor.y, 0.5 * image[row, column])
    is_long = spread > (LINE_LENGTH * layers[layer].depth) ** 2 and not elongation < 2.0
    return LINE if is_long else POINT


@njit(error_model='numpy')
def overrules(first, second, min_snr):
    """
    Whether the second estimate replaces an unconvincing first.

    Where the first is too weak, the second must be strong enough to contradict it.
    """
    return not first.reasons & _LOW_SNR or (
        second.reasons & UNCONVINCING != 0 and second.snr >= min_snr + CONTRADICTION)


@njit(error_model='numpy')
def _shear_shows(kind, fit, forces):
    """Whether the shear is more than noise, by the scatter that the fit leaves."""
    spread = max(1.0, fit.squared_error / max(fit.used - 2.0 - forces, 1.0))
    xx, xy, yy = fit.cov[SHEAR_X, SHEAR_X], fit.cov[SHEAR_Y, SHEAR_X], fit.cov[SHEAR_Y, SHEAR_Y]
    if kind == LINE:
        return fit.shear * fit.shear > LINE_SHEAR_EVIDENCE * spread * xx
    qx, qy = fit.shear_x, fit.shear_y
    # The form Q' C^-1 Q, without dividing by a determinant that may be zero.
    return yy * qx * qx - 2.0 * xy * qx * qy + xx * qy * qy > (
        POINT_SHEAR_EVIDENCE * spread * (xx * yy - xy * xy))


@njit(error_model='numpy')
def fit_without_idle_shear(kind, sensor, layers, forces, extras, memory):
    """
    Fit with these extras, if any, and again without shear where it does not show.

    Without extras the load is fitted already. Leaves the covariance of the fit with shear, whether
    there is one, and how far the load moved: shear that does not show may still be there. Returns
    whether it worked, and has shear.
    """
    fit, with_shear, state = memory.fits[0], memory.fits[2], memory.state[0]
    if not extras:
        fit.cov[:] = 0.0
        fit.regular = invert(fit.normal, 2 + forces, fit.cov)
    elif not fit_extended(kind, sensor, layers, forces, extras, memory):
        return False, False
    fit.moved[:] = 0.0
    if fit.regular and _shear_shows(kind, fit, forces):
        return True, True
    copy_record(memory.fits, 0, memory.fits, 2)
    if extras:
        fitted = fit_extended(kind, sensor, layers, forces // 2, extras, memory)
    else:
        fitted = fit_load(kind, memory.stress, sensor, layers, forces // 2, 0.0, np.inf,
                          state.scatter, memory.tactels, fit)
    fit.regular = with_shear.regular
    for i in range(PARAMETERS):
        for j in range(PARAMETERS):
            fit.cov[i, j] = with_shear.cov[i, j]
    for i in range(5):
        fit.moved[i] = with_shear.vector[i] - fit.vector[i]
    return fitted, False
