"""From the wanted twist of the sensor to joint commands that keep every limit."""

from dataclasses import dataclass
import math
from typing import NamedTuple

import numpy as np

from tactile_common.config import bounded
from tactile_servo.motion.agility import Pace
from tactile_servo.motion.delay import PROBE, WindowDelay
from tactile_servo.motion.inverse import (
    agility,
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
from tactile_servo.motion.window import (
    APART,
    at_rest,
    coasting,
    committed,
    extended,
    Window,
)

UNDAMPED = 1e-6  # damping that does nothing [m/rad]
STILL = 1e-12  # joint rates per unit of a way, below which a joint does not move on it
COAST = 8.0  # control periods that a window goes on before it brakes
SETTLING = 0.1  # s at least, in which the robot's controller comes to where a motion is started
LONGEST_COMMITTED = 0.01  # s; a pad that swings in fast is led less well by more
BLOCKED_AFTER = 1.0  # s held back until the motion counts as blocked


@dataclass(frozen=True)
class MotionConfig:
    """How a twist becomes joint velocities."""

    committed: float = bounded(
        0.004, 'a command no longer changes what the robot does for this long; with a period of '
        'its controller and the way to it within, it does not matter when the controller takes '
        'the next one', 's', 5e-4, 0.1)


class MotionStep(NamedTuple):
    """One command."""

    trajectory: Trajectory | None  # window to a rest; None while the last one is to be played on
    twist: np.ndarray  # wanted one that the workspace let through, sensor's frame [m/s, rad/s]
    scale: float  # fraction of the wanted motion that the joint limits let through
    limited_by: str  # what bound most, empty if nothing did
    manipulability: float  # smallest singular value of the weighted Jacobian [m/rad]


class Commanded(NamedTuple):
    """What is commanded: a window, and the state at the end of its change of velocity."""

    window: Window
    joints: Joints  # a period after what is committed
    pose: np.ndarray  # (4, 4), of the sensor in the base frame
    jacobian: np.ndarray  # (6, n), there
    end: np.ndarray  # (n,), where the last window that was sent comes to rest [rad]
    stamp_ns: int | None = None  # None until it is sent


class Motion:
    """
    Commanded state of the robot, and how a twist moves it on.

    What is commanded is NaN before the first `seed`.

    Attributes
    ----------
    blocked : str
        Which limit, of which joint, has held back (nearly) all of the wanted motion for a
        second, or the singularity or workspace that has; empty while the robot gets on.
    delay : WindowDelay
        How late windows come.
    """

    def __init__(self, robot: RobotModel, limits: JointLimits, config: MotionConfig,
                 period: float, workspace: WorkspaceBox | None = None):
        self._robot, self._limits, self._workspace = robot, limits, workspace
        self._config, self._period = config, period
        self._ahead = config.committed  # s, which the newest window leaves to the one before
        self._inverse = BoundedInverse(limits)
        unknown = np.full(len(limits.names), np.nan)
        self._now = Commanded(at_rest(unknown, 0.0), Joints(unknown, unknown),
                              np.full((4, 4), np.nan), np.full((6, len(unknown)), np.nan), unknown)
        self._before: Commanded | None = None  # a window earlier
        self._stamped = True
        self._held_back, self.blocked, self.delay = 0.0, '', WindowDelay()
        self._limit, self._since_limit = '', math.inf  # of position, met last, and since when [s]

    @property
    def positions(self) -> np.ndarray:
        """Commanded last (n,): at the end of the newest change of velocity [rad]."""
        return self._now.joints.positions

    @property
    def velocities(self) -> np.ndarray:
        """Commanded last (n,) [rad/s]."""
        return self._now.joints.velocities

    @property
    def pose(self) -> np.ndarray:
        """Commanded pose (4, 4) of the sensor in the base frame [m]."""
        return self._now.pose

    @property
    def rest_pose(self) -> np.ndarray:
        """Pose (4, 4) of the sensor where the last window that was sent comes to rest [m]."""
        return self._robot.pose(self._now.end)

    @property
    def standing(self) -> bool:
        """Whether the robot has been commanded to a rest, and that command is over."""
        return not self._now.window.velocities.any()

    @property
    def twist(self) -> np.ndarray:
        """Twist (6,) that the sensor is commanded to, in its own frame [m/s, rad/s]."""
        return self._now.jacobian @ self._now.joints.velocities

    @property
    def lasting(self) -> float:
        """Time from the last cycle that had a window to the rest at the end of it [s]."""
        return float(self._now.window.times[-1])

    @property
    def at_limit(self) -> str:
        """Which joint has kept the sensor from its way lately, at which end of its range."""
        lately = self._since_limit < BLOCKED_AFTER
        return self._limits.end_of(self._limit, self.positions) if lately else ''

    def across(self) -> float:
        """Acceleration of the sensor across its normal that all joints allow [m/s^2]."""
        return agility(self._now.jacobian, self._limits.acceleration)

    def along(self, way: np.ndarray, speed: float = 0.0, bending: float = 1.0) -> Pace:
        """
        Pace that all joints allow on a way, which is a twist (6,) of the sensor per unit.

        It goes on like this: joint rates that change as the arm bends take accelerations, which
        `bending` is the share of that bounds the speed. What is left at a `speed` on the way is
        the acceleration of the pace. Nothing is damped: at a singularity that is another way.
        """
        limits, joints, jacobian = self._limits, self.positions, self._now.jacobian
        rates, _ = damped_least_squares(jacobian, way, damping=UNDAMPED)
        bend, _ = damped_least_squares(
            jacobian, -self._robot.bias(joints, rates), damping=UNDAMPED)
        # At a speed v the joints' velocities are rates v, their accelerations rates dv/dt + bend
        # v^2. Corrections need a fifth of the velocities.
        moving, bent = np.fmax(np.abs(rates), STILL), np.fmax(np.abs(bend), STILL)
        room = limits.reach(self._now.joints, self._period, (COAST + 1.0) * self._period)
        speeds = np.array([np.where(rates > 0.0, room.most[0], -room.least[0]) / moving,
                           0.8 * limits.velocity / moving,
                           np.sqrt(bending * limits.acceleration / bent)])
        kind, joint = np.unravel_index(speeds.argmin(), speeds.shape)
        most = float(((limits.acceleration - bent * speed**2) / moving).min())
        return Pace(float(speeds[kind, joint]), max(most, 0.0), limits.name_of(kind, joint))

    def seed(self, positions: np.ndarray) -> None:
        """
        Start at rest from measured joint positions (n,), never from an old target.

        The robot's controller may still command what it was told last: it is given the time to
        come from there with half of the limits, `SETTLING` at least, before anything moves.
        """
        joints = np.array(positions, dtype=float)
        # Before anything was sent it stands where it was first measured.
        end = np.where(np.isfinite(self._now.end), self._now.end, joints)
        way, limits = np.abs(joints - end), self._limits
        # A cubic between two rests has 1.5 times its mean velocity and 6 way / time^2.
        settling = np.fmax(3.0 * way / limits.velocity, np.sqrt(12.0 * way / limits.acceleration))
        rest = at_rest(joints, float(np.fmax(settling.max(), SETTLING)))
        self._now = Commanded(rest, Joints(joints, np.zeros_like(joints)),
                              *self._robot.place(joints), end)
        self.delay.begin()
        self._since_limit = math.inf
        self.reset_blocked()

    def reset_blocked(self) -> None:
        """Forget what was held back, because another motion is wanted from now on."""
        self._held_back, self.blocked = 0.0, ''

    def expect_lateness(self, lateness: float) -> None:
        """
        Commit to what windows need that come late by this time [s], up to LONGEST_COMMITTED.

        Those that were seen to come later need more, see `WindowDelay`.

        It may change from one command to the next: every window begins with what is left of the
        one before.
        """
        least = self._config.committed
        self._ahead = max(least, min(lateness, LONGEST_COMMITTED), self.delay.needed)

    def command(self, twist: np.ndarray, now_ns: int, stamped: bool = True) -> MotionStep:
        """
        Move on by a twist (6,) of the sensor in its own frame [m/s, rad/s], at a cycle's time.

        The motion begins with what is left of the last window at `now_ns`, however late that
        is: it is what the robot's controller did in the meantime. The joints that the twist
        takes are limited and integrated; one that is not finite counts as a stop. From a start
        that is not `stamped` on windows begin when they are received: to change that while the
        robot moves is a jolt.
        """
        first = self._now.stamp_ns is None
        if first:
            self._stamped = stamped
        elapsed = 1e-9 * (now_ns - self._now.stamp_ns) if self._now.stamp_ns is not None else 0.0
        kept = committed(self._now.window, max(elapsed, 0.0), self._ahead)
        # On its way to the first point the controller is left alone: each window is a seam there.
        settling = bool(kept.times[0] > APART)
        with np.errstate(over='ignore', invalid='ignore'):  # of a twist that is not finite
            window, step = self._plan(kept, twist, settling)
        # Those that are late already are awaited: another one would be as late, nobody knows how.
        awaiting = self.delay.overdue > self._ahead
        # Only what is sent is what the robot's controller plays.
        if first or not (settling or awaiting):
            joints = Joints(window.positions[-3], window.velocities[-3])
            self._before, self._now = self._now, Commanded(
                window, joints, *self._robot.place(joints.positions), window.positions[-1],
                now_ns)
            sent = Trajectory(self._limits.names, *window, stamp_ns=now_ns if self._stamped else 0)
            self.delay.send(sent)
            step = step._replace(trajectory=sent)
        return step

    def _plan(self, kept: Window, wanted: np.ndarray,
              settling: bool) -> tuple[Window, MotionStep]:
        """Go on from what is committed with a wanted twist; nothing is sent yet."""
        period, limits = self._period, self._limits
        joints, twist, at_wall = Joints(kept.positions[-1], kept.velocities[-1]), wanted, ''
        # Velocities are those of the period's end, where the arm stands otherwise: with the
        # Jacobian of its start a probe that rolls at 1.5 rad/s is led 0.7 mm/s off its surface.
        end = joints.positions + period * joints.velocities
        pose, jacobian = self._robot.place(end)
        coast = (COAST + 1.0) * period
        if self._workspace is not None:
            twist, clipped = self._workspace.limit(
                pose, wanted, period + coast + 2.0 * limits.stopping_time)
            at_wall = 'workspace' if clipped else ''
        reach = limits.reach(joints, period, coast)
        velocities, scale, bound, manipulability = self._inverse.solve(
            jacobian, twist, joints, reach)
        if settling:  # it is not moved, so that only a place can hold it; no number stays none
            velocities, scale = 0.0 * velocities, 1.0
            bound = bound if bound.startswith(POSITION) else ''
        if self.delay.probing:
            velocities = np.clip(velocities, -PROBE, PROBE)
        # Whatever the solver gave: no command passes a limit.
        velocities, guarded = limits.guard(velocities, reach)
        # Joint rates that keep a twist change as the arm bends; they do while the window coasts.
        bend, _ = damped_least_squares(jacobian, -self._robot.bias(end, joints.velocities))
        window = self._window(kept, velocities, bend, reach)
        if self._workspace is not None and at_wall and self._bends_out(window, self._workspace):
            velocities, guarded = limits.guard(reach.stop, reach)
            window = self._window(kept, velocities, bend, reach)
        limited_by = at_wall or bound or guarded
        self._since_limit += self._period
        if limited_by.startswith(POSITION):
            self._limit, self._since_limit = limited_by, 0.0
        if limited_by or manipulability < DAMPING:
            self._watch(wanted, jacobian @ velocities, limited_by)
        else:
            self.reset_blocked()
        return window, MotionStep(None, twist, 0.0 if guarded == NOT_FINITE else scale,
                                  limited_by, manipulability)

    def _window(self, kept: Window, velocities: np.ndarray, bend: np.ndarray,
                reach: Reach) -> Window:
        """
        Go on from what is committed to joint velocities (n,), then coast as the arm bends.

        That is with accelerations `bend` (n,), as far as the limits allow them, and as much as is
        left of the motion.
        """
        coast, previous = COAST * self._period, kept.velocities[-1]
        left = velocities @ previous / max(previous @ previous, 1e-12)
        coasted = coasting(
            velocities, coast * min(max(left, 0.0), 1.0)**2 * bend,
            coast * self._limits.acceleration, reach.least[1], reach.most[1])
        return extended(kept, velocities, coasted, self._period, coast,
                        self._limits.acceleration)

    def _bends_out(self, window: Window, box: WorkspaceBox) -> bool:
        """Whether a window that brakes in a curve ends half a millimetre beyond the box."""
        here, there = (box.beyond(self._robot.pose(place)[:3, 3])
                       for place in window.positions[[0, -1]])
        return bool((there > here + 5e-4).any())

    def in_time(self, command: Trajectory, age: float) -> bool:
        """
        Whether the newest command may still be sent at this age [s].

        If not, the robot's controller would have left its course by then: it is forgotten, and
        what was sent before goes on.
        """
        if age <= max(self._ahead, command.times[0]) or self._before is None:
            return True
        self._now = self._before
        self.delay.unsend()
        return False

    def _watch(self, wanted: np.ndarray, brought: np.ndarray, limited_by: str) -> None:
        """Count for how long hardly any of a wanted twist (6,) has been brought."""
        weighted = wanted * np.repeat([1.0, ROTATION_LENGTH**2], 3)
        square = weighted @ wanted
        if square < 1e-12 or weighted @ brought > 0.05 * square:
            self.reset_blocked()
            return
        self._held_back += self._period
        if self._held_back < BLOCKED_AFTER:
            return
        named = self.at_limit if limited_by.startswith(POSITION) else limited_by
        self.blocked = named or 'singularity'
