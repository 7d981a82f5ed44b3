"""Forward models: what a sensor shows of a load, and how that changes with the load."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from tactile_sensing.half_space import line, point
from tactile_sensing.half_space.layers import Layer
from tactile_sensing.types.array import TactelArray


class ForwardModel(Protocol):
    """
    A load's state to the tactile image, and its derivatives.

    Attributes
    ----------
    parameters : tuple of str
        Names of the entries of a state.
    """

    parameters: tuple[str, ...]

    def image(self, state: np.ndarray) -> np.ndarray:
        """Stress [Pa] under the load of a state (K,), shape (layers, rows, columns)."""
        ...

    def jacobian(self, state: np.ndarray) -> np.ndarray:
        """Derivatives of `image` by the state, shape (layers, rows, columns, K)."""
        ...


@dataclass(frozen=True)
class PointModel:
    """
    Point load with friction on a half-space: a, b [m], P, Qx, Qy [N]; (2.2) and (2.5).

    Parameters
    ----------
    array : TactelArray
    layers : sequence of Layer
        Component and depth of each; their noise is not read.
    averaging : bool
        The tactels average over their area instead of sampling at their centre.
    """

    array: TactelArray
    layers: Sequence[Layer]
    averaging: bool = False
    parameters: tuple[str, ...] = (
        'a', 'b', 'normal_force', 'shear_force_x', 'shear_force_y')

    def image(self, state: np.ndarray) -> np.ndarray:
        """Stress [Pa], shape (layers, rows, columns)."""
        return self._each(point.average if self.averaging else point.stress, state)

    def jacobian(self, state: np.ndarray) -> np.ndarray:
        """Derivatives of `image`, shape (layers, rows, columns, 5)."""
        return self._each(
            point.average_jacobian if self.averaging else point.stress_jacobian, state)

    def _each(self, function, state):
        area = (self.array.pitch_x, self.array.pitch_y) if self.averaging else ()
        return np.stack([function(
            layer.component, self.array.x, self.array.y[:, None], *state, layer.depth, *area)
            for layer in self.layers])


@dataclass(frozen=True)
class LineModel:
    """
    Line load with shear across it: rho [m], yaw [rad], force and shear per length [N/m]; (3.1).

    Parameters
    ----------
    array : TactelArray
    depths : sequence of float
        Of the layers of pressure [m].
    averaging : bool
        As for `PointModel`.
    """

    array: TactelArray
    depths: Sequence[float]
    averaging: bool = False
    parameters: tuple[str, ...] = ('rho', 'yaw', 'line_force', 'line_shear')

    def image(self, state: np.ndarray) -> np.ndarray:
        """Pressure [Pa], shape (layers, rows, columns)."""
        return self._each(
            line.average_with_shear if self.averaging else line.stress_with_shear, state)

    def jacobian(self, state: np.ndarray) -> np.ndarray:
        """Derivatives of `image`, shape (layers, rows, columns, 4)."""
        return self._each(line.average_with_shear_jacobian if self.averaging
                          else line.stress_with_shear_jacobian, state)

    def _each(self, function, state):
        area = (self.array.pitch_x, self.array.pitch_y) if self.averaging else ()
        return np.stack([function(self.array.x, self.array.y[:, None], *state, depth, *area)
                         for depth in self.depths])
