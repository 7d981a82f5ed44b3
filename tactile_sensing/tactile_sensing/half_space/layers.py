"""Sensor, layers and tactels as the compiled functions take them."""

from dataclasses import dataclass
from functools import lru_cache
import math
from typing import NamedTuple

import numpy as np

from tactile_common.errors import ConfigurationError
from tactile_common.kernels import njit
from tactile_sensing.skin.kernel import DEGREE, polynomials, SPREAD_DEGREE
from tactile_sensing.skin.pressure import split_tactel
from tactile_sensing.types.array import TactelArray
from tactile_sensing.types.image import COMPONENTS
from tactile_sensing.types.skin import Skin

WINDOW = 4.5  # least half side of a point's fitted window [pitches]: 9x9 tactels
WINDOW_DEPTHS = 1.9  # the same in mean depths of the layers: deeper ones see further
PRESSURE = COMPONENTS.index('zz')  # layer.component of pressure
# Gauss-Legendre nodes for the average over a tactel [tactel sides] and their weights.
_NODES = {1: ((0.0,), (1.0,)),
          2: ((-math.sqrt(1 / 12), math.sqrt(1 / 12)), (0.5, 0.5)),
          3: ((-math.sqrt(0.15), 0.0, math.sqrt(0.15)), (5 / 18, 8 / 18, 5 / 18))}
_LEVERS = {'zz': (1.0, 0.0, 0.0), 'xz': (0.0, 1.0, 0.0), 'yz': (0.0, 0.0, 1.0)}

# Points that stand for a tactel: offset from its centre [m] and weight.
NODE = np.dtype([('x', 'f8'), ('y', 'f8'), ('weight', 'f8')])
# Depth [m], noise of a tactel [Pa], index into COMPONENTS, the component as (gz + gx x' + gy y')
# times the pressure, and what at or below is only known to be below it, 0 if there is none;
# noise (0: unknown) and full scale (0: none) as given with a picture [Pa]. Of the load that is
# being fitted: where this layer's end among the gathered tactels, and the shapes of the load and
# of a line's tip, with their derivatives by the variance of the patch, see `skin.kernels`.
_SHAPE = 'f8', (2, DEGREE + 1)
LAYER = np.dtype([
    ('depth', 'f8'), ('noise', 'f8'), ('component', 'i8'), ('gz', 'f8'), ('gx', 'f8'),
    ('gy', 'f8'), ('floor', 'f8'), ('given_noise', 'f8'), ('full_scale', 'f8'), ('end', 'i8'),
    ('load', *_SHAPE), ('load_slope', *_SHAPE), ('tip', *_SHAPE), ('tip_slope', *_SHAPE)])


class Sensor(NamedTuple):
    """Geometry of a sensor."""

    x: np.ndarray  # centres of the columns [m]
    y: np.ndarray  # centres of the rows [m]
    pitch_x: float  # [m]
    pitch_y: float
    nodes: np.ndarray  # NODE records
    window: float  # half side of the square of tactels around a point that its fit uses [pitches]
    polynomials: np.ndarray  # (layers, *those of `skin.kernel.polynomials`); without them no patch
    closed: bool  # whether sharp loads have the closed forms of a half-space


@dataclass(frozen=True)
class Layer:
    """
    One layer of tactels.

    Raises
    ------
    ConfigurationError
        Unknown component, or a depth or noise that is not positive.
    """

    component: str  # measured stress: 'zz' (pressure), 'xz' or 'yz' (shear)
    depth: float  # below the surface of the skin [m]
    noise_std: float  # standard deviation of one tactel [Pa]

    def __post_init__(self):
        if self.component not in COMPONENTS:
            raise ConfigurationError(
                f'component is {self.component!r}, must be one of {", ".join(COMPONENTS)}')
        for name, unit in (('depth', 'm'), ('noise_std', 'Pa')):
            value = getattr(self, name)
            if not (isinstance(value, (int, float, np.floating))
                    and math.isfinite(value) and value > 0):
                raise ConfigurationError(f'{name} is {value!r}, must be positive [{unit}]')


