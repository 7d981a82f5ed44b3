"""Edge of a rigid object as a polyline in space."""
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from tactile_common.errors import ConfigurationError
from tactile_common.kernels import njit
from tactile_common.polyline import arc_length, nearest_on_polyline, resample

# An edge whose ends are closer than this is a closed contour [m].
CLOSED_WITHIN = 1e-6


@dataclass(frozen=True, eq=False)
class EdgePath:
    """Edge of a rigid object, as a polyline in the base frame with its direction of travel."""

    points: np.ndarray  # vertices (N >= 2, 3), successive ones are different [m]
    solid: np.ndarray | None = None  # (N - 1,): True if a chord has material; None: all

    def __post_init__(self):
        points = np.array(self.points, dtype=float)
        if points.ndim != 2 or points.shape[1] != 3 or len(points) < 2:
            raise ConfigurationError(f'points have shape {points.shape}, must be (N >= 2, 3)')
        if not (np.isfinite(points).all() and (np.diff(points, axis=0) != 0).any(axis=1).all()):
            raise ConfigurationError('points must be finite and successively different')
        solid = np.array(np.ones(len(points) - 1) if self.solid is None else self.solid, bool)
        if solid.shape != (len(points) - 1,):
            raise ConfigurationError(
                f'solid has shape {solid.shape}, must be one for each of {len(points) - 1} chords')
        points.flags.writeable = solid.flags.writeable = False
        object.__setattr__(self, 'points', points)
        object.__setattr__(self, 'solid', solid)

    @cached_property
    def closed(self) -> bool:
        """True if the edge ends where it begins."""
        return bool(np.linalg.norm(self.points[-1] - self.points[0]) < CLOSED_WITHIN)

    @cached_property
    def arclength(self) -> np.ndarray:
        """Arc length from the first point to each point [m], shape `(N,)`."""
        return arc_length(self.points)

    @property
    def length(self) -> float:
        """Length of the whole edge [m]."""
        return float(self.arclength[-1])

    def point_at(self, s) -> np.ndarray:
        """Return points `s.shape + (3,)` [m] at arc lengths [m], clipped to the edge's ends."""
        return resample(self.points, self.arclength, np.ravel(s)).reshape(*np.shape(s), 3)

    def tangent_at(self, s) -> np.ndarray:
        """Return unit directions `s.shape + (3,)` at arc lengths [m]; at a corner the next one."""
        index = np.searchsorted(self.arclength[1:-1], s, side='right')
        chord = self.points[index + 1] - self.points[index]
        return chord / np.linalg.norm(chord, axis=-1, keepdims=True)

    def nearest(self, points) -> tuple[np.ndarray, np.ndarray]:
        """
        Project points (M, 3) of the base frame [m] onto the edge, seen from above.

        Returns
        -------
        lateral, s : np.ndarray (M,)
            Horizontal distance to the nearest point of the edge, positive to the left of the
            direction of travel, and the arc length of that point [m].
        """
        return _nearest(np.atleast_2d(np.asarray(points, float)), self.points, self.arclength)

    def beside(self, s: np.ndarray) -> np.ndarray:
        """Return which arc lengths `s` (M,) of nearest points are not at an open end."""
        return self.closed | ((s > 0.0) & (s < self.length))


@njit(cache=True)
def _nearest(points, vertices, stations):
    lateral, along = np.empty(len(points)), np.empty(len(points))
    for m in range(len(points)):
        place = nearest_on_polyline(
            vertices[:, 0], vertices[:, 1], stations, points[m, 0], points[m, 1])
        lateral[m], along[m] = place.offset, place.station
    return lateral, along
