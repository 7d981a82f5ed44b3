"""Compiling the kernels of this package."""


def warm_up():
    """Compile everything that is not in numba's cache yet, half a minute from nothing."""
    import numpy as np

    from tactile_sensing.contact.estimator import ContactEstimator
    from tactile_sensing.contact.line_fit import fit_line
    from tactile_sensing.types.array import TactelArray

    ContactEstimator()
    fit_line(np.zeros((8, 8)), TactelArray(8, 8, 1e-3, 1e-3), 1e-3, 1.0)
