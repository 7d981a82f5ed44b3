"""
When a servo moves: the contact state machine around a servo law (chapter 5).

`idle -> approach -> track -> retreat -> done`, and from anywhere `hold` with its reason. The
supervisor reads no clock, stamps and steady times come in with the data; and it does not know
what is tracked, that is its law's affair.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from tactile_sensing.types.contact import Contact
from tactile_sensing.types.image import SensorInfo, TactileImage
from tactile_servo.config import ServoConfig, WINDOW_PERIODS
from tactile_servo.inputs import Inputs
from tactile_servo.law import Goal, LawResult, Observation, Reference, Refusal, ServoLaw
from tactile_servo.motion.limits import JointLimits, WorkspaceBox
from tactile_servo.motion.motion import Motion, MotionStep
from tactile_servo.motion.robot import RobotModel
from tactile_servo.motion.trajectory import Trajectory
from tactile_servo.reasons import GoalRefused, Reason, ReasonCode
from tactile_servo.state_machine import ASSESSED, Event, RESUMPTION, StateMachine
from tactile_servo.track_statistics import along_contour, TrackStatistics
from tactile_servo.types import State, Status, TRACKING

SOUND_FORCE = 0.5  # of the force, from which the depth of the pad is known to be sound
OFFER = 'resume with ~/pause false'


@dataclass(eq=False)
class Task:
    """
    What belongs to one goal.

    anchor : ndarray (4, 4)
        Pose where the current way (approach, retreat, press depth) began.
    resumption : Event
        What takes up again what a hold interrupted.
    cause : Reason
        Of the hold.
    outcome : Reason or None
        Why the goal ends; None until then.
    stopping : bool
        It ends where the pad is.
    observed : float
        Steady time at which the law was last told something [s].
    """

    goal: Goal
    statistics: TrackStatistics
    anchor: np.ndarray
    resumption: Event = Event.RESUME_APPROACH
    cause: Reason = Reason(ReasonCode.NONE)
    paused: bool = False
    outcome: Reason | None = None
    success: bool = False
    stopping: bool = False
    observed: float = -np.inf
    reference: Reference | None = None


class Supervisor:
    """
    Drive a robot along something by touch.

    Feed it with `see_sensor`, `see_joints`, `see_contact` and, if its law `sees_images`,
    `see_image`; start it with `start`, call `cycle` at the control rate and send what it
    returns.

    Attributes
    ----------
    law : ServoLaw
    config : ServoConfig
    inputs : Inputs
    motion : Motion
    task : Task or None
        Of the goal that is worked on, or of the last one.
    """

    def __init__(self, robot: RobotModel, limits: JointLimits, law: ServoLaw,
                 config: ServoConfig | None = None, workspace: WorkspaceBox | None = None):
        self.law, self.config = law, config or ServoConfig()
        self.inputs = Inputs(robot, limits, self.config.input)
        self.motion = Motion(robot, limits, self.config.motion,
                             WINDOW_PERIODS / self.config.rate, workspace)
        self.task: Task | None = None
        self._machine, self._names = StateMachine(), limits.names
        self._last_ns: int | None = None

    # Input -------------------------------------------------------------------------------

    def see_sensor(self, sensor: SensorInfo) -> None:
        """Take what is known of the sensor; a goal begins with it."""
        self.inputs.sensor = sensor

    def see_joints(self, positions: np.ndarray, stamp_ns: int, arrival: float) -> None:
        """
        Take a measured joint state (n,) [rad], its stamp [ns] and steady arrival time [s].

        Raises
        ------
        ValueError
            It cannot be believed, see `JointHistory.add`.
        """
        self.inputs.see_joints(positions, stamp_ns, arrival)

    def see_contact(self, contact: Contact, stamp_ns: int, arrival: float) -> None:
        """Take a contact estimate, its image's stamp [ns] and steady arrival time [s]."""
        self.inputs.see_contact(contact, stamp_ns, arrival)
        self._tell(Observation(stamp_ns, arrival, self.inputs.age(stamp_ns),
                               self.inputs.pose_at, contact=contact))

    def see_image(self, image: TactileImage, arrival: float) -> None:
        """Take an image and its steady arrival time [s], for a law that sees them."""
        if self._machine.active and self.law.sees_images:
            self._tell(Observation(image.stamp_ns, arrival, self.inputs.age(image.stamp_ns),
                                   self.inputs.pose_at, image=image))

    def _tell(self, observation):
        self.law.observe(observation)
        if self.task is not None and self.law.sees_images == (observation.image is not None):
            self.task.observed = observation.arrival

    # Goal --------------------------------------------------------------------------------

    @property
    def state(self) -> State:
        """State of the servo."""
        return self._machine.state

    @property
    def reason(self) -> Reason:
        """Why it is in that state."""
        return self._machine.reason

    @property
    def active(self) -> bool:
        """Whether a goal is being worked on."""
        return self._machine.active

    @property
    def success(self) -> bool:
        """Whether the last goal was met."""
        return self.task is not None and self.task.success

    @property
    def statistics(self) -> TrackStatistics | None:
        """What the last goal has achieved so far."""
        return None if self.task is None else self.task.statistics

    def check(self, goal: Any) -> Refusal | None:
        """Why a goal cannot be accepted now, or None if it can."""
        if self.state != State.IDLE:
            return Refusal(ReasonCode.BUSY, 'cancel it first')
        if self.inputs.joints is None:
            return Refusal(ReasonCode.NO_JOINT_STATE, 'none has been received')
        if self.inputs.sensor is None:
            return Refusal(ReasonCode.NO_IMAGE, 'no sensor_info has been received')
        for name, value, bound in (('speed', goal.speed, self.config.speed.max),
                                   ('force', goal.force, self.config.force.max)):
            if not 0.0 < value <= bound:
                return Refusal(ReasonCode.INVALID_GOAL,
                               f'{name} {value:g} is outside 0..{bound:g}')
        least = self.config.approach.contact_force
        if goal.force <= least:
            return Refusal(ReasonCode.INVALID_GOAL,
                           f'force {goal.force:g} N is not above contact_force, {least:g} N')
        return self.law.validate(goal)

    def note(self, refusal: Refusal) -> None:
        """Put a refusal into the status of an idle servo: it has no other answer."""
        if not self.active:
            self._machine.reason = refusal

    def start(self, goal: Any, now: float) -> None:
        """
        Begin a goal at steady time `now` [s].

        Raises
        ------
        GoalRefused
            The goal cannot be accepted.
        """
        refusal = self.check(goal)
        if refusal is not None:
            raise GoalRefused(refusal)
        self.law.begin(goal, self.inputs.sensor)
        self.motion.seed(self.inputs.joints.value)
        self.task = Task(goal, TrackStatistics(goal.force), self.motion.pose)
        self._machine.fire(Event.START, Reason(ReasonCode.GOAL_ACCEPTED), now)

    def cancel(self) -> None:
        """Stop within the robot's limits and end the goal."""
        if self.active:
            self._stop(Reason(ReasonCode.CANCELLED))

    def pause(self, paused: bool, now: float) -> bool:
        """Hold (true) or go on (false); returns whether there was a goal to act on."""
        if not self.active:
            return False
        task = self.task
        task.paused = paused
        if not paused and self.state == State.HOLD and not task.stopping and (
                self._standstill() is None):
            self._resume(now, Reason(ReasonCode.RESUMED))
        return True

    def result(self) -> LawResult:
        """What the law has learnt."""
        return self.law.result()

    def contour(self) -> list[tuple[int, np.ndarray]]:
        """Stamps [ns] and poses (4, 4) of the sensor along what was tracked, in the base frame."""
        visited = self.task.statistics.contour if self.task else []
        nodes = self.law.result().contour
        return visited if nodes is None else along_contour(nodes, visited)

    def finish(self) -> None:
        """Go from done to idle, once the result has been taken."""
        self._machine.fire(Event.FINISH, Reason(ReasonCode.WAITING, f'last: {self.reason.text}'))

    # Cycle -------------------------------------------------------------------------------

    def cycle(self, now: float, now_ns: int) -> tuple[Status, Trajectory | None]:
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
        dt = self._elapsed(now_ns)
        self.inputs.refresh(now, now_ns)
        if not self.active or dt <= 0.0:
            return Status(self.state, self.reason, **self.inputs.known()), None
        task = self.task
        if self.state in TRACKING and task.reference is not None:
            task.statistics.move(self.inputs.pose, task.reference.heading)
        else:
            task.statistics.stand()
        self._decide(now)
        step = self.motion.command(self._twist(dt), dt)
        return self._status(step), step.trajectory

    def _elapsed(self, now_ns):
        """Time since the last cycle by the clock of the stamps, by which the robot moves [s]."""
        period = 1.0 / self.config.rate
        dt = period if self._last_ns is None else (now_ns - self._last_ns) * 1e-9
        self._last_ns = now_ns
        return min(max(dt, 0.0), 2.0 * period)

    def _status(self, step: MotionStep) -> Status:
        task, errors, speed = self.task, {}, 0.0
        if self.law.error is not None and self.state in (*TRACKING, State.HOLD):
            error = self.law.error
            errors = {'lateral_error': error.lateral, 'longitudinal_error': error.longitudinal,
                      'angle_error': error.angle}
        if self.state in TRACKING and task.reference is not None:
            speed = task.reference.speed
        return Status(
            self.state, self.reason, **self.inputs.known(), **errors, speed=speed,
            force_target=task.goal.force, progress=task.statistics.length, twist=step.twist,
            limit_scale=step.scale, limited_by=step.limited_by,
            manipulability=step.manipulability)

    # Decision ----------------------------------------------------------------------------

    def _standstill(self) -> Reason | None:
        """Why the robot must stand still whatever is tracked, or None."""
        if self.task.paused:
            return Reason(ReasonCode.PAUSED)
        missing = self.inputs.joints_missing()
        if missing is None and self.state != State.RETREAT:  # lifting off needs no image
            missing = self.inputs.contact_missing()
        if missing is not None:
            return missing
        behind = np.abs(self.motion.positions - self.inputs.joints.value)
        if behind.max() > self.config.input.following_error:
            return Reason(ReasonCode.NOT_FOLLOWING, self._names[int(np.argmax(behind))])
        return None

    def _decide(self, now):
        why, most, task = self._standstill(), self.config.force.max_load, self.task
        overload = self.inputs.load > most and self.state != State.RETREAT
        if self.state == State.HOLD and not task.stopping:
            self._decide_hold(now, why)
        if task.stopping:
            self._rest_when_standing()
        elif self.state == State.HOLD and (why is not None or not overload):
            return
        elif why is not None:
            self._hold(now, why)
        elif self.motion.blocked:
            self._end_blocked(now)
        elif overload and self.state != State.RETREAT:
            self._end(now, Reason(ReasonCode.OVERLOAD, f'{self.inputs.load:.1f} N'), lift=True)
        elif self.state == State.APPROACH:
            self._decide_approach(now)
        elif self.state in TRACKING:
            self._decide_track(now)
        elif -self._advance() >= self.config.retreat.distance:
            self._rest_when_standing()

    def _decide_approach(self, now):
        c, task, lacking = self.config, self.task, self.law.lacks(now)
        since = self._machine.since
        if self.inputs.load >= c.approach.contact_force and lacking is None:
            task.anchor = self.motion.pose
            self._machine.fire(Event.TOUCH, Reason(ReasonCode.CONTACT), now)
        elif lacking is not None and self.inputs.load >= task.goal.force and (
                task.observed > since or now - since > c.input.lost_after):
            self._end(now, Reason(ReasonCode.NO_EDGE, lacking.text), lift=True)
        elif self._advance() >= c.approach.distance:
            self._end(now, Reason(ReasonCode.NO_CONTACT, f'within {c.approach.distance:g} m'),
                      lift=True)

    def _decide_track(self, now):
        task, c = self.task, self.config
        found = self.law.assess(now, task.statistics.length, self.inputs.load)
        if found.state == State.HOLD:
            self._hold(now, found.reason)
            return
        error = self.law.error
        if error is not None:
            task.statistics.see(error, self.inputs.pose, self.inputs.contact.stamp_ns)
            if error.force >= SOUND_FORCE * task.goal.force:
                task.anchor = self.motion.pose
        if found.state == State.DONE:
            self._end(now, found.reason, found.success, found.lift)
        elif self._advance() > c.force.press_depth:
            self._end(now, Reason(ReasonCode.TOO_DEEP, f'{c.force.press_depth:g} m'), lift=True)
        elif found.state != self.state:
            self._machine.fire(ASSESSED[found.state], found.reason, now)

    def _advance(self):
        """How far the commanded sensor stands beyond the anchor along its own normal [m]."""
        way = self.motion.pose[:3, 3] - self.task.anchor[:3, 3]
        return float(way @ self.task.anchor[:3, 2])

    # Hold and end ------------------------------------------------------------------------

    def _hold(self, now, reason):
        self.task.resumption, self.task.cause = RESUMPTION[self.state], reason
        self._machine.fire(Event.HOLD, reason, now)

    def _decide_hold(self, now, why):
        task, limits = self.task, self.config.hold
        if why is not None:
            task.cause = self._machine.reason = why
        held = now - self._machine.since
        back = why is None and (task.resumption != Event.RESUME_TRACK
                                or self.law.lacks(now) is None)
        if back and held <= limits.resume_within:
            self._resume(now, Reason(ReasonCode.INPUT_BACK))
        elif not task.paused and held > limits.give_up:
            self._end(now, Reason(ReasonCode.GAVE_UP, task.cause.text))
        elif back:
            self._machine.reason = Reason(
                ReasonCode.INPUT_BACK, f'{OFFER} (held: {task.cause.text})')

    def _resume(self, now, reason):
        """Go on from the measured state, or from the commanded one while that still moves."""
        task = self.task
        if self.motion.standing:
            self.motion.seed(self.inputs.joints.value)
        self.law.resume()
        task.reference = None
        self._machine.fire(task.resumption, task.outcome or reason, now)

    def _end(self, now, reason, success=False, lift=False):
        """End the goal: lift off where that is asked for or needed, else stop."""
        task = self.task
        task.success, task.outcome = success, reason
        if (lift or task.goal.retreat) and self._standstill() is None:
            task.anchor = self.motion.pose
            self._machine.fire(Event.LIFT, reason, now)
        else:
            self._stop(reason)

    def _end_blocked(self, now):
        """End a goal whose motion a limit, a singularity or the workspace has held back."""
        reason = Reason(ReasonCode.MOTION_BLOCKED, self.motion.blocked)
        self.motion.reset_blocked()
        if self.state == State.RETREAT:  # its outcome stands
            self._stop(Reason(self.reason.code, f'{self.reason.detail}; {reason.text}'))
        else:
            self._end(now, reason)

    def _stop(self, reason):
        self.task.stopping = True
        self._machine.fire(Event.STOP, reason)

    def _rest_when_standing(self):
        if self.motion.standing:
            self._machine.fire(Event.REST, self.reason)

    # Motion ------------------------------------------------------------------------------

    def _twist(self, dt):
        """Wanted twist of the sensor in its own frame (6,) [m/s, rad/s]."""
        c, task, twist = self.config, self.task, np.zeros(6)
        force = task.goal.force
        if self.state == State.APPROACH and self.inputs.load < force:
            # What is to be touched lightly is touched slowly: the pad stops late.
            softly = c.approach.speed * min(force / c.approach.soft_touch, 1.0)
            twist[2] = min(softly, self.law.touch_speed)
        elif self.state == State.RETREAT and -self._advance() < c.retreat.distance:
            twist[2] = -c.approach.speed
        elif self.state in TRACKING:
            task.reference = self.law.reference(self.inputs.pose, self.motion.pose, dt)
            twist = task.reference.twist
            if self.inputs.saturated and self.inputs.load >= c.approach.contact_force:
                # The force is larger than it seems, nobody knows by how much: give way.
                twist[2] = min(twist[2], -c.approach.speed)
        return twist
