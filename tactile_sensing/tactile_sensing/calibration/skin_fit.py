"""
Skin of an array from presses of a small ball at unknown places with unknown forces.

Depth of the tactels, thickness and Poisson's ratio of the skin are common to all presses; each
has a place, a force, shear, and a patch that Hertz' law ties to its force. The forces enter
linearly and are projected out, so that Gauss and Newton's steps are of the places and the skin.
"""

from dataclasses import dataclass
import math

import numpy as np

from tactile_sensing.calibration.presses import Presses
from tactile_sensing.calibration.skin_parameters import (
    allow_for_poisson,
    ASSUMED_POISSON,
    levels,
    moved_skins,
    parameters_of,
    patch_radius,
    POISSON_STD,
    skin_of,
)
from tactile_sensing.devices.unloaded import missing_mean
from tactile_sensing.skin.pressure import SkinPressure
from tactile_sensing.types.skin import Skin

EVIDENCE = 9.0  # chi-square that a further parameter of the skin must explain
DEPTHS = (0.35, 0.6, 1.0, 1.5, 2.2, 3.2)  # pitches at which the search for the depth begins
RATIOS = (0.35, 0.8)  # likewise depth over thickness
STEPS = 25  # at most
SCATTER_ROUNDS = 2
PATCH, PATCH_STD = 0.5, 0.15  # of a patch's radius over the ball's, before anything is measured
BAD = 3.0  # times the usual misfit at which a press is none of the ball
LEAST_SCATTER = 1e-3  # share of the pressure


@dataclass(frozen=True)
class SkinFit:
    """A skin, how well it is known, and the presses that told it."""

    skin: Skin
    depth_std: float  # [m]
    thickness_std: float  # [m]; infinite where no backing shows
    poisson_std: float  # infinite where it was not fitted
    patch: float  # radius of a patch over that of the ball, at the usual force
    places: np.ndarray  # (N, 2) [m]
    amplitudes: np.ndarray  # (N, 3): normal force and shear over the gain [counts m^2]
    models: np.ndarray  # (N, rows, columns) [counts]
    scatter: float  # what tactels are off beside noise, as a share of the pressure
    chi_square: float
    misfit: np.ndarray  # (N,): RMS of what is left over what is expected
    free: tuple[int, ...]  # which of depth, thickness and Poisson's ratio were fitted
    uncertain: tuple[int, ...]  # these, and Poisson's ratio where a layer's is only assumed
    # Of these (logarithm of the depth, depth over thickness, Poisson's ratio) and the patch.
    covariance: np.ndarray


class _Problem:
    """Residuals and derivatives of all presses."""

    def __init__(self, presses: Presses, ball_radius: float, area: bool):
        self.presses, self.radius = presses, ball_radius
        array = presses.array
        self.size = (array.pitch_x, array.pitch_y) if area else (0.0, 0.0)
        self.x, self.y = array.x[None, :], array.y[:, None]
        self.level = np.ones(len(presses))  # relative force, which sets the patch
        self.weight = np.where(np.isfinite(presses.values), 1.0 / presses.noise, 0.0)
        self.values = np.nan_to_num(presses.values)
        self.models = np.zeros_like(self.values)
        self.amplitudes = np.zeros((len(presses), 3))
        self.scatter = LEAST_SCATTER

    def basis(self, pressure, i, place, patch):
        """Pressure by normal force and shear, (tactels, 3)."""
        radius = patch_radius(patch, self.radius, self.level[i], pressure.skin)
        return pressure.point_basis(self.x, self.y, *place, radius).reshape(-1, 3)

    def fill(self, i):
        """Values of a press; what is below the floor as the model expects it there."""
        noise, floor = self.presses.noise[i], self.presses.floor
        raw, model = self.presses.values[i], self.models[i]
        below = raw <= floor
        if not below.any():
            return
        z = (floor - model) / noise
        self.values[i] = np.where(below, model - noise * missing_mean(np.minimum(z, 30.0)),
                                  np.nan_to_num(raw))

    def set_weights(self):
        """By noise, and by what tactels are off in proportion to the pressure."""
        noise = self.presses.noise
        self.weight = np.where(np.isfinite(self.presses.values), 1.0 / np.sqrt(
            noise**2 + (self.scatter * self.models)**2), 0.0)

    def solve(self, pressure, i, place, patch):
        """Orthonormal weighted basis of a press, its best amplitudes and what they leave."""
        weight = self.weight[i].ravel()
        plain = self.basis(pressure, i, place, patch)
        values = self.values[i].ravel() * weight
        q, r = np.linalg.qr(plain * weight[:, None])
        amplitudes = np.linalg.solve(r, q.T @ values)
        self.models[i] = (plain @ amplitudes).reshape(self.models[i].shape)
        self.amplitudes[i] = amplitudes
        return q, amplitudes, values - q @ (q.T @ values)


