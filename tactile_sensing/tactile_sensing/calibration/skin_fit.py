"""Fit skin and gains to presses of a ball, with their standard deviations."""

from copy import copy
from dataclasses import dataclass, replace
import math

import numpy as np
import scipy

from tactile_sensing.calibration.likelihood import (
    FIXED,
    KIND,
    Likelihood,
    SEEN,
    skin_of,
    step_of,
    Unknowns,
)
from tactile_sensing.calibration.presses import Presses
from tactile_sensing.skin.pressure import SkinPressure
from tactile_sensing.types.skin import Skin

DEPTHS = (0.35, 0.6, 1.0, 1.5, 2.2, 3.2)  # pitches at which the search for the depth begins
RATIOS = (0.35, 0.8)  # likewise depth over thickness; one start alone misses some backings
EVIDENCE = 4.0  # the skin has a backing if this decreases chi-square by at least this amount
BARE = 4.0  # prior odds of no backing against a backing
EXACT = 1e-6  # standard deviation of a known offset [counts]
SLANT = 0.3  # yaw of the edge, through the middle of the pad, for the error of forces [rad]


@dataclass(frozen=True, eq=False)
class SkinFit:
    """Skin and gains that were fitted to presses, with their standard deviations."""

    skin: Skin
    depth_std: float  # [m]
    thickness_std: float  # [m]; infinite: no backing found
    poisson_std: float  # infinite: not fitted
    patch: float  # radius of a patch over that of the ball, at the usual force
    gain: np.ndarray  # (rows, columns): pressure per count, relative to the usual one
    gain_std: np.ndarray  # (rows, columns), relative standard deviation of the estimate
    spread: float  # standard deviation of the gains
    left: float  # RMS of `gain_std` of the pressed tactels
    scatter: float  # error of the model, as share of the pressure
    models: np.ndarray  # (N, rows, columns) [counts]
    misfit: np.ndarray  # (N,): RMS residual over its expected value
    groups: np.ndarray  # (N,): number of the press of each frame
    dead: np.ndarray  # (rows, columns), bool: does not follow the load
    level: np.ndarray  # (sources,) counts per pressure [counts m^2 / N]
    force_left: float  # relative error of the force of a press, due to gains and model
    # Relative standard deviations for forces known in the first source: of its level, and of what
    # the forces of edges have in common.
    level_std: float
    edge_force_std: float


def fit_presses(presses: Presses, ball_radius: float, *, area: bool = True,
                known: Skin | None = None, poisson: float | None = None,
                offset_std: np.ndarray | float = EXACT) -> SkinFit:
    """
    Fit skin and gains to presses of a ball.

    The search begins with a half-space. The skin gets a backing if that explains the presses
    significantly better.

    Parameters
    ----------
    presses : Presses
    ball_radius : float
        [m]
    area : bool
        True: tactels average over their area. False: they sample their centres.
    known, poisson : Skin, float, optional
        Known skin or Poisson's ratio, not fitted. Otherwise Poisson's ratio has a usual prior.
    offset_std : ndarray, shape (rows, columns), optional
        Standard deviation of the offsets of the unloaded tactels [counts].
    """
    problem = Likelihood(presses, ball_radius, area,
                         np.broadcast_to(offset_std, presses.array.shape).ravel())
    if poisson is not None:
        problem.usual[2] = poisson
        problem.known[2] = FIXED
    if known:
        problem.usual[:3] = math.log(known.depth), known.depth / known.thickness, known.poisson
        problem.known[:3] = FIXED
        return _result(problem, problem.settle(problem.at_peaks(problem.usual.copy())))
    problem.known[1] = FIXED
    start = _start(problem)
    plain = problem.iterate(problem.at_peaks(start))
    problem.known[1] = 1.0
    layers = []
    for ratio in RATIOS:
        trial = copy(problem)
        layer = trial.settle(replace(plain, kind=np.array([start[0], ratio, *trial.usual[2:]])))
        layers.append((trial.chi(layer), trial, layer))
    least, problem, layer = min(layers, key=lambda it: it[0])
    problem.known[1] = FIXED
    plain = problem.iterate(replace(layer, kind=plain.kind))
    evidence = problem.chi(plain) - least
    if evidence < EVIDENCE:
        plain = problem.settle(plain)
        # A backing may exist although it does not show. The variance that its effect adds follows
        # from its probability.
        likely = scipy.special.expit(0.5 * evidence - math.log(BARE))
        return _result(problem, plain, likely**0.5 * np.append(
            layer.kind - plain.kind, np.log(layer.level / plain.level)))
    problem.known[1] = 1.0
    return _result(problem, layer)


