"""Compiling every kernel that the package calls: at the build, and before contacts come."""
import numpy as np

from tactile_sensing.types.array import TactelArray
from tactile_sensing.types.image import Layer, TactileImage
from tactile_shape.contour.edge_point import edge_point


def compile_kernels() -> None:
    """Call every kernel once; some seconds where numba's cache is empty."""
    array = TactelArray(8, 8, 1e-3, 1e-3)
    ridge = np.tile(np.exp(-np.linspace(-2.0, 2.0, 8)**2), (8, 1))
    for noise in (1e-3, 0.1):  # which is smoothed first
        edge_point(TactileImage(0, 0, (Layer('zz', 1e-3, ridge, noise_std=noise),), array,
                                tared=True))
