"""Convert a fitted load to the parameters of a contact and their covariance; compiled."""

import math

import numpy as np

from tactile_common.kernels import njit
from tactile_sensing.skin.bumps import (
    BEGIN,
    chord,
    END,
    FORCE,
    loaded_chord,
    Pad,
    POINT,
    Q0,
    Q1,
    SHEAR_U,
    SHEAR_V,
)
from tactile_sensing.types.contact import ROW

X, Y, YAW, NORMAL, SHEAR_X, SHEAR_Y, PER_LENGTH = ROW


@njit(error_model='numpy')
def _write_point(theta: np.ndarray, values: np.ndarray, change: np.ndarray) -> None:
    for row, parameter in ((X, Q0), (Y, Q1), (NORMAL, FORCE), (SHEAR_X, SHEAR_U),
                           (SHEAR_Y, SHEAR_V)):
        values[row], change[row, parameter] = theta[parameter], 1.0


@njit(error_model='numpy')
def _write_line(pad: Pad, theta: np.ndarray, ends: bool, values: np.ndarray,
                change: np.ndarray) -> tuple[float, float]:
    """
    Write the parameters of a line and their derivatives; return its start and end.

    The line's place is the middle of its loaded part on the pad; its forces are those on the pad.
    """
    rho, yaw, force, shear = theta[Q0], theta[Q1], theta[FORCE], theta[SHEAR_U]
    first, last, by_length = loaded_chord(pad, theta, ends)
    middle, length = 0.5 * (first + last), last - first
    cos, sin = math.cos(yaw), math.sin(yaw)
    turns = math.ceil(yaw / math.pi - 0.5)
    values[X], values[Y] = rho * cos - middle * sin, rho * sin + middle * cos
    values[YAW], values[PER_LENGTH] = yaw - math.pi * turns, force
    values[NORMAL] = force * length
    values[SHEAR_X], values[SHEAR_Y] = shear * length * cos, shear * length * sin
    change[X, Q0], change[X, Q1] = cos, cos * middle
    change[Y, Q0], change[Y, Q1] = sin, sin * middle
    change[YAW, Q1] = change[PER_LENGTH, FORCE] = 1.0
    change[NORMAL, FORCE] = length
    change[SHEAR_X, SHEAR_U], change[SHEAR_Y, SHEAR_U] = length * cos, length * sin
    for k, parameter in enumerate((Q0, Q1, BEGIN, END)):
        change[NORMAL, parameter] = force * by_length[k]
        change[SHEAR_X, parameter] = shear * cos * by_length[k]
        change[SHEAR_Y, parameter] = shear * sin * by_length[k]
    change[SHEAR_X, Q1] -= shear * length * sin
    change[SHEAR_Y, Q1] += shear * length * cos
    start = end = np.nan
    if ends:
        begin, stop, sign = theta[BEGIN], theta[END], 1.0
        if turns % 2:
            begin, stop, sign = -stop, -begin, -1.0
        low, high = chord(pad, sign * rho, values[YAW])
        if begin > low:
            start = begin
        if stop < high:
            end = stop
    return start, end


@njit(error_model='numpy')
def reported(pad: Pad, kind: int, theta: np.ndarray, ends: bool,
             covariance: np.ndarray) -> tuple[np.ndarray, np.ndarray, float, float]:
    """
    Return the parameters of a contact.

    Parameters
    ----------
    pad, kind, theta
        As for `bumps.add_rows`.
    ends : bool
        Whether a line begins and ends.
    covariance : ndarray, shape (parameters, parameters)
        Covariance of theta.

    Returns
    -------
    values : ndarray, shape (7,)
        In the order of `types.contact.PARAMETERS`; NaN: the kind has no such parameter.
    covariance : ndarray, shape (7, 7)
    start, end : float
        As in Contact.msg.
    """
    values, change = np.full(7, np.nan), np.zeros((7, theta.size))
    start = end = np.nan
    if kind == POINT:
        _write_point(theta, values, change)
    else:
        start, end = _write_line(pad, theta, ends, values, change)
    out = change @ covariance @ change.T
    for i in range(7):
        if np.isnan(values[i]):
            out[i], out[:, i] = np.nan, np.nan
    return values, out, start, end


@njit(cache=True, error_model='numpy')
def grade_forces(values: np.ndarray, covariance: np.ndarray, valid: bool, std: float) -> None:
    """
    Set invalid forces to NaN; increase the covariance of valid ones by their common error.

    `values` (7,) and `covariance` (7, 7) are modified. `std` is the relative standard deviation
    that all forces have in common.
    """
    for i in range(NORMAL, PER_LENGTH + 1):
        for j in range(7):
            if not valid:
                covariance[i, j] = covariance[j, i] = np.nan
            elif j >= NORMAL:
                covariance[i, j] += std * std * values[i] * values[j]
    if not valid:
        values[NORMAL:] = np.nan
