"""
Surface matrices, local curvature and object shape from the kinematics of contact.

The first example is a swinging path over a sphere of 35 mm radius, the second the contour of a
corner:

>>> import numpy as np
>>> from tactile_shape import find_outline, LocalQuadric
>>> x = np.linspace(-0.01, 0.0, 200)
>>> points = np.column_stack([x, 2e-3 * np.sin(400.0 * x), np.zeros(200)])
>>> points[:, 2] = 0.035 - np.sqrt(0.035**2 - x**2 - points[:, 1]**2)
>>> normals = ([0.0, 0.0, 0.035] - points) / 0.035  # into the object
>>> estimator = LocalQuadric()
>>> patch = [estimator.update(*contact) for contact in zip(points, normals)][-1]
>>> patch.kind.name, [f'{1e3 / curvature:.1f} mm' for curvature in patch.curvature]
('SPHERE', ['35.0 mm', '35.0 mm'])
>>> way = np.linspace(-0.03, 0.03, 121)
>>> corner = np.column_stack([np.minimum(way, 0.0), np.maximum(way, 0.0), 0.0 * way])
>>> print(find_outline(corner))
open outline, 1 corners
side 1: line, 30.00 mm
side 2: line, 30.00 mm
corner 1: (0.00, 0.00, 0.00) mm, turn 90.0 deg
"""
from tactile_common.exports import exported

__all__, __getattr__, __dir__ = exported(__name__, {
    'contact_recording': 'ContactRecording load_contacts',
    'contour.contact_path': 'ContactPath SpatialContact',
    'contour.object_model': 'ObjectModel',
    'contour.outline': 'find_outline Outline Side',
    'local_surface.local_quadric': 'LocalQuadric LocalQuadricConfig',
    'shape_estimator': 'ShapeEstimator',
    'thesis.matrix_estimator': 'MatrixEstimator',
    'types.patch': 'Kind Patch',
    'types.surface_matrix': 'SurfaceMatrix',
})
