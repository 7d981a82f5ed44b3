"""Interpolation of joint trajectories as a joint_trajectory_controller does it."""
from bisect import bisect_right

import numpy as np
from scipy.interpolate import BPoly, PPoly

from tactile_servo.motion.trajectory import Trajectory


class Spline:
    """
    A trajectory as polynomials in time, from a state before its first point on.

    Quintic where position, velocity and acceleration are known at both ends of a segment,
    cubic where position and velocity are, else linear; beyond the end it stays at the last
    point. A first point that is not in the future is taken at once. A segment's polynomial is
    made when it is reached: most trajectories of a stream are replaced in their first.

    Parameters
    ----------
    before, state : float, ndarray (2 or 3, n)
        Time [s] from which the first point is approached; position, velocity and, where known,
        acceleration then.
    start : float
        Time from which the trajectory's own times count [s].
    trajectory : Trajectory
    order : list of int, or slice
        Columns of the trajectory in the order of the joints.
    """

    def __init__(self, before: float, state: np.ndarray, start: float, trajectory: Trajectory,
                 order: list[int] | slice):
        rows = [trajectory.positions]
        if trajectory.velocities is not None:
            rows.append(trajectory.velocities)
            if trajectory.accelerations is not None:
                rows.append(trajectory.accelerations)
        times = (start + np.asarray(trajectory.times, dtype=float)).tolist()
        self._ends, self._begins = times, [before, *times[:-1]]  # of the segments
        self._states = [state, *np.stack(rows, axis=1)[:, :, order]]
        self._segment = -1  # that the polynomial is of
        self._polynomial: PPoly

    def sample(self, now: float) -> np.ndarray:
        """Position, velocity and acceleration (3, n) at a time [s]."""
        segment = bisect_right(self._ends, now)
        if segment == len(self._ends):
            last = self._states[-1]
            return np.concatenate([last, np.zeros((3 - len(last), last.shape[1]))])
        if segment != self._segment:
            self._segment, self._polynomial = segment, hermite(
                self._states[segment], self._states[segment + 1],
                self._ends[segment] - self._begins[segment])
        since = now - self._begins[segment]
        return np.stack([self._polynomial(since, order) for order in range(3)])


def _basis(known):
    """Coefficients of the polynomials on [0, 1] that each meet one of 2 * known conditions."""
    unit = np.eye(2 * known)
    return PPoly.from_bernstein_basis(
        BPoly.from_derivatives([0.0, 1.0], [unit[:known], unit[known:]])).c[:, 0]


# By the number of known derivatives. scipy makes them once, not every segment anew: that takes
# it as long as all else of a cycle of a simulation.
_BASES = {known: _basis(known) for known in (1, 2, 3)}
_POWERS = {known: np.arange(2.0 * known)[:, None] for known in _BASES}


def hermite(first: np.ndarray, last: np.ndarray, duration: float) -> PPoly:
    """
    Polynomial (n values) of the least degree between two states `duration` [s] apart.

    Each (1 to 3, n): position, velocity, acceleration; what only one of them has is not used.
    """
    known = min(len(first), len(last))
    scale = duration**_POWERS[known]
    conditions = np.concatenate([scale[:known] * first[:known], scale[:known] * last[:known]])
    coefficients = (_BASES[known] @ conditions) / scale[::-1]
    return PPoly.construct_fast(coefficients[:, None], np.array([0.0, duration]))
