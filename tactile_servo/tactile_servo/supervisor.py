"""
Edge tracking by touch: the contact state machine around a tracker (chapter 5).

`idle -> approach -> track -> retreat -> done`, and from anywhere `hold` with its reason. The
servo reads no clock: stamps and steady times come in with the data.
"""

from collections import namedtuple
import math

import numpy as np

from tactile_sensing.types.contact import Reason
from tactile_servo.laws.resolved_rate import ResolvedRate
from tactile_servo.motion.joint_history import JointHistory
from tactile_servo.motion.motion import Motion
from tactile_servo.track_statistics import along_contour, TrackStatistics
from tactile_servo.types import EdgeServoConfig, NAN, State, Status, TRACKING, WINDOW_PERIODS

# Newest datum of a kind: value, its own stamp [ns] and steady time of arrival [s].
Sample = namedtuple('Sample', 'value stamp_ns arrival')


class EdgeServo:
    """
    Drive a robot along an edge by touch.

    Feed it with `see_joints`, `see_contact` and, if the tracker `sees_images`, `see_image`;
    start it with `start`, call `cycle` at the control rate and send what it returns. How to
    follow the edge is the tracker's affair, when to move at all is decided here.

    Parameters
    ----------
    robot : RobotModel
    limits : JointLimits
    config : EdgeServoConfig
    tracker : ResolvedRate or Trace, optional
    workspace : WorkspaceBox, optional

    Attributes
    ----------
    pose : ndarray, shape (4, 4)
        Measured pose of the sensor; None before the first joint state.
    """

    def __init__(self, robot, limits, config=None, tracker=None, workspace=None):
        self.robot, self.limits = robot, limits
        self.config = config or EdgeServoConfig()
        self.motion = Motion(
            robot, limits, self.config, WINDOW_PERIODS / self.config.rate, workspace)
        self.tracker = tracker or ResolvedRate(self.config)
        self.state, self.reason = State.IDLE, 'waiting for a goal'
        self.goal = None
        self.success = False
        self.statistics = None
        self.contact = self.joints = self.pose = None
        self._load = 0.0
        self._paused, self._stopping, self._outcome = False, '', ''
        self._contact_fresh = self._joints_fresh = False
        self._resume_state = State.APPROACH
        self._history = JointHistory(limits)
        self._state_since = -np.inf
        self._anchor = None  # where the current way (approach, retreat, press depth) began
        self._last_ns = None

    # Input -------------------------------------------------------------------------------

    def see_joints(self, positions, stamp_ns, arrival):
        """
        Take a measured joint state (n,) [rad], its stamp [ns] and steady arrival time [s].

        Raises
        ------
        ValueError
            It cannot be believed, see `JointHistory.add`.
        """
        positions = self._history.add(positions, stamp_ns)
        self.joints = Sample(positions, stamp_ns, arrival)
        self.pose = self.robot.pose(positions)

    def see_contact(self, contact, stamp_ns, arrival):
        """Take a contact estimate, its image's stamp [ns] and steady arrival time [s]."""
        self.contact = Sample(contact, stamp_ns, arrival)
        # The larger of what is fitted and summed.
        self._load = max((force for force in (contact.normal_force, contact.moments.m0)
                          if math.isfinite(force)), default=0.0)
        self.tracker.see_contact(contact, stamp_ns, arrival, self._age(stamp_ns))

    def see_image(self, image, arrival):
        """Take a TactileImage and its steady arrival time [s], for a tracker that sees them."""
        if self.goal is None or not self.tracker.sees_images:
            return
        pose = self.pose_at(image.stamp_ns)
        if pose is not None:
            self.tracker.see_image(image, pose, arrival, self._age(image.stamp_ns))

    def _age(self, stamp_ns):
        """How much older than the newest joint state a picture is [s]; inf if there is none."""
        return max(1e-9 * (self.joints.stamp_ns - stamp_ns), 0.0) if self.joints else math.inf

    def pose_at(self, stamp_ns):
        """Measured pose (4, 4) of the sensor at a stamp [ns]; None where it is not known."""
        positions = self._history.at(stamp_ns)
        return None if positions is None else self.robot.pose(positions)

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
        return self.tracker.refuse(goal)

    def note(self, text):
        """Put a text into the status of an idle servo: a rejected goal has no other answer."""
        if self.goal is None:
            self.reason = text

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
        self._paused, self._stopping, self._outcome = False, '', ''
        self.statistics = TrackStatistics(goal.force)
        self.tracker.begin(goal)
        self._resume_state = State.APPROACH
        self._seed()
        self._enter(State.APPROACH, 'goal accepted', now)

    def cancel(self):
        """Stop within the robot's limits and end the goal."""
        self._stopping = 'cancelled'

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
                 'normal_force': self._load if self.contact else NAN}
        if self.goal is None or dt <= 0.0:
            return Status(self.state, self.reason, **known), None
        pose = self.pose
        if self.state in TRACKING:
            self.statistics.move(pose, self.tracker.heading(pose))
        else:
            self.statistics.stand()
        self._decide(now, pose)
        status, trajectory = self._command(self._twist(pose, dt), dt, known)
        if self.state == State.DONE:
            self.goal = None
        return status, trajectory

    @property
    def closed(self):
        """Whether the contour closed."""
        return self.tracker.closed

    def contour(self):
        """Stamps [ns] and poses (4, 4) of the sensor frame along the edge, in the base frame."""
        nodes = self.tracker.contour()
        if nodes is None:
            return self.statistics.contour
        return along_contour(nodes, self.statistics.contour)

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
        self.motion.seed(self.joints.value)
        self.tracker.resume()
        self._anchor = self.motion.pose

    def _enter(self, state, reason, now):
        self.state, self.reason, self._state_since = state, reason, now
        self._anchor = self.motion.pose

    def _advance(self):
        """How far the commanded sensor stands beyond the anchor along its own normal [m]."""
        way = self.motion.pose[:3, 3] - self._anchor[:3, 3]
        return float(way @ self._anchor[:3, 2])

    def _standstill_reason(self):
        """Why the robot must stand still whatever the edge does, or ''."""
        if self._paused:
            return 'paused'
        if not self._joints_fresh:
            return 'joint state is stale' if self.joints else 'no joint state'
        if self.state != State.RETREAT:  # lifting off needs no picture
            if not self._contact_fresh:
                return 'tactile image is stale' if self.contact else 'no tactile image'
            if Reason.NOT_TARED in self.contact.value.reasons:
                return 'sensor is not tared'
        behind = np.abs(self.motion.positions - self.joints.value)
        if behind.max() > self.config.following_error:
            return f'robot does not follow: {self.limits.names[int(np.argmax(behind))]}'
        return ''

    def _decide(self, now, pose):
        why = self._standstill_reason()
        if self.state == State.HOLD and not self._stopping:
            self._decide_hold(now, why)
        if self._stopping:
            self.state, self.reason = State.HOLD, self._stopping
            self._done_when_standing()
        elif self.state == State.HOLD and (why or self._load <= self.config.max_load):
            return
        elif why:
            self._hold(now, why)
        elif self.motion.blocked:
            self._end_blocked(now)
        elif self._load > self.config.max_load and self.state != State.RETREAT:
            self._end(now, False, f'overload: {self._load:.1f} N', lift=True)
        elif self.state == State.APPROACH:
            self._decide_approach(now)
        elif self.state in TRACKING:
            self._decide_track(now, pose)
        elif self.state == State.RETREAT and -self._advance() >= self.config.retreat_distance:
            self._done_when_standing()

    def _decide_approach(self, now):
        c = self.config
        if self._load >= c.contact_force and self.tracker.ready(now):
            self._enter(State.TRACK, 'contact', now)
        elif self._load >= self.goal.force and (
                self.tracker.looked > self._state_since
                or now - self._state_since > c.edge_lost):
            self._end(now, False, f'contact on approach, but {self.tracker.reason}', lift=True)
        elif self._advance() >= c.approach_distance:
            self._end(now, False, f'no contact within {c.approach_distance:g} m', lift=True)

    def _decide_track(self, now, pose):
        goal, c = self.goal, self.config
        verdict = self.tracker.judge(now, pose, self.statistics.length, self._load)
        if verdict.state == State.HOLD:
            self._hold(now, verdict.reason)
            return
        features = self.tracker.features
        self.statistics.see(features, pose, self.contact.stamp_ns)
        if features.force >= 0.5 * goal.force:
            self._anchor = self.motion.pose  # as deep as is known to be sound
        if goal.length and self.statistics.length >= goal.length:
            self._end(now, True, 'length reached')
        elif verdict.state == State.DONE:
            self._end(now, verdict.success, verdict.reason, lift=verdict.lift)
        elif self._advance() > c.press_depth:
            self._end(now, False, f'went {c.press_depth:g} m deeper without meeting the force',
                      lift=True)
        elif verdict.state != self.state:
            # After a hold the tracker no longer knows that it was searching.
            self.state, self._state_since = verdict.state, now
            self.reason = verdict.reason or 'the edge is back'

    def _hold(self, now, reason):
        self._resume_state = self.state
        self.state, self.reason, self._state_since = State.HOLD, reason, now

    def _decide_hold(self, now, why):
        if why:
            self.reason = why
        held = now - self._state_since
        edge_needed = self._resume_state in TRACKING
        back = not why and (not edge_needed or self.tracker.ready(now))
        if back and held <= self.config.resume_within:
            self._leave_hold(now, 'input is back')
        elif not self._paused and held > self.config.give_up:
            self._end(now, False, f'gave up: {self.reason}')
        elif back and 'resume' not in self.reason:
            self.reason += '; input is back: resume with ~/pause false'

    def _leave_hold(self, now, reason):
        """Go on from the measured state, or from the commanded one while that still moves."""
        anchor = self._anchor
        if self.motion.standing:
            self._seed()
        else:
            self.tracker.resume()
        self._enter(self._resume_state, self._outcome or reason, now)
        self._anchor = anchor  # the way already gone still counts

    def _end(self, now, success, reason, lift=False):
        """End the goal: lift off where that is asked for or needed, else stop."""
        self.success, self._outcome = success, reason
        if (lift or self.goal.retreat) and not self._standstill_reason():
            self._enter(State.RETREAT, reason, now)
        else:
            self._stopping = reason

    def _end_blocked(self, now):
        """End a goal whose motion a limit, a singularity or the workspace has held back."""
        reason = f'motion blocked: {self.motion.blocked}'
        self.motion.reset_blocked()
        if self.state == State.RETREAT:  # its outcome stands
            self._stopping = f'{self.reason}; {reason}'
        else:
            self._end(now, False, reason)

    def _done_when_standing(self):
        if self.motion.standing:
            self.state = State.DONE

    # Motion ------------------------------------------------------------------------------

    def _twist(self, pose, dt):
        """Return the wanted twist of the sensor in its own frame (6,) [m/s, rad/s]."""
        c, twist = self.config, np.zeros(6)
        if self.state == State.APPROACH and self._load < self.goal.force:
            # What is to be touched lightly is touched slowly: the pad stops late.
            twist[2] = min(c.approach_speed * min(self.goal.force / c.soft_touch, 1.0),
                           self.tracker.touch_speed)
        elif self.state == State.RETREAT and -self._advance() < c.retreat_distance:
            twist[2] = -c.approach_speed
        elif self.state in TRACKING:
            twist = self.tracker.twist(pose, self.motion.pose, dt)
            if (Reason.SATURATED in self.contact.value.reasons
                    and self._load >= c.contact_force):
                # The force is larger than it seems, nobody knows by how much: give way.
                twist[2] = min(twist[2], -c.approach_speed)
        if self.state not in TRACKING:
            self.tracker.speed = 0.0
        return twist

    def _command(self, twist, dt, known):
        """Move on by a twist within every limit: status and window."""
        step = self.motion.command(twist, dt)
        features = self.tracker.features
        tracking = features is not None and self.state in (*TRACKING, State.HOLD)
        status = Status(
            self.state, self.reason, **known,
            lateral_error=features.lateral if tracking else NAN,
            angle_error=features.yaw if tracking else NAN,
            force_target=self.goal.force, speed=self.tracker.speed,
            progress=self.statistics.length, twist=step.twist, limit_scale=step.scale,
            limited_by=step.limited_by, manipulability=step.manipulability)
        return status, step.trajectory
