"""Place, force and normal of a contact on a round probe, from an image."""
from dataclasses import dataclass
import math
from typing import NamedTuple

import numpy as np

from tactile_sensing.dome.geometry import Dome, HalfSpaceDome
from tactile_sensing.image import image_moments
from tactile_sensing.types.array import TactelArray
from tactile_sensing.types.image import TactileImage
from tactile_servo.laws.surface_config import SurfaceConfig
from tactile_servo.reasons import Reason, ReasonCode
from tactile_servo.tactile_jacobian.features import FeatureKind, features_of, filled, ModelFeatures
from tactile_servo.tactile_jacobian.jacobian import (
    Increments,
    least_squares,
    loading_cases,
    scale_for,
)
from tactile_servo.tactile_jacobian.table import JacobianTable
from tactile_servo.types import pressure_layer

MOST_MISSING = 0.3  # largest share of missing tactels
LEAST_CONTACT = 0.04  # least force of a contact, as a share of the wanted force
BEYOND = 1.1  # largest distance of a valid contact from the centre, as a share of half the pad


class PadContact(NamedTuple):
    """Contact on the pad, computed from features."""

    force: float  # N
    place: np.ndarray  # (2,), on the pad [m]


class Felt(NamedTuple):
    """Contact of one image: the fields of `PadContact`, and its position in the base frame."""

    force: float
    place: np.ndarray
    normal: np.ndarray  # (3,), inward normal in the base frame
    centre: np.ndarray  # (3,), centre of the probe [m]
    area: float  # root of the determinant of the image's variance [m^2]


@dataclass
class ContactSense:
    """Compute contacts from images: feature differences times the inverse Jacobian."""

    array: TactelArray
    dome: Dome
    config: SurfaceConfig
    force: float  # operating point of the Jacobian [N]
    table: JacobianTable | None = None

    def __post_init__(self) -> None:
        self.stiffness = self.config.probe.stiffness(self.force)
        self._kind = self.table.kind if self.table else FeatureKind.CENTROID
        model = ModelFeatures(HalfSpaceDome(self.dome, self.array), self.array, self._kind)
        centre = np.array([0.0, 0.0, self.force])
        self.centred = model(centre)
        half = 0.5 * (self.array.half_width_x + self.array.half_width_y)
        self._inverse = least_squares(
            loading_cases(model, centre, Increments.of(self.array, self.stiffness)),
            scale_for(self._kind, self.force, half, self.stiffness)).inverse

    def contact_of(self, features: np.ndarray) -> PadContact:
        """Return the contact for features (3,)."""
        inverse = self.table.nearest(features) if self.table else self._inverse
        # J^-1 (F_d - F_a): two on the pad, one along the normal [m]
        x, y, z = inverse @ (self.centred - features)
        return PadContact(max(self.force - self.stiffness * z, 0.0), np.array([-x, -y]))

    def look(self, image: TactileImage, pose: np.ndarray) -> Felt | Reason:
        """Return the contact of an image at a pose (4, 4), or the reason why there is none."""
        pressure = pressure_of(image, self.array)
        if isinstance(pressure, Reason):
            return pressure
        shown = features_of(pressure, self.array, self._kind)
        if not shown[0] > LEAST_CONTACT * self.force:
            return Reason(ReasonCode.CONTACT_LOST)
        contact = self.contact_of(shown)
        if not (math.isfinite(contact.force)
                and abs(contact.place[0]) <= BEYOND * self.array.half_width_x
                and abs(contact.place[1]) <= BEYOND * self.array.half_width_y):
            return Reason(ReasonCode.CONTACT_LOST, 'it is not on the pad')
        rotation = pose[:3, :3]
        return Felt(*contact, rotation @ self.dome.direction(contact.place),
                    pose[:3, 3] + rotation @ self.dome.centre, _area(pressure, self.array))

    def depth(self, force: float) -> float:
        """Return the depth for a force, relative to the depth at the Jacobian's force [m]."""
        share = math.sqrt(force / self.force) - 1.0
        return 2.0 * self.force / self.stiffness * share

    def pressed(self, depth: float) -> float:
        """Return the force [N] at a depth relative to that at the Jacobian's force [m]."""
        return self.force * max(1.0 + 0.5 * self.stiffness * depth / self.force, 0.0)**2


def pressure_of(image: TactileImage, array: TactelArray) -> np.ndarray | Reason:
    """Return the pressure (rows, columns) of an image without NaN [Pa], or a reason."""
    layer = pressure_layer(image.layers)
    if layer is None or layer.unit != 'Pa' or layer.stress.shape != array.shape:
        return Reason(ReasonCode.BAD_IMAGE, 'no calibrated pressure of the known array')
    pressure = filled(np.asarray(layer.stress, dtype=float), most=MOST_MISSING)
    return Reason(ReasonCode.BAD_IMAGE, 'too many tactels are missing') if (
        pressure is None) else pressure


def _area(pressure: np.ndarray, array: TactelArray) -> float:
    """Return the root of the determinant of an image's variance, at least 0 [m^2]."""
    m = image_moments(pressure, array)
    x, y = m.centre_of_pressure
    square = (m.mxx / m.m0 - x * x) * (m.myy / m.m0 - y * y) - (m.mxy / m.m0 - x * y)**2
    return math.sqrt(max(square, 0.0))
