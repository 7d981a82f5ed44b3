"""Base class of the laws that follow a surface: image features, path, end and record."""
import math
from typing import ClassVar

import numpy as np

from tactile_common.errors import ConfigurationError
from tactile_sensing.dome.geometry import Dome
from tactile_sensing.types.array import TactelArray
from tactile_sensing.types.image import SensorInfo, TactileImage
from tactile_servo.config import image_patience, MAX_STAMP_AGE, ServoConfig, STALE_AFTER
from tactile_servo.control.press_check import PressCheck
from tactile_servo.control.stability import AGE_SHARE
from tactile_servo.control.surface_filter import SurfaceFilter
from tactile_servo.law import Assessment, Observation, Reference, Refusal, Touch
from tactile_servo.laws.surface_config import SurfaceConfig
from tactile_servo.laws.surface_features import ContactSense, Felt, kind_of
from tactile_servo.laws.surface_goal import (
    Pattern,
    refuse_surface_goal,
    SurfaceGoal,
    SurfaceResult,
)
from tactile_servo.laws.surface_motion import CENTRED, STAND, SurfaceMotion
from tactile_servo.laws.surface_state import Going, plan_path, Record
from tactile_servo.laws.surface_teaching import between, Lessons, wanted_contacts
from tactile_servo.motion.agility import Agility
from tactile_servo.reasons import Reason, ReasonCode
from tactile_servo.tactile_jacobian.table import load_table
from tactile_servo.types import State, TaskError

MET = 0.05  # relative error of the force at which it counts as reached, and motion begins
ADVANCE = 5e-4  # m, advance that counts as progress
RETURN_RATE = 30.0  # rate at which the contact returns to its path [1/s]
# Standard deviation of the contact's place on the pad: a part that includes friction [m], and a
# share of its distance from the pad's centre
PLACE_NOISE, PLACE_ERROR = 1e-4, 0.03
OVERFORCE = 2.5  # times the wanted force, above which the goal ends once the force was reached


