"""What frames of the unloaded pad say of its tactels: their counts, their noise."""

from typing import NamedTuple

import numpy as np
from scipy.special import log_ndtr, logsumexp, ndtr

QUANTISATION = 1.0 / 12.0  # variance of rounding to whole counts [counts^2]
QUIET = 1.0  # counts of noise below which rounding hides a part of it
LEVELS = np.arange(-4, 5)  # about its usual one, that a quiet tactel shows [counts]


class Unloaded(NamedTuple):
    """Tactels without load, each of shape (rows, columns)."""

    offset: np.ndarray  # mean [counts]
    noise: np.ndarray  # standard deviation of one reading, quantisation included [counts]


def missing_mean(z: np.ndarray) -> np.ndarray:
    """Mean of a standard normal variable that is known to be below z, with opposite sign."""
    return np.exp(-0.5 * np.square(z) - 0.5 * np.log(2.0 * np.pi) - log_ndtr(z))


def unloaded_statistics(frames: np.ndarray, threshold: float, lowest: float,
                        live: np.ndarray) -> Unloaded:
    """
    Mean and noise of every tactel.

    Counts below the threshold only say that they are: mean and spread are those of the normal
    distribution that is likeliest to leave what is seen above (Tobin's model). The noise of a
    tactel is shrunk towards that of all live ones as far as chance explains that it differs, and
    is never less than rounding to counts makes it. Where it is less than a count, rounding is
    taken for what it is, and only a tactel that is much noisier has a noise of its own. Of a
    threshold that hides nearly all readings is only known that it keeps the noise out.

    Frames are (N, rows, columns) [counts], N >= 2; counts below the threshold are reported as the
    lowest, or anyhow tell nothing; the noise of live tactels (rows, columns) is taken together.
    """
    frames = np.asarray(frames, dtype=np.float64)
    seen = frames >= threshold
    count = seen.sum(axis=0)
    offset, variance = frames.mean(axis=0), frames.var(axis=0, ddof=1)
    if not seen.all():
        offset, variance = _censored(frames, seen, threshold - 0.5, offset, variance)
    # Where next to nothing is seen, a tactel that is seen now and then was touched.
    silent = np.mean(~seen[:, live]) > 0.99
    often = count > (0.5 * len(frames) if silent else 2)
    told, offset = live & often, np.where(often, offset, lowest)
    mean = max(variance[told].mean(), QUANTISATION) if told.any() else QUANTISATION
    by_chance = 2.0 / (len(frames) - 1)  # variance of a sample variance, relative
    excess = (variance[told] / mean).var() if told.any() else 0.0
    own = max(excess - by_chance, 0.0) / max(excess, by_chance)
    shrunk = np.where(told, own * variance + (1.0 - own) * mean, mean)
    whole = np.array_equal(frames, np.rint(frames))
    if whole and not silent and told.any() and mean < QUIET**2 + QUANTISATION:
        centre, variance = _rounded(frames, threshold, told)
        offset = np.where(told, centre, offset)
        # A variance nine times the usual one is no chance.
        shrunk = np.where(told & (shrunk > 9.0 * variance), shrunk, variance)
    noise = np.sqrt(np.maximum(shrunk, QUANTISATION))
    if silent:
        # Thresholds are set at four standard deviations of the noise (3.5).
        noise = np.maximum(noise, (threshold - 0.5 - lowest) / 4.0)
    return Unloaded(offset, noise)


def _rounded(frames: np.ndarray, threshold: float,
             told: np.ndarray) -> tuple[np.ndarray, float]:
    """Likeliest mean of each tactel, and variance of a reading of any, with that of rounding."""
    usual = np.maximum(np.rint(np.median(frames, axis=0)), threshold - 1.0)
    level = np.clip(np.maximum(frames, threshold - 1.0) - usual, LEVELS[0], LEVELS[-1])
    shown = np.stack([(level == k).sum(axis=0) for k in LEVELS], axis=-1)
    below = threshold - 1.0 - usual  # level of all that is below the threshold
    means = np.linspace(-3.0, 1.0, 161)
    best, centre, std = -np.inf, np.zeros(usual.shape), 0.0
    for trial in np.geomspace(0.03, 1.5 * QUIET, 60):
        edges = ndtr((np.append(LEVELS, LEVELS[-1] + 1) - 0.5 - means[:, None]) / trial)
        likely = shown @ np.log(np.diff(edges) + 1e-12).T
        for k in np.flatnonzero(np.isin(LEVELS, below)):
            chance = np.diff(edges)
            chance[:, k] = edges[:, k + 1]
            likely[below == LEVELS[k]] = shown[below == LEVELS[k]] @ np.log(chance + 1e-12).T
        total = logsumexp(likely, axis=-1)
        if total[told].sum() > best:
            best, std = total[told].sum(), trial
            centre = np.exp(likely - total[..., None]) @ means
    return usual + centre, std**2 + QUANTISATION


def _censored(frames: np.ndarray, seen: np.ndarray, level: float, mean: np.ndarray,
              variance: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Likeliest mean and variance where some readings are below a level."""
    count, share = seen.sum(axis=0), 1.0 - seen.mean(axis=0)
    total = np.where(seen, frames, 0.0).sum(axis=0)
    square = np.where(seen, frames**2, 0.0).sum(axis=0)
    for _ in range(100):  # ten gain about a digit
        std = np.sqrt(np.maximum(variance, QUANTISATION))
        z = (level - mean) / std
        lack = missing_mean(z)
        below, spread = mean - std * lack, std**2 * (1.0 - z * lack - lack**2)
        mean = np.maximum(total / len(frames) + share * below, level - 4.0 * std)
        variance = share * (spread + (below - mean)**2) + (
            square - 2.0 * mean * total + count * mean**2) / len(frames)
    return mean, np.maximum(variance, 0.0)
