"""Trace an edge through a cloud of ridge points, step by step."""

import math

import numpy as np

from tactile_common.kernels import njit

STEP = 0.5e-3  # m between nodes of a trace
WIDTH = 0.7e-3  # m, standard deviation of the window of a step
REACH = 1.8e-3  # m, radius of that window
SUPPORT = 0.3  # points, weighted, that a node needs
SIDEWAYS = 0.5  # cosine of the largest angle between a point's ridge and the trace
CLEAR = 7  # nodes either side of a turn whose pressure does not tell their height
BLURRING_TURN = 0.15  # rad over four nodes that makes such a turn
STEEPEST = 0.5  # rise per length that is believed
SHARP_TURN = 0.25  # rad at one vertex that makes it a corner
# Columns of a cloud: position in the plane, depth, direction, weight.
X, Y, Z, DX, DY, WEIGHT = range(6)


@njit(cache=True)
def into_plane(points, pose, indentation):
    """
    Cloud (N, 6) of the ridge points of a picture.

    Parameters
    ----------
    points : ndarray, shape (N, 6)
        Of `tactile_sensing.contact.ridge.ridge_points`.
    pose : ndarray, shape (4, 4)
        Of the sensor in the plane's frame.
    indentation : float
        Of the skin on the ridge, per pressure there [m/Pa].
    """
    cloud = np.empty((len(points), 6))
    for n in range(len(points)):
        x, y, z = points[n, 0], points[n, 1], -indentation * points[n, 4]
        for i in range(3):
            cloud[n, i] = pose[i, 0] * x + pose[i, 1] * y + pose[i, 2] * z + pose[i, 3]
        dx = pose[0, 0] * points[n, 2] + pose[0, 1] * points[n, 3]
        dy = pose[1, 0] * points[n, 2] + pose[1, 1] * points[n, 3]
        length = max(math.hypot(dx, dy), 1e-12)  # square to the plane it has no way in it
        cloud[n, DX], cloud[n, DY], cloud[n, WEIGHT] = dx / length, dy / length, points[n, 5]
    return cloud


@njit(cache=True)
def trace(cloud, x, y, tx, ty, length):
    """
    Follow the ridge from a place in a direction.

    Every step moves the expected place onto the weighted mean line of the points around it,
    whose direction is that of their ridges.

    Parameters
    ----------
    cloud : ndarray, shape (N, 6)
        Points of several pictures: x, y, z, ridge direction x, y, weight [m].
    x, y, tx, ty : float
        Where to begin [m] and the unit direction in which to go.
    length : float
        Where to stop at the latest [m].

    Returns
    -------
    ndarray, shape (M, 6)
        Nodes x, y, z, directions x, y and 1 for material; the first one step from the
        beginning.
    """
    count = int(length / STEP)
    nodes = np.ones((count, 6))
    for m in range(count):
        px, py = x + STEP * tx, y + STEP * ty
        found, cx, cy, cz, ux, uy = local_line(cloud, px, py, tx, ty)
        if not found:
            return nodes[:m].copy()
        along = (px - cx) * ux + (py - cy) * uy
        nx, ny = cx + along * ux, cy + along * uy
        advance = (nx - x) * tx + (ny - y) * ty
        aside = math.hypot(nx - px, ny - py)
        if advance < 0.1 * STEP or aside > 2.0 * STEP:
            return nodes[:m].copy()
        x, y, tx, ty = nx, ny, ux, uy
        nodes[m, 0], nodes[m, 1], nodes[m, 2], nodes[m, 3], nodes[m, 4] = x, y, cz, tx, ty
    return nodes


