"""
Joint likelihood of all presses of a ball; skin and gains of the tactels are the unknowns.

A tactel reads (1 + g) m + o plus noise, where m is the pressure of a press under the skin. All
presses share the skin, the patch of the ball at the usual force, and gain g and offset o of every
tactel. Each press has its own place, force and shear. Gauss-Newton steps change all of them
together. The error of the model is proportional to the load: the variance of a reading is
noise^2 + n (scatter m)^2, because n frames of one press share one error. Errors have the tails of
Student's t distribution. The spread of the gains, the scatter and the spread of the forces are
estimated from the fit.
"""

from dataclasses import dataclass, replace
import math
from typing import NamedTuple

import numpy as np
from scipy import sparse

from tactile_sensing.calibration.presses import Presses
from tactile_sensing.devices.tare import missing_mean
from tactile_sensing.skin.pressure import SkinPressure
from tactile_sensing.types.skin import Skin

ASSUMED_POISSON, POISSON_STD = 0.45, 0.1  # prior of Poisson's ratio, for a soft skin
PATCH, PATCH_STD = 0.5, 0.15  # prior of the radius of a patch over that of the ball
SHEAR = 0.1  # standard deviation of the shear over the force while the ball is pressed straight
# Spread of the gains until it is learnt; smallest spread of gains and forces [relative].
USUAL_SPREAD, LEAST_SPREAD = 0.1, 0.003
# Scatter until it is learnt; smallest scatter [share of the pressure].
USUAL_SCATTER, LEAST_SCATTER = 0.05, 1e-3
TAILS = 6.0  # degrees of freedom of the errors
LONGEST = 0.2  # largest step of the numbers of skin and patch
UPHILL = 1.0  # largest increase of chi-square by a step that is accepted
# Largest number of Gauss-Newton steps: of the last fit, and of each round that learns spreads.
MOST_STEPS, FEW_STEPS = 25, 8
ROUNDS = 3  # number of these rounds
SETTLED = 2e-3  # converged if a step is smaller [relative; pitches]
SAME_PLACE = 0.3  # consecutive frames less far apart show the same press [pitches]
UNLIKE = 3.0  # outlier: force off by more standard deviations, or misfit by this factor
SEEN = 10.0  # a tactel counts as loaded above this [standard deviations]
DEAD = 0.3  # a tactel is dead if it shows less than this share of the modelled load
KIND = 4  # numbers of skin and patch: log depth, depth over thickness, Poisson's ratio, patch
LEAST, MOST = (-np.inf, 0.0, 0.0, 0.05), (np.inf, 1.0, 0.5, 0.95)  # their bounds
OWN = 5  # numbers of a press: force and two shears, relative to the force; place in pitches
FIXED = 1e12  # prior information of a known number
DERIVATIVE = 1e-3, 1e-3, 5e-3, 1e-2, 1e-3  # steps for derivatives: skin (3), patch, place


@dataclass(frozen=True, eq=False)
class Unknowns:
    """Unknowns of the likelihood."""

    kind: np.ndarray  # (KIND,): skin and patch
    gain: np.ndarray  # (tactels,): relative sensitivity - 1
    offset: np.ndarray  # (tactels,) [counts]
    places: np.ndarray  # (N, 2) [m]
    forces: np.ndarray  # (N, 3): normal force and shear [counts m^2]
    level: np.ndarray  # (sources,): fitted force over known force [counts m^2 / N]


class Residuals(NamedTuple):
    """Models of the presses, and residuals with their weights."""

    relative: np.ndarray  # (N,): force over the usual one
    basis: np.ndarray  # (N, tactels, 3): pressure per normal force and shear
    model: np.ndarray  # (N, tactels)
    variance: np.ndarray  # (N, tactels)
    rest: np.ndarray  # (N, tactels + 3): residuals; the last 3: priors of shear (2) and force
    weight: np.ndarray  # (N, tactels + 3)


