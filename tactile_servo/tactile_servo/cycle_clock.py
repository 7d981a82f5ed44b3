"""Time between the cycles of a servo, and its faults."""

from tactile_servo.control.scaling import clipped
from tactile_servo.reasons import Reason, ReasonCode

STALL = 0.05  # s, longest time without a cycle, or without advance of the stamps' clock


class CycleClock:
    """
    Compares the steady clock of the computer and the clock of the stamps, which sets the motion.

    Attributes
    ----------
    gap : float
        Steady time from the previous cycle to the newest one [s].
    fault : Reason or None
        Fault of the time in the newest cycle.
    """

    def __init__(self, period: float):
        self._period = period
        self._last: float | None = None
        self._last_ns = 0
        self._advanced = 0.0  # steady time at which the stamps' clock last advanced [s]
        self.gap = 0.0
        self.fault: Reason | None = None

    def tick(self, now: float, now_ns: int) -> float:
        """
        Begin a cycle at a steady time [s] and a time of the stamps [ns]; return its dt [s].

        dt is the step of the stamps' clock, limited to 0 to 2 periods.
        """
        self.gap, step = 0.0, self._period
        if self._last is not None:
            self.gap, step = now - self._last, (now_ns - self._last_ns) * 1e-9
        self._last, self._last_ns = now, now_ns
        if step > 0.0:
            self._advanced = now
        self.fault = self._judge(step, now)
        return clipped(step, 0.0, 2.0 * self._period)

    def _judge(self, step: float, now: float) -> Reason | None:
        if step < 0.0:
            return Reason(ReasonCode.CLOCK_STOPPED, f'it went back by {-step:g} s')
        if self.gap > STALL:
            return Reason(ReasonCode.STALLED, f'no cycle for {self.gap:.2f} s')
        if now - self._advanced > STALL:
            return Reason(ReasonCode.CLOCK_STOPPED)
        return None
