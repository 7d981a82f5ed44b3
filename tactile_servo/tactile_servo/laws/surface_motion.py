"""Motion of a round probe over a surface: speed along it, force, rotation about its centre."""
import math

import numpy as np

from tactile_sensing.dome.geometry import Dome
from tactile_servo.control.scaling import clipped, ramp, slewed
from tactile_servo.control.surface_filter import SurfaceFilter
from tactile_servo.control.surface_path import Step
from tactile_servo.laws.surface_config import SurfaceFollowingConfig
from tactile_servo.laws.surface_features import Felt, Told
from tactile_servo.motion.agility import Agility, Pace

# Of the force:
LIFTED, PRESSED = 0.5, 0.85  # at which the probe stands, and goes at full speed
CROWDED, BORNE = 1.6, 1.15  # the same for too much of it
UNHEARD = 0.2  # by which it may grow on a way that no joint state has shown
INTEGRATED = 0.3  # the error up to which the integral counts it
# Of half the pad:
ASIDE, CENTRED = 0.7, 0.3  # distance of the contact, at which the probe stands and does not slow
# Others
LATE = 0.2  # of the change of the turn that is wanted: less than this at once is late
WITHIN = 0.8  # of the rate of turn, which the surface may take
AT_ONCE = 0.7  # of the turn's acceleration, which speeding up may take
ANSWER = 0.02  # s until the robot answers to what an image showed
TURNED = 0.4  # least way of the contact, as a share of the centre's: on an edge it is none
EDGE = 1.0 / 3.0  # the same, of an object that is half as wide as the probe: of an edge
BRAKE = 8.0  # times the acceleration, with which the probe slows down
# Of the acceleration that the joints have left:
SPARED = 0.5  # which speeding up may take
BRAKED, SLOWED = 0.8, 0.02  # which slowing down may take, and what it has at the least [m/s^2]
TURNING = 0.6  # which a change of the turn may take
STAND = Step(np.zeros(3), 0.0, math.inf)


