"""Check that the robot follows its commands, by the poses of its sensor."""

import math

import numpy as np

from tactile_common.kernels import njit
from tactile_servo.motion.inverse import ROTATION_LENGTH
from tactile_servo.reasons import Reason, ReasonCode

SIZE = 512  # number of stored cycles
REST_AFTER = 0.05  # times `following_distance`, commanded motion that must have an effect
REST_SHARE = 0.2  # largest share of this motion that a robot at rest may have moved
LATE = 0.05  # s, largest delay of the robot: dead time and lag of an arm that can be servoed


class FollowingCheck:
    """Compares recently commanded poses of the sensor with measured ones, see `apart`."""

    def __init__(self, distance: float):
        self._distance = distance  # largest distance from the commanded way [m]
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
        away, stands = _judge(self._times, self._sent, self._measured, self._count, measured,
                              (arrival - LATE, REST_AFTER * self._distance))
        if not away <= self._distance:
            return Reason(ReasonCode.NOT_FOLLOWING, f'it is {1e3 * away:.1f} mm from its way')
        if stands:
            return Reason(ReasonCode.NOT_FOLLOWING,
                          f'it does not move {1e3 * LATE:.0f} ms after a command')
        return None


@njit(cache=True)
def apart(one: np.ndarray, other: np.ndarray) -> float:
    """
    Return the distance of two poses (3 or 4, 4) [m].

    It is the larger of the distance of their positions and the rotation times `ROTATION_LENGTH`.
    """
    place = turn = 0.0
    for i in range(3):
        place += (one[i, 3] - other[i, 3])**2
        for j in range(3):
            turn += (one[i, j] - other[i, j])**2
    # The difference of two rotations by an angle a has the norm 2 sqrt(2) sin(a / 2).
    return max(math.sqrt(place), ROTATION_LENGTH * math.sqrt(0.5 * turn))


@njit(cache=True)
def _judge(times: np.ndarray, sent: np.ndarray, measured_then: np.ndarray, count: int,
           measured: np.ndarray, limits: tuple[float, float]) -> tuple[float, bool]:
    """
    Return the distance to the nearest commanded pose [m], and whether the robot is at rest.

    `limits` are a time [s] and a distance `enough` [m]. The commands since that time count for
    the distance, and the last one before it. The robot is at rest if it was commanded by `enough`
    until then, and has moved by at most `REST_SHARE` of that.
    """
    since, enough = limits
    nearest, moved, last = math.inf, 0.0, -1
    for n in range(count - 1, max(count - SIZE, 0) - 1, -1):
        k = n % SIZE
        if last < 0:
            distance = apart(sent[k], measured)
            if not distance >= nearest:  # also if it is NaN
                nearest = distance
            if times[k] <= since:
                last = k
        moved = max(moved, apart(measured_then[k], measured))
        if last >= 0 and moved > REST_SHARE * enough:
            break
        if last >= 0 and apart(sent[k], sent[last]) >= enough:
            return nearest, True
    return nearest, False
