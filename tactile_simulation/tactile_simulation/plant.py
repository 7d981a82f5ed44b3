"""Joints that follow their commands with a dead time and a first-order lag."""
from collections import deque
import math

import numpy as np


class DelayedLag:
    """
    Joints that are initially at rest at `position` (n,); `dead_time` and `lag` [s] may be 0.

    Commands are connected by straight lines; the last one is held. The solution is exact at any
    time.
    """

    def __init__(self, position: np.ndarray, dead_time: float, lag: float):
        self._dead_time, self._lag = dead_time, lag
        self.position = np.array(position, dtype=float)
        self.restart()

    def restart(self) -> None:
        """Forget the time and all pending commands; come to rest."""
        self.velocity = np.zeros_like(self.position)
        self._time = -math.inf
        self._last = -math.inf, self.position  # last knot that the joints have passed
        self._knots: deque[tuple[float, np.ndarray]] = deque()

    def command(self, when: float, position: np.ndarray) -> None:
        """Set a command `position` (n,) for a time [s] that is later than the one before."""
        self._knots.append((when + self._dead_time, position))

    def advance(self, now: float) -> tuple[np.ndarray, np.ndarray]:
        """Return position and velocity (n,) at a time [s], which must not go back."""
        if self._time == -math.inf:  # at rest until now
            self._time, self._last = now, (now, self.position)
        while self._time < now:
            since, start = self._last
            # After the last command: hold until now, so that the next line begins here.
            until, goal = self._knots[0] if self._knots else (now, start)
            end = min(until, now)
            if end > self._time:
                self.position, self.velocity = _follow(
                    self.position, start, (goal - start) / (until - since), end - since,
                    end - self._time, self._lag)
                self._time = end
            if until <= now:
                self._last = until, goal
                if self._knots:
                    self._knots.popleft()
        return self.position, self.velocity


def _follow(position, start, slope, since, time, lag):
    """
    Return position and velocity after `time` [s] of a command start + slope t.

    The command has already run for `since` [s].
    """
    command = start + slope * since
    if lag == 0.0:
        return command, slope
    settled = command - lag * slope
    position = settled + (position - (settled - slope * time)) * math.exp(-time / lag)
    return position, (command - position) / lag
