"""Explain a frame as a point contact, with as much shear as the frame shows (chapter 2)."""

from dataclasses import replace
import math

import numpy as np
from scipy.ndimage import uniform_filter

from tactile_sensing.contact import Contact, ContactType, no_covariance, Reason
from tactile_sensing.point import stress
from tactile_sensing.point_fit import fit_point

SHEAR_EVIDENCE = 13.8  # chi-square of (Qx, Qy) that shear must reach: one in a thousand without
MIN_TACTELS = 15  # around the peak, three for each parameter
WINDOW = 2.0  # half side of the window of the second force estimate [depths]
SECOND_CONTACT = 0.15  # of the peak, left over elsewhere, that makes a second contact
ELSEWHERE = 2.0  # depths from the point that are elsewhere
DETECTION = 5.0  # standard deviations

_ROWS = (0, 1, 3, 4, 5)  # a, b, normal and shear force in contact.PARAMETERS


def fitted_point(frame, config):
    """
    Fit a point load to a frame, without shear unless the frame shows it.

    Parameters
    ----------
    frame : Frame
    config : EstimatorConfig

    Returns
    -------
    Contact
        Not valid, with type OTHER and BAD_FIT, where a point does not explain the frame.
    """
    fit, shear = _least_fit(frame, config.model_error)
    if not math.isfinite(fit.last_step) or not fit.normal_force > 0.0:
        return frame.refuse(config.method, ContactType.OTHER, Reason.BAD_FIT)
    if fit.used < MIN_TACTELS:
        return frame.refuse(config.method, ContactType.OTHER, Reason.BAD_FIT | Reason.FEW_TACTELS)
    model, chi_square, residual = _explained(frame, fit, config.model_error)
    peak = float(model.max())
    if not (peak > 0.0 and math.isfinite(chi_square + residual + peak)):
        return frame.refuse(config.method, ContactType.OTHER, Reason.BAD_FIT)
    snr = 20.0 * math.log10(peak / frame.noise)
    evidence = {'snr': snr, 'residual': residual, 'iterations': fit.iterations}
    if snr < config.min_snr:
        return frame.refuse(config.method, ContactType.NONE, Reason.LOW_SNR, **evidence)
    second = Reason.TWO_CONTACTS if _second_contact(frame, fit, model) else Reason(0)
    if second or chi_square > config.max_chi_square:
        return frame.refuse(config.method, ContactType.OTHER, Reason.BAD_FIT | second, **evidence)
    if not fit.converged or not np.isfinite(fit.covariance).all():
        return frame.refuse(
            config.method, ContactType.POINT, Reason.NOT_CONVERGED, **evidence)
    array = frame.array
    if abs(fit.a) > array.half_width_x or abs(fit.b) > array.half_width_y:
        return frame.refuse(config.method, ContactType.POINT, Reason.OFF_PAD, **evidence)
    names = '+'.join(layer.component for layer in frame.layers)
    covariance = no_covariance()
    rows = np.array(_ROWS[:5 if shear else 3])
    covariance[np.ix_(rows, rows)] = fit.covariance * max(1.0, residual**2)
    contact = Contact(
        ContactType.POINT, True, frame.left_out, config.method,
        f'point{"+shear" if shear else ""}/{names}', a=fit.a, b=fit.b,
        normal_force=fit.normal_force, shear_force_x=fit.shear_force_x,
        shear_force_y=fit.shear_force_y, covariance=covariance, moments=frame.moments,
        **evidence)
    return replace(contact, force_windowed=_windowed(frame, fit, model))


def _least_fit(frame, model_error):
    """Fit with shear, and without where the shear is not significant; and which it was."""
    fit = fit_point(frame.stress, frame.array, frame.layers, model_error=model_error)
    force = np.array([fit.shear_force_x, fit.shear_force_y])
    covariance = fit.covariance[3:, 3:]
    if np.isfinite(covariance).all() and np.isfinite(force).all():
        (xx, xy), (_, yy) = covariance
        x, y = force
        # The form Q' C^-1 Q, without dividing by a determinant that may be zero.
        if yy * x * x - 2.0 * xy * x * y + xx * y * y > SHEAR_EVIDENCE * (xx * yy - xy * xy):
            return fit, True
    return fit_point(frame.stress, frame.array, frame.layers, shear=False,
                     model_error=model_error), False


def _explained(frame, fit, model_error):
    """Model of the pressure layer, chi-square per degree of freedom and residual, all layers."""
    chi, squared, count, pressure_model = 0.0, 0.0, 0, None
    for measured, layer in zip(frame.stress, frame.layers, strict=True):
        model = stress(layer.component, frame.array.x, frame.array.y[:, None], fit.a, fit.b,
                       fit.normal_force, fit.shear_force_x, fit.shear_force_y, layer.depth)
        if pressure_model is None and layer.component == 'zz':
            pressure_model = model
        live = np.isfinite(measured)
        error, expected = measured[live] - model[live], model[live]
        chi += float(np.sum(error**2 / (layer.noise_std**2 + (model_error * expected)**2)))
        squared += float(np.sum(error**2)) / layer.noise_std**2
        count += error.size
    freedom = max(count - 5, 1)
    return pressure_model, chi / freedom, math.sqrt(squared / freedom)


def _second_contact(frame, fit, model):
    """Whether something beyond noise is left over away from the point, over 3x3 tactels."""
    left = uniform_filter(np.nan_to_num(frame.pressure - model), size=3, mode='constant')
    away = np.hypot(frame.array.x - fit.a, frame.array.y[:, None] - fit.b) > (
        ELSEWHERE * frame.depth)
    return float(left[away].max(initial=0.0)) > max(
        DETECTION * frame.noise / 3.0, SECOND_CONTACT * float(model.max()))


def _windowed(frame, fit, model):
    """Normal force by the zeroth moment of a window around the point [N]."""
    half = WINDOW * frame.depth
    inside = (np.abs(frame.array.x - fit.a) <= half) & (
        np.abs(frame.array.y[:, None] - fit.b) <= half) & np.isfinite(frame.pressure)
    expected = float(model[inside].sum())
    return fit.normal_force * float(frame.pressure[inside].sum()) / expected if (
        expected > 0.0) else float('nan')
