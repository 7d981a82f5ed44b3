"""Corners of a traced edge: found by their turn, fitted to every image, averaged."""

import math
from typing import NamedTuple

import numpy as np

from tactile_common.geometry import wrap_angle
from tactile_common.kernels import njit
from tactile_sensing.skin.half_spaces import add_point, add_segment, half_spaces
from tactile_servo.edge_map.picture import Picture
from tactile_servo.edge_map.records import nodes_of

LEAST_TURN = math.radians(18.0)
MEMORY = 40.0  # number of images in the average
WORST_FIT = 4.0  # largest chi-square per tactel

# In grains, see `PadScale`, from the vertex: a leg within both enters the corner.
ZONE_BEHIND, ZONE_ASIDE = 1.0, 1.25
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

# Fit to an image:
MODEL_ERROR = 0.02  # relative error of a modelled pressure
# In skin depths, the width to which the skin blurs a line:
LEG = 7.5  # length of each leg that loads the tactels near the vertex
FITTED = 4.0  # distance from the vertex within which tactels are used: farther, only legs show
FARTHEST = 0.75  # largest step of an iteration
LEAST_RADIUS = 0.05  # smallest radius in a fit: a sharp vertex has no derivative
RADIUS_PRIOR = 1.5  # standard deviation of the radius before the fit
BEND_PRIOR = 0.03  # standard deviation of a leg's curvature before the fit, per depth
# Steps of the numerical derivatives: of the vertex, of the radius, and of a curvature, per depth
PLACE_STEP, RADIUS_STEP, BEND_STEP = 0.01, 0.025, 0.001
# In rad:
ANGLE_STEP = 2e-3  # step of the numerical derivatives by a leg's direction
WIDEST_CHANGE = 0.3  # largest change of a leg's direction in an iteration
STRAIGHT = 2.9  # turn above which the legs coincide
# Counts:
LEAST_TACTELS = 20  # tactels near the vertex that a fit needs
CHORDS = 5  # chords of a leg
ARC_CHORDS = 6  # chords of a fillet; even, so that a node is at its middle
ROUNDS = 4  # iterations


class CornerShape(NamedTuple):
    """
    Corner with two legs and the fillet between them.

    Vectors and information matrices of a corner have the order of these fields.
    """

    x: float  # vertex, where the legs would meet [m]
    y: float
    first: float  # direction of travel on the first and on the second leg [rad]
    second: float
    radius: float  # radius of the fillet [m]
    first_bend: float = 0.0  # curvatures of the legs [1/m], positive to the left
    second_bend: float = 0.0

    @property
    def vertex(self) -> np.ndarray:
        """Vertex (2,), where the legs would meet [m]."""
        return np.array([self.x, self.y])

    @property
    def turn(self) -> float:
        """Angle from the first leg to the second [rad]."""
        return wrap_angle(self.second - self.first)

    @property
    def setback(self) -> float:
        """Distance from the vertex to the fillet [m]."""
        return self.radius * math.tan(0.5 * min(abs(self.turn), STRAIGHT))

    def moved(self, place: np.ndarray, yaw: float) -> 'CornerShape':
        """Return the shape rotated by `yaw` and then translated by `place` (2,)."""
        cos, sin = math.cos(yaw), math.sin(yaw)
        x, y = place
        return self._replace(x=cos * self.x - sin * self.y + x, y=sin * self.x + cos * self.y + y,
                             first=self.first + yaw, second=self.second + yaw)


SIZE = len(CornerShape._fields)
RADIUS = CornerShape._fields.index('radius')  # the curvatures come after it


def turned(information: np.ndarray, yaw: float) -> np.ndarray:
    """Return the information (7, 7) of a corner rotated by `yaw`."""
    cos, sin = math.cos(yaw), math.sin(yaw)
    rotation = np.eye(SIZE)
    rotation[:2, :2] = [[cos, -sin], [sin, cos]]
    return rotation @ information @ rotation.T


def vertex_spread(information: np.ndarray) -> float:
    """Return the standard deviation of the vertex [m]; infinite if it is not determined."""
    try:
        return math.sqrt(np.trace(np.linalg.inv(information)[:2, :2]))
    except (np.linalg.LinAlgError, ValueError):
        return math.inf


@njit(cache=True)
def corner_points(corner: CornerShape, depth: float) -> np.ndarray:
    """Return the polyline (2 CHORDS + ARC_CHORDS + 1, 2) of a corner at a skin depth [m]."""
    turn = wrap_angle(corner.second - corner.first)
    radius, spacing = max(corner.radius, 0.0), LEG * depth / CHORDS
    setback = radius * math.tan(0.5 * min(abs(turn), STRAIGHT))
    leg, arc = spacing * (np.arange(CHORDS) + 0.5), (np.arange(ARC_CHORDS) + 0.5) / ARC_CHORDS
    angles = np.concatenate((corner.first - corner.first_bend * leg[::-1],
                             corner.first + turn * arc,
                             corner.second + corner.second_bend * leg))
    chords = np.full(angles.size, spacing)
    chords[CHORDS:-CHORDS] = 2.0 * radius * math.sin(0.5 * abs(turn) / ARC_CHORDS)
    x, y = np.cumsum(chords * np.cos(angles)), np.cumsum(chords * np.sin(angles))
    # The fillet begins at the end of the first leg.
    points = np.empty((angles.size + 1, 2))
    points[0] = 0.0
    points[1:, 0], points[1:, 1] = x, y
    points[:, 0] += corner.x - setback * math.cos(corner.first) - x[CHORDS - 1]
    points[:, 1] += corner.y - setback * math.sin(corner.first) - y[CHORDS - 1]
    return points


