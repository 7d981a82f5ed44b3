"""Surface matrices of planes, cylinders and spheres in their contact frames."""
import numpy as np

from tactile_shape.types.surface_matrix import SurfaceMatrix


def plane(normal=(0.0, 0.0, 1.0), offset=0.0):
    """Plane normal . x = offset [m], the normal inward and of any length."""
    matrix = np.zeros((4, 4))
    matrix[3, :3] = matrix[:3, 3] = 0.5 * np.array(normal) / np.linalg.norm(normal)
    matrix[3, 3] = -offset
    return SurfaceMatrix(matrix)


def sphere(radius):
    """Sphere; a negative radius is a hollow [m]."""
    return SurfaceMatrix.from_curvature(np.eye(2) / radius)


def cylinder(radius, yaw=0.0):
    """Cylinder [m]; yaw [rad] turns its axis from y towards -x."""
    across = np.array([np.cos(yaw), np.sin(yaw)])
    return SurfaceMatrix.from_curvature(np.outer(across, across) / radius)
