"""Geometry of a path: legs, headings, sharpest turn, closing node and nodes near the pad."""

import math
from typing import Any

import numpy as np

from tactile_common.kernels import njit
from tactile_servo.edge_map.records import NODE, Record, Records
from tactile_servo.edge_map.tracing import STEP, trace

NEAR_TURN, FAR_TURN = 4, 9  # nodes on each side over which a turn is measured
SHARPNESS = 0.58  # least share of the far nodes' turn within the near nodes, for a corner
VISIBLE_BEND = 0.6  # largest curvature that is visible through the skin, per depth
BLUR = 0.6  # distance by which a ridge is inside of a curve, times its radius over depth^2
MEETING = 0.8  # least cosine between the directions of a contour's end and start where it closes
ZONE_BEHIND, ZONE_ASIDE = 1.0, 1.25  # grains from a vertex: a leg within both is in its zone
# Vertex of a corner in the plane, reach before it [m], and direction of its first leg [rad].
ZONE = np.dtype([(name, np.float64) for name in ('x', 'y', 'reach', 'way')])


@njit(cache=True)
def headings(nodes: np.ndarray) -> np.ndarray:
    """Return the unwrapped angles (N,) of the directions of nodes [rad]."""
    angles = np.empty(len(nodes))
    for k in range(len(nodes)):
        angles[k] = math.atan2(nodes[k].ty, nodes[k].tx)
        if k:  # subtract whole turns exactly, so that equal turns stay equal
            angles[k] -= 2.0 * math.pi * np.rint((angles[k] - angles[k - 1]) / (2.0 * math.pi))
    return angles


@njit(cache=True)
def unblurred(leg: np.ndarray, blur: float, step: float, depth: float) -> np.ndarray:
    """
    Move the nodes of a curve outwards to the edge: the blur of the skin moves the ridge inwards.

    The nodes (N,) are one `step` [m] apart, the tactels are `depth` [m] deep. `blur` is the
    distance by which the ridge is inside of a curve, times the radius of the curve [m^2].
    """
    count = len(leg)
    moved = leg.copy()
    if count < 6:
        return moved
    most = VISIBLE_BEND / depth
    angles, span = headings(leg), min(5, (count - 1) // 2)
    for k in range(count):
        middle = min(max(k, span), count - 1 - span)
        curvature = (angles[middle + span] - angles[middle - span]) / (2 * span * step)
        curvature = min(max(curvature, -most), most)
        moved[k].x += blur * curvature * leg[k].ty
        moved[k].y -= blur * curvature * leg[k].tx
    return moved


@njit(cache=True)
def sharpest_turn(leg: np.ndarray, least: float) -> tuple[int, int]:
    """
    Return the indices of the nodes before and after the sharpest turn of a leg (N,), or -1, -1.

    There is none if the leg turns by less than `least` [rad] or as evenly as a curve.
    """
    count = len(leg)
    if count <= 2 * NEAR_TURN + 2:
        return -1, -1
    angles = headings(leg)
    largest, middle = -1.0, 0
    for k in range(NEAR_TURN, count - NEAR_TURN):
        turn = abs(angles[k + NEAR_TURN] - angles[k - NEAR_TURN])
        if turn > largest:
            largest, middle = turn, k
    first, last = max(middle - FAR_TURN, 0), min(middle + FAR_TURN, count - 1)
    if largest < least or largest < SHARPNESS * abs(angles[last] - angles[first]):
        return -1, -1
    return first, last


@njit(cache=True)
def measure(nodes: np.ndarray, begin: int) -> None:
    """Set the stations of nodes (N,) from index `begin` > 0 on."""
    for k in range(begin, len(nodes)):
        x, y = nodes[k].x - nodes[k - 1].x, nodes[k].y - nodes[k - 1].y
        nodes[k].station = nodes[k - 1].station + math.sqrt(x * x + y * y)


@njit(cache=True)
def with_leg(nodes: np.ndarray, cloud: np.ndarray, zones: np.ndarray, length: float, grain: float,
             depth: float) -> tuple[np.ndarray, int]:
    """
    Extend nodes (N,) along the ridge, up to the zone of the first corner.

    Returns the nodes with those of the leg, at most `length` [m] long and corrected for the blur,
    and the index of the zone in ZONE (K,) that the leg enters, or -1.
    """
    count, zone = len(nodes), -1
    traced = trace(cloud, nodes[count - 1:], length, grain)
    leg = np.empty(1 + len(traced), NODE)
    leg[0], leg[1:] = nodes[count - 1], traced
    cut = len(traced)
    for k in range(len(zones)):
        first = entry_node(leg, zones[k], grain)
        if first >= 0 and (zone < 0 or first - 1 < cut):
            zone, cut = k, max(first - 1, 0)
    grown = np.empty(count + cut, NODE)
    grown[:count] = nodes
    grown[count:] = unblurred(leg[:cut + 1], BLUR * depth * depth, STEP * grain, depth)[1:]
    measure(grown, count)
    return grown, zone


@njit(cache=True)
def entry_node(leg: np.ndarray, zone: Record, grain: float) -> int:
    """Return the index of the first node of a leg in the zone of a corner, or -1."""
    cos, sin = math.cos(zone.way), math.sin(zone.way)
    for k in range(len(leg)):
        dx, dy = leg[k].x - zone.x, leg[k].y - zone.y
        along = cos * dx + sin * dy
        if (-zone.reach < along < ZONE_BEHIND * grain
                and abs(cos * dy - sin * dx) < ZONE_ASIDE * grain):
            return k
    return -1


@njit(cache=True)
def closing_node(nodes: Records, station: float, begin: float, reach: float) -> int:
    """
    Return the index of the node at which the path meets its start, or -1.

    Only nodes beyond `station` [m] and within `reach` [m] of the start are considered. The start
    is the node at the station `begin`, from which on the path is accurate.
    """
    start = nodes[min(np.searchsorted(nodes.station, begin), len(nodes) - 1)]
    nearest, best = np.inf, -1
    for k in range(len(nodes)):
        if nodes[k].station > station:
            gap = math.hypot(nodes[k].x - start.x, nodes[k].y - start.y)
            if gap < nearest:
                nearest, best = gap, k
    if nearest > reach or best == len(nodes) - 1:
        return -1
    same_way = nodes[best].tx * start.tx + nodes[best].ty * start.ty
    return best if same_way >= MEETING else -1


@njit(cache=True)
def nodes_from(nodes: Records, station: float, reach: float, open_start: bool,
               open_end: bool) -> np.ndarray:
    """
    Return nodes (M,) from a station on, with open start and end extended straight by `reach` [m].

    The start is extended only if it is among these nodes. The last node is always included.
    """
    first: Any = min(np.searchsorted(nodes.station, station, side='right'), len(nodes) - 1)
    before = 1 if open_start and first == 0 else 0
    count = len(nodes) - first
    near = np.empty(before + count + (1 if open_end else 0), NODE)
    near[before:before + count] = nodes[first:]
    if before:
        _lead_on(near, 0, 1, -reach)
    if open_end:
        _lead_on(near, len(near) - 1, len(near) - 2, reach)
    return near


@njit(cache=True)
def _lead_on(nodes: np.ndarray, k: int, last: int, distance: float) -> None:
    nodes[k] = nodes[last]
    nodes[k].x += distance * nodes[last].tx
    nodes[k].y += distance * nodes[last].ty
    nodes[k].material = 1.0