def _tactel_nodes(tactel_points, pitch_x, pitch_y):
    """Points that stand for a tactel: NODE records, shape (tactel_points^2,)."""
    if tactel_points not in _NODES:
        raise ConfigurationError(f'tactel_points is {tactel_points!r}, must be 1, 2 or 3')
    nodes = list(zip(*_NODES[tactel_points], strict=True))
    return np.array([(p * pitch_x, q * pitch_y, u * w) for p, u in nodes for q, w in nodes], NODE)


def _layer_table(layers):
    """LAYER records of layers."""
    table = np.zeros(len(layers), LAYER)
    for record, layer in zip(table, layers, strict=True):
        record['depth'], record['noise'] = layer.depth, layer.noise_std
        record['component'] = COMPONENTS.index(layer.component)
        record['gz'], by_x, by_y = _LEVERS[layer.component]
        record['gx'], record['gy'] = by_x / layer.depth, by_y / layer.depth
    if not (table['component'] == PRESSURE).any():
        raise ConfigurationError("layers have no 'zz', must have at least one to start from")
    return table


def _nodes_and_polynomials(array, layers, tactel_points, thickness, poisson):
    """NODE records, polynomials of every layer, and whether closed forms serve for sharp loads."""
    pitches = array.pitch_x, array.pitch_y
    nodes = _tactel_nodes(tactel_points, *pitches)
    if any(layer.component != 'zz' for layer in layers):
        if thickness < math.inf:
            raise ConfigurationError(f'thickness is {thickness!r}, must be infinite with layers '
                                     'of shear: they are known in a half-space alone')
        none = np.empty((0, 3, SPREAD_DEGREE + 1, 2, DEGREE + 1))
        return nodes, none, True
    side = 0.0
    if tactel_points > 1:
        side, centres = split_tactel(*pitches, min(layer.depth for layer in layers))
        nodes = np.array([(x, y, 1.0 / len(centres)) for x, y in centres], NODE)
    each = [polynomials(Skin(layer.depth, thickness, poisson), side) for layer in layers]
    return nodes, np.stack(each), side == 0.0 and thickness == math.inf


@lru_cache(maxsize=64)
def sensor_of(array: TactelArray, layers: tuple[Layer, ...], tactel_points: int = 1,
              window: float | None = None, thickness: float = math.inf,
              poisson: float = 0.5) -> tuple[Sensor, np.ndarray]:
    """
    What the compiled functions know of a sensor.

    Parameters
    ----------
    array : TactelArray
    layers : tuple of Layer
    tactel_points : int
        1: a tactel samples its centre; 2, 3: it averages its area, with layers of shear by so many
        points a side.
    window : float, optional
        `Sensor.window`; default: WINDOW, or WINDOW_DEPTHS mean depths where that is more.
    thickness, poisson : float
        Of the skin, see `Skin`.

    Returns
    -------
    sensor : Sensor
    table : ndarray of LAYER, shape (layers,)

    Raises
    ------
    ConfigurationError
        No 'zz' layer, a window of less than one pitch, another number of points, or a thickness
        with layers of shear.
    """
    table = _layer_table(layers)
    whole = float(max(array.shape))
    if window is None:
        depths = WINDOW_DEPTHS * table['depth'].mean() / min(array.pitch_x, array.pitch_y)
        window = max(WINDOW, min(depths, whole))
    elif not window >= 1.0:
        raise ConfigurationError(f'window is {window!r}, must be at least 1 [pitches]')
    nodes, coefficients, closed = _nodes_and_polynomials(
        array, layers, tactel_points, thickness, poisson)
    return Sensor(array.x, array.y, float(array.pitch_x), float(array.pitch_y), nodes,
                  min(float(window), max(WINDOW, whole)), coefficients, closed), table


@njit(error_model='numpy')
def half_sides(sensor):
    """Half of the array's extent along x and y [m]."""
    return 0.5 * sensor.x.size * sensor.pitch_x, 0.5 * sensor.y.size * sensor.pitch_y


@njit(error_model='numpy')
def first_pressure_layer(layers):
    """Index of the first layer of pressure."""
    k = 0
    while layers[k].component != PRESSURE:
        k += 1
    return k
