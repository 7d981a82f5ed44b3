"""Presses of a small ball: their images, and the selection of usable ones."""

from dataclasses import dataclass, replace

import numpy as np

from tactile_sensing.devices.tare import QUANTISATION
from tactile_sensing.types.array import TactelArray

LEAST_PEAK = 10.0  # smallest peak of a usable press [standard deviations]
PER_PRESS = 'values', 'noise', 'number', 'source', 'force'  # fields with one item per press
ELSEWHERE = 0.3  # a second load far from the press counts above this share of the peak
SAME_PRESS = 1.5  # two frames show the same held press below this chi-square per tactel


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
        means = self.only(np.array([group[0] for group in groups]))  # a copy
        for k, group in enumerate(groups):
            frames = self.values[group]
            hidden = frames <= self.floor  # if only some are, the mean is unknown
            means.values[k] = np.where(
                hidden.any(axis=0) & ~hidden.all(axis=0), np.nan, frames.mean(axis=0))
            means.noise[k] = np.maximum(means.noise[k] / len(group)**0.5, QUANTISATION**0.5)
        return means


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
