"""Joints that follow their command after a dead time, with a first-order lag."""
from collections import deque
import math

import numpy as np

from tactile_common.kernels import njit


class DelayedLag:
    """
    Joints, at rest at `position` (n,) at first; `dead_time` and `lag` may be 0 [s].

    Exact for commands that run straight between the steps, whatever the steps' lengths.
    """

    def __init__(self, position: np.ndarray, dead_time: float, lag: float):
        self._dead_time, self._lag = dead_time, lag
        self.position = np.array(position, dtype=float)
        self.restart()

    def restart(self) -> None:
        """Forget the time and every command on its way; come to rest."""
        self.velocity = np.zeros_like(self.position)
        self._time: float | None = None
        self._knots: deque[tuple[float, np.ndarray]] = deque()

    def step(self, now: float, command: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Advance to `now` [s], when `command` (n,) is given; position and velocity (n,)."""
        arrival = now + self._dead_time
        if self._time is None:
            self._time = arrival
            self._newest = arrival, command
            return self.position, self.velocity
        self._knots.append((arrival, command))
        while self._knots and self._time < now:
            since, start = self._newest
            until, goal = self._knots[0]
            end = min(until, now)
            self.position, self.velocity = _follow(
                self.position, start, (goal - start) / (until - since), end - since,
                end - self._time, self._lag)
            self._time = end
            if until > now:
                break
            self._newest = self._knots.popleft()
        return self.position, self.velocity


@njit(cache=True)
def _follow(position, start, slope, since, time, lag):
    """Position and velocity after `time` of a command start + slope t, run for `since` [s]."""
    command = start + slope * since
    if lag == 0.0:
        return command, slope
    settled = command - lag * slope
    position = settled + (position - (settled - slope * time)) * math.exp(-time / lag)
    return position, (command - position) / lag
