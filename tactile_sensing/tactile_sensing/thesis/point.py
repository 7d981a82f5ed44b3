"""
Frictional point contact on an elastic half-space: its stress (chapter 2).

Every component has the sign of the published images: 'zz' is -sigma_zz, 'xz' is -tau_xz and 'yz'
is -tau_yz.
"""

import numpy as np

from tactile_common.errors import ConfigurationError

# Powers (i, j) of (u / d)^i (v / d)^j that turn the pressure into the component.
COMPONENTS = {'zz': (0, 0), 'xz': (1, 0), 'yz': (0, 1)}


def stress(component: str, x: np.ndarray, y: np.ndarray, a: float, b: float, normal_force: float,
           shear_x: float, shear_y: float, depth: float) -> np.ndarray:
    """
    Stress below a frictional point load [Pa], compression positive.

    Equation (2.2) for 'zz'. For the shear (2.5) with x' in place of the printed x,
    which makes it (x' / d) times the pressure. ConfigurationError for another component.

    Parameters
    ----------
    component : str
    x, y : ndarray
        Places in the sensor frame [m], of any broadcastable shapes.
    a, b : float
        Point of contact [m].
    normal_force, shear_x, shear_y : float
        P into the skin, and the tangential forces Qx, Qy of the object on the skin [N].
    depth : float
        Of the tactels [m].
    """
    if component not in COMPONENTS:
        raise ConfigurationError(
            f'component is {component!r}, must be one of {", ".join(COMPONENTS)}')
    (i, j), u, v = COMPONENTS[component], x - a, y - b
    force = normal_force * depth + shear_x * u + shear_y * v
    return 1.5 / np.pi * depth**(2 - i - j) * u**i * v**j * force * (
        u**2 + v**2 + depth**2)**-2.5
