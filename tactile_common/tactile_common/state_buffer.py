"""The last states of something that moves, by their stamps, and those in between."""
from collections import deque
from collections.abc import Callable
from typing import Generic, TypeVar

State = TypeVar('State')


class StateBuffer(Generic[State]):
    """
    The last states by their stamps, and those in between.

    Parameters
    ----------
    between : callable
        Of two states and a share from 0 to 1: the state on the way from one to the other.
    size : int
        States kept.
    max_gap_ns : float
        Between states farther apart nothing is interpolated [ns].
    max_ahead_ns : int
        How much newer than the newest state a stamp may be, which then stands for it [ns].
    restart_ns : int
        A stamp older than the newest by this, or by more, means that the clock went back [ns].

    Attributes
    ----------
    newest_ns : int or None
        Stamp of the newest state [ns].
    """

    def __init__(self, between: Callable[[State, State, float], State], *, size: int,
                 max_gap_ns: float = float('inf'), max_ahead_ns: int = 0, restart_ns: int = 0):
        self._between = between
        self._max_gap_ns, self._max_ahead_ns = max_gap_ns, max_ahead_ns
        self._restart_ns = restart_ns
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
        """State at a stamp; None where there are none close enough on both sides."""
        if self.newest_ns is None or stamp_ns > self.newest_ns + self._max_ahead_ns:
            return None
        later_ns, later = self._states[-1]
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
