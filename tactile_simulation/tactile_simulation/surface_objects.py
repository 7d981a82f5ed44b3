"""Objects for a round probe: signed distances, positive outside, in the base frame."""
from dataclasses import dataclass
from typing import Protocol

import numpy as np

NORMAL_STEP = 1e-5  # m, step to each side in the differences that give a normal


class SolidObject(Protocol):
    """An object defined by signed distances."""

    def distance(self, points: np.ndarray) -> np.ndarray:
        """Return the signed distances (N,) of points (N, 3) from its surface [m]."""
        ...


def normal_at(solid: SolidObject, point: np.ndarray) -> np.ndarray:
    """Return the outward unit normal (3,) of the level set of distances at a point (3,)."""
    steps = NORMAL_STEP * np.vstack([np.eye(3), -np.eye(3)])
    distances = solid.distance(point + steps)
    slope = distances[:3] - distances[3:]
    return slope / np.linalg.norm(slope)


def nearest_point(solid: SolidObject, point: np.ndarray) -> np.ndarray:
    """Return the nearest point (3,) of the surface."""
    for _ in range(3):  # one step is enough if the distance is exact
        point = point - solid.distance(point[None])[0] * normal_at(solid, point)
    return point


@dataclass(frozen=True)
class PlacedObject:
    """An object placed in the base frame by its first contact and the heading of its x axis."""

    shape: SolidObject  # in its own frame: z inward, the first contact at the origin
    top: tuple[float, ...]  # m
    heading: float = 0.0  # angle from the base's x to its x [rad]

    def distance(self, points: np.ndarray) -> np.ndarray:
        cos, sin = np.cos(self.heading), np.sin(self.heading)
        # x along the heading, z down, y completes the frame
        axes = np.array([[cos, sin, 0.0], [sin, -cos, 0.0], [0.0, 0.0, -1.0]])
        return self.shape.distance((points - np.array(self.top)) @ axes.T)


@dataclass(frozen=True)
class Torus:
    """
    Torus touched at its outer equator, in the contact frame: x along the ring, z inward.

    Limits are a cylinder (infinite ring), a sphere (ring of radius 0) and a plane (both infinite).
    """

    ring: float  # radius of the circle of the tube's centres [m]
    tube: float  # radius of the tube [m]

    def distance(self, points: np.ndarray) -> np.ndarray:
        x, y, z = np.moveaxis(points, -1, 0)
        outer = self.ring + self.tube
        from_axis = -z if np.isinf(outer) else np.hypot(x, outer - z) - outer
        if np.isinf(self.tube):
            return from_axis
        return np.hypot(from_axis + self.tube, y) - self.tube


@dataclass(frozen=True)
class StepShape:
    """A plane with a step: beyond x = `ahead` it is higher by `height` (lower if negative)."""

    height: float  # m; -inf: the plane ends there
    ahead: float = 0.02  # m

    def distance(self, points: np.ndarray) -> np.ndarray:
        x, up = points[:, 0] - self.ahead, -points[:, 2]
        if self.height >= 0.0:
            return np.minimum(up, _quarter(-x, up - self.height))
        return np.minimum(_quarter(x, up), up - self.height)


def _quarter(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return signed distances from the quadrant x <= 0 and y <= 0."""
    outside = np.hypot(np.maximum(x, 0.0), np.maximum(y, 0.0))
    return outside + np.minimum(np.maximum(x, y), 0.0)
