"""Division of a plane contour into as few lines and arcs as possible."""
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from tactile_common.polyline import arc_length
from tactile_shape.contour.curves import Arc, Line, STEPS

ROUNDING = 3e-3  # m of contour next to a corner, not used because the skin rounds it
_FEW = 6  # smallest number of points of a line or arc
_JOINTS = 30  # approximate number of places at which a division is tried
_F_LEVEL = 12.0  # value of F that is rarely exceeded by chance; a better fit must exceed it


class Ends(NamedTuple):
    """True if a corner bounds a piece at its start, and at its end."""

    start: bool
    end: bool


@dataclass(frozen=True, eq=False)
class Piece:
    """Points (N, 2) of a side [m], which ends are corners, and the fitted curve."""

    points: np.ndarray
    ends: Ends
    curve: Line | Arc


def divide(points: np.ndarray, ends: Ends, tolerance: float) -> list[Piece]:
    """
    Divide a run without corners into as few lines and arcs as the tolerance allows.

    A run that neither a line nor an arc explains is divided, recursively, at the joint with the
    best fit, if this reduces the residual by more than noise would. Then neighbours that one curve
    explains are joined again, and the joints are moved to their best place.
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
    """
    Return the best of about `_JOINTS` indices from first to last at which to divide a run.

    The best index has the least sum of squares of the two pieces.
    """
    candidates = range(first, max(last, first + 1), max(1, (last - first) // _JOINTS))
    return min(candidates, key=lambda joint: _square(_two(points, ends, joint, steps=1)))


def _square(pieces: list[Piece]) -> float:
    """Return the sum of squared distances of points to their pieces [m^2]."""
    return sum(part.curve.residual**2 * len(part.points) for part in pieces)


def _two(points: np.ndarray, ends: Ends, joint: int,
         steps: int = STEPS) -> list[Piece]:
    return [fit_piece(points[:joint + 1], Ends(ends.start, False), steps),
            fit_piece(points[joint:], Ends(False, ends.end), steps)]


def fit_piece(points: np.ndarray, ends: Ends, steps: int = STEPS) -> Piece:
    """Fit a line or arc to points (N, 2) [m], without the parts rounded by corners."""
    travel = arc_length(points)
    keep = (travel >= ROUNDING * ends.start) & (travel <= travel[-1] - ROUNDING * ends.end)
    return Piece(points, ends, _fit_curve(points[keep] if keep.sum() >= 3 else points, steps))


def _is_better(count: int, square: float, than: float) -> bool:
    """Return True if a sum of squares is smaller than another by more than chance."""
    # Neighbours share their noise: three points count as one.
    freedom = max(1.0, count / 3.0 - 3.0)
    return than - square > _F_LEVEL * max(square, 1e-24) / freedom


def _fit_curve(points: np.ndarray, steps: int) -> Line | Arc:
    """Fit a line, or an arc if the points require it."""
    line = Line.fit(points)
    arc = Arc.fit(points, steps) if len(points) >= _FEW else None
    if arc is None:
        return line
    count = len(points)
    return arc if _is_better(count, count * arc.residual**2, count * line.residual**2) else line
