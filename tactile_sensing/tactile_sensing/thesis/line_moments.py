"""Line contact from moments: the closed forms of the thesis (3.3.4)."""

from dataclasses import dataclass

import numpy as np

from tactile_sensing.types.moments import Moments


@dataclass(frozen=True)
class MomentLine:
    """Line contact that was computed from moments."""

    a: float  # [m]
    yaw: float  # [rad]
    line_force: float  # [N/m]


def line_from_moments(moments: Moments, half_length: float) -> MomentLine:
    """
    Compute a line contact from the moments of a strip, (3.8) to (3.10).

    Equation (3.9) is corrected: tan(2 alpha) = -2 Mxy / (Mxx - Myy - b^2 M0). In print, the
    factor 2 is missing, and the last term is 3 b^2 M0. The result still has a bias of about
    3 d^2 / L^2.

    Parameters
    ----------
    moments : Moments
        m0 must be positive.
    half_length : float
        Half the size of the array along y, the thesis' L [m].
    """
    b = moments.mx / moments.m0
    alpha = 0.5 * np.arctan2(2.0 * moments.mxy, moments.myy - moments.mxx + b**2 * moments.m0)
    line_force = moments.m0 * np.cos(alpha) / (2.0 * half_length)
    # The thesis turns +y towards +x, a left-handed rotation about +z; yaw is right-handed.
    return MomentLine(a=b, yaw=-alpha, line_force=line_force)
