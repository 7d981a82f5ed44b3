"""Convert a fitted load to the parameters of a contact and their covariance; compiled."""

import math
from typing import Any

import numpy as np

from tactile_common.kernels import njit
from tactile_sensing.contact.records import Hypothesis
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
    WIDTH,
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
def report(pad: Pad, one: Hypothesis, force_std: float, record: Any) -> None:
    """
    Write the parameters of a valid contact and their covariance to a record.

    The forces are written only if they are valid. `force_std` is the relative standard deviation
    that all of them have in common.
    """
    theta, beliefs = one.fit.theta, one.beliefs
    values, change = np.full(7, np.nan), np.zeros((7, theta.size))
    if beliefs.kind == POINT:
        _write_point(theta, values, change)
    else:
        record.start, record.end = _write_line(pad, theta, beliefs.ends, values, change)
    covariance = change @ one.covariance @ change.T
    for i in range(7):
        for j in range(7):
            if i >= NORMAL and j >= NORMAL:
                covariance[i, j] += force_std**2 * values[i] * values[j]
            known = record.force_valid or max(i, j) < NORMAL
            if known and not np.isnan(values[i] + values[j]):
                record.covariance[i, j] = covariance[i, j]
    record.x, record.y, record.yaw = values[X], values[Y], values[YAW]
    if record.force_valid:
        record.normal_force, record.line_force = values[NORMAL], values[PER_LENGTH]
        record.shear_force_x, record.shear_force_y = values[SHEAR_X], values[SHEAR_Y]
        spread = math.sqrt(theta[WIDTH]) if beliefs.patch else 0.0
        width = math.sqrt(5.0) if beliefs.kind == POINT else 2.0
        record.patch = pad.depths[0] * spread * width
