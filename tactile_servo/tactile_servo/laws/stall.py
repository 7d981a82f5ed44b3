"""Time that a law tracks without progress."""

from dataclasses import dataclass
import math

STALL_TIME = 5.0  # s without progress


@dataclass
class Stall:
    """Time without progress. Time in holds is not counted, and a hold does not reset it."""

    reached: float = -math.inf  # last progress [m]
    lasting: float = 0.0  # time since then, without holds [s]
    seen: float | None = None  # steady time of the last cycle [s], None after a hold

    def see(self, now: float, progress: float, advance: float, speed: float) -> bool:
        """
        Take the progress [m]; True if for `STALL_TIME` it has not grown by `advance` [m].

        At a slow `speed` [m/s] half of the way that was asked for is enough.
        """
        advance = min(advance, 0.5 * speed * STALL_TIME)
        if progress > self.reached + advance:
            self.reached, self.lasting = progress, 0.0
        elif self.seen is not None:
            self.lasting += now - self.seen
        self.seen = now
        return self.lasting > STALL_TIME
