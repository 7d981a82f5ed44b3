"""The last contacts of a path, averaged in cells so that their number is bounded."""
from typing import NamedTuple

import numpy as np

from tactile_common.kernels import njit

CELLS = 24  # that a window is usually divided into
MAX_CELLS = 3 * CELLS  # noise makes cells shorter than they should be
MAX_WEIGHT = 16.0  # samples of one cell that count as independent; a finger at rest adds no more


class _Cells(NamedTuple):
    points: np.ndarray  # (n, 3), means
    normals: np.ndarray  # (n, 3), means
    starts: np.ndarray  # (n, 3), where each cell began
    counts: np.ndarray  # (n,), contacts in it


@njit(cache=True)
def _add(cells, used, point, normal, size):
    """Add a contact to the newest cell, or open one; returns how many cells there are."""
    points, normals, starts, counts = cells
    if used and ((point - starts[used - 1])**2).sum() < size * size:
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
def _span(cells, used, length, max_turn):
    """First cell within a length of path, and the length of the path from there [m]."""
    points, normals = cells.points, cells.normals
    first, travel = used - 1, 0.0
    newest = normals[used - 1]
    flattest = np.cos(max_turn) * np.sqrt((newest * newest).sum())
    while first > 0:
        step = np.sqrt(((points[first] - points[first - 1])**2).sum())
        other = normals[first - 1]
        turned = (newest * other).sum() < flattest * np.sqrt((other * other).sum())
        if travel + step > length or turned:
            break
        first, travel = first - 1, travel + step
    return first, travel


@njit(cache=True)
def _take(cells, used, point, normal, size, length, max_turn):
    """Add a contact; returns how many cells there are, the first of the stretch, its length."""
    used = _add(cells, used, point, normal, size)
    first, extent = _span(cells, used, length, max_turn)
    return used, first, extent


class Stretch(NamedTuple):
    """Contacts in cells, the oldest first: views, valid until the next contact is added."""

    points: np.ndarray  # (m, 3) [m]
    normals: np.ndarray  # (m, 3)
    counts: np.ndarray  # (m,), contacts in each cell
    extent: float  # length of the path [m]

    @property
    def weights(self) -> np.ndarray:
        """Contacts in each cell that count as independent, ndarray (m,)."""
        return np.minimum(self.counts, MAX_WEIGHT)

    @property
    def samples(self) -> int:
        """Contacts in all cells."""
        return int(self.counts.sum())

    def newer_half(self) -> 'Stretch':
        """Return the newer half of the cells."""
        first = (len(self.points) + 1) // 2
        steps = np.diff(self.points[first:], axis=0)
        extent = float(np.sqrt((steps**2).sum(axis=1)).sum())
        return Stretch(self.points[first:], self.normals[first:], self.counts[first:], extent)


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

    def __init__(self, length: float, max_turn: float, cell: float):
        self._length, self._max_turn, self._cell = length, max_turn, cell
        self._cells = _Cells(*np.zeros((3, MAX_CELLS, 3)), np.zeros(MAX_CELLS))
        self.reset()

    def reset(self) -> None:
        """Forget all contacts."""
        self._used = 0

    def add(self, point: np.ndarray, normal: np.ndarray) -> Stretch:
        """Add a contact (3,), (3,) and return the last stretch of the path."""
        cells = self._cells
        self._used, first, extent = _take(
            cells, self._used, point, normal, self._cell, self._length, self._max_turn)
        part = slice(first, self._used)
        return Stretch(cells.points[part], cells.normals[part], cells.counts[part], extent)
