"""Time for which a law tracks without progress."""

from dataclasses import dataclass
import math

STALL_TIME = 5.0  # s without progress
SLOW_PROGRESS = 0.5  # share of the wanted distance that is progress at any speed


@dataclass
class Stall:
    """Time without progress. A hold does not count and does not reset it."""

    reached: float = -math.inf  # progress at the last reset [m]
    lasting: float = 0.0  # time since the last reset, without holds [s]
    seen: float | None = None  # steady time of the last cycle [s], None after a hold

    def see(self, now: float, progress: float, advance: float, speed: float) -> bool:
        """
        Process the progress [m]; return True if it grew by less than `advance` in `STALL_TIME`.

        At a slow `speed` [m/s], `SLOW_PROGRESS` of the wanted distance replaces `advance` [m].
        """
        advance = min(advance, SLOW_PROGRESS * speed * STALL_TIME)
        if progress > self.reached + advance:
            self.reached, self.lasting = progress, 0.0
        elif self.seen is not None:
            self.lasting += now - self.seen
        self.seen = now
        return self.lasting > STALL_TIME
