"""Contact on a round probe from an image, and features that were taught to it (6.4.1)."""
from collections.abc import Sequence
from dataclasses import dataclass
import math
import re
from typing import NamedTuple

import numpy as np

from tactile_common.errors import ConfigurationError
from tactile_sensing.dome.geometry import Dome, HalfSpaceDome
from tactile_sensing.image import image_moments
from tactile_sensing.types.array import TactelArray
from tactile_sensing.types.image import TactileImage
from tactile_servo.laws.surface_config import SurfaceConfig
from tactile_servo.reasons import Reason, ReasonCode
from tactile_servo.tactile_jacobian import (
    FeatureKind,
    features_of,
    filled,
    Increments,
    JacobianTable,
    least_squares,
    loading_cases,
    ModelFeatures,
    scale_for,
)
from tactile_servo.types import pressure_layer

MOST_MISSING = 0.3  # largest share of missing tactels
LEAST_CONTACT = 0.04  # least force of a contact, as a share of the wanted force
BEYOND = 1.1  # largest distance of a valid contact from the centre, as a share of half the pad

# Taught features:
NAME = re.compile(r'[A-Za-z0-9_-]{1,40}')
APART = 1.5  # largest factor between the taught force and the goal's


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
        stiffness = self.table.stiffness if self.table else self.stiffness
        return PadContact(max(self.force - stiffness * z, 0.0), np.array([-x, -y]))

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


class Lessons:
    """Taught features by name, kept while the servo runs."""

    def __init__(self, table: JacobianTable | None):
        self._kind = table.kind if table else FeatureKind.CENTROID
        self._shown: dict[str, np.ndarray] = {}  # (3,)

    def take(self, name: str, image: TactileImage, array: TactelArray, least: float) -> str:
        """
        Store the features of an image under a name and return a description of them.

        Raises a ConfigurationError if the name is invalid, the image is unusable, or its force is
        below `least` [N].
        """
        if not NAME.fullmatch(name):
            raise ConfigurationError(
                f'name is {name!r:.60}, must be 1 to 40 letters, digits, _ or -')
        pressure = pressure_of(image, array)
        if isinstance(pressure, Reason):
            raise ConfigurationError(pressure.text)
        force, x, y = features_of(pressure, array, FeatureKind.CENTROID)
        if not force >= least:
            raise ConfigurationError(
                f'the probe feels {force:.2f} N, must be {least:g} N or more')
        self._shown[name] = features_of(pressure, array, self._kind)
        return f'{name}: M0 {force:.2f} N, centroid at {1e3 * x:.2f}, {1e3 * y:.2f} mm'

    def named(self, text: str, force: float) -> list[np.ndarray]:
        """
        Return the features (3,) for the comma-separated names in `text`; none for an empty text.

        Raises a ConfigurationError if a name is unknown, or if its taught force differs from the
        goal's `force` [N] by more than the factor `APART`.
        """
        names = [name.strip() for name in text.split(',')] if text else []
        for name in names:
            if name not in self._shown:
                raise ConfigurationError(
                    f'no features were taught by the name {name!r}; known: '
                    f'{", ".join(self._shown) or "none"}')
            taught = self._shown[name][0]
            if not force / APART <= taught <= force * APART:
                raise ConfigurationError(
                    f'features {name!r} are of {taught:.2f} N, the goal is of {force:g} N: must '
                    f'be within a factor of {APART:g}')
        return [self._shown[name] for name in names]


def between(wanted: Sequence[PadContact], share: float) -> PadContact:
    """Interpolate between the wanted contacts, at a share of the path from 0 to 1."""
    if len(wanted) == 1:
        return wanted[0]
    rows = np.array([(contact.force, *contact.place) for contact in wanted]).T
    force, x, y = (float(np.interp(share, np.linspace(0.0, 1.0, len(wanted)), row))
                   for row in rows)
    return PadContact(force, np.array([x, y]))
