"""Check that the robot follows its commands, by the poses of its sensor."""

import math

import numpy as np

from tactile_common.kernels import njit
from tactile_servo.config import InputConfig
from tactile_servo.reasons import Reason, ReasonCode

SIZE = 512  # number of stored cycles
REST_AFTER = 0.05  # times `following_distance`, commanded motion that must have an effect
REST_SHARE = 0.2  # largest share of this motion that a robot at rest may have moved
LATE = 0.05  # s, largest delay of the robot: dead time and lag of an arm that can be servoed


class Following:
    """
    Compares recently commanded poses of the sensor with measured ones.

    Rotations count as lengths: angle times `rotation_length` [m/rad].
    """

    def __init__(self, config: InputConfig, rotation_length: float):
        self._config, self._length = config, rotation_length
        self._times = np.empty(SIZE)
        self._sent, self._measured = np.empty((SIZE, 3, 4)), np.empty((SIZE, 3, 4))
        self._count = 0

    def reset(self) -> None:
        """Forget all poses, because the robot starts again from where it is."""
        self._count = 0

    def sent(self, now: float, commanded: np.ndarray, measured: np.ndarray) -> None:
        """Record the pose (4, 4) commanded at a time [s], and the pose measured then."""
        k = self._count % SIZE
        self._times[k], self._sent[k], self._measured[k] = now, commanded[:3], measured[:3]
        self._count += 1

    def problem(self, measured: np.ndarray, arrival: float) -> Reason | None:
        """Check a measured pose (4, 4) that arrived at a time [s]; None if the robot follows."""
        if not self._count:
            return None
        c = self._config
        away, stands = _judge(
            self._times, self._sent, self._measured, self._count, measured,
            arrival - LATE, REST_AFTER * c.following_distance, self._length)
        if not away <= c.following_distance:
            return Reason(ReasonCode.NOT_FOLLOWING, f'it is {1e3 * away:.1f} mm from its way')
        if stands:
            return Reason(ReasonCode.NOT_FOLLOWING,
                          f'it does not move {1e3 * LATE:.0f} ms after a command')
        return None


@njit(cache=True)
def apart(one: np.ndarray, other: np.ndarray, length: float) -> float:
    """
    Return the distance of two poses (3 or 4, 4) [m].

    It is the larger of the distance of their positions and the rotation times `length` [m/rad].
    """
    place = turn = 0.0
    for i in range(3):
        place += (one[i, 3] - other[i, 3])**2
        for j in range(3):
            turn += (one[i, j] - other[i, j])**2
    # The difference of two rotations by an angle a has the norm 2 sqrt(2) sin(a / 2).
    return max(math.sqrt(place), length * math.sqrt(0.5 * turn))


@njit(cache=True)
def _judge(times: np.ndarray, sent: np.ndarray, measured_then: np.ndarray, count: int,
           measured: np.ndarray, since: float, enough: float, length: float) -> tuple[float, bool]:
    """Return the robot's distance from its path [m], and whether it is at rest."""
    return (_away(times, sent, count, measured, since, length),
            _stands(times, sent, measured_then, count, measured, since, enough, length))


@njit(cache=True)
def _away(times: np.ndarray, sent: np.ndarray, count: int, measured: np.ndarray, since: float,
          length: float) -> float:
    """
    Return the distance to the nearest commanded pose [m].

    The commands since a time count, and the last one before it.
    """
    nearest = math.inf
    for n in range(count - 1, max(count - len(times), 0) - 1, -1):
        distance = apart(sent[n % len(times)], measured, length)
        if not distance >= nearest:
            nearest = distance
        if times[n % len(times)] < since:
            break
    return nearest


@njit(cache=True)
def _stands(times: np.ndarray, sent: np.ndarray, measured_then: np.ndarray, count: int,
            measured: np.ndarray, until: float, enough: float, length: float) -> bool:
    """
    Return whether the robot is at rest although it was commanded to move.

    It was commanded by `enough` [m] until a time, and has moved by at most `REST_SHARE` of that.
    """
    size = len(times)
    last, moved = -1, 0.0
    for n in range(count - 1, max(count - size, 0) - 1, -1):
        k = n % size
        moved = max(moved, apart(measured_then[k], measured, length))
        if moved > REST_SHARE * enough:
            return False
        if last < 0 and times[k] <= until:
            last = k
        if last >= 0 and apart(sent[k], sent[last], length) >= enough:
            return True
    return False
