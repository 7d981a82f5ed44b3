"""Shapes of edges: paths of straights, corners and arcs, and polygons with fillets."""
import math

import numpy as np

from tactile_common.errors import ConfigurationError
from tactile_common.geometry import wrap_angle
from tactile_common.polyline import arc_length, resample
from tactile_simulation.edge_path import CLOSED_WITHIN, EdgePath

# Longest chord of an arc [m]; at a radius of 60 mm its error is 0.13 um.
ARC_STEP = 0.25e-3
STEP = 1e-8  # m, horizontal length of a step


class Turtle:
    """Walks in a horizontal plane and stores its vertices."""

    def __init__(self, start, heading: float):
        self.points = [np.array(start, dtype=float)]
        self.heading = heading

    def straight(self, length: float) -> None:
        """Walk straight ahead [m]."""
        self._step(length, self.heading)

    def turn(self, angle: float) -> None:
        """Turn on the spot, to the left if positive [rad]."""
        self.heading += angle

    def arc(self, radius: float, angle: float) -> None:
        """Walk along a circle of a radius [m], to the left if the angle is positive [rad]."""
        count = math.ceil(radius * abs(angle) / ARC_STEP)
        for step in [angle / max(count, 1)] * count:
            self._step(2.0 * radius * math.sin(0.5 * abs(step)), self.heading + 0.5 * step)
            self.heading += step

    def _step(self, length, heading):
        ahead = np.array([math.cos(heading), math.sin(heading)])
        self.points.append(self.points[-1] + length * ahead)


def polygon(points, radius: float, closed: bool) -> np.ndarray:
    """
    Return vertices (M, 2) of straight sides with a fillet at every corner [m].

    Parameters
    ----------
    points : array_like, shape (N, 2)
        Corners before rounding [m].
    radius : float
        Radius of the fillets [m]; 0 leaves the corners sharp.
    closed : bool
        True if a side connects the last corner with the first; the last vertex then equals the
        first one.

    Raises
    ------
    ConfigurationError
        A side is too short for its fillets, or two sides coincide.
    """
    corners = np.asarray(points, dtype=float)
    if closed:  # begins in the middle of a side, so that no corner is at the seam
        middle = 0.5 * (corners[-1] + corners[0])
        corners = np.vstack([middle, corners, middle])
    sides = np.diff(corners, axis=0)
    lengths = np.linalg.norm(sides, axis=1)
    if not lengths.min() > 0.0:
        raise ConfigurationError('two successive corners are at one place')
    headings = np.arctan2(sides[:, 1], sides[:, 0])
    turns = wrap_angle(np.diff(headings))
    for k, turn in enumerate(turns, 1):
        if abs(turn) > math.radians(179.0):
            raise ConfigurationError(f'corner {k} turns back by {math.degrees(turn):.0f} degrees')
    setbacks = np.array([0.0, *radius * np.tan(0.5 * np.abs(turns)), 0.0])
    straights = lengths - setbacks[:-1] - setbacks[1:]
    if straights.min() < 1e-9:
        k = int(straights.argmin())
        raise ConfigurationError(
            f'side {k} of {lengths[k]:.6g} m is too short for fillets of {radius:g} m')
    if not radius:
        return corners
    turtle = Turtle(corners[0], headings[0])
    for length, turn in zip(straights, [*turns, 0.0], strict=True):
        turtle.straight(length)
        turtle.arc(radius, turn)
    return np.array(turtle.points)


def lifted(plan: np.ndarray, base_z: float, *, height=None,
           wave: tuple[float, float] | None = None, gaps=()) -> EdgePath:
    """
    Return the edge in space above its plan.

    Parameters
    ----------
    plan : ndarray, shape (N, 2)
        Vertices seen from above [m].
    base_z : float
        Height of the plan in the base frame [m].
    height : array_like, shape (K, 2), optional
        Distance along the plan and height above it; two rows with equal distance are a step [m].
    wave : tuple of two floats, optional
        Height from trough to crest and length of a sinusoidal wave [m].
    gaps : sequence of pairs
        Parts of the plan without material: from, to [m].
    """
    along = arc_length(plan)
    if np.linalg.norm(plan[-1] - plan[0]) < CLOSED_WITHIN:
        plan = np.vstack([plan[:-1], plan[:1]])
    knots = [along, *gaps]
    if height is not None:
        height = np.array(height, dtype=float)
        height[1:, 0] += STEP * (np.diff(height[:, 0]) == 0.0)
        knots.append(height[:, 0])
    if wave is not None:
        knots.append(np.arange(0.0, along[-1], wave[1] / 64.0))
    s = np.unique(np.concatenate(knots))
    s = s[(s >= 0.0) & (s <= along[-1]) & (np.diff(s, prepend=-1.0) > 1e-9)]
    z = np.full(len(s), float(base_z))
    if wave is not None:
        z += 0.5 * wave[0] * np.sin(2.0 * np.pi * s / wave[1])
    if height is not None:
        z += np.interp(s, *height.T)
    middle = 0.5 * (s[1:] + s[:-1])
    solid = np.diff(s) > 2.0 * STEP  # the face of a step is not part of the edge
    for first, last in gaps:
        solid &= (middle < first) | (middle > last)
    return EdgePath(np.column_stack([resample(plan, along, s), z]), solid)
