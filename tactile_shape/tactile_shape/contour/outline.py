"""Outline of an object from the contour along its edge: corners and sides with their shape."""
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from tactile_common.errors import ConfigurationError
from tactile_common.polyline import arc_length
from tactile_shape.contour.curves import angle_between, Line, meeting, on_curve
from tactile_shape.contour.pieces import divide, Ends, fit_piece, Piece, ROUNDING

STRAIGHT = 0.1  # width per length below which a contour does not define a plane
ROUNDED = 0.15 * ROUNDING  # m, largest distance from the sides of contacts at a corner
LEAST_TURN = 0.05  # rad; a line that turns by less continues the line before it
LEG = 6e-3  # m before and after a point, used for its directions
CORNER_ANGLE = 0.5  # rad; a larger turn between the two legs at a point is a corner
# Largest departure of points from a line or arc, in addition to their noise [m]. Pieces with a
# larger one are divided.
TOLERANCE = 1e-4
SPACING = 1e-3  # m; contour points closer than this are averaged
CLOSING = 2e-3  # m, largest gap between the ends of a closed contour


@dataclass(frozen=True, eq=False)
class Side:
    """Piece of an outline between corners, or between a line and an arc; in metres."""

    kind: str  # 'line' or 'arc', the simplest that explains its points
    start: np.ndarray  # (3,), corner, joint, or end of an open contour
    end: np.ndarray
    length: float  # from start to end, along the arc
    radius: float  # of an arc; inf for a line
    residual: float  # RMS distance of the points used
    points: np.ndarray  # (m, 3), from start to end, an arc as chords of at most 1 mm


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
        There are fewer than four points, a number is not finite, or the contour is shorter than
        two legs.
    """
    points = np.asarray(points, dtype=float)
    if points.ndim != 2 or points.shape[1] != 3 or len(points) < 4:
        raise ConfigurationError(f'contour has shape {points.shape}, must be (N, 3), N above 3')
    if not np.isfinite(points).all():
        raise ConfigurationError('contour: a number is not finite')
    length = arc_length(points)[-1]
    if length < 2.0 * LEG:
        raise ConfigurationError(
            f'contour is {1e3 * length:.3g} mm long, must be at least two legs, '
            f'{2e3 * LEG:.3g} mm')
    centre, axes = _plane(points)
    flat, closed = _cut_overlap((points - centre) @ axes[:, :2])
    flat = _average(flat)
    if len(flat) < 4:
        raise ConfigurationError('contour: fewer than four of its points are apart')
    tolerance = float(np.hypot(TOLERANCE, 1.5 * _noise(flat)))
    corners = _corners(flat, closed)
    pieces = _pieces(flat, corners, closed, tolerance)
    # An outlier next to a gap is not a corner.
    off = [other.points[0] for one, other in zip(pieces, pieces[1:], strict=False)
           if other.ends.start and _straight_on(one, other)]
    if off:
        corners = [k for k in corners if not (flat[k] == off).all(axis=1).any()]
        pieces = _pieces(flat, corners, closed, tolerance)
    if closed and not corners and len(pieces) > 1:
        # The first point is not an end: start again at the joint of two pieces.
        flat = np.roll(flat, 1 - len(pieces[0].points), axis=0)
        pieces = _pieces(flat, corners, closed, tolerance)
    return _assemble(pieces, closed, lambda u: centre + np.asarray(u) @ axes[:, :2].T)


def _pieces(flat: np.ndarray, corners: list[int], closed: bool,
            tolerance: float) -> list[Piece]:
    """Divide a contour into lines and arcs, from corner to corner."""
    pieces, runs = [], _runs(flat, corners, closed)
    round_ends = bool(closed and corners)
    for k, run in enumerate(runs):
        ends = Ends(k > 0 or round_ends, k < len(runs) - 1 or round_ends)
        pieces += divide(run, ends, tolerance)
    pieces = _without_roundings(pieces)
    # Between two successive lines there is a corner, even if its turn is small.
    for k in range(1, len(pieces)):
        one = fit_piece(pieces[k - 1].points, pieces[k - 1].ends._replace(end=True))
        other = fit_piece(pieces[k].points, pieces[k].ends._replace(start=True))
        joint = other.points[0]
        if _are_lines(one, other) and not _straight_on(one, other) and np.linalg.norm(
                meeting(one.curve, other.curve, joint) - joint) < ROUNDING:
            pieces[k - 1:k + 1] = one, other
    return pieces


def _without_roundings(pieces: list[Piece]) -> list[Piece]:
    """Remove pieces between two lines that are a corner rounded by the skin."""
    k = 1
    while k < len(pieces) - 1:
        one, middle, other = pieces[k - 1:k + 2]
        if _are_lines(one, other) and not _straight_on(one, other):
            corner = meeting(one.curve, other.curve, middle.points[0])
            away = np.linalg.norm(middle.points - corner, axis=1)
            off = [min(np.linalg.norm(point - on_curve(side.curve, point))
                       for side in (one, other)) for point in middle.points]
            if away.max() < 3.0 * ROUNDING and max(off) < ROUNDED:
                nearest = away.argmin()
                pieces[k - 1:k + 2] = [
                    fit_piece(np.concatenate([one.points, middle.points[1:nearest + 1]]),
                              one.ends._replace(end=True)),
                    fit_piece(np.concatenate([middle.points[nearest:], other.points[1:]]),
                              other.ends._replace(start=True))]
                continue
        k += 1
    return pieces


def _are_lines(one: Piece, other: Piece) -> bool:
    return isinstance(one.curve, Line) and isinstance(other.curve, Line)


def _straight_on(one: Piece, other: Piece) -> bool:
    """Return True if one line continues in the direction of another."""
    first, second = one.curve, other.curve
    return isinstance(first, Line) and isinstance(second, Line) and bool(
        abs(angle_between(first.direction, second.direction)) < LEAST_TURN)


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
    travel = arc_length(flat)
    if travel[-1] < SPACING:
        return flat
    cell = np.minimum((travel / SPACING).astype(int), int(travel[-1] / SPACING))
    used, cell = np.unique(cell, return_inverse=True)
    sums = np.stack([np.bincount(cell, values, len(used)) for values in flat.T], axis=1)
    means = sums / np.bincount(cell, minlength=len(used))[:, None]
    return np.concatenate([flat[:1], means[1:-1], flat[-1:]])


def _noise(flat: np.ndarray) -> float:
    """
    Estimate the noise of points across their contour from second differences [m].

    Returns a standard deviation.
    """
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
    far = np.flatnonzero(away > max(2.0 * LEG, 0.1 * away.max()))
    if len(far):
        back = np.flatnonzero((away < CLOSING) & (travel > travel[far[0]]))
        if len(back):
            last = back[0]
            while last + 1 < len(flat) and away[last + 1] < away[last]:
                last += 1
            return flat[:last], True
    return flat, False


def _corners(flat: np.ndarray, closed: bool) -> list[int]:
    """Return the indices of points where the contour has a corner between two legs."""
    count = len(flat)
    around = np.concatenate([flat, flat, flat]) if closed else flat
    offset = count if closed else 0
    travel = arc_length(around)
    before = np.searchsorted(travel, travel - LEG)
    after = np.minimum(np.searchsorted(travel, travel + LEG), len(travel) - 1)
    turn = np.zeros(len(around))
    inside = (travel >= LEG) & (travel <= travel[-1] - LEG)
    into, out = around - around[before], around[after] - around
    turn[inside] = np.abs(angle_between(into, out)[inside])
    found: list[int] = []
    for k in range(offset, offset + count):
        near = (travel > travel[k] - LEG) & (travel < travel[k] + LEG)
        # A rounded corner has a flat maximum: skip other points within a leg.
        if turn[k] > CORNER_ANGLE and turn[k] >= turn[near].max() and not (
                found and travel[k] - travel[found[-1]] < LEG):
            found.append(k)
    found = [k - offset for k in found]
    if closed and len(found) > 1 and (
            travel[found[0] + count] - travel[found[-1]] < LEG):
        found.pop()
    return found


def _runs(flat: np.ndarray, corners: list[int], closed: bool) -> list[np.ndarray]:
    """Split the points at the corners."""
    if not closed:
        return [flat[a:b + 1] for a, b in zip(
            [0, *corners], [*corners, len(flat) - 1], strict=True)]
    if not corners:
        return [np.concatenate([flat, flat[:1]])]
    ends = [*corners[1:], corners[0] + len(flat)]
    around = np.concatenate([flat, flat])
    return [around[a:b + 1] for a, b in zip(corners, ends, strict=True)]


def _assemble(pieces: list[Piece], closed: bool,
              lift: Callable[[ArrayLike], np.ndarray]) -> Outline:
    """Make the outline from plane pieces; `lift` transforms points (..., 2) into space."""
    joints = [meeting(before.curve, piece.curve, piece.points[0]) if piece.ends.start
              else on_curve(piece.curve, piece.points[0]) for before, piece in zip(
                  [pieces[-1], *pieces], pieces, strict=False)]
    ends = joints[1:] + [
        joints[0] if closed else on_curve(pieces[-1].curve, pieces[-1].points[-1])]
    sides, corners, turns = [], [], []
    for k, (piece, start, end) in enumerate(zip(pieces, joints, ends, strict=True)):
        path, curve = np.array([start, *piece.points[1:-1], end]), piece.curve
        sides.append(Side(
            curve.kind, lift(start), lift(end), curve.length(path), curve.radius,
            curve.residual, lift(curve.polyline(path))))
        if piece.ends.start:
            corners.append(start)
            turns.append(angle_between(
                pieces[k - 1].curve.tangent(start)[1], curve.tangent(start)[1]))
    return Outline(lift(np.reshape(corners, (-1, 2))), np.array(turns), tuple(sides), closed)
