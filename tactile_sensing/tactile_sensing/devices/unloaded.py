"""What frames of the unloaded pad say of its tactels: their counts, their noise."""

from typing import NamedTuple

import numpy as np
from scipy.special import log_ndtr

QUANTISATION = 1.0 / 12.0  # variance of rounding to whole counts [counts^2]
STEPS = 100  # of expectation and maximisation; they gain a digit in about ten
SILENT = 0.99  # share of readings under a threshold beyond which it hides the noise
THRESHOLD_STD = 4.0  # standard deviations of noise at which thresholds are set (3.5)
LEAST_SEEN = 2  # readings of a tactel that tell where its mean lies below the threshold


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
    is never less than rounding to counts makes it. Of a threshold that hides nearly all readings
    is only known that it keeps the noise out.

    Parameters
    ----------
    frames : ndarray, shape (N, rows, columns)
        [counts], N >= 2.
    threshold, lowest : float
        Counts below the first are reported as the second, or anyhow tell nothing.
    live : ndarray, shape (rows, columns), bool
        Whose noise is taken together.
    """
    frames = np.asarray(frames, dtype=np.float64)
    seen = frames >= threshold
    count = seen.sum(axis=0)
    offset, variance = frames.mean(axis=0), frames.var(axis=0, ddof=1)
    if not seen.all():
        offset, variance = _censored(frames, seen, threshold - 0.5, offset, variance)
    # Where next to nothing is seen, a tactel that is seen now and then was touched.
    silent = np.mean(~seen[:, live]) > SILENT
    often = count > (0.5 * len(frames) if silent else LEAST_SEEN)
    told, offset = live & often, np.where(often, offset, lowest)
    mean = max(variance[told].mean(), QUANTISATION) if told.any() else QUANTISATION
    by_chance = 2.0 / (len(frames) - 1)  # variance of a sample variance, relative
    excess = (variance[told] / mean).var() if told.any() else 0.0
    own = max(excess - by_chance, 0.0) / max(excess, by_chance)
    shrunk = np.where(told, own * variance + (1.0 - own) * mean, mean)
    noise = np.sqrt(np.maximum(shrunk, QUANTISATION))
    if silent:
        noise = np.maximum(noise, (threshold - 0.5 - lowest) / THRESHOLD_STD)
    return Unloaded(offset, noise)


def _censored(frames, seen, level, mean, variance):
    """Likeliest mean and variance where some readings are below a level."""
    count, share = seen.sum(axis=0), 1.0 - seen.mean(axis=0)
    total = np.where(seen, frames, 0.0).sum(axis=0)
    square = np.where(seen, frames**2, 0.0).sum(axis=0)
    for _ in range(STEPS):
        std = np.sqrt(np.maximum(variance, QUANTISATION))
        z = (level - mean) / std
        lack = missing_mean(z)
        below, spread = mean - std * lack, std**2 * (1.0 - z * lack - lack**2)
        mean = np.maximum(total / len(frames) + share * below, level - 4.0 * std)
        variance = share * (spread + (below - mean)**2) + (
            square - 2.0 * mean * total + count * mean**2) / len(frames)
    return mean, np.maximum(variance, 0.0)
