"""
Laws that follow a surface with a round probe: 'tactile_jacobian', and 'jacobian_rate' as printed.

The difference of wanted and measured features of an image, times the inverse of the tactile
Jacobian, gives the place of the contact on the pad and its force (chapter 6).
"""
from collections.abc import Sequence
from dataclasses import dataclass, field
import math
from typing import ClassVar

import numpy as np

from tactile_common.errors import ConfigurationError
from tactile_sensing.dome.geometry import Dome
from tactile_sensing.types.array import TactelArray
from tactile_sensing.types.image import SensorInfo, TactileImage
from tactile_servo.config import image_patience, MAX_STAMP_AGE, ServoConfig, STALE_AFTER
from tactile_servo.control.press_check import PressCheck
from tactile_servo.control.progress import Stall
from tactile_servo.control.scaling import clipped
from tactile_servo.control.stability import AGE_SHARE
from tactile_servo.control.surface_filter import SurfaceFilter
from tactile_servo.control.surface_path import SurfacePath
from tactile_servo.law import (
    Assessment,
    done,
    Observation,
    overforce,
    Reference,
    Refusal,
    ServoLaw,
    UNPLACED,
)
from tactile_servo.laws.surface_config import SurfaceConfig
from tactile_servo.laws.surface_features import between, ContactSense, Felt, Lessons, PadContact
from tactile_servo.laws.surface_goal import (
    Pattern,
    plan_path,
    refuse_surface_goal,
    SurfaceGoal,
    SurfaceResult,
)
from tactile_servo.laws.surface_motion import CENTRED, LIFT, PRESS, ROLL_RATE, STOP, SurfaceMotion
from tactile_servo.laws.surface_record import Record
from tactile_servo.motion.motion import Motion
from tactile_servo.reasons import Reason, ReasonCode
from tactile_servo.tactile_jacobian.table import load_table
from tactile_servo.types import pressure_layer, State, TaskError

MET = 0.05  # relative error of the force at which it counts as reached, and motion begins
ADVANCE = 5e-4  # m, advance that counts as progress
RETURN_RATE = 30.0  # rate at which the contact returns to its path [1/s]
# Standard deviation of the contact's place on the pad: a part that includes friction [m], and a
# share of its distance from the pad's centre
PLACE_NOISE, PLACE_ERROR = 1e-4, 0.03
RATE_SHARE = 2.0 / 3.0  # share of `force.gain` at which 'jacobian_rate' makes up J^-1 dF
OVERFORCE = 2.5  # times the wanted force, above which the goal ends once the force was reached


@dataclass
class Going:
    """State of one goal."""

    wanted: Sequence[PadContact]  # wanted contacts, from first to last
    felt: Felt | None = None  # newest contact
    shown: float = -math.inf  # steady time of the newest contact [s]
    problem: Reason | None = None  # why the newest image shows no contact
    unplaced: bool = False  # whether the pose of the newest image is unknown
    begun: float | None = None  # steady time of first contact [s]
    path: SurfacePath | None = None
    met: bool = False  # True once the force was reached
    end: Assessment | None = None  # set when the path has ended
    over: bool = False  # True after the goal: contacts during lift-off are not recorded
    stall: Stall = field(default_factory=Stall)
    aim: PadContact = field(init=False)  # contact that is wanted now

    def __post_init__(self) -> None:
        self.aim = self.wanted[0]