def skin_of(kind: np.ndarray) -> Skin:
    """Return the skin of the numbers (KIND,)."""
    depth, ratio = math.exp(kind[0]), min(max(kind[1], 0.0), 1.0)
    return Skin(depth, depth / ratio if ratio > 1e-3 else math.inf, min(max(kind[2], 0.0), 0.5))


def step_of(kind: np.ndarray, k: int) -> float:
    """Return the step for the derivative by number k of the kind, away from its bound."""
    return -DERIVATIVE[k] if kind[k] > MOST[k] - 0.01 else DERIVATIVE[k]


def expected_forces(found: np.ndarray, known: np.ndarray, source: np.ndarray,
                    variance: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """
    Return the expected forces of the presses (N,), and their standard deviations (N,).

    These are the `known` forces, scaled per source; `variance` is that of the `found` ones
    [relative]. A press that deviates too much keeps its fitted force, with infinite deviation.
    """
    expected = known.astype(float)
    for name in np.unique(source):
        own = source == name
        expected[own] *= np.median(found[own] / known[own])
    off = np.abs(found / expected - 1.0)
    spread = max(math.hypot(1.4826 * float(np.median(off)), variance**0.5), LEAST_SPREAD)
    like = off <= UNLIKE * spread
    return np.where(like, expected, found), np.where(like, spread * expected, np.inf)


class Likelihood:
    """Likelihood of presses, with its priors and the spreads that are learnt from a fit."""

    def __init__(self, presses: Presses, ball_radius: float, area: bool, offset_std: np.ndarray):
        array, self.presses, self.radius = presses.array, presses, ball_radius
        self.source = presses.source
        self.x, self.y = array.x, array.y[:, None]
        self.pitch = math.sqrt(array.pitch_x * array.pitch_y)
        self.size = (array.pitch_x, array.pitch_y) if area else (0.0, 0.0)
        flat = len(presses), -1
        self.values: np.ndarray = presses.values.reshape(flat)
        self.noise: np.ndarray = presses.noise.reshape(flat)
        self.floor = presses.floor.ravel()
        self.below = self.values <= self.floor
        self.usual = np.array([0.0, 0.0, ASSUMED_POISSON, PATCH])
        self.known = np.array([0.0, 1.0, POISSON_STD**-2, PATCH_STD**-2])
        self.spread, self.scatter = USUAL_SPREAD, USUAL_SCATTER
        self.shared = np.ones((len(presses), 1))
        self.force_std = np.full(len(presses), np.inf)
        self.offset_std = offset_std
        self.gone: np.ndarray = np.zeros(array.rows * array.columns, bool)
        self.groups = np.arange(len(presses))  # number of the press that each frame is of

    def at_peaks(self, kind: np.ndarray) -> Unknowns:
        """Return start values, with every press at its highest tactel."""
        array, count = self.presses.array, len(self.presses)
        row, column = np.unravel_index(
            np.nan_to_num(self.values, nan=-np.inf).argmax(axis=1), array.shape)
        none = np.zeros(self.values.shape[1])
        return Unknowns(kind, none, none,
                        np.stack([array.x[column], array.y[row]], -1), np.zeros((count, 3)),
                        np.ones(self.source.max() + 1))

    def basis(self, kind: np.ndarray, places: np.ndarray, level: np.ndarray) -> np.ndarray:
        """Return the pressure per unit of normal force and shear, (N, tactels, 3)."""
        skin = skin_of(kind)
        radius = np.minimum(kind[3] * self.radius * level**(1 / 3),  # Hertz' law
                            min(0.95 * self.radius, 1.4 * skin.depth))
        a, b, radius = (it[:, None, None] for it in (*places.T, radius))
        return SkinPressure(skin, *self.size).point_basis(
            self.x, self.y, a, b, radius).reshape(len(places), -1, 3)

    def left(self, unknowns: Unknowns,
             models: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the residuals (N, tactels) of models, their variances, and robust weights."""
        expected = (1.0 + unknowns.gain) * models
        variance = self.noise**2 + self.shared * (self.scatter * expected)**2
        expected = expected + unknowns.offset
        rest = np.nan_to_num(self.values) - expected
        if self.below.any():  # expected residual of a value below the floor
            z = (self.floor - expected) / self.noise
            rest = np.where(
                self.below, -self.noise * missing_mean(np.minimum(z, 30.0)), rest)
        tails = np.maximum((TAILS + rest**2 / variance) / (TAILS + 1.0), 1.0)
        return rest, variance, np.isfinite(self.values) / tails

    def solve_forces(self, unknowns: Unknowns, basis: np.ndarray) -> Unknowns:
        """Return the unknowns with the likeliest forces at their places."""
        forces = unknowns.forces
        for _ in range(2):
            rest, variance, weight = self.left(unknowns, np.einsum('ntk,nk->nt', basis, forces))
            seen = basis * (1.0 + unknowns.gain)[:, None]
            normal = np.einsum('ntk,nt,ntl->nkl', seen, weight / variance, seen)
            right = np.einsum('ntk,nt->nk', seen, weight / variance * rest)
            if forces.any():
                straight = (SHEAR * np.maximum(np.abs(forces[:, 0]), 1e-30))**-2.0
                info = np.stack([self.force_std**-2, straight, straight], -1)
                expected = np.zeros(forces.shape)
                expected[:, 0] = self.presses.force * unknowns.level[self.source]
                normal[:, range(3), range(3)] += info
                right += info * (expected - forces)
            forces = forces + np.linalg.solve(normal, right[..., None])[..., 0]
        least = 1e-3 * max(np.median(forces[:, 0]), 1e-30)
        forces[:, 0] = np.maximum(forces[:, 0], least)
        return replace(unknowns, forces=forces)

    def residuals(self, unknowns: Unknowns) -> tuple[Residuals, Unknowns]:
        """Return the residuals at the likeliest forces, and the unknowns with these forces."""
        force = unknowns.forces[:, 0]
        relative = np.clip(force / np.median(force), 0.05, 20.0) if force.any() else 1.0 + force
        basis = self.basis(unknowns.kind, unknowns.places, relative)
        unknowns = self.solve_forces(unknowns, basis)
        model = np.einsum('ntk,nk->nt', basis, unknowns.forces)
        rest, variance, weight = self.left(unknowns, model)
        force = unknowns.forces[:, 0]
        rest = np.column_stack([rest, -unknowns.forces[:, 1:] / force[:, None],
                                self.presses.force * unknowns.level[self.source] / force - 1.0])
        weight = np.column_stack([weight / variance, np.full((len(model), 2), SHEAR**-2),
                                  (force / self.force_std)**2])
        return Residuals(relative, basis, model, variance, rest, weight), unknowns

    def slopes(self, at: Residuals, unknowns: Unknowns) -> np.ndarray:
        """Return the derivatives of the models (N, tactels + 3, KIND + sources + OWN)."""
        (count, tactels), common = at.model.shape, KIND + len(unknowns.level)
        slope = np.zeros((count, tactels + 3, common + OWN))

        def moved(kind: np.ndarray, by: np.ndarray) -> np.ndarray:
            return np.einsum('ntk,nk->nt', self.basis(kind, unknowns.places + by, at.relative),
                             unknowns.forces) - at.model
        for k in np.flatnonzero(self.known < FIXED):
            step = step_of(unknowns.kind, k)
            slope[:, :tactels, k] = moved(
                unknowns.kind + step * np.eye(KIND)[k], np.zeros(2)) / step
        slope[:, :tactels, common:common + 3] = at.basis * unknowns.forces[:, :1, None]
        for k, by in enumerate(DERIVATIVE[KIND] * self.pitch * np.eye(2)):
            slope[:, :tactels, common + 3 + k] = moved(unknowns.kind, by) / DERIVATIVE[KIND]
        slope[:, :tactels] *= (1.0 + unknowns.gain)[:, None]
        slope[:, tactels:, common:common + 3] = [[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]]
        slope[range(count), -1, KIND + self.source] = -at.rest[:, -1] - 1.0
        return slope

    def jacobian(self, at: Residuals, unknowns: Unknowns) -> sparse.csr_matrix:
        """Return the derivatives of the models by all unknowns, in the order of `system`."""
        (count, tactels), common = at.model.shape, KIND + len(unknowns.level)
        slope = self.slopes(at, unknowns)
        # The readings of a tactel have the derivatives `model` by its gain and 1 by its offset.
        by_offset = sparse.kron(np.ones((count, 1)), sparse.eye(tactels + 3, tactels), 'csr')
        by_gain = by_offset.multiply(np.pad(at.model, ((0, 0), (0, 3))).reshape(-1, 1))
        return sparse.hstack([
            slope[..., :common].reshape(-1, common), sparse.block_diag(slope[..., common:]),
            by_gain, by_offset], 'csr')

    def system(self, unknowns: Unknowns) -> tuple[np.ndarray, np.ndarray, Unknowns]:
        """
        Return matrix and right side of the normal equations, and the unknowns with fitted forces.

        Their order is: the common numbers (KIND, levels), presses, gains and offsets.
        """
        at, unknowns = self.residuals(unknowns)
        (count, tactels), common = at.model.shape, KIND + len(unknowns.level)
        jacobian = self.jacobian(at, unknowns)
        weight = at.weight.ravel()
        matrix = (jacobian.T @ jacobian.multiply(weight[:, None])).toarray()
        prior = np.concatenate([self.known, np.full(common - KIND, 1e-9), np.zeros(OWN * count),
                                np.full(tactels, self.spread**-2), self.offset_std**-2.0])
        off = np.zeros(len(prior))
        off[:KIND] = np.where(self.known < FIXED, unknowns.kind - self.usual, 0.0)
        off[-2 * tactels:] = *unknowns.gain, *unknowns.offset
        return (matrix + np.diag(prior),
                jacobian.T @ (weight * at.rest.ravel()) - prior * off, unknowns)

    def chi(self, unknowns: Unknowns) -> float:
        """Return -2 times the log posterior, up to a constant."""
        at, unknowns = self.residuals(unknowns)
        tactels = at.model.shape[1]
        square = at.rest[:, :tactels]**2 / at.variance
        tails = 1.0 + (TAILS + 1.0) * np.log(np.maximum((TAILS + square) / (TAILS + 1.0), 1.0))
        off = (unknowns.kind - self.usual)[self.known < FIXED]
        return ((np.where(square < 1.0, square, tails) + np.log(at.variance))[
            np.isfinite(self.values)].sum()
                + (at.weight * at.rest**2)[:, tactels:].sum()
                + (unknowns.gain**2).sum() / self.spread**2
                + ((unknowns.offset / self.offset_std)**2).sum()
                + (self.known[self.known < FIXED] * off**2).sum())

    def step(self, unknowns: Unknowns, longest: float) -> tuple[Unknowns, np.ndarray]:
        """Return the unknowns after a Gauss-Newton step; the unlimited step of kind and places."""
        matrix, right, fitted = self.system(unknowns)
        move = np.linalg.solve(matrix, right)
        wanted, common = move[:KIND].copy(), KIND + len(unknowns.level)
        part = min(1.0, longest / max(np.abs(wanted).max(), 1e-12))
        move *= part
        own, gain, offset = np.split(move[common:], (OWN * len(self.values), -len(unknowns.gain)))
        places = np.clip(own.reshape(-1, OWN)[:, 3:], -0.5, 0.5)
        return Unknowns(
            np.clip(unknowns.kind + move[:KIND], LEAST, MOST),
            np.clip(unknowns.gain + gain, -0.7, 2.0), unknowns.offset + offset,
            unknowns.places + places * self.pitch, fitted.forces,
            unknowns.level * np.exp(move[KIND:common])), np.append(wanted, places.ravel())

    def iterate(self, unknowns: Unknowns, steps: int = MOST_STEPS) -> Unknowns:
        """Take Gauss-Newton steps that decrease `chi`, until they converge."""
        longest, chi = LONGEST, self.chi(unknowns)
        for _ in range(steps):
            moved, move = self.step(unknowns, longest)
            below = self.chi(moved)
            if below > chi + UPHILL:
                longest = 0.3 * min(longest, np.abs(move[:KIND]).max())
                if longest < SETTLED:
                    break
                continue
            unknowns, chi, longest = moved, below, min(2.0 * longest, LONGEST)
            if np.abs(move).max() < SETTLED:
                break
        return unknowns

    def learn(self, unknowns: Unknowns) -> Unknowns:
        """Estimate spread of gains, scatter and expected forces from a fit; return new levels."""
        at, unknowns = self.residuals(unknowns)
        model, tactels = at.model, at.model.shape[1]
        covariance = np.linalg.inv(self.system(unknowns)[0])
        variance = np.diag(covariance)[-2 * tactels:-tactels]
        determined = max(tactels - (variance / self.spread**2).sum(), 1.0)
        self.spread = min(max(math.sqrt((unknowns.gain**2).sum() / determined), LEAST_SPREAD), 0.5)
        strong = (model > 0.03 * model.max(axis=1, keepdims=True)) & np.isfinite(self.values)
        free = self._left_free(at, unknowns, strong, covariance)
        rest = (at.weight[:, :tactels] * at.variance)[strong] * at.rest[:, :tactels][strong]**2
        excess = (rest - free * self.noise[strong]**2).sum() / (free * model[strong]**2).sum()
        self.scatter = max(excess, LEAST_SCATTER**2)**0.5
        # Consecutive frames at one place belong to one press.
        moved = np.hypot(*np.diff(unknowns.places, axis=0).T) > SAME_PLACE * self.pitch
        self.groups = np.concatenate([[0], np.cumsum(moved)])
        self.shared = np.bincount(self.groups)[self.groups][:, None].astype(float)
        common = KIND + len(unknowns.level)
        by_chance = np.median(np.diag(covariance)[common:-2 * tactels:OWN]) if np.isfinite(
            self.force_std).any() else 0.0
        expected, self.force_std = expected_forces(
            unknowns.forces[:, 0], self.presses.force, self.source, by_chance)
        level = [np.median((expected / self.presses.force)[self.source == k])
                 for k in range(len(unknowns.level))]
        return replace(unknowns, level=np.array(level))

    def _left_free(self, at: Residuals, unknowns: Unknowns, readings: np.ndarray,
                   covariance: np.ndarray) -> np.ndarray:
        """Return the share of each reading's variance that the fit leaves: 1 - its leverage."""
        jacobian, free = self.jacobian(at, unknowns), np.ones(readings.shape)
        for k, seen in enumerate(readings):
            first = k * (len(seen) + 3)  # its priors follow the readings of a press
            rows = jacobian[first:first + len(seen)][seen]
            own = np.unique(rows.indices)
            slope = rows[:, own].toarray()
            free[k, seen] -= at.weight[k, :len(seen)][seen] * (
                slope @ covariance[np.ix_(own, own)] * slope).sum(axis=1)
        return np.maximum(free[readings], 0.0)

    def settle(self, unknowns: Unknowns) -> Unknowns:
        """Fit the unknowns; learn the spreads and exclude dead tactels meanwhile."""
        for _ in range(ROUNDS):
            unknowns = self.iterate(unknowns, FEW_STEPS)
            model = self.residuals(unknowns)[0].model
            load = np.where(np.isfinite(self.values), model, 0.0) / self.noise
            power = (load**2).sum(axis=0)
            follows = (load * np.nan_to_num(self.values) / self.noise).sum(axis=0)
            self.gone |= (power > SEEN**2) & (follows < DEAD * power)
            self.values = np.where(self.gone, np.nan, self.values)
            unknowns = self.learn(unknowns)
        return self.iterate(unknowns)
