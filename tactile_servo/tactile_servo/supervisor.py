"""
Supervisor of a servo law: the contact state machine that decides when to move (chapter 5).

The states are `idle -> approach -> track -> retreat -> done`; every moving state can change to
`hold`, with a reason (`goal_run.RULES`). The supervisor reads no clock: stamps and steady times
are arguments. Only the law knows what is tracked.
"""

from dataclasses import asdict
import json
from typing import Any

import numpy as np

from tactile_common.config import built, checked, leaves
from tactile_common.errors import ConfigurationError
from tactile_sensing.types.contact import Contact
from tactile_sensing.types.image import SensorInfo, TactileImage
from tactile_servo.clocks import ClockCheck, CycleClock, STALL
from tactile_servo.config import check_goal, ServoConfig
from tactile_servo.goal_run import GoalRun
from tactile_servo.inputs import Inputs
from tactile_servo.journal import Call, Journal
from tactile_servo.law import LawResult, Observation, ServoLaw, Teachable
from tactile_servo.motion.delay import LATEST
from tactile_servo.motion.limits import JointLimits, WorkspaceBox
from tactile_servo.motion.motion import Motion, MotionStep
from tactile_servo.motion.robot import RobotModel
from tactile_servo.motion.trajectory import Trajectory
from tactile_servo.phases import HELD, TOUCHING, TRACKING
from tactile_servo.reasons import Reason, ReasonCode, Refused
from tactile_servo.track_statistics import along_contour, TrackStatistics
from tactile_servo.types import NAN, pressure_layer, State, Status

LONGEST_SILENCE = 3600.0  # s, largest `client_timeout` of a goal


