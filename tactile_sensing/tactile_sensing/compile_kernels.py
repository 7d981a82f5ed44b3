"""Compile the kernels of this package; called by the build, and by a node before it starts."""

import numpy as np

from tactile_sensing.contact.estimator import ContactEstimator
from tactile_sensing.contact.ridge import ridge_points
from tactile_sensing.skin.bumps import chord
from tactile_sensing.skin.half_spaces import add_point, add_segment
from tactile_sensing.types.array import TactelArray
from tactile_sensing.types.image import Layer, TactileImage


def compile_kernels() -> None:
    """Compile what is missing in numba's cache, by calling every entry point once."""
    array, depth = TactelArray(8, 8, 1e-3, 1e-3), 1e-3
    edge, crossing = np.zeros(array.shape), np.zeros(array.shape)
    add_segment(edge, array.x, array.y, depth, -0.01, 1e-4, 0.01, 1e-4, 100.0, 100.0)
    add_segment(crossing, array.x, array.y, depth, 1e-3, -0.01, 1e-3, 0.01, 100.0, 100.0)
    crossing += edge
    ball = np.zeros(array.shape)
    add_point(ball, array.x, array.y, depth, 0.0, 0.0, 1.0)
    estimator = ContactEstimator()
    for pressure in (edge, ball, crossing):  # the crossing makes the search try everything
        for skin in (depth, 0.0):
            for noise in (0.01 * pressure.max(), 0.0):
                layer = Layer('zz', skin, pressure.astype(np.float32), noise_std=noise)
                estimator.estimate(TactileImage(0, 0, (layer,), array, tared=True))
    ridge_points(edge, array, 1.0, depth)
    chord(array.half_width_x, array.half_width_y, 0.0, 0.0)
