"""Joint commands within all limits for a wanted twist of the sensor."""

import math
from typing import NamedTuple

import numpy as np

from tactile_servo.motion.delay import PROBE, WindowDelay
from tactile_servo.motion.inverse import (
    allowed_acceleration,
    BoundedInverse,
    damped_least_squares,
    DAMPING,
    ROTATION_LENGTH,
)
from tactile_servo.motion.limits import (
    JointLimits,
    Joints,
    NOT_FINITE,
    POSITION,
    Reach,
    WorkspaceBox,
)
from tactile_servo.motion.robot import RobotModel
from tactile_servo.motion.trajectory import Trajectory
from tactile_servo.motion.window import APART, at_rest, committed, extended, Window

UNDAMPED = 1e-6  # damping without effect [m/rad]
STILL = 1e-12  # least joint rate in divisions, per unit of a path
# Time that a new window leaves to the previous one [s]: a period of a controller at 500 Hz and the
# way to it, so that it does not matter when the controller takes the window.
COMMITTED = 0.004
COAST = 0.02  # s for which a window continues before it brakes, if no other follows
SETTLING = 0.1  # least time for the controller to reach the start of a motion [s]
LONGEST_COMMITTED = 0.01  # largest committed time [s]; with more, fast turns are less accurate
PLANNED = 0.8  # share of a joint's velocity limit that a path may use: corrections need the rest
# Share of the joints' acceleration for changes of their velocities at constant speed of the pad,
# which are large near a singularity
BENDING = 0.3
BOX_EXCESS = 5e-4  # distance by which braking in a curve may lead further out of the box [m]
HELD_BACK = 0.05  # share of the wanted motion; with less realised, motion is prevented
BLOCKED_AFTER = 1.0  # time of prevented motion after which it counts as blocked [s]


class JointPace(NamedTuple):
    """Speed and acceleration that the joints allow along a path."""

    speed: float  # m/s for a direction per metre, rad/s for a turn per radian
    acceleration: float  # m/s^2 or rad/s^2
    bound: str  # limit that bounds the speed, for instance 'position of joint1'


class MotionStep(NamedTuple):
    """Result of one command."""

    trajectory: Trajectory | None  # window that ends at rest; None if the last one is to continue
    twist: np.ndarray  # (6,), wanted twist after the workspace limit, sensor frame [m/s, rad/s]
    scale: float  # fraction of the wanted motion that the joint limits allow
    limited_by: str  # limit with the largest effect, or empty
    manipulability: float  # smallest singular value of the weighted Jacobian [m/rad]


class Commanded(NamedTuple):
    """Commanded window, and the state at the end of its change of velocity."""

    window: Window
    joints: Joints  # state one period after the committed part
    pose: np.ndarray  # (4, 4), pose of the sensor in the base frame for `joints`
    jacobian: np.ndarray  # (6, n), Jacobian for `joints`
    end: np.ndarray  # (n,), positions where the last window that was sent comes to rest [rad]
    stamp_ns: int | None = None  # None until it is sent


