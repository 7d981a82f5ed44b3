"""
When a servo moves: the contact state machine around a servo law (chapter 5).

`idle -> approach -> track -> retreat -> done`, and from anywhere `hold` with its reason. The
supervisor reads no clock, stamps and steady times come in with the data; and it does not know
what is tracked, that is its law's affair.
"""

from typing import Any

import numpy as np

from tactile_common.config import checked
from tactile_common.errors import ConfigurationError
from tactile_sensing.types.contact import Contact
from tactile_sensing.types.image import SensorInfo, TactileImage
from tactile_servo.config import check_goal, ServoConfig
from tactile_servo.cycle_clock import CycleClock, STALL
from tactile_servo.goal_run import GoalRun
from tactile_servo.inputs import Inputs
from tactile_servo.law import Goal, LawResult, Observation, Refusal, ServoLaw, Teachable
from tactile_servo.motion.clock import ClockCheck
from tactile_servo.motion.delay import LATEST
from tactile_servo.motion.limits import JointLimits, WorkspaceBox
from tactile_servo.motion.motion import Motion, MotionStep
from tactile_servo.motion.robot import RobotModel
from tactile_servo.motion.trajectory import Trajectory
from tactile_servo.reasons import GoalRefused, Reason, ReasonCode
from tactile_servo.state_machine import Event, HELD, Phase, StateMachine, TOUCHING, TRACKING
from tactile_servo.track_statistics import along_contour, TrackStatistics
from tactile_servo.types import NAN, State, Status

LONGEST_SILENCE = 3600.0  # s of a client, that a goal may allow


