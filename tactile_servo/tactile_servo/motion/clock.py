"""Clock agreement of robot and servo, and transport delays, from the ages of joint states."""

import math

CLOCK_AHEAD = 4e-3  # s by which the robot's clock may be ahead
CLOCK_BEHIND = 2.5e-3  # s by which it may be behind, including the way of a joint state
WATCHED = 0.5  # s over which the least age is taken


class ClockCheck:
    """
    Compare the stamps of joint states with the servo's clock, by the least age over `WATCHED`.

    The controller plays a window correctly if its clock is behind by up to its own period. If its
    clock is ahead by more than the committed time, it begins to leave the intended motion.
    """

    def __init__(self) -> None:
        self._since = -math.inf
        # Ages [s]: of the last complete time `WATCHED`, and of the present one.
        self._youngest, self._running = math.inf, math.inf
        self._oldest, self._running_oldest = -math.inf, -math.inf
        self._newest_ns: int | None = None

    def see(self, stamp_ns: int, age: float, now: float) -> None:
        """Process a joint state's stamp [ns] and its age on arrival; `now` is steady time [s]."""
        if stamp_ns == self._newest_ns:
            return
        self._newest_ns = stamp_ns
        if now - self._since > WATCHED:
            self._youngest, self._running, self._since = self._running, math.inf, now
            self._oldest, self._running_oldest = self._running_oldest, -math.inf
        self._running = min(self._running, age)
        self._running_oldest = max(self._running_oldest, age)

    @property
    def agrees(self) -> bool:
        """True if the clocks agree within a joint state's transport time; False if unknown."""
        youngest = min(self._youngest, self._running)
        return -CLOCK_AHEAD <= youngest <= CLOCK_BEHIND

    @property
    def lateness(self) -> float:
        """
        Difference between the largest and the least age of the joint states [s].

        It covers the last 0.5 to 1 s. On an overloaded machine, commands are delayed in the same
        way as joint states.
        """
        return max(max(self._oldest, self._running_oldest)
                   - min(self._youngest, self._running), 0.0)
