"""Buffer of the last stamped states of something that moves, with interpolation."""
from bisect import bisect_right
from collections import deque
from collections.abc import Callable
import math
from operator import itemgetter
from typing import Generic, TypeVar

import numpy as np

State = TypeVar('State')
NS = 1_000_000_000  # in a second
ONWARD = 10  # extrapolate at most this multiple of the time between the last two states


class StateBuffer(Generic[State]):
    """
    The last `size` states by their stamps, with interpolation and extrapolation.

    `between(first, second, share)` returns the state at a share of the way from one to another: 0
    to 1, or beyond. States farther apart than `max_gap_ns` are not interpolated. A stamp may be
    `max_ahead_ns` newer than the newest state: the motion of the last two states is extrapolated
    for this time, and at most for `ONWARD` times the time between them. A stamp that is older than
    the newest by `restart_ns` or more means that the clock went back.
    """

    def __init__(self, between: Callable[[State, State, float], State], *, size: int,
                 max_gap_ns: float = math.inf, max_ahead_ns: int = 0, restart_ns: int = 0):
        self._between, self._restart_ns = between, restart_ns
        self._max_gap_ns, self._max_ahead_ns = max_gap_ns, max_ahead_ns
        self._states: deque[tuple[int, State]] = deque(maxlen=size)
        self.newest_ns: int | None = None

    def __len__(self) -> int:
        """Return the number of states."""
        return len(self._states)

    def clear(self) -> None:
        """Remove all states."""
        self._states.clear()
        self.newest_ns = None

    def went_back(self, stamp_ns: int) -> bool:
        """Return True if a stamp shows that the clock was set back or a recording restarted."""
        return self.newest_ns is not None and stamp_ns <= self.newest_ns - self._restart_ns

    def add(self, stamp_ns: int, state: State) -> bool:
        """
        Add a state; return False and ignore it if it is not newer than the newest.

        If the clock went back, the earlier states belong to another time and are removed.
        """
        if self.newest_ns is not None and stamp_ns <= self.newest_ns:
            if not self.went_back(stamp_ns):
                return False
            self._states.clear()
        self._states.append((stamp_ns, state))
        self.newest_ns = stamp_ns
        return True

    def at(self, stamp_ns: int) -> State | None:
        """Return the state at a stamp; None if no states are close enough."""
        if self.newest_ns is None or stamp_ns > self.newest_ns + self._max_ahead_ns:
            return None
        after = bisect_right(self._states, stamp_ns, key=itemgetter(0))
        if not after:
            return None
        before_ns, before = self._states[after - 1]
        if before_ns == stamp_ns or len(self._states) == 1:
            return before
        after = min(after, len(self._states) - 1)  # beyond the newest: the last two go on
        (earlier_ns, earlier), (later_ns, later) = self._states[after - 1], self._states[after]
        span = later_ns - earlier_ns
        if span > self._max_gap_ns or stamp_ns - later_ns > ONWARD * span:
            return None
        return self._between(earlier, later, (stamp_ns - earlier_ns) / span)


def pose_between(one: np.ndarray, other: np.ndarray, share: float) -> np.ndarray:
    """
    Interpolate two poses (4, 4): position and rotation each at constant velocity.

    The direction of a rotation by half a turn is undefined; this does not occur in practice.
    """
    pose = one.copy()
    pose[:3, 3] += share * (other[:3, 3] - one[:3, 3])
    turn = one[:3, :3].T @ other[:3, :3]
    skew = 0.5 * (turn - turn.T)
    sine = math.sqrt(0.5 * (skew * skew).sum())
    if sine > 1e-12:
        angle = share * math.atan2(sine, 0.5 * (turn.trace() - 1.0))
        skew /= sine
        pose[:3, :3] = one[:3, :3] @ (
            np.eye(3) + math.sin(angle) * skew + (1.0 - math.cos(angle)) * skew @ skew)
    return pose
