"""Corners of a traced edge: found by their turn, fitted to every image, averaged."""

import math

import numpy as np

from tactile_common.geometry import wrap_angle
from tactile_sensing.skin.half_spaces import half_spaces
from tactile_servo.edge_map import corner_fit
from tactile_servo.edge_map.corner_fit import CornerShape, SIZE
from tactile_servo.edge_map.picture import Picture
from tactile_servo.edge_map.records import nodes_of

LEAST_TURN = math.radians(18.0)
MEMORY = 40.0  # number of images in the average
WORST_FIT = 4.0  # largest chi-square per tactel

# In skin depths:
SHARP = 0.175  # radius below which a corner counts as sharp
BLURRED = 2.0  # distance beyond the fillet in which the skin blurs the legs
VIEWED = 1.5  # length of each leg beyond the fillet that the pad must cover
FIRST_RADIUS = 0.5  # radius of a guess
WORST_PLACE = 0.2  # largest standard deviation of the vertex
LONGEST_SHIFT = 2.0  # largest distance of a fitted vertex from the guess
# A rounder corner, or one with more curved legs, is followed as a curve.
LONGEST_SETBACK = 3.1  # largest distance from the vertex to the fillet
MOST_BENT = 0.06  # largest curvature of a leg, per depth
# Information known before any image: of the radius [1/depth^2] and of a leg's curvature [depth^2]
RADIUS_INFORMATION, BEND_INFORMATION = 0.4, 1e3


class Corner:
    """
    Corner in the plane of the edge, averaged over the images that show it.

    It starts with one fit: the shape and its inverse covariance (7, 7); `depth` is that of the
    tactels [m].
    """

    def __init__(self, shape: CornerShape, information: np.ndarray, depth: float):
        self.shape, self.depth = shape, depth
        self.entry = self.leave = math.inf  # stations between which it replaces the edge [m]
        self.denied = 0  # number of failed fits since the last successful one
        self._information = information.copy()
        self._moment = np.zeros(SIZE)
        self._reference = np.array(shape)
        self._count = 1.0

    def merge(self, shape: CornerShape, information: np.ndarray) -> None:
        """Add the fit of another image to the mean, weighted by information."""
        gap = np.array(shape) - self._reference
        gap[2:4] = wrap_angle(gap[2:4])
        self._moment += information @ gap
        self._information += information
        self._count += 1.0
        if self._count > MEMORY:
            keep = MEMORY / self._count
            self._moment *= keep
            self._information *= keep
            self._count = MEMORY
        ridge = 1e-9 * np.diag(np.diag(self._information)) + 1e-12 * np.eye(SIZE)
        mean = CornerShape(*(
            self._reference + np.linalg.solve(self._information + ridge, self._moment)))
        self.shape = mean._replace(radius=max(mean.radius, 0.0))

    @property
    def reach(self) -> float:
        """Distance from the vertex within which the corner replaces the traced edge [m]."""
        return self.shape.setback + BLURRED * self.depth

    @property
    def zone(self) -> tuple[float, float, float, float]:
        """Zone in which a leg reaches the corner, values of a ZONE."""
        return self.shape.x, self.shape.y, self.reach, self.shape.first

    def nodes(self) -> np.ndarray:
        """Return the path through the corner: NODE (M,), all at height 0."""
        points, vertex = corner_fit.corner_points(self.shape, self.depth), self.shape.vertex
        if self.shape.radius < SHARP * self.depth:  # sharp: one vertex instead of the fillet
            points = np.vstack([points[:corner_fit.CHORDS], vertex, points[-corner_fit.CHORDS:]])
        legs = np.linalg.norm(points - vertex, axis=1)
        points = points[legs < self.reach + 1e-9]
        chords = np.diff(points, axis=0)
        chords /= np.maximum(np.linalg.norm(chords, axis=1), 1e-12)[:, None]
        return nodes_of(points, 0.0, np.vstack([chords, chords[-1:]]))


def shown(picture: Picture, shape: CornerShape) -> bool:
    """Return True if the corner is on the pad, with legs long enough beyond the fillet."""
    reach = shape.setback + VIEWED * picture.depth
    return (picture.covers(shape.x - reach * math.cos(shape.first),
                           shape.y - reach * math.sin(shape.first))
            and picture.covers(shape.x + reach * math.cos(shape.second),
                               shape.y + reach * math.sin(shape.second)))


def fit(picture: Picture, shape: CornerShape) -> tuple[CornerShape, np.ndarray] | None:
    """
    Fit a corner to an image; return its shape in the plane and its information (7, 7).

    Returns None if the image does not show such a corner, or not enough of it.
    """
    if not shown(picture, shape):
        return None
    array, depth, yaw = picture.array, picture.depth, picture.yaw
    start = shape.moved(-picture.place, 0.0).moved(np.zeros(2), -yaw)
    found, information, chi_square, load = corner_fit.fit_corner(
        picture.pressure, array.x, array.y, half_spaces(picture.skin), picture.noise, start)
    if not (np.isfinite(found).all() and load > 0.0 and chi_square < WORST_FIT):
        return None
    # Add priors of radius and curvatures.
    information += np.diag([0.0, 0.0, 0.0, 0.0, RADIUS_INFORMATION / depth**2,
                            BEND_INFORMATION * depth**2, BEND_INFORMATION * depth**2])
    if (corner_fit.vertex_spread(information) > WORST_PLACE * depth
            or abs(found.turn) < LEAST_TURN
            or max(abs(found.first_bend), abs(found.second_bend)) > MOST_BENT / depth
            or found.setback > LONGEST_SETBACK * depth
            or np.hypot(*(found.vertex - start.vertex)) > LONGEST_SHIFT * depth):
        return None
    return found.moved(picture.place, yaw), corner_fit.turned(information, yaw)


def guess(first: np.ndarray, first_way: np.ndarray, second: np.ndarray, second_way: np.ndarray,
          depth: float) -> CornerShape | None:
    """
    Guess a corner from a place and a direction on each leg (each (2,)).

    Returns None if the legs do not meet ahead of the first place and behind the second.
    """
    (ax, ay), (bx, by), (gap_x, gap_y) = first_way, second_way, second - first
    cross = ax * by - ay * bx
    if abs(cross) < math.sin(0.5 * LEAST_TURN):
        return None
    along = (gap_x * by - gap_y * bx) / cross
    back = (gap_x * ay - gap_y * ax) / cross
    if along < 0.0 or back > 0.0:
        return None
    x, y = first + along * first_way
    return CornerShape(x, y, math.atan2(ay, ax), math.atan2(by, bx), FIRST_RADIUS * depth)
