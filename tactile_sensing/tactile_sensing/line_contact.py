"""Explain a frame as a line contact: fitted, or by the thesis' closed form (chapter 3)."""

from dataclasses import replace
import math

import numpy as np

from tactile_sensing.contact import Contact, ContactType, no_covariance, Reason
from tactile_sensing.line import chord_length, peak_pressure, pressure
from tactile_sensing.line_fit import fit_line
from tactile_sensing.moments import image_moments, line_from_moments

MODEL = 'line/zz'
MOMENTS_THRESHOLD = 4.0  # standard deviations; the thesis' threshold (3.5)
UNEXPLAINED = 0.5  # share of the energy that the biased closed form may leave unexplained
MIN_ELONGATION = 3.0  # of second moments; less is no edge, whatever the closed form says
LAST_STEP = 0.05  # fraction of the depth; the error left by a Gauss-Newton step is its square


def fitted_line(frame, config):
    """
    Fit a line load to a frame.

    Parameters
    ----------
    frame : Frame
    config : EstimatorConfig

    Returns
    -------
    Contact
        Not valid, with type OTHER and BAD_FIT, where a line does not explain the frame.
    """
    fit = fit_line(frame.pressure, frame.array, frame.depth, frame.noise,
                   model_error=config.model_error)
    finite = np.isfinite([fit.rho, fit.yaw, fit.line_force, fit.squared_error]).all()
    if not finite or fit.line_force <= 0.0:
        return frame.refuse(config.method, ContactType.OTHER, Reason.BAD_FIT)
    freedom = fit.used - 3
    evidence = {'snr': _snr(fit.line_force, frame), 'iterations': 3,
                'residual': float(np.sqrt(fit.squared_error / freedom) / frame.noise)}
    if fit.chi_square > config.max_chi_square * freedom:
        return frame.refuse(config.method, ContactType.OTHER, Reason.BAD_FIT, **evidence)
    if evidence['snr'] < config.min_snr:
        return frame.refuse(config.method, ContactType.NONE, Reason.LOW_SNR, **evidence)
    cos, sin = math.cos(fit.yaw), math.sin(fit.yaw)
    if fit.last_step > LAST_STEP * frame.depth:
        off_pad = Reason.OFF_PAD if abs(fit.rho) > frame.array.half_width_x * cos else Reason(0)
        return frame.refuse(
            config.method, ContactType.LINE, Reason.NOT_CONVERGED | off_pad, **evidence)
    line = Contact(
        ContactType.LINE, True, frame.left_out, config.method, MODEL, a=fit.rho / cos, b=0.0,
        yaw=fit.yaw, line_force=fit.line_force, moments=frame.moments, **evidence)
    # (rho, yaw, force) -> (a, yaw, line_force); more noise than expected widens it.
    change = np.array([[1.0 / cos, fit.rho * sin / cos**2, 0.0], [0, 1, 0], [0, 0, 1]])
    try:
        inverse = np.linalg.inv(fit.information)
    except np.linalg.LinAlgError:
        return frame.refuse(config.method, ContactType.LINE, Reason.NOT_CONVERGED, **evidence)
    spread = frame.noise**2 * max(1.0, evidence['residual']**2)
    return _on_pad(line, frame, spread * change @ inverse @ change.T)


def line_by_moments(frame, config):
    """
    Line contact by the closed form (3.8) to (3.10), corrected; parameters as `fitted_line`.
    """
    cleaned = image_moments(
        frame.pressure, frame.array, threshold=MOMENTS_THRESHOLD * frame.noise)
    if not cleaned.m0 > 0.0:
        return frame.refuse(config.method, ContactType.NONE, Reason.LOW_SNR)
    if not cleaned.elongation() >= MIN_ELONGATION:
        return frame.refuse(config.method, ContactType.OTHER, Reason.BAD_FIT)
    closed = line_from_moments(cleaned, frame.array.half_width_y)
    left = frame.pressure - pressure(
        frame.array.x, frame.array.y[:, None], closed.a * math.cos(closed.yaw), closed.yaw,
        closed.line_force, frame.depth)
    if not np.nansum(left**2) <= UNEXPLAINED * np.nansum(frame.pressure**2):
        return frame.refuse(config.method, ContactType.OTHER, Reason.BAD_FIT)
    line = Contact(
        ContactType.LINE, True, frame.left_out, config.method, MODEL, a=closed.a, b=0.0,
        yaw=closed.yaw, line_force=closed.line_force, moments=frame.moments,
        snr=_snr(closed.line_force, frame))
    if line.snr < config.min_snr:
        return frame.refuse(config.method, ContactType.NONE, Reason.LOW_SNR, snr=line.snr)
    return _on_pad(line, frame, np.full((3, 3), np.nan))


def _snr(line_force, frame):
    return 20.0 * math.log10(peak_pressure(line_force, frame.depth) / frame.noise)


def _on_pad(line, frame, covariance):
    """Add forces on the pad and covariance to a line; refuse one whose centre is off it."""
    array = frame.array
    half = array.half_width_x, array.half_width_y

    def chord(a, yaw):
        return chord_length(a * math.cos(yaw), yaw, *half)

    length = chord(line.a, line.yaw)
    if abs(line.a) > half[0] or length == 0.0:
        return frame.refuse(
            line.method, ContactType.LINE, Reason.OFF_PAD, snr=line.snr,
            residual=line.residual, iterations=line.iterations)
    step = 1e-6
    slopes = np.array([
        line.line_force * (chord(line.a + step, line.yaw) - length) / step,
        line.line_force * (chord(line.a, line.yaw + step) - length) / step, length])
    full = no_covariance()
    rows = [0, 2, 6]  # a, yaw, line_force in contact.PARAMETERS
    full[np.ix_(rows, rows)] = covariance
    full[3, rows] = full[rows, 3] = covariance @ slopes
    full[3, 3] = slopes @ covariance @ slopes
    force = line.line_force * length
    model = pressure(array.x, array.y[:, None], line.a * math.cos(line.yaw), line.yaw,
                     line.line_force, frame.depth)
    live = np.isfinite(frame.pressure)
    windowed = force * float(frame.pressure[live].sum() / model[live].sum())
    return replace(line, normal_force=force, covariance=full, force_windowed=windowed)
