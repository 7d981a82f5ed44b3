"""Pictures of a round probe that touches the object of a scene."""
import math

import numpy as np

from tactile_sensing.dome.finite_element_model import FiniteElementDome, superpose
from tactile_sensing.dome.operator_cache import operator_for
from tactile_sensing.types.array import TactelArray
from tactile_simulation.renderer import EdgeRenderer
from tactile_simulation.scene_surface import SurfaceScene

CALIBRATED = 5.0  # N at the pad's centre, with which the sensor's gain was found
SLIDES = 1e-7  # m between two poses, below which nothing slides


class SurfaceRenderer(EdgeRenderer):
    """
    What a round probe measures at a pose (4, 4), sensor -> base, given a scene.

    Its skin presses as an elastic foundation does, by its modulus times the depth to which each
    point of the surface would lie in the object; the tactels feel that load through the finite
    elements. Friction acts against the sliding since the pose before. The sensor has been
    calibrated by the force on it: M0 is that force at the pad's centre.
    """

    def __init__(self, scene: SurfaceScene, array: TactelArray):
        super().__init__(scene, array)  # type: ignore[arg-type]
        self._object, self._friction = scene.surface, scene.touch.friction
        self._dome, self._operator = scene.dome, operator_for(scene.dome, scene.rubber, array)
        self._outward = (self._operator.points - scene.dome.centre) / scene.dome.skin_radius
        model = FiniteElementDome(scene.dome, array, self._operator)
        image = model.image(np.array([0.0, 0.0, CALIBRATED, 0.0, 0.0]))
        self._sensitivity = image.sum() * array.pitch_x * array.pitch_y / CALIBRATED
        self._pose = np.full((4, 4), np.nan)
        self._loads, self._pressing = np.zeros_like(self._outward), 0.0

    def render(self, pose: np.ndarray) -> np.ndarray:
        """Return the pressure at the tactels (rows, columns), free of noise [Pa]."""
        self._touch(pose)
        pressure = superpose(self._operator.green, self._loads) / self._sensitivity
        return pressure.reshape(self._array.shape)

    def force(self, pose: np.ndarray) -> float:
        """Return the force along the contact's normal at a pose [N]."""
        self._touch(pose)
        return self._pressing

    def _touch(self, pose):
        """Loads (N, 3) of the object on the points of the skin, in the sensor frame [N]."""
        if (pose == self._pose).all():
            return
        before, self._pose = self._pose, pose.copy()
        self._loads, self._pressing = np.zeros_like(self._outward), 0.0
        rotation, radius = pose[:3, :3], self._dome.skin_radius
        centre = pose[:3, 3] + rotation @ self._dome.centre
        if self._object.distance(centre[None])[0] >= radius:
            return
        points = self._operator.points @ rotation.T + pose[:3, 3]
        depth = np.maximum(-self._object.distance(points), 0.0)
        touched = np.flatnonzero(depth)
        pressed = self._operator.modulus * depth[touched] * self._operator.areas[touched]
        loads = -pressed[:, None] * self._outward[touched]
        total = loads.sum(axis=0)
        self._pressing = math.sqrt(total @ total)
        if self._friction and np.isfinite(before).all():
            loads = loads - self._friction * pressed[:, None] * self._sliding(
                touched, points[touched], before)
        self._loads[touched] = loads

    def _sliding(self, touched, points, before):
        """Directions (K, 3) in which the skin slides over the object, in the sensor frame."""
        was = self._operator.points[touched] @ before[:3, :3].T + before[:3, 3]
        moved = (points - was) @ self._pose[:3, :3]
        outward = self._outward[touched]
        along = moved - (moved * outward).sum(axis=1, keepdims=True) * outward
        size = np.linalg.norm(along, axis=1, keepdims=True)
        return np.where(size > SLIDES, along / np.maximum(size, SLIDES), 0.0)
