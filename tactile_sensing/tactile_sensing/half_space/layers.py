"""Layers and tactels as the compiled fits take them."""

from dataclasses import dataclass
from functools import lru_cache
import math

import numpy as np

from tactile_common.errors import ConfigurationError
from tactile_sensing.half_space.point_model import WINDOW, WINDOW_DEPTHS

COMPONENTS = ('zz', 'xz', 'yz')
# Gauss-Legendre nodes for the average over a tactel [tactel sides] and their weights.
_NODES = {1: ((0.0,), (1.0,)),
          2: ((-math.sqrt(1 / 12), math.sqrt(1 / 12)), (0.5, 0.5)),
          3: ((-math.sqrt(0.15), 0.0, math.sqrt(0.15)), (5 / 18, 8 / 18, 5 / 18))}


@dataclass(frozen=True)
class Layer:
    """
    One layer of tactels.

    Parameters
    ----------
    component : str
        Measured stress: 'zz' (pressure), 'xz' or 'yz' (shear).
    depth : float
        Depth below the surface of the skin [m].
    noise_std : float
        Standard deviation of one tactel [Pa].

    Raises
    ------
    ConfigurationError
        Unknown component, or a depth or noise that is not positive.
    """

    component: str
    depth: float
    noise_std: float

    def __post_init__(self):
        if self.component not in COMPONENTS:
            raise ConfigurationError(
                f'component is {self.component!r}, must be one of {", ".join(COMPONENTS)}')
        for name, unit in (('depth', 'm'), ('noise_std', 'Pa')):
            value = getattr(self, name)
            if not (isinstance(value, (int, float, np.floating))
                    and math.isfinite(value) and value > 0):
                raise ConfigurationError(f'{name} is {value!r}, must be positive [{unit}]')


def tactel_nodes(tactel_points, pitch_x, pitch_y):
    """
    Points that stand for a tactel: offsets along x and y [m] and weight, shape (n^2, 3).

    Raises
    ------
    ConfigurationError
        tactel_points is not 1 (a tactel samples its centre), 2 or 3 (it averages its area).
    """
    if tactel_points not in _NODES:
        raise ConfigurationError(f'tactel_points is {tactel_points!r}, must be 1, 2 or 3')
    nodes = list(zip(*_NODES[tactel_points], strict=True))
    return np.array([(p * pitch_x, q * pitch_y, u * w) for p, u in nodes for q, w in nodes])


@lru_cache(maxsize=64)
def sensor_of(array, layers, tactel_points=1, window=None):
    """
    What the compiled functions know of a sensor.

    Parameters
    ----------
    array : TactelArray
    layers : tuple of Layer
    tactel_points : int
        As for `tactel_nodes`.
    window : float, optional
        Half side of the square of tactels around a point that its fit uses [pitches]; by
        default WINDOW, or WINDOW_DEPTHS mean depths of the layers where that is more.

    Returns
    -------
    sensor : tuple
        x, y [m], pitch_x, pitch_y [m], component (index into COMPONENTS, shape (layers,)),
        nodes, window [pitches].
    table : ndarray, shape (layers, 6)
        Depth, noise, the component as (gz + gx x' + gy y') times the pressure, and the
        threshold below which the values are missing, 0 if there is none.

    Raises
    ------
    ConfigurationError
        No 'zz' layer, a window of less than one pitch, or as `tactel_nodes`.
    """
    levers = {'zz': (1.0, 0.0, 0.0), 'xz': (0.0, 1.0, 0.0), 'yz': (0.0, 0.0, 1.0)}
    table = np.array([(layer.depth, layer.noise_std, *levers[layer.component], 0.0)
                      for layer in layers]).reshape(-1, 6)
    table[:, 3:5] /= table[:, :1]
    component = np.array([COMPONENTS.index(layer.component) for layer in layers], np.int64)
    if not (component == 0).any():
        raise ConfigurationError("layers have no 'zz', must have at least one to start from")
    whole = float(max(array.shape))
    if window is None:
        depths = WINDOW_DEPTHS * table[:, 0].mean() / min(array.pitch_x, array.pitch_y)
        window = max(WINDOW, min(depths, whole))
    elif not window >= 1.0:
        raise ConfigurationError(f'window is {window!r}, must be at least 1 [pitches]')
    sensor = (array.x, array.y, float(array.pitch_x), float(array.pitch_y), component,
              tactel_nodes(tactel_points, array.pitch_x, array.pitch_y),
              min(float(window), max(WINDOW, whole)))
    return sensor, table
