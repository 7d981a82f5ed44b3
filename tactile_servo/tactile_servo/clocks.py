"""Time between the cycles of a servo, and agreement of the robot's clock with the servo's."""

import math

from tactile_servo.control.scaling import clipped
from tactile_servo.reasons import Reason, ReasonCode

STALL = 0.05  # s, longest time without a cycle, or without advance of the stamps' clock
CLOCK_AHEAD = 4e-3  # s by which the robot's clock may be ahead
CLOCK_BEHIND = 2.5e-3  # s by which it may be behind, including the way of a joint state
WATCHED = 0.5  # s over which the least age is taken


class CycleClock:
    """Compares the computer's steady clock and the clock of the stamps, which sets the motion."""

    def __init__(self, period: float):
        self._period = period
        self._last: float | None = None
        self._last_ns = 0
        self._advanced = 0.0  # steady time at which the stamps' clock last advanced [s]
        # Of the newest cycle: steady time, step of the stamps' clock, time since the cycle before
        self.now = self.dt = self.gap = 0.0  # s
        self.fault: Reason | None = None  # of the time in the newest cycle

    def tick(self, now: float, now_ns: int) -> float:
        """
        Begin a cycle at a steady time [s] and a time of the stamps [ns]; return its `dt` [s].

        It is the step of the stamps' clock, limited to 0 to 2 periods.
        """
        self.now, self.gap, step = now, 0.0, self._period
        if self._last is not None:
            self.gap, step = now - self._last, (now_ns - self._last_ns) * 1e-9
        self._last, self._last_ns = now, now_ns
        if step > 0.0:
            self._advanced = now
        self.fault = self._judge(step, now)
        self.dt = clipped(step, 0.0, 2.0 * self._period)
        return self.dt

    def _judge(self, step: float, now: float) -> Reason | None:
        if step < 0.0:
            return Reason(ReasonCode.CLOCK_STOPPED, f'it went back by {-step:g} s')
        if self.gap > STALL:
            return Reason(ReasonCode.STALLED, f'no cycle for {self.gap:.2f} s')
        if now - self._advanced > STALL:
            return Reason(ReasonCode.CLOCK_STOPPED)
        return None


class ClockCheck:
    """
    Compare the stamps of joint states with the servo's clock, by the least age over `WATCHED`.

    The controller plays a window correctly if its clock is behind by up to its own period. If its
    clock is ahead by more than the committed time, it begins to leave the intended motion.
    """

    def __init__(self) -> None:
        self._since = -math.inf
        # Least and largest age [s] in the last complete time `WATCHED`, and in the present one.
        self._ages = [(math.inf, -math.inf)] * 2
        self._newest_ns: int | None = None

    def see(self, stamp_ns: int, age: float, now: float) -> None:
        """Process a joint state's stamp [ns] and its age on arrival; `now` is steady time [s]."""
        if stamp_ns == self._newest_ns:
            return
        self._newest_ns = stamp_ns
        if now - self._since > WATCHED:
            self._ages, self._since = [self._ages[1], (math.inf, -math.inf)], now
        least, largest = self._ages[1]
        self._ages[1] = min(least, age), max(largest, age)

    @property
    def agrees(self) -> bool:
        """True if the clocks agree within a joint state's transport time; False if unknown."""
        return -CLOCK_AHEAD <= min(least for least, _ in self._ages) <= CLOCK_BEHIND

    @property
    def lateness(self) -> float:
        """
        Difference between the largest and the least age of the joint states [s].

        It covers the last 0.5 to 1 s. On an overloaded machine, commands are delayed in the same
        way as joint states.
        """
        least, largest = zip(*self._ages, strict=True)
        return max(max(largest) - min(least), 0.0)
