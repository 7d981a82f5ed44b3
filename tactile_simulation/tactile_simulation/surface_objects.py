"""Objects for a round probe: signed distances, positive outside, in the base frame."""
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from scipy.ndimage import map_coordinates

from tactile_common.errors import ConfigurationError

CELLS = 96  # along the longest side of a mesh's box
MARGIN = 0.04  # m around it: the grid must include the centre of a probe in contact
NORMAL_STEP = 1e-5  # m, step to each side in the differences that give a normal


class SolidObject(Protocol):
    """An object defined by signed distances."""

    def distance(self, points: np.ndarray) -> np.ndarray:
        """Return the signed distances (N,) of points (N, 3) from its surface [m]."""
        ...


def normal_at(solid: SolidObject, point: np.ndarray) -> np.ndarray:
    """
    Return the outward unit normal (3,) at a point (3,), from differences.

    At a point off the surface, this is the normal of the level set of distances.
    """
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
class Placed:
    """An object placed in the base frame by its first contact and the heading of its x axis."""

    shape: SolidObject  # in its own frame: z inward, the first contact at the origin
    top: tuple[float, float, float]  # m
    heading: float = 0.0  # angle from the base's x to its x [rad]

    def distance(self, points: np.ndarray) -> np.ndarray:
        """Return signed distances (N,) [m]."""
        cos, sin = np.cos(self.heading), np.sin(self.heading)
        # x along the heading, z down, y completes the frame
        axes = np.array([[cos, sin, 0.0], [sin, -cos, 0.0], [0.0, 0.0, -1.0]])
        return self.shape.distance((points - np.array(self.top)) @ axes.T)


@dataclass(frozen=True)
class Torus:
    """
    Torus touched at its outer equator, in the contact frame: x along the ring, z inward.

    Limits are a cylinder (infinite ring), a sphere (ring of radius 0) and a plane (both infinite).

    Parameters
    ----------
    ring : float
        Radius of the circle of the tube's centres [m]; inf makes a cylinder along x, 0 a sphere.
    tube : float
        Radius of the tube [m]; inf, with a ring of inf, makes a plane.
    """

    ring: float
    tube: float

    def distance(self, points: np.ndarray) -> np.ndarray:
        """Return signed distances of points (..., 3) [m]."""
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
        """Return signed distances (N,) [m]."""
        x, up = points[:, 0] - self.ahead, -points[:, 2]
        if self.height >= 0.0:
            return np.minimum(up, _quarter(-x, up - self.height))
        return np.minimum(_quarter(x, up), up - self.height)


def _quarter(x, y):
    """Return signed distances from the quadrant x <= 0 and y <= 0."""
    outside = np.hypot(np.maximum(x, 0.0), np.maximum(y, 0.0))
    return outside + np.minimum(np.maximum(x, y), 0.0)


class Mesh:
    """
    A closed triangle mesh (STL, PLY or any format of trimesh), highest point at the origin.

    Distances are interpolated in a grid of distances to the triangles. The error where the mesh
    curves is an eighth of the squared cell size over the radius; at its edges it is a part of a
    cell. `scale` converts the unit of the file to m.
    """

    def __init__(self, path: str, scale: float = 1.0):
        import trimesh  # off-line only

        try:
            mesh = trimesh.load_mesh(path)
        except Exception as error:  # readers of mesh files raise many types
            raise ConfigurationError(f'mesh {path}: cannot be read: {error}') from error
        if not isinstance(mesh, trimesh.Trimesh) or not len(mesh.faces):
            raise ConfigurationError(f'mesh {path}: has no triangles')
        if not mesh.is_watertight:
            raise ConfigurationError(f'mesh {path}: is not closed')
        vertices = scale * np.asarray(mesh.vertices) * [1.0, -1.0, -1.0]  # z inward
        vertices -= vertices[vertices[:, 2].argmin()]
        low, high = vertices.min(axis=0), vertices.max(axis=0)
        self._spacing = float((high - low + 2.0 * MARGIN).max() / CELLS)
        counts = np.ceil((high - low + 2.0 * MARGIN) / self._spacing).astype(int) + 1
        nodes = np.stack(np.meshgrid(*(np.arange(n) for n in counts), indexing='ij'), axis=-1)
        self._origin = low - MARGIN
        self._grid = _distances(self._origin + self._spacing * nodes.reshape(-1, 3),
                                vertices[np.asarray(mesh.faces)]).reshape(counts)

    def distance(self, points: np.ndarray) -> np.ndarray:
        """Return signed distances (N,) [m]; outside of the grid, those of its border."""
        places = ((points - self._origin) / self._spacing).T
        return map_coordinates(self._grid, places, order=1, mode='nearest')


def _distances(points, triangles):
    """
    Return signed distances of points from triangles (F, 3, 3).

    The nearest triangle is found approximately, by samples of the surface.
    """
    from scipy.spatial import cKDTree
    import trimesh

    # The samples are so dense that the triangle of the nearest sample is the nearest one.
    samples, faces = trimesh.sample.sample_surface_even(
        trimesh.Trimesh(triangles.reshape(-1, 3), np.arange(3 * len(triangles)).reshape(-1, 3),
                        process=False), 40000, seed=0)
    _, nearest = cKDTree(samples).query(points)
    index = faces[nearest]
    closest = trimesh.triangles.closest_point(triangles[index], points)
    edges = triangles[:, 1:] - triangles[:, :1]
    outward = np.cross(edges[:, 0], edges[:, 1])
    volume = np.einsum('ij,ij->', triangles[:, 0], outward)
    away = points - closest
    sign = np.sign(np.einsum('ij,ij->i', away, outward[index])) * np.sign(volume)
    return np.linalg.norm(away, axis=1) * np.where(sign == 0.0, 1.0, sign)
