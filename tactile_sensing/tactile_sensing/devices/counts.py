"""Range of the counts of a sensor, and which of them are measurements."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from tactile_common.config import bounded, check_fields
from tactile_common.errors import ConfigurationError

MAX_BITS = 16


@dataclass(frozen=True)
class Counts:
    """
    Range of an analogue-digital converter, and the part of it that is measured.

    A reading below `threshold` is only an upper bound. A reading of `saturation` or more is at
    full scale. A converter clips at its lowest count, so the threshold is at least one count
    higher. It is higher still if the sensor replaces small values by its lowest count or by zero.
    Raises a ConfigurationError if a value is out of bounds.
    """

    bits: int = bounded(8, low=1, high=MAX_BITS)
    signed: bool = False
    threshold: Any = None  # int: smallest count that is measured; None: lowest + 1
    saturation: Any = None  # int: smallest count that is at full scale; None: highest

    def __post_init__(self) -> None:
        check_fields(self)
        full = self.highest + (self.bits == 1)  # with one bit, both counts are measurements
        for name, default in (('threshold', self.lowest + 1), ('saturation', full)):
            value = getattr(self, name)
            if value is None:
                object.__setattr__(self, name, default)
            elif type(value) is not int or not self.lowest < value <= self.highest + 1:
                raise ConfigurationError(
                    f'{name} is {value!r}, must be an integer from {self.lowest + 1} to '
                    f'{self.highest + 1}')

    @property
    def lowest(self) -> int:
        """Smallest count of the converter."""
        return -(1 << self.bits - 1) if self.signed else 0

    @property
    def highest(self) -> int:
        """Largest count of the converter."""
        return (1 << self.bits - self.signed) - 1

    @property
    def dtype(self) -> np.dtype:
        """Smallest integer type for the counts."""
        return np.dtype(('i' if self.signed else 'u') + ('1' if self.bits <= 8 else '2'))

    def outside(self, readings: np.ndarray) -> np.ndarray:
        """Return which readings, after rounding, the converter cannot send; False for NaN."""
        return (readings < self.lowest - 0.5) | (readings > self.highest + 0.5)
