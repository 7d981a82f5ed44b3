"""Features of a tactile image: its moments (6.6), or its force and centroid."""
from dataclasses import dataclass, field
from enum import Enum
from typing import Protocol

import numpy as np

from tactile_common.errors import ConfigurationError
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


class ProbeModel(Protocol):
    """What a probe shows of a load, as `HalfSpaceDome` and `FiniteElementDome` say it."""

    def image(self, state: np.ndarray) -> np.ndarray:
        """Pressure (1, rows, columns) [Pa] of a state: a, b, normal force and shear (5,)."""
        ...


@dataclass(frozen=True, eq=False)
class ModelFeatures:
    """
    Features of what a model shows of a contact (x, y, p): place on the pad [m], force [N].

    A sensor is calibrated by the force on it: the model's image is scaled so that M0 is the
    force at the pad's centre.
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
        """Features (3,) of a contact (3,) and a shear force on the skin [N]."""
        image = self.model.image(np.array([*contact, *shear]))[0] / self.sensitivity
        return features_of(image, self.array, self.kind)
