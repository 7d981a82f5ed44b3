"""
One likelihood of all presses of a ball: the skin and the gains of the tactels are the unknowns.

A tactel reads (1 + g) m and noise, m the pressure of a press under the skin. All presses share the
skin, the patch of the ball at the usual force, and the sensitivity 1 + g of every tactel; each has
a place, a force, and shear. Gauss and Newton's steps are of all of them together; the gains, whose
block is diagonal, are eliminated. What the model misses is in proportion to the load: the variance
of a reading is noise^2 + n (scatter m)^2, so that n frames of one press share one error. Tails are
those of Student's t. Spread of the gains, scatter and spread of the forces follow from the fit.
"""

from dataclasses import dataclass, replace
import math

import numpy as np

from tactile_sensing.calibration.presses import Presses
from tactile_sensing.devices.unloaded import missing_mean
from tactile_sensing.skin.pressure import SkinPressure
from tactile_sensing.types.skin import Skin

ASSUMED_POISSON, POISSON_STD = 0.45, 0.1  # of a soft skin, before the presses tell it
PATCH, PATCH_STD = 0.5, 0.15  # likewise radius of a patch over that of the ball
SHEAR = 0.1  # of the force: standard deviation while the ball is pressed straight
SPREAD, LEAST_SPREAD = 0.1, 0.003  # of gains: usual before the fit, least that is looked for
SCATTER, LEAST_SCATTER = 0.05, 1e-3  # of the pressure: likewise what the model misses
TAILS = 6.0  # degrees of freedom
LONGEST, UPHILL = 0.2, 1.0  # step of the numbers of the skin; chi-square that one may add
SETTLED = 2e-3  # relative, and in pitches: a shorter step is the last
STEPS, FEW, ROUNDS = 25, 8, 3  # of the fit; of those before the last; of the spreads by it
SAME_PLACE = 0.3  # pitches between frames in turn of one press
UNLIKE = 3.0  # standard deviations at which a press is of another weight, times the usual misfit
DEAD = 0.3  # of the expected reading, less than which a tactel does not follow the load
SEEN = 10.0  # standard deviations of load that show it
KIND = 4  # numbers of skin and patch: log depth, depth over thickness, Poisson's ratio, patch
OWN = 5  # of a press: force and shear over the force, place in pitches
FIXED = 1e12  # information on a number that is known
DERIVATIVE = 1e-3, 1e-3, 5e-3, 1e-2, 1e-3  # steps for derivatives: skin, patch, place


@dataclass(frozen=True, eq=False)
class Unknowns:
    """What the likelihood depends on."""

    kind: np.ndarray  # (KIND,)
    gain: np.ndarray  # (tactels,): sensitivity over the usual one, less 1
    offset: np.ndarray  # (tactels,): what the unloaded pad reads beside what was found [counts]
    places: np.ndarray  # (N, 2) [m]
    forces: np.ndarray  # (N, 3): normal force and shear [counts m^2]
    level: np.ndarray  # (sources,) of forces over those told [counts m^2 / N]


def skin_of(kind: np.ndarray) -> Skin:
    """Skin of the numbers."""
    depth, ratio = math.exp(kind[0]), min(max(kind[1], 0.0), 1.0)
    return Skin(depth, depth / ratio if ratio > 1e-3 else math.inf, min(max(kind[2], 0.0), 0.5))


