"""
Laws that follow a surface with a round probe: 'tactile_jacobian', and 'jacobian_rate' as printed.

The difference of wanted and measured features of an image, times the inverse of the tactile
Jacobian, gives the place of the contact on the pad and its force (chapter 6).
"""
from dataclasses import dataclass, field
import math
from typing import ClassVar

import numpy as np

from tactile_common.errors import ConfigurationError
from tactile_common.geometry import cross
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
    ServoLaw,
    Touch,
    UNPLACED,
)
from tactile_servo.laws.surface_config import ProbeConfig, SurfaceConfig
from tactile_servo.laws.surface_features import between, ContactSense, Felt, Lessons
from tactile_servo.laws.surface_goal import (
    Pattern,
    plan_path,
    refuse_surface_goal,
    SurfaceGoal,
    SurfaceResult,
)
from tactile_servo.laws.surface_motion import CENTRED, LIFT, PRESS, ROLL_RATE, STOP, SurfaceMotion
from tactile_servo.motion.motion import Motion
from tactile_servo.reasons import Reason, ReasonCode
from tactile_servo.tactile_jacobian import load_table
from tactile_servo.types import depth_of, State, TaskError

MET = 0.05  # relative error of the force at which it counts as reached, and motion begins
ADVANCE = 5e-4  # m, advance that counts as progress
RETURN_RATE = 30.0  # rate at which the contact returns to its path [1/s]
# Standard deviation of the contact's place on the pad: a part that includes friction [m], and a
# share of its distance from the pad's centre
PLACE_NOISE, PLACE_ERROR = 1e-4, 0.03
RATE_SHARE = 2.0 / 3.0  # share of `force.gain` at which 'jacobian_rate' makes up J^-1 dF
TOUCH_SPACING = 2.5e-4  # m, least distance between the recorded contacts
LEAST_IMAGES = 20  # images of the whole print after which its mean area is accurate enough
AREA_WEIGHT = 0.02  # weight of the newest area in the running mean
# m^2, by which the area from an image is smaller than that from the pressure on the skin; computed
# by finite elements for the default probe
BLURRED_AREA = 2.0e-6
OVERFORCE = 2.5  # times the wanted force, above which the goal ends once the force was reached


