"""Desired features that were taught to the probe, under names that goals refer to (6.4.1)."""
from collections.abc import Sequence
import re

import numpy as np

from tactile_common.errors import ConfigurationError
from tactile_sensing.types.array import TactelArray
from tactile_sensing.types.image import TactileImage
from tactile_servo.laws.surface_features import PadContact, pressure_of
from tactile_servo.reasons import Reason
from tactile_servo.tactile_jacobian.features import FeatureKind, features_of
from tactile_servo.tactile_jacobian.table import JacobianTable

NAME = re.compile(r'[A-Za-z0-9_-]{1,40}')
APART = 1.5  # largest factor between the taught force and the goal's


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