class SurfaceLaw:
    """
    Follow a surface with a round probe, using features of its image (chapter 6).

    The difference of wanted and measured features, times the inverse of the tactile Jacobian,
    gives the place of the contact on the pad and its force. Each law adds its `normal` and its
    `twist`.
    """

    goal_type: ClassVar[type] = SurfaceGoal
    config_type: ClassVar[type] = SurfaceConfig
    sees_images: ClassVar[bool] = True
    near: ClassVar[float] = math.inf  # a contact may be anywhere on the pad
    touch_speed = math.inf
    goal: SurfaceGoal  # set by `begin`
    _sense: ContactSense

    def __init__(self, servo: ServoConfig, config: SurfaceConfig | None = None):
        self.servo, self.config = servo, config or self.config_type()
        self._stale = STALE_AFTER
        probe = self.config.probe
        self._dome = Dome(probe.skin_radius, probe.array_radius,
                          2.0 * probe.array_radius - probe.skin_radius)
        path = self.config.jacobian.table
        self._table = load_table(path) if path else None
        self._lessons = Lessons(kind_of(self._table))
        self._surface, self._press = SurfaceFilter(), PressCheck()
        self.error: TaskError | None = None
        self._going, self._record = Going(), Record(self.config.probe)
        self._motion = SurfaceMotion(
            self.config, self._dome, self._surface, math.inf, MAX_STAMP_AGE)

    def retune(self, config: SurfaceConfig) -> None:
        """Use new gains from now on."""
        self.config = config
        self._motion.retune(config)

    @property
    def stiffness(self) -> float:
        """Total stiffness of skin, finger and robot along the normal [N/m]."""
        return self.config.probe.stiffness

    def validate(self, goal: SurfaceGoal) -> Refusal | None:
        """Return why this law cannot execute a goal, or None."""
        try:
            taught = self._lessons.named(goal.features, goal.force)
        except ConfigurationError as error:
            return Refusal(ReasonCode.UNSUPPORTED_GOAL, str(error))
        if len(taught) > 1 and goal.pattern != Pattern.LINE and not goal.duration:
            return Refusal(ReasonCode.INVALID_GOAL,
                           'several features need a line, or a duration, to go through')
        return refuse_surface_goal(goal)

    def teach(self, name: str, image: TactileImage, array: TactelArray) -> str:
        """Store the features of an image under a name, see `Lessons.take`."""
        return self._lessons.take(name, image, array, self.servo.approach.contact_force)

    def begin(self, goal: SurfaceGoal, sensor: SensorInfo) -> None:
        """Forget the last goal and start a new one."""
        self.goal, self.error = goal, None
        self._stale = image_patience(sensor.nominal_rate)
        self._sense = ContactSense(sensor.array, self._dome, self.config, goal.force, self._table)
        self._going = Going(wanted_contacts(
            self._sense, self._lessons.named(goal.features, goal.force)))
        self._record = Record(self.config.probe)
        self._surface, self._press = SurfaceFilter(), PressCheck()
        self._motion = SurfaceMotion(
            self.config, self._dome, self._surface, sensor.array.half_width_x, self._motion.age)

    def resume(self) -> None:
        """Continue from a standstill, along the same path."""
        self._motion.stand()
        self._press.forget()
        self._going.stall.seen = None

    def observe(self, observation: Observation) -> None:
        """Process an image."""
        if observation.image is None:
            return
        pose, going = observation.pose(), self._going
        if pose is None:
            return
        felt = self._sense.look(observation.image, pose)
        tracking = going.begun is not None and not going.over
        if isinstance(felt, Reason):
            going.problem = felt
            return
        self._motion.age += AGE_SHARE * (
            min(observation.age, MAX_STAMP_AGE) - self._motion.age)
        going.felt, going.shown, going.problem = felt, observation.arrival, None
        off = felt.place - going.aim.place
        self.error = TaskError(float(off[0]), float(off[1]), force=felt.force)
        aside = math.hypot(*felt.place)
        share = min(self.goal.force / max(felt.force, 1e-6), 20.0)
        angle = math.hypot(PLACE_NOISE * share, PLACE_ERROR * aside) / self._dome.array_radius
        going.met = going.met or abs(felt.force - going.aim.force) < MET * going.aim.force
        take = self._surface.update if self._surface.begun else self._surface.reset
        take(self._sense.depth(felt.force), felt.normal, felt.centre, angle)
        if tracking:
            self._press.see(felt.centre, felt.normal, self._sense.depth(felt.force),
                            abs(felt.force - going.aim.force) < MET * going.aim.force)
            # Otherwise a part of the print may lie beside the pad, or may not be pressed yet.
            whole = going.met and aside <= CENTRED * self._sense.array.half_width_x
            self._record.keep(
                observation.stamp_ns, felt, float(off @ off), self._surface.normal, whole)

    def depth(self, force: float) -> float:
        """Return the depth for a force [N], relative to the depth at the goal's force [m]."""
        return self._sense.depth(force)

    @property
    def unfelt(self) -> float:
        """Force expected from the probe's depth, minus the force seen in images [N]."""
        return self._sense.pressed(self._press.unexplained) - self.goal.force

    def lacks(self, now: float) -> Reason | None:
        """Return what prevents the law from tracking, or None."""
        if now - self._going.shown < self._stale:
            return None
        return self._going.problem or Reason(ReasonCode.CONTACT_LOST)

    def assess(self, now: float, progress: float, load: float) -> Assessment:
        """Decide whether to continue."""
        record, found = self._record, self._assess(now, progress, load)
        record.cycles += 1
        record.touching += self._going.problem is None
        self._going.over = found.state is State.DONE
        return found

    def _assess(self, now: float, progress: float, load: float) -> Assessment:
        going, goal = self._going, self.goal
        if going.begun is None:
            going.begun = now
        if len(going.wanted) > 1:
            share = progress / goal.length if goal.length else (now - going.begun) / goal.duration
            going.aim = between(going.wanted, share)
        if goal.duration and now - going.begun >= goal.duration:
            return Assessment(State.DONE, Reason(ReasonCode.DURATION_REACHED), True)
        if goal.pattern == Pattern.LINE and 0.0 < goal.length <= progress:
            return Assessment(State.DONE, Reason(ReasonCode.LENGTH_REACHED), True)
        lacking = self.lacks(now)
        if lacking is not None:
            return Assessment(State.HOLD, lacking)
        if going.end is not None:
            return going.end
        if going.met and load > OVERFORCE * goal.force:
            return Assessment(State.DONE, Reason(
                ReasonCode.OVERFORCE, f'{load:.1f} N, beyond {OVERFORCE:g} times the '
                f'{goal.force:g} N asked for'), lift=True)
        if going.stall.see(now, progress, ADVANCE, goal.speed):
            return Assessment(State.DONE, Reason(
                ReasonCode.NO_PROGRESS, self._motion.bound), lift=True)
        return Assessment(State.TRACK, Reason(ReasonCode.TRACKING))

    def reference(self, pose: np.ndarray, commanded: np.ndarray, agility: Agility,
                  dt: float) -> Reference:
        """Return the reference for the measured and the commanded pose (4, 4) of the sensor."""
        going, motion = self._going, self._motion
        normal = self.normal(commanded, dt)
        point = motion.centre_of(commanded) + self._dome.skin_radius * normal
        if going.path is None:
            going.path = plan_path(self.goal, point, normal, self.config.course.acceleration)
        step = going.path.step(point, normal, RETURN_RATE, motion.speed)
        if step is None:
            going.end = Assessment(State.DONE, Reason(
                ReasonCode.NO_PROGRESS, 'the surface is too steep for the path'))
            step = STAND
        elif step.left <= 0.0:
            going.end = Assessment(State.DONE, Reason(ReasonCode.PATH_COMPLETED), True)
        speed = motion.advance(
            step, self.felt, going.aim, self.goal.speed if going.met else 0.0,
            motion.pace(step.way, normal, commanded, agility), dt)
        twist = self.twist(normal, step.way, pose, commanded, agility, dt)
        return Reference(twist, speed, step.way.tolist())

    @property
    def felt(self) -> Felt:
        """Newest contact."""
        assert self._going.felt is not None  # otherwise `lacks` prevents tracking
        return self._going.felt

    def normal(self, commanded: np.ndarray, dt: float) -> np.ndarray:
        """Return the inward normal (3,) for the motion from a commanded pose (4, 4)."""
        raise NotImplementedError

    def twist(self, normal: np.ndarray, way: np.ndarray, pose: np.ndarray,
              commanded: np.ndarray, agility: Agility, dt: float) -> np.ndarray:
        """Return the twist (6,) in the sensor's frame, for a direction (3,) and a normal (3,)."""
        raise NotImplementedError

    @property
    def touch(self) -> Touch | None:
        """Last measured point of the surface, or None."""
        return self._record.newest

    def result(self) -> SurfaceResult:
        """Return the measured contacts."""
        return self._record.result()
