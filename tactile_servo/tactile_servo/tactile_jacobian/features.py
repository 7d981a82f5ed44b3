"""Features of a tactile image: its moments (6.6), or its force and centroid."""
from dataclasses import dataclass, field
from enum import Enum
from typing import Protocol

import numpy as np

from tactile_common.errors import ConfigurationError
from tactile_sensing.types.array import TactelArray

REFERENCE = 5.0  # force at which the sensitivity of a model is determined [N]


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
    from scipy.ndimage import convolve  # most sensors never need it
    known = np.where(missing, 0.0, pressure)
    total, count = (convolve(values, np.ones((3, 3)), mode='constant')
                    for values in (known, (~missing).astype(float)))
    return np.where(missing, total / np.maximum(count, 1.0), known)


class ProbeModel(Protocol):
    """Model of a probe's image, for instance `HalfSpaceDome` or `FiniteElementDome`."""

    def image(self, state: np.ndarray) -> np.ndarray:
        """Return the pressure (1, rows, columns) [Pa] for a, b, normal force and shear (5,)."""
        ...


@dataclass(frozen=True, eq=False)
class ModelFeatures:
    """
    Features of a model's image for a contact (x, y, p): place on the pad [m] and force [N].

    Sensors are calibrated by the force on them. Therefore the model's image is scaled so that M0
    equals the force at the pad's centre.
    """

    model: ProbeModel
    array: TactelArray
    kind: FeatureKind = FeatureKind.CENTROID
    sensitivity: float = field(init=False)

    def __post_init__(self) -> None:
        image = self.model.image(np.array([0.0, 0.0, REFERENCE, 0.0, 0.0]))[0]
        m0 = features_of(image, self.array, FeatureKind.MOMENTS)[0]
        if not m0 > 0.0:
            raise ConfigurationError(f'model: {REFERENCE:g} N at the centre give M0 = {m0:g} N')
        object.__setattr__(self, 'sensitivity', m0 / REFERENCE)

    def __call__(self, contact: np.ndarray, shear: tuple[float, float] = (0.0, 0.0)
                 ) -> np.ndarray:
        """Return the features (3,) for a contact (3,) and a shear force on the skin [N]."""
        image = self.model.image(np.array([*contact, *shear]))[0] / self.sensitivity
        return features_of(image, self.array, self.kind)
