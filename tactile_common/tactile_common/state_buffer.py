"""The last states of something that moves, by their stamps, and those in between."""
from collections import deque
from collections.abc import Callable
import math
from typing import Generic, TypeVar

import numpy as np

State = TypeVar('State')
NS = 1_000_000_000
ONWARD = 10  # spans of the last two states that their motion is believed to go on for


class StateBuffer(Generic[State]):
    """
    The last states, as many as `size`, by their stamps, and those in between.

    Parameters
    ----------
    between : callable
        Of two states and a share: the state on the way from one to the other, 0 to 1, or beyond.
    max_gap_ns : float
        Between states farther apart nothing is interpolated.
    max_ahead_ns : int
        How much newer than the newest state a stamp may be: the motion of the last two goes on
        for so long, and for `ONWARD` times what is between them.
    restart_ns : int
        A stamp older than the newest by this, or by more, means that the clock went back.
    """

    def __init__(self, between: Callable[[State, State, float], State], *, size: int,
                 max_gap_ns: float = math.inf, max_ahead_ns: int = 0, restart_ns: int = 0):
        self._between, self._restart_ns = between, restart_ns
        self._max_gap_ns, self._max_ahead_ns = max_gap_ns, max_ahead_ns
        self._states: deque[tuple[int, State]] = deque(maxlen=size)
        self.newest_ns: int | None = None

    def __len__(self) -> int:
        """States that are kept."""
        return len(self._states)

    def clear(self) -> None:
        """Forget all states."""
        self._states.clear()
        self.newest_ns = None

    def went_back(self, stamp_ns: int) -> bool:
        """Whether the clock has been set back, or a recording has begun anew, by a stamp."""
        return self.newest_ns is not None and stamp_ns <= self.newest_ns - self._restart_ns

    def add(self, stamp_ns: int, state: State) -> bool:
        """
        Add a state; False, and it is left out, if it is no later than the newest.

        Where the clock went back, what was before belongs to another time and is forgotten.
        """
        if self.newest_ns is not None and stamp_ns <= self.newest_ns:
            if not self.went_back(stamp_ns):
                return False
            self._states.clear()
        self._states.append((stamp_ns, state))
        self.newest_ns = stamp_ns
        return True

    def at(self, stamp_ns: int) -> State | None:
        """State at a stamp; None where there are none close enough."""
        if self.newest_ns is None or stamp_ns > self.newest_ns + self._max_ahead_ns:
            return None
        later_ns, later = self._states[-1]
        if stamp_ns > later_ns and len(self._states) > 1:
            before_ns, before = self._states[-2]
            span = later_ns - before_ns
            if span > self._max_gap_ns or stamp_ns - later_ns > ONWARD * span:
                return None
            return self._between(before, later, (stamp_ns - before_ns) / span)
        for earlier_ns, earlier in reversed(self._states):
            if earlier_ns <= stamp_ns:
                break
            later_ns, later = earlier_ns, earlier
        else:
            return None
        span = later_ns - earlier_ns
        if not span or earlier_ns == stamp_ns:
            return earlier
        if span > self._max_gap_ns:
            return None
        return self._between(earlier, later, (stamp_ns - earlier_ns) / span)


class PoseBuffer(StateBuffer[np.ndarray]):
    """
    The last poses (4, 4), as many as `size`; none between those `max_gap` apart [s].

    One that is ten gaps older than the newest is of a recording that begins anew.
    """

    def __init__(self, max_gap: float = 0.1, size: int = 500):
        gap = round(max_gap * NS)
        super().__init__(pose_between, size=size, max_gap_ns=gap, restart_ns=10 * gap)


def pose_between(one: np.ndarray, other: np.ndarray, share: float) -> np.ndarray:
    """
    Pose (4, 4) on the way between two: position and rotation each at constant velocity.

    Half a turn between them has no direction; neither is there one in practice.
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
