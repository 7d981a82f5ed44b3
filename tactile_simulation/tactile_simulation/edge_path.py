"""Edge of a rigid object as a polyline in space."""
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from tactile_common.errors import ConfigurationError
from tactile_common.kernels import njit
from tactile_common.polyline import arc_length, nearest_on_polyline, resample

# An edge whose ends are nearer than this is a contour [m].
CLOSED_WITHIN = 1e-6


@dataclass(frozen=True, eq=False)
class EdgePath:
    """
    Edge of a rigid object, as a polyline in the base frame with its direction of travel.

    Parameters
    ----------
    points : np.ndarray
        Vertices [m], shape `(N, 3)`, N >= 2, no two successive ones at one place.
    solid : np.ndarray, optional
        Whether there is material along each chord, shape `(N - 1,)`; default everywhere.

    Raises
    ------
    ConfigurationError
        The points are not a polyline.
    """

    points: np.ndarray
    solid: np.ndarray | None = None

    def __post_init__(self):
        points = np.array(self.points, dtype=float)
        if points.ndim != 2 or points.shape[1] != 3 or len(points) < 2:
            raise ConfigurationError(f'points have shape {points.shape}, must be (N >= 2, 3)')
        if not (np.isfinite(points).all() and (np.diff(points, axis=0) != 0).any(axis=1).all()):
            raise ConfigurationError('points must be finite and successively different')
        solid = np.ones(len(points) - 1, bool) if self.solid is None else np.array(
            self.solid, dtype=bool)
        if solid.shape != (len(points) - 1,):
            raise ConfigurationError(
                f'solid has shape {solid.shape}, must be one for each of {len(points) - 1} chords')
        points.flags.writeable = solid.flags.writeable = False
        object.__setattr__(self, 'points', points)
        object.__setattr__(self, 'solid', solid)

    @cached_property
    def closed(self) -> bool:
        """Whether the edge ends where it begins."""
        return bool(np.linalg.norm(self.points[-1] - self.points[0]) < CLOSED_WITHIN)

    @cached_property
    def arclength(self) -> np.ndarray:
        """Length of the way from the first point to each point [m], shape `(N,)`."""
        return arc_length(self.points)

    @property
    def length(self) -> float:
        """Length of the whole edge [m]."""
        return float(self.arclength[-1])

    def point_at(self, s) -> np.ndarray:
        """
        Return the point at arc length `s`, held between the ends of the edge.

        Parameters
        ----------
        s : float or np.ndarray
            Arc length [m].

        Returns
        -------
        np.ndarray
            Point [m] in the base frame, shape `(3,)` or `s.shape + (3,)`.
        """
        return resample(self.points, self.arclength, np.ravel(s)).reshape(*np.shape(s), 3)

    def tangent_at(self, s) -> np.ndarray:
        """
        Return the unit direction of the chord at arc length `s`; at a corner, of the next one.

        Parameters
        ----------
        s : float or np.ndarray
            Arc length [m].

        Returns
        -------
        np.ndarray
            Direction in the base frame, shape `(3,)` or `s.shape + (3,)`.
        """
        index = np.searchsorted(self.arclength, s, side='right') - 1
        index = np.clip(index, 0, len(self.points) - 2)
        chord = self.points[index + 1] - self.points[index]
        return chord / np.linalg.norm(chord, axis=-1, keepdims=True)

    def nearest(self, points) -> tuple[np.ndarray, np.ndarray]:
        """
        Project points onto the edge, seen from above (along base -z).

        Parameters
        ----------
        points : np.ndarray
            Points [m] in the base frame, shape `(M, 3)`.

        Returns
        -------
        lateral : np.ndarray
            Horizontal distance to the nearest point of the edge [m], shape `(M,)`; positive to
            the left of the direction of travel.
        s : np.ndarray
            Arc length of that point [m], shape `(M,)`, between 0 and `length`.
        """
        points = np.atleast_2d(np.asarray(points, dtype=float))
        return _nearest(points, self.points, self.arclength)


@njit(cache=True)
def _nearest(points, vertices, stations):
    lateral, along = np.empty(len(points)), np.empty(len(points))
    for m in range(len(points)):
        place = nearest_on_polyline(
            vertices[:, 0], vertices[:, 1], stations, points[m, 0], points[m, 1])
        lateral[m], along[m] = place.offset, place.station
    return lateral, along
