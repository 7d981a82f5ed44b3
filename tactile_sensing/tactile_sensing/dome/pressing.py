"""Sums over the Green's functions of a skin, for compiled loops."""
import numpy as np

from tactile_common.kernels import njit


@njit(cache=True, nogil=True)
def superpose(green, loads):
    """Pressure (T,) [Pa] of loads (N, 3) [N], by unit loads' (N, 3, T) [Pa/N]."""
    pressure = np.zeros(green.shape[2])
    for n in range(len(loads)):
        for axis in range(3):
            load = loads[n, axis]
            if load != 0.0:
                for k in range(len(pressure)):
                    pressure[k] += load * green[n, axis, k]
    return pressure
