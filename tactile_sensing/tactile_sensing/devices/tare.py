"""Tare: offset and noise of the tactels, from frames of the unloaded pad."""
from dataclasses import dataclass

import numpy as np
import scipy

from tactile_common.errors import TactileError

# With fewer frames, neither the noise nor steadiness can be determined.
MIN_TARE_FRAMES = 20
QUANTISATION = 1.0 / 12.0  # variance of rounding to whole counts [counts^2]
QUIET = 1.0  # below this noise, rounding hides a part of it [counts]
HIDDEN = 0.99  # if a larger share of the readings is below the threshold, it hides the noise
LEAST_SEEN = 2  # a tactel with more readings above the threshold has a known offset
NOISIER = 9.0  # a tactel of a quiet pad has its own noise above this multiple of the variance
THRESHOLD_STD = 4.0  # thresholds are set to this multiple of the noise, (3.5) of the thesis
LEVELS = np.arange(-4, 5)  # counts of a quiet tactel, relative to its usual count


class TareRefusedError(TactileError):
    """The frames do not show an unloaded pad; the message says why."""


@dataclass(frozen=True, eq=False)
class Tare:
    """Image of the unloaded pad."""

    offset: np.ndarray  # mean counts, shape (rows, columns), float32
    noise: np.ndarray  # standard deviation of every tactel [counts], float32
    live: np.ndarray  # whether a tactel is used, bool

    @property
    def noise_std(self) -> float:
        """RMS noise of the used tactels [counts]."""
        return float(np.sqrt(np.mean(np.square(self.noise[self.live]))))


def missing_mean(z: np.ndarray) -> np.ndarray:
    """Return minus the mean of a standard normal variable that is known to be below z."""
    return np.exp(-0.5 * np.square(z) - 0.5 * np.log(2.0 * np.pi) - scipy.special.log_ndtr(z))


def unloaded_statistics(frames: np.ndarray, threshold: float, lowest: float,
                        live: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """
    Return the mean of every unloaded tactel, and the noise of one reading, (rows, columns).

    Counts below the threshold are only upper bounds. Mean and standard deviation are therefore
    those of the most likely normal distribution for censored readings (Tobin's model). The noise
    of a tactel is shrunk towards that of all live tactels, as far as chance explains the
    difference, and is at least the noise of rounding. If the noise is below one count, rounding is
    part of the model, and only a much noisier tactel gets its own noise. If the threshold hides
    nearly all readings, the noise is estimated from the threshold.

    Parameters
    ----------
    frames : ndarray, shape (N, rows, columns), N >= 2
        Counts; those below the threshold are the lowest count, or have no meaning.
    threshold, lowest : float
        Smallest measured count; smallest count of the converter.
    live : ndarray of bool, shape (rows, columns)
        Tactels whose noise is averaged.
    """
    frames = np.asarray(frames, dtype=np.float64)
    seen = frames >= threshold
    count = seen.sum(axis=0)
    offset, variance = frames.mean(axis=0), frames.var(axis=0, ddof=1)
    if not seen.all():
        offset, variance = _censored(frames, seen, threshold - 0.5, offset, variance)
    # If nearly all readings are hidden, a tactel with occasional readings was touched.
    silent = np.mean(~seen[:, live]) > HIDDEN
    often = count > (0.5 * len(frames) if silent else LEAST_SEEN)
    known, offset = live & often, np.where(often, offset, lowest)
    mean = max(variance[known].mean(), QUANTISATION) if known.any() else QUANTISATION
    by_chance = 2.0 / (len(frames) - 1)  # relative variance of a sample variance
    excess = (variance[known] / mean).var() if known.any() else 0.0
    own = max(excess - by_chance, 0.0) / max(excess, by_chance)
    shrunk = np.where(known, own * variance + (1.0 - own) * mean, mean)
    whole = np.array_equal(frames[:, live], np.rint(frames[:, live]))
    if whole and not silent and known.any() and mean < QUIET**2 + QUANTISATION:
        centre, variance = _rounded(frames, threshold, known)
        offset = np.where(known, centre, offset)
        shrunk = np.where(known & (shrunk > NOISIER * variance), shrunk, variance)
    noise = np.sqrt(np.maximum(shrunk, QUANTISATION))
    if silent:
        noise = np.maximum(noise, (threshold - 0.5 - lowest) / THRESHOLD_STD)
    return offset, noise


def _rounded(frames: np.ndarray, threshold: float,
             known: np.ndarray) -> tuple[np.ndarray, float]:
    """Return the likeliest mean of each tactel, and their common variance including rounding."""
    usual = np.maximum(np.rint(np.median(frames, axis=0)), threshold - 1.0)
    level = np.clip(np.maximum(frames, threshold - 1.0) - usual, LEVELS[0], LEVELS[-1])
    shown = np.stack([(level == k).sum(axis=0) for k in LEVELS], axis=-1)
    below = threshold - 1.0 - usual  # level that stands for all counts below the threshold
    means = np.linspace(-3.0, 1.0, 161)
    best, centre, std = -np.inf, np.zeros(usual.shape), 0.0
    for trial in np.geomspace(0.03, 1.5 * QUIET, 60):
        edges = scipy.special.ndtr(
            (np.append(LEVELS, LEVELS[-1] + 1) - 0.5 - means[:, None]) / trial)
        likely = shown @ np.log(np.diff(edges) + 1e-12).T
        for k in np.flatnonzero(np.isin(LEVELS, below)):
            chance = np.diff(edges)
            chance[:, k] = edges[:, k + 1]
            likely[below == LEVELS[k]] = shown[below == LEVELS[k]] @ np.log(chance + 1e-12).T
        total = scipy.special.logsumexp(likely, axis=-1)
        if total[known].sum() > best:
            best, std = total[known].sum(), trial
            centre = np.exp(likely - total[..., None]) @ means
    return usual + centre, std**2 + QUANTISATION


def _censored(frames: np.ndarray, seen: np.ndarray, level: float, mean: np.ndarray,
              variance: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the likeliest mean and variance if some readings are hidden below a level."""
    count, share = seen.sum(axis=0), 1.0 - seen.mean(axis=0)
    total = np.where(seen, frames, 0.0).sum(axis=0)
    square = np.where(seen, frames**2, 0.0).sum(axis=0)
    for _ in range(100):  # ten iterations gain about one digit
        std = np.sqrt(np.maximum(variance, QUANTISATION))
        z = (level - mean) / std
        lack = missing_mean(z)
        below, spread = mean - std * lack, std**2 * (1.0 - z * lack - lack**2)
        mean = np.maximum(total / len(frames) + share * below, level - 4.0 * std)
        variance = share * (spread + (below - mean)**2) + (
            square - 2.0 * mean * total + count * mean**2) / len(frames)
    return mean, np.maximum(variance, 0.0)
