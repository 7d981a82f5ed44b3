"""Tracing of an edge through a cloud of ridge points, step by step."""

import math

import numpy as np

from tactile_common.kernels import njit
from tactile_common.polyline import nearest_on_polyline
from tactile_servo.edge_map.records import CLOUD_POINT, LocalLine, NODE, Records

# In grains, the resolution of an image, see `PadScale`:
STEP = 0.25  # distance of the nodes of a trace
WIDTH = 0.35  # standard deviation of the weights of points around a place
REACH = 0.9  # radius within which points form a line
AROUND = 1.0  # distance of a trace after which its nearby points are selected again

SUPPORT = 0.3  # least sum of the weights of the points at a node
SIDEWAYS = 0.5  # least cosine between the ridge at a point and the trace
SINGLE = 0.5  # share of the largest support below which a point is due to noise
LINE_ALONG, LINE_ASIDE = 2.0, 0.5  # grains, within which points are on the line of a point


@njit(cache=True)
def into_plane(ridge: np.ndarray, pose: np.ndarray, indentation: float) -> np.ndarray:
    """
    Transform ridge points RIDGE_POINT (N,) of an image into the plane: CLOUD_POINT (N,).

    `pose` (4, 4) is the sensor's in the plane, `indentation` the indentation of the skin per
    pressure on the ridge [m/Pa].
    """
    cloud = np.empty(len(ridge), CLOUD_POINT)
    for n in range(len(ridge)):
        x, y, z = ridge[n].x, ridge[n].y, -indentation * ridge[n].pressure
        cloud[n].x = pose[0, 0] * x + pose[0, 1] * y + pose[0, 2] * z + pose[0, 3]
        cloud[n].y = pose[1, 0] * x + pose[1, 1] * y + pose[1, 2] * z + pose[1, 3]
        cloud[n].z = pose[2, 0] * x + pose[2, 1] * y + pose[2, 2] * z + pose[2, 3]
        tx = pose[0, 0] * ridge[n].tx + pose[0, 1] * ridge[n].ty
        ty = pose[1, 0] * ridge[n].tx + pose[1, 1] * ridge[n].ty
        length = max(math.hypot(tx, ty), 1e-12)  # 0 for a ridge perpendicular to the plane
        cloud[n].tx, cloud[n].ty, cloud[n].weight = tx / length, ty / length, ridge[n].quality
    return cloud


@njit(cache=True)
def trace(cloud: np.ndarray, start: np.ndarray, length: float, grain: float) -> np.ndarray:
    """
    Follow the ridge from a node in its direction.

    Every step moves the expected place onto the weighted mean line of the points around it. The
    direction of this line is the mean direction of their ridges. `cloud` (N,) are the points of
    several images, `length` is the largest length of the trace [m]. The nodes (M,) have no
    stations; the first is one step from `start` (1,).
    """
    step = STEP * grain
    x, y, tx, ty = start[0].x, start[0].y, start[0].tx, start[0].ty
    count = int(length / step)
    nodes = np.empty(count, NODE)
    around, around_x, around_y = cloud, np.inf, np.inf
    for m in range(count):
        px, py = x + step * tx, y + step * ty
        if not math.hypot(px - around_x, py - around_y) < AROUND * grain:
            around, around_x, around_y = _within(cloud, px, py, (AROUND + REACH) * grain), px, py
        line = local_line(around, px, py, tx, ty, grain)
        if not line.support:
            return nodes[:m].copy()
        along = (px - line.x) * line.tx + (py - line.y) * line.ty
        nx, ny = line.x + along * line.tx, line.y + along * line.ty
        advance = (nx - x) * tx + (ny - y) * ty
        aside = math.hypot(nx - px, ny - py)
        if advance < 0.1 * step or aside > 2.0 * step:
            return nodes[:m].copy()
        x, y, tx, ty = nx, ny, line.tx, line.ty
        nodes[m].x, nodes[m].y, nodes[m].z, nodes[m].tx, nodes[m].ty = x, y, line.z, tx, ty
        nodes[m].station, nodes[m].material = 0.0, 1.0
    return nodes


