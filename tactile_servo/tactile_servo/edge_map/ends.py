"""End of a leg of the path: it fades, continues beyond a gap, or turns into another leg."""

import numpy as np

from tactile_servo.edge_map.corner import CornerShape, guess, LEAST_TURN
from tactile_servo.edge_map.path import sharpest_turn
from tactile_servo.edge_map.picture import PadScale
from tactile_servo.edge_map.records import joined, nodes_of
from tactile_servo.edge_map.tracing import local_line, STEP

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
    first, last = sharpest_turn(leg, GUESSED * LEAST_TURN)
    if first < 0:
        return None
    place, way = leg['place'], leg['way']
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
