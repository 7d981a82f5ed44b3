"""Compiling the kernels of this package: by the build, and by a node before it begins."""

import numpy as np

from tactile_sensing.contact.estimator import ContactEstimator
from tactile_sensing.contact.load_fits import fit_loads
from tactile_sensing.contact.ridge import ridge_points
from tactile_sensing.dome.pressing import superpose
from tactile_sensing.half_space.kernels import add_point, add_segment
from tactile_sensing.half_space.layers import Layer as FitLayer
from tactile_sensing.types.array import TactelArray
from tactile_sensing.types.contact import ContactType
from tactile_sensing.types.image import Layer


def compile_kernels() -> None:
    """Compile what is not in numba's cache yet, by calling every entry point once."""
    array, stress = TactelArray(8, 8, 1e-3, 1e-3), np.zeros((1, 1, 8, 8))
    x, y = array.x, array.y
    ContactEstimator().estimate_batch(stress, array, (Layer('zz', 1e-3, stress),))
    fit_loads(ContactType.LINE, stress, array, (FitLayer('zz', 1e-3, 1.0),))
    picture = np.zeros(array.shape)
    add_point(picture, x, y, 1e-3, 0.0, 0.0, 1.0)
    add_segment(picture, x, y, 1e-3, 0.0, 0.0, 1e-3, 0.0, 1.0, 1.0)
    ridge_points(picture, array, 1.0, 1e-3)
    superpose(np.zeros((1, 3, 4)), np.zeros((1, 3)))
