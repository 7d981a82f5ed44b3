"""Skin and gains that explain presses of a ball, and how well they are known."""

from copy import copy
from dataclasses import dataclass, replace
import math

import numpy as np

from tactile_sensing.calibration.likelihood import (
    DERIVATIVE,
    FIXED,
    KIND,
    Likelihood,
    SEEN,
    skin_of,
)
from tactile_sensing.calibration.presses import Presses
from tactile_sensing.skin.pressure import SkinPressure
from tactile_sensing.types.skin import Skin

EVIDENCE = 4.0  # chi-square that a backing must explain
BARE = 4.0  # times as likely as one of the depth that fits is none, before presses tell
DEPTHS = (0.35, 0.6, 1.0, 1.5, 2.2, 3.2)  # pitches at which the search for the depth begins
RATIOS = (0.35, 0.8)  # likewise depth over thickness
SLANT = 0.3  # rad: yaw of an edge through the middle of the pad
EXACT = 1e-6  # counts: standard deviation of an offset that is known


@dataclass(frozen=True, eq=False)
class Fit:
    """What presses tell of skin and gains, and how well."""

    skin: Skin
    depth_std: float  # [m]
    thickness_std: float  # [m]; infinite where no backing shows
    poisson_std: float  # infinite where it was not fitted
    patch: float  # radius of a patch over that of the ball, at the usual force
    gain: np.ndarray  # (rows, columns): pressure of a count over the usual one
    gain_std: np.ndarray  # (rows, columns), relative
    spread: float  # standard deviation of the gains
    left: float  # of what is unknown of them, RMS of those that were pressed
    scatter: float  # what the model misses, as a share of the pressure
    models: np.ndarray  # (N, rows, columns) [counts]
    misfit: np.ndarray  # (N,): RMS of what is left over what is expected
    groups: np.ndarray  # (N,): number of the press that each frame is of
    dead: np.ndarray  # (rows, columns), bool: does not follow the load
    level: np.ndarray  # (sources,) [counts m^2 / N]
    force_left: float  # what gains and model let the force of a press be off by, relative
    kind: np.ndarray  # log depth [m], depth over thickness, Poisson's ratio, patch
    covariance: np.ndarray  # of the KIND numbers, and the logarithms of the levels

    def level_std(self, source: int) -> float:
        """Standard deviation of the level of a source."""
        return float(self.level[source] * math.sqrt(self.covariance[KIND + source, KIND + source]))


def fit_presses(presses: Presses, ball_radius: float, *, area: bool = True,
                known: Skin | None = None, poisson: float | None = None,
                told: np.ndarray | None = None, source: np.ndarray | None = None,
                offset_std: np.ndarray | float = EXACT) -> Fit:
    """
    Find skin and gains that explain presses of a ball.

    A half-space comes first, then a backing, where it explains more.

    Parameters
    ----------
    presses : Presses
    ball_radius : float
        [m].
    area : bool
        Whether tactels average over their area, or sample their centres.
    known : Skin, optional
        Nothing of it is fitted then.
    poisson : float, optional
        Poisson's ratio where it is known; else it is found about what is usual.
    told : ndarray, shape (N,), optional
        What is known of the forces relative to those of the same source.
    source : ndarray, shape (N,), optional
        Where each press is from: 0, 1 ...
    offset_std : ndarray, shape (rows, columns), optional
        How well it is known what the unloaded pad reads [counts].
    """
    count = len(presses)
    problem = Likelihood(presses, ball_radius, area, np.ones(count) if told is None else told,
                         np.zeros(count, int) if source is None else source,
                         np.broadcast_to(offset_std, presses.array.shape).ravel())
    if poisson is not None:
        problem.usual[2] = poisson
        problem.hold(2)
    if known:
        problem.usual[:3] = math.log(known.depth), known.depth / known.thickness, known.poisson
        problem.hold(0, 1, 2)
        return _result(problem, problem.settle(problem.at_peaks(problem.usual.copy())))
    problem.hold(1)
    start = _start(problem)
    plain = problem.iterate(problem.at_peaks(start))
    problem.known[1] = 1.0
    layers = []
    for ratio in RATIOS:
        trial = copy(problem)
        layer = trial.settle(replace(plain, kind=np.array([start[0], ratio, *trial.usual[2:]])))
        layers.append((trial.chi(layer), trial, layer))
    least, problem, layer = min(layers, key=lambda it: it[0])
    problem.hold(1)
    plain = problem.iterate(replace(layer, kind=plain.kind))
    evidence = problem.chi(plain) - least
    if evidence < EVIDENCE:
        plain = problem.settle(plain)
        # A backing that does not show may be there: so likely is what it would change.
        likely = 1.0 / (1.0 + BARE * math.exp(-0.5 * evidence))
        return _result(problem, plain, likely**0.5 * np.append(
            layer.kind - plain.kind, np.log(layer.level / plain.level)))
    problem.known[1] = 1.0
    return _result(problem, layer)


