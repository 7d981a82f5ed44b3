"""
Tactile Jacobian: the change of image features with the contact (chapter 6, appendix C).

Features are the moments of an image (6.6), or its force and centroid. The Jacobian is fitted to
small changes of the contact (6.7), (C.10), and looked up in a table of it (6.4.2, 6.5).
"""
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from enum import Enum
import os
from typing import NamedTuple, Protocol

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
import scipy

from tactile_common.errors import ConfigurationError
from tactile_common.npz_stream import read_arrays
from tactile_sensing.types.array import TactelArray

REFERENCE = 5.0  # force at which a model's sensitivity is determined, and unit of forces [N]
FORMAT = 2
WORST_CONDITION = 50.0  # largest condition number of a Jacobian that is used
_ARRAYS = ('contacts', 'features', 'forward', 'inverse', 'condition', 'scale')

Features = Callable[[np.ndarray], np.ndarray]  # contact (3,) -> features (3,)


class FeatureKind(Enum):
    """Kind of the three features of an image."""

    MOMENTS = 'moments'  # M0 [N], Mx, My [N m]: those of the thesis
    CENTROID = 'centroid'  # M0 [N], Mx / M0, My / M0 [m]


def features_of(pressure: np.ndarray, array: TactelArray, kind: FeatureKind) -> np.ndarray:
    """
    Return the features (3,) of a pressure image (rows, columns) [Pa].

    The image must not contain NaN, see `filled`. The centroid of an image without force is NaN.
    """
    area = array.pitch_x * array.pitch_y
    by_column, by_row = area * pressure.sum(axis=0), area * pressure.sum(axis=1)
    m0, mx, my = by_column.sum(), by_column @ array.x, by_row @ array.y
    if kind is FeatureKind.CENTROID:
        mx, my = (mx / m0, my / m0) if m0 > 0.0 else (np.nan, np.nan)
    return np.array([m0, mx, my])


def filled(pressure: np.ndarray, most: float) -> np.ndarray | None:
    """
    Replace NaN in an image by the mean of the neighbours; return None if too many are NaN.

    A value of zero instead would shift the centroid away from the tactel. `most` is the largest
    allowed share of NaN. A tactel without valid neighbours becomes 0.
    """
    missing = ~np.isfinite(pressure)
    if not missing.any():
        return np.asarray(pressure, dtype=float)
    if missing.mean() > most:
        return None
    known = np.where(missing, 0.0, pressure)
    total, count = (sliding_window_view(np.pad(values, 1), (3, 3)).sum(axis=(2, 3))
                    for values in (known, ~missing))
    return np.where(missing, total / np.maximum(count, 1.0), known)


class ProbeModel(Protocol):
    """Model of a probe's image, for instance `HalfSpaceDome` or `FiniteElementDome`."""

    def image(self, state: np.ndarray) -> np.ndarray:
        """Return the pressure (1, rows, columns) [Pa] for a, b, normal force and shear (5,)."""
        ...


class ModelFeatures:
    """
    Features of a model's image for a contact (x, y, p): place on the pad [m] and force [N].

    Sensors are calibrated by the force on them. Therefore the model's image is scaled so that M0
    equals the force at the pad's centre.
    """

    def __init__(self, model: ProbeModel, array: TactelArray,
                 kind: FeatureKind = FeatureKind.CENTROID):
        self._model, self._array, self.kind = model, array, kind
        image = model.image(np.array([0.0, 0.0, REFERENCE, 0.0, 0.0]))[0]
        m0 = features_of(image, array, FeatureKind.MOMENTS)[0]
        if not m0 > 0.0:
            raise ConfigurationError(f'model: {REFERENCE:g} N at the centre give M0 = {m0:g} N')
        self.sensitivity = m0 / REFERENCE

    def __call__(self, contact: np.ndarray) -> np.ndarray:
        """Return the features (3,) for a contact (3,)."""
        image = self._model.image(np.array([*contact, 0.0, 0.0]))[0] / self.sensitivity
        return features_of(image, self._array, self.kind)


