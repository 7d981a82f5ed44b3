"""Joint trajectories as a joint_trajectory_controller takes them, and short ones to a stop."""

from dataclasses import dataclass

import numpy as np

from tactile_common.errors import ConfigurationError
from tactile_common.kernels import njit
from tactile_servo.motion.limits import JointLimits

MIN_STOP = 0.01  # s, so that the times of a window at rest still increase


@dataclass(frozen=True, eq=False)
class Trajectory:
    """
    Points of a joint trajectory; the shapes are checked, what they hold is the receiver's affair.

    Raises ConfigurationError where an array has another shape.
    """

    joint_names: tuple[str, ...]  # n, the order of the columns
    times: np.ndarray  # (K,) after the start [s]
    positions: np.ndarray  # (K, n) [rad or m]
    velocities: np.ndarray | None = None  # (K, n) [rad/s or m/s]
    accelerations: np.ndarray | None = None  # (K, n) [rad/s^2 or m/s^2]
    stamp: float = 0.0  # of the start [s]; 0 means as soon as it is received

    def __post_init__(self):
        shape = len(self.times), len(self.joint_names)
        for name in ('positions', 'velocities', 'accelerations'):
            values = getattr(self, name)
            if values is not None and values.shape != shape:
                raise ConfigurationError(
                    f'{name}: shape {values.shape}, must be (points, joints) = {shape}')


def stopping_window(limits: JointLimits, positions: np.ndarray, velocities: np.ndarray,
                    lookahead: float) -> Trajectory:
    """
    Trajectory through the commanded state and then to a stop within the limits.

    A controller that hears nothing more brings the robot to rest by itself: all joints brake
    evenly over the time that the slowest of them needs, so none brakes harder than it may,
    and `limit_velocities` has left room for it.

    The commanded state, positions (n,) [rad] and velocities (n,) [rad/s], is reached after the
    lookahead [s]. Three points, the last at rest; stamp 0, that is from now.
    """
    return Trajectory(
        limits.names, *_braking(limits.acceleration, positions, velocities, lookahead))


@njit(cache=True)
def _braking(acceleration, positions, velocities, lookahead):
    """Times (3,), positions and velocities (3, n) of the way to a stop."""
    stop = MIN_STOP
    for k in range(len(velocities)):
        stop = max(stop, abs(velocities[k]) / acceleration[k])
    times, places = np.empty(3), np.empty((3, len(positions)))
    speeds = np.empty_like(places)
    for i in range(3):
        share = 0.5 * i  # of the time to the stop; the speed falls evenly with it
        times[i] = lookahead + share * stop
        for k in range(len(positions)):
            speeds[i, k] = (1.0 - share) * velocities[k]
            places[i, k] = positions[k] + share * (1.0 - 0.5 * share) * stop * velocities[k]
    return times, places, speeds
