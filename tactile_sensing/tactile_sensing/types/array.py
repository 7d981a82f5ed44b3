"""Geometry of a rectangular tactile array."""
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from tactile_common.config import checked

PITCH = (1e-6, 0.1)  # m
MAX_SIDE = 1024  # rows or columns


@dataclass(frozen=True)
class TactelArray:
    """
    Rectangular array of tactels, centred on the origin of the sensor frame.

    Its images have the shape `(rows, columns)`; x increases with the column, y with the row.
    Raises a ConfigurationError if a size or a pitch is out of bounds.
    """

    rows: int  # tactels along y
    columns: int  # tactels along x
    pitch_x: float  # distance between columns [m]
    pitch_y: float  # distance between rows [m]

    def __post_init__(self) -> None:
        for name in ('rows', 'columns'):
            checked(name, getattr(self, name), int, {'range': (1, MAX_SIDE)})
        for name in ('pitch_x', 'pitch_y'):
            checked(name, getattr(self, name), float, {'range': PITCH, 'unit': 'm'})

    @property
    def shape(self) -> tuple[int, int]:
        """Shape of an image, `(rows, columns)`."""
        return self.rows, self.columns

    @cached_property
    def x(self) -> np.ndarray:
        """Centres of the columns [m], shape `(columns,)`, read-only."""
        return _centres(self.columns, self.pitch_x)

    @cached_property
    def y(self) -> np.ndarray:
        """Centres of the rows [m], shape `(rows,)`, read-only."""
        return _centres(self.rows, self.pitch_y)

    @property
    def size_x(self) -> float:
        """Extent along x, outer borders of the tactels included [m]."""
        return self.columns * self.pitch_x

    @property
    def size_y(self) -> float:
        """Extent along y, outer borders of the tactels included [m]."""
        return self.rows * self.pitch_y

    @property
    def half_width_x(self) -> float:
        """Half of `size_x` [m]."""
        return 0.5 * self.size_x

    @property
    def half_width_y(self) -> float:
        """Half of `size_y` [m]."""
        return 0.5 * self.size_y


def _centres(count: int, pitch: float) -> np.ndarray:
    centres = (np.arange(count) - 0.5 * (count - 1)) * pitch
    centres.flags.writeable = False
    return centres