@dataclass(frozen=True)
class Increments:
    """Increments of Table 6.1, and the stiffness against the motion along the normal."""

    # By which the contact is moved either way [m]; at least a pitch, because over less the
    # centroid of a coarse array moves in steps.
    place: float = 1.0e-3
    force: float = 0.25  # share by which the force is changed either way
    stiffness: float = 1.5e4  # K_z of (6.7): of skin, finger and robot along the normal [N/m]

    @classmethod
    def of(cls, array: TactelArray, stiffness: float = stiffness) -> 'Increments':
        """Return the increments for an array and a stiffness K_z [N/m]."""
        return cls(max(cls.place, array.pitch_x, array.pitch_y), stiffness=stiffness)


class TactileJacobian(NamedTuple):
    """Change of the features with the contact's place and the motion along the normal."""

    forward: np.ndarray  # (3, 3), dF = J dX
    inverse: np.ndarray  # (3, 3), dX = J^-1 dF, fitted directly
    condition: float  # condition number of the scaled forward matrix, at least 1


def loading_cases(features: Features, contact: np.ndarray,
                  increments: Increments) -> tuple[np.ndarray, np.ndarray]:
    """
    Compute the changes of the features for the six increments of Table 6.1 from a base contact.

    Returns the motions dX = (dx, dy, dp / K_z), (6, 3) [m], and the changes (6, 3). Friction
    against the sliding by dx or dy is neglected.
    """
    contact = np.asarray(contact, dtype=float)
    base, motions, changes = features(contact), [], []
    size = np.array([increments.place, increments.place, increments.force * contact[2]])
    for axis in range(3):
        for sign in (1.0, -1.0):
            change = np.zeros(3)
            change[axis] = sign * size[axis]
            changes.append(features(contact + change) - base)
            motions.append(change / [1.0, 1.0, increments.stiffness])
    return np.array(motions), np.array(changes)


class Scale(NamedTuple):
    """Units of features and motions, so that all have comparable weight."""

    features: np.ndarray  # (3,)
    motions: np.ndarray  # (3,)


def scale_for(kind: FeatureKind, force: float, length: float, stiffness: float) -> Scale:
    """Return units from force [N], length on the pad [m], K_z [N/m]: J is near 1 at the centre."""
    lever = length * (force if kind is FeatureKind.MOMENTS else 1.0)
    return Scale(np.array([force, lever, lever]), np.array([length, length, force / stiffness]))


def least_squares(cases: tuple[np.ndarray, np.ndarray], scale: Scale) -> TactileJacobian:
    """
    Fit the Jacobian and its inverse separately to the six cases, see `loading_cases`.

    The inverse is that of (C.10). Its 18 equations (the thesis counts 12) form three groups of
    six, one for each row: changes @ inverse' = motions.
    """
    motions, changes = cases
    forward = np.linalg.lstsq(motions, changes, rcond=None)[0].T
    inverse = np.linalg.lstsq(changes / scale.features, motions, rcond=None)[0].T / scale.features
    return TactileJacobian(forward, inverse, condition_of(forward, scale))


def condition_of(forward: np.ndarray, scale: Scale) -> float:
    """Return the condition number of a Jacobian (3, 3) after scaling; inf if it is not finite."""
    if not np.isfinite(forward).all():
        return np.inf
    return float(np.linalg.cond(forward * scale.motions / scale.features[:, None]))