class SurfaceFollowing(ServoLaw):
    """
    Follow a surface with the tactile Jacobian and the robot's own pose.

    The probe turns about its centre to bring the contact to the wanted place on the pad. It moves
    along the contact's normal to keep the force, and at right angles to it over the surface. The
    normal is filtered, and predicted from the robot's pose, so the age of the images is not in the
    loop.
    """

    name: ClassVar[str] = 'tactile_jacobian'
    goal_type: ClassVar[type] = SurfaceGoal
    config_type: ClassVar[type] = SurfaceConfig
    even: ClassVar[bool] = False  # on the rim of a step it is less
    near: ClassVar[float] = math.inf  # a contact may be anywhere on the pad
    # Set by `begin`:
    goal: SurfaceGoal
    press: PressCheck
    _dome: Dome
    _sense: ContactSense
    _surface: SurfaceFilter
    _motion: SurfaceMotion
    _going: Going

    def __init__(self, servo: ServoConfig, config: SurfaceConfig | None = None):
        self.servo, self.config = servo, config or SurfaceConfig()
        self._stale, self._age, self._begun = STALE_AFTER, MAX_STAMP_AGE, False
        path = self.config.jacobian.table
        self._table = load_table(path) if path else None
        self._lessons = Lessons(self._table)
        self.stiffness = math.nan  # set by `begin`
        self.press, self._record = PressCheck(), Record(self.config.probe)

    def retune(self, config: SurfaceConfig) -> None:
        self.config = config
        if self._begun:
            self._motion.retune(config)

    def validate(self, goal: SurfaceGoal) -> Refusal | None:
        try:
            taught = self._lessons.named(goal.features, goal.force)
        except ConfigurationError as error:
            return Refusal(ReasonCode.UNSUPPORTED_GOAL, str(error))
        if len(taught) > 1 and goal.pattern != Pattern.LINE and not goal.duration:
            return Refusal(ReasonCode.INVALID_GOAL,
                           'several features need a line, or a duration, to go through')
        return refuse_surface_goal(goal)

    def teach(self, name: str, image: TactileImage, array: TactelArray) -> str:
        return self._lessons.take(name, image, array, self.servo.approach.contact_force)

    def begin(self, goal: SurfaceGoal, sensor: SensorInfo) -> None:
        radius = self.config.probe.skin_radius
        layer = pressure_layer(sensor.layers)
        depth = layer.depth if layer else 0.0
        self._dome = Dome(radius, radius - depth, radius - 2.0 * depth)
        self.goal, self.error, self.touch, self._begun = goal, None, None, True
        self._stale = image_patience(sensor.nominal_rate)
        self._sense = ContactSense(sensor.array, self._dome, self.config, goal.force, self._table)
        self.stiffness = self._sense.stiffness
        features = self._lessons.named(goal.features, goal.force) or [self._sense.centred]
        self._going = Going([self._sense.contact_of(shown) for shown in features])
        self._surface, self.press, self._record = (
            SurfaceFilter(), PressCheck(), Record(self.config.probe))
        self._motion = SurfaceMotion(
            self.config, self._dome, self._surface, sensor.array.half_width_x, self._age)

    def halt(self) -> None:
        self._motion.halted = True

    def resume(self) -> None:
        self._motion.reset()
        self.press.forget()
        self._going.stall.seen = None

    def observe(self, observation: Observation) -> None:
        if observation.image is None:
            return
        pose, going = observation.pose, self._going
        going.unplaced = pose is None
        if pose is None:
            return
        felt = self._sense.look(observation.image, pose)
        if isinstance(felt, Reason):
            going.problem = felt
            return
        self._age += AGE_SHARE * (min(observation.age, MAX_STAMP_AGE) - self._age)
        self._motion.age = self._age
        going.felt, going.shown, going.problem = felt, observation.arrival, None
        off = felt.place - going.aim.place
        self.error = TaskError(float(off[0]), float(off[1]), force=felt.force)
        aside, depth = math.hypot(*felt.place), self._sense.depth(felt.force)
        share = min(self.goal.force / max(felt.force, 1e-6), 20.0)
        angle = math.hypot(PLACE_NOISE * share, PLACE_ERROR * aside) / self._dome.array_radius
        met = abs(felt.force - going.aim.force) < MET * going.aim.force
        going.met = going.met or met
        take = self._surface.update if self._surface.begun else self._surface.reset
        take(depth, felt.normal, felt.centre, angle)
        if going.begun is not None and not going.over:
            # Otherwise a part of the print may lie beside the pad, or may not be pressed yet.
            whole = going.met and aside <= CENTRED * self._sense.array.half_width_x
            self.press.see(pose, felt.centre, felt.normal, depth, whole)
            self._record.keep(
                observation.stamp_ns, felt, float(off @ off), self._surface.normal, whole)
            self.touch = self._record.newest

    def depth(self, force: float) -> float:
        return self._sense.depth(force)

    @property
    def unfelt(self) -> float:
        return self._sense.pressed(self.press.unexplained) - self.goal.force

    def lacks(self, now: float) -> Reason | None:
        if now - self._going.shown < self._stale:
            return None
        going = self._going
        return UNPLACED if going.unplaced else going.problem or Reason(ReasonCode.CONTACT_LOST)

    def assess(self, now: float, progress: float, load: float) -> Assessment:
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
            return done(ReasonCode.DURATION_REACHED, success=True)
        if goal.pattern == Pattern.LINE and 0.0 < goal.length <= progress:
            return done(ReasonCode.LENGTH_REACHED, success=True)
        lacking = self.lacks(now)
        if lacking is not None:
            return Assessment(State.HOLD, lacking)
        if going.end is not None:
            return going.end
        if going.met and load > OVERFORCE * goal.force:
            return overforce(load, goal.force, OVERFORCE)
        if going.stall.see(now, progress, ADVANCE, goal.speed):
            return done(ReasonCode.NO_PROGRESS, self._motion.bound, lift=True)
        return Assessment(State.TRACK, Reason(ReasonCode.TRACKING))

    def reference(self, pose: np.ndarray, commanded: np.ndarray, robot: Motion,
                  dt: float) -> Reference:
        going, motion = self._going, self._motion
        normal = self._normal(commanded, dt)
        point = motion.centre_of(commanded) + self._dome.skin_radius * normal
        if going.path is None:
            going.path = plan_path(self.goal, point, normal, self.config.speed.acceleration)
        step = going.path.step(point, normal, RETURN_RATE, motion.speed)
        if step is None:
            going.end = done(ReasonCode.NO_PROGRESS, 'the surface is too steep for the path')
            step = STOP
        elif step.left <= 0.0:
            going.end = done(ReasonCode.PATH_COMPLETED, success=True)
        speed = motion.advance(
            step, self._felt, going.aim, self.goal.speed if going.met else 0.0,
            motion.pace(step.way, normal, commanded, robot), dt)
        twist = self._twist(normal, step.way, pose, commanded, robot, dt)
        return Reference(twist, speed, step.way.tolist())

    @property
    def _felt(self) -> Felt:
        assert self._going.felt is not None  # otherwise `lacks` prevents tracking
        return self._going.felt

    def _normal(self, commanded: np.ndarray, dt: float) -> np.ndarray:
        """Return the inward normal (3,) predicted for the end of a cycle from a pose (4, 4)."""
        return self._motion.normal_ahead(commanded, dt)

    def _twist(self, normal: np.ndarray, way: np.ndarray, pose: np.ndarray,
               commanded: np.ndarray, robot: Motion, dt: float) -> np.ndarray:
        """Return the twist (6,) in the sensor's frame, for a direction (3,) and a normal (3,)."""
        going, motion, felt = self._going, self._motion, self._felt
        depth, wanted = self._sense.depth(felt.force), self._sense.depth(going.aim.force)
        press = motion.press(pose, commanded, felt, going.aim, wanted,
                             depth if going.met else None, dt)
        return motion.twist(way, normal, press, commanded, going.aim, robot, dt)

    def result(self) -> SurfaceResult:
        return self._record.result()


