"""
Simulated robot: a joint_trajectory_controller, and joints that lag behind it.

The controller samples in the same way as that of ros2_controllers 4 and 5 (Jazzy, Kilted) with
position command interfaces (joint_trajectory_controller.cpp, trajectory.cpp), including the
transitions between trajectories. At time t it commands the trajectory's state one period later.
Where a new trajectory is joined to that command, it treats the command as the state at time t. A
trajectory whose first point is in the past is played unchanged. Its messages of rejection are the
same. Some inputs that it accepts are always mistakes (numbers that are not finite, a joint named
twice, a time before the start); they are rejected here.
"""
from bisect import bisect_right
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np

from tactile_common.config import bounded
from tactile_common.errors import ConfigurationError, Rejected
from tactile_servo.motion.trajectory import Trajectory
from tactile_simulation.plant import DelayedLag

_VELOCITY_AT_END = float(np.finfo(np.float32).eps)  # rad/s; the controller's limit for zero
LONGEST_STALL = 0.5  # s, longest delay that is caught up; a clock that jumps farther is set anew
_TOLERANCE = 1e-6  # relative; smaller violations of a limit are rounding errors


@dataclass(frozen=True)
class MockRobotConfig:
    """Parameters of the mock robot."""

    robot_description: str = field(default='', metadata={
        'doc': 'URDF of the robot: path of a file, or the XML itself'})
    tip_frame: str = field(default='tactile_pad', metadata={
        'doc': 'link of the URDF that is the sensor frame'})
    scene: str = field(default='', metadata={
        'doc': "scene file whose start pose the sensor begins at; '' = none"})
    initial_positions: tuple[float, ...] = field(default=(), metadata={
        'doc': 'joint positions at the start or, with a scene, where the search for those of '
               'its start pose begins; [] = chosen', 'unit': 'rad'})
    rate: float = bounded(
        500.0, 'rate of the controller and of the joint states', 'Hz', 10.0, 2000.0)
    dead_time: float = bounded(0.0025, 'time from a command to the first motion', 's', 0.0, 1.0)
    lag: float = bounded(
        0.010, 'time constant with which a joint follows its command', 's', 0.0, 1.0)
    interpolate_from_desired_state: bool = field(default=True, metadata={
        'doc': 'start a new trajectory from the desired, not from the measured state'})
    controller: str = field(default='/joint_trajectory_controller', metadata={
        'doc': 'name of the controller; its topic is joint_trajectory below it'})


def _basis(known: int) -> np.ndarray:
    """
    Return polynomials of u in [0, 1] that each meet one of 2 * known conditions, (3, 2k, 2k).

    The array contains the coefficients of u^0, u^1, ... of the values and of their first and
    second derivatives.
    """
    derivative = np.diag(np.arange(1.0, 2 * known), 1)
    orders = [np.linalg.matrix_power(derivative, order) for order in range(3)]
    at_ends = np.array([*(it[0] for it in orders[:known]), *(
        it.sum(axis=0) for it in orders[:known])])
    return np.stack(orders) @ np.linalg.inv(at_ends)


_BASES = {known: _basis(known) for known in (1, 2, 3)}


def hermite(first: np.ndarray, last: np.ndarray, duration: float) -> np.ndarray:
    """
    Return the polynomial of least degree between two states `duration` [s] apart, u from 0 to 1.

    Each state is (1 to 3, n): position, velocity, acceleration; rows that only one state has are
    not used. The result contains the coefficients (3, powers of u, n) of position, velocity and
    acceleration.
    """
    known = min(len(first), len(last))
    scale = duration ** np.arange(3.0)[:, None]
    conditions = np.concatenate([scale[:known] * first[:known], scale[:known] * last[:known]])
    return _BASES[known] @ conditions / scale[:, None]