def _step(problem, theta, patch, places, free):
    """One step of Gauss and Newton; returns new skin, patch, places, chi-square, covariance."""
    presses, count = problem.presses, len(places)
    n_free = len(free) + 1  # and the patch
    normal, right, chi = np.zeros((n_free, n_free)), np.zeros(n_free), 0.0
    here = SkinPressure(skin_of(theta), *problem.size)
    moved = [(SkinPressure(skin, *problem.size), step)
             for skin, step in moved_skins(theta, free)]
    blocks = []
    d = 1e-3 * min(presses.array.pitch_x, presses.array.pitch_y)
    for i in range(count):
        problem.fill(i)
        q, amplitudes, left = problem.solve(here, i, places[i], patch)

        def by(pressure, place, other_patch, step, i=i, q=q, amplitudes=amplitudes):
            other = problem.basis(pressure, i, place, other_patch) @ amplitudes
            column = (other - problem.models[i].ravel()) / step * problem.weight[i].ravel()
            return column - q @ (q.T @ column)

        place_columns = np.stack([by(here, places[i] + np.array([d, 0.0]), patch, d),
                                  by(here, places[i] + np.array([0.0, d]), patch, d)], -1)
        skin_columns = np.stack([*(by(it, places[i], patch, step) for it, step in moved),
                                 by(here, places[i], patch + 0.01, 0.01)], -1)
        own = place_columns.T @ place_columns + 1e-12 * np.eye(2)
        cross, grad = place_columns.T @ skin_columns, place_columns.T @ left
        blocks.append((own, cross, grad))
        solved = np.linalg.solve(own, np.column_stack([cross, grad]))
        normal += skin_columns.T @ skin_columns - cross.T @ solved[:, :-1]
        right += skin_columns.T @ left - cross.T @ solved[:, -1]
        chi += left @ left
    expected = [(-1, patch, PATCH, PATCH_STD)]
    if 2 in free:
        expected.append((free.index(2), theta[2], ASSUMED_POISSON, POISSON_STD))
    for k, value, usual, std in expected:
        normal[k, k] += 1.0 / std**2
        right[k] += (usual - value) / std**2
        chi += (usual - value)**2 / std**2
    covariance = np.linalg.pinv(normal)
    step = covariance @ right
    step *= min(1.0, 0.2 / max(np.abs(step).max(), 1e-12))
    new = theta.copy()
    for k, change in zip(free, step[:-1], strict=True):
        new[k] += change
    new[1], new[2] = min(max(new[1], 0.0), 1.0), min(max(new[2], 0.0), 0.5)
    moved_places = places.copy()
    for i, (own, cross, grad) in enumerate(blocks):
        move = np.linalg.solve(own, grad - cross @ step)
        longest = 0.5 * min(presses.array.pitch_x, presses.array.pitch_y)
        moved_places[i] += move * min(1.0, longest / max(np.abs(move).max(), 1e-12))
    return new, min(max(patch + step[-1], 0.05), 0.95), moved_places, chi, covariance, step


def _iterate(problem, theta, patch, places, free, steps=STEPS):
    """Step until chi-square rests; weights and patches follow the models."""
    chi = before = math.inf
    covariance = np.zeros((len(free) + 1,) * 2)
    for k in range(steps):
        theta, patch, places, chi, covariance, step = _step(problem, theta, patch, places, free)
        problem.level = levels(problem.amplitudes[:, 0])
        if k > 2 and abs(before - chi) < 1e-3 * max(chi, 1.0) ** 0.5 and (
                np.abs(step).max() < 1e-3):
            break
        before = chi
    return theta, patch, places, chi, covariance


def _peaks(presses):
    """Places of the highest tactels [m], (N, 2)."""
    flat = np.nan_to_num(presses.values, nan=-np.inf).reshape(len(presses), -1).argmax(axis=1)
    row, column = np.unravel_index(flat, presses.array.shape)
    return np.stack([presses.array.x[column], presses.array.y[row]], -1)


def _start(problem, presses, places):
    """Best of some half-spaces, at which the search begins."""
    pitch = math.sqrt(presses.array.pitch_x * presses.array.pitch_y)
    some = presses.only(np.arange(min(len(presses), 8)))
    best, least = math.inf, np.zeros(3)
    for depth in DEPTHS:
        trial = _Problem(some, problem.radius, problem.size[0] > 0.0)
        theta = np.array([math.log(depth * pitch), 0.0, ASSUMED_POISSON])
        _, _, _, chi, _ = _iterate(trial, theta, PATCH, places[:len(some)], (), 3)
        if chi < best:
            best, least = chi, theta
    return least


