"""A point load on a round probe, as if the skin were a half-space below its tangent plane."""
from dataclasses import dataclass, field

import numpy as np

from tactile_sensing.dome.geometry import contact_frame, Dome
from tactile_sensing.types.array import TactelArray

PARAMETERS = ('a', 'b', 'normal_force', 'shear_force_x', 'shear_force_y')


@dataclass(frozen=True)
class HalfSpaceDome:
    """
    Point load on the tangent plane of the dome: (2.2) in the place of every tactel.

    Below a point force F on the surface of an incompressible half-space the stress at r is
    -3 / (2 pi) (F . r) r r' / |r|^5 (Boussinesq, Cerruti), of which a tactel feels the component
    along its own normal. On a flat pad this is (2.2).

    A state is the place a, b on the pad [m], the normal force into the skin and the shear of the
    object on the skin along the axes of `contact_frame` [N].
    """

    dome: Dome
    array: TactelArray
    parameters: tuple[str, ...] = PARAMETERS
    _inward: np.ndarray = field(init=False, repr=False, compare=False)

    def __post_init__(self):
        object.__setattr__(self, '_inward', -self.dome.tactels(self.array))

    def image(self, state: np.ndarray) -> np.ndarray:
        """Pressure on the tactels [Pa], shape (1, rows, columns)."""
        axes, _ = contact_frame(self.dome, state[0], state[1])
        way, force = self._way(axes), _force(axes, state)
        square = np.einsum('ijk,ijk->ij', way, way)
        pressed, faced = way @ force, np.einsum('ijk,ijk->ij', way, self._inward)
        return (1.5 / np.pi * pressed * faced**2 * square**-2.5)[None]

    def jacobian(self, state: np.ndarray) -> np.ndarray:
        """Derivatives of `image` by the state, shape (1, rows, columns, 5)."""
        axes, by_place = contact_frame(self.dome, state[0], state[1])
        way, force = self._way(axes), _force(axes, state)
        square = np.einsum('ijk,ijk->ij', way, way)
        pressed, faced = way @ force, np.einsum('ijk,ijk->ij', way, self._inward)
        scale = 1.5 / np.pi * square**-2.5
        found = np.empty((1, *self.array.shape, 5))
        for k in range(2):
            step = -self.dome.skin_radius * by_place[k, 2]
            found[0, ..., k] = scale * faced * (
                faced * (step @ force + way @ _force(by_place[k], state))
                + 2.0 * pressed * (self._inward @ step)
                - 5.0 * pressed * faced / square * (way @ step))
        for k, axis in ((2, -axes[2]), (3, axes[0]), (4, axes[1])):
            found[0, ..., k] = scale * faced**2 * (way @ axis)
        return found

    def _way(self, axes):
        """From the contact to every tactel, (rows, columns, 3) [m]."""
        return -self.dome.array_radius * self._inward - self.dome.skin_radius * axes[2]


def _force(axes, state):
    """Force on the skin (3,) [N]."""
    return state[3] * axes[0] + state[4] * axes[1] - state[2] * axes[2]