class JacobianRate(SurfaceFollowing):
    """
    Follow a surface with the law of the thesis: J^-1 dF as a rate (6.3), V_d in the plane (6.5).

    The printed law makes up all of the difference at every image, which is a gain of 200/s.
    """

    name: ClassVar[str] = 'jacobian_rate'

    def _normal(self, commanded: np.ndarray, dt: float) -> np.ndarray:
        return self._felt.normal

    def _twist(self, normal: np.ndarray, way: np.ndarray, pose: np.ndarray,
               commanded: np.ndarray, robot: Motion, dt: float) -> np.ndarray:
        twist, ahead = np.zeros(6), commanded[:3, :3].T @ way
        twist[:2] = self._motion.speed * ahead[:2] / max(math.hypot(ahead[0], ahead[1]), 1e-9)
        rate, felt, aim = RATE_SHARE * self.config.force.gain, self._felt, self._going.aim
        dx, dy = rate * (aim.place - felt.place)
        twist[2] = clipped(
            rate * (aim.force - felt.force) / self._sense.stiffness, -LIFT, PRESS)
        turn = np.array([dy, -dx, 0.0]) / self._dome.array_radius
        turn *= min(1.0, ROLL_RATE / max(math.sqrt(turn @ turn), 1e-12))
        twist[:3] += np.cross(turn, -self._dome.centre)
        twist[3:] = turn
        return twist
