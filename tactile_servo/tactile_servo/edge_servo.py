"""
Edge tracking by touch: contact state machine around the resolved-rate servo (chapter 5).

`idle -> approach -> track -> retreat -> done`, and from anywhere `hold` with its reason. The
servo reads no clock: stamps and steady times come in with the data.
"""

from collections import namedtuple
from dataclasses import dataclass, field
from enum import IntEnum

import numpy as np

from tactile_servo.errors import ConfigurationError
from tactile_servo.limits import limit_velocities
from tactile_servo.resolved_rate import (
    alignment_scale, contact_scale, edge_features, edge_twist, ResolvedRateConfig)
from tactile_servo.robot import damped_least_squares
from tactile_servo.statistics import TrackStatistics
from tactile_servo.window import stopping_window

NAN = float('nan')


class State(IntEnum):
    """States of a servo; the numbers of ServoStatus.msg."""

    IDLE = 0
    APPROACH = 1
    TRACK = 2
    CORNER = 3
    SEARCH = 4
    RETREAT = 5
    DONE = 6
    HOLD = 7


@dataclass(frozen=True)
class EdgeServoConfig:
    """Bounds of the servo, beside the gains of `ResolvedRateConfig`."""

    rate: float = field(default=400.0, metadata={
        'doc': 'control cycles per second', 'unit': 'Hz', 'range': (10.0, 2000.0)})
    array_half_width: float = field(default=0.0127, metadata={
        'doc': 'half the size of the tactel array', 'unit': 'm', 'range': (0.001, 1.0)})
    max_speed: float = field(default=0.2, metadata={
        'doc': 'largest speed along the edge that a goal may ask for', 'unit': 'm/s',
        'range': (0.001, 2.0)})
    max_force: float = field(default=10.0, metadata={
        'doc': 'largest force that a goal may ask for', 'unit': 'N', 'range': (0.1, 1e3)})
    max_load: float = field(default=12.0, metadata={
        'doc': 'the pad is lifted off above this force', 'unit': 'N', 'range': (0.1, 1e4)})
    contact_force: float = field(default=0.5, metadata={
        'doc': 'force that ends the approach', 'unit': 'N', 'range': (0.01, 100.0)})
    approach_speed: float = field(default=0.01, metadata={
        'doc': 'speed along the normal towards the object, and away from it', 'unit': 'm/s',
        'range': (1e-4, 0.1)})
    approach_distance: float = field(default=0.03, metadata={
        'doc': 'the approach gives up after this way', 'unit': 'm', 'range': (0.001, 1.0)})
    retreat_distance: float = field(default=0.01, metadata={
        'doc': 'how far the pad lifts off at the end', 'unit': 'm', 'range': (0.0, 1.0)})
    press_depth: float = field(default=0.003, metadata={
        'doc': 'the force loop may press this much deeper than where it last met half of the '
               'force',
        'unit': 'm', 'range': (1e-4, 0.1)})
    max_acceleration: float = field(default=1.0, metadata={
        'doc': 'acceleration along the edge', 'unit': 'm/s^2', 'range': (0.01, 100.0)})
    end_of_edge: float = field(default=0.35, metadata={
        'doc': 'the edge ends when the centre of pressure falls behind by this fraction of '
               'half the array', 'range': (0.1, 1.0)})
    stale_image: float = field(default=0.05, metadata={
        'doc': 'hold when no image came for this long', 'unit': 's', 'range': (0.002, 10.0)})
    stale_joints: float = field(default=0.05, metadata={
        'doc': 'hold when no joint state came for this long', 'unit': 's',
        'range': (0.002, 10.0)})
    max_stamp_age: float = field(default=0.1, metadata={
        'doc': 'hold when the newest stamp is older, or further in the future, than this',
        'unit': 's', 'range': (0.005, 10.0)})
    edge_lost: float = field(default=0.05, metadata={
        'doc': 'hold when the images show no edge for this long', 'unit': 's',
        'range': (0.002, 10.0)})
    resume_within: float = field(default=0.5, metadata={
        'doc': 'a hold whose cause goes away within this time ends by itself; a longer one '
               'waits for ~/pause false', 'unit': 's', 'range': (0.0, 60.0)})
    give_up: float = field(default=30.0, metadata={
        'doc': 'a hold that nobody ended by then aborts the goal', 'unit': 's',
        'range': (0.1, 3600.0)})
    following_error: float = field(default=0.15, metadata={
        'doc': 'hold when a joint is this far from where it was commanded', 'unit': 'rad',
        'range': (0.001, 3.0)})
    damping: float = field(default=0.01, metadata={
        'doc': 'damping of the inverse Jacobian near a singularity', 'range': (1e-6, 1.0)})
    rotation_length: float = field(default=0.04, metadata={
        'doc': 'length that weighs rotation against position', 'unit': 'm/rad',
        'range': (1e-3, 1.0)})

    def __post_init__(self):
        if not self.max_force < self.max_load:
            raise ConfigurationError(
                f'max_force: {self.max_force} N is not below max_load, {self.max_load} N')


