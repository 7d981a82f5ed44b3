"""Model of a touched object: strokes along its edges and patches of its surface."""
from collections import deque
from os import PathLike

import numpy as np

from tactile_shape.types.patch import Patch

SPACING = 1e-3  # m between stored contour points; `find_outline` averages over as much
PATCH_SPACING = 4e-3  # m, smallest distance between successive stored patches
MAX_POINTS = 5000  # stored contour points, and patches: 5 m of edge; the oldest go first
RECENT = 20  # newest contour points, with which a contact is compared
TAIL = 100  # newest contacts of a stroke, used to locate its ends
# Largest distance of such a contact behind the last point, as a share of the spacing: at contacts
# farther behind, the pad was still moving.
BEHIND = 0.4


class ObjectModel:
    """Contour and patches of an object, accumulated with bounded memory."""

    def __init__(self) -> None:
        # Contour points (3,) [m] of each stroke of unbroken contact, and the number ever stored.
        self.strokes: list[list[np.ndarray]] = []
        self.total = 0
        self.patches: deque[Patch] = deque(maxlen=MAX_POINTS)
        self._recent: deque[np.ndarray] = deque(maxlen=RECENT)
        self._tail: deque[np.ndarray] = deque(maxlen=TAIL)
        self._anew = True

    def begin_stroke(self) -> None:
        """End the present stroke after a loss of contact; the next contact begins a new one."""
        if not self._anew and len(self.strokes[-1]) > 1:
            self._end_stroke()
        self._tail.clear()
        self._anew = True

    def add_contact(self, position: np.ndarray) -> bool:
        """
        Add a point (3,) of the contour [m]; return True if it was far enough to be stored.

        The distance is to all recent points: a pad that stands still, or moves back a little at
        the end of an edge, adds nothing.
        """
        position = np.array(position, dtype=float)
        if self._recent and (((np.array(self._recent) - position)**2).sum(axis=1).min()
                             < SPACING**2):
            if not self._anew:
                self._tail.append(position)
            return False
        if self._anew:
            self.strokes.append([])
        elif len(self.strokes[-1]) == 1:
            # The very first contact is light and inaccurate: begin among the first ones.
            first = np.array(self._tail)[:len(self._tail) // 4 + 1]
            if len(first) > 2:
                self.strokes[-1][0] = _most_central(first)
        self._anew = False
        self._keep(position)
        self._tail.append(position)
        return True

    def _end_stroke(self) -> None:
        """End a stroke among the newest contacts near or beyond its last point."""
        before, last = self.strokes[-1][-2:]
        onward = (last - before) / np.linalg.norm(last - before)
        tail = np.array(self._tail)
        about = tail[(tail - last) @ onward > -BEHIND * SPACING]
        if len(about) < 3:
            return
        end = _most_central(about[len(about) // 2:])
        if (end - last) @ onward > 0.0:
            self._keep(end)
        else:
            self.strokes[-1][-1] = end

    def _keep(self, position: np.ndarray) -> None:
        self.strokes[-1].append(position)
        self._recent.append(position)
        self.total += 1
        if sum(map(len, self.strokes)) > MAX_POINTS:
            self.strokes[0].pop(0)
            if not self.strokes[0]:
                self.strokes.pop(0)

    def add_patch(self, patch: Patch) -> None:
        """Store a patch if it is valid and far enough from the last one."""
        if patch.valid and not (self.patches and np.linalg.norm(
                patch.origin - self.patches[-1].origin) < PATCH_SPACING):
            self.patches.append(patch)

    @property
    def contour(self) -> np.ndarray:
        """All contour points, ndarray (N, 3)."""
        return np.array([point for stroke in self.strokes for point in stroke]).reshape(-1, 3)

    def save_points(self, path: str | PathLike) -> None:
        """Write the contour as a CSV table: number of the stroke, x, y, z [m]."""
        rows = [(number, *point) for number, stroke in enumerate(self.strokes)
                for point in stroke]
        np.savetxt(path, np.reshape(rows, (-1, 4)), '%.9g', ',', header='stroke,x,y,z',
                   comments='')


def _most_central(points: np.ndarray) -> np.ndarray:
    """Return the point of points (N, 3) that is nearest to their median."""
    return points[((points - np.median(points, axis=0))**2).sum(axis=1).argmin()]
