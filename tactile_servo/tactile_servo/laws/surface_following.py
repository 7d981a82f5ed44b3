"""
Law 'tactile_jacobian': a round probe follows a surface by features of its image (chapter 6).

The difference of wanted and felt features, through the inverse of the tactile Jacobian, says
where on the pad the contact lies and how hard it presses. The probe turns about its centre to
bring the contact where it is wanted, goes along the contact's normal to keep the force, and over
the surface across it. That normal is filtered and predicted from the robot's own pose, so that
the age of the images is not in the loop.
"""
from dataclasses import dataclass, field
import math
from typing import ClassVar

import numpy as np

from tactile_sensing.dome.geometry import Dome
from tactile_sensing.types.image import SensorInfo
from tactile_servo.config import ServoConfig
from tactile_servo.control.scaling import clipped, ramp, slewed
from tactile_servo.control.stability import AGE_SHARE
from tactile_servo.control.surface_filter import SurfaceFilter
from tactile_servo.control.surface_path import (
    Line,
    PlanarPath,
    raster,
    seen_along,
    spiral,
    SurfacePath,
)
from tactile_servo.law import Assessment, Observation, Reference, Refusal
from tactile_servo.laws.surface_config import SurfaceFollowingConfig
from tactile_servo.laws.surface_features import ContactSense, Felt
from tactile_servo.laws.surface_goal import (
    Pattern,
    refuse_surface_goal,
    SurfaceGoal,
    SurfaceResult,
)
from tactile_servo.reasons import Reason, ReasonCode
from tactile_servo.tactile_jacobian.table import load_table
from tactile_servo.types import State, TaskError

# Of the force:
LIFTED, PRESSED = 0.2, 0.5  # at which the probe stands, and goes at full speed
CROWDED, BORNE = 2.0, 1.5  # the same for too much of it
INTEGRATED = 0.3  # the error up to which the integral counts it
MET = 0.05  # the error from which a force counts as met, and the probe goes
# Of half the pad:
ASIDE, CENTRED = 0.7, 0.3  # distance of the contact, at which the probe stands and does not slow
# Others
LATE = 0.2  # of the change of the turn that is wanted: less than this at once is late
WITHIN = 0.8  # of the rate of turn, which the surface may take
AT_ONCE = 0.7  # of the turn's acceleration, which speeding up may take
ANSWER = 0.02  # s until the robot answers to what an image showed
AVERAGED = 20  # images of the print, before it says how deep the skin is pressed
AREA_SHARE = 0.02  # of an image in the running mean of the print's size
SMALLEST = 1e-6  # m^2, of that
TURNED = 0.4  # least way of the contact, as a share of the centre's: on an edge it is none
BRAKE = 3.0  # times the acceleration, with which the probe slows down
SPACING = 2.5e-4  # m between the contacts of a result
STALL_TIME = 5.0  # s without progress
ADVANCE = 5e-4  # m that are progress
ON_SURFACE = Assessment(State.TRACK, Reason(ReasonCode.TRACKING))


@dataclass
class Going:
    """State of one goal."""

    felt: Felt | None = None  # newest contact
    shown: float = -math.inf  # steady time of it [s]
    problem: Reason | None = None  # of the newest image
    begun: float | None = None  # steady time of first contact [s]
    path: SurfacePath | None = None
    met: bool = False  # whether the force was met once
    end: Assessment | None = None  # what the path has come to
    over: bool = False  # whether the goal has ended: what is felt on lifting off is no surface
    reached: float = -math.inf  # progress, and when it was made [m, s]
    reached_at: float = -math.inf


@dataclass
class Record:
    """What was felt over the whole goal."""

    points: list = field(default_factory=list)  # (3,) [m]
    normals: list = field(default_factory=list)
    images: int = 0
    kept: int = 0
    pressed: int = 0  # since the force was first met
    square: float = 0.0  # of the contact's distance from where it is wanted [m^2]