def _start(problem: Likelihood) -> np.ndarray:
    """Return the half-space at which the search begins: the best of some for few presses."""
    few = problem.presses.only(np.arange(min(len(problem.presses), 8)))
    trial = Likelihood(few, problem.radius, problem.size[0] > 0.0, problem.offset_std)
    trial.usual, trial.known = problem.usual, problem.known.copy()
    trial.known[0] = FIXED
    kinds = [np.append(math.log(depth * problem.pitch), problem.usual[1:]) for depth in DEPTHS]
    return min(kinds, key=lambda kind: trial.chi(trial.iterate(trial.at_peaks(kind), 3)))


def _result(problem: Likelihood, unknowns: Unknowns,
            unseen: np.ndarray | float = 0.0) -> SkinFit:
    matrix, _, unknowns = problem.system(unknowns)
    inverse = np.linalg.inv(matrix)
    at, unknowns = problem.residuals(unknowns)
    model, tactels, common = at.model, at.model.shape[1], KIND + len(unknowns.level)
    skin, live, rest = skin_of(unknowns.kind), np.isfinite(problem.values), at.rest[:, :tactels]
    # A common factor of all gains belongs to the levels: move the weighted mean gain there.
    usual = np.where(live, model**2, 0.0).sum(axis=0)
    usual /= usual.sum()
    mean, follows = usual @ unknowns.gain, np.eye(common, len(inverse))
    follows[KIND:, -2 * tactels:-tactels] = usual
    covariance = follows @ inverse @ follows.T + np.multiply.outer(unseen, unseen)
    std = np.sqrt(np.diag(covariance))
    thickness_std = math.inf
    if not skin.is_half_space:  # depth over the ratio
        ratio = np.array([1.0, -1.0 / unknowns.kind[1]])
        thickness_std = skin.thickness * math.sqrt(ratio @ covariance[:2, :2] @ ratio)
    variance = np.diag(inverse)[-2 * tactels:-tactels]
    seen = (np.where(live, model / problem.noise, 0.0)**2).sum(axis=0) > SEEN**2
    left = math.sqrt(variance[seen].mean())
    # Error of the force of a press of unknown place, due to errors of gains and model.
    root, slope = np.sqrt(at.weight[..., None]), problem.slopes(at, unknowns)
    by_reading = np.linalg.pinv(slope[..., common:] * root)[:, 0, :tactels] * root[:, :tactels, 0]
    by_press = np.sqrt((by_reading**2 * (left**2 + problem.scatter**2) * model**2).sum(axis=1))
    off = np.where(live, rest**2 / at.variance, 0.0)
    shape, gain = problem.presses.array.shape, unknowns.gain
    return SkinFit(
        skin=skin, depth_std=0.0 if problem.known[0] == FIXED else skin.depth * std[0],
        thickness_std=thickness_std,
        poisson_std=math.inf if skin.is_half_space or problem.known[2] == FIXED else std[2],
        patch=unknowns.kind[3], gain=((1.0 + mean) / (1.0 + gain)).reshape(shape),
        gain_std=np.sqrt(variance).reshape(shape), spread=problem.spread, left=left,
        scatter=problem.scatter,
        models=((1.0 + gain) * model + unknowns.offset).reshape(-1, *shape),
        misfit=np.sqrt(off.sum(axis=1) / live.sum(axis=1)), groups=problem.groups,
        dead=problem.gone.reshape(shape), level=unknowns.level * (1.0 + mean),
        force_left=float(np.median(by_press)), level_std=std[KIND],
        edge_force_std=_edge_force_std(problem, unknowns.kind, covariance))


def _edge_force_std(problem: Likelihood, kind: np.ndarray, covariance: np.ndarray) -> float:
    """Return the relative error that forces of edges have in common, due to gain and skin."""
    # For points these errors compensate, because they are like the presses; for edges not.
    def line(kind: np.ndarray) -> np.ndarray:
        return SkinPressure(skin_of(kind), *problem.size).line(
            problem.x[None, :], problem.y, 0.0, SLANT, 1.0)
    edge, by = line(kind), np.zeros(len(covariance))
    for k in range(3):
        step = step_of(kind, k)
        change = line(kind + step * np.eye(KIND)[k]) - edge
        by[k] = -np.vdot(edge, change) / step / np.vdot(edge, edge)
    by[KIND] = -1.0
    return math.sqrt(by @ covariance @ by)
