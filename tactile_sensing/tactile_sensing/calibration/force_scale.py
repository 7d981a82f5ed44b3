"""What the forces of edges are off by in common, as the presses of a ball tell the gain."""

import math

import numpy as np

from tactile_sensing.calibration.presses import Presses
from tactile_sensing.calibration.skin_fit import SkinFit
from tactile_sensing.calibration.skin_parameters import (
    levels,
    moved_skins,
    parameters_of,
    patch_radius,
)
from tactile_sensing.skin.pressure import SkinPressure

SLANT = 0.3  # rad: yaw of an edge through the middle of the pad
STEP = 1e-3  # pitches, and shares of the ball's radius, for derivatives


def edge_force_std(presses: Presses, fit: SkinFit, ball_radius: float, area: bool) -> float:
    """
    Relative standard deviation that the forces of all edges have by the skin that was fitted.

    What is wrong with the skin, and with the patch beside it, moves the gain as it moves the force
    of the presses that tell it. Points follow these, but edges do not.

    Parameters
    ----------
    presses : Presses
    fit : SkinFit
        Of the presses.
    ball_radius : float
        [m].
    area : bool
        As of `fit_skin`.
    """
    size = (presses.array.pitch_x, presses.array.pitch_y) if area else (0.0, 0.0)
    here = SkinPressure(fit.skin, *size)
    moved = [(SkinPressure(skin, *size), step)
             for skin, step in moved_skins(parameters_of(fit.skin), fit.uncertain)]
    off = _by_edge(presses.array, here, moved) - _by_presses(
        presses, fit, ball_radius, here, moved)
    return math.sqrt(off @ fit.covariance @ off)


def _by_edge(array, here, moved):
    """Derivatives of the logarithm of an edge's force by skin and patch, which it has not."""
    x, y = array.x[None, :], array.y[:, None]
    edge = here.line(x, y, 0.0, SLANT, 1.0)
    return np.array([-np.vdot(edge, other.line(x, y, 0.0, SLANT, 1.0) - edge) / step
                     for other, step in moved] + [0.0]) / np.vdot(edge, edge)


def _by_presses(presses, fit, ball_radius, here, moved):
    """Derivatives of the mean logarithm of the presses' forces by skin and patch."""
    x, y = presses.array.x[None, :], presses.array.y[:, None]
    total, d = np.zeros(len(moved) + 1), STEP * presses.array.pitch_x
    for values, noise, model, (a, b), amplitudes, level in zip(
            presses.values, presses.noise, fit.models, fit.places, fit.amplitudes,
            levels(fit.amplitudes[:, 0]), strict=True):
        weight = np.where(np.isfinite(values), 1.0 / np.hypot(
            noise, fit.scatter * model), 0.0).reshape(-1, 1)

        def basis(pressure, dx=0.0, dy=0.0, wider=0.0, a=a, b=b, level=level):
            return pressure.point_basis(x, y, a + dx, b + dy, patch_radius(
                fit.patch + wider, ball_radius, level, pressure.skin)).reshape(-1, 3)

        force_and_shear = basis(here)
        plain = force_and_shear @ amplitudes

        def slope(step, pressure=here, amplitudes=amplitudes, plain=plain, **change):
            return (basis(pressure, **change) @ amplitudes - plain) / step

        free = np.column_stack([force_and_shear, slope(d, dx=d), slope(d, dy=d)])
        common = np.column_stack([*(slope(step, other) for other, step in moved),
                                  slope(STEP, wider=STEP)])
        follows = np.linalg.lstsq(free * weight, common * weight, rcond=None)[0]
        total -= follows[0] / amplitudes[0]
    return total / len(presses)
