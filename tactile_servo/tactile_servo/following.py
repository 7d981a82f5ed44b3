"""Commands to the robot during a goal, and the check that it follows them."""

import math

import numpy as np

from tactile_common.kernels import njit
from tactile_servo.inputs import Inputs
from tactile_servo.motion.inverse import ROTATION_LENGTH
from tactile_servo.motion.motion import Motion, MotionStep
from tactile_servo.reasons import Reason, ReasonCode

SIZE = 512  # number of stored cycles
REST_AFTER = 0.05  # times `following_distance`, commanded motion that must have an effect
REST_SHARE = 0.2  # largest share of this motion that a robot at rest may have moved
LATE = 0.05  # s, largest delay of the robot: dead time and lag of an arm that can be servoed
NEAR = 5.0  # times `following_distance`: only a robot this near is sent to its measured position
SLIGHT = 0.1  # times `following_distance`: a command by less than this counts as no motion


class FollowingCheck:
    """Compares recently commanded poses of the sensor with measured ones, see `apart`."""

    def __init__(self, distance: float):
        self._distance = distance  # largest distance from the commanded way [m]
        self._times = np.empty(SIZE)
        self._sent, self._measured = np.empty((SIZE, 3, 4)), np.empty((SIZE, 3, 4))
        self.reset()

    def reset(self) -> None:
        """Forget all poses, because the robot starts again from where it is."""
        self._count = 0
        self.yielded = 0.0  # of the sensor from the commanded way, along its own normal [m]

    def sent(self, now: float, commanded: np.ndarray, measured: np.ndarray) -> None:
        """Record the pose (4, 4) commanded at a time [s], and the pose measured then."""
        k = self._count % SIZE
        self._times[k], self._sent[k], self._measured[k] = now, commanded[:3], measured[:3]
        self._count += 1

    def problem(self, measured: np.ndarray, arrival: float, end: np.ndarray) -> Reason | None:
        """
        Check a measured pose (4, 4) that arrived at a time [s]; None if the robot follows.

        `end` is the pose (4, 4) where the last window ends, which the robot reaches alone when
        cycles are missed.
        """
        if not self._count:
            return None
        away, self.yielded, at_rest = _judge(
            self._times, self._sent, self._measured, self._count, measured, end,
            (arrival - LATE, REST_AFTER * self._distance))
        if not away <= self._distance:
            return Reason(ReasonCode.NOT_FOLLOWING, f'it is {1e3 * away:.1f} mm from its way')
        if at_rest:
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
def _off_way(one: np.ndarray, other: np.ndarray, measured: np.ndarray) -> tuple[float, float]:
    """Return how far a pose (3 or 4, 4) is off the way between two others, and along its z [m]."""
    along = square = 0.0
    for i in range(3):
        for j in range(4):
            weight = 1.0 if j == 3 else 0.5 * ROTATION_LENGTH**2
            step = other[i, j] - one[i, j]
            along += weight * step * (measured[i, j] - one[i, j])
            square += weight * step**2
    share = min(max(along / max(square, 1e-300), 0.0), 1.0)
    nearest, off = one[:3] + share * (other[:3] - one[:3]), 0.0
    for i in range(3):
        off += measured[i, 2] * (measured[i, 3] - nearest[i, 3])
    return apart(nearest, measured), off


@njit(cache=True)
def _judge(times: np.ndarray, sent: np.ndarray, measured_then: np.ndarray, count: int,
           measured: np.ndarray, end: np.ndarray,
           limits: tuple[float, float]) -> tuple[float, float, bool]:
    """
    Return the distance from the commanded way, along z too [m], and whether the robot is at rest.

    The way leads through the commanded poses to `end`. `limits` are a time [s] and a distance
    `enough` [m]. The commands since that time count for the distance, and the last one before it.
    The robot is at rest if it was commanded by `enough` until then, and has moved by at most
    `REST_SHARE` of that.
    """
    since, enough = limits
    nearest, off, moved, last, following = math.inf, 0.0, 0.0, -1, end
    for n in range(count - 1, max(count - SIZE, 0) - 1, -1):
        k = n % SIZE
        if last < 0:
            distance, deeper = _off_way(sent[k], following, measured)
            following = sent[k]
            if not distance >= nearest:  # also if it is NaN
                nearest, off = distance, deeper
            if times[k] <= since:
                last = k
        moved = max(moved, apart(measured_then[k], measured))
        if last >= 0 and moved > REST_SHARE * enough:
            break
        if last >= 0 and apart(sent[k], sent[last]) >= enough:
            return nearest, off, True
    return nearest, off, False


class Driven:
    """
    The robot that a goal moves: whether it follows, and when its last command ends.

    Once a robot is at rest, it is sent to its measured position (`send_here`), so that no older
    command can move it any more.
    """

    def __init__(self, inputs: Inputs, motion: Motion, distance: float):
        self._inputs, self.motion, self._distance = inputs, motion, distance
        self._check = FollowingCheck(distance)
        self.until = -math.inf  # steady time until which the robot may move [s]
        self.sent_here = True  # whether it was sent to its measured position
        self._way: float | None = None  # of that command if it is due now [m]

    @property
    def pose(self) -> np.ndarray:
        """
        Pose (4, 4) of the sensor where the commands lead it.

        It is the commanded one, but as much less deep as the robot yields to the force now.
        """
        pose = self.motion.pose.copy()
        pose[:3, 3] += self._check.yielded * pose[:3, 2]
        return pose

    @property
    def off(self) -> float:
        """Distance of the robot from the end of its last window, as in `apart` [m]."""
        return apart(self.motion.rest_pose, self._inputs.pose)

    @property
    def astray(self) -> bool:
        """Whether it is too far from there, because something else has moved it."""
        return not self.off <= self._distance

    def problem(self) -> Reason | None:
        """Return that the robot does not follow its commands, or None."""
        inputs = self._inputs
        return None if inputs.joints is None else inputs.astray(
            self.motion.positions) or self._check.problem(
                inputs.pose, inputs.joints.arrival, self.motion.rest_pose)

    def blocked(self) -> Reason | None:
        """Return what prevents all motion, or None."""
        blocked = self.motion.blocked
        return Reason(ReasonCode.MOTION_BLOCKED, blocked) if blocked else None

    def start_here(self) -> None:
        """Start from the measured position at rest; forget earlier commands."""
        assert self._inputs.joints is not None  # a goal starts with a joint state
        self.motion.seed(self._inputs.joints.value)
        self._check.reset()

    def send_here(self) -> None:
        """Request a command to the measured position, where the robot is at rest."""
        off, self.sent_here = self.off, True
        self.start_here()
        # A robot that is farther off was moved by somebody else, who commands it now.
        self._way = off if off <= NEAR * self._distance else None

    def move(self, twist: np.ndarray, now: float, now_ns: int, stamped: bool) -> MotionStep:
        """Command a twist (6,) of the sensor in its own frame [m/s, rad/s]."""
        step = self.motion.command(twist, now_ns, stamped)
        self._check.sent(now, self.motion.pose, self._inputs.pose)
        if step.trajectory is not None:
            self.until, self.sent_here = now + self.motion.lasting, False
        return step

    def stay(self, now: float, now_ns: int, stamped: bool) -> MotionStep | None:
        """Return the command that `send_here` has requested, or None."""
        way, self._way = self._way, None
        if way is None:
            return None
        step = self.motion.command(np.zeros(6), now_ns, stamped)
        if way > SLIGHT * self._distance:
            self.until = now + self.motion.lasting
        return step