@njit(cache=True)
def local_line(cloud, x, y, tx, ty):
    """
    Mean place (3) and direction (2) of the ridge near a place, and whether there is one.

    Only points whose ridge runs roughly along (tx, ty) count, and the direction has that sense.
    """
    total = mx = my = mz = sx = sy = 0.0
    for n in range(len(cloud)):
        dx, dy = cloud[n, X] - x, cloud[n, Y] - y
        squared = dx * dx + dy * dy
        if squared > REACH * REACH:
            continue
        along = cloud[n, DX] * tx + cloud[n, DY] * ty
        if abs(along) < SIDEWAYS:
            continue
        weight = cloud[n, WEIGHT] * math.exp(-0.5 * squared / (WIDTH * WIDTH)) * along * along
        sense = weight if along > 0.0 else -weight
        total += weight
        mx += weight * dx
        my += weight * dy
        mz += weight * cloud[n, Z]
        sx += sense * cloud[n, DX]
        sy += sense * cloud[n, DY]
    norm = math.hypot(sx, sy)
    if total < SUPPORT or norm == 0.0:
        return False, 0.0, 0.0, 0.0, 0.0, 0.0
    return True, x + mx / total, y + my / total, mz / total, sx / norm, sy / norm


@njit(cache=True)
def project(nodes, stations, x, y, first, last):
    """
    Nearest place of a polyline between two stations.

    Returns
    -------
    tuple of float
        Station, x and y of the place, distance to the left, and the direction x, y there.
    """
    best, station, fx, fy, left, ux, uy = np.inf, first, x, y, 0.0, 1.0, 0.0
    for k in range(max(np.searchsorted(stations, first) - 1, 0), len(nodes) - 1):
        if stations[k] > last:
            break
        ax, ay = nodes[k, 0], nodes[k, 1]
        bx, by = nodes[k + 1, 0] - ax, nodes[k + 1, 1] - ay
        length = math.hypot(bx, by)
        if length == 0.0:
            continue
        share = min(max(((x - ax) * bx + (y - ay) * by) / (length * length), 0.0), 1.0)
        dx, dy = x - ax - share * bx, y - ay - share * by
        squared = dx * dx + dy * dy
        if squared < best:
            best = squared
            station = stations[k] + share * (stations[k + 1] - stations[k])
            fx, fy = ax + share * bx, ay + share * by
            ux, uy = bx / length, by / length
            left = ux * dy - uy * dx
    return station, fx, fy, left, ux, uy


@njit(cache=True)
def share_near(points, nodes, distance):
    """Share of points (N, >= 2) that are nearer than a distance [m] to some node."""
    near = 0
    for n in range(len(points)):
        for k in range(len(nodes) - 1, -1, -1):
            if math.hypot(points[n, 0] - nodes[k, 0], points[n, 1] - nodes[k, 1]) < distance:
                near += 1
                break
    return near / max(len(points), 1)


@njit(cache=True)
def place_at(nodes, stations, station):
    """Place (x, y, z) of a polyline at a station [m], its ends beyond them."""
    if station <= stations[0]:
        return nodes[0, 0], nodes[0, 1], nodes[0, 2]
    if station >= stations[-1]:
        return nodes[-1, 0], nodes[-1, 1], nodes[-1, 2]
    k = np.searchsorted(stations, station)
    length = stations[k] - stations[k - 1]
    share = (station - stations[k - 1]) / length if length > 0.0 else 0.0
    first, last = nodes[k - 1], nodes[k]
    return (first[0] + share * (last[0] - first[0]), first[1] + share * (last[1] - first[1]),
            first[2] + share * (last[2] - first[2]))


@njit(cache=True)
def turned(angle_1, angle_2):
    """Angle from one direction to another, within half a turn."""
    return math.atan2(math.sin(angle_2 - angle_1), math.cos(angle_2 - angle_1))


