"""What an image says of a contact on a round probe: place, force, normal."""
from dataclasses import dataclass
import math
from typing import NamedTuple

import numpy as np

from tactile_sensing.dome.geometry import Dome
from tactile_sensing.moments.image_moments import image_moments
from tactile_sensing.types.array import TactelArray
from tactile_sensing.types.image import TactileImage
from tactile_servo.laws.surface_config import SurfaceFollowingConfig
from tactile_servo.reasons import Reason, ReasonCode
from tactile_servo.tactile_jacobian.features import FeatureKind, features_of, filled, REFERENCE
from tactile_servo.tactile_jacobian.source import ModelSource
from tactile_servo.tactile_jacobian.table import JacobianTable

MOST_MISSING = 0.3  # of the tactels
FAINT = 0.04  # of the force, below which there is no contact
BEYOND = 1.1  # of half the pad, up to which a contact is believed


class Felt(NamedTuple):
    """One image's contact."""

    force: float  # N
    place: np.ndarray  # (2,), on the pad [m]
    error: np.ndarray  # (3,): J^-1 (F_d - F_a), on the pad and along the normal [m]
    normal: np.ndarray  # (3,) inward, in the base frame
    centre: np.ndarray  # (3,) of the probe [m]
    area: float  # root of the determinant of the image's variance [m^2]


@dataclass
class ContactSense:
    """From images to contacts, by the difference of features and the Jacobian's inverse."""

    array: TactelArray
    dome: Dome
    config: SurfaceFollowingConfig
    force: float  # wanted [N]
    table: JacobianTable | None = None

    def __post_init__(self):
        c = self.config
        # An elastic foundation: the force grows with the square of the depth.
        self.stiffness = c.probe.stiffness * math.sqrt(self.force / REFERENCE)
        self._kind = self.table.kind if self.table else FeatureKind(c.jacobian.features)
        self._source = ModelSource(self.dome, self.array, self._kind, c.jacobian.method,
                                   self.force, self.stiffness, self.table)
        self.wanted = self._source.features(np.array([0.0, 0.0, self.force]))

    def look(self, image: TactileImage, pose: np.ndarray) -> Felt | Reason:
        """Contact of an image at a pose (4, 4), or why there is none."""
        layer = next((one for one in image.layers if one.component == 'zz'), None)
        if layer is None or layer.unit != 'Pa' or layer.stress.shape != self.array.shape:
            return Reason(ReasonCode.BAD_IMAGE, 'no calibrated pressure of the known array')
        pressure = filled(np.asarray(layer.stress, dtype=float), MOST_MISSING)
        if pressure is None:
            return Reason(ReasonCode.BAD_IMAGE, 'too many tactels are missing')
        shown = features_of(pressure, self.array, self._kind)
        if not shown[0] > FAINT * self.force:
            return Reason(ReasonCode.CONTACT_LOST)
        error = self._source.inverse(shown).inverse @ (self.wanted - shown)
        place = -error[:2]
        if not (np.isfinite(error).all() and abs(place[0]) <= BEYOND * self.array.half_width_x
                and abs(place[1]) <= BEYOND * self.array.half_width_y):
            return Reason(ReasonCode.CONTACT_LOST, 'it is not on the pad')
        rotation = pose[:3, :3]
        return Felt(max(self.force - self.stiffness * error[2], 0.0), place, error,
                    rotation @ self.dome.direction(place),
                    pose[:3, 3] + rotation @ self.dome.centre, _area(pressure, self.array))

    def depth(self, felt: Felt) -> float:
        """How much deeper than wanted the probe presses [m]."""
        share = math.sqrt(felt.force / self.force) - 1.0
        return 2.0 * self.force / self.stiffness * share


def _area(pressure, array):
    """Root of the determinant of the variance of an image; 0 if it has none [m^2]."""
    m = image_moments(pressure, array)
    x, y = m.centre_of_pressure
    square = (m.mxx / m.m0 - x * x) * (m.myy / m.m0 - y * y) - (m.mxy / m.m0 - x * y)**2
    return math.sqrt(max(square, 0.0))