class Supervisor:
    """
    Drive a robot along something by touch.

    Feed it with `see_sensor`, `see_joints`, `see_contact` and, if its law `sees_images`,
    `see_image`; start it with `start`, call `cycle` at the control rate and send what it
    returns.
    """

    def __init__(self, robot: RobotModel, limits: JointLimits, law: ServoLaw,
                 config: ServoConfig | None = None, workspace: WorkspaceBox | None = None):
        self.law, self.config = law, config or ServoConfig()
        self.inputs = Inputs(robot, limits, self.config.input)
        self.motion = Motion(robot, limits, self.config.motion,
                             1.0 / self.config.rate, workspace)
        self.run: GoalRun | None = None  # of the goal that is worked on, or of the last one
        self._machine = StateMachine()
        self._clock = CycleClock(1.0 / self.config.rate)
        self._robot_clock = ClockCheck()
        self._image: TactileImage | None = None  # the newest
        self._silence = 0.0  # of the goal's client [s]
        self.around: Reason | None = None  # what is wrong around the servo, that no datum tells

    def see_sensor(self, sensor: SensorInfo) -> None:
        """Take what is known of the sensor; a goal begins with it."""
        self.inputs.sensor = sensor

    def see_joints(self, positions: np.ndarray, stamp_ns: int, arrival: float) -> None:
        """
        Take a measured joint state (n,) [rad], its stamp [ns] and steady arrival time [s].

        ValueError if it cannot be believed, see `JointHistory.add`.
        """
        self.inputs.see_joints(positions, stamp_ns, arrival)

    def see_reference(self, positions: np.ndarray, stamp_ns: int) -> None:
        """Take what the robot's controller commands (n,) [rad] for a time [ns], if it tells."""
        self.motion.delay.see(positions, stamp_ns)

    def see_wrench(self, force: np.ndarray, arrival: float) -> None:
        """Take a force (3,) at the wrist [N] and its steady arrival time [s], if it has one."""
        pressed = self.active or self.inputs.load >= self.config.approach.contact_force
        self.inputs.wrist.see(force, arrival, not pressed)

    def see_contact(self, contact: Contact, stamp_ns: int, arrival: float) -> None:
        """Take a contact estimate, its image's stamp [ns] and steady arrival time [s]."""
        self.inputs.see_contact(contact, stamp_ns, arrival)
        self._tell(stamp_ns, arrival, contact=contact)

    def see_image(self, image: TactileImage, arrival: float) -> None:
        """
        Take an image and its steady arrival time [s], for its load and for a law that sees them.

        InputRefused if it is not of the sensor that is known.
        """
        self.inputs.see_image(image, arrival)
        loaded = self.inputs.load >= self.config.approach.contact_force
        self.inputs.watch.see(image, loaded, self.inputs.pose[:3, 3])
        self._image = image
        if self._machine.active and self.law.sees_images:
            self._tell(image.stamp_ns, arrival, image=image)

    def _tell(self, stamp_ns: int, arrival: float, image: TactileImage | None = None,
              contact: Contact | None = None) -> None:
        self.law.observe(Observation(
            stamp_ns, arrival, self.inputs.age(stamp_ns), self.inputs.pose_at, image, contact))
        if self.run is not None and self.law.sees_images == (image is not None):
            self.run.observed = arrival

    @property
    def state(self) -> State:
        """State of the servo."""
        return self._machine.phase.state

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
        return self.run is not None and self.run.success

    @property
    def statistics(self) -> TrackStatistics:
        """What the last goal has achieved so far."""
        return TrackStatistics(NAN) if self.run is None else self.run.statistics

    def check(self, goal: Any) -> Refusal | None:
        """Why a goal cannot be accepted now, or None if it can."""
        if self.state != State.IDLE:
            return Refusal(ReasonCode.BUSY, 'cancel it first')
        try:
            check_goal(goal.speed, goal.force, self.config)
            checked('client_timeout', goal.client_timeout, float,
                    {'range': (0.0, LONGEST_SILENCE), 'unit': 's'})
        except ConfigurationError as error:
            return Refusal(ReasonCode.INVALID_GOAL, str(error))
        refused = self.law.validate(goal) or self.around
        if refused is None and self.inputs.joints is None:
            return Refusal(ReasonCode.NO_JOINT_STATE,
                           self.inputs.unbelieved or 'none has been received')
        if refused is None and self.inputs.sensor is None:
            return Refusal(ReasonCode.NO_IMAGE, 'no sensor_info has been received')
        lacking = self.inputs.contact_missing(images=False)
        if refused is not None or lacking is None or lacking.code is not ReasonCode.NOT_TARED:
            return refused
        # Of a sensor that was tared just now, the next contact will say so.
        return None if self.inputs.sensor and self.inputs.sensor.tared_at_ns else lacking

    def note(self, refusal: Refusal) -> None:
        """Put a refusal into the status of an idle servo: it has no other answer."""
        if self.state is State.IDLE:  # the reason of one that is done belongs to its result
            self._machine.fire(Event.REPORT, refusal, self._machine.since)

    def start(self, goal: Any, now: float) -> None:
        """Begin a goal at steady time `now` [s]; GoalRefused if it cannot be accepted."""
        refusal, inputs = self.check(goal), self.inputs
        if refusal is not None or inputs.sensor is None or inputs.joints is None:
            raise GoalRefused(refusal or Refusal(ReasonCode.BUSY))
        self.law.begin(goal, inputs.sensor)
        self.motion.seed(inputs.joints.value)
        self.motion.delay.forget()
        self.run = GoalRun(goal, self.config, self.law, inputs, self.motion, self._machine)
        self._silence = 0.0
        self._machine.fire(Event.START, Reason(ReasonCode.GOAL_ACCEPTED), now)

    def hear_client(self) -> None:
        """Take that the client of the goal lives; the goal's `client_timeout` begins anew."""
        self._silence = 0.0

    def _end_without_client(self, goal: Goal) -> None:
        """End a goal whose client is silent, unless the pad lifts off already."""
        # A servo that does not come to run cannot hear its client either.
        self._silence += min(self._clock.gap, STALL)
        lost = 0.0 < goal.client_timeout < self._silence
        if lost and self._machine.phase in TOUCHING | HELD:
            self.cancel(ReasonCode.CLIENT_LOST)

    def cancel(self, code: ReasonCode = ReasonCode.CANCELLED) -> None:
        """Stop within the robot's limits and end the goal."""
        if self.run is not None and self.active:
            self.run.cancel(code)

    def pause(self, paused: bool, now: float) -> Reason:
        """Hold (true) or go on (false): PAUSED, RESUMED, or why that does not happen."""
        if self.run is None or not self.active:
            return Reason(ReasonCode.WAITING)
        return self.run.pause(paused) or Reason(
            ReasonCode.PAUSED if paused else ReasonCode.RESUMED)

    def teach(self, name: str) -> str:
        """
        Have a `Teachable` law keep what the newest image shows by a name; returns what that is.

        ConfigurationError if there is nothing to keep, or the name is none.
        """
        assert isinstance(self.law, Teachable)
        lacking, sensor = self.inputs.contact_missing(images=True), self.inputs.sensor
        if lacking or sensor is None or self._image is None:
            raise ConfigurationError((lacking or Reason(ReasonCode.NO_IMAGE)).text)
        return self.law.teach(name, self._image, sensor.array)

    def result(self) -> LawResult:
        """What the law has learnt."""
        return self.law.result()

    def contour(self) -> list[tuple[int, np.ndarray]]:
        """Stamps [ns] and poses (4, 4) of the sensor along what was tracked, in the base frame."""
        visited = self.run.statistics.contour if self.run else []
        nodes = self.law.result().contour
        return visited if nodes is None else along_contour(nodes, visited)

    def finish(self) -> None:
        """Go from done to idle, once the result has been taken."""
        self._machine.fire(Event.FINISH, Reason(ReasonCode.WAITING, f'last: {self.reason.text}'),
                           self._machine.since)

    def cycle(self, now: float, now_ns: int) -> tuple[Status, Trajectory | None]:
        """
        Decide one control cycle at a steady time [s] and one of the clock of the stamps [ns].

        The trajectory is for the joint trajectory controller; None while nothing is to move.
        """
        dt = self._clock.tick(now, now_ns)
        self.inputs.refresh(now, now_ns)
        if (joints := self.inputs.joints) is not None:
            self._robot_clock.see(joints.stamp_ns, 1e-9 * (now_ns - joints.stamp_ns) - (
                now - joints.arrival), now)
        if self.run is None or not self.active or (dt == 0.0 and self._clock.fault is None):
            return self._status(self.run), None
        self.run.count()
        self._end_without_client(self.run.goal)
        self.run.decide(now, dt, self._clock, self.around or self._late())
        self.motion.expect_lateness(self._robot_clock.lateness)
        step = self.run.command(now, now_ns, dt, self._robot_clock.agrees)
        return self._status(self.run, step), None if step is None else step.trajectory

    def _late(self) -> Reason | None:
        overdue = self.motion.delay.overdue
        return Reason(ReasonCode.NOT_FOLLOWING,
                      f'commands come more than {1e3 * LATEST:.0f} ms late'
                      ) if overdue > LATEST else None

    def _status(self, run: GoalRun | None, step: MotionStep | None = None) -> Status:
        inputs, machine = self.inputs, self._machine
        status = Status(machine.phase.state, machine.reason, contact_fresh=inputs.contact_fresh,
                        joints_fresh=inputs.joints_fresh)
        if inputs.contact is not None:
            status.normal_force = inputs.load
        used = self._image if self.law.sees_images else inputs.contact
        if used is not None:
            status.contact_stamp_ns = used.stamp_ns
        if run is None or machine.phase is Phase.IDLE:
            return status
        if machine.phase in TRACKING | HELD:
            error = self.law.error
            if error is not None:
                status.lateral_error, status.longitudinal_error = error.lateral, error.longitudinal
                status.angle_error = error.angle
        if machine.phase in TRACKING and run.reference is not None:
            status.speed = run.reference.speed
        status.force_target, status.progress = run.goal.force, run.statistics.length
        if step is not None:
            status.twist, status.limit_scale = step.twist, step.scale
            status.limited_by, status.manipulability = step.limited_by, step.manipulability
        return status
