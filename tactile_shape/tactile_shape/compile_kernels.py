"""Compiles all kernels of the package, at build time and before the first contact."""
import numpy as np

from tactile_sensing.types.array import TactelArray
from tactile_sensing.types.image import Layer, TactileImage
from tactile_shape.contour.contact_path import edge_point


def compile_kernels() -> None:
    """Call every kernel once; this takes seconds if numba's cache is empty."""
    array = TactelArray(8, 8, 1e-3, 1e-3)
    ridge = np.tile(np.exp(-np.linspace(-2.0, 2.0, 8)**2), (8, 1))
    edge_point(TactileImage(0, 0, (Layer('zz', 1e-3, ridge, noise_std=1e-3),), array, tared=True))
