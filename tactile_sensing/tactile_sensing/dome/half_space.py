"""Image of a point load on a round probe, with the skin as a half-space below a tangent plane."""
from dataclasses import dataclass

import numpy as np

from tactile_sensing.dome.geometry import contact_frame, Dome
from tactile_sensing.types.array import TactelArray


@dataclass(frozen=True)
class HalfSpaceDome:
    """
    Image of a point load on the tangent plane of the dome: (2.2) at every tactel.

    Under a point force F on the surface of an incompressible half-space, the stress at r is
    -3 / (2 pi) (F . r) r r' / |r|^5 (Boussinesq, Cerruti). A tactel measures its component along
    its own normal. On a flat pad this is (2.2).

    A state (5,) is the place a, b on the pad [m], the normal force into the skin, and the shear x
    and y of the object on the skin along the axes of `contact_frame` [N].
    """

    dome: Dome
    array: TactelArray

    def image(self, state: np.ndarray) -> np.ndarray:
        """Return the pressure on the tactels [Pa], shape (1, rows, columns)."""
        axes, outward = contact_frame(self.dome, state[0], state[1]), self.dome.tactels(self.array)
        force = state[3] * axes[0] + state[4] * axes[1] - state[2] * axes[2]
        way = self.dome.array_radius * outward - self.dome.skin_radius * axes[2]
        faced = np.einsum('ijk,ijk->ij', way, outward)
        square = np.einsum('ijk,ijk->ij', way, way)
        return (1.5 / np.pi * (way @ force) * faced**2 * square**-2.5)[None]
