"""Pieces of a plane contour: lines and arcs, as few as its points allow."""
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from tactile_common.polyline import arc_length
from tactile_shape.contour.curves import Arc, Line, STEPS

ROUNDING = 3e-3  # m of contour next to a corner that is not used: the skin rounds it
_FEW = 6  # points that a line or an arc needs at least


class Ends(NamedTuple):
    """Whether a corner bounds a piece at its start and at its end."""

    start: bool
    end: bool


@dataclass(frozen=True, eq=False)
class Piece:
    """Points (N, 2) of a side [m], whether corners bound it, and its curve."""

    points: np.ndarray
    ends: Ends
    curve: Line | Arc


def divide(points: np.ndarray, ends: Ends, tolerance: float) -> list[Piece]:
    """
    Pieces of a run without corners, each a line or an arc, as few as the tolerance allows.

    A run that is neither is divided where the two parts fit best, and so on, where that explains
    more than noise would; neighbours that fit as one are joined again, and the joints moved to
    where they are best.
    """
    whole = fit_piece(points, ends)
    if whole.curve.departure <= tolerance or len(points) < 4 * _FEW:
        return [whole]
    joint = _best_joint(points, ends, _FEW, len(points) - _FEW)
    square = _square(_two(points, ends, joint))
    if not _is_better(len(points), square, _square([whole])):
        return [whole]
    pieces = (divide(points[:joint + 1], Ends(ends.start, False), tolerance)
              + divide(points[joint:], Ends(False, ends.end), tolerance))
    k = 0
    while k + 1 < len(pieces):
        one, other = pieces[k], pieces[k + 1]
        both = np.concatenate([one.points, other.points[1:]])
        around = Ends(one.ends.start, other.ends.end)
        joined = fit_piece(both, around)
        if joined.curve.departure <= tolerance:
            pieces[k:k + 2] = [joined]
            continue
        middle, reach = len(one.points) - 1, len(both) // 8
        joint = _best_joint(both, around, max(_FEW, middle - reach),
                            min(len(both) - _FEW, middle + reach))
        pieces[k:k + 2] = _two(both, around, joint)
        k += 1
    return pieces


def _best_joint(points: np.ndarray, ends: Ends, first: int, last: int) -> int:
    """Index from first to last, of some thirty, at which two pieces leave the least squares."""
    candidates = range(first, max(last, first + 1), max(1, (last - first) // 30))
    return min(candidates, key=lambda joint: _square(_two(points, ends, joint, steps=1)))


def _square(pieces: list[Piece]) -> float:
    """Sum of squared distances of points to their pieces [m^2]."""
    return sum(part.curve.residual**2 * len(part.points) for part in pieces)


def _two(points: np.ndarray, ends: Ends, joint: int,
         steps: int = STEPS) -> list[Piece]:
    return [fit_piece(points[:joint + 1], Ends(ends.start, False), steps),
            fit_piece(points[joint:], Ends(False, ends.end), steps)]


def fit_piece(points: np.ndarray, ends: Ends, steps: int = STEPS) -> Piece:
    """Line or arc through points (N, 2), without what the corners have rounded [m]."""
    travel = arc_length(points)
    keep = (travel >= ROUNDING * ends.start) & (travel <= travel[-1] - ROUNDING * ends.end)
    return Piece(points, ends, _fit_curve(points[keep] if keep.sum() >= 3 else points, steps))


def _is_better(count: int, square: float, than: float) -> bool:
    """Whether a sum of squares of points is less than another by more than chance."""
    # Neighbours share their noise: of three points, one counts. By chance F is seldom above 12.
    freedom = max(1.0, count / 3.0 - 3.0)
    return than - square > 12.0 * max(square, 1e-24) / freedom


def _fit_curve(points: np.ndarray, steps: int) -> Line | Arc:
    """Line or, where the points demand it, arc."""
    line = Line.fit(points)
    arc = Arc.fit(points, steps) if len(points) >= _FEW else None
    if arc is None:
        return line
    count = len(points)
    return arc if _is_better(count, count * arc.residual**2, count * line.residual**2) else line