def _start(problem):
    """Half-space at which the search begins: the best of some, by some of the presses."""
    trial = problem.only(8)
    trial.usual, trial.known = problem.usual, problem.known.copy()
    trial.hold(0)
    kinds = [np.append(math.log(depth * problem.pitch), problem.usual[1:]) for depth in DEPTHS]
    return min(kinds, key=lambda kind: trial.chi(trial.iterate(trial.at_peaks(kind), 3)))


def _result(problem, unknowns, unseen=0.0):
    shape = problem.presses.array.shape
    inverse, share, own, unknowns = problem.inverse(unknowns)
    here, rest, weight, slope, unknowns = problem.slopes(unknowns)
    _, expected, _ = problem.left(unknowns, here)
    tactels, common, skin = here.shape[1], KIND + len(unknowns.level), skin_of(unknowns.kind)
    live = np.isfinite(problem.values)
    # A common factor of all gains is one of the levels: their mean, as forces weigh it, is none.
    usual = np.where(live, here**2, 0.0).sum(axis=0)
    usual /= usual.sum()
    mean, follows = usual @ unknowns.gain, np.eye(common, len(inverse))
    follows[KIND:] -= usual @ share
    covariance = follows @ inverse @ follows.T
    covariance[KIND:, KIND:] += usual**2 @ (1.0 / own)
    covariance += np.multiply.outer(unseen, unseen)
    std = np.sqrt(np.diag(covariance))
    thickness_std = math.inf
    if not skin.is_half_space:  # depth over the ratio
        ratio = np.array([1.0, -1.0 / unknowns.kind[1]])
        thickness_std = skin.thickness * math.sqrt(ratio @ covariance[:2, :2] @ ratio)
    variance = 1.0 / own + np.einsum('tk,kl,tl->t', share, inverse, share, optimize=True)
    seen = (np.where(live, here / problem.noise, 0.0)**2).sum(axis=0) > SEEN**2
    left = math.sqrt(variance[seen].mean())
    # What a press of unknown place makes of its force, as gains and model are off.
    root = np.sqrt(weight[..., None])
    by_reading = np.linalg.pinv(slope[..., common:] * root)[:, 0, :tactels] * root[:, :tactels, 0]
    by_press = np.sqrt((by_reading**2 * (left**2 + problem.scatter**2) * here**2).sum(axis=1))
    off = np.where(live, rest[:, :tactels]**2 / expected, 0.0)
    return Fit(
        skin, 0.0 if problem.known[0] == FIXED else skin.depth * std[0], thickness_std,
        math.inf if skin.is_half_space or problem.known[2] == FIXED else std[2],
        unknowns.kind[3], ((1.0 + mean) / (1.0 + unknowns.gain)).reshape(shape),
        np.sqrt(variance).reshape(shape), problem.spread, left, problem.scatter,
        ((1.0 + unknowns.gain) * here + unknowns.offset).reshape(-1, *shape),
        np.sqrt(off.sum(axis=1) / live.sum(axis=1)), problem.groups,
        problem.gone.reshape(shape), unknowns.level * (1.0 + mean),
        float(np.median(by_press)), unknowns.kind, covariance)


def edge_force_std(presses: Presses, fit: Fit, source: int, area: bool) -> float:
    """
    Relative standard deviation that the forces of all edges have by gain and skin.

    What is wrong with the skin, and with the patch beside it, moves the gain as it moves the force
    of the presses that tell it. Points follow these, but edges do not.
    """
    array, kind = presses.array, fit.kind
    size = (array.pitch_x, array.pitch_y) if area else (0.0, 0.0)

    def line(kind):
        return SkinPressure(skin_of(kind), *size).line(
            array.x[None, :], array.y[:, None], 0.0, SLANT, 1.0)
    edge, by = line(kind), np.zeros(len(fit.covariance))
    for k in range(3):
        step = -DERIVATIVE[k] if kind[k] > (np.inf, 0.99, 0.49)[k] else DERIVATIVE[k]
        by[k] = -np.vdot(edge, line(kind + step * np.eye(KIND)[k]) - edge) / step / np.vdot(
            edge, edge)
    by[KIND + source] = -1.0
    return math.sqrt(by @ fit.covariance @ by)
