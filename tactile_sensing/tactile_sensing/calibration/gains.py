"""Flat-fielding: the gain of every tactel from presses over the pad."""

from dataclasses import dataclass

import numpy as np

from tactile_sensing.calibration.presses import Presses
from tactile_sensing.calibration.skin_fit import fit_skin, SkinFit

ROUNDS = 4  # of gains by presses and presses by gains
LEAST_SPREAD = 0.005  # of gains that is looked for


@dataclass(frozen=True, eq=False)
class Gains:
    """Relative gains: what pressure a count of each tactel stands for, 1 in the mean."""

    gain: np.ndarray  # (rows, columns)
    std: np.ndarray  # (rows, columns), of each, relative
    spread: float  # standard deviation of the gains
    left: float  # RMS of `std`: the spread that is left


def flat_field(presses: Presses, ball_radius: float, skin_fit: SkinFit,
               area: bool) -> tuple[Gains, SkinFit]:
    """
    Find the gains with which presses look as one skin makes them.

    In turns the presses are fitted to what the gains make of the counts, and every gain to what
    the presses demand; a tactel that no press loads keeps what is usual.
    """
    gain = np.ones(presses.array.shape)
    spread = max(skin_fit.scatter, LEAST_SPREAD)
    std = np.full(gain.shape, spread)
    for _ in range(ROUNDS):
        evened = Presses(presses.array, presses.values * gain, presses.noise * gain,
                         presses.floor * gain, presses.number)
        fit = fit_skin(evened, ball_radius, area=area, known=skin_fit.skin)
        # A count is the model over the gain: its sensitivity s = 1 / gain.
        seen = np.isfinite(presses.values) & (presses.values > presses.floor)
        model = np.where(seen, fit.models, 0.0)
        values = np.where(seen, np.nan_to_num(presses.values), 0.0)
        # Places, forces and shear of a press absorb a part of what its tactels are off.
        weight = 1.0 / (presses.noise**2 + (0.01 * model)**2)
        information = (weight * model**2).sum(axis=0)
        demanded = (weight * model * values).sum(axis=0)
        prior = 1.0 / spread**2
        sensitivity = (demanded + prior) / (information + prior)
        std = 1.0 / np.sqrt(information + prior)
        known = std < 0.5 * spread
        if known.any():
            sensitivity = np.where(known, sensitivity / sensitivity[known].mean(), sensitivity)
            spread = max(float(sensitivity[known].std()), LEAST_SPREAD)
        gain = 1.0 / sensitivity
    left = float(np.sqrt(np.mean(std**2)))
    return Gains(gain, std, spread, left), fit
