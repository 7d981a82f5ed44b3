"""Edge of a rigid object as a polyline in space, and its shape from the elements of a path."""
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
import math

import numpy as np
from numpy.typing import ArrayLike

from tactile_common.errors import ConfigurationError
from tactile_common.polyline import arc_length, nearest_on_polyline, resample

# An edge whose ends are closer than this is a closed contour [m].
CLOSED_WITHIN = 1e-4
# Longest chord of an arc [m]; at a radius of 60 mm its error is 0.13 um.
ARC_STEP = 0.25e-3
STEP = 1e-8  # m, horizontal length of a step


@dataclass(frozen=True, eq=False)
class EdgePath:
    """Edge of a rigid object, as a polyline in the base frame with its direction of travel."""

    points: np.ndarray  # vertices (N >= 2, 3), successive ones are different [m]
    solid: np.ndarray | None = None  # (N - 1,): True if a chord has material; None: all

    def __post_init__(self) -> None:
        points = np.array(self.points, dtype=float)
        if points.ndim != 2 or points.shape[1] != 3 or len(points) < 2:
            raise ConfigurationError(f'points have shape {points.shape}, must be (N >= 2, 3)')
        if not (np.isfinite(points).all() and (np.diff(points, axis=0) != 0).any(axis=1).all()):
            raise ConfigurationError('points must be finite and successively different')
        object.__setattr__(self, 'points', points)
        if self.solid is None:
            object.__setattr__(self, 'solid', np.ones(len(points) - 1, bool))

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

    def point_at(self, s: ArrayLike) -> np.ndarray:
        """Return points `s.shape + (3,)` [m] at arc lengths [m], clipped to the edge's ends."""
        return resample(self.points, self.arclength, np.ravel(s)).reshape(*np.shape(s), 3)

    def samples(self) -> np.ndarray:
        """Return the vertices and points between them, at most `ARC_STEP` apart (N, 3) [m]."""
        s = np.linspace(0.0, self.length, math.ceil(self.length / ARC_STEP) + 1)
        return self.point_at(np.union1d(s, self.arclength))

    def tangent_at(self, s: ArrayLike) -> np.ndarray:
        """Return unit directions `s.shape + (3,)` at arc lengths [m]; at a corner the next one."""
        index = np.searchsorted(self.arclength[1:-1], s, side='right')
        chord = self.points[index + 1] - self.points[index]
        return chord / np.linalg.norm(chord, axis=-1, keepdims=True)

    def nearest(self, points: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
        """
        Project points (M, 3) of the base frame [m] onto the edge, seen from above.

        Returns
        -------
        lateral, s : np.ndarray (M,)
            Horizontal distance to the nearest point of the edge, positive to the left of the
            direction of travel, and the arc length of that point [m].
        """
        xs, ys, _ = self.points.T
        places = [nearest_on_polyline(xs, ys, self.arclength, x, y, -math.inf, math.inf)
                  for x, y, _ in np.atleast_2d(np.asarray(points, float)).tolist()]
        return (np.array([place.offset for place in places]),
                np.array([place.station for place in places]))

    def beside(self, s: np.ndarray) -> np.ndarray:
        """Return which arc lengths `s` (M,) of nearest points are not at an open end."""
        return self.closed | ((s > 0.0) & (s < self.length))


def walk(start: Sequence[float], heading: float,
         elements: Sequence[tuple[float, float]]) -> np.ndarray:
    """
    Return the vertices (N, 2) of a path in a plane [m].

    Each element has a length [m] and a turn to the left [rad]: a straight does not turn, a corner
    has no length, all others are arcs.
    """
    headings: list[float] = []
    lengths: list[float] = []
    for length, turn in elements:
        if length:
            count = math.ceil(length / ARC_STEP) if turn else 1
            headings.extend(heading + turn * (np.arange(count) + 0.5) / count)
            # The chord of an arc is 2 r sin(angle / 2); np.sinc(x) is sin(pi x) / (pi x).
            lengths.extend([length / count * np.sinc(0.5 * turn / count / math.pi)] * count)
        heading += turn
    steps = np.array(lengths) * [np.cos(headings), np.sin(headings)]
    return np.vstack([start, start + steps.T.cumsum(axis=0)])


def lifted(plan: np.ndarray, z: float, height: ArrayLike = ((0.0, 0.0),),
           wave: tuple[float, float] = (0.0, math.inf), gaps: ArrayLike = ()) -> EdgePath:
    """
    Return the edge in space above its plan; it is closed if the plan ends where it begins.

    Parameters
    ----------
    plan : ndarray, shape (N, 2)
        Vertices seen from above [m].
    z : float
        Height of the plan in the base frame [m].
    height : array_like, shape (K, 2)
        Distance along the plan and height above it; two rows with equal distance are a step [m].
    wave : tuple of two floats
        Height from trough to crest and length of a sinusoidal wave [m].
    gaps : array_like, shape (G, 2)
        Parts of the plan without material: from, to, ascending [m].
    """
    if np.linalg.norm(plan[-1] - plan[0]) < CLOSED_WITHIN:
        plan = np.vstack([plan[:-1], plan[:1]])
    along, height = arc_length(plan), np.array(height, dtype=float)
    height[1:, 0] += STEP * (np.diff(height[:, 0]) == 0.0)
    s = np.unique(np.concatenate([
        along, height[:, 0], np.ravel(gaps), np.arange(0.0, along[-1], wave[1] / 64.0)]))
    s = s[(s >= 0.0) & (s <= along[-1]) & (np.diff(s, prepend=-1.0) > 1e-9)]
    heights = z + np.interp(s, *height.T) + 0.5 * wave[0] * np.sin(2.0 * np.pi * s / wave[1])
    middle = 0.5 * (s[1:] + s[:-1])
    solid = np.searchsorted(np.ravel(gaps), middle) % 2 == 0
    solid &= np.diff(s) > 2.0 * STEP  # the face of a step is not part of the edge
    return EdgePath(np.column_stack([resample(plan, along, s), heights]), solid)
