"""When control cycles begin: with the pictures where there are any, and without them as well."""

from dataclasses import dataclass, field
import math

from tactile_servo.types import Timing

EARLY = 0.8  # of a period before a picture is due from which the timer leaves the cycle to it
LATE = 0.3  # of a period that it then waits for it
LEAST = 0.5  # of a period between two cycles
SHORTEST = 0.25  # of a period between the end of a cycle and one that is late
AHEAD = 0.1  # of a period that a timer may be early
SMOOTHING = 0.1  # of the mean time between pictures


@dataclass
class Pace:
    """
    When cycles begin, and what they take: steady times [s], processor times [s], counts.

    A picture begins a cycle as it comes; between pictures, and without them, the timer begins one
    a period after the last. That is about as many as the period says: pictures that come faster
    than that begin none.
    """

    period: float
    last: float = -math.inf  # begin of the last cycle,
    due: float = -math.inf  # and of the next one if no picture comes
    picture: float = -math.inf  # arrival of the newest picture,
    gap: float = math.inf  # and the mean time between pictures
    cycles: int = 0
    lost: float = 0.0  # periods by which cycles came late in all
    longest: float = 0.0  # cycle since this was set to 0
    costs: list[float] = field(default_factory=list)  # of cycles that no message has told of

    def hear(self, now: float) -> bool:
        """Take the arrival of a picture; whether a cycle is to begin with it."""
        since, self.picture = now - self.picture, now
        # One that is missing, or an interruption, changes the mean by little.
        self.gap = since if self.gap == math.inf else (
            self.gap + SMOOTHING * (min(since, 2.0 * self.gap) - self.gap))
        return now - self.last >= (LEAST if self._slow else 1.0) * self.period

    @property
    def _slow(self) -> bool:
        """Whether there is a cycle for every picture."""
        return self.gap > EARLY * self.period

    def begin(self, now: float) -> None:
        """Count a cycle that begins."""
        late = now - self.due if self.cycles else 0.0
        self.cycles, self.last = self.cycles + 1, now
        # A timer that comes a little late does not slow the cycles down.
        self.due = (self.due if 0.0 < late < LEAST * self.period else now) + self.period
        if late >= LEAST * self.period:
            self.lost += late / self.period

    @property
    def missed(self) -> int:
        """Cycles that were due and did not come."""
        return int(self.lost)

    def end(self, now: float, cost: float) -> float:
        """End a cycle that took so much of the processor; how long to wait for the next [s]."""
        self.longest = max(self.longest, now - self.last)
        self.costs.append(cost)
        expected = self.picture + self.gap
        if self._slow and (
                expected - EARLY * self.period < self.due < expected + LATE * self.period):
            self.due = expected + LATE * self.period
        return max(self.due - now, SHORTEST * self.period)

    def is_due(self, now: float) -> bool:
        """Whether the timer is to begin a cycle now."""
        return not now < self.due - AHEAD * self.period

    def timing(self, now: float, latency: float) -> Timing:
        """What a message during a cycle tells; `latency` as in it."""
        cost = sum(self.costs) / len(self.costs) if self.costs else math.nan
        self.costs = []
        return Timing(latency, now - self.last, cost, self.cycles, self.missed)
