"""Presses of a small ball: their images, and the selection of usable ones."""

from dataclasses import dataclass, replace

import numpy as np

from tactile_sensing.devices.tare import QUANTISATION
from tactile_sensing.types.array import TactelArray

LEAST_PEAK = 10.0  # smallest peak of a usable press [standard deviations]
PER_PRESS = 'values', 'noise', 'number', 'source', 'force'  # fields with one item per press
ELSEWHERE = 0.3  # a second load far from the press counts above this share of the peak
SAME_PRESS = 1.5  # two frames show the same held press below this chi-square per tactel
MOST_PRESSES = 120  # more presses cost time and add little information


@dataclass(frozen=True, eq=False)
class Presses:
    """
    Images that each show one press: one frame, or the mean of frames while it was held.

    Values are counts above those of the unloaded pad. A value at or below the floor is only an
    upper bound; NaN means no value.
    """

    array: TactelArray
    values: np.ndarray  # (N, rows, columns) [counts]
    noise: np.ndarray  # (N, rows, columns) [counts]
    floor: np.ndarray  # (rows, columns) [counts]
    number: np.ndarray  # (N,): index of its first frame in the file
    source: np.ndarray  # (N,): number of the file
    force: np.ndarray  # (N,): known force over those of the other presses of the same file

    def __len__(self) -> int:
        return len(self.values)

    def joined(self, other: 'Presses') -> 'Presses':
        """Return these presses followed by other presses of the same array."""
        return replace(self, **{
            name: np.concatenate([getattr(self, name), getattr(other, name)])
            for name in PER_PRESS})

    def only(self, chosen: np.ndarray) -> 'Presses':
        """Return the chosen presses; `chosen` is an index array or mask."""
        return replace(self, **{name: getattr(self, name)[chosen] for name in PER_PRESS})

    def averaged(self) -> 'Presses':
        """Return presses in which consecutive frames that differ only by noise are averaged."""
        groups = [[0]]
        for i in range(1, len(self)):
            group = groups[-1]
            off = (self.values[i] - self.values[group].mean(axis=0)) / self.noise[i]
            if np.nanmean(off**2) < SAME_PRESS * (1.0 + 1.0 / len(group)):
                group.append(i)
            else:
                groups.append([i])
        values, noise = np.array([self._mean(group) for group in groups]).swapaxes(0, 1)
        first = self.only(np.array([group[0] for group in groups]))
        return replace(first, values=values, noise=noise)

    def _mean(self, group: list[int]) -> tuple[np.ndarray, np.ndarray]:
        """Return the mean of some frames and its noise; NaN where only some are at the floor."""
        values = self.values[group]
        hidden = values <= self.floor
        mean = np.where(hidden.any(axis=0) & ~hidden.all(axis=0), np.nan, values.mean(axis=0))
        return mean, np.maximum(self.noise[group[0]] / np.sqrt(len(group)), QUANTISATION**0.5)


def sort_presses(presses: Presses, saturated: np.ndarray) -> tuple[Presses, dict[int, str]]:
    """
    Select usable presses; return them and the reasons for the others, by frame number.

    `saturated` (N,) is the number of tactels at full scale in every frame. Frames of a held press
    are averaged. At most `MOST_PRESSES`, evenly in time, are kept.
    """
    reasons = [why_not(values, noise, presses.array, int(full)) for values, noise, full in zip(
        presses.values, presses.noise, saturated, strict=True)]
    bad = {int(k): why for k, why in zip(presses.number, reasons, strict=True) if why}
    presses = presses.only(np.array([not why for why in reasons]))
    if not len(presses):
        return presses, bad
    presses = presses.averaged()
    some = np.linspace(0, len(presses) - 1, min(len(presses), MOST_PRESSES))
    return presses.only(np.rint(some).astype(int)), bad


def highest(values: np.ndarray) -> tuple:
    """Return row and column of the highest tactel."""
    return np.unravel_index(np.nan_to_num(values, nan=-np.inf).argmax(), values.shape)


def why_not(values: np.ndarray, noise: np.ndarray, array: TactelArray, saturated: int) -> str:
    """
    Return what is wrong with a press of a ball; an empty text if nothing is.

    `values` are counts above those of the unloaded pad, `noise` their standard deviation, both of
    shape (rows, columns). `saturated` is the number of tactels at full scale.
    """
    row, column = highest(values)
    peak = values[row, column]
    if not peak > LEAST_PEAK * noise[row, column]:
        return 'nothing presses, or too lightly'
    if saturated:
        return f'{saturated} tactels are at full scale: press more lightly'
    if row in (0, array.rows - 1) or column in (0, array.columns - 1):
        return 'too close to the border'
    around = np.hypot((array.x - array.x[column])[None], (array.y - array.y[row])[:, None])
    far = around > 5.0 * max(array.pitch_x, array.pitch_y)
    elsewhere = np.where(far, np.nan_to_num(values, nan=0.0), 0.0)
    if elsewhere.max() > max(ELSEWHERE * peak, LEAST_PEAK * noise.max()):
        return 'something presses elsewhere as well'
    return ''
