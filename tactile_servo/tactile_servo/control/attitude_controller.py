"""Rotation of a pad to the attitude of the edge or surface that it follows."""

import math

import numpy as np

# Share of the joints' acceleration for a change of the rate. A wrist that is asked for more than
# it can holds back the whole pad, off its edge or surface.
TURNING = 0.6
LATE_SHARE = 0.2  # share of a wanted change of the rate; a cycle that allows less is late


class AttitudeController:
    """
    Proportional control of an attitude with bounded rate and acceleration.

    An error is corrected at the rate `gain` [1/s], with at most `max_rate` [rad/s]. `late` is True
    if a cycle allows less than `LATE_SHARE` of the wanted change of the rate.
    """

    def __init__(self, gain: float, max_rate: float):
        self._gain, self._max_rate = gain, max_rate
        self.reset()

    def reset(self) -> None:
        """Set the rate to 0."""
        self._rate, self.late = np.zeros(3), False

    def rate(self, error: np.ndarray, ahead: np.ndarray, dt: float,
             acceleration: float) -> np.ndarray:
        """
        Compute the angular velocity (3,) [rad/s] for an error, a rotation vector (3,) [rad].

        The correction is added to `ahead` (3,) [rad/s], the rate at which the edge or surface
        turns. `acceleration` [rad/s^2] bounds its change in a cycle of `dt` [s].
        """
        step = self._step(error, ahead)
        share = acceleration * dt / max(_size(step), 1e-12)
        self.late = share < LATE_SHARE
        self._rate = self._rate + step * min(1.0, share)
        return self._rate

    def way(self, error: np.ndarray, ahead: np.ndarray) -> np.ndarray:
        """Return the axis (3,), a unit vector, of the change of rate for the same arguments."""
        step = self._step(error, ahead)
        return step / max(_size(step), 1e-12)

    def _step(self, error: np.ndarray, ahead: np.ndarray) -> np.ndarray:
        wanted = ahead + self._gain * error
        return wanted * min(1.0, self._max_rate / max(_size(wanted), 1e-12)) - self._rate


def _size(vector: np.ndarray) -> float:
    return math.sqrt(vector @ vector)


def off_edge(rotation: np.ndarray, way: tuple[float, float], slope: float, direction: int,
             max_turn: float) -> np.ndarray:
    """
    Compute the rotation vector (3,) that aligns a pad with an edge, perpendicular to it [rad].

    The commanded pad has a `rotation` (3, 3) in the plane, with its y along the edge or, if
    `direction` is -1, against it. `way` is the edge's direction, a unit vector x, y, and `slope`
    its rise per length. Beyond a yaw of `max_turn` [rad] the pad does not turn further.
    """
    ux, uy = way
    heading = math.atan2(direction * rotation[1, 1], direction * rotation[0, 1])
    turn = math.remainder(math.atan2(uy, ux) - heading, math.tau)
    yaw = math.atan2(rotation[1, 0], rotation[0, 0])
    if abs(yaw) > max_turn and turn * yaw > 0.0:
        turn = 0.0
    # The pad's normal n is made perpendicular to the edge's direction t and to the direction s
    # across it: the rotation -(n t) n x t changes n by -(n t) t.
    nx, ny, nz = rotation[:3, 2].tolist()
    tilt = (nx * ux + ny * uy + nz * slope) / (1.0 + slope**2)
    lean = ny * ux - nx * uy
    return np.array([-tilt * (ny * slope - nz * uy) + lean * nz * ux,
                     -tilt * (nz * ux - nx * slope) + lean * nz * uy,
                     turn - tilt * (nx * uy - ny * ux) - lean * (nx * ux + ny * uy)])
