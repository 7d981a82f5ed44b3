"""Angles; every function accepts numbers and arrays and can be called from kernels and Python."""
from typing import Any

import numpy as np

from tactile_common.kernels import njit


@njit(cache=True)
def wrap_angle(angle: Any) -> Any:
    """Wrap an angle, or an array of angles, to within half a turn [rad]."""
    return np.arctan2(np.sin(angle), np.cos(angle))
