"""Residual of a fitted load: error of the model, patch and second load; compiled."""

import math

import numpy as np

from tactile_common.kernels import FAST, njit
from tactile_sensing.contact.errors import SANDWICH
from tactile_sensing.contact.records import Beliefs, Fit, Misfit, Readings, Residual
from tactile_sensing.image import without_spikes
from tactile_sensing.skin.bumps import LINE, P, Pad
from tactile_sensing.skin.kernel import MAX_VARIANCE

LOADED = 0.02  # share of the peak from which a tactel is examined for an error of the model
ALLOWED, LARGEST = 0.1, 0.5  # prior standard deviation of d; largest d^2
UNSEEN = 0.0, 0.05  # d where the residual does not show it: sharp load on a known skin, others
TURNED = 0.5  # RMS of a part of the error that grows linearly along a line, relative to d
LOUD = 4.5  # a larger error of a tactel is not noise [standard deviations]
AWAY = 0.1  # share of the peak below which a tactel is away from the load
HALF_WIDTH = 0.64  # half width at half height of a line on a half-space [depths]
PATCHES = 90  # integration steps over the variance of a patch
BINS = 4  # per correlation length, across or along a line
TAPER_SHOWN = 2.0, 0.1  # a larger taper is fitted [standard deviations; share of the force]


@njit(error_model='numpy')
def residual_of(fit: Fit, readings: Readings) -> Residual:
    """Return the sizes of the errors that a fit leaves."""
    noise2, silent, loudest, loud = readings.noise2, 0, 0.0, 0.0
    squared = kept = lit = beyond = power = by_noise = total = above = 0.0
    least = LOADED * fit.model.max()
    for t in range(fit.model.size):
        total += max(fit.model[t], 0.0)
        above += max(fit.model[t] - readings.full[t], 0.0)
        if fit.weight[t] > 0.0:
            ratio = fit.error[t] ** 2 / fit.variance[t]
            loudest, kept = max(loudest, ratio), kept + 1.0
            if fit.model[t] ** 2 > LOUD ** 2 * noise2[t]:
                squared, lit = squared + ratio, lit + 1.0
            by_noise += fit.error[t] ** 2 / noise2[t]
            power += fit.model[t] ** 2
            if ratio < LOUD ** 2:
                beyond += fit.error[t] ** 2 - noise2[t]
            else:
                loud += abs(fit.error[t]) > least
        elif fit.kept[t]:  # a dead tactel is no error of the model
            silent, kept, loud = silent + 1, kept + 1.0, loud + 1.0
    free = max(lit - fit.rows.shape[0], 1.0)
    return Residual(
        math.sqrt(loudest), loud / max(kept, 1.0), (squared - free) / math.sqrt(2.0 * free),
        math.sqrt(by_noise / max(kept, 1.0)),
        math.sqrt(max(beyond, 0.0) / max(power, 1e-300)), above / max(total, 1e-300), silent)


@njit(error_model='numpy', fastmath=FAST)
def _smooth_line(place: np.ndarray, width: float, values: np.ndarray) -> None:
    """Smooth values (n, count) over places (count,) by a Gaussian, with bins; in place."""
    low, step, reach = place.min(), width / BINS, 3 * BINS
    count = int((place.max() - low) / step) + 2
    bins, smooth = np.empty(count + 2 * reach), np.empty(count)
    kernel = np.exp(-0.5 * (np.arange(-reach, reach + 1) / BINS) ** 2)
    bin_of = ((place - low) / step).astype(np.int64)
    part = (place - low) / step - bin_of
    for k in range(values.shape[0]):
        bins[:] = 0.0
        for i in range(place.size):
            bins[reach + bin_of[i]] += values[k, i] * (1.0 - part[i])
            bins[reach + bin_of[i] + 1] += values[k, i] * part[i]
        for b in range(count):
            smooth[b] = kernel @ bins[b:b + kernel.size]
        values[k] = smooth[bin_of] * (1.0 - part) + smooth[bin_of + 1] * part


@njit(error_model='numpy', fastmath=FAST)
def _smooth_plane(x: np.ndarray, y: np.ndarray, width: float, values: np.ndarray,
                  first: int) -> None:
    """Smooth values (n, tactels) of a layer, from a tactel on, by a Gaussian; in place."""
    rows, columns = y.size, x.size
    over_x = np.exp(-0.5 * ((x - x.reshape(-1, 1)) / width) ** 2)
    over_y = np.exp(-0.5 * ((y - y.reshape(-1, 1)) / width) ** 2)
    for k in range(values.shape[0]):
        layer = values[k, first:first + rows * columns].copy().reshape(rows, columns)
        values[k, first:first + rows * columns] = (over_y @ layer @ over_x).ravel()


