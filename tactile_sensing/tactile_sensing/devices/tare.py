"""Tare: the image of the unloaded pad."""
from dataclasses import dataclass

import numpy as np

from tactile_common.errors import TactileError

# With fewer frames, neither the noise nor steadiness can be determined.
MIN_TARE_FRAMES = 20


class TareRefusedError(TactileError):
    """The frames do not show an unloaded pad; the message says why."""


@dataclass(frozen=True, eq=False)
class Tare:
    """Image of the unloaded pad."""

    offset: np.ndarray  # mean counts, shape (rows, columns), float32
    noise: np.ndarray  # standard deviation of every tactel [counts], float32
    live: np.ndarray  # whether a tactel is used, bool

    @property
    def noise_std(self) -> float:
        """RMS noise of the used tactels [counts]."""
        return float(np.sqrt(np.mean(np.square(self.noise[self.live]))))
