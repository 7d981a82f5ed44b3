"""Queries of a path at a station: place, slope, length on a pad, speed."""

import math
from typing import Any, NamedTuple

import numpy as np

from tactile_common.geometry import wrap_angle
from tactile_common.kernels import njit
from tactile_common.polyline import nearest_on_polyline
from tactile_servo.edge_map.picture import PadScale
from tactile_servo.edge_map.records import Records
from tactile_servo.edge_map.tracing import STEP

Way = tuple[float, float]  # x, y

CLEAR = 7  # nodes on each side of a turn whose pressure does not give their height
BENT_ANGLE = 0.15  # rad, angle over four nodes above which they form such a turn
STEEPEST = 0.5  # largest slope
LEAST_NODES = 12  # least number of nodes that determine a slope
VERTEX_ANGLE = 0.25  # rad, turn at one vertex above which it is a corner

# In grains, see `PadScale`:
WINDOW = 7.5  # on each side, in which the measured pad is searched
COMMANDED_WINDOW = 2.5  # on each side, in which the commanded pad is searched
SHOWN_WINDOW = 5.0  # on each side, in which the pad of an image is searched
TURN_REACH = 2.0  # on each side of the pad's centre: the pad is aligned with this chord
SLOPE_REACH = 5.0  # on each side, over which the slope is measured
SHORTEST_CHORD = 0.05  # least length that determines a direction


class PathPosition(NamedTuple):
    """Measured and commanded position of a pad on the path."""

    there: np.ndarray  # (4, 4), commanded pose of the pad in the plane
    here: float  # station of the measured pad [m]
    aside: Way  # vector from the measured pad to the path [m]
    along: Way  # direction of the path at the measured pad
    ahead: float  # station of the commanded pad [m]
    way: Way  # direction of the path around the commanded pad
    length: float  # length of the edge under the commanded pad after a move [m]


@njit(cache=True)
def locate(nodes: Records, near: np.ndarray, plane: np.ndarray, pose: np.ndarray,
           commanded: np.ndarray, scale: PadScale, here: float, ahead: float,
           move: Way) -> PathPosition:
    """
    Return the measured and commanded position of a pad on a path.

    One call gives all values of a control cycle, because calls cost more than the computation.
    For the arguments see `EdgeMap.locate`; `nodes` and `near` (N,), (M,) are the path and its part
    that the pad can reach.
    """
    there, grain = np.zeros((4, 4)), scale.grain
    for i in range(4):
        for j in range(4):
            for k in range(4):
                there[i, j] += plane[i, k] * commanded[k, j]
    x = y = 0.0
    for k in range(4):
        x += plane[0, k] * pose[k, 3]
        y += plane[1, k] * pose[k, 3]
    at = nearest_on_polyline(
        nodes.x, nodes.y, nodes.station, x, y, here - WINDOW * grain, here + WINDOW * grain)
    window, chord = COMMANDED_WINDOW * grain, TURN_REACH * grain
    ahead = nearest_on_polyline(
        nodes.x, nodes.y, nodes.station, there[0, 3], there[1, 3], ahead - window,
        ahead + window).station
    return PathPosition(
        there, at.station, (at.x - x, at.y - y), (at.along_x, at.along_y), ahead,
        direction(nodes, ahead - chord, ahead + chord, grain),
        length_on_pad(near, there, move[0], move[1], scale.half_x, scale.half_y))


@njit(cache=True)
def at_picture(nodes: Records, near: np.ndarray, pose: np.ndarray, scale: PadScale, sense: int,
               station: float, ahead: float, ends: bool) -> tuple[float, float, float, float]:
    """
    Return a pad's lateral [m] and angular error, the length under it [m] and the slope ahead.

    `pose` is in the plane. `sense` is +1 if the pad's y points along the path, otherwise -1. The
    pad is searched around `station` [m]. For the slope see `rise`, for `nodes` and `near`
    `locate`.
    """
    grain = scale.grain
    window = SHOWN_WINDOW * grain
    at = nearest_on_polyline(nodes.x, nodes.y, nodes.station, pose[0, 3], pose[1, 3],
                             station - window, station + window)
    yaw = math.atan2(pose[0, 1], pose[1, 1])
    along = math.atan2(sense * at.along_x, sense * at.along_y)
    return (sense * at.left, wrap_angle(yaw - along),
            length_on_pad(near, pose, 0.0, 0.0, scale.half_x, scale.half_y),
            rise(nodes, ahead, SLOPE_REACH * grain, STEP * grain, ends))


@njit(cache=True)
def place_at(nodes: Records, station: float) -> tuple[float, float, float]:
    """Return the place (x, y, z) at a station [m], clipped to the ends of the path."""
    last: Any = min(max(np.searchsorted(nodes.station, station), 1), len(nodes) - 1)
    a, b = nodes[max(last - 1, 0)], nodes[last]
    length = b.station - a.station
    share = min(max((station - a.station) / length, 0.0), 1.0) if length > 0.0 else 0.0
    return a.x + share * (b.x - a.x), a.y + share * (b.y - a.y), a.z + share * (b.z - a.z)


