"""
Simulated robot: a joint_trajectory_controller, and joints that lag behind it.

The controller samples as that of ros2_controllers 4 and 5 (Jazzy, Kilted) with position command
interfaces (joint_trajectory_controller.cpp, trajectory.cpp). At time t it commands the
trajectory's state one period later. Where a new trajectory is joined to that command, it treats
the command as the state at time t. A trajectory whose first point is in the past is played
unchanged. Unlike the real one it plays only finite positions with velocities.
"""
from bisect import bisect_right
from collections import deque
import math
from typing import Any

import numpy as np

from tactile_common.errors import ConfigurationError, Rejected
from tactile_servo.motion.trajectory import Trajectory
from tactile_simulation.world import Plant

RATE = 500.0  # Hz
LONGEST_STALL = 0.5  # s, longest delay that is caught up; a clock that jumps farther is set anew
_VELOCITY_AT_END = float(np.finfo(np.float32).eps)  # rad/s; the controller's limit for zero
_TOLERANCE = 1e-6  # relative; smaller violations of a limit are rounding errors


class Late(Rejected):
    """A trajectory that had ended when it arrived: nothing moves, and the next one is in time."""


class Spline:
    """
    Cubic polynomials from a state (2 or 3, n) at a time [s] through the points of a trajectory.

    The times of the trajectory are relative to `start` [s]. After the end the state stays at the
    last point. A first point that is not in the future is reached at once.
    """

    def __init__(self, before: float, state: np.ndarray, start: float, trajectory: Trajectory):
        self._times = [before, *(start + trajectory.times).tolist()]
        self._positions = [state[0], *trajectory.positions]
        self._velocities = [state[1], *np.asarray(trajectory.velocities)]

    def sample(self, now: float) -> np.ndarray:
        """Return position, velocity and acceleration (3, n) at a time [s]."""
        index = bisect_right(self._times, now, lo=1)  # of the segment's end
        if index == len(self._times):
            last = self._positions[-1]
            return np.array([last, np.zeros_like(last), np.zeros_like(last)])
        begin, end = self._times[index - 1:index + 1]
        (p0, p1), (v0, v1) = (
            values[index - 1:index + 1] for values in (self._positions, self._velocities))
        span, u = end - begin, (now - begin) / (end - begin)
        mean = (p1 - p0) / span
        square, cube = 3.0 * mean - 2.0 * v0 - v1, v0 + v1 - 2.0 * mean
        return np.array([p0 + span * u * (v0 + u * (square + u * cube)),
                         v0 + u * (2.0 * square + 3.0 * u * cube),
                         (2.0 * square + 6.0 * u * cube) / span])


