"""Presses of a small ball: frames in counts above those of the unloaded pad, good ones and bad."""

from dataclasses import dataclass

import numpy as np

from tactile_sensing.types.array import TactelArray

LEAST_PEAK = 10.0  # standard deviations that the peak of a usable press must reach
BORDER = 1.5  # pitches that its peak must be away from the border
SECOND = 0.3  # of the peak; as high elsewhere means that something else presses as well
MOST = 120  # presses that are used; more of them cost time and tell little


@dataclass(frozen=True, eq=False)
class Presses:
    """
    Frames that each show one press.

    What a tactel reports at or below the floor is only known to be below it. NaN is no value.
    """

    array: TactelArray
    values: np.ndarray  # (N, rows, columns) [counts]
    noise: np.ndarray  # (rows, columns) [counts]
    floor: np.ndarray  # (rows, columns) [counts]
    number: np.ndarray  # (N,) of the frame in its file

    def __len__(self) -> int:
        return len(self.values)

    def scaled(self, factor: np.ndarray) -> 'Presses':
        """Return the presses with every tactel (rows, columns) multiplied."""
        return Presses(self.array, self.values * factor, self.noise * factor,
                       self.floor * factor, self.number)

    def joined(self, other: 'Presses') -> 'Presses':
        """Return these and other presses of the same array."""
        return Presses(self.array, np.concatenate([self.values, other.values]), self.noise,
                       self.floor, np.concatenate([self.number, other.number]))

    def only(self, chosen: np.ndarray) -> 'Presses':
        """Return the presses that are chosen."""
        return Presses(
            self.array, self.values[chosen], self.noise, self.floor, self.number[chosen])


def sort_presses(presses: Presses, saturated: np.ndarray) -> tuple[Presses, dict[int, str]]:
    """
    Return the presses that tell something of the skin, and why not the others.

    Parameters
    ----------
    presses : Presses
    saturated : ndarray, shape (N,)
        How many tactels of each are at full scale.

    Returns
    -------
    good : Presses
        At most MOST of them, spread over the pad.
    bad : dict
        From the number of a frame to what is wrong with it.
    """
    array, bad, good, peaks = presses.array, {}, [], []
    for i, values in enumerate(presses.values):
        peak = np.unravel_index(np.nanargmax(np.nan_to_num(values, nan=-np.inf)), values.shape)
        reason = why_not(values, peak, presses.noise, array, int(saturated[i]))
        if reason:
            bad[int(presses.number[i])] = reason
        else:
            good.append(i)
            peaks.append(peak[0] * array.columns + peak[1])
    # In turns over the tactels that were pressed, so that none of them crowds out the others.
    _, place, count = np.unique(peaks, return_inverse=True, return_counts=True)
    turn = np.zeros(len(peaks), int)
    for k in range(len(count)):
        turn[place == k] = np.arange(count[k])
    order = np.argsort(turn, kind='stable')[:MOST]
    return presses.only(np.array(good, int)[np.sort(order)]), bad


def why_not(values: np.ndarray, peak: tuple, noise: np.ndarray, array: TactelArray,
            saturated: int) -> str:
    """
    Return what is wrong with a press of a ball; an empty text where nothing is.

    Parameters
    ----------
    values, noise : ndarray, shape (rows, columns)
        Counts above those of the unloaded pad.
    peak : tuple
        Row and column of the highest.
    array : TactelArray
    saturated : int
        How many tactels are at full scale.
    """
    row, column = peak
    highest = values[row, column]
    if not highest > LEAST_PEAK * noise[row, column]:
        return 'nothing presses, or too lightly'
    if saturated:
        return f'{saturated} tactels are at full scale: press more lightly'
    if (min(row, array.rows - 1 - row) < BORDER - 0.5
            or min(column, array.columns - 1 - column) < BORDER - 0.5):
        return 'too close to the border'
    around = np.hypot((array.x - array.x[column])[None], (array.y - array.y[row])[:, None])
    far = around > 5.0 * max(array.pitch_x, array.pitch_y)
    elsewhere = np.where(far, np.nan_to_num(values, nan=0.0), 0.0)
    if elsewhere.max() > max(SECOND * highest, LEAST_PEAK * noise.max()):
        return 'something presses elsewhere as well'
    return ''
