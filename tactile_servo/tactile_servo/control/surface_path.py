"""Paths over an unknown surface: the direction of travel at each contact."""
import math
from typing import NamedTuple

import numpy as np

from tactile_common.geometry import cross
from tactile_common.polyline import arc_length, nearest_on_polyline, resample
from tactile_servo.control.scaling import clipped

SPACING = 2.5e-4  # m between the points of a planned path
SEARCHED = 5e-3  # m ahead of its last station, within which the probe is searched on its path
LEAD = 5e-4  # m, least distance ahead of the probe of the point that it moves towards
ARRIVED = 2e-4  # m before the end of a path at which it is complete
STEEP = 0.2  # smallest cosine between the normal and the first normal, or the plane of a path


class PathStep(NamedTuple):
    """Direction of travel and largest speed at a contact."""

    way: np.ndarray  # (3,), unit vector in the surface
    top: float  # largest speed [m/s]
    left: float  # remaining length of the path [m], infinite if it has no end


class SectionPath:
    """
    Path in the plane of a direction and the first normal; it can go round a cylinder.

    Points and inward normals (3,) are in the base frame.
    """

    def __init__(self, point: np.ndarray, normal: np.ndarray, direction: np.ndarray):
        self._start = point
        self._across = _axes(direction, normal)[1]

    def step(self, point: np.ndarray, normal: np.ndarray, gain: float,
             speed: float) -> PathStep | None:
        """
        Compute the next step from a contact; None if the surface is almost parallel to the plane.

        The path is approached at a rate `gain` [1/s], at a speed [m/s].
        """
        across = self._across
        way = cross(across, normal)
        size = math.sqrt(way @ way)
        if size < STEEP:
            return None
        back = clipped(gain * ((point - self._start) @ across) / max(speed, 1e-3), -0.5, 0.5)
        return PathStep(_unit(way / size - back * (across - normal * (normal @ across))),
                        math.inf, math.inf)


class PlanarPath:
    """A path drawn in the plane of the first contact, seen along its normal."""

    def __init__(self, point: np.ndarray, normal: np.ndarray, direction: np.ndarray,
                 plan: np.ndarray, acceleration: float):
        self._frame = np.stack([*_axes(direction, normal), normal])
        self._start = point
        corners = arc_length(plan)
        stations = np.linspace(0.0, corners[-1], max(int(corners[-1] / SPACING), 2))
        self._plan = resample(plan, corners, stations)
        self._stations, self._station = stations, 0.0
        self._tops = _speeds(self._plan, stations, acceleration)

    def step(self, point: np.ndarray, normal: np.ndarray, gain: float,
             speed: float) -> PathStep | None:
        """Compute the next step, as `SectionPath.step`; None where the surface is too steep."""
        ahead, aside, inward = self._frame
        facing = float(inward @ normal)
        if facing < STEEP:
            return None
        x, y, _ = self._frame @ (point - self._start)
        # Only ahead, never back: outside a corner both legs are equally near.
        at = nearest_on_polyline(self._plan[:, 0], self._plan[:, 1], self._stations, x, y,
                                 self._station, self._station + SEARCHED)
        self._station = max(at.station, self._station)
        aim = self._station + LEAD + speed / max(gain, 1e-3)
        u, v = (float(np.interp(aim, self._stations, axis)) for axis in self._plan.T)
        u, v = u - x, v - y
        flat = u * ahead + v * aside
        way = flat - inward * ((flat @ normal) / facing)  # as seen along the first normal
        left = self._stations[-1] - self._station
        return PathStep(_unit(way), float(np.interp(self._station, self._stations, self._tops)),
                        0.0 if left < ARRIVED else left)


SurfacePath = SectionPath | PlanarPath


def raster(size_x: float, size_y: float, step_over: float) -> np.ndarray:
    """Return rows along x (N, 2) over a rectangle around the origin, where they begin [m]."""
    count = int(size_y / step_over + 1e-9) + 1
    radius, x = 0.5 * step_over, 0.5 * size_x
    points, first = [(0.0, 0.0)], -0.5 * step_over * (count - 1)
    turn = np.linspace(-0.5 * np.pi, 0.5 * np.pi, 13)[1:-1]
    for k in range(count):
        y, sign = first + k * step_over, 1.0 if k % 2 == 0 else -1.0
        points += [(-sign * x, y), (sign * x, y)]
        if k + 1 < count:
            points += [(sign * (x + radius * math.cos(a)), y + radius * (1.0 + math.sin(a)))
                       for a in turn]
    return np.array(points)


def spiral(radius: float, step_over: float) -> np.ndarray:
    """Return an Archimedean spiral (N, 2) from the origin outwards to a radius [m]."""
    turns = radius / step_over
    angles = np.linspace(0.0, 2.0 * np.pi * turns, max(int(turns * 120), 8))
    away = step_over * angles / (2.0 * np.pi)
    return np.column_stack([away * np.cos(angles), away * np.sin(angles)])


def seen_along(points: np.ndarray, point: np.ndarray, normal: np.ndarray,
               direction: np.ndarray) -> np.ndarray:
    """Project points (N, 3) along the first normal: a plan (N + 1, 2) from the first contact."""
    return np.vstack([np.zeros(2), (points - point) @ _axes(direction, normal).T])


def _speeds(plan: np.ndarray, stations: np.ndarray, acceleration: float) -> np.ndarray:
    """Return speeds (N,) that allow to brake for and follow every bend; 0 at the end [m/s]."""
    chord = np.diff(plan, axis=0)
    heading = np.unwrap(np.arctan2(chord[:, 1], chord[:, 0]))
    spacing = stations[1] - stations[0]
    # The curvature is averaged over three points: a path of chords is no chain of corners.
    bend = np.zeros(len(plan))
    bend[1:-1] = abs(np.diff(heading)) / spacing
    bend = np.convolve(np.pad(bend, 1, 'edge'), np.full(3, 1.0 / 3.0), 'valid')
    square = acceleration / np.maximum(bend, 1e-3)
    square[-1] = 0.0
    # The least over the stations ahead of what braking for each of them allows
    braking = 2.0 * acceleration * stations
    ahead = np.minimum.accumulate((square + braking)[::-1])[::-1]
    return np.sqrt(np.maximum(ahead - braking, 0.0))


def _axes(direction: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """
    Return unit vectors (2, 3) in the surface, along a direction (3,) and across it.

    If the direction is 0 or parallel to the normal, any direction in the surface will do.
    """
    along = direction - normal * (direction @ normal)
    if along @ along <= 1e-4 * (direction @ direction):
        along = cross(normal, [1.0, 0.0, 0.0] if abs(normal[0]) < 0.7 else [0.0, 1.0, 0.0])
    return np.stack([_unit(along), cross(normal, _unit(along))])


def _unit(vector: np.ndarray) -> np.ndarray:
    return vector / math.sqrt(vector @ vector)
