"""Whether a law goes on and on without getting anywhere."""

from dataclasses import dataclass
import math

STALL_TIME = 5.0  # s without progress


@dataclass
class Stall:
    """For how long there was no progress. A hold in between neither counts nor makes it good."""

    reached: float = -math.inf  # progress that was made last [m],
    lasting: float = 0.0  # and time without any since [s]
    seen: float | None = None  # steady time of the last cycle [s], None after a hold

    def see(self, now: float, progress: float, advance: float) -> bool:
        """Take the progress [m], of which an `advance` [m] counts; whether it is too long ago."""
        if progress > self.reached + advance:
            self.reached, self.lasting = progress, 0.0
        elif self.seen is not None:
            self.lasting += now - self.seen
        self.seen = now
        return self.lasting > STALL_TIME