@njit(cache=True)
def _within(cloud: np.ndarray, x: float, y: float, distance: float) -> np.ndarray:
    """Return the points of a cloud within a distance of a place."""
    found, count = np.empty(len(cloud), CLOUD_POINT), 0
    for n in range(len(cloud)):
        dx, dy = cloud[n].x - x, cloud[n].y - y
        if dx * dx + dy * dy <= distance * distance:
            found[count] = cloud[n]
            count += 1
    return found[:count]


@njit(cache=True)
def local_line(cloud: np.ndarray, x: float, y: float, tx: float, ty: float,
               grain: float) -> LocalLine:
    """
    Return the mean line of the ridge near a place.

    Only points with a ridge roughly along (tx, ty) count; the line's direction has that sense.
    """
    width, reach = WIDTH * grain, REACH * grain
    total = mx = my = mz = sx = sy = 0.0
    for n in range(len(cloud)):
        dx, dy = cloud[n].x - x, cloud[n].y - y
        squared = dx * dx + dy * dy
        if squared > reach * reach:
            continue
        along = cloud[n].tx * tx + cloud[n].ty * ty
        if abs(along) < SIDEWAYS:
            continue
        weight = cloud[n].weight * math.exp(-0.5 * squared / (width * width)) * along * along
        sense = weight if along > 0.0 else -weight
        total += weight
        mx += weight * dx
        my += weight * dy
        mz += weight * cloud[n].z
        sx += sense * cloud[n].tx
        sy += sense * cloud[n].ty
    norm = math.hypot(sx, sy)
    if total < SUPPORT or norm == 0.0:
        return LocalLine(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    return LocalLine(total, x + mx / total, y + my / total, mz / total, sx / norm, sy / norm)


@njit(cache=True)
def nearest_line(cloud: np.ndarray, x: float, y: float, tx: float, ty: float,
                 grain: float) -> LocalLine:
    """
    Return the mean line of the ridge along (tx, ty) that is nearest to a place.

    Points with few others on their own line are due to noise, however near they are.
    """
    support = np.zeros(len(cloud))
    for n in range(len(cloud)):
        if abs(cloud[n].tx * tx + cloud[n].ty * ty) < SIDEWAYS:
            continue
        for m in range(len(cloud)):
            dx, dy = cloud[m].x - cloud[n].x, cloud[m].y - cloud[n].y
            along, aside = cloud[n].tx * dx + cloud[n].ty * dy, cloud[n].tx * dy - cloud[n].ty * dx
            if abs(along) < LINE_ALONG * grain and abs(aside) < LINE_ASIDE * grain:
                support[n] += cloud[m].weight
    least, nearest, at = SINGLE * support.max(), np.inf, 0
    for n in range(len(cloud)):
        distance = math.hypot(cloud[n].x - x, cloud[n].y - y)
        if support[n] >= least and distance < nearest:
            nearest, at = distance, n
    return local_line(cloud, cloud[at].x, cloud[at].y, tx, ty, grain)


@njit(cache=True)
def on_path(seen: np.ndarray, near: np.ndarray, distance: float, nodes: Records, x: float,
            y: float, first: float, last: float) -> tuple[float, float]:
    """
    Return the share of seen points near the path, and the station of x, y on it [m].

    A point is near if it is nearer than a `distance` [m] to a node of `near`.
    """
    at = nearest_on_polyline(nodes.x, nodes.y, nodes.station, x, y, first, last)
    count = 0
    for n in range(len(seen)):
        for k in range(len(near) - 1, -1, -1):
            dx, dy = seen[n].x - near[k].x, seen[n].y - near[k].y
            if dx * dx + dy * dy < distance * distance:
                count += 1
                break
    return count / max(len(seen), 1), at.station