class Spline:
    """
    A trajectory as polynomials in time, beginning at a state before its first point.

    A segment is quintic if position, velocity and acceleration are known at both ends, cubic if
    position and velocity are known, otherwise linear. After the end the state stays at the last
    point. A first point that is not in the future is reached at once. A segment's polynomial is
    computed when the segment is reached, because most trajectories of a stream are replaced during
    their first segment.

    Parameters
    ----------
    before, state : float, ndarray (2 or 3, n)
        Time [s] at which the motion to the first point begins, and the state at this time:
        position, velocity and, if known, acceleration.
    start : float
        Time to which the trajectory's times are relative [s].
    trajectory : Trajectory
    order : list of int, or slice
        Columns of the trajectory in the order of the joints.
    """

    def __init__(self, before: float, state: np.ndarray, start: float, trajectory: Trajectory,
                 order: list[int] | slice):
        rows = [trajectory.positions]
        if trajectory.velocities is not None:
            rows.append(trajectory.velocities)
            if trajectory.accelerations is not None:
                rows.append(trajectory.accelerations)
        self._times = [before, *(start + np.asarray(trajectory.times, dtype=float)).tolist()]
        self._states = [state, *np.stack(rows, axis=1)[:, :, order]]
        self._segment = 0  # segment of the polynomial
        self._polynomial: np.ndarray = np.empty((3, 0, 0))

    def sample(self, now: float) -> np.ndarray:
        """Return position, velocity and acceleration (3, n) at a time [s]."""
        segment = bisect_right(self._times, now, lo=1)  # index of its end point
        if segment == len(self._times):
            last = self._states[-1]
            return np.concatenate([last, np.zeros((3 - len(last), last.shape[1]))])
        begin, end = self._times[segment - 1:segment + 1]
        if segment != self._segment:
            self._segment, self._polynomial = segment, hermite(
                self._states[segment - 1], self._states[segment], end - begin)
        powers = np.arange(self._polynomial.shape[1])
        return ((now - begin) / (end - begin)) ** powers @ self._polynomial


class Late(Rejected):
    """A trajectory that had ended when it arrived: nothing moves, and the next one is in time."""


