"""Angles; every function is for kernels and for Python, for numbers and for arrays."""
from typing import Any

import numpy as np

from tactile_common.kernels import njit


@njit(cache=True)
def wrap_angle(angle: Any) -> Any:
    """Return an angle, or angles, less the whole turns in it: within half a turn [rad]."""
    return np.arctan2(np.sin(angle), np.cos(angle))