class SurfaceFollowing:
    """Follow a surface by the tactile Jacobian."""

    name: ClassVar[str] = 'tactile_jacobian'
    goal_type: ClassVar[type] = SurfaceGoal
    config_type: ClassVar[type] = SurfaceFollowingConfig
    sees_images: ClassVar[bool] = True
    touch_speed = math.inf
    goal: SurfaceGoal  # since `begin`
    _sense: ContactSense

    def __init__(self, servo: ServoConfig, config: SurfaceFollowingConfig | None = None):
        self.servo, self.config = servo, config or SurfaceFollowingConfig()
        probe = self.config.probe
        self._dome = Dome(probe.skin_radius, probe.array_radius,
                          2.0 * probe.array_radius - probe.skin_radius)
        path = self.config.jacobian.table
        self._table = load_table(path) if path else None
        self._surface = SurfaceFilter(self.config.normal)
        self.error: TaskError | None = None
        self._going, self._record = Going(), Record()
        self._area = 0.0  # of the contact's print, running mean [m^2]
        self._age = servo.input.max_stamp_age  # of the images, running mean [s]
        self._stand()

    def _stand(self):
        self._speed, self._integral, self._late = 0.0, 0.0, False
        self._turn, self._velocity = np.zeros(3), np.zeros(3)  # in the base frame

    def validate(self, goal: SurfaceGoal) -> Refusal | None:
        """Why a goal is beyond this law, or None."""
        if goal.features:
            return Refusal(ReasonCode.UNSUPPORTED_GOAL,
                           f'no features were taught by the name {goal.features!r}')
        return refuse_surface_goal(goal)

    def begin(self, goal: SurfaceGoal, sensor: SensorInfo) -> None:
        """Forget the last goal and take a new one."""
        self.goal, self.error = goal, None
        self._sense = ContactSense(sensor.array, self._dome, self.config, goal.force, self._table)
        self._going, self._record = Going(), Record()
        self._surface = SurfaceFilter(self.config.normal)
        self._area = 0.0
        self._stand()

    def resume(self) -> None:
        """Go on from a standstill, along the same path."""
        self._stand()
        self._going.reached_at = -math.inf

    def observe(self, observation: Observation) -> None:
        """Take an image."""
        if observation.image is None:
            return
        pose, going = observation.pose(), self._going
        if pose is None:
            return
        felt = self._sense.look(observation.image, pose)
        tracking = going.begun is not None and not going.over
        self._record.images += tracking
        if isinstance(felt, Reason):
            going.problem = felt
            return
        self._age += AGE_SHARE * (
            min(observation.age, self.servo.input.max_stamp_age) - self._age)
        going.felt, going.shown, going.problem = felt, observation.arrival, None
        self.error = TaskError(float(felt.place[0]), float(felt.place[1]), force=felt.force)
        noise = self.config.normal
        aside = math.hypot(*felt.place)
        share = min(self.goal.force / max(felt.force, 1e-6), 20.0)
        angle = math.hypot(noise.location_noise * share,
                           noise.eccentricity * aside) / self._dome.array_radius
        going.met = going.met or abs(felt.force - self.goal.force) < MET * self.goal.force
        take = self._surface.update if self._surface.begun else self._surface.reset
        take(self._sense.depth(felt), felt.normal, felt.centre, angle)
        if tracking:
            self._keep(felt, aside)

    def _keep(self, felt, aside):
        record = self._record
        record.kept += 1
        record.square += aside**2
        if not self._going.met or aside > CENTRED * self._sense.array.half_width_x:
            return  # a part of the print may lie beside the pad
        record.pressed += 1
        self._area += max(AREA_SHARE, 1.0 / record.pressed) * (felt.area - self._area)
        if record.pressed < AVERAGED:
            return
        normal = self._surface.normal
        point = felt.centre + (self._dome.skin_radius - self._deflection(felt.force)) * normal
        if not record.points or np.linalg.norm(point - record.points[-1]) >= SPACING:
            record.points.append(point)
            record.normals.append(normal.copy())

    def _deflection(self, force):
        """
        Indentation of the skin [m], told by the size of its print.

        On an elastic foundation P = pi / 2 k d a b, a and b the half axes of the patch; the
        variance of its pressure is a^2 / 6 and b^2 / 6. It is larger on what curves more.
        """
        probe = self.config.probe
        area = max(self._area + probe.spread, SMALLEST)
        return force / (3.0 * math.pi * probe.modulus * area)

    def lacks(self, now: float) -> Reason | None:
        """What keeps the law from tracking, or None."""
        if now - self._going.shown < self.servo.input.lost_after:
            return None
        return self._going.problem or Reason(ReasonCode.CONTACT_LOST)

    def assess(self, now: float, progress: float, load: float) -> Assessment:
        """Decide whether to go on."""
        found = self._assess(now, progress, load)
        self._going.over = found.state is State.DONE
        return found

    def _assess(self, now, progress, load):
        going, goal = self._going, self.goal
        if going.begun is None:
            going.begun = now
        if goal.duration and now - going.begun >= goal.duration:
            return Assessment(State.DONE, Reason(ReasonCode.DURATION_REACHED), True)
        if goal.pattern == Pattern.LINE and 0.0 < goal.length <= progress:
            return Assessment(State.DONE, Reason(ReasonCode.LENGTH_REACHED), True)
        lacking = self.lacks(now)
        if lacking is not None:
            return Assessment(State.HOLD, lacking)
        if going.end is not None:
            return going.end
        most = self.config.press.overforce
        if going.met and load > most * goal.force:
            return Assessment(State.DONE, Reason(
                ReasonCode.OVERFORCE, f'{load:.1f} N, beyond {most:g} times the {goal.force:g} N '
                'asked for'), lift=True)
        if progress > going.reached + ADVANCE or going.reached_at == -math.inf:
            going.reached, going.reached_at = progress, now
        if now - going.reached_at > STALL_TIME:
            return Assessment(State.DONE, Reason(ReasonCode.NO_PROGRESS), lift=True)
        return ON_SURFACE

    def reference(self, pose: np.ndarray, commanded: np.ndarray, dt: float) -> Reference:
        """Wanted motion from the measured and the commanded pose (4, 4) of the sensor."""
        going, rotation = self._going, commanded[:3, :3]
        felt = going.felt
        assert felt is not None  # there is contact
        centre = commanded[:3, 3] + rotation @ self._dome.centre
        thesis = self.config.control == 'thesis'
        # In the middle of the cycle: a chord of the way would lead off the surface in time.
        _, normal = self._surface.predict(centre + 0.5 * dt * self._velocity)
        normal = felt.normal if thesis else normal
        point = centre + self._dome.skin_radius * normal
        if going.path is None:
            going.path = self._plan(point, normal)
        way, speed = self._advance(point, normal, felt, dt)
        if thesis:
            return self._as_printed(felt, way, speed, rotation)
        velocity = speed / self._shrink(way) * way
        press = self._press(felt, pose, dt)
        turn = self._roll(normal, self._surface.bend @ velocity, rotation, dt)
        self._velocity = velocity + press * normal
        arm = -rotation @ self._dome.centre
        linear = self._velocity + np.cross(turn, arm + 0.5 * dt * np.cross(turn, arm))
        return Reference(np.concatenate([rotation.T @ linear, rotation.T @ turn]), speed,
                         way.tolist())

    def _plan(self, point, normal) -> SurfacePath:
        goal, direction = self.goal, np.array(self.goal.direction, dtype=float)
        if goal.pattern == Pattern.LINE:
            return Line(point, normal, direction)
        if goal.pattern == Pattern.RASTER:
            plan = raster(*goal.size, goal.step_over)
        elif goal.pattern == Pattern.SPIRAL:
            plan = spiral(goal.size[0], goal.step_over)
        else:
            plan = seen_along(np.asarray(goal.points, dtype=float), point, normal, direction)
        return PlanarPath(point, normal, direction, plan, self.config.course.acceleration)

    def _advance(self, point, normal, felt, dt):
        """Unit vector over the surface, and speed along it, slowed down where need be."""
        going, c = self._going, self.config.course
        step = going.path.step(point, normal, c.gain, self._speed)
        if step is None:
            going.end = Assessment(State.DONE, Reason(
                ReasonCode.NO_PROGRESS, 'the surface is too steep for the path'))
            return np.zeros(3), 0.0
        if step.left <= 0.0:
            going.end = Assessment(State.DONE, Reason(ReasonCode.PATH_COMPLETED), True)
        share, half = felt.force / self.goal.force, self._sense.array.half_width_x
        scale = (going.met * ramp(share, LIFTED, PRESSED) * ramp(share, CROWDED, BORNE)
                 * ramp(math.hypot(*felt.place) / half, ASIDE, CENTRED))
        top = min(self.goal.speed, step.top, self._known(step.way)) * scale
        # The probe must turn as it goes; one that is late with that goes no faster.
        turn = float(np.linalg.norm(self._surface.bend @ step.way)) / self._shrink(step.way)
        change = min(c.acceleration, AT_ONCE * self.config.roll.acceleration / max(turn, 1e-9))
        top = min(top, self.config.roll.max_rate * WITHIN / max(turn, 1e-9))
        if self._late or top < self._speed:
            self._speed = max(min(top, self._speed), self._speed - BRAKE * c.acceleration * dt)
        else:
            self._speed = slewed(self._speed, top, change * dt)
        self._speed = min(self._speed, step.top)
        return step.way, self._speed

    def _shrink(self, way):
        """Way of the contact over the surface for each way of the probe's centre."""
        bend = float(way @ self._surface.bend @ way)
        return max(1.0 + self._dome.skin_radius * bend, TURNED)

    def _known(self, way):
        """Speed at which the curvature ahead is known well enough [m/s]."""
        reach = math.sqrt(2.0 * self.config.course.blind / max(self._surface.bend_std(way), 1e-9))
        return self._shrink(way) * reach / (self._age + ANSWER)

    def _press(self, felt, pose, dt):
        """
        Speed along the normal that keeps the force [m/s]: PI, on a depth that is predicted.

        It is that of the measured pose: a robot that lags behind cuts the bends.
        """
        c = self.config.press
        depth, _ = self._surface.predict(pose[:3, 3] + pose[:3, :3] @ self._dome.centre)
        missing = abs(felt.force - self.goal.force)
        if self._going.met and missing < INTEGRATED * self.goal.force:
            self._integral -= self._sense.depth(felt) * dt
        speed = -c.gain * depth + c.integral_gain * self._integral
        # At the rim of the pad a part of the force is not felt.
        aside = math.hypot(*felt.place) / self._sense.array.half_width_x > ASIDE
        return clipped(speed, -c.max_speed, 0.0 if aside else c.press_speed)

    def _roll(self, normal, change, rotation, dt):
        """Angular velocity (3,) in the base: with the normal, which changes, and to it [rad/s]."""
        c = self.config.roll
        wanted = np.cross(normal, change) + c.gain * np.cross(rotation[:, 2], normal)
        size = math.sqrt(wanted @ wanted)
        wanted = wanted * min(1.0, c.max_rate / max(size, 1e-12))
        step = wanted - self._turn
        share = c.acceleration * dt / max(math.sqrt(step @ step), 1e-12)
        self._late = share < LATE
        self._turn = self._turn + step * min(1.0, share)
        return self._turn

    def _as_printed(self, felt, way, speed, rotation):
        """The thesis' law: V_d in the sensor's plane (6.5), and J^-1 dF (6.3), as a rate."""
        c = self.config
        twist = np.zeros(6)
        ahead = rotation.T @ way
        size = math.hypot(ahead[0], ahead[1])
        twist[:2] = speed * ahead[:2] / max(size, 1e-9)
        dx, dy, dz = c.thesis.gain * felt.error
        twist[2] = clipped(dz, -c.press.max_speed, c.press.press_speed)
        turn = np.array([dy, -dx, 0.0]) / self._dome.array_radius
        size = math.sqrt(turn @ turn)
        turn *= min(1.0, c.roll.max_rate / max(size, 1e-12))
        twist[:3] += np.cross(turn, -self._dome.centre)
        twist[3:] = turn
        return Reference(twist, speed, way.tolist())

    def result(self) -> SurfaceResult:
        """Contacts that were felt."""
        record = self._record
        if not record.points:
            return SurfaceResult()
        return SurfaceResult(
            contour=np.array(record.points), normals=np.array(record.normals),
            contact_kept=record.kept / max(record.images, 1),
            centre_rms=math.sqrt(record.square / max(record.kept, 1)))
