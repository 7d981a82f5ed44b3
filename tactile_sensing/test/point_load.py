"""
Reference for tests: stress of a frictional point contact on an elastic half-space (chapter 2).

Signs are those of the published images: 'zz' is -sigma_zz, 'xz' is -tau_xz, 'yz' is -tau_yz.
"""

import numpy as np

# Powers (i, j): component = (u / d)^i (v / d)^j times the pressure.
COMPONENTS = {'zz': (0, 0), 'xz': (1, 0), 'yz': (0, 1)}


def stress(component: str, x: np.ndarray, y: np.ndarray, a: float, b: float, normal_force: float,
           shear_x: float, shear_y: float, depth: float) -> np.ndarray:
    """
    Return the stress under a frictional point load [Pa], compression positive.

    'zz' is equation (2.2). Shear is (2.5) with x' instead of the printed x, i.e. (x' / d) times
    the pressure.

    Parameters
    ----------
    component : str
    x, y : ndarray
        Places in the sensor frame [m]; they broadcast.
    a, b : float
        Point of contact [m].
    normal_force, shear_x, shear_y : float
        P into the skin, and the tangential forces Qx, Qy of the object on the skin [N].
    depth : float
        Depth of the tactels [m].
    """
    (i, j), u, v = COMPONENTS[component], x - a, y - b
    force = normal_force * depth + shear_x * u + shear_y * v
    return 1.5 / np.pi * depth**(2 - i - j) * u**i * v**j * force * (
        u**2 + v**2 + depth**2)**-2.5
