"""Flat-fielding: the gain of every tactel from presses over the pad."""

from dataclasses import dataclass

import numpy as np

from tactile_sensing.calibration.presses import Presses
from tactile_sensing.calibration.skin_fit import fit_skin, SkinFit
from tactile_sensing.skin.pressure import SkinPressure

ROUNDS = 4  # of gains by presses and presses by gains
MODEL_ERROR = 0.01  # of the pressure, that the skin's model may leave out
SHEAR = 0.1  # of the force: standard deviation of shear while the ball is pressed straight
USUAL_SPREAD = 0.1  # of gains, before anything is measured
LEAST_SPREAD = 0.005  # that is looked for
LEAST_FORCE_SPREAD = 0.003  # of presses of one weight, relative
UNLIKE = 3.0  # standard deviations of the forces beyond which a press is of another weight


@dataclass(frozen=True, eq=False)
class Gains:
    """Relative gains: what pressure a count of each tactel stands for, 1 in the mean."""

    gain: np.ndarray  # (rows, columns)
    std: np.ndarray  # (rows, columns), of each, relative
    spread: float  # standard deviation of the gains
    left: float  # RMS of `std`: the spread that is left


def flat_field(presses: Presses, ball_radius: float, skin_fit: SkinFit, area: bool,
               force: np.ndarray, source: np.ndarray) -> Gains:
    """
    Find the gains with which presses look as one skin makes them.

    Sensitivities of all tactels and places and forces of all presses are fitted together: what a
    press is free to be is projected out of what its tactels demand. Chance alone spreads gains
    as far as they are found to spread, and forces about those given; a tactel that no press
    loads keeps what is usual.

    Parameters
    ----------
    presses : Presses
    ball_radius : float
        [m].
    skin_fit : SkinFit
    area : bool
        As of `fit_skin`.
    force : ndarray, shape (N,)
        What is known of the forces relative to those of the same source.
    source : ndarray, shape (N,)
        Where each press is from.
    """
    array, sensitivity = presses.array, np.ones(presses.array.shape)
    spread = USUAL_SPREAD
    size = (array.pitch_x, array.pitch_y) if area else (0.0, 0.0)
    pressure = SkinPressure(skin_fit.skin, *size)
    covariance = np.eye(sensitivity.size)
    for _ in range(ROUNDS):
        fit = fit_skin(presses.scaled(1.0 / sensitivity), ball_radius, area=area,
                       known=skin_fit.skin)
        information, demanded = _demands(
            presses, sensitivity, pressure, fit, *expected_forces(
                fit.amplitudes[:, 0], force, source))
        prior = np.eye(sensitivity.size) / spread**2
        covariance = np.linalg.inv(information + prior)
        step = covariance @ (demanded - (sensitivity.ravel() - 1.0) / spread**2)
        sensitivity = np.clip(sensitivity + step.reshape(array.shape), 0.3, 3.0)
        variance = np.diag(covariance)
        spread = max(float(np.sqrt(np.mean((sensitivity.ravel() - 1.0)**2 + variance))),
                     LEAST_SPREAD)
    std = np.sqrt(np.diag(covariance)).reshape(array.shape)
    return Gains(1.0 / sensitivity, std, spread, float(np.sqrt(np.mean(std**2))))


def expected_forces(found: np.ndarray, force: np.ndarray,
                    source: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """
    Return the forces that presses are expected to have (N,), and their standard deviations (N,).

    That is what is known of them relative to each other, `force`, at the level of those found of
    the same source and with the spread of all; a press that is unlike the others keeps its own.
    """
    expected = force.astype(float)
    for name in np.unique(source):
        own = source == name
        expected[own] *= np.median(found[own] / force[own])
    off = np.abs(found / expected - 1.0)
    spread = max(1.4826 * float(np.median(off)), LEAST_FORCE_SPREAD)  # of a normal distribution
    like = off <= UNLIKE * spread
    return np.where(like, expected, found), np.where(like, spread * expected, np.inf)


def _demands(presses, sensitivity, pressure, fit, force, force_std):
    """Normal equations of the sensitivities, with places and forces eliminated."""
    x, y = presses.array.x[None, :], presses.array.y[:, None]
    count = sensitivity.size
    information, demanded = np.zeros((count, count)), np.zeros(count)
    step = 1e-3 * min(presses.array.pitch_x, presses.array.pitch_y)
    for values, noise, model, (a, b), amplitudes, expected, std in zip(
            presses.values, presses.noise, fit.models, fit.places, fit.amplitudes, force,
            force_std, strict=True):
        seen = np.isfinite(values) & (values > presses.floor)
        weight = np.where(seen, 1.0 / np.hypot(noise, MODEL_ERROR * model), 0.0).ravel()
        basis = pressure.point_basis(x, y, a, b)
        moved = [(pressure.point_basis(x, y, a + dx, b + dy) - basis) @ amplitudes / step
                 for dx, dy in ((step, 0.0), (0.0, step))]
        columns = np.concatenate([basis, np.stack(moved, -1)], -1).reshape(count, 5)
        # Three more rows: the force that is expected, and that the ball is pressed straight.
        known = 1.0 / np.array([std, SHEAR * amplitudes[0], SHEAR * amplitudes[0]])
        q, _ = np.linalg.qr(np.concatenate([
            columns * (sensitivity.ravel() * weight)[:, None], np.eye(3, 5) * known[:, None]]))
        lever = model.ravel() * weight
        left = np.concatenate([np.nan_to_num(values - sensitivity * model).ravel() * weight,
                               (np.array([expected, 0.0, 0.0]) - amplitudes) * known])
        own = lever[:, None] * q[:count]
        information += np.diag(lever**2) - own @ own.T
        demanded += lever * (left - q @ (q.T @ left))[:count]
    return information, demanded
