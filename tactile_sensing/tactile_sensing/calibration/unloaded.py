"""What recordings of raw counts say of the tactels: range, noise, dead, stuck, drift."""

from dataclasses import dataclass

import numpy as np

from tactile_common.errors import ConfigurationError
from tactile_sensing.devices.counts import Counts, MAX_BITS
from tactile_sensing.devices.unloaded import unloaded_statistics


@dataclass(frozen=True, eq=False)
class Tactels:
    """Tactels without load and what is wrong with them; arrays of shape (rows, columns)."""

    offset: np.ndarray  # [counts]
    noise: np.ndarray  # [counts]
    dead: dict  # from (row, column) to what is wrong
    step: int  # between neighbouring counts that occur: the effective least significant bit
    drift: float  # median change from the first half of the frames to the second [counts]
    unloaded: np.ndarray  # bool: not dead, but no frame shows that it was loaded


def range_of(recordings: list[np.ndarray], bits: int | None, signed: bool | None,
             threshold: int | None) -> tuple[Counts, list[str]]:
    """
    Range of the counts, and what of it was assumed.

    What is not given follows from the counts: the fewest bits that hold them; a threshold where
    small counts are never reported though larger ones are. ConfigurationError where the bits that
    are given do not hold the counts.
    """
    assumed = []
    counts = np.concatenate([np.rint(frames[np.isfinite(frames)]) for frames in recordings])
    low, high = int(counts.min()), int(counts.max())
    if signed is None:
        signed = low < 0
        assumed.append(f'{"signed" if signed else "unsigned"} counts, as the recordings show')
    need = max(high, -low - 1, 1).bit_length() + signed
    if bits is not None and bits < need:
        raise ConfigurationError(f'--bits is {bits}, but counts of {low} to {high} need {need}')
    if bits is None:
        bits = next((b for b in (8, 10, 12, 14) if b >= need), MAX_BITS)
        assumed.append(f'{bits} bits: the least usual converter for counts of {low} to {high}')
    if threshold is None and low >= 0:
        threshold = _threshold(counts, Counts(bits, signed).lowest)
        if threshold:
            assumed.append(f'a threshold of {threshold}: smaller counts than that are all 0')
    return Counts(bits, signed, threshold or None), assumed


def _threshold(counts: np.ndarray, lowest: int) -> int | None:
    """Least count above the lowest, where those below it are missing; None: no threshold."""
    above = np.sort(counts[counts > lowest])
    if above.size < 50 or not np.any(counts == lowest):
        return None
    least = int(above[0])
    # As many below as there are in as wide a range above, unless something leaves them out.
    expected = np.count_nonzero(above < 2 * least - lowest)
    return least if least > lowest + 1 and expected > 5 else None


def survey(frames: np.ndarray, counts: Counts, loaded: list[np.ndarray]) -> Tactels:
    """
    Survey frames (N, rows, columns) of the unloaded pad.

    Frames of the loaded pad, if there are any, tell what does not show without load: tactels that
    are always the same though their neighbours change.
    """
    live = np.ones(frames.shape[1:], bool)
    first = unloaded_statistics(frames, counts.threshold, counts.lowest, live)
    usual = float(np.median(first.noise))
    dead = {}
    for place in np.argwhere(first.noise > 5.0 * usual):
        dead[tuple(place.tolist())] = f'noise {first.noise[tuple(place)]:.1f} counts'
    for place in np.argwhere(first.offset >= counts.saturation - 1):
        dead[tuple(place.tolist())] = 'at full scale without load'
    never = np.zeros(live.shape, bool)
    if loaded:
        silent, never = _silent(np.concatenate(loaded), first.offset, usual)
        dead |= {tuple(place.tolist()): 'shows nothing under load'
                 for place in np.argwhere(silent)}
    for place in dead:
        live[place] = False
    offset, noise = unloaded_statistics(frames, counts.threshold, counts.lowest, live)
    half = len(frames) // 2
    change = np.median((frames[half:].mean(axis=0) - frames[:half].mean(axis=0))[live])
    values = np.unique(np.concatenate([
        np.rint(it[np.isfinite(it)]).ravel() for it in (frames, *loaded)]))
    step = int(np.gcd.reduce(np.diff(values).astype(np.int64))) if values.size > 2 else 1
    return Tactels(offset, np.maximum(noise, step * 12**-0.5), dead, step, float(change),
                   never & live)


def _silent(loaded: np.ndarray, offset: np.ndarray,
            noise: float) -> tuple[np.ndarray, np.ndarray]:
    """Tactels that do not follow those on either side of them; others that were never loaded."""
    values = np.nan_to_num(loaded[::-(-len(loaded) // 2000)] - offset)
    padded = np.pad(values, ((0, 0), (1, 1), (1, 1)))
    rows, columns = offset.shape

    def beside(i: int, j: int) -> np.ndarray:
        return padded[:, 1 + i:1 + i + rows, 1 + j:1 + j + columns]
    # Under an elastic skin a tactel between two loaded ones is loaded, one beside them need not.
    between = np.max([np.minimum(beside(i, j), beside(-i, -j))
                      for i, j in ((0, 1), (1, 0), (1, 1), (1, -1))], axis=0)
    between = np.where(between > 10.0 * noise, between, 0.0)
    power = (between**2).sum(axis=0)
    silent = (power > (20.0 * noise)**2) & ((between * values).sum(axis=0) < 0.1 * power)
    return silent, ~silent & (values.max(axis=0) < 5.0 * noise)
