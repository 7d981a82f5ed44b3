"""The last contacts of a path, averaged in cells so that their number is bounded."""
from typing import NamedTuple

import numpy as np

CELLS = 24  # that a window is usually divided into
MAX_TURN = 0.7  # rad of the normal, where a stretch ends
MAX_CELLS = 3 * CELLS  # noise makes cells shorter than they should be
MAX_WEIGHT = 16.0  # samples of one cell that count as independent; a finger at rest adds no more


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
        extent = float(_lengths(np.diff(self.points[first:], axis=0)).sum())
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
    cell : float
        Distance within which contacts are averaged [m]; well above their noise.
    """

    def __init__(self, length: float, cell: float):
        self._length, self._cell = length, cell
        self.reset()

    def reset(self) -> None:
        """Forget all contacts."""
        self._cells = np.empty((0, 7))  # mean point, mean normal, contacts
        self._start = np.full(3, np.nan)  # first point of the newest cell

    def add(self, point: np.ndarray, normal: np.ndarray) -> Stretch:
        """Add a contact (3,), (3,) and return the last stretch of the path."""
        contact = np.concatenate([point, normal])
        away = point - self._start
        if away @ away < self._cell**2:  # not of the first, whose start is NaN
            newest = self._cells[-1]
            newest[6] += 1.0
            newest[:6] += (contact - newest[:6]) / newest[6]
        else:
            self._cells = np.vstack([self._cells[1 - MAX_CELLS:], [*contact, 1.0]])
            self._start = point
        return self._stretch()

    def _stretch(self) -> Stretch:
        points, normals, counts = self._cells[:, :3], self._cells[:, 3:6], self._cells[:, 6]
        # From the newest cell backwards.
        travel = np.cumsum(_lengths(np.diff(points, axis=0))[::-1])
        lengths = _lengths(normals)
        turned = normals @ normals[-1] < np.cos(MAX_TURN) * lengths * lengths[-1]
        beyond = (travel > self._length) | turned[-2::-1]
        steps = int(beyond.argmax()) if beyond.any() else len(beyond)
        first = len(points) - 1 - steps
        return Stretch(points[first:], normals[first:], counts[first:],
                       float(travel[steps - 1]) if steps else 0.0)


def _lengths(vectors: np.ndarray) -> np.ndarray:
    return np.sqrt((vectors * vectors).sum(axis=1))