class MockController:
    """
    Accepts trajectories, interpolates them and moves joints within their limits.

    Parameters
    ----------
    joint_names : sequence of str
        Order of every joint vector (n joints).
    lower, upper, velocity_limit : array_like (n,)
        Limits of position (infinite if there are none) and velocity [rad or m, per s].
    initial_positions : array_like (n,)
        Positions of the joints until a trajectory arrives [rad or m].
    rate, dead_time, lag, interpolate_from_desired_state
        As in `MockRobotConfig`.

    Attributes
    ----------
    commanded : ndarray (3, n)
        Position, velocity and acceleration commanded by the newest step.
    active : bool
        True if trajectories are accepted; see `activate`.
    limit_violations : int
        Number of steps whose command was clamped to a position or velocity limit.

    Raises
    ------
    ConfigurationError
        A vector has the wrong length or a value is out of bounds.
    """

    def __init__(self, joint_names, lower, upper, velocity_limit, *, initial_positions,
                 rate=MockRobotConfig.rate, dead_time=MockRobotConfig.dead_time,
                 lag=MockRobotConfig.lag,
                 interpolate_from_desired_state=MockRobotConfig.interpolate_from_desired_state):
        self.joint_names = tuple(joint_names)
        self._lower, self._upper, self._velocity_limit, start = (
            self._vector(name, values) for name, values in (
                ('lower', lower), ('upper', upper), ('velocity_limit', velocity_limit),
                ('initial_positions', initial_positions)))
        if not np.all(self._velocity_limit > 0.0):
            raise ConfigurationError(f'velocity_limit: {self._velocity_limit} must be above 0')
        for name, q, low, high in zip(
                self.joint_names, start, self._lower, self._upper, strict=True):
            if not low <= q <= high:
                raise ConfigurationError(
                    f'initial_positions: {name} = {q:.6g}, must be within {low:.6g}..{high:.6g}')
        self.interpolate_from_desired_state = interpolate_from_desired_state
        self._period, self._joints = 1.0 / rate, DelayedLag(start, dead_time, lag)
        self.limit_violations, self.active = 0, True
        self._restart(start)

    def _vector(self, name, values):
        vector = np.array(values, dtype=float)
        if vector.shape != (len(self.joint_names),) or np.any(np.isnan(vector)):
            raise ConfigurationError(
                f'{name}: {vector.tolist()}, must be {len(self.joint_names)} numbers, one a joint')
        return vector

    def _restart(self, positions):
        self._time: float | None = None
        self._hold()
        self.commanded = np.zeros((3, len(positions)))
        self.commanded[0] = self._command = positions

    def _hold(self):
        self._spline: Spline | None = None
        self._pending: tuple[Trajectory, Any] | None = None

    def activate(self, active: bool) -> None:
        """
        Accept trajectories, or stop accepting them, as when a controller manager switches.

        In both cases the robot stops at once at its last commanded position.
        """
        self.active = active
        self._hold()
        self.commanded[0], self.commanded[1:] = self._command, 0.0

    def accept(self, trajectory: Trajectory, now: float) -> None:
        """
        Execute a trajectory from the next step on, or raise an error and change nothing.

        Its joints may have any order; `now` is the time of the clock of its stamp [s]. A
        controller that is not active checks the trajectory and drops it.

        Raises
        ------
        Rejected
            The message contains the reason.
        """
        self._check(trajectory, now)
        names = trajectory.joint_names
        order = (slice(None) if names == self.joint_names
                 else [names.index(name) for name in self.joint_names])
        if self.active:
            self._pending = trajectory, order

    def _check(self, trajectory, now):
        names, times = trajectory.joint_names, np.asarray(trajectory.times, dtype=float).tolist()
        if len(names) != len(self.joint_names):
            raise Rejected("Joints on incoming trajectory don't match the controller joints.")
        if len(times) == 0:
            raise Rejected('Empty trajectory received.')
        for name in names:
            if name not in self.joint_names:
                raise Rejected(f"Incoming joint {name} doesn't match the controller's joints.")
        if len(set(names)) < len(names):
            raise Rejected(f'Incoming joints {", ".join(names)}: one is named twice.')
        for name in ('times', 'positions', 'velocities', 'accelerations'):
            values = getattr(trajectory, name)
            missing = values is None and name == 'positions'
            if missing or not (values is None or np.isfinite(values).all()):
                raise Rejected(f'{name} must be finite numbers')
        if trajectory.velocities is not None:
            for name, velocity in zip(names, trajectory.velocities[-1].tolist(), strict=True):
                if abs(velocity) > _VELOCITY_AT_END:
                    raise Rejected(f'Velocity of last trajectory point of joint {name} is not '
                                   f'zero: {velocity:.15f}')
        start = 1e-9 * trajectory.stamp_ns
        if start != 0.0 and start + times[-1] < now:
            raise Late(f'Received trajectory with non-zero start time ({start:f}) that ends '
                       f'in the past ({start + times[-1]:f})')
        if times[0] < 0.0:
            raise Rejected(f'Time of point 0 is {times[0]:f}, before the start')
        for k, (time, after) in enumerate(pairwise(times)):
            if after <= time:
                raise Rejected(f'Time between points {k} and {k + 1} is not strictly increasing, '
                               f'it is {time:f} and {after:f} respectively')

    def step(self, now: float) -> tuple[np.ndarray, np.ndarray]:
        """
        Advance to a time [s] at the controller's rate; return measured positions and velocities.

        Both have shape (n,). If the time jumps back, the robot stops where it is and starts again.
        """
        if now == self._time:
            return self.measured(now)
        if self._time is not None and now < self._time:
            self._restart(self._joints.position)
            self._joints.restart()
        measured = self._joints.advance(now)
        elapsed = self._period if self._time is None else now - self._time
        if self._pending is not None:
            self._take_over(*self._pending, now, measured)
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

    def _take_over(self, trajectory, order, now, measured):
        self._pending = None
        before, state = now, np.array(measured)
        if self.interpolate_from_desired_state:
            # The command for one period after the last step counts as the state at that step.
            before, state = now if self._time is None else self._time, self.commanded
        start = 1e-9 * trajectory.stamp_ns or now
        self._spline = Spline(before, state, start, trajectory, order)

    def _limited(self, wanted, elapsed):
        """Return the command (n,) within the limits; count the step if they changed it."""
        reach, before = self._velocity_limit * elapsed, self._command
        command = np.clip(wanted, self._lower, self._upper)
        command = np.clip(command, before - reach, before + reach)
        self.limit_violations += bool((abs(command - wanted) > _TOLERANCE * reach + 1e-9).any())
        self._command = command
        return command