def _least_skin(problem, theta, patch, places, poisson):
    """Fit of a half-space, or of the layer or any Poisson's ratio where that explains more."""
    usual = ASSUMED_POISSON if poisson is None else poisson
    plain = theta.copy()
    plain[1:] = 0.0, usual
    free: tuple[int, ...] = (0,)
    best = _iterate(problem, plain, patch, places, free)
    layers = []
    for ratio in RATIOS if theta[1] == 0.0 else (theta[1],):
        layer = best[0].copy()
        layer[1:] = ratio, usual  # whatever an earlier round has found
        layers.append(_iterate(problem, layer, best[1], best[2], (0, 1)))
    layer = min(layers, key=lambda found: found[3])
    if best[3] - layer[3] > EVIDENCE:
        best, free = layer, (0, 1)
        if poisson is not None:
            return best, free
        more = _iterate(problem, best[0], best[1], best[2], (0, 1, 2))
        if best[3] - more[3] > EVIDENCE:
            best, free = more, (0, 1, 2)
    return best, free


def fit_skin(presses: Presses, ball_radius: float, *, area: bool = True,
             known: Skin | None = None, start: SkinFit | None = None,
             poisson: float | None = None) -> SkinFit:
    """
    Fit the skin that explains presses of a ball.

    A half-space comes first, then a backing, then Poisson's ratio, each where it explains more.

    Parameters
    ----------
    presses : Presses
    ball_radius : float
        [m].
    area : bool
        Whether tactels average over their area, or sample their centres.
    known : Skin, optional
        Nothing of it is fitted then, only the presses.
    start : SkinFit, optional
        An earlier fit of the same presses, whose kind of skin is kept.
    poisson : float, optional
        Poisson's ratio where it is known; else it is found, or assumed and widens the claims.
    """
    problem = _Problem(presses, ball_radius, area)
    places, patch, chi = _peaks(presses), PATCH, math.inf
    free: tuple[int, ...] = ()
    skin = start.skin if start else known
    if skin:
        theta = parameters_of(skin)
    else:
        theta = _start(problem, presses, places)
    if start:
        places, patch, free = start.places, start.patch, start.free
    for _ in range(SCATTER_ROUNDS):  # the scatter of the tactels follows from what is left
        if not skin:
            (theta, patch, places, chi, _), free = _least_skin(
                problem, theta, patch, places, poisson)
        theta, patch, places, chi, covariance = _iterate(problem, theta, patch, places, free)
        uncertain = free
        if free == (0, 1) and poisson is None:
            uncertain = 0, 1, 2
            covariance = allow_for_poisson(
                *_step(problem, theta, patch, places, uncertain)[4:])
        problem.scatter = _scatter(problem)
        problem.set_weights()
    return _result(problem, theta, patch, places, chi, covariance, free, uncertain)


def _scatter(problem):
    """Share of the pressure by which tactels are off, so that chi-square is as expected."""
    rest = np.where(problem.weight > 0.0, problem.values - problem.models, np.nan)
    noise = problem.presses.noise
    strong = problem.models > 0.03 * problem.models.max(axis=(1, 2), keepdims=True)
    strong &= np.isfinite(rest)
    # Place, force and shear of a press take up what five of its tactels are off.
    free = max(1.0 - 5.0 * len(rest) / max(strong.sum(), 1), 0.2)
    excess = np.mean(rest[strong]**2 / free - noise[strong]**2) / np.mean(
        problem.models[strong]**2)
    return math.sqrt(max(excess, LEAST_SCATTER**2))


def _result(problem, theta, patch, places, chi, covariance, free, uncertain):
    skin = skin_of(theta)
    live = problem.weight > 0.0
    rest = np.where(live, (problem.values - problem.models) * problem.weight, 0.0)
    misfit = np.sqrt((rest**2).sum(axis=(1, 2)) / live.sum(axis=(1, 2)))
    spread = max(1.0, chi / max(live.sum() - 5 * len(places), 1))
    covariance = spread * covariance
    std = dict(zip(uncertain, np.sqrt(np.diag(covariance)), strict=False))
    depth_std = skin.depth * std.get(0, 0.0)
    thickness_std = poisson_std = math.inf
    if 1 in free and not skin.is_half_space:
        # thickness = depth / ratio
        gradient = np.array([1.0, -1.0 / theta[1]])
        thickness_std = skin.thickness * math.sqrt(
            max(gradient @ covariance[:2, :2] @ gradient, 0.0))
    if 2 in free:
        poisson_std = std[2]
    return SkinFit(skin, depth_std, thickness_std, poisson_std, patch, places,
                   problem.amplitudes.copy(), problem.models.copy(), problem.scatter, chi, misfit,
                   free, uncertain, covariance)


def bad_presses(fit: SkinFit) -> np.ndarray:
    """Which presses the skin does not explain as it does the others, shape (N,), bool."""
    return fit.misfit > BAD * np.median(fit.misfit)
