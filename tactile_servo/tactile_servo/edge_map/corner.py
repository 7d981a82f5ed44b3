"""Corners of a traced edge: found by their turn, fitted to every picture, remembered."""

import math

import numpy as np

from tactile_common.kernels import njit
from tactile_servo.edge_map.corner_fit import CHORDS, corner_points, fit_corner

SHARP = 0.35e-3  # m, radius below which a corner is taken for sharp
LONGEST_SETBACK = 6.2e-3  # m from vertex to fillet; what is rounder is followed as a curve
CLEARANCE = 4.0e-3  # m beyond the fillet until the skin no longer blurs the legs
VIEWED = 3.0e-3  # m of each leg beyond the fillet that the pad must cover
LEAST_TURN = math.radians(18.0)
STRAIGHTEST = 30.0  # 1/m, curvature of a leg from which it is a curve, and this no corner of it
WORST_FIT = 4.0  # chi-square per tactel
WORST_PLACE = 0.4e-3  # m, standard deviation of the vertex
MODEL_ERROR = 0.02
MEMORY = 40.0  # pictures
PLACE, RADIUS = slice(0, 2), 4


class Corner:
    """
    A corner in the plane of the edge, averaged over the pictures that show it.

    Attributes
    ----------
    p : ndarray, shape (7,)
        As `corner_fit.corner_points`, in the plane.
    denied : int
        Pictures since the last one that it could be fitted to.
    """

    def __init__(self, p, information):
        self.p = p
        self.denied = 0
        self._information = information.copy()
        self._moment = np.zeros(7)
        self._reference = p.copy()
        self._count = 1.0

    def merge(self, p, information):
        """Take the fit of another picture: the mean weighted by information."""
        difference = p - self._reference
        difference[2:4] = np.arctan2(np.sin(difference[2:4]), np.cos(difference[2:4]))
        self._moment += information @ difference
        self._information += information
        self._count += 1.0
        if self._count > MEMORY:
            keep = MEMORY / self._count
            self._moment *= keep
            self._information *= keep
            self._count = MEMORY
        ridge = 1e-9 * np.diag(np.diag(self._information)) + 1e-12 * np.eye(7)
        self.p = self._reference + np.linalg.solve(self._information + ridge, self._moment)
        self.p[RADIUS] = max(self.p[RADIUS], 0.0)

    @property
    def vertex(self):
        """Where the legs would meet (2,) [m]."""
        return self.p[PLACE]

    @property
    def turn(self):
        """Angle from the first leg to the second [rad]."""
        return math.atan2(math.sin(self.p[3] - self.p[2]), math.cos(self.p[3] - self.p[2]))

    @property
    def setback(self):
        """Distance from the vertex to the fillet [m]."""
        return setback(self.p)

    @property
    def arriving(self):
        """Direction of travel on the first leg at the corner (2,)."""
        return np.array([math.cos(self.p[2]), math.sin(self.p[2])])

    @property
    def reach(self):
        """How far from its vertex a corner stands for the edge [m]."""
        return self.setback + CLEARANCE

    def nodes(self):
        """Path through the corner (M, 4): x, y and direction x, y."""
        points = corner_points(self.p)
        if self.p[RADIUS] < SHARP:  # one vertex instead of the fillet
            points = np.vstack([points[:CHORDS], self.vertex, points[-CHORDS:]])
        legs = np.linalg.norm(points - self.vertex, axis=1)
        points = points[legs < self.reach + 1e-9]
        chords = np.diff(points, axis=0)
        chords /= np.maximum(np.linalg.norm(chords, axis=1), 1e-12)[:, None]
        return np.hstack([points, np.vstack([chords, chords[-1:]])])


def setback(p):
    """Distance from the vertex of a corner to its fillet [m]."""
    turn = abs(math.atan2(math.sin(p[3] - p[2]), math.cos(p[3] - p[2])))
    return p[RADIUS] * math.tan(0.5 * min(turn, 2.9))


