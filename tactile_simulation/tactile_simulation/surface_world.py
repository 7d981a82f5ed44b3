"""The surface of an object under a round probe."""
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
import math
from typing import Any

import numpy as np

from tactile_common.config import bounded
from tactile_sensing.dome.finite_elements import (
    FiniteElementDome,
    operator_for,
    SkinConfig,
    superpose,
)
from tactile_sensing.dome.geometry import contact_frame, Dome
from tactile_simulation.metrics import largest, NAN, rms
from tactile_simulation.sensor import SceneSkin, Sensor
from tactile_simulation.surface_objects import nearest_point, normal_at, PlacedObject
from tactile_simulation.world import Course, Scene, World

# 15 N on a sphere of the probe's own size do not saturate it.
SENSOR = Sensor(pa_per_count=1000.0)
CALIBRATION_FORCE = 5.0  # N at the pad's centre, by which the sensor is calibrated
SLIDING = 1e-7  # m between two poses; smaller motions do not count as sliding
TOUCHING = 0.05  # share of the target force, above which there is contact


@dataclass(frozen=True)
class TouchedObject:
    """Mechanical properties of the touched object."""

    friction: float = bounded(0.0, 'coefficient of Coulomb friction with the skin', '', 0.0, 3.0)
    fragile: float = bounded(0.0, 'force that breaks the object; 0: none does', 'N', 0.0, 1e4)


@dataclass(frozen=True)
class SurfaceStart:
    """Initial place of the probe, see `SurfaceScene.start_pose`."""

    x: float = bounded(0.0, 'of the first contact, from where the object is placed', 'm', -1, 1)
    y: float = bounded(0.0, 'likewise', 'm', -1.0, 1.0)
    height: float = bounded(0.004, "of the probe's surface above the object", 'm', 0.0, 0.5)
    aside_x: float = bounded(
        0.0, 'place of the first contact on the pad: by this much the probe is turned', 'm',
        -0.02, 0.02)
    aside_y: float = bounded(0.0, 'likewise', 'm', -0.02, 0.02)


@dataclass(frozen=True, eq=False)
class SurfaceScene(Scene):
    """An object and the round probe that touches it; the driver knows its skin by its depth."""

    action = 'track_surface'
    surface: PlacedObject
    touch: TouchedObject = field(default_factory=TouchedObject)
    dome: Dome = field(default_factory=Dome)
    rubber: SkinConfig = field(default_factory=SkinConfig)
    start: SurfaceStart = field(default_factory=SurfaceStart)
    skin: SceneSkin = field(init=False)
    sensor: Sensor = field(default=SENSOR, kw_only=True)

    def __post_init__(self) -> None:
        object.__setattr__(self, 'skin', SceneSkin(depth=self.dome.depth))

    def parameters(self) -> dict[str, dict[str, Any]]:
        """Return the probe's radius, and moments: no flat-pad model fits its contacts."""
        return {'edge_servo': {'probe.skin_radius': self.dome.skin_radius},
                'shape_estimator': {'source': 'servo'},
                'contact_estimator': {'method': 'moments'}}

    def start_pose(self) -> np.ndarray:
        """Return the first pose (4, 4) of the sensor: above the object, z towards it."""
        start = self.start
        above = np.array(self.surface.top) + [start.x, start.y, 0.0]
        contact = nearest_point(self.surface, above)
        outward = normal_at(self.surface, contact)
        level = np.array([1.0, 0.0, 0.0]) - outward[0] * outward
        ahead = level / np.linalg.norm(level)
        # z into the object, x forward
        rotation = np.column_stack([ahead, np.cross(-outward, ahead), -outward])
        rotation = rotation @ contact_frame(self.dome, start.aside_x, start.aside_y)
        pose = np.eye(4)
        pose[:3, :3] = rotation
        centre = contact + (start.height + self.dome.skin_radius) * outward
        pose[:3, 3] = centre - rotation @ self.dome.centre
        return pose

    def centre(self, pose: np.ndarray) -> np.ndarray:
        """Return the centre (3,) of the probe's spheres at a pose, in the base frame."""
        return pose[:3, 3] + pose[:3, :3] @ self.dome.centre

    def world(self) -> 'SurfaceWorld':
        return SurfaceWorld(self)

    def truth(self, course: Course) -> Course:
        place = np.full((len(course.time), 2), NAN)
        for index in np.flatnonzero(course.tracking):
            pose = course.poses[index]
            inward = -normal_at(self.surface, self.centre(pose))
            place[index] = self.dome.place(pose[:3, :3].T @ inward)
        return replace(course, on_target=course.settled, place=place)

    def numbers(self, truth: Course, felt: np.ndarray, force: float) -> dict[str, Any]:
        errors = self.surface.distance(felt) if len(felt) else np.zeros(0)
        aside, tracked = np.hypot(*truth.place.T)[truth.settled], truth.force[truth.tracking]
        fragile = self.touch.fragile
        return {
            'surface_rms': rms(errors), 'surface_max': largest(errors),
            'centre_rms': rms(aside), 'centre_max': largest(aside),
            'contact_kept': float(np.mean(tracked > TOUCHING * force)) if len(tracked) else 0.0,
            'broken': bool(fragile and largest(truth.force) > fragile)}

    def objection(self, numbers: Mapping[str, Any]) -> str:
        return 'what was touched has broken' if numbers['broken'] else ''