class Motion:
    """Commanded state of the robot, updated by twists; NaN before the first `seed`."""

    def __init__(self, robot: RobotModel, limits: JointLimits, period: float,
                 workspace: WorkspaceBox | None = None):
        self._robot, self._limits = robot, limits
        self._workspace = workspace or WorkspaceBox(np.full(3, -np.inf), np.full(3, np.inf))
        self._period = period
        self._ahead = COMMITTED  # or longer, see `expect_lateness`
        self._inverse = BoundedInverse(limits)
        unknown = np.full(len(limits.names), np.nan)
        self._now = Commanded(at_rest(unknown, 0.0), Joints(unknown, unknown),
                              np.full((4, 4), np.nan), np.full((6, len(unknown)), np.nan), unknown)
        self._before: Commanded | None = None  # the previous window
        self._stamped = True
        self.delay, self._held_back = WindowDelay(), 0.0
        # Joint limit, singularity or workspace that has prevented (nearly) all of the wanted
        # motion for a second; empty while the robot moves.
        self.blocked = ''
        # What hindered the motion last, a joint at its limit or a singularity; time since then [s]
        self._limit, self._since_limit = '', math.inf

    @property
    def positions(self) -> np.ndarray:
        """Commanded positions (n,) at the end of the newest change of velocity [rad]."""
        return self._now.joints.positions

    @property
    def velocities(self) -> np.ndarray:
        """Commanded velocities (n,) at the same time [rad/s]."""
        return self._now.joints.velocities

    @property
    def pose(self) -> np.ndarray:
        """Commanded pose (4, 4) of the sensor in the base frame [m]."""
        return self._now.pose

    @property
    def rest_pose(self) -> np.ndarray:
        """Pose (4, 4) of the sensor at the end of the last window that was sent [m]."""
        return self._robot.pose(self._now.end)

    @property
    def standing(self) -> bool:
        """True if the commanded window contains no motion."""
        return not self._now.window.velocities.any()

    @property
    def twist(self) -> np.ndarray:
        """Commanded twist (6,) of the sensor in its own frame [m/s, rad/s]."""
        return self._now.jacobian @ self._now.joints.velocities

    @property
    def lasting(self) -> float:
        """Duration of the newest window until it is at rest [s]."""
        return float(self._now.window.times[-1])

    @property
    def at_limit(self) -> str:
        """Joint at an end of its range, or singularity, that recently hindered motion; or ''."""
        return self._limit if self._since_limit < BLOCKED_AFTER else ''

    def across(self) -> float:
        """Return the acceleration across the sensor's normal that all joints allow [m/s^2]."""
        return allowed_acceleration(self._now.jacobian, self._limits.acceleration, 0, 2)

    def lifting(self) -> float:
        """Return the acceleration along the normal that all joints allow [m/s^2]."""
        return allowed_acceleration(self._now.jacobian, self._limits.acceleration, 2, 3)

    def turning(self) -> float:
        """Return the acceleration of a turn about the normal that all joints allow [rad/s^2]."""
        return allowed_acceleration(self._now.jacobian, self._limits.acceleration, 5, 6)

    def along(self, way: np.ndarray, speed: float = 0.0, bending: float = 1.0) -> JointPace:
        """
        Return the pace that all joints allow along `way`, a twist (6,) per unit of path.

        The joint velocities change as the arm moves. The share `bending` of the joints'
        acceleration is available for this and bounds the speed; what remains at `speed` is the
        acceleration of the pace. There is no damping: at a singularity it would change the way.
        """
        limits, (rates, moving, bent) = self._limits, self._course(way)
        room = limits.reach(self._now.joints, self._period, COAST + self._period)
        speeds = np.array([np.where(rates > 0.0, room.most[0], -room.least[0]) / moving,
                           PLANNED * limits.velocity / moving,
                           np.sqrt(bending * limits.acceleration / bent)])
        kind, joint = np.unravel_index(speeds.argmin(), speeds.shape)
        most = float(((limits.acceleration - bent * speed**2) / moving).min())
        return JointPace(float(speeds[kind, joint]), max(most, 0.0), limits.name_of(kind, joint))

    def passing(self, way: np.ndarray) -> float:
        """
        Return the speed at which the arm can go on along `way`, also through a singularity.

        It is that of `along`, but as there is damping, the joints never move farther for a way
        than at its limit. Joints at the ends of their ranges do not bound it: others take over.
        """
        limits, (_, moving, bent) = self._limits, self._course(way)
        most = math.hypot(np.linalg.norm(way[:3]),
                          ROTATION_LENGTH * np.linalg.norm(way[3:])) / DAMPING
        return float(min((PLANNED * limits.velocity / np.fmin(moving, most)).min(),
                         np.sqrt(BENDING * limits.acceleration / np.fmin(bent, most**2)).min()))

    def _course(self, way: np.ndarray) -> tuple[np.ndarray, ...]:
        """
        Return the joint rates (n,) along `way`, their size, and that of their change.

        At a speed v the joint velocities are rates v, the accelerations rates dv/dt + bend v^2.
        """
        jacobian = self._now.jacobian
        rates, _ = damped_least_squares(jacobian, way, damping=UNDAMPED)
        bend, _ = damped_least_squares(
            jacobian, -self._robot.bias(self.positions, rates), damping=UNDAMPED)
        return rates, np.fmax(np.abs(rates), STILL), np.fmax(np.abs(bend), STILL)

    def seed(self, positions: np.ndarray) -> None:
        """
        Start at rest from measured joint positions (n,), never from an old target.

        The robot's controller may still command the end of the last window. Before any motion it
        gets the time to come from there with half of the limits, at least `SETTLING`.
        """
        joints = np.array(positions, dtype=float)
        # Before the first window the robot is at its measured positions.
        end = np.where(np.isfinite(self._now.end), self._now.end, joints)
        way, limits = np.abs(joints - end), self._limits
        # A cubic between two rests reaches 1.5 times its mean velocity and 6 way / time^2.
        settling = np.fmax(3.0 * way / limits.velocity, np.sqrt(12.0 * way / limits.acceleration))
        rest = at_rest(joints, float(np.fmax(settling.max(), SETTLING)))
        self._now = Commanded(rest, Joints(joints, np.zeros_like(joints)),
                              *self._robot.place(joints), end)
        self.delay.begin()
        self._since_limit = math.inf
        self.reset_blocked()

    def reset_blocked(self) -> None:
        """Reset the time for which motion was blocked, because another motion begins."""
        self._held_back, self.blocked = 0.0, ''

    def expect_lateness(self, lateness: float) -> None:
        """
        Increase the committed time to this lateness of windows [s], up to LONGEST_COMMITTED.

        A larger delay that was measured increases it further, see `WindowDelay`.
        """
        self._ahead = max(COMMITTED, min(lateness, LONGEST_COMMITTED), self.delay.needed)

    def command(self, twist: np.ndarray, now_ns: int, stamped: bool = True) -> MotionStep:
        """
        Continue the motion with a twist (6,) of the sensor in its own frame [m/s, rad/s].

        The motion begins with the remaining part of the last window at the cycle's time `now_ns`,
        even if this cycle is late, because the robot's controller has played that window in the
        meantime. The joint velocities for the twist are limited and integrated. A twist that is
        not finite is a stop. If the first command after `seed` is not `stamped`, all its windows
        start when they are received; a change during the motion would cause a jolt.
        """
        first = self._now.stamp_ns is None
        if first:
            self._stamped = stamped
        elapsed = 1e-9 * (now_ns - self._now.stamp_ns) if self._now.stamp_ns is not None else 0.0
        kept = committed(self._now.window, max(elapsed, 0.0), self._ahead)
        # Send nothing until the controller reaches the first point: a new window would disturb it.
        settling = bool(kept.times[0] > APART)
        with np.errstate(over='ignore', invalid='ignore'):  # for a twist that is not finite
            window, step = self._plan(kept, twist, settling)
        # Wait for windows that are already late: another one would be late by an unknown time.
        awaiting = self.delay.overdue > self._ahead
        if first or not (settling or awaiting):
            joints = Joints(window.positions[-3], window.velocities[-3])
            self._before, self._now = self._now, Commanded(
                window, joints, *self._robot.place(joints.positions), window.positions[-1],
                now_ns)
            sent = Trajectory(self._limits.names, *window, stamp_ns=now_ns if self._stamped else 0)
            self.delay.send(window, sent.stamp_ns)
            step = step._replace(trajectory=sent)
        elif awaiting:  # the last window leads on
            joints = Joints(kept.positions[-1], kept.velocities[-1])
            pose, jacobian = self._robot.place(joints.positions)
            self._now = self._now._replace(joints=joints, pose=pose, jacobian=jacobian)
        return step

    def _plan(self, kept: Window, wanted: np.ndarray,
              settling: bool) -> tuple[Window, MotionStep]:
        """Plan the window that follows the committed part with a wanted twist; send nothing."""
        period, limits = self._period, self._limits
        joints = Joints(kept.positions[-1], kept.velocities[-1])
        # The velocities hold at the end of the period, so use the Jacobian there: with that of the
        # start, a probe that rolls at 1.5 rad/s would leave its surface at 0.7 mm/s.
        end = joints.positions + period * joints.velocities
        pose, jacobian = self._robot.place(end)
        coast = COAST + period
        twist, clipped = self._workspace.limit(
            pose, wanted, period + coast + 2.0 * limits.stopping_time)
        reach = limits.reach(joints, period, coast)
        velocities, scale, bound, manipulability = self._inverse.solve(
            jacobian, twist, joints, reach)
        if settling:  # no motion, so only position limits matter; NaN stays NaN
            velocities, scale = 0.0 * velocities, 1.0
            bound = bound if bound.startswith(POSITION) else ''
        if self.delay.probing:
            velocities = np.clip(velocities, -PROBE, PROBE)
        # The solver may fail, but no command exceeds a limit.
        velocities, guarded = limits.guard(velocities, reach)
        # At a constant twist the joint velocities change as the arm moves, also in the coast.
        bend, _ = damped_least_squares(jacobian, -self._robot.bias(end, joints.velocities))
        window = self._window(kept, velocities, bend, reach)
        if clipped and self._bends_out(window):
            velocities, guarded = limits.guard(reach.stop, reach)
            window = self._window(kept, velocities, bend, reach)
        limited_by = 'workspace' if clipped else bound or guarded
        self._since_limit += self._period
        if limited_by.startswith(POSITION):
            self._limit, self._since_limit = limits.end_of(limited_by, self.positions), 0.0
        elif manipulability < DAMPING:
            self._limit, self._since_limit = 'the arm is near a singularity', 0.0
        if limited_by or manipulability < DAMPING:
            self._watch(wanted, jacobian @ velocities, limited_by)
        else:
            self.reset_blocked()
        return window, MotionStep(None, twist, 0.0 if guarded == NOT_FINITE else scale,
                                  limited_by, manipulability)

    def _window(self, kept: Window, velocities: np.ndarray, bend: np.ndarray,
                reach: Reach) -> Window:
        """
        Extend the committed part to joint velocities (n,), then coast at a constant twist.

        The coast has the joint accelerations `bend` (n,) within the limits, scaled by the squared
        ratio of the new motion to the previous one (at most 1).
        """
        coast, previous = COAST, kept.velocities[-1]
        left = velocities @ previous / max(previous @ previous, 1e-12)
        most = coast * self._limits.acceleration
        change = coast * min(max(left, 0.0), 1.0)**2 * bend
        if not np.isfinite(change).all():
            change = np.zeros_like(bend)
        coasted = velocities + np.minimum(np.maximum(change, -most), most)
        # A velocity beyond its room, because the joint brakes no harder, does not increase.
        coasted = np.minimum(np.maximum(coasted, np.minimum(reach.least[1], velocities)),
                             np.maximum(reach.most[1], velocities))
        return extended(kept, velocities, coasted, self._period, coast,
                        self._limits.acceleration)

    def _bends_out(self, window: Window) -> bool:
        """Return True if a window, which brakes in a curve, ends further out of the box."""
        here, there = (self._workspace.beyond(self._robot.pose(place)[:3, 3])
                       for place in window.positions[[0, -1]])
        return bool((there > here + BOX_EXCESS).any())

    def in_time(self, command: Trajectory, age: float) -> bool:
        """
        Return True if the newest command may still be sent at this age [s].

        Otherwise the robot's controller has already passed the committed part: the command is
        discarded, and the previous one continues.
        """
        if age <= max(self._ahead, command.times[0]) or self._before is None:
            return True
        self._now = self._before
        self.delay.unsend()
        return False

    def _watch(self, wanted: np.ndarray, brought: np.ndarray, limited_by: str) -> None:
        """Measure the time for which hardly any of a wanted twist (6,) was realised."""
        weighted = wanted * np.repeat([1.0, ROTATION_LENGTH**2], 3)
        square = weighted @ wanted
        if square < 1e-12 or weighted @ brought > HELD_BACK * square:
            self.reset_blocked()
            return
        self._held_back += self._period
        if self._held_back < BLOCKED_AFTER:
            return
        named = self.at_limit if limited_by.startswith(POSITION) else limited_by
        self.blocked = named or 'singularity'