class SurfaceMotion:
    """
    How a probe goes on, presses and turns, given what the filter says of the surface.

    Vectors are in the base frame; `half` is half the width of the pad [m].
    """

    def __init__(self, config: SurfaceFollowingConfig, dome: Dome, surface: SurfaceFilter,
                 half: float, age: float):
        self.config, self._dome, self._surface, self._half = config, dome, surface, half
        self.age = age  # of the images, running mean [s]
        self.stand()

    def stand(self) -> None:
        """Stand still."""
        self.speed, self._integral, self._late = 0.0, 0.0, False
        self.bound = ''  # limit of the joints that slows it down, if one does
        self._press = 0.0  # along the normal [m/s]
        self._turn, self._velocity = np.zeros(3), np.zeros(3)  # of the centre [rad/s, m/s]

    def centre_of(self, pose: np.ndarray) -> np.ndarray:
        """Centre (3,) of the probe at a pose (4, 4)."""
        return pose[:3, 3] + pose[:3, :3] @ self._dome.centre

    def normal_ahead(self, commanded: np.ndarray, dt: float) -> np.ndarray:
        """Inward normal (3,) at the end of a cycle, where its velocity holds."""
        return self._surface.predict(self.centre_of(commanded) + dt * self._velocity)[1]

    def course(self, way: np.ndarray, normal: np.ndarray, commanded: np.ndarray) -> np.ndarray:
        """Twist (6,) of the sensor in its own frame for each metre of a way (3,) at a normal."""
        velocity = way / self._shrink(way)
        return self._twist(velocity, np.cross(normal, self._surface.bend @ velocity),
                           commanded[:3, :3])

    def _twist(self, velocity, turn, rotation, dt=0.0):
        """Twist (6,) of the sensor in its own frame, which turns, by the motion of the centre."""
        own = rotation.T @ turn
        linear = rotation.T @ (velocity - dt * np.cross(turn, velocity))
        return np.concatenate([linear - np.cross(own, self._dome.centre), own])

    def advance(self, step: Step, felt: Felt, aim: Told, speed: float, pace: Pace,
                dt: float) -> float:
        """Speed along a path [m/s], slowed down where need be from the one that is wanted."""
        c, share = self.config.course, felt.force / aim.force
        scale = (ramp(share, LIFTED, PRESSED) * ramp(share, CROWDED, BORNE)
                 * ramp(math.hypot(*(felt.place - aim.place)) / self._half, ASIDE, CENTRED))
        top = min(speed, step.top, self._known(step.way)) * scale
        # The probe must turn as it goes; one that is late with that goes no faster.
        turn = float(np.linalg.norm(self._surface.bend @ step.way)) / self._shrink(step.way)
        change = min(c.acceleration, SPARED * pace.acceleration,
                     AT_ONCE * self.config.roll.acceleration / max(turn, 1e-9))
        self.bound = pace.bound if pace.speed < top else ''
        top = min(top, pace.speed, self.config.roll.max_rate * WITHIN / max(turn, 1e-9))
        if self._sharp(step.way):
            top = min(top, c.edge_speed * self._shrink(step.way))
        if self._late or top < self.speed:
            self.speed = max(min(top, self.speed), self.speed - min(
                BRAKE * c.acceleration, max(BRAKED * pace.acceleration, SLOWED)) * dt)
        else:
            self.speed = slewed(self.speed, top, change * dt)
        self.speed = min(self.speed, step.top)
        return self.speed

    def _shrink(self, way):
        """Way of the contact over the surface for each way of the probe's centre."""
        bend = float(way @ self._surface.bend @ way)
        return max(1.0 + self._dome.skin_radius * bend, TURNED)

    def _sharp(self, way):
        """Whether the contact hardly moves as the probe rolls on: over an edge."""
        return 1.0 + self._dome.skin_radius * float(way @ self._surface.bend @ way) < EDGE

    def _known(self, way):
        """Speed at which the curvature ahead is known well enough [m/s]."""
        reach = math.sqrt(2.0 * self.config.course.blind / max(self._surface.bend_std(way), 1e-9))
        return self._shrink(way) * reach / (self.age + ANSWER)

    def press(self, pose: np.ndarray, felt: Felt, aim: Told, wanted: float, depth: float | None,
              commanded: np.ndarray, dt: float) -> None:
        """
        Keep the force: PI, on a depth that is predicted, to one that is `wanted` [m].

        It is that of the measured pose: a robot that lags behind cuts the bends. But where that
        is not heard of in time, what was commanded counts: see `UNHEARD`. The integral is of the
        depth [m] that was felt, None until the force was met once.
        """
        c = self.config.press
        if depth is not None and abs(felt.force - aim.force) < INTEGRATED * aim.force:
            self._integral -= (depth - wanted) * dt
        depth, _ = self._surface.predict(self.centre_of(pose))
        sent, _ = self._surface.predict(self.centre_of(commanded))
        depth = max(depth, sent - UNHEARD * aim.force / self.config.probe.stiffness)
        speed = -c.gain * (depth - wanted) + c.integral_gain * self._integral
        # At the rim of the pad a part of the force is not felt.
        aside = math.hypot(*felt.place) > ASIDE * self._half
        self._press = clipped(speed, -c.max_speed, 0.0 if aside else c.press_speed)

    def twist(self, way: np.ndarray, normal: np.ndarray, commanded: np.ndarray, aim: Told,
              agility: Agility, dt: float) -> np.ndarray:
        """Twist (6,) of the sensor in its own frame, along a way (3,) at a normal (3,)."""
        rotation = commanded[:3, :3]
        velocity = self.speed / self._shrink(way) * way
        turn = self._roll(normal, self._surface.bend @ velocity,
                          rotation @ self._dome.direction(aim.place), agility, rotation, dt)
        self._velocity = velocity + self._press * normal
        return self._twist(self._velocity, turn, rotation, dt)

    def _roll(self, normal, change, axis, agility, rotation, dt):
        """
        Angular velocity (3,) in the base [rad/s].

        It goes with the normal, which changes, and brings to it the axis (3,) from the centre to
        where the contact is wanted.
        """
        c = self.config.roll
        wanted = np.cross(normal, change) + c.gain * np.cross(axis, normal)
        size = math.sqrt(wanted @ wanted)
        wanted = wanted * min(1.0, c.max_rate / max(size, 1e-12))
        step = wanted - self._turn
        more = max(math.sqrt(step @ step), 1e-12)
        most = min(c.acceleration, TURNING * agility.along(
            self._twist(np.zeros(3), step / more, rotation)).acceleration)
        share = most * dt / more
        self._late = share < LATE
        self._turn = self._turn + step * min(1.0, share)
        return self._turn


def thesis_twist(felt: Felt, aim: Told, way: np.ndarray, speed: float, commanded: np.ndarray,
                 dome: Dome, config: SurfaceFollowingConfig) -> np.ndarray:
    """Twist (6,) of the thesis: V_d in the sensor plane (6.5), and J^-1 dF (6.3) as a rate."""
    twist, ahead = np.zeros(6), commanded[:3, :3].T @ way
    twist[:2] = speed * ahead[:2] / max(math.hypot(ahead[0], ahead[1]), 1e-9)
    dx, dy, dz = config.thesis.gain * (felt.error - aim.error)
    twist[2] = clipped(dz, -config.press.max_speed, config.press.press_speed)
    turn = np.array([dy, -dx, 0.0]) / dome.array_radius
    turn *= min(1.0, config.roll.max_rate / max(math.sqrt(turn @ turn), 1e-12))
    twist[:3] += np.cross(turn, -dome.centre)
    twist[3:] = turn
    return twist
