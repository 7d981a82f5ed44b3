"""
Geometry of a round probe.

The origin of the sensor frame is the apex of the skin; z points outward, and the probe's centre
is at (0, 0, -skin_radius). A place (x, y) on the pad is the end of an arc from the apex on the
sphere of the tactels: its length is |(x, y)| and its direction at the apex is (x, y). An array
that is wrapped around the probe therefore keeps its pitches along x and y through the apex.
"""
from dataclasses import dataclass

import numpy as np

from tactile_common.config import bounded, check_fields
from tactile_common.errors import ConfigurationError
from tactile_sensing.types.array import TactelArray


@dataclass(frozen=True)
class Dome:
    """A spherical skin bonded to a rigid core, with tactels on a sphere in the skin."""

    skin_radius: float = bounded(0.027, 'of the surface of the skin', 'm', 1e-4, 1.0)
    array_radius: float = bounded(0.025, 'of the sphere of the tactels', 'm', 1e-4, 1.0)
    core_radius: float = bounded(0.023, 'of the rigid core below the skin', 'm', 1e-4, 1.0)

    def __post_init__(self) -> None:
        check_fields(self, 'dome.')
        if not self.core_radius < self.array_radius < self.skin_radius:
            raise ConfigurationError(
                f'dome: core_radius {self.core_radius}, array_radius {self.array_radius} and '
                f'skin_radius {self.skin_radius} m must increase')

    @property
    def depth(self) -> float:
        """Depth of the tactels below the surface [m]."""
        return self.skin_radius - self.array_radius

    @property
    def centre(self) -> np.ndarray:
        """Centre of the probe in the sensor frame (3,) [m]."""
        return np.array([0.0, 0.0, -self.skin_radius])

    def direction(self, place: np.ndarray) -> np.ndarray:
        """Return outward unit vectors (..., 3) at places (..., 2) [m] on the pad."""
        place = np.asarray(place, dtype=float) / self.array_radius
        angle = np.hypot(place[..., 0], place[..., 1])
        return np.concatenate([
            np.sinc(angle / np.pi)[..., None] * place, np.cos(angle)[..., None]], axis=-1)

    def place(self, direction: np.ndarray) -> np.ndarray:
        """Return places (..., 2) [m] on the pad, given vectors (..., 3) from the centre."""
        direction = np.asarray(direction, dtype=float)
        across = np.hypot(direction[..., 0], direction[..., 1])
        angle = np.arctan2(across, direction[..., 2])
        share = np.where(across > 0.0, angle / np.where(across > 0.0, across, 1.0), 0.0)
        return self.array_radius * share[..., None] * direction[..., :2]

    def tactels(self, array: TactelArray) -> np.ndarray:
        """Return outward unit vectors (rows, columns, 3) at the tactels."""
        x, y = np.meshgrid(array.x, array.y)
        return self.direction(np.stack([x, y], axis=-1))


def contact_frame(dome: Dome, x: float, y: float) -> np.ndarray:
    """
    Return the axes (3, 3) at a place [m], as rows: x and y along the skin, z outward.

    They are the sensor's axes after the smallest rotation that turns z to the local normal.
    """
    nx, ny, nz = dome.direction(np.array([x, y]))
    fold = 1.0 / (1.0 + nz)
    return np.array([[1.0 - nx * nx * fold, -nx * ny * fold, -nx],
                     [-nx * ny * fold, 1.0 - ny * ny * fold, -ny], [nx, ny, nz]])


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
