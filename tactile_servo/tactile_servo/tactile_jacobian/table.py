"""Table of tactile Jacobians, searched by features (6.4.2, 6.5)."""
from collections.abc import Iterable
from dataclasses import dataclass, field
import os

import numpy as np

from tactile_common.errors import ConfigurationError
from tactile_common.npz_stream import read_arrays
from tactile_servo.tactile_jacobian.features import FeatureKind
from tactile_servo.tactile_jacobian.jacobian import (
    Features,
    Increments,
    least_squares,
    loading_cases,
    scale_for,
)

FORMAT = 1
WORST_CONDITION = 50.0  # largest condition number of a Jacobian that is used
_ARRAYS = ('contacts', 'features', 'forward', 'inverse', 'condition', 'scale')


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
    usable: np.ndarray = field(init=False)  # (N,), True for finite, well-conditioned entries

    def __post_init__(self) -> None:
        count = len(self.contacts)
        for name, shape in (('contacts', (count, 3)), ('features', (count, 3)),
                            ('forward', (count, 3, 3)), ('inverse', (count, 3, 3)),
                            ('condition', (count,)), ('scale', (3,))):
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
        from scipy.spatial import cKDTree  # needs 35 MB, and is used only here
        self._index = np.flatnonzero(self.usable)
        self._tree = cKDTree(self.features[self._index] / self.scale)
        self._last: np.ndarray | None = None

    def nearest(self, features: np.ndarray) -> np.ndarray:
        """
        Return J^-1 (3, 3) of the entry with the nearest features (3,).

        Beyond the stop radius, or for features that are not finite, it is that of the last match.
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
                     **{name: getattr(self, name) for name in _ARRAYS})


def load_table(path: str | os.PathLike) -> JacobianTable:
    """
    Read a table from a file.

    ConfigurationError if it cannot be read, is no table of this format, or has no usable entry.
    """
    arrays = read_arrays(path, (*_ARRAYS, 'format', 'kind', 'stop'))
    if arrays['format'].tolist() != FORMAT:
        raise ConfigurationError(f'{path}: is not a table of format {FORMAT}')
    try:
        return JacobianTable(
            FeatureKind(str(arrays['kind'])), stop=float(arrays['stop']),
            **{name: np.array(arrays[name], dtype=float) for name in _ARRAYS})
    except (ValueError, TypeError) as error:
        raise ConfigurationError(f'{path}: is no table of Jacobians: {error}') from error


def grid(half_x: float, half_y: float, across: int, forces: Iterable[float]) -> np.ndarray:
    """Return contacts (N, 3), evenly spaced on the pad (Figure 6.8), for each force [N]."""
    shares = (np.arange(across) + 0.5) / across * 2.0 - 1.0
    return np.array([(half_x * x, half_y * y, p) for p in forces for y in shares for x in shares])


def build_table(features: Features, kind: FeatureKind, contacts: np.ndarray,
                increments: Increments, length: float, force: float = 5.0) -> JacobianTable:
    """
    Compute Jacobians at contacts (N, 3), scaled for a `length` on the pad [m] and a `force` [N].

    The stop radius is the diagonal of the largest cell of the grid, so that contacts within the
    grid find an entry.
    """
    contacts = np.asarray(contacts, dtype=float)
    scale = scale_for(kind, force, length, increments.stiffness)
    found = [least_squares(loading_cases(features, contact, increments), scale)
             for contact in contacts]
    shown = np.array([features(contact) for contact in contacts])
    gaps = np.array([np.diff(np.unique(np.round(contacts[:, k], 9))).max(initial=unit)
                     for k, unit in enumerate((0.0, 0.0, force))]) / [length, length, force]
    return JacobianTable(
        kind, contacts, shown, np.array([one.forward for one in found]),
        np.array([one.inverse for one in found]), np.array([one.condition for one in found]),
        scale.features, stop=float(gaps @ gaps))