class MockController:
    """
    Accepts trajectories, interpolates them and moves joints within their limits.

    Parameters
    ----------
    robot : RobotModel
        Its joint names, position and velocity limits are used.
    positions : array_like (n,)
        Positions of the joints until a trajectory arrives [rad or m]. A ConfigurationError is
        raised if they are not one for each joint, within its limits.
    plant : Plant
        Dead time and lag of the joints.
    rate : float
        Of the controller [Hz].
    from_desired : bool
        As the controller's `interpolate_from_desired_state`: a new trajectory starts from the
        desired, not from the measured state.

    Attributes
    ----------
    commanded : ndarray (3, n)
        Position, velocity and acceleration commanded by the newest step.
    limit_violations : int
        Number of steps whose command was clamped to a position or velocity limit.
    """

    def __init__(self, robot: Any, positions: Any, plant: Plant, *, rate: float = RATE,
                 from_desired: bool = True):
        self._robot, start = robot, np.array(positions, dtype=float)
        if start.shape != robot.lower.shape:
            raise ConfigurationError(f'initial positions: {start.tolist()}, must be '
                                     f'{len(robot.joint_names)} numbers, one a joint')
        for name, q, low, high in zip(
                robot.joint_names, start, robot.lower, robot.upper, strict=True):
            if not low <= q <= high:
                raise ConfigurationError(
                    f'initial positions: {name} = {q:.6g}, must be within {low:.6g}..{high:.6g}')
        self._plant, self._from_desired, self._period = plant, from_desired, 1.0 / rate
        self.limit_violations, self._active = 0, True
        self._restart(start)

    def _restart(self, positions: np.ndarray) -> None:
        self._time: float | None = None
        self._command = positions
        self._joints = DelayedLag(positions, self._plant.dead_time, self._plant.lag)
        self.activate(self._active)

    def activate(self, active: bool) -> None:
        """Stop at the last commanded position; from now on accept trajectories, or drop them."""
        self._active = active
        self._spline: Spline | None = None
        self._pending: Trajectory | None = None
        self.commanded = np.array([self._command, *np.zeros((2, len(self._command)))])

    def accept(self, trajectory: Trajectory, now: float) -> None:
        """
        Execute a trajectory from the next step on, or raise Rejected and change nothing.

        `now` is the time of the clock of its stamp [s].
        """
        names, times = trajectory.joint_names, trajectory.times
        if names != self._robot.joint_names:
            raise Rejected(f'joints are {", ".join(names) or "none"}, must be '
                           f'{", ".join(self._robot.joint_names)}')
        if len(times) == 0 or trajectory.velocities is None:
            raise Rejected('the trajectory has no points with velocities')
        for name in ('times', 'positions', 'velocities'):
            if not np.isfinite(getattr(trajectory, name)).all():
                raise Rejected(f'{name} must be finite numbers')
        if times[0] < 0.0 or (np.diff(times) <= 0.0).any():
            raise Rejected('times must not be negative, and strictly increase')
        if (abs(trajectory.velocities[-1]) > _VELOCITY_AT_END).any():
            raise Rejected('velocity of the last point is not zero')
        end = 1e-9 * trajectory.stamp_ns + times[-1]
        if trajectory.stamp_ns and end < now:
            raise Late(f'the trajectory has ended {now - end:.6f} s ago')
        if self._active:
            self._pending = trajectory

    def step(self, now: float) -> tuple[np.ndarray, np.ndarray]:
        """
        Advance to a time [s] at the controller's rate; return measured positions and velocities.

        Both have shape (n,). If the time jumps back, the robot stops where it is and starts again.
        """
        if now == self._time:
            return self.measured(now)
        if self._time is not None and now < self._time:
            self._restart(self._joints.position)
        measured = self._joints.advance(now)
        elapsed = self._period if self._time is None else now - self._time
        if self._pending is not None:
            before, state = now, np.array(measured)
            if self._from_desired:
                # The command for one period after the last step counts as the state at that step.
                before, state = now if self._time is None else self._time, self.commanded
            start = 1e-9 * self._pending.stamp_ns or now
            self._spline, self._pending = Spline(before, state, start, self._pending), None
        if self._spline is not None:
            self.commanded = self._spline.sample(now + self._period)
        self._time = now
        self._joints.command(now + self._period, self._limited(self.commanded[0], elapsed))
        return measured

    def run_to(self, now: float) -> tuple[np.ndarray, np.ndarray]:
        """
        Step at the controller's rate up to a time [s], even if it is late; return as `step`.

        A real controller has a thread that keeps its period under any load. A clock that jumps by
        more than `LONGEST_STALL` is taken as set anew.
        """
        if self._time is not None and now - self._time < LONGEST_STALL:
            while now - self._time > 1.5 * self._period:
                self.step(self._time + self._period)
        return self.step(now)

    def measured(self, now: float) -> tuple[np.ndarray, np.ndarray]:
        """Return positions and velocities (n,) of the joints at a time after the last step [s]."""
        return self._joints.advance(now)

    def _limited(self, wanted: np.ndarray, elapsed: float) -> np.ndarray:
        """Return the command (n,) within the limits; count the step if they changed it."""
        reach, before = self._robot.velocity_limit * elapsed, self._command
        command = np.clip(wanted, self._robot.lower, self._robot.upper)
        command = np.clip(command, before - reach, before + reach)
        self.limit_violations += bool((abs(command - wanted) > _TOLERANCE * reach + 1e-9).any())
        self._command = command
        return command


class DelayedLag:
    """
    Joints that are initially at rest at `position` (n,); `dead_time` and `lag` [s] may be 0.

    Commands are connected by straight lines; the last one is held. The solution is exact at any
    time.
    """

    def __init__(self, position: np.ndarray, dead_time: float, lag: float):
        self._dead_time, self._lag = dead_time, lag
        self.position = np.array(position, dtype=float)
        self.velocity = np.zeros_like(self.position)
        self._time = -math.inf
        self._last = -math.inf, self.position  # last knot that the joints have passed
        self._knots: deque[tuple[float, np.ndarray]] = deque()

    def command(self, when: float, position: np.ndarray) -> None:
        """Set a command `position` (n,) for a time [s] that is later than the one before."""
        self._knots.append((when + self._dead_time, position))

    def advance(self, now: float) -> tuple[np.ndarray, np.ndarray]:
        """Return position and velocity (n,) at a time [s], which must not go back."""
        if self._time == -math.inf:  # at rest until now
            self._time, self._last = now, (now, self.position)
        while self._time < now:
            since, start = self._last
            # After the last command: hold until now, so that the next line begins here.
            until, goal = self._knots[0] if self._knots else (now, start)
            end = min(until, now)
            if end > self._time:
                slope = (goal - start) / (until - since)
                self._follow(start + slope * (end - since), slope, end - self._time)
                self._time = end
            if until <= now:
                self._last = until, goal
                if self._knots:
                    self._knots.popleft()
        return self.position, self.velocity

    def _follow(self, command: np.ndarray, slope: np.ndarray, time: float) -> None:
        """Move for a time [s], at whose end the command that changes steadily is `command`."""
        if self._lag == 0.0:
            self.position, self.velocity = command, slope
            return
        settled = command - self._lag * slope
        off = self.position - (settled - slope * time)
        self.position = settled + off * math.exp(-time / self._lag)
        self.velocity = (command - self.position) / self._lag
