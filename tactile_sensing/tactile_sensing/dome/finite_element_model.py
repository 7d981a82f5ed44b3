"""Image of a loaded patch on a round probe, from a finite element solution of its skin."""
from dataclasses import dataclass

import numpy as np

from tactile_common.errors import ConfigurationError
from tactile_sensing.dome.finite_elements import Operator
from tactile_sensing.dome.geometry import contact_frame, Dome
from tactile_sensing.types.array import TactelArray


def superpose(green: np.ndarray, loads: np.ndarray) -> np.ndarray:
    """Return the pressure (T,) [Pa] of loads (N, 3) [N]; green: of unit loads (N, 3, T) [Pa/N]."""
    loaded = np.flatnonzero(loads.any(axis=1))  # most loads are 0
    return np.tensordot(loads[loaded], green[loaded], 2)


@dataclass(frozen=True, eq=False)
class FiniteElementDome:
    """
    Image of a plane or a sphere that is pressed against the dome.

    The state is that of `HalfSpaceDome`. The skin is treated as an elastic foundation with
    `modulus` k. The pressure of the patch is then a paraboloid of radius (4 P R / (pi k))^(1/4),
    where R is the radius of the relative curvature. Shear has the same distribution. Raises a
    ConfigurationError if the operator has another array, or the probe does not fit into the
    object.
    """

    dome: Dome
    array: TactelArray
    operator: Operator
    curvature: float = 0.0  # of the object, positive: convex [1/m]

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
        """Return the pressure on the tactels [Pa], (1, rows, columns); 0 without normal force."""
        if not state[2] > 0.0:
            return np.zeros((1, *self.array.shape))
        return superpose(self.operator.green, self._loads(state)).reshape(1, *self.array.shape)

    def _loads(self, state: np.ndarray) -> np.ndarray:
        """Return the forces (N, 3) on the points of the surface [N]."""
        op, radius = self.operator, self.dome.skin_radius
        axes = contact_frame(self.dome, state[0], state[1])
        relative = radius / (1.0 + self.curvature * radius)
        patch = 4.0 * state[2] * relative / (np.pi * op.modulus)  # radius of the patch^4
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
