"""Lines and arcs that explain the points of a plane contour: division, fits, intersections."""
from dataclasses import dataclass

import numpy as np
import scipy

CHORD = 1e-3  # m, longest chord of an arc as a polyline
FEW = 6  # smallest number of points of a line or arc
# A line must reduce the sum of squares by this much, in variances of the points; an arc, which has
# one more parameter, by `ARC` more.
LINE, ARC = 40.0, 15.0


@dataclass(frozen=True, eq=False)
class Line:
    """Straight line in the plane, fitted to points."""

    middle: np.ndarray  # (2,), a point on the line [m]
    direction: np.ndarray  # (2,), of length 1, along the points
    residual: float  # RMS distance of the points [m]

    kind = 'line'
    radius = np.inf

    @classmethod
    def fit(cls, points: np.ndarray) -> 'Line':
        """Fit a line to points (N, 2) by total least squares."""
        middle = points.mean(axis=0)
        direction = np.linalg.svd(points - middle)[2][0]
        if direction @ (points[-1] - points[0]) < 0.0:
            direction = -direction
        off = (points - middle) @ [-direction[1], direction[0]]
        return cls(middle, direction, float(np.sqrt(np.mean(off**2))))

    def tangent(self, point: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return point (2,) and direction (2,), along the points, of the tangent near a point."""
        return self.middle, self.direction

    def length(self, path: np.ndarray) -> float:
        """Return the length [m] along the curve between the ends of a path (N, 2)."""
        return float(np.linalg.norm(path[-1] - path[0]))

    def polyline(self, path: np.ndarray) -> np.ndarray:
        """Return points (m, 2) [m] on the curve between the ends of a path (N, 2)."""
        return path[[0, -1]]


@dataclass(frozen=True, eq=False)
class Arc:
    """Arc of a circle in the plane, fitted to points; same methods as `Line`."""

    centre: np.ndarray  # (2,) [m]
    radius: float  # [m]
    turn: float  # 1: the points turn to the left, -1: to the right
    residual: float  # RMS distance of the points [m]

    kind = 'arc'

    @classmethod
    def fit(cls, points: np.ndarray) -> 'Arc | None':
        """Fit a circle to points (N, 2) by least squares of the distance; None for a line."""
        middle = points.mean(axis=0)
        u = points - middle
        scale = np.abs(u).max() or 1.0
        u = u / scale
        matrix = np.column_stack([2.0 * u, np.ones(len(u))])
        solution, _, rank, _ = np.linalg.lstsq(matrix, (u**2).sum(axis=1), rcond=1e-12)
        if rank < 3:
            return None
        start = [*solution[:2], np.sqrt(solution[2] + solution[:2] @ solution[:2])]
        *centre, radius = scipy.optimize.least_squares(
            lambda circle: np.linalg.norm(u - circle[:2], axis=1) - circle[2], start, method='lm',
            xtol=1e-12).x
        centre, radius = middle + scale * np.array(centre), float(scale * radius)
        away = points - centre
        turn = 1.0 if angle_between(away[:-1], away[1:]).sum() >= 0.0 else -1.0
        off = np.linalg.norm(away, axis=1) - radius
        return cls(centre, radius, turn, float(np.sqrt(np.mean(off**2))))

    def tangent(self, point: np.ndarray) -> tuple[np.ndarray, np.ndarray]:  # noqa: D102
        out = point - self.centre
        out = out / np.linalg.norm(out)
        return self.centre + self.radius * out, self.turn * np.array([-out[1], out[0]])

    def _sweep(self, path: np.ndarray) -> float:
        """Return the angle along a path [rad], summed over steps: it may exceed half a circle."""
        away = path - self.centre
        return angle_between(away[:-1], away[1:]).sum()

    def length(self, path: np.ndarray) -> float:  # noqa: D102
        return float(self.radius * abs(self._sweep(path)))

    def polyline(self, path: np.ndarray) -> np.ndarray:  # noqa: D102
        sweep = self._sweep(path)
        first, last = path[0] - self.centre, path[-1] - self.centre
        share = np.linspace(0.0, 1.0, int(abs(sweep) * self.radius / CHORD) + 2)
        angle = np.arctan2(first[1], first[0]) + share * sweep
        # The ends, where this side meets its neighbours, need not lie on the circle.
        radius = (1.0 - share) * np.linalg.norm(first) + share * np.linalg.norm(last)
        between = self.centre + radius[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
        return np.array([path[0], *between[1:-1], path[-1]])


Curve = Line | Arc


def fit_curve(points: np.ndarray, std: float) -> Curve:
    """Fit a line to points (N, 2) [m], or an arc if it explains them much better; see `joints`."""
    line = Line.fit(points)
    arc = Arc.fit(points) if len(points) >= FEW else None
    if arc is None or len(points) * (line.residual**2 - arc.residual**2) < ARC * std**2:
        return line
    return arc


def angle_between(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Return the angle from directions (..., 2) to others, positive to the left [rad]."""
    cross = one[..., 0] * other[..., 1] - one[..., 1] * other[..., 0]
    return np.arctan2(cross, (one * other).sum(axis=-1))


def on_curve(curve: Curve, point: np.ndarray) -> np.ndarray:
    """Return the point of a curve nearest to a point (2,)."""
    foot, direction = curve.tangent(point)
    return foot + (point - foot) @ direction * direction


def meeting(first: Curve, second: Curve, corner: np.ndarray) -> np.ndarray:
    """Return the intersection of two lines, or of tangents near a corner (2,), or the corner."""
    p, d = first.tangent(corner)
    q, e = second.tangent(corner)
    cross = d[0] * e[1] - d[1] * e[0]
    if abs(cross) < 1e-3:  # nearly parallel
        return corner
    (x, y) = q - p
    return p + (x * e[1] - y * e[0]) / cross * d


def joints(points: np.ndarray, std: float) -> list[int]:
    """
    Return the indices of points at which lines and arcs meet, with both ends.

    The division has the least sum of squared distances of the points (N, 2) [m] from their line or
    arc, in units of std^2, plus `LINE` or `LINE` + `ARC` for each. It is found by dynamic
    programming over the last joint.
    """
    sums = _cumulated(points - points.mean(axis=0))
    best = np.full(len(points), np.inf)
    best[0] = 0.0
    before = np.zeros(len(points), int)
    for last in range(1, len(points)):
        firsts = np.arange(max(last - FEW + 2, 1))  # always one that begins at the first point
        line, arc = _squares(sums[last + 1] - sums[firsts])
        costs = best[firsts] + LINE + np.minimum(line, arc + ARC * std**2) / std**2
        before[last] = costs.argmin()
        best[last] = costs[before[last]]
    found = [len(points) - 1]
    while found[-1] > 0:
        found.append(int(before[found[-1]]))
    return found[::-1]


def _cumulated(points: np.ndarray) -> np.ndarray:
    """Return sums over the points before each of 1, x, y, xx, xy, yy, xq, yq, qq; q = xx + yy."""
    x, y = points.T
    q = x * x + y * y
    terms = np.stack([np.ones(len(x)), x, y, x * x, x * y, y * y, x * q, y * q, q * q], axis=1)
    return np.vstack([np.zeros(9), np.cumsum(terms, axis=0)])


def _squares(sums: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """
    Return sums of squared distances from the best line and circle, from sums (M, 9) over points.

    The circle minimises the sum of (q - 2 a x - 2 b y - d)^2, about 4 r^2 times that of squared
    distances.
    """
    n, x, y, xx, xy, yy, xq, yq, qq = sums.T
    x, y, q = x / n, y / n, xx + yy
    cxx, cxy, cyy = xx - n * x * x, xy - n * x * y, yy - n * y * y  # about the mean
    line = 0.5 * (cxx + cyy - np.hypot(cxx - cyy, 2.0 * cxy))
    fx, fy = xq - x * q, yq - y * q
    px = fx - 2.0 * (x * cxx + y * cxy)
    py = fy - 2.0 * (x * cxy + y * cyy)
    square = (qq - q * q / n - 4.0 * (x * fx + y * fy)
              + 4.0 * (x * x * cxx + 2.0 * x * y * cxy + y * y * cyy))
    with np.errstate(divide='ignore', invalid='ignore'):
        determinant = cxx * cyy - cxy * cxy
        a, b = (px * cyy - py * cxy) / determinant, (py * cxx - px * cxy) / determinant
        radius_squared = 0.25 * (a * a + b * b) + (cxx + cyy) / n
        arc = (square - a * px - b * py) / (4.0 * radius_squared)
    arc[~np.isfinite(arc) | (n < FEW)] = np.inf
    return np.maximum(line, 0.0), np.maximum(arc, 0.0)