@njit(cache=True)
def direction(nodes: np.ndarray, first: float, last: float, grain: float) -> Way:
    """Return the direction (x, y) between two stations [m]; beyond the end, that of its end."""
    x0, y0, _ = place_at(nodes, first)
    x1, y1, _ = place_at(nodes, last)
    length = math.hypot(x1 - x0, y1 - y0)
    if length < SHORTEST_CHORD * grain:
        return nodes[len(nodes) - 1].tx, nodes[len(nodes) - 1].ty
    return (x1 - x0) / length, (y1 - y0) / length


@njit(cache=True)
def rise(nodes: Records, station: float, reach: float, step: float, ends: bool) -> float:
    """
    Return the slope of an edge around a station, from the heights of its nodes.

    The nodes (N,) are a `step` [m] apart; those within `reach` [m] are used. Nodes near a turn, a
    gap or, if the edge `ends`, the end are excluded: their pressure does not give the height. NaN
    if too few nodes remain.
    """
    count = len(nodes)
    first = np.searchsorted(nodes.station, station - reach)
    last: Any = min(np.searchsorted(nodes.station, station + reach, side='right'),
                    count - 2 * CLEAR if ends else count)
    begin = max(first - CLEAR, 0)
    bent = np.empty(max(min(last + CLEAR, count) - begin, 0), np.bool_)
    for m in range(begin, begin + len(bent)):
        a, b = nodes[max(m - 2, 0)], nodes[min(m + 2, count - 1)]
        bent[m - begin] = a.tx * b.tx + a.ty * b.ty < math.cos(BENT_ANGLE)
    n = ss = sz = sss = ssz = 0.0
    for k in range(first, last):
        clear = True
        for m in range(max(k - CLEAR, 0), min(k + CLEAR + 1, count)):
            away = abs(nodes[m].station - nodes[k].station)
            if nodes[m].material == 0.0 or (bent[m - begin] and away <= CLEAR * step):
                clear = False
                break
        if clear:
            s, z = nodes[k].station - station, nodes[k].z
            n, ss, sz, sss, ssz = n + 1.0, ss + s, sz + z, sss + s * s, ssz + s * z
    spread = n * sss - ss * ss
    if n < LEAST_NODES or spread <= 0.0:
        return np.nan
    return min(max((n * ssz - ss * sz) / spread, -STEEPEST), STEEPEST)


@njit(cache=True)
def speed_profile(nodes: Records, here: float, top: float, acceleration: float, end_speed: float,
                  cut: float, settle: float) -> float:
    """
    Return the largest speed at a station that is compatible with all turns ahead.

    A vertex that turns by phi between chords of mean length l is passed like a circle of radius
    l / phi. A sharp vertex is passed at the speed of the circle that cuts it by `cut`, within a
    distance `settle` on both sides, so that a lagging robot does not cut it more. `top` is the
    wanted speed; all quantities are in m, m/s and m/s^2.
    """
    left = max(nodes[len(nodes) - 1].station - here, 0.0)
    squared = end_speed * end_speed + 2.0 * acceleration * left
    first: Any = max(np.searchsorted(nodes.station, here - settle), 1)
    for k in range(first, len(nodes) - 1):
        before, at, after = nodes[k - 1], nodes[k], nodes[k + 1]
        ahead = at.station - here
        ax, ay = at.x - before.x, at.y - before.y
        bx, by = after.x - at.x, after.y - at.y
        turn = abs(math.atan2(ax * by - ay * bx, ax * bx + ay * by))
        if turn < 1e-3:
            continue
        radius = 0.5 * (math.hypot(ax, ay) + math.hypot(bx, by)) / turn
        if turn > VERTEX_ANGLE:
            radius = min(radius, cut / (1.0 / math.cos(0.5 * min(turn, 2.9)) - 1.0))
            ahead -= settle
        elif ahead < 0.0:
            continue
        squared = min(squared, acceleration * radius + 2.0 * acceleration * max(ahead, 0.0))
    return min(top, math.sqrt(max(squared, 0.0)))


@njit(cache=True)
def length_on_pad(nodes: np.ndarray, pose: np.ndarray, dx: float, dy: float, half_x: float,
                  half_y: float) -> float:
    """
    Return the length of a path, nodes (M,), on the pad [m], without chords that have no material.

    The pad has the pose (4, 4) in the plane, displaced by dx, dy, and the half sides given [m].
    """
    x, y = pose[0, 3] + dx, pose[1, 3] + dy
    yaw = math.atan2(pose[1, 0], pose[0, 0])
    cos, sin, total = math.cos(yaw), math.sin(yaw), 0.0
    for k in range(len(nodes) - 1):
        if nodes[k + 1].material == 0.0:
            continue
        ax, ay = nodes[k].x - x, nodes[k].y - y
        bx, by = nodes[k + 1].x - x, nodes[k + 1].y - y
        ax, ay = cos * ax + sin * ay, cos * ay - sin * ax
        bx, by = cos * bx + sin * by, cos * by - sin * bx
        first, last = 0.0, 1.0
        for position, slope, half in ((ax, bx - ax, half_x), (-ax, ax - bx, half_x),
                                      (ay, by - ay, half_y), (-ay, ay - by, half_y)):
            # position + share slope <= half
            if slope > 0.0:
                last = min(last, (half - position) / slope)
            elif slope < 0.0:
                first = max(first, (half - position) / slope)
            elif position > half:
                last = -1.0
        if last > first:
            total += (last - first) * math.hypot(bx - ax, by - ay)
    return total
