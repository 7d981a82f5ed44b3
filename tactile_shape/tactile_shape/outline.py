"""The outline of an object from the contour traced along its edge: corners, sides, their form."""
from dataclasses import dataclass, field

import numpy as np

from tactile_shape.config import check_fields
from tactile_shape.errors import ConfigurationError

_F_LEVEL = 12.0  # how much better than chance an arc must explain a side than a line does


@dataclass(frozen=True)
class OutlineConfig:
    """How corners are told from what lies between them."""

    leg: float = field(default=6e-3, metadata={
        'doc': 'length before and after a point over which the direction is taken', 'unit': 'm',
        'range': (1e-5, 1.0)})
    corner_angle: float = field(default=0.5, metadata={
        'doc': 'a turn by more than this between the two legs is a corner', 'unit': 'rad',
        'range': (0.05, 3.0)})
    rounding: float = field(default=3e-3, metadata={
        'doc': 'contour next to a corner that is not used: the skin rounds it', 'unit': 'm',
        'range': (0.0, 1.0)})
    closing: float = field(default=2e-3, metadata={
        'doc': 'largest gap between the ends of a closed contour', 'unit': 'm',
        'range': (0.0, 1.0)})

    def __post_init__(self):
        check_fields(self)


@dataclass(frozen=True, eq=False)
class Side:
    """
    Piece of an outline between two corners.

    Attributes
    ----------
    kind : str
        'line' or 'arc', the least that explains its points.
    start, end : ndarray, shape (3,)
        The corners, or the ends of an open contour [m].
    length : float
        From start to end, along the arc [m].
    radius : float
        Of an arc [m]; inf for a line.
    residual : float
        RMS distance of the points used [m].
    """

    kind: str
    start: np.ndarray
    end: np.ndarray
    length: float
    radius: float
    residual: float


@dataclass(frozen=True, eq=False)
class Outline:
    """
    Outline in the plane of its contour.

    Attributes
    ----------
    corners : ndarray, shape (c, 3)
        Where neighbouring sides would meet if the skin did not round them [m].
    angles : ndarray, shape (c,)
        Turn at each corner, positive to the left about the plane's normal [rad].
    sides : tuple of Side
    closed : bool
    """

    corners: np.ndarray
    angles: np.ndarray
    sides: tuple
    closed: bool

    def __str__(self):
        """Lines of text: sides and corners."""
        lines = [f'{"closed" if self.closed else "open"} outline, {len(self.corners)} corners']
        for k, side in enumerate(self.sides):
            form = '' if side.kind == 'line' else f', radius {1e3 * side.radius:.2f} mm'
            lines.append(f'side {k + 1}: {side.kind}, {1e3 * side.length:.2f} mm{form}')
        for k, (corner, angle) in enumerate(zip(self.corners, self.angles, strict=True)):
            x, y, z = 1e3 * corner
            lines.append(f'corner {k + 1}: ({x:.2f}, {y:.2f}, {z:.2f}) mm, turn '
                         f'{np.degrees(angle):.1f} deg')
        return '\n'.join(lines)


def find_outline(points, config=None):
    """
    Find corners and sides of a contour.

    Parameters
    ----------
    points : array_like, shape (N, 3)
        Along the edge, in order [m]; an overlap at the end of a closed contour may be there.
    config : OutlineConfig, optional

    Returns
    -------
    Outline

    Raises
    ------
    ConfigurationError
        Fewer than four points, a number that is not finite, or shorter than two legs.
    """
    config = config or OutlineConfig()
    points = np.asarray(points, dtype=float)
    if points.ndim != 2 or points.shape[1] != 3 or len(points) < 4:
        raise ConfigurationError(f'contour has shape {points.shape}, must be (N, 3), N above 3')
    if not np.isfinite(points).all():
        raise ConfigurationError('contour: a number is not finite')
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    if steps.sum() < 2.0 * config.leg:
        raise ConfigurationError(
            f'contour is {1e3 * steps.sum():.3g} mm long, must be at least two legs, '
            f'{2e3 * config.leg:.3g} mm')
    centre, axes = _plane(points)
    flat, closed = _cut_overlap((points - centre) @ axes[:, :2], config)
    corners = _corners(flat, closed, config)
    pieces = _pieces(flat, corners, closed)
    fits = [_fit_piece(_inner(piece, k > 0 or closed, k < len(pieces) - 1 or closed,
                              config.rounding if len(corners) else 0.0))
            for k, piece in enumerate(pieces)]
    return _assemble(flat, pieces, fits, corners, closed,
                     lambda u: centre + np.asarray(u) @ axes[:, :2].T)


def fit_circle(points):
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
    for _ in range(10):  # Gauss-Newton on the distance itself
        away = u - centre
        length = np.linalg.norm(away, axis=1)
        jacobian = np.column_stack([away / length[:, None], np.ones(len(u))])
        step = np.linalg.lstsq(jacobian, length - radius, rcond=None)[0]
        centre, radius = centre + step[:2], radius + step[2]
        if np.abs(step).max() < 1e-12 * radius:
            break
    return middle + scale * centre, scale * radius


def _plane(points):
    """Centre and axes (3, 3) of the best plane, its normal nearest to +z of the frame."""
    centre = points.mean(axis=0)
    axes = np.linalg.svd(points - centre)[2].T
    if axes[2, 2] < 0.0:
        axes[:, 2] = -axes[:, 2]
    axes[:, 1] = np.cross(axes[:, 2], axes[:, 0])
    return centre, axes


