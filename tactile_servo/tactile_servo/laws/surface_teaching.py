"""Desired features that were shown to the probe, by the names that goals give them (6.4.1)."""
from collections.abc import Sequence
import math
import re

import numpy as np

from tactile_common.errors import ConfigurationError
from tactile_sensing.types.array import TactelArray
from tactile_sensing.types.image import TactileImage
from tactile_servo.laws.surface_features import ContactSense, pressure_of, Told
from tactile_servo.reasons import Reason
from tactile_servo.tactile_jacobian.features import FeatureKind, features_of

NAME = re.compile(r'[A-Za-z0-9_-]{1,40}')
MOST = 100  # that are kept
APART = 1.5  # factor of the goal's force, within which taught ones must be


class Lessons:
    """Features that were shown, by name, as long as the servo runs."""

    def __init__(self, kind: FeatureKind):
        self._kind = kind
        self._shown: dict[str, np.ndarray] = {}  # (3,)

    def take(self, name: str, image: TactileImage, array: TactelArray, least: float) -> str:
        """
        Keep what an image shows, from a force of `least` [N] on; returns what that is.

        ConfigurationError if it cannot be kept.
        """
        if not NAME.fullmatch(name):
            raise ConfigurationError(
                f'name is {name!r:.60}, must be 1 to 40 letters, digits, _ or -')
        if name not in self._shown and len(self._shown) >= MOST:
            raise ConfigurationError(f'{MOST} features have been taught: no room for more')
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
        Features of a goal of a `force` [N]: none, those of a name, or of several to go through.

        ConfigurationError if one is not known, or too far from that force.
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


def wanted_contacts(sense: ContactSense, features: Sequence[np.ndarray]) -> list[Told]:
    """Contacts that features tell of; of none, the one at the pad's centre."""
    return [sense.tell(shown) for shown in features or [sense.centred]]


def between(wanted: Sequence[Told], share: float) -> Told:
    """Contact that is wanted where a share of the way, 0 to 1, is gone: from one to the next."""
    place = min(max(share, 0.0), 1.0) * (len(wanted) - 1)
    k = min(math.floor(place), len(wanted) - 2)
    if k < 0:
        return wanted[0]
    was, will, part = wanted[k], wanted[k + 1], place - k
    return Told(was.force + part * (will.force - was.force),
                was.place + part * (will.place - was.place),
                was.error + part * (will.error - was.error))
