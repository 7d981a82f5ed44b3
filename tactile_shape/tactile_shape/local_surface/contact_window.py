"""Window of the last contacts of a path, averaged in cells so that their number is bounded."""
import numpy as np

CELLS = 24  # usual number of cells in a window
MAX_CELLS = 3 * CELLS  # with noise, cells are shorter than intended
MAX_TURN = 0.7  # rad, largest turn of the normal within a window


class ContactWindow:
    """
    Contacts of the last part of a path, in which the normal has turned by at most `MAX_TURN`.

    Contacts within one cell, usually a 24th of the window, are averaged. This bounds time and
    memory however slowly the finger moves, and prevents noise from lengthening the path.

    Parameters
    ----------
    length : float
        Length of the path [m].
    cell : float
        Distance within which contacts are averaged [m]; must be well above their noise.
    """

    def __init__(self, length: float, cell: float):
        self._length, self._cell = length, cell
        self.reset()

    def reset(self) -> None:
        """Remove all contacts."""
        self._cells = np.empty((0, 7))  # mean point, mean normal, number of contacts
        self._start = np.full(3, np.nan)  # first point of the newest cell

    def add(self, point: np.ndarray, normal: np.ndarray) -> np.ndarray:
        """
        Add a contact (3,) with its normal (3,); return the cells of the window, oldest first.

        The rows (m, 7) are mean point, mean normal and number of contacts. They are a view that is
        valid until the next contact is added.
        """
        contact = np.concatenate([point, normal])
        away = point - self._start
        if away @ away < self._cell**2:  # false for the first contact: start is NaN
            newest = self._cells[-1]
            newest[6] += 1.0
            newest[:6] += (contact - newest[:6]) / newest[6]
        else:
            self._cells = np.vstack([self._cells[1 - MAX_CELLS:], [*contact, 1.0]])
            self._start = point
        normals = self._cells[:, 3:6]
        # From the newest cell backwards.
        travel = np.cumsum(_steps(self._cells)[::-1])
        lengths = np.sqrt((normals * normals).sum(axis=1))
        turned = normals @ normals[-1] < np.cos(MAX_TURN) * lengths * lengths[-1]
        beyond = (travel > self._length) | turned[-2::-1]
        steps = int(beyond.argmax()) if beyond.any() else len(beyond)
        return self._cells[len(self._cells) - 1 - steps:]


def path_length(cells: np.ndarray) -> float:
    """Return the length of the path through cells (m, 7) [m]."""
    return float(_steps(cells).sum())


def _steps(cells: np.ndarray) -> np.ndarray:
    steps = np.diff(cells[:, :3], axis=0)
    return np.sqrt((steps * steps).sum(axis=1))
