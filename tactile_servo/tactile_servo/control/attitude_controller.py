"""Turning a pad to what it follows."""

from dataclasses import dataclass
import math

import numpy as np


@dataclass(frozen=True)
class AttitudeGains:
    """Gain and bounds of a rotation."""

    gain: float  # rate at which an error is made up [1/s]
    max_rate: float  # rad/s
    acceleration: float  # rad/s^2


class AttitudeController:
    """
    Proportional control of an attitude, of bounded rate and acceleration.

    Attributes
    ----------
    late : bool
        Whether the rate is far from the wanted one.
    """

    def __init__(self, gains: AttitudeGains):
        self.gains = gains
        self.reset()

    def reset(self) -> None:
        """Stand still."""
        self._rate, self.late = np.zeros(3), False

    def rate(self, error: np.ndarray, ahead: np.ndarray, dt: float,
             acceleration: float = math.inf) -> np.ndarray:
        """
        Angular velocity (3,) [rad/s] by the rotation vector (3,) [rad] that is missing.

        It is added to the rate `ahead` (3,) [rad/s], with which what is followed turns. The
        robot's own `acceleration` [rad/s^2] bounds its change as well.
        """
        step = self._step(error, ahead)
        share = min(self.gains.acceleration, acceleration) * dt / max(_size(step), 1e-12)
        self.late = share < 0.2  # of the change that is wanted, at once
        self._rate = self._rate + step * min(1.0, share)
        return self._rate

    def way(self, error: np.ndarray, ahead: np.ndarray) -> np.ndarray:
        """Unit vector (3,) about which the rate is to change, by the same."""
        step = self._step(error, ahead)
        return step / max(_size(step), 1e-12)

    def _step(self, error: np.ndarray, ahead: np.ndarray) -> np.ndarray:
        wanted = ahead + self.gains.gain * error
        most = self.gains.max_rate
        return wanted * min(1.0, most / max(_size(wanted), 1e-12)) - self._rate


def _size(vector: np.ndarray) -> float:
    return math.sqrt(vector @ vector)


def off_edge(rotation: np.ndarray, way: tuple[float, float], slope: float, direction: int,
             max_turn: float) -> np.ndarray:
    """
    Rotation vector (3,) that brings a pad along an edge and square to it [rad].

    Parameters
    ----------
    rotation : ndarray, shape (3, 3) or more
        Of the commanded pad in the plane.
    way, slope : tuple of float, float
        Unit vector x, y in which the edge runs, and its rise along itself.
    direction : int
        +1 or -1, of the pad's y along the edge.
    max_turn : float
        The pad is turned with the edge up to this angle [rad], and kept beyond.
    """
    ux, uy = way
    heading = math.atan2(direction * rotation[1, 1], direction * rotation[0, 1])
    turn = math.remainder(math.atan2(uy, ux) - heading, math.tau)
    yaw = math.atan2(rotation[1, 0], rotation[0, 0])
    if abs(yaw) > max_turn and turn * yaw > 0.0:
        turn = 0.0
    # The pad's normal n is brought square to the edge, t, and to what lies across it, s:
    # n turns by -(n t) t with the rate of turn -(n t) n x t.
    nx, ny, nz = rotation[:3, 2].tolist()
    tilt = (nx * ux + ny * uy + nz * slope) / (1.0 + slope**2)
    lean = ny * ux - nx * uy
    return np.array([-tilt * (ny * slope - nz * uy) + lean * nz * ux,
                     -tilt * (nz * ux - nx * slope) + lean * nz * uy,
                     turn - tilt * (nx * uy - ny * ux) - lean * (nx * ux + ny * uy)])
