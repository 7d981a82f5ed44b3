"""Pieces of a plane contour: lines and arcs, as few as its points allow."""
from dataclasses import dataclass

import numpy as np

STEPS = 10  # of Gauss-Newton, at most
_JOINTS = 30  # places at which a division is tried
_FEW = 6  # points that a line or an arc needs at least
_F_LEVEL = 12.0  # how much better than chance an arc must explain a side than a line does


@dataclass(eq=False)
class Piece:
    """Points of a side, whether corners bound it, and its fit."""

    points: np.ndarray
    ends: tuple
    fit: dict

    @property
    def length(self):
        """Length of the path [m]."""
        return float(np.linalg.norm(np.diff(self.points, axis=0), axis=1).sum())


def fit_circle(points, steps=STEPS):
    """
    Circle through points (N, 2) by least squares of the distance.

    Returns
    -------
    centre : ndarray, shape (2,)
    radius : float
        inf where the points lie on a line.
    """
    middle = points.mean(axis=0)
    u = points - middle
    scale = np.abs(u).max() or 1.0
    u = u / scale
    matrix = np.column_stack([2.0 * u, np.ones(len(u))])
    solution, _, rank, _ = np.linalg.lstsq(matrix, (u**2).sum(axis=1), rcond=1e-12)
    if rank < 3:
        return middle, np.inf
    centre, radius = solution[:2], np.sqrt(solution[2] + solution[:2] @ solution[:2])
    for _ in range(steps):  # Gauss-Newton on the distance itself
        away = u - centre
        length = np.linalg.norm(away, axis=1)
        jacobian = np.column_stack([away / length[:, None], np.ones(len(u))])
        step = np.linalg.lstsq(jacobian, length - radius, rcond=None)[0]
        centre, radius = centre + step[:2], radius + step[2]
        if np.abs(step).max() < 1e-12 * radius:
            break
    return middle + scale * centre, scale * radius


def divide(points, ends, rounding, tolerance):
    """
    Pieces of a run without corners, each a line or an arc, as few as the tolerance allows.

    A run that is neither is divided where the two parts fit best, and so on; neighbours that
    fit as one are joined again, and the joints moved to where they are best.
    """
    whole = fit_piece(points, ends, rounding)
    if whole.fit['residual'] <= tolerance or len(points) < 4 * _FEW:
        return [whole]
    joint = _best_joint(points, ends, rounding, _FEW, len(points) - _FEW)
    pieces = (divide(points[:joint + 1], (ends[0], False), rounding, tolerance)
              + divide(points[joint:], (False, ends[1]), rounding, tolerance))
    k = 0
    while k + 1 < len(pieces):
        one, other = pieces[k], pieces[k + 1]
        both, around = np.concatenate([one.points, other.points[1:]]), (one.ends[0], other.ends[1])
        joined = fit_piece(both, around, rounding)
        if joined.fit['residual'] <= tolerance:
            pieces[k:k + 2] = [joined]
            continue
        middle, reach = len(one.points) - 1, len(both) // 8
        joint = _best_joint(both, around, rounding, max(_FEW, middle - reach),
                            min(len(both) - _FEW, middle + reach))
        pieces[k:k + 2] = _two(both, around, rounding, joint)
        k += 1
    return pieces


def _best_joint(points, ends, rounding, first, last):
    """Index from first to last at which two pieces leave the least squares."""
    candidates = range(first, max(last, first + 1), max(1, (last - first) // _JOINTS))
    return min(candidates, key=lambda joint: sum(
        part.fit['residual']**2 * len(part.points)
        for part in _two(points, ends, rounding, joint, steps=1)))


def _two(points, ends, rounding, joint, steps=STEPS):
    return [fit_piece(points[:joint + 1], (ends[0], False), rounding, steps),
            fit_piece(points[joint:], (False, ends[1]), rounding, steps)]


def fit_piece(points, ends, rounding, steps=STEPS):
    """Line or arc through points, without what the corners have rounded."""
    travel = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1)))
    keep = (travel >= rounding * ends[0]) & (travel <= travel[-1] - rounding * ends[1])
    return Piece(points, ends, _fit_piece(points[keep] if keep.sum() >= 3 else points, steps))


def _fit_piece(points, steps):
    """Line (point, direction) and, where the points demand it, a circle."""
    middle = points.mean(axis=0)
    direction = np.linalg.svd(points - middle)[2][0]
    direction = direction if direction @ (points[-1] - points[0]) >= 0.0 else -direction
    off = (points - middle) @ [-direction[1], direction[0]]
    line = float(off @ off)
    fit = {'middle': middle, 'direction': direction, 'radius': np.inf,
           'residual': np.sqrt(line / len(points))}
    if len(points) < _FEW:
        return fit
    centre, radius = fit_circle(points, steps)
    if not np.isfinite(radius):
        return fit
    arc = float(((np.linalg.norm(points - centre, axis=1) - radius)**2).sum())
    # Neighbours share their noise: of three points, one counts.
    freedom = max(1.0, len(points) / 3.0 - 3.0)
    if line - arc > _F_LEVEL * max(arc, 1e-24) / freedom:
        fit |= {'centre': centre, 'radius': radius, 'residual': np.sqrt(arc / len(points))}
    return fit


def angle_between(one, other):
    cross = one[..., 0] * other[..., 1] - one[..., 1] * other[..., 0]
    return np.arctan2(cross, (one * other).sum(axis=-1))
