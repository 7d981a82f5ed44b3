"""Features of a tactile image: its moments (6.6), or its force and centroid."""
from dataclasses import dataclass, field
from enum import Enum

import numpy as np

from tactile_common.errors import ConfigurationError
from tactile_sensing.half_space.forward_model import ForwardModel
from tactile_sensing.types.array import TactelArray

REFERENCE = 5.0  # N, at which the sensitivity of a model is taken


class FeatureKind(Enum):
    """Which three numbers stand for an image."""

    MOMENTS = 'moments'  # M0 [N], Mx, My [N m]: the thesis'
    CENTROID = 'centroid'  # M0 [N], Mx / M0, My / M0 [m]


def features_of(pressure: np.ndarray, array: TactelArray, kind: FeatureKind) -> np.ndarray:
    """
    Features (3,) of a pressure image (rows, columns) [Pa] without NaN, see `filled`.

    The centroid of an image without force is NaN.
    """
    area = array.pitch_x * array.pitch_y
    by_column, by_row = area * pressure.sum(axis=0), area * pressure.sum(axis=1)
    m0, mx, my = by_column.sum(), by_column @ array.x, by_row @ array.y
    if kind is FeatureKind.CENTROID:
        mx, my = (mx / m0, my / m0) if m0 > 0.0 else (np.nan, np.nan)
    return np.array([m0, mx, my])


def features_jacobian(pressure: np.ndarray, derivatives: np.ndarray, array: TactelArray,
                      kind: FeatureKind) -> np.ndarray:
    """Derivatives (3, K) of the features, of those (rows, columns, K) of the image."""
    area = array.pitch_x * array.pitch_y
    moments = area * np.stack([derivatives.sum(axis=(0, 1)),
                               np.tensordot(array.x, derivatives.sum(axis=0), 1),
                               np.tensordot(array.y, derivatives.sum(axis=1), 1)])
    if kind is FeatureKind.CENTROID:
        m0, x, y = features_of(pressure, array, kind)
        moments[1:] = (moments[1:] - np.outer([x, y], moments[0])) / m0
    return moments


def filled(pressure: np.ndarray, most: float) -> np.ndarray | None:
    """
    Image whose NaN are the mean of the tactels around them; None if too many are NaN.

    A tactel that counted as zero would pull the centroid away from itself. `most` is the largest
    share of the tactels that may be NaN; one among NaN alone is 0.
    """
    missing = ~np.isfinite(pressure)
    if not missing.any():
        return np.asarray(pressure, dtype=float)
    if missing.mean() > most:
        return None
    known = np.pad(np.where(missing, 0.0, pressure), 1)
    counts = np.pad((~missing).astype(float), 1)
    rows, columns = pressure.shape
    total, count = np.zeros(pressure.shape), np.zeros(pressure.shape)
    for r in range(3):
        for c in range(3):
            total += known[r:r + rows, c:c + columns]
            count += counts[r:r + rows, c:c + columns]
    return np.where(missing, total / np.maximum(count, 1.0), known[1:-1, 1:-1])


@dataclass(frozen=True, eq=False)
class ModelFeatures:
    """
    Features of what a model shows of a contact (x, y, p): place on the pad [m], force [N].

    A sensor is calibrated by the force on it: the model's image is scaled so that M0 is the
    force at the pad's centre.
    """

    model: ForwardModel  # of a, b, normal force and shear, as those of the dome
    array: TactelArray
    kind: FeatureKind = FeatureKind.CENTROID
    sensitivity: float = field(init=False)

    def __post_init__(self):
        image = self.model.image(_state((0.0, 0.0, REFERENCE)))[0]
        m0 = features_of(image, self.array, FeatureKind.MOMENTS)[0]
        if not m0 > 0.0:
            raise ConfigurationError(f'model: {REFERENCE:g} N at the centre give M0 = {m0:g} N')
        object.__setattr__(self, 'sensitivity', m0 / REFERENCE)

    def __call__(self, contact: np.ndarray, shear: tuple[float, float] = (0.0, 0.0)
                 ) -> np.ndarray:
        """Features (3,) of a contact (3,) and a shear force on the skin [N]."""
        image = self.model.image(_state(contact, shear))[0] / self.sensitivity
        return features_of(image, self.array, self.kind)

    def jacobian(self, contact: np.ndarray) -> np.ndarray:
        """Derivatives (3, 3) of the features by x, y [1/m] and p [1/N], those of the model."""
        state = _state(contact)
        image, derivatives = self.model.image(state)[0], self.model.jacobian(state)[0, ..., :3]
        return features_jacobian(image / self.sensitivity, derivatives / self.sensitivity,
                                 self.array, self.kind)


def _state(contact, shear=(0.0, 0.0)):
    return np.array([*contact, *shear])
