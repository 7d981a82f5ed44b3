"""Outline of an object from the contour along its edge: corners and sides with their shape."""
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from tactile_common.errors import ConfigurationError
from tactile_common.polyline import arc_length
from tactile_shape.contour.curves import (
    angle_between,
    Curve,
    fit_curve,
    joints,
    Line,
    meeting,
    on_curve,
)

STRAIGHT = 0.1  # width per length below which a contour does not define a plane
ROUNDING = 3e-3  # m of contour next to a corner, not used because the skin rounds it
# m, largest distance of contacts at a corner from the sides, in addition to that of an arc with a
# radius of `ROUNDING`.
BLUNTED = 0.45e-3
FARTHEST = 3.0 * ROUNDING  # m, largest distance of a corner from the contour
LEAST_TURN = 0.05  # rad; a line that turns by less continues the line before it
CORNER_ANGLE = 0.5  # rad; a larger turn between a line and an arc is a corner
SHORTEST = 12e-3  # m; a shorter contour is refused, a longer step is a gap
TOLERANCE = 1e-4  # m, departure of a contour from lines and arcs, in addition to its noise
SPACING = 1e-3  # m; contour points closer than this are averaged
CLOSING = 2e-3  # m, largest gap between the ends of a closed contour


@dataclass(frozen=True, eq=False)
class Side:
    """Piece of an outline between corners, or between a line and an arc; in metres."""

    kind: str  # 'line' or 'arc', the simplest that explains its points
    length: float  # along the arc
    radius: float  # of an arc; inf for a line
    # (m, 3), from corner, joint or end of an open contour to the next; an arc as chords of at
    # most 1 mm.
    points: np.ndarray


@dataclass(frozen=True, eq=False)
class Outline:
    """Outline of an object in the plane of its contour."""

    corners: np.ndarray  # (c, 3), intersections of the sides, without rounding by the skin [m]
    angles: np.ndarray  # (c,), turn about the plane's normal, positive to the left [rad]
    sides: tuple[Side, ...]
    closed: bool

    @property
    def points(self) -> np.ndarray:
        """The whole outline as a polyline, ndarray (N, 3) [m]; if closed, it ends at its start."""
        return np.concatenate([self.sides[0].points[:1], *(s.points[1:] for s in self.sides)])

    def __str__(self) -> str:
        """Return lines of text: sides and corners."""
        lines = [f'{"closed" if self.closed else "open"} outline, {len(self.corners)} corners']
        for k, side in enumerate(self.sides):
            form = '' if side.kind == 'line' else f', radius {1e3 * side.radius:.2f} mm'
            lines.append(f'side {k + 1}: {side.kind}, {1e3 * side.length:.2f} mm{form}')
        for k, (corner, angle) in enumerate(zip(self.corners, self.angles, strict=True)):
            x, y, z = np.round(1e3 * corner, 2) + 0.0  # no minus zero
            lines.append(f'corner {k + 1}: ({x:.2f}, {y:.2f}, {z:.2f}) mm, turn '
                         f'{np.degrees(angle):.1f} deg')
        return '\n'.join(lines)


def find_outline(points: ArrayLike) -> Outline:
    """
    Find corners and sides of a contour: points (N, 3) along the edge, in order [m].

    A closed contour may overlap at its end.

    Raises
    ------
    ConfigurationError
        There are fewer than four points, a number is not finite, the contour is too short, or most
        of it lies between points that are far from each other.
    """
    points = np.asarray(points, dtype=float)
    if points.ndim != 2 or points.shape[1] != 3 or len(points) < 4:
        raise ConfigurationError(f'contour has shape {points.shape}, must be (N, 3), N above 3')
    if not np.isfinite(points).all():
        raise ConfigurationError('contour: a number is not finite')
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    length, unseen = steps.sum(), steps[steps > SHORTEST].sum()
    if length < SHORTEST:
        raise ConfigurationError(
            f'contour is {1e3 * length:.3g} mm long, must be at least {1e3 * SHORTEST:.3g} mm')
    if unseen > 0.5 * length:
        raise ConfigurationError(f'contour: along {1e3 * unseen:.0f} of its {1e3 * length:.0f} mm '
                                 'there is no point, must be at most half')
    centre, axes = _plane(points)
    flat, closed = _cut_overlap((points - centre) @ axes[:, :2])
    flat = _average(flat)
    if len(flat) < 4:
        raise ConfigurationError('contour: fewer than four of its points are apart')
    std = float(np.hypot(TOLERANCE, 1.5 * _noise(flat)))
    runs = _runs(flat, closed, std)
    return _assemble(runs, closed, std, lambda u: centre + np.asarray(u) @ axes[:, :2].T)


