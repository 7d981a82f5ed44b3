"""
Polylines: length, points along them, nearest place on them; lengths are in metres.

A station is the arc length along a polyline from its first point.
"""
import math
from typing import NamedTuple

import numpy as np

from tactile_common.kernels import njit


class Projection(NamedTuple):
    """Nearest place on a polyline in the plane."""

    station: float
    x: float
    y: float
    offset: float  # distance; positive if the point is to the left of the polyline
    left: float  # distance from the line of the first nearest chord; beyond its end < offset
    along_x: float  # unit direction of that chord; (0, 0) if all chords have zero length
    along_y: float


def arc_length(points: np.ndarray) -> np.ndarray:
    """Return the stations (N,) of the vertices (N, D) of a polyline."""
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    return np.append(0.0, np.cumsum(steps))[:len(points)]


def resample(points: np.ndarray, stations: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """
    Interpolate the points (M, D) of a polyline at the wanted stations (M,).

    `points` (N, D) are the vertices, `stations` (N,) their ascending stations. Stations beyond the
    ends give the end points.
    """
    return np.column_stack([np.interp(wanted, stations, axis) for axis in points.T])


@njit(cache=True)
def nearest_on_polyline(xs: np.ndarray, ys: np.ndarray, stations: np.ndarray, x: float, y: float,
                        first: float, last: float) -> Projection:
    """
    Project a point onto a polyline in the plane.

    Outside a corner two chords are equally near and have the same nearest place. The sign of the
    offset then comes from the chord whose line has the larger distance to the point.

    Parameters
    ----------
    xs, ys : ndarray, shape (N,)
        Vertices; columns of a matrix or fields of records.
    stations : ndarray, shape (N,)
        Ascending stations of the vertices; may be those of a polyline in space, seen from above.
    x, y : float
        The point.
    first, last : float
        Only the chords between these stations are used. No defaults: with one, each call from
        Python would determine the types of all arguments again, in 0.25 ms.
    """
    best, seen = np.inf, -1.0
    station, place_x, place_y, offset = max(first, stations[0]), x, y, 0.0
    left = along_x = along_y = 0.0
    for k in range(max(np.searchsorted(stations, first) - 1, 0), len(stations) - 1):
        if stations[k] > last:
            break
        chord_x, chord_y = xs[k + 1] - xs[k], ys[k + 1] - ys[k]
        dx, dy = x - xs[k], y - ys[k]
        length = chord_x * chord_x + chord_y * chord_y  # squared
        share = (dx * chord_x + dy * chord_y) / length if length > 0.0 else 0.0
        if share <= 0.0:
            share, px, py = 0.0, xs[k], ys[k]
        elif share >= 1.0:
            share, px, py = 1.0, xs[k + 1], ys[k + 1]
        else:
            px, py = xs[k] + share * chord_x, ys[k] + share * chord_y
        dx, dy = x - px, y - py
        squared = dx * dx + dy * dy
        if squared > best:
            continue
        length = math.sqrt(length)
        ux, uy = (chord_x / length, chord_y / length) if length > 0.0 else (0.0, 0.0)
        cross = ux * dy - uy * dx
        if squared < best or along_x == along_y == 0.0:
            station = stations[k] + share * (stations[k + 1] - stations[k])
            place_x, place_y, left, along_x, along_y = px, py, cross, ux, uy
        if squared < best or abs(cross) > seen:
            best, seen = squared, abs(cross)
            offset = math.copysign(math.sqrt(squared), cross)
    return Projection(station, place_x, place_y, offset, left, along_x, along_y)
