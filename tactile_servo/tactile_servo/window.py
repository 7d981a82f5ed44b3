"""Short trajectories that always end at rest, for streaming to a trajectory controller."""

import numpy as np

from tactile_servo.trajectory import Trajectory

MIN_STOP = 0.01  # s, so that the times of a window at rest still increase


def stopping_window(limits, positions, velocities, lookahead):
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
    stop = max(limits.stop_time(velocities), MIN_STOP)
    times = lookahead + stop * np.array([0.0, 0.5, 1.0])
    way = np.outer([0.0, 0.375, 0.5], velocities) * stop
    return Trajectory(limits.names, times, positions + way, np.outer([1.0, 0.5, 0.0], velocities))
