"""Detection of a pad that goes round a contour which does not close."""

from collections.abc import Sequence
import math

MISS = 0.005  # m, distance within which a pad passes the start of its path
LEFT = 10.0  # times MISS: a pad at this distance has left its start
PASSED = 3.0  # times MISS: a pad that goes on so far after a return has passed its start
SAME_HEADING = 0.5  # least cosine between the headings at the start and at a return to it
LAPS = 1.5  # largest number of laps, by the rotation of the path

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