@njit(cache=True)
def corner_pressure(corner: CornerShape, x: np.ndarray, y: np.ndarray,
                    skin: np.ndarray) -> np.ndarray:
    """
    Return the pressure (rows, columns) of a corner with unit load per length at tactels x, y [m].

    `skin` contains HALF_SPACE records, see `half_spaces`.
    """
    depth = skin[0].depth
    points = corner_points(corner, depth)
    pressure = np.zeros((len(y), len(x)))
    for k in range(len(points) - 1):
        x0, y0, x1, y1 = points[k, 0], points[k, 1], points[k + 1, 0], points[k + 1, 1]
        length = math.hypot(x1 - x0, y1 - y0)
        for part in skin:
            if part.weight == 0.0:
                continue
            if length > 0.125 * depth:
                add_segment(pressure, x, y, part.depth, x0, y0, x1, y1, part.weight, part.weight)
            elif length > 0.0:
                add_point(pressure, x, y, part.depth, 0.5 * (x0 + x1), 0.5 * (y0 + y1),
                          part.weight * length)
    return pressure


def fit_corner(pressure: np.ndarray, x: np.ndarray, y: np.ndarray, skin: np.ndarray, noise: float,
               start: CornerShape) -> tuple[CornerShape, np.ndarray] | None:
    """
    Fit a corner to an image by Gauss-Newton, with the load eliminated in closed form.

    The pressure (rows, columns) [Pa] must be finite; x, y are the tactels' positions [m]; `skin`
    is as for `corner_pressure`. `noise` is that of one tactel [Pa]. `start` is the first guess, in
    the sensor frame. Returns the corner and its information (7, 7), without the priors, or None if
    too few tactels are near or none fits.
    """
    depth = skin[0]['depth']
    near = (x - start.x)**2 + (y[:, None] - start.y)**2 < (FITTED * depth)**2
    if np.count_nonzero(near) < LEAST_TACTELS:
        return None
    seen = pressure[near]
    weight = 1.0 / (noise**2 + (MODEL_ERROR * seen)**2)
    steps = np.array([PLACE_STEP * depth, PLACE_STEP * depth, ANGLE_STEP, ANGLE_STEP,
                      RADIUS_STEP * depth, BEND_STEP / depth, BEND_STEP / depth])
    prior = np.zeros(SIZE)  # information about radius and curvatures
    prior[RADIUS] = (RADIUS_PRIOR * depth)**-2
    prior[RADIUS + 1:] = (BEND_PRIOR / depth)**-2

    def modelled(vector: np.ndarray) -> np.ndarray:
        return corner_pressure(CornerShape(*vector.tolist()), x, y, skin)[near]

    p = np.array(start)
    for step in range(ROUNDS + 1):
        unit = modelled(p)
        own = (weight * unit) @ unit
        load = (weight * unit) @ seen / own
        error = seen - load * unit
        if not load > 0.0:
            return None
        if step == ROUNDS:
            break
        slopes = np.array([modelled(other) for other in p + np.diag(steps)]) - unit
        slopes /= steps[:, None]
        # Remove the part that a change of the load can explain.
        jacobian = load * (slopes - np.outer(slopes @ (weight * unit) / own, unit))
        information = (weight * jacobian) @ jacobian.T
        change = CornerShape(*np.linalg.solve(
            information + np.diag(prior + 1e-9 * np.diag(information) + 1e-12),
            jacobian @ (weight * error) - prior * p))
        p += np.array(change) / max(
            math.hypot(change.x, change.y) / (FARTHEST * depth),
            abs(change.radius) / (FARTHEST * depth),
            max(abs(change.first), abs(change.second)) / WIDEST_CHANGE, 1.0)
        p[RADIUS] = max(p[RADIUS], LEAST_RADIUS * depth)
    fits = np.isfinite(p).all() and weight @ error**2 / len(seen) < WORST_FIT
    return (CornerShape(*p.tolist()), information) if fits else None


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

    def entered(self, leg: np.ndarray, grain: float) -> np.ndarray:
        """Return which nodes (N,) of a leg are where it enters the corner."""
        x, y = (leg['place'] - self.shape.vertex).T
        cos, sin = math.cos(self.shape.first), math.sin(self.shape.first)
        along, aside = cos * x + sin * y, np.abs(cos * y - sin * x)
        return ((-self.reach < along) & (along < ZONE_BEHIND * grain)
                & (aside < ZONE_ASIDE * grain))

    def nodes(self) -> np.ndarray:
        """Return the path through the corner: NODE (M,), all at height 0."""
        points, vertex = corner_points(self.shape, self.depth), self.shape.vertex
        if self.shape.radius < SHARP * self.depth:  # sharp: one vertex instead of the fillet
            points = np.vstack([points[:CHORDS], vertex, points[-CHORDS:]])
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
    fitted = fit_corner(
        picture.pressure, array.x, array.y, half_spaces(picture.skin), picture.noise, start)
    if fitted is None:
        return None
    found, information = fitted
    # Add priors of radius and curvatures.
    information += np.diag([0.0, 0.0, 0.0, 0.0, RADIUS_INFORMATION / depth**2,
                            BEND_INFORMATION * depth**2, BEND_INFORMATION * depth**2])
    if (vertex_spread(information) > WORST_PLACE * depth
            or abs(found.turn) < LEAST_TURN
            or max(abs(found.first_bend), abs(found.second_bend)) > MOST_BENT / depth
            or found.setback > LONGEST_SETBACK * depth
            or np.hypot(*(found.vertex - start.vertex)) > LONGEST_SHIFT * depth):
        return None
    return found.moved(picture.place, yaw), turned(information, yaw)


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
