"""Shapes of edges: walks of straights, corners and arcs, polygons with fillets, splines."""
import math

import numpy as np
from scipy.interpolate import CubicSpline

from tactile_common.errors import ConfigurationError
from tactile_common.polyline import arc_length, resample
from tactile_simulation.edge_path import CLOSED_WITHIN, EdgePath

# Longest chord of an arc or spline [m]; at a radius of 60 mm it leaves the circle by 0.13 um.
ARC_STEP = 0.25e-3


class Turtle:
    """Walks in a horizontal plane and remembers its vertices."""

    def __init__(self, start, heading: float):
        self.points = [np.array(start, dtype=float)]
        self.heading = heading

    def straight(self, length: float) -> None:
        """Walk ahead [m]."""
        self._step(length, self.heading)

    def turn(self, angle: float) -> None:
        """Turn on the spot, to the left if positive [rad]."""
        self.heading += angle

    def arc(self, radius: float, angle: float) -> None:
        """Walk along a circle [m], to the left if the angle is positive [rad]."""
        count = math.ceil(radius * abs(angle) / ARC_STEP)
        step = angle / count
        for _ in range(count):
            self._step(2.0 * radius * math.sin(0.5 * abs(step)), self.heading + 0.5 * step)
            self.heading += step

    def _step(self, length, heading):
        ahead = np.array([math.cos(heading), math.sin(heading)])
        self.points.append(self.points[-1] + length * ahead)


def polygon(points, radius: float, closed: bool) -> np.ndarray:
    """
    Vertices (M, 2) of straight sides with a fillet at every corner [m].

    Parameters
    ----------
    points : array_like, shape (N, 2)
        Corners before rounding [m].
    radius : float
        Of the fillets [m]; 0 leaves the corners sharp.
    closed : bool
        Whether a side leads from the last corner to the first; the last vertex then equals the
        first.

    Raises
    ------
    ConfigurationError
        A side is too short for its fillets, or two sides lie on one another.
    """
    corners = np.asarray(points, dtype=float)
    if closed:  # begins in the middle of a side, so that no corner is at the seam
        middle = 0.5 * (corners[-1] + corners[0])
        corners = np.vstack([middle, corners, middle])
    sides = np.diff(corners, axis=0)
    lengths = np.linalg.norm(sides, axis=1)
    if not lengths.min() > 0.0:
        raise ConfigurationError('two successive corners are at one place')
    along = sides / lengths[:, None]
    used = np.zeros(len(lengths))
    turns = np.zeros(len(corners))
    for k in range(1, len(corners) - 1):
        cross = along[k - 1, 0] * along[k, 1] - along[k - 1, 1] * along[k, 0]
        turns[k] = turn = math.atan2(cross, along[k - 1] @ along[k])
        if abs(turn) > math.radians(179.0):
            raise ConfigurationError(f'corner {k} turns back by {math.degrees(turn):.0f} degrees')
        used[k - 1:k + 1] += radius * math.tan(0.5 * abs(turn))
    if (used > lengths - 1e-9).any():
        k = int((used - lengths).argmax())
        raise ConfigurationError(
            f'side {k} of {lengths[k]:.6g} m is too short for fillets of {radius:g} m')
    vertices = [corners[0]]  # only now: fillets that fit are no longer than their sides
    for k in range(1, len(corners) - 1):
        vertices.extend(_fillet(corners[k], along[k - 1], along[k], turns[k], radius))
    return np.array([*vertices, corners[-1]])


def _fillet(corner, arriving, leaving, turn, radius):
    """Vertices of the arc that rounds a corner."""
    count = math.ceil(radius * abs(turn) / ARC_STEP)
    if count == 0:
        return [corner]
    setback = radius * math.tan(0.5 * abs(turn))
    side = math.copysign(radius, turn)
    first = corner - setback * arriving
    centre = first + side * np.array([-arriving[1], arriving[0]])
    angles = turn * np.arange(count + 1) / count
    cos, sin = np.cos(angles), np.sin(angles)
    x, y = first - centre
    return list(centre + np.column_stack([cos * x - sin * y, sin * x + cos * y]))


def spline(points, closed: bool) -> np.ndarray:
    """Smooth curve through points, cubic in the length of their polygon; else as `polygon`."""
    knots = np.asarray(points, dtype=float)
    if closed:
        knots = np.vstack([knots, knots[:1]])
    parameter = arc_length(knots)
    if not np.diff(parameter).min() > 0.0:
        raise ConfigurationError('two successive points are at one place')
    curve = CubicSpline(parameter, knots, bc_type='periodic' if closed else 'not-a-knot')
    # Between knots the curve is longer than the polygon, but never by half in a usable scene.
    count = math.ceil(1.5 * parameter[-1] / ARC_STEP)
    vertices = curve(np.linspace(0.0, parameter[-1], count + 1))
    if closed:
        vertices[-1] = vertices[0]
    return vertices


def lifted(plan: np.ndarray, base_z: float, *, height=None,
           wave: tuple[float, float] | None = None, gaps=()) -> EdgePath:
    """
    Edge in space above its plan.

    Parameters
    ----------
    plan : ndarray, shape (N, 2)
        Vertices seen from above [m].
    base_z : float
        Height of the plan in the base frame [m].
    height : array_like, shape (K, 2), optional
        Distance along the plan and height above it; two rows of one distance are a step [m].
    wave : tuple of two floats, optional
        Height from trough to crest and length of a sinusoidal wave [m].
    gaps : sequence of pairs
        Parts of the plan without material: from, to [m].
    """
    along = arc_length(plan)
    if abs(along[-1]) > 0.0 and np.linalg.norm(plan[-1] - plan[0]) < CLOSED_WITHIN:
        plan = np.vstack([plan[:-1], plan[:1]])
    knots = [along]
    if height is not None:
        knots.append(np.asarray(height)[:, 0])
    if wave is not None:
        knots.append(np.arange(0.0, along[-1], wave[1] / 64.0))
    knots.extend(np.asarray(gap) for gap in gaps)
    s = np.unique(np.concatenate(knots))
    s = s[(s >= 0.0) & (s <= along[-1])]
    s = s[np.concatenate([[True], np.diff(s) > 1e-9])]
    z = np.full(len(s), float(base_z))
    if wave is not None:
        z += 0.5 * wave[0] * np.sin(2.0 * np.pi * s / wave[1])
    if height is not None:
        s, z = _stepped(s, z, np.asarray(height, dtype=float))
    x, y = resample(plan, along, s).T
    middle = 0.5 * (s[1:] + s[:-1])
    solid = np.diff(s) > 0.0  # the face of a step is no edge
    for first, last in gaps:
        solid &= (middle < first) | (middle > last)
    return EdgePath(np.column_stack([x, y, z]), solid)


def _stepped(s, z, height):
    """Add a height profile with steps: at a step the distance occurs twice."""
    steps = height[:-1, 0][np.diff(height[:, 0]) == 0.0]
    steps = np.intersect1d(steps, s)
    order = np.argsort(np.concatenate([s, steps]), kind='stable')
    s, z = np.concatenate([s, steps])[order], np.concatenate([z, np.interp(steps, s, z)])[order]
    after = np.concatenate([[False], np.diff(s) == 0.0])
    # At a step `np.interp` takes the height behind it; seen the other way, that before it.
    right = np.interp(s, *height.T)
    left = np.interp(-s, -height[::-1, 0], height[::-1, 1])
    before = np.concatenate([after[1:], [False]])
    return s, z + np.where(before, left, right)