@dataclass(eq=False)
class JacobianTable:
    """
    Jacobians at contacts (x, y, p), searched by the features of these contacts.

    The thesis finds the nearest features with a hash of r^2, searching from a sphere outwards and
    inwards; a k-d tree finds the same entries. Features are scaled, because otherwise the feature
    with the largest numbers would dominate the distance. ConfigurationError if an array has a
    wrong shape, the scale is not positive, or no entry is usable.
    """

    kind: FeatureKind
    contacts: np.ndarray  # (N, 3): place [m], force [N]
    features: np.ndarray  # (N, 3)
    forward: np.ndarray  # (N, 3, 3)
    inverse: np.ndarray  # (N, 3, 3)
    condition: np.ndarray  # (N,)
    scale: np.ndarray  # (3,), units of the features
    stop: float = 1.0  # largest squared distance of a match, in scaled features
    stiffness: float = Increments.stiffness  # K_z of the motions [N/m]
    usable: np.ndarray = field(init=False)  # (N,), True for finite, well-conditioned entries

    def __post_init__(self) -> None:
        count = len(self.contacts)
        rows, matrices = (count, 3), (count, 3, 3)
        for name, shape in zip(_ARRAYS, (rows, rows, matrices, matrices, (count,), (3,)),
                               strict=True):
            found = np.shape(getattr(self, name))
            if found != shape:
                raise ConfigurationError(f'table: {name} has the shape {found}, must be {shape}')
        if not (np.isfinite(self.scale).all() and (self.scale > 0.0).all()):
            raise ConfigurationError(f'table: scale is {self.scale}, must be above 0')
        self.usable = (np.isfinite(self.features).all(axis=1)
                       & np.isfinite(self.inverse).all(axis=(1, 2))
                       & (self.condition <= WORST_CONDITION))
        if not self.usable.any():
            raise ConfigurationError(f'table: none of its {count} entries is usable')
        self._index = np.flatnonzero(self.usable)
        self._tree = scipy.spatial.cKDTree(self.features[self._index] / self.scale)
        self._last: np.ndarray | None = None

    def nearest(self, features: np.ndarray) -> np.ndarray:
        """
        Return J^-1 (3, 3) of the entry with the nearest features (3,).

        Beyond the stop radius, or for features that are not finite, it is that of the last match,
        or before any match that of the nearest or first entry.
        """
        place = 0
        if np.isfinite(features).all():
            distance, place = self._tree.query(features / self.scale)
            if distance**2 <= self.stop:
                self._last = self.inverse[self._index[place]]
        return self.inverse[self._index[place]] if self._last is None else self._last

    def save(self, path: str | os.PathLike) -> None:
        """Write the table to a file for `load_table`."""
        with open(path, 'wb') as file:
            np.savez(file, format=FORMAT, kind=self.kind.value, stop=self.stop,
                     stiffness=self.stiffness, **{name: getattr(self, name) for name in _ARRAYS})


def load_table(path: str | os.PathLike) -> JacobianTable:
    """
    Read a table from a file.

    ConfigurationError if it cannot be read, is no table of this format, or has no usable entry.
    """
    found = read_arrays(path, ('format',))['format'].tolist()
    if found != FORMAT:
        raise ConfigurationError(
            f'{path}: is a table of format {found!r:.20}, must be of {FORMAT}: build it again')
    arrays = read_arrays(path, (*_ARRAYS, 'kind', 'stop', 'stiffness'))
    try:
        return JacobianTable(
            FeatureKind(str(arrays['kind'])), stop=float(arrays['stop']),
            stiffness=float(arrays['stiffness']),
            **{name: np.array(arrays[name], dtype=float) for name in _ARRAYS})
    except (ValueError, TypeError) as error:
        raise ConfigurationError(f'{path}: is no table of Jacobians: {error}') from error


def grid(half_x: float, half_y: float, across: int, forces: Iterable[float]) -> np.ndarray:
    """Return contacts (N, 3), evenly spaced on the pad (Figure 6.8), for each force [N]."""
    shares = (np.arange(across) + 0.5) / across * 2.0 - 1.0
    return np.array([(half_x * x, half_y * y, p) for p in forces for y in shares for x in shares])


def build_table(features: Features, kind: FeatureKind, contacts: np.ndarray,
                increments: Increments, length: float) -> JacobianTable:
    """
    Compute Jacobians at contacts (N, 3), scaled for a `length` on the pad [m].

    The stop radius is the diagonal of the largest cell of the grid, so that contacts within the
    grid find an entry.
    """
    contacts = np.asarray(contacts, dtype=float)
    scale = scale_for(kind, REFERENCE, length, increments.stiffness)
    found = [least_squares(loading_cases(features, contact, increments), scale)
             for contact in contacts]
    shown = np.array([features(contact) for contact in contacts])
    gaps = [np.diff(np.unique(np.round(contacts[:, k], 9))).max(initial=unit)
            for k, unit in enumerate((0.0, 0.0, REFERENCE))]
    cell = np.array(gaps) / [length, length, REFERENCE]
    return JacobianTable(
        kind, contacts, shown, np.array([one.forward for one in found]),
        np.array([one.inverse for one in found]), np.array([one.condition for one in found]),
        scale.features, stop=float(cell @ cell), stiffness=increments.stiffness)
