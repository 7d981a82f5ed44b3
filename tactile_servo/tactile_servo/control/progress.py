"""Progress of a pad along its path: laps of a contour that does not close, and stalls."""

from collections.abc import Sequence
from dataclasses import dataclass
import math

MISS = 0.005  # m, distance within which a pad passes the start of its path
LEFT = 10.0  # times MISS: a pad at this distance has left its start
PASSED = 3.0  # times MISS: a pad that goes on so far after a return has passed its start
SAME_HEADING = 0.5  # least cosine between the headings at the start and at a return to it
LAPS = 1.5  # largest number of laps, by the rotation of the path
STALL_TIME = 5.0  # s without progress
SLOW_PROGRESS = 0.5  # share of the wanted distance that is progress at any speed

Vector = Sequence[float]


class LapGuard:
    """
    Checks whether the path of a pad returns to its start, and how far it has turned.

    A contour that closes ends the goal at its start. If the pad passes the start within `MISS` and
    continues, the contour will not close any more.
    """

    def __init__(self) -> None:
        self._start: tuple[Vector, Vector] | None = None  # position and heading
        self._heading: Vector = (0.0, 0.0, 0.0)
        self._left = False
        self._passed = math.inf  # length at which the start was passed [m]
        self.turned = 0.0  # rad

    def see(self, place: Vector, normal: Vector, heading: Vector, length: float) -> None:
        """Process position [m], normal and heading (3,) of the pad, and the length so far [m]."""
        if self._start is None:
            self._start = place, heading
        else:
            self.turned += _turn(self._heading, heading, normal)
        self._heading = heading
        begin, way = self._start
        distance = math.dist(place, begin)
        self._left = self._left or distance > LEFT * MISS
        if self._left and distance < MISS and _dot(way, heading) > SAME_HEADING:
            self._passed = min(self._passed, length)

    def problem(self, length: float) -> str:
        """Return why the contour will not close after a length [m]; empty if it still may."""
        if length - self._passed > PASSED * MISS:
            return 'the pad has passed its start'
        if abs(self.turned) > 2.0 * math.pi * LAPS:
            return f'{LAPS:g} laps'
        return ''


def _dot(one: Vector, other: Vector) -> float:
    return sum(a * b for a, b in zip(one, other, strict=True))


def _turn(one: Vector, other: Vector, normal: Vector) -> float:
    """Return the angle from one heading to the other about a normal [rad]."""
    (ax, ay, az), (bx, by, bz), (x, y, z) = one, other, normal
    across = x * (ay * bz - az * by) + y * (az * bx - ax * bz) + z * (ax * by - ay * bx)
    return math.atan2(across, _dot(one, other))


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