def expected_forces(found: np.ndarray, told: np.ndarray, source: np.ndarray,
                    variance: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """
    Return the forces that presses are expected to have (N,), and their standard deviations (N,).

    That is what is known of them relative to each other, `told`, at the level of those found of
    the same source and with the spread of all, beside the relative variance with which they are
    found; a press that is unlike the others keeps its own.
    """
    expected = told.astype(float)
    for name in np.unique(source):
        own = source == name
        expected[own] *= np.median(found[own] / told[own])
    off = np.abs(found / expected - 1.0)
    spread = max(math.hypot(1.4826 * float(np.median(off)), variance**0.5), LEAST_SPREAD)
    like = off <= UNLIKE * spread
    return np.where(like, expected, found), np.where(like, spread * expected, np.inf)


class Likelihood:
    """Presses, what is known beforehand, and what follows from a fit: its spreads."""

    def __init__(self, presses: Presses, ball_radius: float, area: bool, told: np.ndarray,
                 source: np.ndarray, offset_std: np.ndarray):
        array = presses.array
        self.presses, self.radius, self.told, self.source = presses, ball_radius, told, source
        self.x, self.y = array.x, array.y[:, None]
        self.pitch = math.sqrt(array.pitch_x * array.pitch_y)
        self.size = (array.pitch_x, array.pitch_y) if area else (0.0, 0.0)
        flat = len(presses), -1
        self.values: np.ndarray = presses.values.reshape(flat)
        self.noise: np.ndarray = presses.noise.reshape(flat)
        self.below = self.values <= presses.floor.ravel()
        self.usual = np.array([0.0, 0.0, ASSUMED_POISSON, PATCH])
        self.known = np.array([0.0, 1.0, POISSON_STD**-2, PATCH_STD**-2])
        self.spread, self.scatter, self.shared = SPREAD, SCATTER, np.ones((len(presses), 1))
        self.force_std = np.full(len(presses), np.inf)
        self.offset_std = offset_std
        self.gone: np.ndarray = np.zeros(array.rows * array.columns, bool)

    def at_peaks(self, kind: np.ndarray) -> Unknowns:
        """Unknowns with every press at its highest tactel."""
        array, count = self.presses.array, len(self.presses)
        row, column = np.unravel_index(
            np.nan_to_num(self.values, nan=-np.inf).argmax(axis=1), array.shape)
        return Unknowns(kind, np.zeros(self.values.shape[1]),
                        np.zeros(self.values.shape[1]),
                        np.stack([array.x[column], array.y[row]], -1), np.zeros((count, 3)),
                        np.ones(self.source.max() + 1))

    def basis(self, kind, places, level):
        """Pressure by normal force and shear, (N, tactels, 3)."""
        skin = skin_of(kind)
        radius = np.minimum(kind[3] * self.radius * level**(1 / 3),  # Hertz' law
                            min(0.95 * self.radius, 1.4 * skin.depth))
        a, b, radius = (it[:, None, None] for it in (*places.T, radius))
        return SkinPressure(skin, *self.size).point_basis(
            self.x, self.y, a, b, radius).reshape(len(places), -1, 3)

    def left(self, unknowns, models):
        """What models leave of the values, its variance, and the weight of its tails."""
        expected = (1.0 + unknowns.gain) * models
        variance = self.noise**2 + self.shared * (self.scatter * expected)**2
        expected = expected + unknowns.offset
        rest = np.nan_to_num(self.values) - expected
        if self.below.any():  # as the model expects it there
            z = (self.presses.floor.ravel() - expected) / self.noise
            rest = np.where(
                self.below, -self.noise * missing_mean(np.minimum(z, 30.0)), rest)
        tails = np.maximum((TAILS + rest**2 / variance) / (TAILS + 1.0), 1.0)
        return rest, variance, np.isfinite(self.values) / tails

    def solve_forces(self, unknowns, basis):
        """Likeliest forces of given places."""
        forces = unknowns.forces
        for _ in range(2):
            rest, variance, weight = self.left(unknowns, np.einsum('ntk,nk->nt', basis, forces))
            seen = basis * (1.0 + unknowns.gain)[:, None]
            normal = np.einsum('ntk,nt,ntl->nkl', seen, weight / variance, seen)
            right = np.einsum('ntk,nt->nk', seen, weight / variance * rest)
            straight = (SHEAR * np.maximum(np.abs(forces[:, 0]), 1e-30))**-2.0
            if forces.any():
                normal[:, (1, 2), (1, 2)] += straight[:, None]
                right[:, 1:] -= straight[:, None] * forces[:, 1:]
                info = self.force_std**-2
                normal[:, 0, 0] += info
                right[:, 0] += info * (self.told * unknowns.level[self.source] - forces[:, 0])
            forces = forces + np.linalg.solve(normal, right[..., None])[..., 0]
        least = 1e-3 * max(np.median(forces[:, 0]), 1e-30)
        forces[:, 0] = np.maximum(forces[:, 0], least)
        return replace(unknowns, forces=forces)

    def residuals(self, unknowns):
        """
        Models (N, tactels), what they and the expectations leave and its weight, forces that fit.

        Three more columns say that the ball is pressed straight, with a force as it is told. Last
        come the unknowns with their forces, the basis (N, tactels, 3) and the level of each press.
        """
        force = unknowns.forces[:, 0]
        level = np.clip(force / np.median(force), 0.05, 20.0) if force.any() else 1.0 + force
        basis = self.basis(unknowns.kind, unknowns.places, level)
        unknowns = self.solve_forces(unknowns, basis)
        here = np.einsum('ntk,nk->nt', basis, unknowns.forces)
        rest, variance, weight = self.left(unknowns, here)
        force = unknowns.forces[:, 0]
        expected = self.told * unknowns.level[self.source] / force
        tilt = unknowns.forces[:, 1:] / force[:, None]
        rest = np.column_stack([rest, -tilt, expected - 1.0])
        weight = np.column_stack([weight / variance, np.full((len(here), 2), SHEAR**-2),
                                  (force / self.force_std)**2])
        return here, rest, weight, unknowns, basis, level

    def slopes(self, unknowns):
        """
        Models, rest, weight, slopes (N, tactels + 3, parameters), and forces that fit.

        Slopes are of the KIND numbers, the logarithms of the levels, and the OWN numbers of a
        press.
        """
        here, rest, weight, unknowns, basis, level = self.residuals(unknowns)

        def model(kind=unknowns.kind, dx=0.0, dy=0.0):
            return np.einsum('ntk,nk->nt', self.basis(
                kind, unknowns.places + np.array([dx, dy]), level), unknowns.forces)
        d, force = DERIVATIVE[KIND], unknowns.forces[:, 0]
        (count, tactels), common = here.shape, KIND + len(unknowns.level)
        slope = np.zeros((count, tactels + 3, common + OWN))
        for k in np.flatnonzero(self.known < FIXED):
            back = unknowns.kind[k] > (np.inf, 0.99, 0.49, np.inf)[k]
            step = -DERIVATIVE[k] if back else DERIVATIVE[k]
            slope[:, :tactels, k] = (model(unknowns.kind + step * np.eye(KIND)[k]) - here) / step
        slope[:, :tactels, common:common + 3] = basis * force[:, None, None]
        for k, moved in enumerate((model(dx=d * self.pitch), model(dy=d * self.pitch))):
            slope[:, :tactels, common + 3 + k] = (moved - here) / d
        slope[:, :tactels] *= (1.0 + unknowns.gain)[:, None]
        slope[:, tactels:, common:common + 3] = [[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]]
        slope[range(count), -1, KIND + self.source] = -rest[:, -1] - 1.0
        return here, rest, weight, slope, unknowns

    def system(self, unknowns):
        """
        Normal equations about the unknowns, whose forces are those that fit.

        Returns
        -------
        matrix, right : ndarray
            Of the common numbers (KIND, levels) and those of every press.
        cross, own, by_gain : ndarray
            Of the gains: with the others, diagonal, and right side.
        unknowns : Unknowns
        """
        here, rest, weight, slope, unknowns = self.slopes(unknowns)
        (count, tactels), common = here.shape, KIND + len(unknowns.level)
        shared, each = slope[..., :common], slope[..., common:]
        size = common + OWN * count
        matrix, right = np.zeros((size, size)), np.zeros(size)
        matrix[:common, :common] = np.einsum('ntk,nt,ntl->kl', shared, weight, shared,
                                             optimize=True)
        matrix[:common, common:] = np.einsum('ntk,nt,ntl->knl', shared, weight, each,
                                             optimize=True).reshape(common, -1)
        matrix[common:, :common] = matrix[:common, common:].T
        blocks = np.einsum('ntk,nt,ntl->nkl', each, weight, each, optimize=True)
        at = common + np.arange(OWN * count).reshape(count, OWN)
        matrix[at[:, :, None], at[:, None, :]] = blocks
        right[:common] = np.einsum('ntk,nt,nt->k', shared, weight, rest, optimize=True)
        right[common:] = np.einsum('ntk,nt,nt->nk', each, weight, rest, optimize=True).ravel()
        matrix[range(KIND), range(KIND)] += self.known
        matrix[range(KIND, common), range(KIND, common)] += 1e-9
        right[:KIND] -= np.where(
            self.known < FIXED, self.known * (unknowns.kind - self.usual), 0.0)
        lever = here * weight[:, :tactels]
        def of_tactels(lever):
            return np.concatenate([
                np.einsum('nt,ntk->tk', lever, shared[:, :tactels]),
                (lever[..., None] * each[:, :tactels]).transpose(1, 0, 2).reshape(tactels, -1)], 1)
        cross, cross_offset = of_tactels(lever), of_tactels(weight[:, :tactels])
        own = (lever * here).sum(axis=0) + self.spread**-2
        by_gain = (lever * rest[:, :tactels]).sum(axis=0) - unknowns.gain / self.spread**2
        # Offsets go first: they are as uncertain as the unloaded frames leave them.
        certain = weight[:, :tactels].sum(axis=0) + self.offset_std**-2.0
        share, both = cross_offset / certain[:, None], lever.sum(axis=0)
        by_offset = (weight * rest)[:, :tactels].sum(axis=0) - unknowns.offset / self.offset_std**2
        self.offsets = by_offset / certain, both / certain, share
        return (matrix - cross_offset.T @ share, right - share.T @ by_offset,
                cross - both[:, None] * share, own - both**2 / certain,
                by_gain - both * by_offset / certain, unknowns)

    def chi(self, unknowns: Unknowns) -> float:
        """Return twice the negative logarithm of the posterior, but for a constant."""
        here, rest, weight, unknowns, _, _ = self.residuals(unknowns)
        tactels = here.shape[1]
        _, variance, _ = self.left(unknowns, here)
        square = rest[:, :tactels]**2 / variance
        tails = 1.0 + (TAILS + 1.0) * np.log(np.maximum((TAILS + square) / (TAILS + 1.0), 1.0))
        off = (unknowns.kind - self.usual)[self.known < FIXED]
        return ((np.where(square < 1.0, square, tails) + np.log(variance))[
            np.isfinite(self.values)].sum()
                + (weight * rest**2)[:, tactels:].sum()
                + (unknowns.gain**2).sum() / self.spread**2
                + ((unknowns.offset / self.offset_std)**2).sum()
                + (self.known[self.known < FIXED] * off**2).sum())

    def step(self, unknowns: Unknowns, longest: float) -> tuple[Unknowns, np.ndarray]:
        """Return the unknowns after a step of Gauss and Newton, and what it wanted of the kind."""
        matrix, right, cross, own, by_gain, unknowns = self.system(unknowns)
        share = cross / own[:, None]
        move = np.linalg.solve(matrix - cross.T @ share, right - share.T @ by_gain)
        wanted, common = move[:KIND].copy(), KIND + len(unknowns.level)
        part = min(1.0, longest / max(np.abs(wanted).max(), 1e-12))
        move *= part
        places = np.clip(move[common:].reshape(-1, OWN)[:, 3:], -0.5, 0.5)
        kind = np.clip(unknowns.kind + move[:KIND], [-np.inf, 0.0, 0.0, 0.05],
                       [np.inf, 1.0, 0.5, 0.95])
        gain = np.clip(unknowns.gain + part * by_gain / own - share @ move, -0.7, 2.0)
        plain, by_gains, by_others = self.offsets
        offset = unknowns.offset + (
            part * plain - by_gains * (gain - unknowns.gain) - by_others @ move)
        return Unknowns(
            kind, gain, offset,
            unknowns.places + places * self.pitch, unknowns.forces,
            unknowns.level * np.exp(move[KIND:common])), np.append(wanted, places.ravel())

    def iterate(self, unknowns: Unknowns, steps: int = STEPS) -> Unknowns:
        """Step downhill until nothing moves."""
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

    def inverse(self, unknowns):
        """Covariance of all but the gains, how these follow, and their own information."""
        matrix, _, cross, own, _, unknowns = self.system(unknowns)
        share = cross / own[:, None]
        return np.linalg.inv(matrix - cross.T @ share), share, own, unknowns

    def learn(self, unknowns: Unknowns) -> Unknowns:
        """Set spread of gains, scatter, and what is expected of forces by what a fit leaves."""
        here, rest, weight, unknowns, _, _ = self.residuals(unknowns)
        inverse, share, own, _ = self.inverse(unknowns)
        variance = 1.0 / own + np.einsum('tk,kl,tl->t', share, inverse, share, optimize=True)
        told = max(len(variance) - (variance / self.spread**2).sum(), 1.0)
        self.spread = min(max(math.sqrt((unknowns.gain**2).sum() / told), LEAST_SPREAD), 0.5)
        strong = (here > 0.03 * here.max(axis=1, keepdims=True)) & np.isfinite(self.values)
        tails = (weight[:, :here.shape[1]] * self.left(unknowns, here)[1])[strong]
        # Of the readings, gains and presses take up as many as they are.
        free = max(1.0 - (told + OWN * len(here)) / strong.sum(), 0.2)
        excess = np.mean(tails * rest[:, :here.shape[1]][strong]**2 / free
                         - self.noise[strong]**2) / np.mean(here[strong]**2)
        self.scatter = math.sqrt(max(excess, LEAST_SCATTER**2))
        moved = np.hypot(*np.diff(unknowns.places, axis=0).T) > SAME_PLACE * self.pitch
        self.groups = np.concatenate([[0], np.cumsum(moved)])
        self.shared = np.bincount(self.groups)[self.groups][:, None].astype(float)
        common = KIND + len(unknowns.level)
        by_chance = np.median(np.diag(inverse)[common::OWN]) if np.isfinite(
            self.force_std).any() else 0.0
        expected, self.force_std = expected_forces(
            unknowns.forces[:, 0], self.told, self.source, by_chance)
        level = [np.median((expected / self.told)[self.source == k])
                 for k in range(len(unknowns.level))]
        return replace(unknowns, level=np.array(level))

    def dead(self, unknowns: Unknowns) -> np.ndarray:
        """Which tactels do not follow the load that presses around them make, bool."""
        here = self.residuals(unknowns)[0]
        values = np.nan_to_num(self.values)
        load = np.where(np.isfinite(self.values), here, 0.0) / self.noise
        power, follows = (load**2).sum(axis=0), (load * values / self.noise).sum(axis=0)
        return (power > SEEN**2) & (follows < DEAD * power)

    def hold(self, *numbers: int) -> None:
        """Fix numbers of the kind at what is usual."""
        self.known[list(numbers)] = FIXED

    def settle(self, unknowns: Unknowns) -> Unknowns:
        """Fit, with the spreads that follow from it and without the tactels that are dead."""
        for _ in range(ROUNDS):
            unknowns = self.iterate(unknowns, FEW)
            self.gone |= self.dead(unknowns)
            self.values = np.where(self.gone, np.nan, self.values)
            unknowns = self.learn(unknowns)
        return self.iterate(unknowns)

    def only(self, count: int) -> 'Likelihood':
        """Return the likelihood of the first presses."""
        return Likelihood(self.presses.only(np.arange(min(len(self.presses), count))),
                          self.radius, self.size[0] > 0.0, self.told[:count], self.source[:count],
                          self.offset_std)
