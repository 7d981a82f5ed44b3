"""What the path of a traced edge is asked for: stations, turns, where it closes, what is near."""

import math

import numpy as np

from tactile_common.kernels import njit

NEAR_TURN, FAR_TURN = 4, 9  # nodes either side over which a turn is measured
SHARPNESS = 0.58  # share of the turn that the near nodes must see for a corner
BENT = 300.0  # 1/m, largest curvature that is believed
SAME_WAY = 0.8  # cosine of the angle at which a contour may meet its start


@njit(cache=True)
def stations_of(nodes, first):
    """Way along nodes (N, >= 2) from a first station on: shape (N,) [m]."""
    stations = np.empty(len(nodes))
    way = 0.0
    for k in range(len(nodes)):
        if k:
            dx, dy = nodes[k, 0] - nodes[k - 1, 0], nodes[k, 1] - nodes[k - 1, 1]
            way += math.sqrt(dx * dx + dy * dy)
        stations[k] = first + way
    return stations


@njit(cache=True)
def headings(nodes):
    """Angles (N,) of the nodes' directions, columns 3 and 4, without jumps of a turn [rad]."""
    angles = np.empty(len(nodes))
    for k in range(len(nodes)):
        angles[k] = math.atan2(nodes[k, 4], nodes[k, 3])
        if k:
            turns = np.rint((angles[k] - angles[k - 1]) / (2.0 * math.pi))
            angles[k] -= 2.0 * math.pi * turns
    return angles


@njit(cache=True)
def unblurred(leg, blur, step):
    """
    Move the nodes of a curve out to where the edge must lie: the skin blurs it in.

    Parameters
    ----------
    leg : ndarray, shape (N, 6)
        Nodes, see `edge_trace`, one `step` [m] apart.
    blur : float
        How far a ridge lies inside of a curve, times the curve's radius [m^2].
    """
    count = len(leg)
    moved = leg.copy()
    if count < 6:
        return moved
    angles, span = headings(leg), min(5, (count - 1) // 2)
    for k in range(count):
        middle = min(max(k, span), count - 1 - span)
        curvature = (angles[middle + span] - angles[middle - span]) / (2 * span * step)
        curvature = min(max(curvature, -BENT), BENT)
        moved[k, 0] += blur * curvature * leg[k, 4]
        moved[k, 1] -= blur * curvature * leg[k, 3]
    return moved


@njit(cache=True)
def sharpest_turn(leg, least):
    """
    Nodes before and after the sharpest turn of a leg (N, 6), or -1, -1.

    There is none where it turns by less than `least` [rad], or as evenly as a curve does.
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
def closing_node(nodes, stations, station, begin, reach):
    """
    Node beyond a station at which the path meets its start, or -1.

    Parameters
    ----------
    nodes, stations : ndarray, shape (N, 6), (N,)
    station : float
        Of the pad [m].
    begin : float
        From where on the start is known well [m].
    reach : float
        Largest distance from the node there [m].
    """
    start = nodes[min(np.searchsorted(stations, begin), len(nodes) - 1)]
    nearest, best = np.inf, -1
    for k in range(len(nodes)):
        if stations[k] > station:
            gap = math.hypot(nodes[k, 0] - start[0], nodes[k, 1] - start[1])
            if gap < nearest:
                nearest, best = gap, k
    if nearest > reach or best == len(nodes) - 1:
        return -1
    same_way = nodes[best, 3] * start[3] + nodes[best, 4] * start[4]
    return best if same_way >= SAME_WAY else -1


@njit(cache=True)
def nodes_from(nodes, stations, station, reach, open_start, open_end):
    """
    Nodes (M, 6) from a station on, an open start and end led straight on by `reach` [m].

    A start that lies before the station is not led on; the last node is always among them.
    """
    first = min(np.searchsorted(stations, station, side='right'), len(nodes) - 1)
    before = 1 if open_start and first == 0 else 0
    count = len(nodes) - first
    near = np.empty((before + count + (1 if open_end else 0), 6))
    near[before:before + count] = nodes[first:]
    if before:
        _lead_on(near[0], near[1], -reach)
    if open_end:
        _lead_on(near[-1], near[-2], reach)
    return near


@njit(cache=True)
def _lead_on(node, last, distance):
    node[:] = last
    node[0] += distance * last[3]
    node[1] += distance * last[4]
    node[5] = 1.0
