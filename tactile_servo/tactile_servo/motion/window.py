"""Short trajectories that always end at rest, for streaming to a trajectory controller."""

import numpy as np

from tactile_common.kernels import njit
from tactile_servo.motion.limits import JointLimits
from tactile_servo.motion.trajectory import Trajectory

MIN_STOP = 0.01  # s, so that the times of a window at rest still increase


def stopping_window(limits: JointLimits, positions: np.ndarray, velocities: np.ndarray,
                    lookahead: float) -> Trajectory:
    """
    Trajectory through the commanded state and then to a stop within the limits.

    A controller that hears nothing more brings the robot to rest by itself: all joints brake
    evenly over the time that the slowest of them needs, so none brakes harder than it may,
    and `limit_velocities` has left room for it.

    Parameters
    ----------
    limits : JointLimits
    positions, velocities : ndarray, shape (n,)
        Commanded state [rad, rad/s].
    lookahead : float
        When the commanded state is to be reached, from now [s].

    Returns
    -------
    Trajectory
        Three points, the last at rest; stamp 0, that is from now.
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
