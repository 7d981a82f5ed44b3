"""The last contacts of a path, averaged in cells so that their number is bounded."""
from typing import NamedTuple

import numpy as np

from tactile_common.kernels import njit

CELLS = 24  # that a window is usually divided into
MAX_CELLS = 3 * CELLS  # noise makes cells shorter than they should be
MAX_WEIGHT = 16.0  # samples of one cell that count as independent; a finger at rest adds no more


@njit(cache=True)
def _add(points, normals, starts, counts, used, point, normal, cell):
    """Add a contact to the newest cell, or open one; returns how many cells there are."""
    if used and ((point - starts[used - 1])**2).sum() < cell * cell:
        k = used - 1
        counts[k] += 1.0
        points[k] += (point - points[k]) / counts[k]
        normals[k] += (normal - normals[k]) / counts[k]
        return used
    if used == len(points):
        for values in (points, normals, starts):
            values[:-1] = values[1:].copy()
        counts[:-1] = counts[1:].copy()
        used -= 1
    points[used], normals[used], starts[used], counts[used] = point, normal, point, 1.0
    return used + 1


@njit(cache=True)
def _span(points, normals, used, window, max_turn):
    """First cell within the window, and the length of the path from there [m]."""
    first, travel = used - 1, 0.0
    newest = normals[used - 1]
    flattest = np.cos(max_turn) * np.sqrt((newest * newest).sum())
    while first > 0:
        step = np.sqrt(((points[first] - points[first - 1])**2).sum())
        other = normals[first - 1]
        turned = (newest * other).sum() < flattest * np.sqrt((other * other).sum())
        if travel + step > window or turned:
            break
        first, travel = first - 1, travel + step
    return first, travel


class Stretch(NamedTuple):
    """
    Contacts of a stretch of path, averaged in cells, the oldest first.

    Attributes
    ----------
    points, normals : ndarray, shape (m, 3)
        Views, valid until the next contact is added.
    counts : ndarray, shape (m,)
        Contacts in each cell.
    extent : float
        Length of the path [m].
    """

    points: np.ndarray
    normals: np.ndarray
    counts: np.ndarray
    extent: float

    @property
    def weights(self):
        """Contacts in each cell that count as independent, ndarray (m,)."""
        return np.minimum(self.counts, MAX_WEIGHT)

    @property
    def samples(self):
        """Contacts in all cells."""
        return int(self.counts.sum())

    def newer_half(self):
        """Return the newer half of the cells."""
        first = (len(self.points) + 1) // 2
        steps = np.diff(self.points[first:], axis=0)
        return Stretch(self.points[first:], self.normals[first:], self.counts[first:],
                       float(np.sqrt((steps**2).sum(axis=1)).sum()))


class ContactWindow:
    """
    The contacts of the last stretch of a path.

    Contacts within one cell, usually a 24th of the window, are averaged: this keeps time and
    memory bounded however slowly the finger moves, and keeps noise from lengthening the path.

    Parameters
    ----------
    length : float
        Of the path [m].
    max_turn : float
        The stretch ends where the normal has turned by more than this [rad].
    cell : float
        Distance within which contacts are averaged [m]; well above their noise.
    """

    def __init__(self, length, max_turn, cell):
        self._length, self._max_turn, self._cell = length, max_turn, cell
        self._points, self._normals, self._starts = np.zeros((3, MAX_CELLS, 3))
        self._counts = np.zeros(MAX_CELLS)
        self.reset()

    def reset(self):
        """Forget all contacts."""
        self._used = 0

    def add(self, point, normal):
        """Add a contact and return the last Stretch of the path."""
        self._used = used = _add(
            self._points, self._normals, self._starts, self._counts, self._used, point, normal,
            self._cell)
        first, extent = _span(self._points, self._normals, used, self._length, self._max_turn)
        return Stretch(self._points[first:used], self._normals[first:used],
                       self._counts[first:used], extent)