class Supervisor:
    """
    Moves a robot along an edge or a surface by touch.

    Pass inputs to `see_sensor`, `see_joints`, `see_contact` and, if its law `sees_images`,
    `see_image`. Start a goal with `start`, call `cycle` at the control rate, and send the
    trajectory that it returns. All calls are recorded in the `journal`, for `repeat`.
    """

    def __init__(self, robot: RobotModel, limits: JointLimits, law: ServoLaw,
                 config: ServoConfig | None = None, workspace: WorkspaceBox | None = None):
        self.law, self.config = law, config or ServoConfig()
        self.inputs = Inputs(robot, limits)
        self.motion = Motion(robot, limits, 1.0 / self.config.rate, workspace)
        self.run: GoalRun | None = None  # None from `finish` to `start`
        self._last: GoalRun | None = None  # the same, or the last one
        self._idle = Reason(ReasonCode.WAITING)  # reason while there is no goal
        self._clock = CycleClock(1.0 / self.config.rate)
        self._robot_clock = ClockCheck()
        self._silence = 0.0  # time since the last heartbeat of the goal's client [s]
        self.around: Reason | None = None  # problem outside the servo, set by its owner
        self.journal = Journal()
        # Values that are set from outside, as last recorded.
        self._recorded: dict[Call, Reason | None] = {Call.AROUND: None, Call.REFUSED: None}
        self._delay = self.motion.delay.learnt

    def _record_changes(self) -> None:
        """Record values that are set from outside, if they have changed."""
        for call, reason in ((Call.AROUND, self.around), (Call.REFUSED, self.inputs.refused)):
            if reason != self._recorded[call]:
                self._recorded[call] = reason
                code, text = reason or (ReasonCode.NONE, '')
                self.journal.add(call, 0.0, code, text)
        if self._delay != self.motion.delay.learnt:
            self._delay = self.motion.delay.learnt
            self.journal.add(Call.DELAY, text=json.dumps(self._delay))

    def see_sensor(self, sensor: SensorInfo) -> None:
        """Store the description of the sensor; laws use the one at the start of a goal."""
        self.journal.add(Call.SENSOR, 0.0, sensor.stamp_ns)
        self.inputs.sensor = sensor

    def see_joints(self, positions: np.ndarray, stamp_ns: int, arrival: float) -> None:
        """
        Process a measured joint state (n,) [rad] with its stamp [ns] and steady arrival time [s].

        ValueError if it is not plausible, see `JointHistory.add`.
        """
        self.journal.add(Call.JOINTS, arrival, stamp_ns)
        self.inputs.see_joints(positions, stamp_ns, arrival)

    def see_reference(self, positions: np.ndarray, stamp_ns: int) -> None:
        """Process the positions (n,) [rad] that the robot's controller commands at a time [ns]."""
        self.motion.delay.see(positions, stamp_ns)

    def see_wrench(self, force: np.ndarray, arrival: float) -> None:
        """Process a force (3,) at the wrist [N] with its steady arrival time [s]."""
        self.journal.add(Call.WRENCH, arrival, text=json.dumps(force.tolist()))
        pressed = self.active or self.inputs.load >= self.config.contact_force
        self.inputs.wrist.see(force, arrival, not pressed)

    def see_contact(self, contact: Contact, stamp_ns: int, arrival: float) -> None:
        """Process a contact estimate, its image's stamp [ns] and its steady arrival time [s]."""
        self.journal.add(Call.CONTACT, arrival, stamp_ns)
        self.inputs.see_contact(contact, stamp_ns, arrival)
        self._observe(stamp_ns, arrival, contact=contact)

    def see_image(self, image: TactileImage, arrival: float) -> None:
        """
        Process an image with its steady arrival time [s].

        The supervisor uses its load; a law that `sees_images` observes it. Refused if its
        frame or array is not that of the known sensor.
        """
        self.journal.add(Call.IMAGE, arrival, image.stamp_ns)
        self.inputs.see_image(image, arrival)
        loaded = self.inputs.load >= self.config.contact_force
        self.inputs.watch.see(image, loaded, self.inputs.pose[:3, 3])
        if self.active and self.law.sees_images:
            self._observe(image.stamp_ns, arrival, image=image)

    def _observe(self, stamp_ns: int, arrival: float, image: TactileImage | None = None,
              contact: Contact | None = None) -> None:
        self.law.observe(Observation(
            stamp_ns, arrival, self.inputs.age(stamp_ns), self.inputs.pose_at(stamp_ns), image,
            contact))
        if self.run is not None and self.law.sees_images == (image is not None):
            self.run.observed = arrival

    @property
    def state(self) -> State:
        """State of the servo."""
        return State.IDLE if self.run is None else self.run.phase.state

    @property
    def reason(self) -> Reason:
        """Reason of the state."""
        return self._idle if self.run is None else self.run.reason

    @property
    def active(self) -> bool:
        """Whether a goal is active."""
        return self.state not in (State.IDLE, State.DONE)

    @property
    def success(self) -> bool:
        """Whether the last goal was reached."""
        return self._last is not None and self._last.success

    @property
    def statistics(self) -> TrackStatistics:
        """Statistics of the active goal or the last one."""
        return TrackStatistics(NAN) if self._last is None else self._last.statistics

    def check(self, goal: Any) -> Reason | None:
        """Return why a goal cannot be accepted now, or None."""
        if self.state != State.IDLE:
            return Reason(ReasonCode.BUSY, 'cancel it first')
        try:
            check_goal(goal.speed, goal.force, self.config)
            if goal.force < self.inputs.least_force:
                raise ConfigurationError(
                    f'force is {goal.force:g}, must be {self.inputs.least_force:.2g} N at least: '
                    'a smaller one may be noise of this sensor')
            checked('client_timeout', goal.client_timeout, float,
                    {'range': (0.0, LONGEST_SILENCE), 'unit': 's'})
        except ConfigurationError as error:
            return Reason(ReasonCode.INVALID_GOAL, str(error))
        refused = self.law.validate(goal) or self.around
        if refused is not None:
            return refused
        if self.inputs.joints is None:
            return Reason(ReasonCode.NO_JOINT_STATE,
                          self.inputs.unbelieved or 'none has been received')
        if self.inputs.sensor is None:
            return Reason(ReasonCode.NO_IMAGE, 'no sensor_info has been received')
        layer = pressure_layer(self.inputs.sensor.layers)
        if layer is None or layer.unit != 'Pa':
            return Reason(ReasonCode.UNSUPPORTED_GOAL,
                          'the sensor gives no pressure in Pa: it is not calibrated')
        lacking = self.inputs.contact_missing(images=False)
        if lacking is None or lacking.code is not ReasonCode.NOT_TARED:
            return None
        # If `sensor_info` says that the sensor is tared, the next contact will say so too.
        return None if self.inputs.sensor.tared_at_ns else lacking

    def note(self, refusal: Reason) -> None:
        """Show a refusal in the status of an idle servo: the action returns no reason for it."""
        self.journal.add(Call.NOTED, 0.0, refusal.code, refusal.detail)
        self._idle = refusal

    def start(self, goal: Any, now: float) -> None:
        """Start a goal at steady time `now` [s]; Refused if it cannot be accepted."""
        self._record_changes()
        self.journal.add(Call.START, now, text=json.dumps(asdict(goal), default=np.ndarray.tolist))
        refusal, inputs = self.check(goal), self.inputs
        if refusal is not None or inputs.sensor is None or inputs.joints is None:
            raise Refused(refusal or Reason(ReasonCode.BUSY))
        try:
            self.law.begin(goal, inputs.sensor)
        except ConfigurationError as error:  # the sensor does not suit the law
            raise Refused(Reason(ReasonCode.UNSUPPORTED_GOAL, str(error))) from error
        self.motion.seed(inputs.joints.value)
        self.motion.delay.forget()
        self.run = self._last = GoalRun(goal, self.config, self.law, inputs, self.motion, now)
        self._silence = 0.0

    def hear_client(self) -> None:
        """Process a heartbeat of the goal's client: its `client_timeout` starts again."""
        self.journal.add(Call.CLIENT)
        self._silence = 0.0

    def _end_without_client(self, run: GoalRun) -> None:
        """End a goal whose client is silent, unless the goal is already ending."""
        # A long gap between cycles is no silence: without processor time the servo hears nobody.
        self._silence += min(self._clock.gap, STALL)
        lost = 0.0 < run.goal.client_timeout < self._silence
        if lost and run.phase in TOUCHING | HELD:
            run.cancel(ReasonCode.CLIENT_LOST)

    def cancel(self, code: ReasonCode = ReasonCode.CANCELLED) -> None:
        """Stop within the robot's limits and end the goal."""
        self.journal.add(Call.CANCEL, 0.0, code)
        if self.run is not None and self.active:
            self.run.cancel(code)

    def pause(self, paused: bool, now: float) -> Reason:
        """Hold (true) or continue (false); return PAUSED, RESUMED, or why neither happens."""
        self.journal.add(Call.PAUSE, now, paused)
        if self.run is None or not self.active:
            return Reason(ReasonCode.WAITING)
        return self.run.pause(paused) or Reason(
            ReasonCode.PAUSED if paused else ReasonCode.RESUMED)

    def teach(self, name: str) -> str:
        """
        Make a `Teachable` law store the features of the newest image; return their description.

        ConfigurationError if the image is missing or shows no features, or the name is invalid.
        """
        self.journal.add(Call.TEACH, text=name)
        assert isinstance(self.law, Teachable)
        lacking, sensor = self.inputs.contact_missing(images=True), self.inputs.sensor
        image = self.inputs.image
        if lacking or sensor is None or image is None:
            raise ConfigurationError((lacking or Reason(ReasonCode.NO_IMAGE)).text)
        return self.law.teach(name, image.value, sensor.array)

    def retune(self, config: Any) -> None:
        """Pass a configuration with changed live fields to the law."""
        values = {name: value for name, value, *_ in leaves(type(config), defaults=config)}
        self.journal.add(Call.TUNE, text=json.dumps(values))
        self.law.retune(config)

    def result(self) -> LawResult:
        """Return the result of the law."""
        return self.law.result()

    def contour(self) -> list[tuple[int, np.ndarray]]:
        """Return stamps [ns] and sensor poses (4, 4) on the tracked contour, in the base frame."""
        visited = self.statistics.contour
        nodes = self.law.result().contour
        return visited if nodes is None else along_contour(nodes, visited)

    def finish(self) -> None:
        """Change from DONE to IDLE after the result has been read."""
        self.journal.add(Call.FINISH)
        assert self.state is State.DONE
        self._idle = Reason(ReasonCode.WAITING, f'last: {self.reason.text}')
        self.run = None

    def cycle(self, now: float, now_ns: int) -> tuple[Status, Trajectory | None]:
        """
        Run one control cycle at a steady time [s] and at a time of the stamps' clock [ns].

        Returns the status and a trajectory for the joint trajectory controller, or None if no
        motion is to be commanded.
        """
        self._record_changes()
        self.journal.add(Call.CYCLE, now, now_ns)
        dt = self._clock.tick(now, now_ns)
        self.inputs.refresh(now, now_ns)
        joints = self.inputs.joints
        if joints is not None and dt > 0.0:  # a stopped clock gives no ages
            self._robot_clock.see(joints.stamp_ns, 1e-9 * (now_ns - joints.stamp_ns) - (
                now - joints.arrival), now)
        if self.run is not None:
            self._end_without_client(self.run)
        if self.run is None or not self.active or (dt == 0.0 and self._clock.fault is None):
            return self._status(self.run), None
        late = Reason(
            ReasonCode.NOT_FOLLOWING, f'commands come more than {1e3 * LATEST:.0f} ms late'
        ) if self.motion.delay.overdue > LATEST else None
        self.run.decide(self._clock, self.around or late)
        self.motion.expect_lateness(self._robot_clock.lateness)
        step = self.run.command(now_ns, self._robot_clock.agrees)
        return self._status(self.run, step), None if step is None else step.trajectory

    def _status(self, run: GoalRun | None, step: MotionStep | None = None) -> Status:
        inputs = self.inputs
        status = Status(self.state, self.reason, contact_fresh=inputs.contact_fresh,
                        joints_fresh=inputs.joints_fresh)
        if inputs.contact is not None:
            status.normal_force = inputs.load
        used = inputs.image if self.law.sees_images else inputs.contact
        if used is not None:
            status.contact_stamp_ns = used.stamp_ns
        if run is None:
            return status
        if run.phase in TRACKING | HELD:
            error = self.law.error
            if error is not None:
                status.lateral_error, status.longitudinal_error = error.lateral, error.longitudinal
                status.angle_error = error.angle
        if run.phase in TRACKING and run.reference is not None:
            status.speed = run.reference.speed
        status.force_target, status.progress = run.goal.force, run.statistics.length
        if step is not None:
            status.twist, status.limit_scale = step.twist, step.scale
            status.limited_by, status.manipulability = step.limited_by, step.manipulability
        return status

    def repeat(self, call: int, time: float, value: int, text: str) -> None:
        """
        Repeat a recorded call, one of those from `Call.START` on.

        TactileError if the call is refused, as it was in the recording.
        """
        code = next((it for it in ReasonCode if it == value), ReasonCode.NONE)
        reason = Reason(code, text) if value else None
        if call == Call.START:
            if self.state is State.DONE:  # with other settings the last goal may end earlier
                self.finish()
            self.start(self.law.goal_type(**json.loads(text)), time)
        elif call == Call.FINISH:
            self.finish()
        elif call == Call.CANCEL:
            self.cancel(code)
        elif call == Call.PAUSE:
            self.pause(bool(value), time)
        elif call == Call.TUNE:
            self.law.retune(built(self.law.config_type, json.loads(text)))
        elif call == Call.TEACH:
            self.teach(text)
        elif call == Call.AROUND:
            self.around = reason
        elif call == Call.REFUSED:
            self.inputs.refused = reason
        elif call == Call.CLIENT:
            self.hear_client()
        elif call == Call.DELAY:
            self.motion.delay.learnt = tuple(json.loads(text))
        elif call == Call.WRENCH:
            self.see_wrench(np.array(json.loads(text)), time)
        elif call == Call.NOTED and reason is not None:
            self.note(reason)
