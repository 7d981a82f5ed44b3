"""Interpolation of joint trajectories as a joint_trajectory_controller does it."""

from bisect import bisect_right

import numpy as np


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
    order : list of int
        Columns of the trajectory in the order of the joints.
    now : float
        Time of the first sample [s].

    """

    def __init__(self, before, state, start, trajectory, order, now):
        times = start + np.asarray(trajectory.times, dtype=float)
        rows = [trajectory.positions, trajectory.velocities, trajectory.accelerations]
        if rows[1] is None:
            rows = rows[:1]
        elif rows[2] is None:
            rows = rows[:2]
        points = np.array([row[:, order] for row in rows])  # (1 to 3, K, n)
        self._last = np.zeros((3, points.shape[2]))
        self._last[:len(rows)] = points[:, -1]
        # Segment 0 leads to the first point and is never sampled if that is not ahead.
        lead = times[0] - before if times[0] > max(before, now) else 1.0
        self._knots = [min(before, now), *times.tolist()]
        known = min(len(rows), len(state))
        first = _polynomials(np.array([lead]), state[:known, None], points[:known, :1])
        rest = _polynomials(np.diff(times), points[:, :-1], points[:, 1:])
        self._origins = [before, *times.tolist()]
        self._polynomials = np.concatenate([first, rest])

    def sample(self, now):
        """Position, velocity and acceleration (3, n) at a time [s]."""
        segment = max(bisect_right(self._knots, now) - 1, 0)
        if segment >= len(self._polynomials):
            return self._last
        t = now - self._origins[segment]
        t2 = t * t
        t3 = t2 * t
        powers = np.array([[1.0, t, t2, t3, t2 * t2, t2 * t3],
                           [0.0, 1.0, 2 * t, 3 * t2, 4 * t3, 5 * t2 * t2],
                           [0.0, 0.0, 2.0, 6 * t, 12 * t2, 20 * t3]])
        return powers @ self._polynomials[segment]


def _polynomials(duration, start, end):
    """
    Coefficients (segments, 6, n), lowest power first, between states (1 to 3, segments, n).

    `duration` (segments,) [s]; the rows of a state are position, velocity, acceleration.
    """
    t = duration[:, None]
    coefficients = np.zeros((len(duration), 6, start.shape[2]))
    coefficients[:, 0] = start[0]
    step = end[0] - start[0]
    if len(start) == 1:
        coefficients[:, 1] = step / t
        return coefficients
    v0, v1 = start[1], end[1]
    coefficients[:, 1] = v0
    if len(start) == 2:
        coefficients[:, 2] = (3.0 * step - (2.0 * v0 + v1) * t) / t**2
        coefficients[:, 3] = (-2.0 * step + (v0 + v1) * t) / t**3
        return coefficients
    a0, a1 = start[2], end[2]
    coefficients[:, 2] = 0.5 * a0
    # What the start state leaves to be made up by the three highest powers.
    p = step - (v0 + 0.5 * a0 * t) * t
    v = (v1 - v0 - a0 * t) * t
    a = (a1 - a0) * t**2
    coefficients[:, 3] = (10.0 * p - 4.0 * v + 0.5 * a) / t**3
    coefficients[:, 4] = (-15.0 * p + 7.0 * v - a) / t**4
    coefficients[:, 5] = (6.0 * p - 3.0 * v + 0.5 * a) / t**5
    return coefficients
