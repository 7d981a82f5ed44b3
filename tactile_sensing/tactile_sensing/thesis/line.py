"""
Line contact on an elastic half-space: pressure, geometry and moments (chapter 3).

A line has rho, its signed distance from the origin along its normal [m]; yaw, right-handed about
+z, 0 along +y [rad]; and forces per length [N/m]. Depth is that of the tactels [m]. Compression
is positive, as in the published images: pressure = -sigma_zz.
"""

from dataclasses import dataclass

import numpy as np

from tactile_sensing.types.moments import Moments


def pressure(x: np.ndarray, y: np.ndarray, rho: float, yaw: float, line_force: float,
             depth: float, line_shear: float = 0.0) -> np.ndarray:
    """
    Return the pressure under an infinite line load [Pa] at places x, y [m], which broadcast.

    Equation (3.1), extended by the shear across the line (Flamant):
    (2 / pi) d^2 (P d + Q v) / (v^2 + d^2)^2, where v is the distance along the normal
    (cos yaw, sin yaw) and Q the shear of the object on the skin along this normal. Shear along
    the line adds no pressure.
    """
    v = x * np.cos(yaw) + y * np.sin(yaw) - rho
    return 2.0 / np.pi * depth**2 * (line_force * depth + line_shear * v) / (v**2 + depth**2)**2


def peak_pressure(line_force: float, depth: float) -> float:
    """Return the pressure directly under a line load [Pa], equation (3.1) at v = 0."""
    return 2.0 * line_force / (np.pi * depth)


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
