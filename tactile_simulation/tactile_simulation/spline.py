"""Interpolation of joint trajectories as a joint_trajectory_controller does it."""

from bisect import bisect_right

import numpy as np

from tactile_common.kernels import njit


class Spline:
    """
    A trajectory as polynomials in time, from a state before its first point on.

    Quintic where position, velocity and acceleration are known at both ends of a segment,
    cubic where position and velocity are, else linear; beyond the end it stays at the last
    point. A first point that is not in the future is taken at once.

    Parameters
    ----------
    before : float
        Time of the state that the first point is approached from [s].
    state : ndarray (2 or 3, n)
        Position, velocity and, where known, acceleration at that time.
    start : float
        Time from which the trajectory's own times count [s].
    trajectory : Trajectory
    order : list of int, or slice
        Columns of the trajectory in the order of the joints.
    now : float
        Time of the first sample [s].

    """

    def __init__(self, before, state, start, trajectory, order, now):
        times = (start + np.asarray(trajectory.times, dtype=float)).tolist()
        rows = [trajectory.positions, trajectory.velocities, trajectory.accelerations]
        if rows[1] is None:
            rows = rows[:1]
        elif rows[2] is None:
            rows = rows[:2]
        self._points = np.empty((len(times), len(rows), len(state[0])))
        for i, row in enumerate(rows):
            self._points[:, i] = row[:, order]
        self._state, self._before = state, before
        self._knots = [min(before, now), *times]

    def sample(self, now):
        """Position, velocity and acceleration (3, n) at a time [s]."""
        points, knots = self._points, self._knots
        segment = max(bisect_right(knots, now) - 1, 0)
        if segment == len(points):
            end = np.zeros((3, points.shape[2]))
            end[:points.shape[1]] = points[-1]
            return end
        first = self._state if segment == 0 else points[segment - 1]
        since = self._before if segment == 0 else knots[segment]
        return _between(first, points[segment], knots[segment + 1] - since, now - since)


@njit(cache=True)
def _between(first, last, duration, t):
    """
    State (3, n) at a time t after a first state, on the way to a last one.

    `first` and `last` (1 to 3, n) are position, velocity, acceleration; what only one of them
    has is not used. `duration` and t [s].
    """
    known = min(len(first), len(last))
    between = np.empty((3, first.shape[1]))
    for j in range(first.shape[1]):
        step = last[0, j] - first[0, j]
        c1, c2, c3, c4, c5 = step / duration, 0.0, 0.0, 0.0, 0.0
        if known > 1:
            c1 = first[1, j]
            p, v = step - c1 * duration, (last[1, j] - c1) * duration
            if known == 2:
                c2 = (3.0 * p - v) / duration**2
                c3 = (v - 2.0 * p) / duration**3
            else:
                c2 = 0.5 * first[2, j]
                # What the first state leaves to be made up by the three highest powers.
                p -= c2 * duration**2
                v -= 2.0 * c2 * duration**2
                a = (last[2, j] - first[2, j]) * duration**2
                c3 = (10.0 * p - 4.0 * v + 0.5 * a) / duration**3
                c4 = (-15.0 * p + 7.0 * v - a) / duration**4
                c5 = (6.0 * p - 3.0 * v + 0.5 * a) / duration**5
        between[0, j] = first[0, j] + t * (c1 + t * (c2 + t * (c3 + t * (c4 + t * c5))))
        between[1, j] = c1 + t * (2.0 * c2 + t * (3.0 * c3 + t * (4.0 * c4 + t * 5.0 * c5)))
        between[2, j] = 2.0 * c2 + t * (6.0 * c3 + t * (12.0 * c4 + t * 20.0 * c5))
    return between
