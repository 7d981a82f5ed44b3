"""Geometry of a path: legs, their sharpest turns and their ends, and where a path closes."""

import numpy as np

from tactile_common.polyline import arc_length
from tactile_servo.edge_map.corner import CornerShape, guess, LEAST_TURN
from tactile_servo.edge_map.picture import PadScale
from tactile_servo.edge_map.records import joined, nodes_of
from tactile_servo.edge_map.tracing import local_line, STEP

TURN = 2.0 * np.pi  # a whole turn [rad]
NEAR_TURN, FAR_TURN = 4, 9  # nodes on each side over which a turn is measured
SHARPNESS = 0.58  # least share of the far nodes' turn within the near nodes, for a corner
VISIBLE_BEND = 0.6  # largest curvature that is visible through the skin, per depth
BEND_NODES = 5  # nodes on each side over which a curvature is measured
MEETING = 0.8  # least cosine between the directions of a contour's end and start where it closes

# The end of a leg: it fades, continues beyond a gap, or turns into another leg.
TIP = 8  # number of nodes over which a ridge fades at its end
FEWEST = 3  # least number of points of another leg
FADED = 0.5  # pressure at the end of a line load, as a share of that along it
GAP_REACH = 18.0 / 12.7  # longest gap that the pad spans from corner to corner, in half pads
GAP_ASIDE, GAP_SPREAD = 0.4, 0.08  # largest deviation beyond a gap: grains, and share of the gap
STRAIGHT_ON = 0.92  # least cosine between the directions of a ridge before and beyond a gap
GUESSED = 0.8  # share of LEAST_TURN above which a turn is guessed to be a corner
LEG_END = 10  # nodes before the end of a leg, where its direction is reliable
OWN_NODES = 30  # nodes at the end of a leg that are compared with the points of another leg
# In grains, see `PadScale`:
BRANCH_REACH = 3.0  # distance from the end of a ridge within which another leg is searched
OFF_LEG = 0.65  # distance from the path beyond which a point belongs to another leg


