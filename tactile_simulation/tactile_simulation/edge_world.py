"""The edge of a rigid object under a flat pad."""
from collections.abc import Mapping
from dataclasses import dataclass, field, MISSING, replace
import math
from typing import Any

import numpy as np

from tactile_common.config import bounded
from tactile_common.errors import ConfigurationError
from tactile_servo.track_statistics import SETTLING_LENGTH
from tactile_simulation.edge_path import EdgePath
from tactile_simulation.metrics import largest, NAN, rms
from tactile_simulation.render import force_on, render
from tactile_simulation.world import Course, Scene, World

# Settled lateral RMS of the pad's centre, below which the edge counts as tracked [m]. The object
# may slip farther at once.
LATERAL_BOUND = 3e-3


@dataclass(frozen=True)
class Start:
    """Initial place of the pad, see `EdgeScene.start_pose`."""

    s: float = bounded(0.02, 'arc length along the edge', 'm', 0.0)
    offset: float = bounded(0.003, 'centre of the pad to the left of the edge', 'm', -0.1, 0.1)
    height: float = bounded(0.004, "of the pad's surface above the edge", 'm', -0.01, 0.5)
    yaw: float = bounded(0.0, "of the pad about its own +z, away from the edge's direction",
                         'degrees', -180.0, 180.0)


@dataclass(frozen=True)
class Slip:
    """A jump of the object to the left of its edge when the pad reaches an arc length."""

    s: float = bounded(MISSING, 'arc length of the pad at which the object slips', 'm', 0.0)
    offset: float = bounded(MISSING, 'by how much, to the left', 'm', -0.1, 0.1)


@dataclass(frozen=True, eq=False)
class EdgeScene(Scene):
    """An edge and a flat pad above it."""

    action = 'track_edge'
    edge: EdgePath
    start: Start = field(default_factory=Start)
    slip: Slip | None = None

    def __post_init__(self) -> None:
        for name, place in (('start', self.start), ('slip', self.slip)):
            if place is not None and place.s > self.edge.length:
                raise ConfigurationError(
                    f'{name}.s is {place.s}, must be at most the length of the edge, '
                    f'{self.edge.length:.6g} m')

    @property
    def way(self) -> float:
        return self.edge.length - self.start.s

    @property
    def closed(self) -> bool:
        return self.edge.closed

    def start_pose(self) -> np.ndarray:
        """
        Return the first pose (4, 4) of the pad, sensor -> base, looking straight down.

        Pad z = base -z; pad y along the edge, turned by `start.yaw` about pad z (the edge then
        appears at minus that yaw in the image); centre `start.offset` to the left of the edge
        (towards pad +x at yaw 0) and `start.height` above it.
        """
        along = self.edge.tangent_at(self.start.s)
        along = np.array([along[0], along[1], 0.0]) / math.hypot(along[0], along[1])
        down = np.array([0.0, 0.0, -1.0])
        left = np.cross(along, down)
        yaw = math.radians(self.start.yaw)
        cos, sin = math.cos(yaw), math.sin(yaw)
        place = self.edge.point_at(self.start.s) + self.start.offset * left
        pose = np.eye(4)
        pose[:3] = np.column_stack([cos * left + sin * along, cos * along - sin * left, down,
                                    place - self.start.height * down])
        return pose

    def world(self) -> 'EdgeWorld':
        return EdgeWorld(self)

    def truth(self, course: Course) -> Course:
        edge, reach = self.edge, self.sensor.array.half_width_y
        lateral, along = edge.nearest(course.poses[:, :3, 3] - course.shift)
        settled = course.settled & edge.beside(along)
        # A pad that extends beyond an end cannot reach the target force.
        whole = edge.closed | ((along >= reach) & (along <= edge.length - reach))
        return replace(course, settled=settled, on_target=settled & whole, lateral=lateral,
                       along=along)

    def numbers(self, truth: Course, felt: np.ndarray, force: float) -> dict[str, Any]:
        settled, along = truth.lateral[truth.settled], truth.along[truth.tracking]
        transient = truth.tracking & ~truth.settled & self.edge.beside(truth.along)
        error, area = contour_errors(felt, self.edge)
        return {
            'edge_length': float(np.ptp(along)) if len(along) else NAN,
            'lateral_rms': rms(settled), 'lateral_max': largest(settled),
            'lateral_steady': rms(settled[len(settled) // 2:]),
            'lateral_transient_max': largest(truth.lateral[transient]),
            'contour_max_error': error, 'contour_area_error': area}

    def objection(self, numbers: Mapping[str, Any]) -> str:
        """Object if the pad's centre did not follow the edge as far as the servo reports."""
        led = (numbers['lateral_rms'] < LATERAL_BOUND  # NaN (never settled) fails too
               and numbers['edge_length'] > max(SETTLING_LENGTH,
                                                0.9 * numbers['tracked_length']))
        return '' if led else 'the pad was not led along the edge'


class EdgeWorld(World):
    """
    An edge that presses on a flat pad.

    The object slips, and `shift` changes, when any method is called with a pose at which the scene
    defines a slip.
    """

    def render(self, pose: np.ndarray) -> np.ndarray:
        scene = self.scene
        return render(self._points(pose), self.array, scene.skin, scene.edge.solid,
                      scene.sensor.area)

    def force(self, pose: np.ndarray) -> float:
        return self._force(self._points(pose))

    def _force(self, points: np.ndarray) -> float:
        return force_on(points, self.array, self.scene.skin, self.scene.edge.solid)

    def _points(self, pose: np.ndarray) -> np.ndarray:
        """Return the edge (N, 3) in the sensor frame [m], after the slip that is due."""
        edge, slip = self.scene.edge, self.scene.slip
        # Rows are points, so the transpose of base -> sensor is needed: the rotation itself.
        points = (edge.points + (self.shift - pose[:3, 3])) @ pose[:3, :3]
        if (slip is None or not slip.offset or self.shift.any() or self._force(points) <= 0.0
                or edge.nearest(pose[:3, 3])[1][0] < slip.s):
            return points
        along = edge.tangent_at(slip.s)
        self.shift = slip.offset / math.hypot(along[0], along[1]) * np.array(
            [-along[1], along[0], 0.0])
        return self._points(pose)


def contour_errors(contour: np.ndarray, edge: EdgePath) -> tuple[float, float]:
    """
    Compare a rebuilt contour `(N, 3)` [m] with the true edge, seen from above.

    Returns
    -------
    error : float
        Largest distance between the two, in both directions; for an open edge, only from the
        contour to the edge [m].
    area : float
        Relative error of the area of a closed edge. NaN if the contour has too few points.
    """
    if edge.closed:
        contour = np.vstack([contour, contour[:1]])
    moved = (np.diff(contour, axis=0) != 0.0).any(axis=1)
    if not moved.any():
        return NAN, NAN
    rebuilt = EdgePath(contour[np.append(True, moved)])
    error = largest(edge.nearest(rebuilt.samples())[0])
    if not edge.closed:
        return error, NAN
    missed = largest(rebuilt.nearest(edge.samples())[0])
    return max(error, missed), area_of(contour) / area_of(edge.points) - 1.0


def area_of(points: np.ndarray) -> float:
    """Return the area of a closed polyline (N, >= 2) seen from above [m^2]."""
    x, y = (points[:, :2] - points[0, :2]).T
    return abs(0.5 * float(x[:-1] @ y[1:] - x[1:] @ y[:-1]))
