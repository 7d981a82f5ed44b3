"""Describe a sensor for the fit: its tactels, and its skin if that is known."""

from functools import lru_cache
import math

import numpy as np

from tactile_common.errors import ConfigurationError
from tactile_sensing.skin.bumps import Pad
from tactile_sensing.skin.kernel import polynomials
from tactile_sensing.skin.pressure import split_tactel
from tactile_sensing.types.array import TactelArray
from tactile_sensing.types.image import COMPONENTS
from tactile_sensing.types.skin import Skin


def _gauss(points: int, array: TactelArray) -> np.ndarray:
    """Return the quadrature nodes over a tactel, (points^2, 3): offset x, y [m], weight."""
    nodes = np.column_stack(np.polynomial.legendre.leggauss(points)) / 2.0
    return np.array([(p * array.pitch_x, q * array.pitch_y, u * w)
                     for p, u in nodes for q, w in nodes])


@lru_cache(maxsize=64)
def pad_of(array: TactelArray, layers: tuple[tuple[str, float], ...], *, area: bool = True,
           thickness: float = math.inf, poisson: float = 0.5) -> Pad:
    """
    Describe a sensor for the compiled functions.

    Parameters
    ----------
    array : TactelArray
    layers : tuple of (component, depth [m])
        A single layer of pressure with depth 0 means that the skin is unknown.
    area : bool
        True: a tactel measures the mean over its area. False: the stress at its centre.
    thickness, poisson : float
        Thickness [m] and Poisson's ratio of the skin, see `Skin`.

    Raises
    ------
    ConfigurationError
        If layers or skin are impossible, or the tactels are much wider than their depth.
    """
    if 'zz' not in [component for component, _ in layers]:
        raise ConfigurationError("layers have no 'zz', must have at least one of pressure")
    levers = np.zeros((len(layers), 3))
    depths = np.array([depth for _, depth in layers], float)
    kernels = np.zeros((len(layers), 0, 0, 0, 0))
    if (depths == 0.0).any():
        if len(layers) > 1:
            raise ConfigurationError('depth is 0, must be positive [m] with several layers')
        levers[0, 0], nodes = 1.0, _gauss(2 if area else 1, array)
    else:
        shear = any(component != 'zz' for component, _ in layers)
        if shear and thickness < math.inf:
            raise ConfigurationError(f'thickness is {thickness!r}, must be infinite with layers '
                                     'of shear: they are known in a half-space alone')
        side, nodes = 0.0, _gauss(3 if area else 1, array)
        if area and not shear:
            side, centres = split_tactel(array.pitch_x, array.pitch_y, depths.min())
            nodes = np.column_stack([centres, np.full(len(centres), 1.0 / len(centres))])
        for lever, (component, depth) in zip(levers, layers, strict=True):
            lever[COMPONENTS.index(component)] = 1.0 if component == 'zz' else 1.0 / depth
        kernels = np.stack([polynomials(Skin(depth, thickness, poisson), side)
                            for depth in depths])
    return Pad(array.x, array.y, array.half_width_x, array.half_width_y,
               math.sqrt(array.pitch_x * array.pitch_y), nodes, depths, levers, kernels)
