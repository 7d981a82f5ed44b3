"""Presses of a small ball: counts above those of the unloaded pad, good ones and bad."""

from dataclasses import dataclass, replace

import numpy as np

from tactile_sensing.devices.unloaded import QUANTISATION
from tactile_sensing.types.array import TactelArray

LEAST_PEAK = 10.0  # standard deviations that the peak of a usable press must reach


@dataclass(frozen=True, eq=False)
class Presses:
    """
    Images that each show one press: a frame, or the mean of those while it was held.

    What a tactel reports at or below the floor is only known to be below it. NaN is no value.
    """

    array: TactelArray
    values: np.ndarray  # (N, rows, columns) [counts]
    noise: np.ndarray  # (N, rows, columns) [counts]
    floor: np.ndarray  # (rows, columns) [counts]
    number: np.ndarray  # (N,) of its first frame in its file

    def __len__(self) -> int:
        return len(self.values)

    def joined(self, other: 'Presses') -> 'Presses':
        """Return these and other presses of the same array."""
        return replace(self, **{
            name: np.concatenate([getattr(self, name), getattr(other, name)])
            for name in ('values', 'noise', 'number')})

    def only(self, chosen: np.ndarray) -> 'Presses':
        """Return the presses that are chosen."""
        return replace(self, **{
            name: getattr(self, name)[chosen] for name in ('values', 'noise', 'number')})

    def averaged(self) -> 'Presses':
        """Return the presses with frames in turn that differ by noise alone as one."""
        groups: list[list[int]] = []
        for i in range(len(self)):
            if groups and self._is_like(i, groups[-1]):
                groups[-1].append(i)
            else:
                groups.append([i])
        values, noise = np.array([self._mean(group) for group in groups]).swapaxes(0, 1)
        return Presses(self.array, values, noise, self.floor,
                       self.number[[group[0] for group in groups]])

    def _is_like(self, i: int, group: list[int]) -> bool:
        off = (self.values[i] - self.values[group].mean(axis=0)) / self.noise[i]
        return np.nanmean(off**2) < 1.5 * (1.0 + 1.0 / len(group))

    def _mean(self, group: list[int]) -> tuple[np.ndarray, np.ndarray]:
        """Mean of some frames and its noise; what hides in some of them alone tells nothing."""
        values = self.values[group]
        hidden = values <= self.floor
        mean = np.where(hidden.any(axis=0) & ~hidden.all(axis=0), np.nan, values.mean(axis=0))
        return mean, np.maximum(self.noise[group[0]] / np.sqrt(len(group)), QUANTISATION**0.5)


def sort_presses(presses: Presses, saturated: np.ndarray) -> tuple[Presses, dict[int, str]]:
    """
    Return the presses that tell something of the skin, and why not the others, by their numbers.

    Of every frame is told how many tactels are at full scale, (N,). The good ones are at most
    120, spread over the pad, as more cost time and tell little; those that were held are averaged.
    """
    bad, good = {}, []
    for i, values in enumerate(presses.values):
        reason = why_not(values, presses.noise[i], presses.array, int(saturated[i]))
        if reason:
            bad[int(presses.number[i])] = reason
        else:
            good.append(i)
    if not good:
        return presses.only(np.zeros(0, int)), bad
    presses = presses.only(np.array(good)).averaged()
    peaks = [highest(values) for values in presses.values]
    # In turns over the tactels that were pressed, so that none of them crowds out the others.
    _, place, count = np.unique(peaks, axis=0, return_inverse=True, return_counts=True)
    turn = np.zeros(len(peaks), int)
    for k in range(len(count)):
        turn[place.ravel() == k] = np.arange(count[k])
    order = np.argsort(turn, kind='stable')[:120]
    return presses.only(np.sort(order)), bad


def highest(values: np.ndarray) -> tuple:
    """Row and column of the highest tactel."""
    return np.unravel_index(np.nan_to_num(values, nan=-np.inf).argmax(), values.shape)


def why_not(values: np.ndarray, noise: np.ndarray, array: TactelArray, saturated: int) -> str:
    """
    Return what is wrong with a press of a ball; an empty text where nothing is.

    Counts above those of the unloaded pad and their noise have the shape (rows, columns); so many
    tactels are at full scale.
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
    if elsewhere.max() > max(0.3 * peak, LEAST_PEAK * noise.max()):
        return 'something presses elsewhere as well'
    return ''
