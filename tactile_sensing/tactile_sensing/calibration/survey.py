"""Properties of the tactels from recordings of raw counts: range, noise, dead tactels."""

from dataclasses import dataclass

import numpy as np
import scipy

from tactile_common.errors import ConfigurationError
from tactile_sensing.devices.counts import Counts, MAX_BITS
from tactile_sensing.devices.tare import THRESHOLD_STD, unloaded_statistics

MISSING = 5.0  # a threshold exists if more counts than this are expected below it, but missing
MOST_NOISE = 5.0  # a tactel with more noise is dead [times the usual noise]
MOST_FRAMES = 2000  # frames that are searched for tactels that do not follow a load
# Load that two tactels on either side must show before the one between them is judged: in a
# frame; in all frames, root of the sum of squares [standard deviations].
STRONG, ENOUGH = 10.0, 20.0
STUCK = 0.1  # a tactel is dead if it shows less than this share of that load
TOUCHED = 5.0  # a tactel that once read at least this was loaded [standard deviations]
TOGETHER = 8.0  # neighbours that change by this together are touched [standard deviations]


@dataclass(frozen=True, eq=False)
class Tactels:
    """Statistics and faults of the unloaded tactels; arrays have the shape (rows, columns)."""

    offset: np.ndarray  # [counts]
    noise: np.ndarray  # [counts]
    dead: dict  # (row, column) -> fault
    step: int  # smallest step of the counts: the effective least significant bit
    unloaded: np.ndarray  # bool: not dead, but not loaded in any frame


def range_of(recordings: list[np.ndarray], bits: int | None, signed: bool | None,
             threshold: int | None) -> tuple[Counts, list[str]]:
    """
    Determine the range of the counts; return it and the assumptions.

    Values that are not given follow from the counts: the smallest usual number of bits for them,
    and a threshold if small counts never occur although larger ones do. Raises a
    ConfigurationError if no converter, or not the given one, sends such counts.
    """
    assumed = []
    counts = np.concatenate([np.rint(frames).ravel() for frames in recordings])
    low, high = int(counts.min()), int(counts.max())
    if signed is None:
        signed = low < 0
        assumed.append(f'{"signed" if signed else "unsigned"} counts, as the recordings show')
    elif low < 0 and not signed:
        raise ConfigurationError(f'--signed is no, but counts of {low} to {high} are signed')
    need = max(high, -low - 1, 1).bit_length() + signed
    if bits is not None and bits < need:
        raise ConfigurationError(f'--bits is {bits}, but counts of {low} to {high} need {need}')
    if need > MAX_BITS:
        raise ConfigurationError(
            f'counts of {low} to {high} need {need} bits, at most {MAX_BITS} are possible: '
            '--resolution gives the size of a count')
    if bits is None:
        bits = next((b for b in (8, 10, 12, 14) if b >= need), MAX_BITS)
        assumed.append(f'{bits} bits: the least usual converter for counts of {low} to {high}')
    if threshold is None and low == 0 and not signed:
        above = counts[counts > 0.0]
        least = int(above.min(initial=high))
        # Without a threshold, about as many counts are expected below as in an equal range above.
        if above.size >= 50 and least > 1 and np.count_nonzero(above < 2 * least) > MISSING:
            threshold = least
            assumed.append(f'a threshold of {threshold}: smaller counts than that are all 0')
    return Counts(bits, signed, threshold), assumed


def touched(frames: np.ndarray, counts: Counts) -> np.ndarray:
    """
    Return in which frames (N,) of a pad something begins or ceases to touch it.

    There 3 x 3 tactels differ together from their medians over time. A change that all tactels
    have in common is drift.
    """
    off = frames - np.median(frames, axis=0)
    off -= np.median(off, axis=(1, 2), keepdims=True)
    usual = np.median(np.abs(off), axis=0) / 0.6745
    # Of steps of the converter the median shows nothing.
    noise = np.maximum(usual, max(counts.threshold - counts.lowest, 2) / THRESHOLD_STD)
    together = 3.0 * scipy.ndimage.uniform_filter(off / noise, (1, 3, 3), mode='constant')
    return np.abs(together).max(axis=(1, 2)) > TOGETHER


def survey(frames: np.ndarray, counts: Counts, loaded: list[np.ndarray]) -> Tactels:
    """
    Examine frames (N, rows, columns) of the unloaded pad.

    Frames of the loaded pad, if given, show faults that are invisible without load: tactels that
    do not change although their neighbours do.
    """
    live = np.ones(frames.shape[1:], bool)
    offset, noise = unloaded_statistics(frames, counts.threshold, counts.lowest, live)
    usual = float(np.median(noise))
    silent = never = np.zeros(live.shape, bool)
    if loaded:
        silent, never = _silent(np.concatenate(loaded), offset, usual)
    dead = {}
    for faulty, text in ((noise > MOST_NOISE * usual, 'noise {:.1f} counts'),
                         (offset >= counts.saturation - 1, 'at full scale without load'),
                         (silent, 'shows nothing under load')):
        for row, column in np.argwhere(faulty).tolist():
            dead[row, column] = text.format(noise[row, column])
        live[faulty] = False
    offset, noise = unloaded_statistics(frames, counts.threshold, counts.lowest, live)
    values = np.unique(np.concatenate([np.rint(it).ravel() for it in (frames, *loaded)]))
    step = int(np.gcd.reduce(np.diff(values).astype(np.int64))) if values.size > 2 else 1
    return Tactels(offset, np.maximum(noise, step * 12**-0.5), dead, step, never & live)


def _silent(loaded: np.ndarray, offset: np.ndarray,
            noise: float) -> tuple[np.ndarray, np.ndarray]:
    """Return which tactels do not follow their neighbours, and which were never loaded."""
    values = loaded[::-(-len(loaded) // MOST_FRAMES)] - offset
    padded = np.pad(values, ((0, 0), (1, 1), (1, 1)))
    rows, columns = offset.shape

    def beside(i: int, j: int) -> np.ndarray:
        return padded[:, 1 + i:1 + i + rows, 1 + j:1 + j + columns]
    # Under an elastic skin, a tactel between two loaded ones is loaded too.
    between = np.max([np.minimum(beside(i, j), beside(-i, -j))
                      for i, j in ((0, 1), (1, 0), (1, 1), (1, -1))], axis=0)
    between = np.where(between > STRONG * noise, between, 0.0)
    power = (between**2).sum(axis=0)
    silent = (power > (ENOUGH * noise)**2) & ((between * values).sum(axis=0) < STUCK * power)
    return silent, ~silent & (values.max(axis=0) < TOUCHED * noise)
