"""Forward models: what a sensor shows of a load, and how that changes with the load."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from tactile_sensing.half_space import line, point
from tactile_sensing.types.array import TactelArray


@dataclass(frozen=True)
class Layer:
    """One layer of tactels, without its image."""

    component: str  # measured stress: 'zz' (pressure), 'xz' or 'yz' (shear)
    depth: float  # below the surface of the skin [m]
    noise_std: float = 1.0  # standard deviation of one tactel [Pa]


class ForwardModel(Protocol):
    """A load's state (K,) to the tactile image, and its derivatives."""

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of the entries of a state."""
        ...

    def image(self, state: np.ndarray) -> np.ndarray:
        """Stress at the centres of the tactels [Pa], shape (layers, rows, columns)."""
        ...

    def jacobian(self, state: np.ndarray) -> np.ndarray:
        """Derivatives of `image` by the state, shape (layers, rows, columns, K)."""
        ...


@dataclass(frozen=True)
class PointModel:
    """Point load with friction on a half-space: a, b [m], P, Qx, Qy [N]; (2.2) and (2.5)."""

    array: TactelArray
    layers: Sequence[Layer]  # component and depth of each; their noise is not read
    parameters: tuple[str, ...] = ('a', 'b', 'normal_force', 'shear_force_x', 'shear_force_y')

    def image(self, state: np.ndarray) -> np.ndarray:
        """Stress [Pa], shape (layers, rows, columns)."""
        return self._each(point.stress, state)

    def jacobian(self, state: np.ndarray) -> np.ndarray:
        """Derivatives of `image`, shape (layers, rows, columns, 5)."""
        return self._each(point.stress_jacobian, state)

    def _each(self, function, state):
        return np.stack([function(
            layer.component, self.array.x, self.array.y[:, None], *state, layer.depth)
            for layer in self.layers])


@dataclass(frozen=True)
class LineModel:
    """Line load: rho [m], yaw [rad], force and shear across it per length [N/m]; (3.1)."""

    array: TactelArray
    depths: Sequence[float]  # of the layers of pressure [m]
    parameters: tuple[str, ...] = ('rho', 'yaw', 'line_force', 'line_shear')

    def image(self, state: np.ndarray) -> np.ndarray:
        """Pressure [Pa], shape (layers, rows, columns)."""
        return self._each(line.stress_with_shear, state)

    def jacobian(self, state: np.ndarray) -> np.ndarray:
        """Derivatives of `image`, shape (layers, rows, columns, 4)."""
        return self._each(line.stress_with_shear_jacobian, state)

    def _each(self, function, state):
        return np.stack([function(self.array.x, self.array.y[:, None], *state, depth)
                         for depth in self.depths])
