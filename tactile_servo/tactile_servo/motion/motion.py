"""From the wanted twist of the sensor to joint commands that keep every limit."""

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from tactile_common.config import bounded
from tactile_common.kernels import njit
from tactile_servo.motion.agility import Pace, pace
from tactile_servo.motion.inverse import (
    agility,
    BoundedInverse,
    damped_least_squares,
    least_squares,
    progress,
)
from tactile_servo.motion.limits import (
    coasting_velocities,
    JointLimits,
    nearest,
    WorkspaceBox,
)
from tactile_servo.motion.robot import RobotModel
from tactile_servo.motion.trajectory import Trajectory
from tactile_servo.motion.window import APART, at_rest, begin, extended, Window

UNDAMPED = 1e-6  # damping that does nothing [m/rad]
COAST = 8.0  # control periods that a window goes on before it brakes
SETTLING = 0.1  # s at least, in which the robot's controller comes to where a motion is started
BENT = 5e-4  # m by which braking in a curve may lead out of the box
LONGEST_COMMITTED = 0.01  # s; a pad that swings in fast is led less well by more
MORE = 5  # points at the most that the next window has more than the last one
HELD_BACK = 0.05  # of the wanted motion; with less than this left the robot does not get on
BLOCKED_AFTER = 1.0  # s held back until the motion counts as blocked