def _cut_overlap(flat, config):
    """Contour without what was traced twice, and whether it is closed."""
    travel = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(flat, axis=0), axis=1)))
    away = np.linalg.norm(flat - flat[0], axis=1)
    # The first return to the start, after having been a good way off it.
    far = np.flatnonzero(away > max(2.0 * config.leg, 0.1 * away.max()))
    if len(far):
        back = np.flatnonzero((away < max(config.closing, 1e-12)) & (travel > travel[far[0]]))
        if len(back):
            last = back[0]
            while last + 1 < len(flat) and away[last + 1] < away[last]:
                last += 1
            return flat[:last], True
    return flat, False


def _corners(flat, closed, config):
    """Indices of points at which the contour turns sharply."""
    count = len(flat)
    around = np.concatenate([flat, flat, flat]) if closed else flat
    offset = count if closed else 0
    travel = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(around, axis=0), axis=1)))
    before = np.searchsorted(travel, travel - config.leg)
    after = np.minimum(np.searchsorted(travel, travel + config.leg), len(travel) - 1)
    turn = np.zeros(len(around))
    inside = (travel >= config.leg) & (travel <= travel[-1] - config.leg)
    into, out = around - around[before], around[after] - around
    turn[inside] = np.abs(_angle(into, out)[inside])
    found = []
    for k in range(offset, offset + count):
        near = (travel > travel[k] - config.leg) & (travel < travel[k] + config.leg)
        # A rounded corner has a flat top: its middle.
        if turn[k] > config.corner_angle and turn[k] >= turn[near].max() and not (
                found and travel[k] - travel[found[-1]] < config.leg):
            found.append(k)
    found = [k - offset for k in found]
    if closed and len(found) > 1 and (
            travel[found[0] + count] - travel[found[-1]] < config.leg):
        found.pop()
    return found


def _angle(one, other):
    cross = one[..., 0] * other[..., 1] - one[..., 1] * other[..., 0]
    return np.arctan2(cross, (one * other).sum(axis=-1))


def _pieces(flat, corners, closed):
    """Points of each side."""
    if not closed:
        return [flat[a:b + 1] for a, b in zip(
            [0, *corners], [*corners, len(flat) - 1], strict=True)]
    if not corners:
        return [flat]
    ends = [*corners[1:], corners[0] + len(flat)]
    around = np.concatenate([flat, flat])
    return [around[a:b + 1] for a, b in zip(corners, ends, strict=True)]


def _inner(piece, cut_start, cut_end, rounding):
    """Points of a side that the corners have not rounded; all of a very short one."""
    travel = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(piece, axis=0), axis=1)))
    keep = ((travel >= (rounding if cut_start else 0.0))
            & (travel <= travel[-1] - (rounding if cut_end else 0.0)))
    return piece[keep] if keep.sum() >= 3 else piece


def _fit_piece(points):
    """Line (point, direction) and, where the points demand it, a circle."""
    middle = points.mean(axis=0)
    direction = np.linalg.svd(points - middle)[2][0]
    direction = direction if direction @ (points[-1] - points[0]) >= 0.0 else -direction
    off = (points - middle) @ [-direction[1], direction[0]]
    line = float(off @ off)
    fit = {'middle': middle, 'direction': direction, 'radius': np.inf,
           'residual': np.sqrt(line / len(points))}
    if len(points) < 6:
        return fit
    centre, radius = fit_circle(points)
    if not np.isfinite(radius):
        return fit
    arc = float(((np.linalg.norm(points - centre, axis=1) - radius)**2).sum())
    # Neighbours share their noise: of ten points, one counts.
    freedom = max(1.0, len(points) / 10.0 - 3.0)
    if line - arc > _F_LEVEL * max(arc, 1e-24) / freedom:
        fit |= {'centre': centre, 'radius': radius, 'residual': np.sqrt(arc / len(points))}
    return fit


def _meet(first, second, corner):
    """Where the lines, or tangents, of two sides meet."""
    tangents = []
    for fit in (first, second):
        if np.isfinite(fit['radius']):
            out = corner - fit['centre']
            out = out / np.linalg.norm(out)
            tangents.append((fit['centre'] + fit['radius'] * out, np.array([-out[1], out[0]])))
        else:
            tangents.append((fit['middle'], fit['direction']))
    (p, d), (q, e) = tangents
    cross = d[0] * e[1] - d[1] * e[0]
    if abs(cross) < 1e-3:
        return corner
    along = ((q - p)[0] * e[1] - (q - p)[1] * e[0]) / cross
    return p + along * d


def _assemble(flat, pieces, fits, corners, closed, lift):
    joints = []
    for k, index in enumerate(corners):
        before, after = (fits[k - 1], fits[k]) if closed else (fits[k], fits[k + 1])
        joints.append(_meet(before, after, flat[index]))
    sides = []
    for k, (piece, fit) in enumerate(zip(pieces, fits, strict=True)):
        if closed and not corners:
            start = end = flat[0]
        elif closed:
            start, end = joints[k], joints[(k + 1) % len(joints)]
        else:
            start = joints[k - 1] if k else flat[0]
            end = joints[k] if k < len(joints) else flat[-1]
        sides.append(Side(
            'arc' if np.isfinite(fit['radius']) else 'line', lift(start), lift(end),
            _length(piece, fit, start, end), float(fit['radius']), float(fit['residual'])))
    turns = [_angle(fits[k - 1 if closed else k]['direction'],
                    fits[k if closed else k + 1]['direction']) for k in range(len(corners))]
    return Outline(lift(np.array(joints).reshape(-1, 2)), np.array(turns), tuple(sides), closed)


def _length(piece, fit, start, end):
    if not np.isfinite(fit['radius']):
        return float(np.linalg.norm(end - start))
    # The angle swept, by steps so that more than half a circle counts.
    away = np.array([start, *piece[1:-1], end]) - fit['centre']
    return float(fit['radius'] * abs(_angle(away[:-1], away[1:]).sum()))
