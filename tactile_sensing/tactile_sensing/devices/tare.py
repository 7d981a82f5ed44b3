"""Tare: the image of the unloaded pad, and the checks of its frames."""
from dataclasses import dataclass
import os

import numpy as np

from tactile_common.errors import ConfigurationError, TactileError
from tactile_common.npz_stream import read_arrays, scalar, write_arrays
from tactile_sensing.devices.counts import Counts
from tactile_sensing.devices.unloaded import unloaded_statistics

# With fewer frames, neither the noise nor steadiness can be determined.
MIN_TARE_FRAMES = 20
CHANCE = 5.0  # a mean may be off by this much by chance [standard deviations]


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


def save_tare(tare: Tare, at_ns: int, path: str | os.PathLike) -> None:
    """Write a tare and its time [ns] to a file for `load_tare`."""
    write_arrays(path, at_ns=at_ns, offset=tare.offset, noise=tare.noise, live=tare.live)


def load_tare(path: str | os.PathLike, live: np.ndarray) -> tuple[Tare, int]:
    """
    Read a tare and its time [ns].

    Raises a ConfigurationError if its shape or live tactels differ from `live` (rows, columns).
    """
    held = read_arrays(path, ('at_ns', 'offset', 'noise', 'live'))
    tare = Tare(*(held[name].astype(kind) for name, kind in (
        ('offset', np.float32), ('noise', np.float32), ('live', bool))))
    if not (np.array_equal(tare.live, live) and tare.offset.shape == tare.noise.shape
            == live.shape and np.isfinite([tare.offset, tare.noise]).all()):
        raise ConfigurationError(f'{path}: is no tare of this array')
    scalar('at_ns', held['at_ns'])
    return tare, int(held['at_ns'].item())  # an integer, because a float would round it


def tare_of(frames: np.ndarray, counts: Counts, baseline: np.ndarray, live: np.ndarray,
            tolerance: float) -> Tare:
    """
    Average frames of the unloaded pad, (n, rows, columns) [counts].

    A live tactel may differ from the baseline (rows, columns) by the tolerance [counts]. Raises a
    TareRefusedError if there are too few frames, if a live tactel sends no number or is loaded,
    or if the frames are not steady.
    """
    if len(frames) < MIN_TARE_FRAMES:
        raise TareRefusedError(f'{len(frames)} frames, at least {MIN_TARE_FRAMES} are needed')
    told = np.isfinite(frames).all(axis=0) | ~live
    if not told.all():
        row, column = np.argwhere(~told)[0]
        raise TareRefusedError(f'{np.count_nonzero(~told)} tactels send no number, the first one '
                               f'is row {row} column {column}: see dead_tactels')
    offset, noise = unloaded_statistics(frames, counts.threshold, counts.lowest, live)
    # Median change from frame to frame: a load that begins does not count as noise.
    steps = np.abs(np.diff(frames[:, live].astype(np.float64), axis=0))
    chance = CHANCE * 1.05 * float(np.median(steps)) / np.sqrt(len(frames))
    deviation, allowed = np.where(live, offset - baseline, 0.0), tolerance + chance
    worst = np.unravel_index(np.abs(deviation).argmax(), deviation.shape)
    if abs(deviation[worst]) > allowed:
        loaded = np.count_nonzero(np.abs(deviation) > allowed)
        raise TareRefusedError(
            f'under load: {loaded} tactels are off the no-load baseline, row {worst[0]} '
            f'column {worst[1]} by {deviation[worst]:+.1f} counts, at most '
            f'{allowed:.1f} are allowed')
    half = len(frames) // 2
    change = np.where(live, frames[half:].mean(axis=0) - frames[:half].mean(axis=0), 0.0)
    allowed = 0.5 * tolerance + 2.0 * chance
    if np.abs(change).max() > allowed:
        raise TareRefusedError(
            f'not steady: a tactel changes by {np.abs(change).max():.1f} counts within '
            f'{len(frames)} frames, at most {allowed:.1f} are allowed')
    return Tare(offset.astype(np.float32), noise.astype(np.float32), live)