@dataclass(frozen=True)
class MotionConfig:
    """How a twist becomes joint velocities."""

    damping: float = bounded(
        0.01, 'damping of the inverse Jacobian near a singularity', '', 1e-6, 1.0)
    rotation_length: float = bounded(
        0.04, 'length that weighs rotation against position', 'm/rad', 1e-3, 1.0)
    committed: float = bounded(
        0.004, 'a command no longer changes what the robot does for this long; with a period of '
        'its controller and the way to it within, it does not matter when the controller takes '
        'the next one', 's', 5e-4, 0.1)
    stamped: bool = field(default=True, metadata={
        'doc': "commands say when they begin, wherever the robot's clock is found to be this "
               "one's; false: at once, which is rough"})


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
    positions: np.ndarray  # (n,), reached a period after what is committed [rad]
    velocities: np.ndarray  # (n,) [rad/s]
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
    """

    def __init__(self, robot: RobotModel, limits: JointLimits, config: MotionConfig,
                 period: float, workspace: WorkspaceBox | None = None):
        self._robot, self._limits, self._workspace = robot, limits, workspace
        self._config, self._period = config, period
        self._ahead = config.committed  # s, which the newest window leaves to the one before
        self._inverse = BoundedInverse(limits, config.damping, config.rotation_length)
        unknown = np.full(len(limits.names), np.nan)
        self._now = Commanded(at_rest(unknown, 0.0), unknown, unknown, np.full((4, 4), np.nan),
                              np.full((6, len(unknown)), np.nan), unknown)
        self._before: Commanded | None = None  # a window earlier
        self._stamped = config.stamped
        self._held_back, self.blocked = 0.0, ''

    @property
    def positions(self) -> np.ndarray:
        """Commanded last (n,): at the end of the newest change of velocity [rad]."""
        return self._now.positions

    @property
    def velocities(self) -> np.ndarray:
        """Commanded last (n,) [rad/s]."""
        return self._now.velocities

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
    def lasting(self) -> float:
        """Time from the last cycle that had a window to the rest at the end of it [s]."""
        return float(self._now.window.times[-1])

    def across(self) -> float:
        """Acceleration of the sensor across its normal that all joints allow [m/s^2]."""
        return agility(self._now.jacobian, self._limits.acceleration,
                       self._config.damping, self._config.rotation_length)

    def along(self, way: np.ndarray, speed: float = 0.0, bending: float = 1.0) -> Pace:
        """
        Pace that all joints allow on a way, which is a twist (6,) of the sensor per unit.

        It goes on like this: joint rates that change as the arm bends take accelerations, which
        `bending` is the share of that bounds the speed. What is left at a `speed` on the way is
        the acceleration of the pace. Nothing is damped: at a singularity that is another way.
        """
        limits, joints, jacobian = self._limits, self._now.positions, self._now.jacobian
        rates, _ = damped_least_squares(jacobian, way, damping=UNDAMPED)
        bend, _ = damped_least_squares(
            jacobian, -self._robot.bias(joints, rates), damping=UNDAMPED)
        top, most, kind, joint = pace(
            *limits.bounds, joints, rates, bend, speed, bending, (COAST + 2.0) * self._period)
        return Pace(top, most, limits.name_of(kind, joint))

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
        self._now = Commanded(rest, joints, np.zeros_like(joints), *self._robot.place(joints), end)
        self.reset_blocked()

    def reset_blocked(self) -> None:
        """Forget what was held back, because another motion is wanted from now on."""
        self._held_back, self.blocked = 0.0, ''

    def expect_lateness(self, lateness: float) -> None:
        """
        Commit to what windows need that come late by this time [s], up to LONGEST_COMMITTED.

        It may change from one command to the next: every window begins with what is left of the
        one before.
        """
        least = self._config.committed
        self._ahead = max(least, min(lateness, LONGEST_COMMITTED))

    def command(self, twist: np.ndarray, now_ns: int, stamped: bool = True) -> MotionStep:
        """
        Move on by a twist (6,) of the sensor in its own frame [m/s, rad/s], at a cycle's time.

        The motion begins with what is left of the last window at `now_ns`, however late that
        is: it is what the robot's controller did in the meantime. The joints that the twist
        takes are limited and integrated; one that is not finite counts as a stop. From a start
        that is not `stamped` on windows begin when they are received: to change that while the
        robot moves is a jolt.
        """
        c, period, wanted, at_wall = self._config, self._period, twist, ''
        coast = (COAST + 1.0) * period
        window, since = self._now.window, self._now.stamp_ns
        elapsed = 0.0 if since is None else max(1e-9 * (now_ns - since), 0.0)
        times, places, speeds = (np.empty((len(part) + MORE, *part.shape[1:]))
                                 for part in window)
        # Kernels write into what they are given: to make an array of what one returns costs more.
        kept = begin(*window, elapsed, self._ahead, times, places, speeds)
        positions = places[kept - 1]
        # On its way to the first point the controller is left alone: each window is a seam there.
        settling = times[0] > APART
        first = since is None
        if first:
            self._stamped = stamped and c.stamped
        # Velocities are those of the period's end, where the arm stands otherwise: with the
        # Jacobian of its start a probe that rolls at 1.5 rad/s is led 0.7 mm/s off its surface.
        end = positions + period * speeds[kept - 1]
        pose, jacobian = self._robot.place(end)
        if self._workspace is not None:
            twist, clipped = self._workspace.limit(
                pose, twist, period + coast + 2.0 * self._limits.stopping_time)
            at_wall = 'workspace' if clipped else ''
        velocities, let, bound, manipulability = self._inverse.solve(
            jacobian, twist, positions, speeds[kept - 1], period, coast)
        if settling:  # it is not moved, so that only a place can hold it; no number stays none
            velocities, let = 0.0 * velocities, 1.0
            bound = bound if bound.startswith('position') else ''
        bias = self._robot.bias(end, speeds[kept - 1])
        # Whatever that gave: no command passes a limit.
        parts = (times, places, speeds, kept, self._limits.bounds)
        onward = (bias, period, COAST * period, coast, jacobian, wanted, c.damping,
                  c.rotation_length)
        scale, kind, joint, brought = _onward(*parts, velocities, *onward)
        if at_wall and self._bends_out(places[:kept + 3]):
            velocities = np.zeros_like(velocities)
            scale, kind, joint, brought = _onward(*parts, velocities, *onward)
        limited_by = at_wall or bound or self._limits.name_of(kind, joint)
        hindered = limited_by or manipulability < c.damping
        self._watch(brought if hindered else 1.0, limited_by, period)
        trajectory = None
        if first or not settling:  # only what is sent is what the robot's controller plays
            window = Window(times[:kept + 3], places[:kept + 3], speeds[:kept + 3])
            self._before, self._now = self._now, Commanded(
                window, places[kept], velocities, *self._robot.place(places[kept]),
                places[kept + 2], now_ns)
            trajectory = Trajectory(self._limits.names, *window,
                                    stamp_ns=now_ns if self._stamped else 0)
        return MotionStep(trajectory, twist, min(scale, let), limited_by, manipulability)

    def _bends_out(self, positions):
        """Whether a window of positions (N, n) that brakes in a curve ends beyond the box."""
        here, there = (self._workspace.beyond(self._robot.pose(place)[:3, 3])
                       for place in positions[[0, -1]])
        return bool((there > here + BENT).any())

    def in_time(self, command: Trajectory, age: float) -> bool:
        """
        Whether the newest command may still be sent at this age [s].

        If not, the robot's controller would have left its course by then: it is forgotten, and
        what was sent before goes on.
        """
        if age <= max(self._ahead, command.times[0]) or self._before is None:
            return True
        self._now = self._before
        return False

    def _watch(self, brought, limited_by, dt):
        """Count for how long the wanted motion has been held back."""
        if brought > HELD_BACK:
            self.reset_blocked()
            return
        self._held_back += dt
        if self._held_back >= BLOCKED_AFTER:
            self.blocked = limited_by or 'singularity'
            kind, _, joint = limited_by.partition(' of ')
            if kind == 'position':
                index = self._limits.names.index(joint)
                low, high = self._limits.lower[index], self._limits.upper[index]
                side, end = (('lower', low) if self.positions[index] - low
                             < high - self.positions[index] else ('upper', high))
                self.blocked = f'{joint} is at its {side} limit, {end:g}'


@njit(cache=True)
def _onward(times, places, speeds, kept, bounds, velocities, bias, period, coasting, coast,
            jacobian, wanted, damping, rotation_length):
    """
    Write the window on from its first `kept` points, which are committed, and its velocities.

    These are the limited ones of those asked for; what limits them, and their progress.
    """
    velocities[:], scale, kind, joint = nearest(
        *bounds, places[kept - 1], speeds[kept - 1], velocities, period, coast)
    # Joint rates that keep a twist change as the arm bends; they do while the window coasts.
    bend, _ = least_squares(jacobian, -bias, damping, rotation_length)
    coasted = coasting_velocities(*bounds, places[kept - 1], speeds[kept - 1], velocities, bend,
                                  coasting, period + coast)
    window = extended(Window(times[:kept], places[:kept], speeds[:kept]), velocities, coasted,
                      period, coasting, bounds[3])
    count = len(window.times)
    times[:count], places[:count], speeds[:count] = window
    return scale, kind, joint, progress(jacobian, velocities, wanted, rotation_length)