@njit(error_model='numpy')
def _places(pad: Pad, tactels: int, angle: float) -> np.ndarray:
    """Return places of the tactels along a direction [m], shape (tactels,)."""
    place = np.empty((tactels // (pad.x.size * pad.y.size), pad.y.size, pad.x.size))
    place[:] = (pad.y * math.sin(angle)).reshape(-1, 1) + pad.x * math.cos(angle)
    return place.ravel()


@njit(error_model='numpy', fastmath=FAST)
def _passed_on(kind: int, pad: Pad, moves: np.ndarray, basis: np.ndarray, place: np.ndarray,
               correlation: float) -> tuple[np.ndarray, np.ndarray]:
    """
    Propagate an error of the model to the parameters; return Q K / d^2 and Q K Q' / d^2.

    Q is `moves` (n, tactels), the change of the parameters by an error. The error has the
    covariance K_ij = d^2 b_i b_j rho_ij, where b is `basis` (tactels,), 0 where tactels are not
    loaded, and rho falls with the distance of two tactels; for a line, with that of `place`.
    """
    size = pad.x.size * pad.y.size
    moved = moves * basis
    if kind == LINE:
        _smooth_line(place, correlation, moved)
    else:
        for layer in range(basis.size // size):
            _smooth_plane(pad.x, pad.y, correlation, moved, layer * size)
    moved *= basis
    return moved, moved @ moves.T


@njit(error_model='numpy', fastmath=FAST)
def _agreement(kind: int, pad: Pad, fit: Fit, rows: np.ndarray, answer: np.ndarray,
               correlation: float, loaded: np.ndarray, moved: np.ndarray,
               both: np.ndarray) -> tuple[float, float, float]:
    """
    Measure how far the errors of neighbouring tactels agree.

    Returns the weighted sum of products of neighbours' errors, less its expectation under noise
    after a fit; the standard deviation of this sum under noise; and its expectation for d = 1.
    """
    n, tactels = rows.shape
    columns, size = pad.x.size, pad.x.size * pad.y.size
    by_model, root = moved - 0.5 * (both @ rows), np.sqrt(fit.weight) * loaded
    common, passed = np.empty(tactels), np.empty(tactels)
    agreed = expected = pairs = 0.0
    for side in range(2):
        step, ahead = 0.0, 1 if side == 0 else columns
        if side == 0 and columns > 1:
            step = pad.x[1] - pad.x[0]
        elif side == 1 and pad.y.size > 1:
            step = pad.y[1] - pad.y[0]
        if kind == LINE:
            step *= math.cos(fit.theta[P.Q1]) if side == 0 else math.sin(fit.theta[P.Q1])
        rho = math.exp(-0.5 * (step / correlation) ** 2)
        count = tactels - ahead
        for i in range(count):
            common[i], passed[i] = rho * fit.model[i] * fit.model[i + ahead], 0.0
        for k in range(n):
            for i in range(count):
                j = i + ahead
                common[i] -= rows[k, i] * by_model[k, j] + rows[k, j] * by_model[k, i]
                passed[i] += rows[k, i] * answer[k, j]
        for first in range(0, tactels, columns):
            last = first + columns - 1 + side
            if side == 1 and (first + columns) % size == 0:  # no neighbour
                last = first
            for i in range(first, last):
                weight = 2.0 * root[i] * root[i + ahead]
                agreed += weight * (fit.error[i] * fit.error[i + ahead] + passed[i])
                expected += weight * common[i]
                pairs += weight > 0.0
    return agreed, 2.0 * math.sqrt(pairs), expected


@njit(error_model='numpy')
def _by_gains(fit: Fit, beliefs: Beliefs) -> np.ndarray:
    """Return the additional covariance if the gains scatter more than the fit assumed."""
    more = max(fit.scatter ** 2 - beliefs.known ** 2, 0.0)
    scaled = fit.inverse @ (fit.rows * (fit.weight * fit.model))
    return more * (scaled @ scaled.T)


@njit(error_model='numpy', fastmath=FAST)
def _one_more(fit: Fit, by: np.ndarray) -> tuple[float, float, np.ndarray]:
    """
    Estimate a parameter that was not fitted from the residual, with derivatives `by` (tactels,).

    Returns its value, its standard deviation (0 if it is not determined), and the changes of the
    fitted parameters with it, shape (n,).
    """
    weighted = fit.weight * by
    coupled = fit.rows @ weighted
    slope, right = -(fit.inverse @ coupled), (weighted * fit.error).sum()
    own = (weighted * by).sum() + (slope * coupled).sum()
    if not own > 0.0:
        return 0.0, 0.0, slope
    return right / own, 1.0 / math.sqrt(own), slope


@njit(error_model='numpy')
def shows_taper(fit: Fit) -> bool:
    """Return whether the residual of a line shows that its force grows along it."""
    mean, deviation, _ = _one_more(fit, fit.by[P.TAPER])
    least, share = TAPER_SHOWN
    return abs(mean) > max(least * deviation, share * fit.theta[P.FORCE])


@njit(error_model='numpy')
def _hidden_patch(fit: Fit, covariance: np.ndarray) -> float:
    """
    Return the probability that a sharp load has a patch; add its effect to the covariance.

    Prior of the variance of the patch: 0 with probability 1/2, else uniform up to MAX_VARIANCE.
    """
    mean, deviation, slope = _one_more(fit, fit.by[P.WIDTH])
    if deviation == 0.0:
        return 0.0
    total = squared = 0.0
    for i in range(PATCHES):
        variance = MAX_VARIANCE * (i + 0.5) / PATCHES
        likely = math.exp(min(0.5 * (mean ** 2 - (variance - mean) ** 2) / deviation ** 2, 600.0))
        total += likely / PATCHES
        squared += likely * variance * variance / PATCHES
    for i in range(slope.size):
        for j in range(slope.size):
            covariance[i, j] += squared / (1.0 + total) * slope[i] * slope[j]
    return total / (1.0 + total)


@njit(error_model='numpy')
def _apart(pad: Pad, fit: Fit, peak: float) -> float:
    """Return `Misfit.apart`; the fit treats a second load as outliers. One tactel is no load."""
    over = (fit.error - LOUD * np.sqrt(fit.variance)) * (fit.weight > 0.0)
    over = over[:pad.y.size * pad.x.size].copy().reshape(pad.y.size, pad.x.size)
    apart, highest = 0.0, without_spikes(over).ravel()
    for t in range(highest.size):
        if fit.model[t] < AWAY * peak:
            apart = max(apart, highest[t] / peak)
    return apart


@njit(error_model='numpy')
def _unseen_middle(pad: Pad, fit: Fit, readings: Readings, beliefs: Beliefs,
                   covariance: np.ndarray) -> None:
    """
    Add to a covariance (n, n) the uncertainty of place and force due to saturated tactels.

    Two visible flanks determine the middle of a load. If only one is visible, for instance near
    the rim of the pad, the middle may be anywhere on the saturated tactels, and the load may be
    as much wider. Let the flanks give the information S = I_1 + I_2 about the place, and
    r = (I_1 - I_2) / S. If the half width is unknown too, the variance of the place increases by
    r^2 / (S (1 - r^2) + 12 / width^2), where `width` is that of the saturated tactels.
    """
    if not (readings.value >= readings.full).any():
        return
    for i in range(beliefs.active.size):
        parameter = beliefs.active[i]
        if parameter != P.Q0 and (parameter != P.Q1 or beliefs.kind == LINE):
            continue
        angle = fit.theta[P.Q1] if beliefs.kind == LINE else 0.5 * math.pi * (parameter == P.Q1)
        across, low, high = _places(pad, fit.model.size, angle), math.inf, -math.inf
        total, side = 1e-300, 0.0
        for t in range(fit.model.size):
            if readings.value[t] >= readings.full[t]:
                low, high = min(low, across[t]), max(high, across[t])
            else:
                by = fit.weight[t] * fit.rows[i, t] * abs(fit.rows[i, t])
                side, total = side + by, total + abs(by)
        if high >= low:
            moves, width = np.zeros(beliefs.active.size), high - low + pad.pitch
            share = side / total
            # Away from the visible flank.
            moves[i] = -share / math.sqrt(
                (1.0 - share ** 2) / covariance[i, i] + 12.0 / width ** 2)
            force = np.searchsorted(beliefs.active, P.FORCE)
            moves[force] = 2.0 * abs(moves[i]) / width * fit.theta[P.FORCE]
            covariance += moves.reshape(-1, 1) * moves


@njit(error_model='numpy', fastmath=FAST)
def _along(fit: Fit, noise2: np.ndarray, basis: np.ndarray, place: np.ndarray,
           correlation: float) -> float:
    """
    Return `Misfit.along` of a line: the smooth part of the residual at places (tactels,) along it.

    What noise contributes to its square is subtracted.
    """
    squared, sums = basis ** 2, np.empty((3, place.size))
    sums[0], sums[1], sums[2] = fit.error * basis, squared, squared * noise2
    _smooth_line(place, correlation, sums)
    varied = power = 0.0
    for i in range(place.size):
        power += fit.model[i] ** 2 * (fit.weight[i] > 0.0)
        if sums[1, i] > 0.0:
            # The sum of a Gaussian's squares is that of the Gaussian over the root of 2.
            by_noise = math.sqrt(0.5) * sums[2, i]
            varied += squared[i] * (sums[0, i] ** 2 - by_noise) / sums[1, i] ** 2
    return math.sqrt(max(varied, 0.0) / max(power, 1e-300))


@njit(error_model='numpy')
def _normalised(place: np.ndarray, basis: np.ndarray) -> np.ndarray:
    """Return places (tactels,) with mean 0 and RMS 1, weighted by the squares of a basis."""
    squared = basis ** 2
    centred = place - (squared * place).sum() / squared.sum()
    return centred / math.sqrt((squared * centred ** 2).sum() / squared.sum())


@njit(error_model='numpy')
def judge(pad: Pad, fit: Fit, readings: Readings, beliefs: Beliefs) -> tuple[Misfit, np.ndarray]:
    """
    Examine the residual that neighbouring tactels share; compute the covariance of the load.

    Returns
    -------
    Misfit
    ndarray, shape (n, n)
        Covariance of the active parameters.
    """
    half = math.exp(fit.theta[P.WIDTH]) if beliefs.power else HALF_WIDTH * pad.depths[0]
    correlation, peak = max(half, pad.pitch), fit.model.max()
    loaded = (fit.weight > 0.0) & (np.abs(fit.model) > LOADED * peak)
    rows = fit.rows * loaded
    answer = fit.inverse @ rows
    moves, basis = answer * fit.weight, fit.model * loaded
    across = _places(pad, basis.size, fit.theta[P.Q1])
    moved, both = _passed_on(beliefs.kind, pad, moves, basis, across, correlation)
    agreed, deviation, by_model = _agreement(
        beliefs.kind, pad, fit, rows, answer, correlation, loaded, moved, both)
    d2 = UNSEEN[int(beliefs.power or beliefs.patch)] ** 2
    if by_model > 0.0:
        # Standard deviation of d^2 under noise, relative to its prior.
        worth = (deviation / by_model / (ALLOWED * ALLOWED)) ** 2
        d2 = (min(max(agreed / by_model, 0.0), LARGEST) + worth * d2) / (1.0 + worth)
    covariance = fit.inverse * (SANDWICH if beliefs.robust else 1.0) + d2 * both
    if not beliefs.robust:
        covariance += _by_gains(fit, beliefs)
    along = 0.0
    if beliefs.robust and beliefs.kind == LINE:
        place = _places(pad, basis.size, fit.theta[P.Q1] + 0.5 * math.pi)
        # Of the same tactels as `Residual.left`.
        kept = basis * (fit.error ** 2 < LOUD ** 2 * fit.variance)
        along = _along(fit, readings.noise2, kept, place, correlation)
        _, both = _passed_on(LINE, pad, moves, kept, place, correlation)
        covariance += along ** 2 * both
        _, both = _passed_on(
            LINE, pad, moves, basis * _normalised(place, basis), across, correlation)
        covariance += TURNED ** 2 * d2 * both
    hidden = 0.0
    if not beliefs.power and not beliefs.patch:
        hidden = _hidden_patch(fit, covariance)
    _unseen_middle(pad, fit, readings, beliefs, covariance)
    significance = agreed / deviation if deviation > 0.0 else 0.0
    apart = _apart(pad, fit, peak)
    return Misfit(significance, hidden, along, apart), covariance