@dataclass(frozen=True)
class EdgeGoal:
    """
    What to track, as in TrackEdge.action.

    speed [m/s]; force [N]; direction +1 or -1 along the sensor's y; length [m], 0 = until the
    edge ends; retreat at the end.
    """

    speed: float
    force: float
    direction: int = 1
    length: float = 0.0
    retreat: bool = True


@dataclass(frozen=True)
class Status:
    """One control cycle, as in ServoStatus.msg; SI units, NaN = unknown."""

    state: State
    reason: str
    contact_stamp_ns: int = 0
    contact_fresh: bool = False
    joints_fresh: bool = False
    lateral_error: float = NAN
    angle_error: float = NAN
    normal_force: float = NAN
    force_target: float = NAN
    speed: float = 0.0
    progress: float = 0.0
    twist: np.ndarray = field(default_factory=lambda: np.zeros(6))
    limit_scale: float = 1.0
    limited_by: str = ''
    manipulability: float = NAN


# Newest datum of a kind: value, its own stamp [ns] and steady time of arrival [s].
Sample = namedtuple('Sample', 'value stamp_ns arrival')


class EdgeServo:
    """
    Drive a robot along an edge by touch.

    Feed it with `see_joints` and `see_contact`, start it with `start`, call `cycle` at the
    control rate and send what it returns.

    Parameters
    ----------
    robot : RobotModel
    limits : JointLimits
    config : EdgeServoConfig
    gains : ResolvedRateConfig
    workspace : WorkspaceBox, optional
    """

    def __init__(self, robot, limits, config=None, gains=None, workspace=None):
        self.robot, self.limits, self.workspace = robot, limits, workspace
        self.config, self.gains = config or EdgeServoConfig(), gains or ResolvedRateConfig()
        self.state, self.reason = State.IDLE, 'waiting for a goal'
        self.goal = None
        self.success = False
        self.statistics = None
        self.contact = self.joints = None
        self._paused = self._cancelled = False
        self._contact_fresh = self._joints_fresh = False
        self._resume_state = State.APPROACH
        self._features, self._edge_reason = None, 'edge lost'
        self._features_arrival = self._state_since = -np.inf
        self._commanded = self._velocities = None
        self._speed = 0.0
        self._anchor = None  # where the current way (approach, retreat, press depth) began
        self._last_ns = None

    # Input -------------------------------------------------------------------------------

    def see_joints(self, positions, stamp_ns, arrival):
        """
        Take a measured joint state (n,) [rad], its stamp [ns] and steady arrival time [s].

        Raises
        ------
        ValueError
            Wrong number of joints or a position that is not finite; the state is not used.
        """
        positions = np.asarray(positions, dtype=float)
        if positions.shape != self.limits.lower.shape or not np.isfinite(positions).all():
            raise ValueError(f'joint state {positions} is not {len(self.limits.names)} angles')
        self.joints = Sample(positions, stamp_ns, arrival)

    def see_contact(self, contact, stamp_ns, arrival):
        """Take a contact estimate, its image's stamp [ns] and steady arrival time [s]."""
        self.contact = Sample(contact, stamp_ns, arrival)
        features, why = edge_features(contact, self.config.array_half_width, self.gains)
        self._edge_reason = why
        if features is not None:
            self._features, self._features_arrival = features, arrival

    def check(self, goal):
        """Return why a goal cannot be accepted now, or '' if it can."""
        c = self.config
        if self.goal is not None:
            return 'busy: a goal is active; cancel it first'
        if self.joints is None:
            return 'no joint state has been received'
        for name, value, bound in (('speed', goal.speed, c.max_speed),
                                   ('force', goal.force, c.max_force)):
            if not 0.0 < value <= bound:
                return f'{name} {value:g} is outside 0..{bound:g}'
        if goal.force <= c.contact_force:
            return f'force {goal.force:g} N is not above contact_force, {c.contact_force:g} N'
        if not 0.0 <= goal.length < np.inf:
            return f'length {goal.length:g} is negative or not finite'
        if goal.direction not in (-1, 1):
            return f'direction {goal.direction} is neither +1 nor -1'
        return ''

    def start(self, goal, now):
        """
        Begin a goal at steady time `now` [s].

        Raises
        ------
        ValueError
            The goal cannot be accepted; the message says why.
        """
        why = self.check(goal)
        if why:
            raise ValueError(why)
        self.goal, self.success = goal, False
        self._paused = self._cancelled = False
        self.statistics = TrackStatistics(goal.force, goal.direction)
        self._features, self._features_arrival = None, -np.inf
        self._resume_state = State.APPROACH
        self._seed()
        self._enter(State.APPROACH, 'goal accepted', now)

    def cancel(self):
        """Stop within the robot's limits and end the goal."""
        self._cancelled = self.goal is not None

    def pause(self, paused, now):
        """Hold (true) or go on (false); returns whether there was a goal to act on."""
        if self.goal is None:
            return False
        self._paused = paused
        if not paused and self.state == State.HOLD and not self._standstill_reason():
            self._leave_hold(now, 'resumed')
        return True

    # Cycle -------------------------------------------------------------------------------

    def cycle(self, now, now_ns):
        """
        Decide one control cycle.

        Parameters
        ----------
        now : float
            Steady time [s].
        now_ns : int
            Time of the clock that stamps images and joint states [ns].

        Returns
        -------
        status : Status
        trajectory : Trajectory or None
            To send to the joint trajectory controller; None while no goal is active.
        """
        period = 1.0 / self.config.rate
        # By the clock of the stamps: under simulated time the robot moves by that one.
        dt = period if self._last_ns is None else (now_ns - self._last_ns) * 1e-9
        dt = min(max(dt, 0.0), 2.0 * period)
        self._last_ns = now_ns
        self._contact_fresh = self._fresh(self.contact, self.config.stale_image, now, now_ns)
        self._joints_fresh = self._fresh(self.joints, self.config.stale_joints, now, now_ns)
        known = {'contact_fresh': self._contact_fresh, 'joints_fresh': self._joints_fresh,
                 'contact_stamp_ns': self.contact.stamp_ns if self.contact else 0,
                 'normal_force': self._load() if self.contact else NAN}
        if self.goal is None or dt <= 0.0:
            return Status(self.state, self.reason, **known), None
        pose = self.robot.pose(self.joints.value)
        self.statistics.move(pose, self.state == State.TRACK)
        self._decide(now, pose)
        status, trajectory = self._command(self._twist(dt), dt, known)
        if self.state == State.DONE:
            self.goal = None
        return status, trajectory

    def finish(self):
        """Go from done to idle, once the result has been taken."""
        self.state, self.reason = State.IDLE, f'waiting for a goal; last: {self.reason}'

    @staticmethod
    def _stamp_gap(sample, now_ns):
        return abs(now_ns - sample.stamp_ns) * 1e-9

    def _fresh(self, sample, limit, now, now_ns):
        return (sample is not None and now - sample.arrival <= limit
                and self._stamp_gap(sample, now_ns) <= self.config.max_stamp_age)

    def _seed(self):
        """Start from the measured state, never from an old target."""
        self._commanded = self.joints.value.copy()
        self._velocities = np.zeros_like(self._commanded)
        self._speed = 0.0
        self._anchor = self.robot.pose(self._commanded)

    def _enter(self, state, reason, now):
        self.state, self.reason, self._state_since = state, reason, now
        self._anchor = self.robot.pose(self._commanded)

    def _advance(self):
        """How far the commanded sensor stands beyond the anchor along its own normal [m]."""
        here = self.robot.pose(self._commanded)
        return float((here[:3, 3] - self._anchor[:3, 3]) @ self._anchor[:3, 2])

    def _standstill_reason(self):
        """Why the robot must stand still whatever the edge does, or ''."""
        if self._paused:
            return 'paused'
        if not self._joints_fresh:
            return 'joint state is stale' if self.joints else 'no joint state'
        if not self._contact_fresh and self.state != State.RETREAT:
            return 'tactile image is stale' if self.contact else 'no tactile image'
        behind = np.abs(self._commanded - self.joints.value)
        if np.max(behind) > self.config.following_error:
            return f'robot does not follow: {self.limits.names[int(np.argmax(behind))]}'
        return ''

    def _decide(self, now, pose):
        why = self._standstill_reason()
        if self._cancelled:
            self._decide_cancelled(now)
        elif self.state == State.HOLD:
            self._decide_hold(now, why)
        elif why:
            self._hold(now, why)
        elif self._load() > self.config.max_load and self.state != State.RETREAT:
            self._end(now, False, f'overload: {self._load():.1f} N', lift=True)
        elif self.state == State.APPROACH:
            self._decide_approach(now)
        elif self.state == State.TRACK:
            self._decide_track(now, pose)
        elif self.state == State.RETREAT and -self._advance() >= self.config.retreat_distance:
            self._done_when_standing(now)

    def _load(self):
        """Normal force of the newest image [N]; the larger of what is fitted and summed."""
        contact = self.contact.value
        loads = [force for force in (contact.normal_force, contact.moments.m0)
                 if np.isfinite(force)]
        return max(loads, default=0.0)

    def _decide_approach(self, now):
        c = self.config
        if self._load() >= c.contact_force and self._edge_age(now) < c.edge_lost:
            self.statistics.touch()
            self._enter(State.TRACK, 'contact', now)
        elif self._load() >= self.goal.force:
            self._end(now, False, f'contact on approach, but {self._edge_reason}', lift=True)
        elif self._advance() >= c.approach_distance:
            self._end(now, False, f'no contact within {c.approach_distance:g} m', lift=True)

    def _edge_age(self, now):
        return now - self._features_arrival

    def _decide_track(self, now, pose):
        goal, c = self.goal, self.config
        if self._edge_age(now) > c.edge_lost:
            if self._load() < c.contact_force and goal.length == 0.0 and (
                    self.statistics.length > 2.0 * c.array_half_width):
                self._end(now, True, 'the edge ended')
            else:
                self._hold(now, self._edge_reason or 'edge lost')
            return
        self.statistics.see(self._features, pose, self.contact.stamp_ns)
        if self._features.force >= 0.5 * goal.force:
            self._anchor = self.robot.pose(self._commanded)  # as deep as is known to be sound
        ahead = goal.direction * self._features.remaining
        if goal.length and self.statistics.length >= goal.length:
            self._end(now, True, 'length reached')
        elif ahead < -c.end_of_edge * c.array_half_width and (
                self.statistics.length > 2.0 * c.array_half_width):
            self._end(now, goal.length == 0.0, 'the edge ended')
        elif self._advance() > c.press_depth:
            self._end(now, False, f'went {c.press_depth:g} m deeper without meeting the force',
                      lift=True)

    def _hold(self, now, reason):
        self._resume_state = self.state
        self.state, self.reason, self._state_since = State.HOLD, reason, now

    def _decide_hold(self, now, why):
        if why:
            self.reason = why
        held = now - self._state_since
        edge_needed = self._resume_state == State.TRACK
        back = not why and (not edge_needed or self._edge_age(now) < self.config.edge_lost)
        if back and held <= self.config.resume_within:
            self._leave_hold(now, 'input is back')
        elif not self._paused and held > self.config.give_up:
            self._end(now, False, f'gave up: {self.reason}')
        elif back and 'resume' not in self.reason:
            self.reason += '; input is back: resume with ~/pause false'

    def _leave_hold(self, now, reason):
        """Go on from the measured state."""
        anchor = self._anchor
        self._seed()
        self._enter(self._resume_state, reason, now)
        self._anchor = anchor  # the way already gone still counts

    def _decide_cancelled(self, now):
        self.reason = 'cancelled'
        self.state = State.HOLD
        self._done_when_standing(now)

    def _end(self, now, success, reason, lift=False):
        """End the goal: lift off where that is asked for or needed, else stop."""
        self.success = success
        can_move = not self._standstill_reason()
        if (lift or self.goal.retreat) and can_move:
            self._enter(State.RETREAT, reason, now)
        else:
            self._cancelled = True
            self._decide_cancelled(now)
            self.reason = reason

    def _done_when_standing(self, now):
        if not np.any(self._velocities):
            self.state = State.DONE

    # Motion ------------------------------------------------------------------------------

    def _twist(self, dt):
        """Return the wanted twist of the sensor in its own frame (6,) [m/s, rad/s]."""
        c, goal = self.config, self.goal
        speed, twist = 0.0, np.zeros(6)
        if self.state == State.APPROACH:
            twist[2] = c.approach_speed
        elif self.state == State.RETREAT and -self._advance() < c.retreat_distance:
            twist[2] = -c.approach_speed
        elif self.state == State.TRACK:
            features = self._features
            speed = goal.speed * min(alignment_scale(features, c.array_half_width),
                                     contact_scale(features, goal.force))
            twist = edge_twist(features, 0.0, goal.force, self.gains)
        change = c.max_acceleration * dt
        self._speed += float(np.clip(speed - self._speed, -change, change))
        if self.state == State.TRACK:
            twist[1] = goal.direction * self._speed
        return twist

    def _command(self, twist, dt, known):
        """Turn a twist into joint velocities within every limit, and integrate them."""
        c = self.config
        commanded_pose = self.robot.pose(self._commanded)
        limited_by = ''
        if self.workspace is not None:
            rotation = commanded_pose[:3, :3]
            horizon = dt + 2.0 * self.limits.stopping_time
            linear, clipped = self.workspace.limit(
                commanded_pose[:3, 3], rotation @ twist[:3], horizon)
            twist = np.concatenate([rotation.T @ linear, twist[3:]])
            limited_by = 'workspace' if clipped else ''
        wanted, manipulability = damped_least_squares(
            self.robot.jacobian(self._commanded), twist, damping=c.damping,
            rotation_length=c.rotation_length)
        self._velocities, scale, joint_limit = limit_velocities(
            self.limits, self._commanded, self._velocities, wanted, dt)
        self._commanded = self._commanded + self._velocities * dt
        features = self._features if self._features_arrival > -np.inf else None
        tracking = features is not None and self.state in (State.TRACK, State.HOLD)
        status = Status(
            self.state, self.reason, **known,
            lateral_error=features.lateral if tracking else NAN,
            angle_error=features.yaw if tracking else NAN,
            force_target=self.goal.force, speed=self._speed, progress=self.statistics.length, twist=twist, limit_scale=scale,
            limited_by=limited_by or joint_limit, manipulability=manipulability)
        return status, stopping_window(
            self.limits, self._commanded, self._velocities, lookahead=2.0 / c.rate)