class Picture:
    """
    What a corner is fitted to: a mended picture and where it was taken.

    Parameters
    ----------
    pressure : ndarray, shape (rows, columns)
        [Pa], all finite.
    array : TactelArray
    depth, noise : float
        Of the tactels [m], of one tactel [Pa].
    place : ndarray, shape (2,)
        Centre of the pad in the plane [m].
    yaw : float
        Angle of the pad in the plane [rad].
    depth_of_pad : float
        Of the pad's surface along the plane's normal [m].
    """

    def __init__(self, pressure, array, depth, noise, place, yaw, depth_of_pad):
        self.pressure, self.array, self.depth, self.noise = pressure, array, depth, noise
        self.place, self.yaw, self.depth_of_pad = place, yaw, depth_of_pad
        cos, sin = math.cos(yaw), math.sin(yaw)
        self._rotation = np.array([[cos, -sin], [sin, cos]])

    def to_pad(self, points):
        """Points of the plane (..., 2) in the sensor frame."""
        return (points - self.place) @ self._rotation

    def covers(self, points, margin=0.0):
        """Whether every point (M, 2) of the plane lies on the pad, off its border [m]."""
        return _inside(points, self.place, self._rotation,
                       self.array.half_width_x - margin, self.array.half_width_y - margin)

    def shows(self, p):
        """Whether a corner (7,) and enough of its legs lie on the pad."""
        legs = np.array([[math.cos(p[2]), math.sin(p[2])], [math.cos(p[3]), math.sin(p[3])]])
        away = setback(p) + VIEWED
        return self.covers(p[:2] + away * legs * np.array([[-1.0], [1.0]]))

    def fit(self, p):
        """
        Fit a corner of the plane (7,).

        Returns
        -------
        p, information : ndarray or None
            None where the picture shows no such corner, or too little of it.
        """
        if not self.shows(p):
            return None
        start = p.copy()
        start[:2] = self.to_pad(p[:2])
        start[2:4] -= self.yaw
        array = self.array
        q, information, chi_square, load = fit_corner(
            self.pressure, array.x, array.y, self.depth, self.noise, MODEL_ERROR, start)
        if not (np.isfinite(q).all() and load > 0.0 and chi_square < WORST_FIT):
            return None
        full = information + np.diag([0, 0, 0, 0, 1e5, 4e-3, 4e-3])
        try:
            spread = np.linalg.inv(full)[:2, :2]
        except np.linalg.LinAlgError:
            return None
        turn = math.atan2(math.sin(q[3] - q[2]), math.cos(q[3] - q[2]))
        if (np.trace(spread) > WORST_PLACE**2 or abs(turn) < LEAST_TURN
                or np.abs(q[5:7]).max() > STRAIGHTEST or setback(q) > LONGEST_SETBACK
                or np.hypot(*(q[:2] - start[:2])) > 4e-3):
            return None
        q[:2] = self._rotation @ q[:2] + self.place
        q[2:4] += self.yaw
        turned = np.eye(7)
        turned[:2, :2] = self._rotation
        return q, turned @ full @ turned.T


@njit(cache=True)
def _inside(points, place, rotation, half_x, half_y):
    for n in range(len(points)):
        dx, dy = points[n, 0] - place[0], points[n, 1] - place[1]
        if not (abs(dx * rotation[0, 0] + dy * rotation[1, 0]) <= half_x
                and abs(dx * rotation[0, 1] + dy * rotation[1, 1]) <= half_y):
            return False
    return True


def guess(first, first_way, second, second_way):
    """
    First guess of a corner from a place and direction on either leg (each (2,)).

    Returns
    -------
    ndarray, shape (7,) or None
        None where the legs do not meet ahead of the first and behind the second.
    """
    cross = first_way[0] * second_way[1] - first_way[1] * second_way[0]
    if abs(cross) < math.sin(0.5 * LEAST_TURN):
        return None
    gap = second - first
    along = (gap[0] * second_way[1] - gap[1] * second_way[0]) / cross
    back = (gap[0] * first_way[1] - gap[1] * first_way[0]) / cross
    if along < 0.0 or back > 0.0:
        return None
    vertex = first + along * first_way
    return np.array([*vertex, math.atan2(first_way[1], first_way[0]),
                     math.atan2(second_way[1], second_way[0]), 1e-3, 0.0, 0.0])
