"""The skin, and the depth of the tactels in it."""

from dataclasses import dataclass
import math

import numpy as np

from tactile_common.errors import ConfigurationError


@dataclass(frozen=True)
class Skin:
    """
    Elastic layer on a rigid backing, with tactels at a depth.

    Raises a ConfigurationError if a value is out of bounds.
    """

    depth: float  # of the tactels below the surface [m]
    thickness: float = math.inf  # of the layer [m], at least `depth`; infinite: a half-space
    poisson: float = 0.5  # Poisson's ratio, 0 to 0.5; no effect in a half-space

    def __post_init__(self) -> None:
        for name in ('depth', 'thickness', 'poisson'):
            value = getattr(self, name)
            if not isinstance(value, (int, float, np.floating)) or isinstance(value, bool):
                raise ConfigurationError(f'{name} is {value!r}, must be a number')
        if not 0.0 < self.depth < math.inf:
            raise ConfigurationError(f'depth is {self.depth!r}, must be positive [m]')
        if not self.thickness >= self.depth:
            raise ConfigurationError(f'thickness is {self.thickness!r}, must be at least the '
                                     f'depth of the tactels, {self.depth!r} m')
        if not 0.0 <= self.poisson <= 0.5:
            raise ConfigurationError(f'poisson is {self.poisson!r}, must be from 0 to 0.5')

    @property
    def is_half_space(self) -> bool:
        """Whether the skin has no backing."""
        return self.thickness == math.inf