@dataclass
class Record:
    """Contacts with a surface during one goal."""

    probe: ProbeConfig
    touches: list[Touch] = field(default_factory=list)
    cycles: int = 0  # control cycles of tracking
    touching: int = 0  # those whose newest image shows a contact
    kept: int = 0  # recorded images with contact
    pressed: int = 0  # images with the whole print on the pad
    area: float = 0.0  # running mean of `Felt.area` [m^2]
    square: float = 0.0  # sum of the squared distances of the contact from its wanted place [m^2]

    def keep(self, stamp_ns: int, felt: Felt, off: float, normal: np.ndarray,
             whole: bool) -> Touch | None:
        """
        Record a contact, and return it if its position on the surface is accurate.

        `off` is the squared distance from its wanted place [m^2], `normal` (3,) the filtered
        inward normal. `whole` is True if the whole print is measured.
        """
        self.kept += 1
        self.square += off
        if not whole:
            return None
        self.pressed += 1
        self.area += max(AREA_WEIGHT, 1.0 / self.pressed) * (felt.area - self.area)
        if self.pressed < LEAST_IMAGES:
            return None
        # On an elastic foundation P = pi / 2 k d a b, with the half axes a and b of the patch. The
        # variances of its pressure are a^2 / 6 and b^2 / 6.
        indentation = felt.force / (3.0 * math.pi * self.probe.modulus
                                    * (self.area + BLURRED_AREA))
        point = felt.centre + (self.probe.skin_radius - indentation) * normal
        touch = Touch(stamp_ns, point, normal.copy())
        if not self.touches or np.linalg.norm(point - self.touches[-1].point) >= TOUCH_SPACING:
            self.touches.append(touch)
        return touch

    def result(self) -> SurfaceResult:
        """Return the recorded contacts."""
        contacts = [(touch.point, touch.normal) for touch in self.touches]
        points, normals = map(np.array, zip(*contacts, strict=True)) if contacts else (None, None)
        return SurfaceResult(
            contour=points, normals=normals,
            contact_kept=self.touching / self.cycles if self.cycles else math.nan,
            centre_rms=math.sqrt(self.square / self.kept) if self.kept else math.nan)


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
    _felt: Felt  # newest contact, set by `observe`; before it `lacks` prevents tracking

    def __init__(self, servo: ServoConfig, config: SurfaceConfig | None = None):
        self.servo, self.config = servo, config or SurfaceConfig()
        self._stale, self._age, self._begun = STALE_AFTER, MAX_STAMP_AGE, False
        path = self.config.table
        self._table = load_table(path) if path else None
        self._lessons = Lessons(self._table)
        self.stiffness = math.nan  # set by `begin`
        self.press, self._record = PressCheck(), Record(self.config.probe)

    def retune(self, config: SurfaceConfig) -> None:
        self.config = config
        if self._begun:
            self._motion.retune(config)

    def validate(self, goal: SurfaceGoal) -> Reason | None:
        try:
            taught = self._lessons.named(goal.features, goal.force)
        except ConfigurationError as error:
            return Reason(ReasonCode.UNSUPPORTED_GOAL, str(error))
        if len(taught) > 1 and goal.pattern != Pattern.LINE and not goal.duration:
            return Reason(ReasonCode.INVALID_GOAL,
                          'several features need a line, or a duration, to go through')
        return refuse_surface_goal(goal)

    def teach(self, name: str, image: TactileImage, array: TactelArray) -> str:
        return self._lessons.take(name, image, array, self.servo.contact_force)

    def begin(self, goal: SurfaceGoal, sensor: SensorInfo) -> None:
        radius = self.config.probe.skin_radius
        depth = depth_of(sensor.layers)
        self._dome = Dome(radius, radius - depth, radius - 2.0 * depth)
        self.goal, self.error, self.touch, self._begun = goal, None, None, True
        self._stale = image_patience(sensor.nominal_rate)
        self._sense = ContactSense(sensor.array, self._dome, self.config, goal.force, self._table)
        self.stiffness = self._sense.stiffness
        features = self._lessons.named(goal.features, goal.force) or [self._sense.centred]
        # Wanted contacts, from first to last, and the one that is wanted now
        self._wanted = [self._sense.contact_of(shown) for shown in features]
        self._aim = self._wanted[0]
        # Steady times of the newest contact, and of the first one [s]
        self._shown, self._touched = -math.inf, math.nan
        # Why the newest image shows no contact, and whether its pose is unknown
        self._problem: Reason | None = None
        self._unplaced = False
        self._path: SurfacePath | None = None
        self._met = False  # True once the force was reached, since the last hold
        self._end: Assessment | None = None  # set when the path has ended
        self._over = False  # True after the goal: contacts during lift-off are not recorded
        self._stall = Stall()
        self._surface, self.press, self._record = (
            SurfaceFilter(), PressCheck(), Record(self.config.probe))
        self._motion = SurfaceMotion(
            self.config, self._dome, self._surface, sensor.array.half_width_x, self._age)

    def halt(self) -> None:
        self._motion.halted = True

    def resume(self) -> None:
        self._motion.reset()
        self.press.forget()
        self._met = False  # it may have lifted off
        self._stall.seen = None

    def observe(self, observation: Observation) -> None:
        if observation.image is None:
            return
        pose = observation.pose
        self._unplaced = pose is None
        if pose is None:
            return
        felt = self._sense.look(observation.image, pose)
        if isinstance(felt, Reason):
            self._problem = felt
            return
        self._age += AGE_SHARE * (min(observation.age, MAX_STAMP_AGE) - self._age)
        self._motion.age = self._age
        self._felt, self._shown, self._problem = felt, observation.arrival, None
        off = felt.place - self._aim.place
        self.error = TaskError(float(off[0]), float(off[1]), force=felt.force)
        aside, depth = math.hypot(*felt.place), self.depth(felt.force)
        share = min(self.goal.force / max(felt.force, 1e-6), 20.0)
        angle = math.hypot(PLACE_NOISE * share, PLACE_ERROR * aside) / self._dome.array_radius
        met = abs(felt.force - self._aim.force) < MET * self._aim.force
        self._met = self._met or met
        self._surface.update(depth, felt.normal, felt.centre, angle)
        if not (math.isnan(self._touched) or self._over):
            # Otherwise a part of the print may lie beside the pad, or may not be pressed yet.
            whole = self._met and aside <= CENTRED * self._sense.array.half_width_x
            self.press.see(pose, felt.centre, felt.normal, depth, whole)
            self.touch = self._record.keep(
                observation.stamp_ns, felt, float(off @ off), self._surface.normal, whole)

    def depth(self, force: float) -> float:
        """Return the depth [m] for a force [N], relative to that for the goal's force."""
        wanted = self.goal.force
        return 2.0 * wanted / self.stiffness * (math.sqrt(force / wanted) - 1.0)

    @property
    def unfelt(self) -> float:
        wanted, depth = self.goal.force, self.press.unexplained
        return wanted * max(1.0 + 0.5 * self.stiffness * depth / wanted, 0.0)**2 - wanted

    def lacks(self, now: float) -> Reason | None:
        if now - self._shown < self._stale:
            return None
        return UNPLACED if self._unplaced else self._problem or Reason(ReasonCode.CONTACT_LOST)

    def assess(self, now: float, progress: float, load: float) -> Assessment:
        record, found = self._record, self._assess(now, progress, load)
        record.cycles += 1
        record.touching += self._problem is None
        self._over = found.state is State.DONE
        return found

    def _assess(self, now: float, progress: float, load: float) -> Assessment:
        goal = self.goal
        if math.isnan(self._touched):
            self._touched = now
        lasting = now - self._touched
        if len(self._wanted) > 1:
            self._aim = between(
                self._wanted, progress / goal.length if goal.length else lasting / goal.duration)
        if goal.duration and lasting >= goal.duration:
            return done(ReasonCode.DURATION_REACHED, success=True)
        if goal.pattern == Pattern.LINE and 0.0 < goal.length <= progress:
            return done(ReasonCode.LENGTH_REACHED, success=True)
        lacking = self.lacks(now)
        if lacking is not None:
            return Assessment(State.HOLD, lacking)
        if self._end is not None:
            return self._end
        if self._met and load > OVERFORCE * goal.force:
            return overforce(load, goal.force, OVERFORCE)
        if self._stall.see(now, progress, ADVANCE, goal.speed):
            return done(ReasonCode.NO_PROGRESS, self._motion.bound, lift=True)
        return Assessment(State.TRACK, Reason(ReasonCode.TRACKING))

    def reference(self, pose: np.ndarray, commanded: np.ndarray, robot: Motion,
                  dt: float) -> Reference:
        motion, normal = self._motion, self._normal(commanded, dt)
        point = motion.centre_of(commanded) + self._dome.skin_radius * normal
        if self._path is None:
            self._path = plan_path(self.goal, point, normal, self.config.acceleration)
        step = self._path.step(point, normal, RETURN_RATE, motion.speed)
        if step is None:
            self._end = done(ReasonCode.NO_PROGRESS, 'the surface is too steep for the path')
            step = STOP
        elif step.left <= 0.0:
            self._end = done(ReasonCode.PATH_COMPLETED, success=True)
        speed = motion.advance(
            step, self._felt, self._aim, self.goal.speed if self._met else 0.0,
            motion.pace(step.way, normal, commanded, robot), dt)
        twist = self._twist(normal, step.way, pose, commanded, robot, dt)
        return Reference(twist, speed, step.way.tolist())

    def _normal(self, commanded: np.ndarray, dt: float) -> np.ndarray:
        """Return the inward normal (3,) predicted for the end of a cycle from a pose (4, 4)."""
        motion = self._motion
        return self._surface.predict(motion.centre_of(commanded) + dt * motion.velocity)[1]

    def _twist(self, normal: np.ndarray, way: np.ndarray, pose: np.ndarray,
               commanded: np.ndarray, robot: Motion, dt: float) -> np.ndarray:
        """Return the twist (6,) in the sensor's frame, for a direction (3,) and a normal (3,)."""
        motion, felt, aim = self._motion, self._felt, self._aim
        press = motion.press(pose, commanded, felt, aim, self.depth(aim.force),
                             self.depth(felt.force) if self._met else None, dt)
        return motion.twist(way, normal, press, commanded, aim, robot, dt)

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
        rate, felt, aim = RATE_SHARE * self.config.force_gain, self._felt, self._aim
        dx, dy = rate * (aim.place - felt.place)
        twist[2] = clipped(
            rate * (aim.force - felt.force) / self.stiffness, -LIFT, PRESS)
        turn = np.array([dy, -dx, 0.0]) / self._dome.array_radius
        turn *= min(1.0, ROLL_RATE / max(math.sqrt(turn @ turn), 1e-12))
        twist[:3] += cross(turn, -self._dome.centre)
        twist[3:] = turn
        return twist