def unblurred(leg: np.ndarray, blur: float, step: float, depth: float) -> np.ndarray:
    """
    Move the nodes of a curve outwards to the edge: the blur of the skin moves the ridge inwards.

    The nodes (N,) are one `step` [m] apart, the tactels are `depth` [m] deep. `blur` is the
    distance by which the ridge is inside of a curve, times the radius of the curve [m^2].
    """
    count, moved = len(leg), leg.copy()
    if count < 6:
        return moved
    angles, span, most = headings(leg), min(BEND_NODES, (count - 1) // 2), VISIBLE_BEND / depth
    bend = np.empty(count)
    bend[span:-span] = (angles[2 * span:] - angles[:-2 * span]) / (2 * span * step)
    bend[:span], bend[-span:] = bend[span], bend[-span - 1]
    out = blur * np.minimum(np.maximum(bend, -most), most)
    moved['x'] += out * leg['ty']
    moved['y'] -= out * leg['tx']
    return moved


def headings(nodes: np.ndarray) -> np.ndarray:
    """Return the unwrapped angles (N,) of the directions of nodes [rad]."""
    angles = np.arctan2(nodes['ty'], nodes['tx'])
    # Whole turns are subtracted exactly, unlike by np.unwrap, so that equal turns stay equal.
    angles[1:] -= TURN * np.cumsum(np.rint((angles[1:] - angles[:-1]) / TURN))
    return angles


def sharpest_turn(leg: np.ndarray, least: float) -> tuple[int, int] | None:
    """
    Return the indices of the nodes before and after the sharpest turn of a leg (N,).

    There is none if the leg turns by less than `least` [rad] or as evenly as a curve.
    """
    count = len(leg)
    if count <= 2 * NEAR_TURN + 2:
        return None
    angles = headings(leg)
    turns = np.abs(angles[2 * NEAR_TURN:] - angles[:-2 * NEAR_TURN])
    middle = NEAR_TURN + int(turns.argmax())
    first, last = max(middle - FAR_TURN, 0), min(middle + FAR_TURN, count - 1)
    even = SHARPNESS * abs(angles[last] - angles[first])
    return None if turns.max() < max(least, even) else (first, last)


def measure(nodes: np.ndarray, begin: int) -> None:
    """Set the stations of nodes (N,) from index `begin` > 0 on."""
    last = begin - 1
    nodes['station'][last:] = nodes['station'][last] + arc_length(nodes['place'][last:])


def closing_node(nodes: np.ndarray, station: float, begin: float, reach: float) -> int | None:
    """
    Return the index of the node at which the path meets its start, or None.

    Only nodes beyond `station` [m] and within `reach` [m] of the start are considered. The start
    is the node at the station `begin`, from which on the path is accurate.
    """
    stations, last = nodes['station'], len(nodes) - 1
    start = nodes[min(int(stations.searchsorted(begin)), last)]
    gaps = np.hypot(*(nodes['place'] - start['place']).T)
    gaps[stations <= station] = np.inf
    k = int(gaps.argmin())
    met = gaps[k] <= reach and k != last and nodes['way'][k] @ start['way'] >= MEETING
    return k if met else None


def led_on(nodes: np.ndarray, reach: float) -> np.ndarray:
    """Extend a path straight beyond the end of its ridge, by a last node without material."""
    # Single nodes are uncertain where a ridge fades: use means of several.
    tail, last = nodes[-2 * TIP:]['place'], nodes[-1:]
    half = len(tail) // 2
    middle, way = tail[half:].mean(axis=0), last['way'][0]
    if half:
        chord = middle - tail[:half].mean(axis=0)
        size = np.hypot(*chord)
        way = chord / size if size > 0.0 else way
    there = middle + (reach + (last['place'][0] - middle) @ way) * way
    return joined([nodes, nodes_of(there, last['z'], way, 0.0)])


def faded(leg: np.ndarray, height: float) -> int:
    """
    Count the nodes at the end of a ridge that exist only because of the blur.

    `leg` is an ndarray (N,) of NODE, `height` that of the pad's surface [m].
    """
    if len(leg) < 3 * TIP:
        return 0
    indentation = height - leg['z'][-3 * TIP:]
    faint = indentation < FADED * np.median(indentation[:2 * TIP])
    return int(faint[::-1].argmin()) if not faint.all() else 0


def way_over_gap(cloud: np.ndarray, last: np.ndarray, scale: PadScale) -> np.ndarray | None:
    """
    Return nodes across a gap, from the end of a ridge to its continuation ahead, or None.

    `cloud` is an ndarray of CLOUD_POINT, `last` an ndarray (1,) of NODE.
    """
    step, (here,), (way,) = STEP * scale.grain, last['place'], last['way']
    relative = cloud['place'] - here
    ahead, aside = relative @ way, np.abs(relative @ [-way[1], way[0]])
    on = ((ahead > 2.0 * step) & (ahead < GAP_REACH * scale.half)
          & (aside < GAP_ASIDE * scale.grain + GAP_SPREAD * ahead)
          & (np.abs(cloud['way'] @ way) > STRAIGHT_ON))
    if on.sum() < FEWEST:
        return None
    nearest = cloud['place'][on][ahead[on].argmin()]
    line = local_line(cloud, *nearest, *way, scale.grain)
    if not line.support:
        return None
    there = np.array([line.x, line.y])
    count = max(int(np.hypot(*(there - here)) / step), 1)
    share = np.linspace(0.0, 1.0, count + 1)[1:]
    height = last['z'] + share * (line.z - last['z'])
    return nodes_of(here + share[:, None] * (there - here), height, (line.tx, line.ty), 0.0)


def sharp_turn(leg: np.ndarray, depth: float) -> CornerShape | None:
    """Guess a corner at the sharpest turn of a leg; return None if it is a curve."""
    turn = sharpest_turn(leg, GUESSED * LEAST_TURN)
    if turn is None:
        return None
    (first, last), place, way = turn, leg['place'], leg['way']
    return guess(place[first], way[first], place[last], way[last], depth)


def acute_turn(cloud: np.ndarray, leg: np.ndarray, scale: PadScale) -> CornerShape | None:
    """Guess an acute corner, from another leg that begins at the end of this one."""
    if len(leg) < TIP:
        return None
    last = leg['place'][-1]
    close = np.linalg.norm(cloud['place'] - last, axis=1) < BRANCH_REACH * scale.grain
    cloud = cloud[close]
    gaps = np.linalg.norm(cloud['place'][:, None] - leg['place'][None, -OWN_NODES:], axis=2)
    others = cloud[gaps.min(axis=1) > OFF_LEG * scale.grain]
    if len(others) < FEWEST:
        return None
    centre, way = others['place'].mean(axis=0), others['way']
    way = (way * np.sign(way @ way[0])[:, None]).mean(axis=0)
    way /= np.linalg.norm(way)
    if way @ (centre - last) < 0.0:
        way = -way
    before = max(len(leg) - LEG_END, 0)
    return guess(leg['place'][before], leg['way'][before], centre, way, scale.depth)
