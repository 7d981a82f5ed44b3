"""Turning a pad along an edge and square to it."""

from dataclasses import dataclass
import math

import numpy as np

from tactile_common.config import bounded
from tactile_common.geometry import wrap_angle
from tactile_servo.control.scaling import clipped, slewed


@dataclass(frozen=True)
class AttitudeConfig:
    """Gains and bounds of the pad's rotation."""

    gain: float = bounded(
        5.0, 'rate at which the pad is turned along the edge', '1/s', 0.0, 50.0)
    max_rate: float = bounded(
        1.5, 'largest rate of turn', 'rad/s', 0.0, 20.0)
    acceleration: float = bounded(
        5.0, 'acceleration of that turn; a wrist that is asked for more than it can holds '
        'back the whole pad, off the edge at every corner', 'rad/s^2', 0.1, 1000.0)
    max_turn: float = bounded(
        7.0, 'the pad is turned with the edge up to this angle from where it began, and '
        'kept beyond', 'rad', 0.0, 100.0)


class AttitudeController:
    """
    Proportional control of the pad's attitude in a plane's frame.

    Parameters
    ----------
    config : AttitudeConfig
    """

    def __init__(self, config: AttitudeConfig):
        self._config, self._rate = config, 0.0

    def reset(self) -> None:
        """Forget the rate of turn, at a standstill."""
        self._rate = 0.0

    def rate(self, rotation: np.ndarray, way: tuple[float, float], slope: float,
             direction: int, dt: float) -> tuple[float, float, float]:
        """
        Angular velocity x, y, z in the plane's frame [rad/s].

        Parameters
        ----------
        rotation : ndarray, shape (3, 3)
            Of the commanded pad in the plane.
        way : tuple of float
            Unit vector x, y in which the edge runs.
        slope : float
            Its rise along itself.
        direction : int
            +1 or -1, of the pad's y along the edge.
        dt : float
            [s]
        """
        c, (ux, uy) = self._config, way
        (xx, yx, nx), (xy, yy, ny), (_, _, nz) = rotation.tolist()
        heading = math.atan2(direction * yy, direction * yx)
        wanted = c.gain * wrap_angle(math.atan2(uy, ux) - heading)
        wanted = clipped(wanted, -c.max_rate, c.max_rate)
        yaw = math.atan2(xy, xx)
        if abs(yaw) > c.max_turn and wanted * yaw > 0.0:
            wanted = 0.0
        self._rate = slewed(self._rate, wanted, c.acceleration * dt)
        # The pad's normal n is brought square to the edge, t, and to what lies across it, s:
        # n turns by -(n t) t with the rate of turn -(n t) n x t.
        tilt = (nx * ux + ny * uy + nz * slope) / (1.0 + slope**2)
        lean = ny * ux - nx * uy
        x, y, z = (clipped(-c.gain * error, -c.max_rate, c.max_rate) for error in (
            tilt * (ny * slope - nz * uy) - lean * nz * ux,
            tilt * (nz * ux - nx * slope) - lean * nz * uy,
            tilt * (nx * uy - ny * ux) + lean * (nx * ux + ny * uy)))
        return x, y, z + self._rate
