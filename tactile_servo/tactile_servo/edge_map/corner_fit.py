"""Fit of a corner to the pressure image: vertex, two legs and fillet."""

import math
from typing import NamedTuple

import numpy as np

from tactile_common.geometry import wrap_angle
from tactile_common.kernels import njit
from tactile_sensing.skin.half_spaces import add_point, add_segment

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


class CornerFit(NamedTuple):
    """Result of the fit of a corner to an image."""

    shape: CornerShape
    information: np.ndarray  # (7, 7), inverse covariance without the priors
    chi_square: float  # per tactel
    load: float  # force per length [N/m], 0 if too few tactels are near


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
    radius = max(corner.radius, 0.0)
    setback = radius * math.tan(0.5 * min(abs(turn), STRAIGHT))
    points = np.empty((2 * CHORDS + ARC_CHORDS + 1, 2))
    spacing = LEG * depth / CHORDS
    # First leg, backwards from the start of the fillet.
    x = begin_x = corner.x - setback * math.cos(corner.first)
    y = begin_y = corner.y - setback * math.sin(corner.first)
    points[CHORDS] = x, y
    for k in range(CHORDS):
        angle = corner.first - corner.first_bend * spacing * (k + 0.5)
        x, y = x - spacing * math.cos(angle), y - spacing * math.sin(angle)
        points[CHORDS - 1 - k] = x, y
    x, y = begin_x, begin_y
    chord = 2.0 * radius * math.sin(0.5 * abs(turn) / ARC_CHORDS)
    for k in range(ARC_CHORDS + CHORDS):
        if k < ARC_CHORDS:
            length, angle = chord, corner.first + turn * (k + 0.5) / ARC_CHORDS
        else:
            length = spacing
            angle = corner.second + corner.second_bend * spacing * (k - ARC_CHORDS + 0.5)
        x, y = x + length * math.cos(angle), y + length * math.sin(angle)
        points[CHORDS + 1 + k] = x, y
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
               start: CornerShape) -> CornerFit:
    """
    Fit a corner to an image by Gauss-Newton, with the load eliminated in closed form.

    The pressure (rows, columns) [Pa] must be finite; x, y are the tactels' positions [m]; `skin`
    is as for `corner_pressure`. `noise` is that of one tactel [Pa]. `start` is the first guess, in
    the sensor frame.
    """
    depth, information = skin[0]['depth'], np.zeros((SIZE, SIZE))
    near = (x - start.x)**2 + (y[:, None] - start.y)**2 < (FITTED * depth)**2
    if np.count_nonzero(near) < LEAST_TACTELS:
        return CornerFit(start, information, math.inf, 0.0)
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
        if step == ROUNDS or not load > 0.0:
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
    return CornerFit(CornerShape(*p.tolist()), information, weight @ error**2 / len(seen), load)
