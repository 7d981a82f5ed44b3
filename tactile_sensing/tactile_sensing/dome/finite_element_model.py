"""A loaded patch on a round probe whose skin has been solved by finite elements."""
from dataclasses import dataclass

import numpy as np

from tactile_common.errors import ConfigurationError
from tactile_sensing.dome.finite_elements import Operator
from tactile_sensing.dome.geometry import contact_frame, Dome
from tactile_sensing.types.array import TactelArray


def superpose(green: np.ndarray, loads: np.ndarray) -> np.ndarray:
    """Pressure (T,) [Pa] of loads (N, 3) [N], by unit loads' (N, 3, T) [Pa/N]."""
    loaded = np.flatnonzero(loads.any(axis=1))  # few of them are
    return np.tensordot(loads[loaded], green[loaded], 2)


@dataclass(frozen=True, eq=False)
class FiniteElementDome:
    """
    The patch of a plane, or of a sphere, pressed against the dome.

    A state is as in `HalfSpaceDome`. On an elastic foundation of the skin's `modulus` k the
    pressure of the patch is a paraboloid of radius (4 P R / (pi k))^(1/4), R the radius of the
    relative curvature; shear is distributed as the pressure is.
    """

    dome: Dome
    array: TactelArray
    operator: Operator
    curvature: float = 0.0  # of the object, positive where it is convex [1/m]

    def __post_init__(self) -> None:
        if self.operator.green.shape[2] != self.array.rows * self.array.columns:
            raise ConfigurationError(
                f'operator: has {self.operator.green.shape[2]} tactels, the array '
                f'{self.array.rows} x {self.array.columns}')
        if not self.curvature * self.dome.skin_radius > -1.0:
            raise ConfigurationError(
                f'curvature is {self.curvature:g}, must be above {-1 / self.dome.skin_radius:g} '
                '1/m: the probe does not fit')

    def image(self, state: np.ndarray) -> np.ndarray:
        """Pressure on the tactels [Pa], shape (1, rows, columns); 0 without normal force."""
        if not state[2] > 0.0:
            return np.zeros((1, *self.array.shape))
        return superpose(self.operator.green, self._loads(state)).reshape(1, *self.array.shape)

    def _loads(self, state: np.ndarray) -> np.ndarray:
        """Forces (N, 3) on the points of the surface [N]."""
        op, radius = self.operator, self.dome.skin_radius
        axes = contact_frame(self.dome, state[0], state[1])
        relative = radius / (1.0 + self.curvature * radius)
        patch = 4.0 * state[2] * relative / (np.pi * op.modulus)  # its radius^4
        outward = (op.points - self.dome.centre) / radius
        square = 2.0 * radius**2 * (1.0 - outward @ axes[2])
        pressed = np.maximum(1.0 - square / np.sqrt(patch), 0.0) * op.areas
        total = pressed @ (outward @ axes[2])
        if not total > 0.0:
            raise ConfigurationError(
                f'state: the contact at ({state[0]:g}, {state[1]:g}) m is off the skin')
        shear = state[3] * axes[0] + state[4] * axes[1]
        return np.outer(pressed, shear / pressed.sum()) - (state[2] / total * pressed)[
            :, None] * outward
