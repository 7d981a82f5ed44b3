"""Whether the robot's clock is the servo's, so that a command can say when it begins."""

import math

AHEAD, BEHIND = 4e-3, 2.5e-3  # s; of the robot's clock, the way of a joint state included
WATCHED = 0.5  # s; of that time the youngest joint state counts, the others came late


class ClockCheck:
    """
    Compare the stamps of joint states with the clock here, by the youngest of half a second.

    A window is played right by a controller whose clock is up to its own period behind; one
    that is further ahead than what is committed begins to leave the motion that is meant.
    """

    def __init__(self) -> None:
        self._since = -math.inf
        self._youngest, self._running = math.inf, math.inf  # s; of the last half second, of this
        self._newest_ns: int | None = None

    def see(self, stamp_ns: int, age: float, now: float) -> None:
        """Take a joint state's stamp [ns] and the age that it had when it came, now [s]."""
        if stamp_ns == self._newest_ns:
            return
        self._newest_ns = stamp_ns
        if now - self._since > WATCHED:
            self._youngest, self._running, self._since = self._running, math.inf, now
        self._running = min(self._running, age)

    @property
    def agrees(self) -> bool:
        """Whether both are one clock, as far as is known."""
        youngest = min(self._youngest, self._running)
        return -AHEAD <= youngest <= BEHIND