def _runs(flat: np.ndarray, closed: bool, std: float) -> list[np.ndarray]:
    """Divide a contour (n, 2) at corners, and between lines and arcs."""
    order = np.arange(len(flat))
    if closed:  # begin in the middle of the longest run, and join its halves at the end
        order = np.append(order, 0)
        ends = joints(flat[order], std)
        longest = int(np.argmax(np.diff(ends)))
        order = np.roll(order[:-1], -(ends[longest] + ends[longest + 1]) // 2)
        order = np.append(order, order[0])
    ends = joints(flat[order], std)
    runs = [order[a:b + 1] for a, b in zip(ends, ends[1:], strict=False)]
    k = 1
    while k < len(runs):
        one, other, *after = [_side_of(flat[run], std) for run in runs[k - 1:k + 2]]
        if _turn_of_lines(one, other) < LEAST_TURN:
            runs[k - 1:k + 1] = [np.concatenate([runs[k - 1], runs[k][1:]])]
        elif after and _is_rounding(one, flat[runs[k]], after[0]):
            corner = meeting(one, after[0], flat[runs[k][0]])
            nearest = np.linalg.norm(flat[runs[k]] - corner, axis=1).argmin()
            runs[k - 1:k + 2] = [np.concatenate([runs[k - 1], runs[k][1:nearest + 1]]),
                                 np.concatenate([runs[k][nearest:], runs[k + 1][1:]])]
        else:
            k += 1
    if closed and len(runs) > 1:
        runs[0] = np.concatenate([runs.pop(), runs[0][1:]])
        first = int(np.argmin([run[0] for run in runs]))  # the first joint after the first point
        runs = runs[first:] + runs[:first]
    return [flat[run] for run in runs]


def _turn_of_lines(one: Curve, other: Curve) -> float:
    """Return the angle between two lines [rad]; NaN unless both curves are lines."""
    if isinstance(one, Line) and isinstance(other, Line):
        return abs(float(angle_between(one.direction, other.direction)))
    return np.nan


def _is_rounding(one: Curve, points: np.ndarray, other: Curve) -> bool:
    """Return True if points between two lines are a corner that the skin has rounded."""
    turn = _turn_of_lines(one, other)
    if not turn > LEAST_TURN:
        return False
    corner = meeting(one, other, points[0])
    off = [min(np.linalg.norm(point - on_curve(line, point)) for line in (one, other))
           for point in points]
    return bool(np.linalg.norm(points - corner, axis=1).max() < FARTHEST
                and max(off) < BLUNTED + ROUNDING * (1.0 - np.cos(0.5 * turn)))


def _plane(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return centre and axes (3, 3) of the best plane; for a straight contour, seen from +z."""
    centre = points.mean(axis=0)
    _, spread, axes = np.linalg.svd(points - centre, full_matrices=False)
    axes = axes.T
    if spread[1] < STRAIGHT * spread[0] and abs(axes[2, 0]) < 1.0 - STRAIGHT:
        axes[:, 2] = np.array([0.0, 0.0, 1.0]) - axes[2, 0] * axes[:, 0]
        axes[:, 2] /= np.linalg.norm(axes[:, 2])
    if axes[2, 2] < 0.0:
        axes[:, 2] = -axes[:, 2]
    axes[:, 1] = np.cross(axes[:, 2], axes[:, 0])
    return centre, axes


def _average(flat: np.ndarray) -> np.ndarray:
    """Average points (n, 2) within a spacing of each other; the end points remain."""
    first = np.flatnonzero(np.diff((arc_length(flat) / SPACING).astype(int), prepend=-1))
    means = np.add.reduceat(flat, first) / np.diff(first, append=len(flat))[:, None]
    return np.concatenate([flat[:1], means[1:-1], flat[-1:]])


def _noise(flat: np.ndarray) -> float:
    """Return the standard deviation of points across their contour [m]."""
    step = flat[2:] - flat[:-2]
    length = np.linalg.norm(step, axis=1)
    bend = flat[2:] - 2.0 * flat[1:-1] + flat[:-2]
    across = np.abs(step[:, 0] * bend[:, 1] - step[:, 1] * bend[:, 0])
    some = length > 0.0
    return np.median(across[some] / length[some]) / (0.6745 * np.sqrt(6.0)) if some.any() else 0.0


def _cut_overlap(flat: np.ndarray) -> tuple[np.ndarray, bool]:
    """Remove the part that was traced twice; return the contour and True if it is closed."""
    travel = arc_length(flat)
    away = np.linalg.norm(flat - flat[0], axis=1)
    # First return to the start, after the contour was far away from it.
    far = np.flatnonzero(away > max(SHORTEST, 0.1 * away.max()))
    if len(far):
        # A way there and back encloses nothing. The area is that up to each point.
        x, y = (flat - flat[0]).T
        area = 0.5 * np.abs(np.cumsum(np.append(0.0, x[:-1] * y[1:] - x[1:] * y[:-1])))
        back = np.flatnonzero((away < CLOSING) & (travel > travel[far[0]])
                              & (2.0 * area > CLOSING * travel))
        if len(back):
            last = back[0]
            while last + 1 < len(flat) and away[last + 1] < away[last]:
                last += 1
            return flat[:last], True
    return flat, False


def _assemble(runs: list[np.ndarray], closed: bool, std: float,
              lift: Callable[[ArrayLike], np.ndarray]) -> Outline:
    """Make the outline from runs of points; `lift` transforms points (..., 2) into space."""
    def corners_of(curves: list[Curve]) -> list[np.ndarray | None]:
        """Return the corner at the start of each run, or None, and again that of the first."""
        found = [_corner_of(curves[k - 1], curves[k], run[0])
                 if k > 0 or closed and len(runs) > 1 else None for k, run in enumerate(runs)]
        return found + found[:1]

    # An arc is first fitted as a whole: what a corner rounds of it hardly turns its ends.
    curves = [fit_curve(run, std) for run in runs]
    corners = corners_of([curve if curve.kind == 'arc' else _side_of(run, std)
                          for run, curve in zip(runs, curves, strict=True)])
    curves = [_side_of(run, std, corners[k] is not None, corners[k + 1] is not None)
              for k, run in enumerate(runs)]
    corners = corners_of(curves)
    starts = [on_curve(curve, run[0]) if corner is None else corner
              for run, curve, corner in zip(runs, curves, corners, strict=False)]
    ends = starts[1:] + [starts[0] if closed else on_curve(curves[-1], runs[-1][-1])]
    sides = []
    for run, curve, start, end in zip(runs, curves, starts, ends, strict=True):
        path = np.array([start, *run[1:-1], end])
        sides.append(Side(
            curve.kind, curve.length(path), curve.radius, lift(curve.polyline(path))))
    turns = [angle_between(curves[k - 1].tangent(start)[1], curves[k].tangent(start)[1])
             for k, start in enumerate(starts) if corners[k] is not None]
    found = [corner for corner in corners[:-1] if corner is not None]
    return Outline(lift(np.reshape(found, (-1, 2))), np.array(turns), tuple(sides), closed)


def _corner_of(one: Curve, other: Curve, joint: np.ndarray) -> np.ndarray | None:
    """Return the corner (2,) of two sides near their joint (2,); None if there is none."""
    turn = abs(angle_between(one.tangent(joint)[1], other.tangent(joint)[1]))
    lines = not np.isnan(_turn_of_lines(one, other))
    if turn < (LEAST_TURN if lines else CORNER_ANGLE):
        return None
    corner = meeting(one, other, joint)
    return corner if np.linalg.norm(corner - joint) < FARTHEST else None


def _side_of(run: np.ndarray, std: float, at_start: bool = True, at_end: bool = True) -> Curve:
    """Fit the points of a run without the parts that corners round at its start and end."""
    travel = arc_length(run)
    keep = (travel >= ROUNDING * at_start) & (travel <= travel[-1] - ROUNDING * at_end)
    return fit_curve(run[keep] if keep.sum() >= 3 else run, std)
