"""Turning a pad along an edge and square to it."""

from dataclasses import dataclass
import math

import numpy as np

from tactile_common.config import bounded
from tactile_common.geometry import wrap_angle
from tactile_common.kernels import njit


@dataclass(frozen=True)
class AttitudeConfig:
    """Gains and bounds of the pad's rotation."""

    gain: float = bounded(
        5.0, 'rate at which the pad is turned along the edge', '1/s', 0.0, 50.0, live=True)
    max_rate: float = bounded(1.5, 'largest rate of turn', 'rad/s', 0.0, 20.0)
    acceleration: float = bounded(
        5.0, 'acceleration of that turn; a wrist that is asked for more than it can holds '
        'back the whole pad, off the edge at every corner', 'rad/s^2', 0.1, 1000.0)
    max_turn: float = bounded(
        7.0, 'the pad is turned with the edge up to this angle from where it began, and '
        'kept beyond', 'rad', 0.0, 100.0)


class AttitudeController:
    """Proportional control of the pad's attitude in a plane's frame."""

    def __init__(self, config: AttitudeConfig):
        self.config, self._rate = config, 0.0

    def reset(self) -> None:
        """Forget the rate of turn, at a standstill."""
        self._rate = 0.0

    def rate(self, rotation: np.ndarray, way: tuple[float, float], slope: float,
             direction: int, dt: float) -> tuple[float, float, float]:
        """
        Angular velocity x, y, z in the plane's frame [rad/s].

        Parameters
        ----------
        rotation : ndarray, shape (3, 3) or more
            Of the commanded pad in the plane.
        way, slope : tuple of float, float
            Unit vector x, y in which the edge runs, and its rise along itself.
        direction : int
            +1 or -1, of the pad's y along the edge.
        dt : float, s
        """
        c = self.config
        self._rate, x, y, z = _rates(
            rotation, *way, slope, direction, self._rate, c.gain, c.max_rate, c.max_turn,
            c.acceleration * dt)
        return x, y, z


@njit(cache=True)
def _rates(rotation, ux, uy, slope, direction, rate, gain, most, max_turn, change):
    """Rate of turn along the edge, and angular velocity x, y, z."""
    heading = math.atan2(direction * rotation[1, 1], direction * rotation[0, 1])
    wanted = gain * wrap_angle(math.atan2(uy, ux) - heading)
    wanted = min(max(wanted, -most), most)
    yaw = math.atan2(rotation[1, 0], rotation[0, 0])
    if abs(yaw) > max_turn and wanted * yaw > 0.0:
        wanted = 0.0
    rate += min(max(wanted - rate, -change), change)
    # The pad's normal n is brought square to the edge, t, and to what lies across it, s:
    # n turns by -(n t) t with the rate of turn -(n t) n x t.
    nx, ny, nz = rotation[0, 2], rotation[1, 2], rotation[2, 2]
    tilt = (nx * ux + ny * uy + nz * slope) / (1.0 + slope**2)
    lean = ny * ux - nx * uy
    x = tilt * (ny * slope - nz * uy) - lean * nz * ux
    y = tilt * (nz * ux - nx * slope) - lean * nz * uy
    z = tilt * (nx * uy - ny * ux) + lean * (nx * ux + ny * uy)
    return (rate, min(max(-gain * x, -most), most), min(max(-gain * y, -most), most),
            min(max(-gain * z, -most), most) + rate)
