"""Compared methods: the estimators, and a paraboloid fitted to positions only."""
from dataclasses import dataclass
import time

import numpy as np

from tactile_shape.local_surface.local_quadric import LocalQuadric, LocalQuadricConfig
from tactile_shape.shape_estimator import SurfaceEstimator
from tactile_shape.thesis.matrix_estimator import MatrixEstimator
from tactile_shape.types.patch import Kind, Patch
from tactile_shape.types.tangent import principal_curvatures, tangent_frame, turn_about_z

WINDOW = 0.024  # m


@dataclass(frozen=True)
class Stream:
    """
    An estimator that gets one contact at a time.

    Attributes
    ----------
    name : str
    estimator : SurfaceEstimator
    """

    name: str
    estimator: SurfaceEstimator

    def __call__(self, points, normals):
        """Return the patch at the last contact of a trace."""
        self.estimator.reset()
        for point, normal in zip(points, normals, strict=True):
            self.estimator.add(point, normal)
        return self.estimator.estimate()

    def times(self, points, normals):
        """Return the processor time of every update along a trace, ndarray [s]."""
        self.estimator.reset()
        took = []
        for point, normal in zip(points, normals, strict=True):
            begin = time.thread_time()
            self.estimator.update(point, normal)
            took.append(time.thread_time() - begin)
        return np.array(took)


class Paraboloid:
    """Least-squares fit of z = a + b u + u' K u / 2 to positions only, with numpy."""

    def reset(self):
        self._points = []

    def add(self, point, normal):
        self._points.append(point)
        self._normal = normal

    def update(self, point, normal):
        self.add(point, normal)
        return self.estimate()

    def estimate(self):
        points = np.array(self._points[-96:])
        if len(points) < 6:
            return Patch(Kind.NONE, False, 'too few', 'paraboloid')
        axes = tangent_frame(self._normal)
        x, y, z = ((points - points[-1]) @ axes).T
        rows = np.column_stack([np.ones(len(x)), x, y, 0.5 * x * x, x * y, 0.5 * y * y])
        a, b, c, k11, k12, k22 = np.linalg.lstsq(rows, z, rcond=None)[0]
        slope = np.array([b, c])
        long = np.sqrt(1.0 + slope @ slope)
        frame = np.eye(4)
        normal = axes @ (np.array([-b, -c, 1.0]) / long)
        tilt = tangent_frame(normal)
        # Slopes are small, so the curvature is approximated in the tilted frame.
        bend = ((tilt[:, :2].T @ axes[:, :2]) @ np.array([[k11, k12], [k12, k22]])
                @ (axes[:, :2].T @ tilt[:, :2]) / long**3)
        first, second, heading = principal_curvatures(bend[0, 0], bend[0, 1], bend[1, 1])
        frame[:3, :3] = tilt @ turn_about_z(heading)
        frame[:3, 3] = points[-1] + a * axes[:, 2]
        return Patch(Kind.GENERAL, True, '', 'paraboloid', frame=frame,
                     curvature=np.array([first, second]), seen=np.ones(2, bool))


def local_quadric(name='local_quadric', **config):
    """Return the least-model estimator with changes to its defaults."""
    return Stream(name, LocalQuadric(LocalQuadricConfig(**config)))


def surface_matrix(contacts=6, window=WINDOW, name=None):
    """Return the thesis' estimator for contacts spread over a window."""
    return Stream(name or f'surface_matrix, N = {contacts}', MatrixEstimator(
        LocalQuadricConfig(window=window), contacts))


def compared():
    """Return the methods of the chart of error against time."""
    return [local_quadric(), surface_matrix(6), surface_matrix(12), surface_matrix(24),
            surface_matrix(5, 1e-3, 'surface_matrix, 5 adjacent'),
            Stream('paraboloid through positions', Paraboloid())]
