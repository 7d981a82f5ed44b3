"""Start times of control cycles, at the arrival of images or by a timer; times of statuses."""

from dataclasses import dataclass, field
import math
from typing import Any

from tactile_common.ros.conversions import NS
from tactile_servo.types import Status, Timing

# EARLY to AHEAD are shares of a period.
EARLY = 0.8  # before an expected image: the timer leaves a cycle due from then on to the image
LATE = 0.3  # after an expected image: the timer waits until then
LEAST = 0.5  # least time between the starts of two cycles
SHORTEST = 0.25  # least time from the end of a cycle to the timer, if the next cycle is late
AHEAD = 0.1  # that a timer may be early
STATUS_PERIOD = 0.01  # s between status messages; a new state or reason is published at once
SMOOTHING = 0.1  # weight of the newest interval in the mean time between images


@dataclass
class Pace:
    """
    Start times and durations of cycles: steady times [s], processor times [s], counts.

    An image starts a cycle at its arrival. Between images, and without images, the timer starts a
    cycle one period after the last. The mean rate is thus about one cycle per period: images that
    arrive faster do not start a cycle each.
    """

    period: float
    last: float = -math.inf  # start of the last cycle
    due: float = -math.inf  # start of the next cycle if no image arrives
    image: float = -math.inf  # arrival of the newest image
    gap: float = math.inf  # mean time between images
    cycles: int = 0
    lost: float = 0.0  # total lateness of cycles, in periods
    longest: float = 0.0  # longest cycle since this was set to 0
    costs: list[float] = field(default_factory=list)  # of cycles since the last message

    def hear(self, now: float) -> bool:
        """Record the arrival of an image; return whether it starts a cycle."""
        since, self.image = now - self.image, now
        # A missing image, or an interruption, changes the mean only little.
        self.gap = since if self.gap == math.inf else (
            self.gap + SMOOTHING * (min(since, 2.0 * self.gap) - self.gap))
        return now - self.last >= (LEAST if self._slow else 1.0) * self.period

    @property
    def _slow(self) -> bool:
        """Whether images arrive so slowly that each can start a cycle."""
        return self.gap > EARLY * self.period

    def begin(self, now: float) -> None:
        """Record the start of a cycle."""
        late = now - self.due if self.cycles else 0.0
        self.cycles, self.last = self.cycles + 1, now
        # A timer that is a little late does not reduce the rate: the schedule is kept.
        self.due = (self.due if 0.0 < late < LEAST * self.period else now) + self.period
        if late >= LEAST * self.period:
            self.lost += late / self.period

    @property
    def missed(self) -> int:
        """Number of cycles that were due and did not start."""
        return int(self.lost)

    def end(self, now: float, cost: float) -> float:
        """Record the end of a cycle and its processor time; return the wait for the next [s]."""
        self.longest = max(self.longest, now - self.last)
        self.costs.append(cost)
        expected = self.image + self.gap
        if self._slow and (
                expected - EARLY * self.period < self.due < expected + LATE * self.period):
            self.due = expected + LATE * self.period
        return max(self.due - now, SHORTEST * self.period)

    def is_due(self, now: float) -> bool:
        """Return whether the timer is to start a cycle now."""
        return not now < self.due - AHEAD * self.period

    def timing(self, now: float, latency: float) -> Timing:
        """Return the timing for a message that is published during a cycle."""
        cost = sum(self.costs) / len(self.costs) if self.costs else math.nan
        self.costs = []
        return Timing(latency, now - self.last, cost, self.cycles, self.missed)


@dataclass
class StatusTiming:
    """When to publish the status, and the latency from image to command; times in s."""

    published: tuple[Any, Any] | None = None  # state and reason that were last published
    next: float = -math.inf  # when the same state and reason are published again
    used_ns: int = 0  # stamp of the newest image that was used
    latency: float = math.nan  # from that stamp to the first command; NaN if there was none

    def due(self, now: float, status: Status) -> bool:
        """Return whether to publish a status now."""
        news = status.state, status.reason
        if news == self.published and now < self.next:
            return False
        self.published, self.next = news, max(self.next + STATUS_PERIOD, now)
        return True

    def record_image(self, stamp_ns: int, commanded: bool, now_ns: float) -> None:
        """Record the stamp of the image that a cycle used, and whether it sent a command."""
        if stamp_ns != self.used_ns:
            self.used_ns = stamp_ns
            self.latency = (now_ns - stamp_ns) / NS if commanded else math.nan