@njit(cache=True)
def rise(nodes, stations, station, reach, ends):
    """
    Rise of an edge along itself around a station, from the heights of its nodes.

    Left out is what lies near a turn, a gap or, if it `ends`, the end: there the pressure does
    not tell the height. NaN where too little is left.
    """
    count = len(nodes)
    first = np.searchsorted(stations, station - reach)
    last = min(np.searchsorted(stations, station + reach, side='right'),
               count - 2 * CLEAR if ends else count)
    begin = max(first - CLEAR, 0)
    bent = np.empty(max(min(last + CLEAR, count) - begin, 0), np.bool_)
    for m in range(begin, begin + len(bent)):
        a, b = max(m - 2, 0), min(m + 2, count - 1)
        bent[m - begin] = abs(turned(math.atan2(nodes[a, 4], nodes[a, 3]),
                                     math.atan2(nodes[b, 4], nodes[b, 3]))) > BLURRING_TURN
    n = ss = sz = sss = ssz = 0.0
    for k in range(first, last):
        clear = True
        for m in range(max(k - CLEAR, 0), min(k + CLEAR + 1, count)):
            if nodes[m, 5] == 0.0 or (
                    bent[m - begin] and abs(stations[m] - stations[k]) <= CLEAR * STEP):
                clear = False
                break
        if clear:
            s, z = stations[k] - station, nodes[k, 2]
            n, ss, sz, sss, ssz = n + 1.0, ss + s, sz + z, sss + s * s, ssz + s * z
    spread = n * sss - ss * ss
    if n < 12 or spread <= 0.0:
        return np.nan
    return min(max((n * ssz - ss * sz) / spread, -STEEPEST), STEEPEST)


@njit(cache=True)
def speed_profile(nodes, stations, here, top, acceleration, end_speed, cut, settle):
    """
    Largest speed at a station from which every turn ahead can be taken.

    A vertex that turns by phi between chords of mean length l is passed as a circle of
    radius l / phi; a sharp one at the speed of the circle that cuts it by `cut`, and over a
    distance `settle` either side of it, so that a robot that lags does not cut it either.

    Parameters
    ----------
    nodes, stations : ndarray, shape (M, >= 2), (M,)
        The path [m].
    here, top, acceleration, end_speed, cut, settle : float
        Station [m], speed asked for [m/s], largest acceleration [m/s^2], speed allowed at the
        end of the path [m/s], allowed distance from a corner [m], see above [m].
    """
    squared = end_speed * end_speed + 2.0 * acceleration * max(stations[-1] - here, 0.0)
    for k in range(max(np.searchsorted(stations, here - settle), 1), len(nodes) - 1):
        ahead = stations[k] - here
        ax, ay = nodes[k, 0] - nodes[k - 1, 0], nodes[k, 1] - nodes[k - 1, 1]
        bx, by = nodes[k + 1, 0] - nodes[k, 0], nodes[k + 1, 1] - nodes[k, 1]
        turn = abs(math.atan2(ax * by - ay * bx, ax * bx + ay * by))
        if turn < 1e-3:
            continue
        radius = 0.5 * (math.hypot(ax, ay) + math.hypot(bx, by)) / turn
        if turn > SHARP_TURN:
            radius = min(radius, cut / (1.0 / math.cos(0.5 * min(turn, 2.9)) - 1.0))
            ahead -= settle
        elif ahead < 0.0:
            continue
        squared = min(squared, acceleration * radius + 2.0 * acceleration * max(ahead, 0.0))
    return min(top, math.sqrt(max(squared, 0.0)))


@njit(cache=True)
def length_on_pad(nodes, x, y, cos, sin, half_x, half_y):
    """
    Length of a path on the pad [m], chords without material left out.

    Parameters
    ----------
    nodes : ndarray, shape (M, 6)
        Column 5 says whether there is material between a node and the one before.
    x, y, cos, sin : float
        Centre of the pad [m] and its orientation in the plane.
    half_x, half_y : float
        Half the size of the pad [m].
    """
    total = 0.0
    for k in range(len(nodes) - 1):
        if nodes[k + 1, 5] == 0.0:
            continue
        ax, ay = nodes[k, 0] - x, nodes[k, 1] - y
        bx, by = nodes[k + 1, 0] - x, nodes[k + 1, 1] - y
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
