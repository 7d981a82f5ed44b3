"""Model of a touched object: an outline from its edges and a surface from patches."""
from collections import deque
from dataclasses import dataclass
from operator import itemgetter
from os import PathLike
from typing import NamedTuple

import numpy as np

from tactile_common.config import bounded, check_fields
from tactile_common.errors import ConfigurationError
from tactile_shape.ply import write_ply
from tactile_shape.types.patch import Kind, Patch

# Red, green and blue of each kind of patch.
COLOURS = {Kind.NONE: (0.6, 0.6, 0.6), Kind.PLANE: (0.30, 0.55, 0.80),
           Kind.CYLINDER: (0.25, 0.65, 0.40), Kind.SPHERE: (0.90, 0.60, 0.15),
           Kind.GENERAL: (0.75, 0.30, 0.35)}
PATCH_SPACING = 4e-3  # m, smallest distance between successive stored patches
PATCH_SIZE = 6e-3  # m, side of a drawn patch
STEPS = (5, 5)  # points along the sides of a patch
RECENT = 20  # newest contour points, with which a contact is compared
TAIL = 100  # newest contacts of a stroke, used to locate its ends
# Largest distance of such a contact behind the last point, as a share of the spacing: at contacts
# farther behind, the pad was still moving.
BEHIND = 0.4


@dataclass(frozen=True)
class ModelConfig:
    """Limits of the stored contour points and patches."""

    spacing: float = bounded(
        1e-3, 'distance between the contour points that are kept', 'm', 1e-5, 0.1)
    max_points: int = bounded(
        5000, 'contour points, and patches, that are kept; the oldest go first', '', 10, 1000000)

    def __post_init__(self) -> None:
        check_fields(self)


class Mesh(NamedTuple):
    """Coloured triangles."""

    vertices: np.ndarray  # (V, 3) [m]
    colours: np.ndarray  # (V, 3), red, green and blue
    faces: np.ndarray  # (F, 3), vertices of each triangle


class ObjectModel:
    """Contour and patches of an object, accumulated with bounded memory."""

    def __init__(self, config: ModelConfig | None = None):
        self.config = config or ModelConfig()
        # Contour points (3,) [m] of each stroke of unbroken contact, and the number ever stored.
        self.strokes: list[list[np.ndarray]] = []
        self.total = 0
        self.patches: list[Patch] = []
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
                             < self.config.spacing**2):
            if not self._anew:
                self._tail.append(position)
            return False
        if self._anew:
            self.strokes.append([])
        elif len(self.strokes[-1]) == 1:
            self._begin_at_first()
        self._anew = False
        self._keep(position)
        self._tail.append(position)
        return True

    def _begin_at_first(self) -> None:
        """Move a stroke's start to its first contacts: the very first is light and inaccurate."""
        first = np.array(self._tail)[:len(self._tail) // 4 + 1]
        if len(first) > 2:
            away = ((first - np.median(first, axis=0))**2).sum(axis=1)
            self.strokes[-1][0] = first[away.argmin()]

    def _end_stroke(self) -> None:
        """End a stroke at the median of the newest contacts near or beyond its last point."""
        before, last = self.strokes[-1][-2:]
        onward = (last - before) / np.linalg.norm(last - before)
        beyond = [(float((position - last) @ onward), position) for position in self._tail]
        about = [item for item in beyond if item[0] > -BEHIND * self.config.spacing]
        if len(about) < 3:
            return
        newest = sorted(about[len(about) // 2:], key=itemgetter(0))
        ahead, end = newest[(len(newest) - 1) // 2]
        if ahead > 0.0:
            self._keep(end)
        else:
            self.strokes[-1][-1] = end

    def _keep(self, position: np.ndarray) -> None:
        self.strokes[-1].append(position)
        self._recent.append(position)
        self.total += 1
        if sum(map(len, self.strokes)) > self.config.max_points:
            self.strokes[0].pop(0)
            if not self.strokes[0]:
                self.strokes.pop(0)

    def add_patch(self, patch: Patch) -> bool:
        """Add a valid patch; return True if it was far enough from the last one to be stored."""
        if not patch.valid:
            return False
        if self.patches and np.linalg.norm(
                patch.origin - self.patches[-1].origin) < PATCH_SPACING:
            return False
        self.patches.append(patch)
        if len(self.patches) > self.config.max_points:
            self.patches.pop(0)
        return True

    @property
    def contour(self) -> np.ndarray:
        """All contour points, ndarray (N, 3)."""
        return np.array([point for stroke in self.strokes for point in stroke]).reshape(-1, 3)

    def mesh(self, patches: list[Patch] | None = None) -> Mesh:
        """Return the patches as triangles, coloured by kind."""
        vertices, colours, faces = [np.zeros((0, 3))], [np.zeros((0, 3))], [np.zeros((0, 3), int)]
        rows, columns = STEPS
        corner = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).reshape(-1, 1)
        squares = np.concatenate([corner + [0, columns, 1], corner + [1, columns, columns + 1]])
        for patch in self.patches if patches is None else patches:
            sheet = patch.sheet(PATCH_SIZE, PATCH_SIZE, steps=STEPS).reshape(-1, 3)
            whole = squares[np.isfinite(sheet).all(axis=1)[squares].all(axis=1)]
            faces.append(whole + sum(map(len, vertices)))
            vertices.append(np.where(np.isfinite(sheet), sheet, patch.origin))
            colours.append(np.tile(COLOURS[patch.kind], (len(sheet), 1)))
        return Mesh(np.concatenate(vertices), np.concatenate(colours), np.concatenate(faces))

    def save_surface(self, path: str | PathLike) -> None:
        """Write the patches as a coloured PLY mesh; ConfigurationError if it fails."""
        mesh = self.mesh()
        write_ply(path, mesh.vertices, colours=mesh.colours, faces=mesh.faces,
                  comment='patches: blue plane, green cylinder, orange sphere, red general; m')

    def save_points(self, path: str | PathLike) -> None:
        """Write the contour as a CSV table; ConfigurationError if it fails."""
        rows = (f'{number},{x:.9g},{y:.9g},{z:.9g}\n'
                for number, stroke in enumerate(self.strokes) for x, y, z in stroke)
        try:
            with open(path, 'w', encoding='utf-8') as file:
                file.writelines(('stroke,x,y,z\n', *rows))
        except OSError as error:
            raise ConfigurationError(f'{path}: cannot be written: {error.strerror}') from error

    def save_contour(self, path: str | PathLike) -> None:
        """Write the contour as vertices and edges in PLY; ConfigurationError if it fails."""
        edges, first = [], 0
        for stroke in self.strokes:
            edges += [(k, k + 1) for k in range(first, first + len(stroke) - 1)]
            first += len(stroke)
        write_ply(path, self.contour, edges=edges, comment='contour; m')


def model_of(patches: list[Patch]) -> ObjectModel:
    """Return the model of some patches, with their origins as its contour."""
    model = ObjectModel()
    for patch in patches:
        model.add_contact(patch.origin)
        model.add_patch(patch)
    return model
