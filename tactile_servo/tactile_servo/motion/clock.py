"""What the ages of joint states tell: whether the robot's clock is the servo's, and delays."""

import math


class ClockCheck:
    """
    Compare the stamps of joint states with the clock here, by the youngest of half a second.

    A window is played right by a controller whose clock is up to its own period behind; one
    that is further ahead than what is committed begins to leave the motion that is meant.
    """

    def __init__(self) -> None:
        self._since = -math.inf
        # Ages [s], of the last half second and of this.
        self._youngest, self._running = math.inf, math.inf
        self._oldest, self._running_oldest = -math.inf, -math.inf
        self._newest_ns: int | None = None

    def see(self, stamp_ns: int, age: float, now: float) -> None:
        """Take a joint state's stamp [ns] and the age that it had when it came, now [s]."""
        if stamp_ns == self._newest_ns:
            return
        self._newest_ns = stamp_ns
        if now - self._since > 0.5:
            self._youngest, self._running, self._since = self._running, math.inf, now
            self._oldest, self._running_oldest = self._running_oldest, -math.inf
        self._running = min(self._running, age)
        self._running_oldest = max(self._running_oldest, age)

    @property
    def agrees(self) -> bool:
        """Whether both are one clock, as far as is known, and but for a joint state's way."""
        youngest = min(self._youngest, self._running)
        return -4e-3 <= youngest <= 2.5e-3

    @property
    def lateness(self) -> float:
        """
        How much later than the first of them the last of the joint states came [s].

        Of the last half to whole second; what holds them up on a machine without time for all its
        processes holds up the commands as well.
        """
        return max(max(self._oldest, self._running_oldest)
                   - min(self._youngest, self._running), 0.0)