class SurfaceWorld(World):
    """
    An object that presses on a round probe.

    The probe's skin acts as an elastic foundation: its pressure is its modulus times the depth by
    which each skin point would penetrate the object. Finite elements convert this load to the
    tactels' pressure. Friction acts against the sliding since the previous pose. The sensor is
    calibrated by force: M0 is the force at the pad's centre.
    """

    def __init__(self, scene: SurfaceScene):
        super().__init__(scene)
        array = self.array
        self._operator = operator_for(scene.dome, scene.rubber, array)
        self._outward = (self._operator.points - scene.dome.centre) / scene.dome.skin_radius
        model = FiniteElementDome(scene.dome, array, self._operator)
        image = model.image(np.array([0.0, 0.0, CALIBRATION_FORCE, 0.0, 0.0]))
        self._sensitivity = image.sum() * array.pitch_x * array.pitch_y / CALIBRATION_FORCE
        self._pose = np.full((4, 4), np.nan)
        self._loads, self._pressing = np.zeros_like(self._outward), 0.0

    def render(self, pose: np.ndarray) -> np.ndarray:
        self._press(pose)
        pressure = superpose(self._operator.green, self._loads) / self._sensitivity
        return pressure.reshape(self.array.shape)

    def force(self, pose: np.ndarray) -> float:
        self._press(pose)
        return self._pressing

    def _press(self, pose: np.ndarray) -> None:
        """Update the loads (N, 3) of the object on the skin points, in the sensor frame [N]."""
        if (pose == self._pose).all():
            return
        before, self._pose = self._pose, pose.copy()
        self._loads, self._pressing = np.zeros_like(self._outward), 0.0
        scene, solid = self.scene, self.scene.surface
        if solid.distance(scene.centre(pose)[None])[0] >= scene.dome.skin_radius:
            return
        points = self._operator.points @ pose[:3, :3].T + pose[:3, 3]
        depth = np.maximum(-solid.distance(points), 0.0)
        touched = np.flatnonzero(depth)
        pressed = self._operator.modulus * depth[touched] * self._operator.areas[touched]
        loads = -pressed[:, None] * self._outward[touched]
        total = loads.sum(axis=0)
        self._pressing = math.sqrt(total @ total)
        friction = scene.touch.friction
        if friction and np.isfinite(before).all():
            loads = loads - friction * pressed[:, None] * self._sliding(
                touched, points[touched], before)
        self._loads[touched] = loads

    def _sliding(self, touched: np.ndarray, points: np.ndarray,
                 before: np.ndarray) -> np.ndarray:
        """Return directions (K, 3) of the skin's sliding over the object, in the sensor frame."""
        was = self._operator.points[touched] @ before[:3, :3].T + before[:3, 3]
        moved = (points - was) @ self._pose[:3, :3]
        outward = self._outward[touched]
        along = moved - (moved * outward).sum(axis=1, keepdims=True) * outward
        size = np.linalg.norm(along, axis=1, keepdims=True)
        return np.where(size > SLIDING, along / np.maximum(size, SLIDING), 0.0)
