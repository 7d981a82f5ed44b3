"""Motion of a round probe over a surface: speed along it, force, rotation about its centre."""
from dataclasses import replace
import math

import numpy as np

from tactile_sensing.dome.geometry import Dome
from tactile_servo.control.attitude_controller import AttitudeController, AttitudeGains
from tactile_servo.control.force_controller import ForceController, ForceGains, INTEGRATED
from tactile_servo.control.speed_controller import caution, SpeedController
from tactile_servo.control.surface_filter import SurfaceFilter
from tactile_servo.control.surface_path import Step
from tactile_servo.laws.surface_config import SurfaceConfig
from tactile_servo.laws.surface_features import Felt, Told
from tactile_servo.motion.agility import Agility, Pace

# Of the force:
UNHEARD = 0.2  # by which it may grow on a way that no joint state has shown
# Of half the pad:
ASIDE, CENTRED = 0.7, 0.3  # distance of the contact, at which the probe stands and does not slow
# Force and attitude:
INTEGRAL = 150.0  # 1/s^2
PRESS, LIFT = 0.01, 0.05  # largest speed along the normal [m/s], towards the object and off it
ROLL = 15.0  # 1/s, rate at which the contact is brought where it is wanted on the pad
# Speed:
WITHIN = 0.8  # of the rate of turn, which the surface may take
AT_ONCE = 0.7  # of the turn's acceleration, which speeding up may take
ANSWER = 0.02  # s until the robot answers to what an image showed
TURNED = 0.4  # least way of the contact, as a share of the centre's: on an edge it is none
EDGE = 1.0 / 3.0  # the same, of an object that is half as wide as the probe: of an edge
EDGE_SPEED = 0.015  # m/s, of the centre round an edge: what comes after it nobody has felt
BRAKE = 8.0  # times the acceleration, with which the probe slows down
# Of the acceleration that the joints have:
BENDING = 0.3  # which a way may take as the arm bends along it, as near a singularity
SPARED = 0.5  # of the rest, which speeding up may take
BRAKED, SLOWED = 0.8, 0.02  # which slowing down may take, and what it has at the least [m/s^2]
TURNING = 0.6  # which a change of the turn may take
STAND = Step(np.zeros(3), 0.0, math.inf)


class SurfaceMotion:
    """
    How a probe goes on, presses and turns, given what the filter says of the surface.

    Vectors are in the base frame; `half` is half the width of the pad [m].
    """

    def __init__(self, config: SurfaceConfig, dome: Dome, surface: SurfaceFilter,
                 half: float, age: float):
        self.config, self._dome, self._surface, self._half = config, dome, surface, half
        self.age = age  # of the images, running mean [s]
        self._speed = SpeedController()
        self._force = ForceController(ForceGains(config.press.gain, INTEGRAL, PRESS, LIFT))
        self._attitude = AttitudeController(AttitudeGains(
            ROLL, config.roll.max_rate, config.roll.acceleration))
        self.stand()

    def retune(self, config: SurfaceConfig) -> None:
        """Take other gains from now on."""
        self._force.gains = replace(self._force.gains, gain=config.press.gain)

    def stand(self) -> None:
        """Stand still."""
        for controller in (self._speed, self._force, self._attitude):
            controller.reset()
        self.bound = ''  # limit of the joints that slows it down, if one does
        self._shrunk = 1.0  # way of the contact for each of the centre
        self._velocity = np.zeros(3)  # of the centre [m/s]

    @property
    def speed(self) -> float:
        """Of the contact along the path [m/s]."""
        return self._speed.speed * self._shrunk

    def centre_of(self, pose: np.ndarray) -> np.ndarray:
        """Centre (3,) of the probe at a pose (4, 4)."""
        return pose[:3, 3] + pose[:3, :3] @ self._dome.centre

    def normal_ahead(self, commanded: np.ndarray, dt: float) -> np.ndarray:
        """Inward normal (3,) at the end of a cycle, where its velocity holds."""
        return self._surface.predict(self.centre_of(commanded) + dt * self._velocity)[1]

    def _twist(self, velocity: np.ndarray, turn: np.ndarray, rotation: np.ndarray,
               dt: float = 0.0) -> np.ndarray:
        """Twist (6,) of the sensor in its own frame, which turns, by the motion of the centre."""
        own = rotation.T @ turn
        linear = rotation.T @ (velocity - dt * np.cross(turn, velocity))
        return np.concatenate([linear - np.cross(own, self._dome.centre), own])

    def pace(self, way: np.ndarray, normal: np.ndarray, commanded: np.ndarray,
             agility: Agility) -> Pace:
        """Pace that the joints allow the centre along a way (3,) at a normal (3,)."""
        course = self._twist(way, np.cross(normal, self._surface.bend @ way), commanded[:3, :3])
        return agility.along(course, self._speed.speed, BENDING)

    def advance(self, step: Step, felt: Felt, aim: Told, wanted: float, pace: Pace,
                dt: float) -> float:
        """
        Speed of the contact along a path [m/s], slowed down where need be from the wanted one.

        What changes within bounds is the speed of the centre: over a bend that comes unexpectedly
        the contact is slower, not the centre faster.
        """
        c, roll = self.config.course, self.config.roll
        off = math.hypot(*(felt.place - aim.place)) / self._half
        bent = self._bent(step.way)
        self._shrunk = shrink = max(bent, TURNED)
        top = min(wanted, step.top) / shrink
        top = min(top, self._known(step.way)) * caution(
            felt.force / aim.force, (off - CENTRED) / (ASIDE - CENTRED))
        # The probe must turn as it goes; one that is late with that goes no faster.
        turn = max(float(np.linalg.norm(self._surface.bend @ step.way)), 1e-9)
        self.bound = pace.bound if pace.speed < top else ''
        top = min(top, pace.speed, roll.max_rate * WITHIN / turn)
        if self._on_edge():
            top = min(top, EDGE_SPEED / (self._dome.skin_radius * turn))
        along = c.acceleration / shrink
        faster = 0.0 if self._attitude.late else min(
            along, SPARED * pace.acceleration, AT_ONCE * roll.acceleration / turn)
        slower = min(BRAKE * along, max(BRAKED * pace.acceleration, SLOWED))
        self._speed.change(top, faster * dt, slower * dt)
        self._speed.speed = min(self._speed.speed, step.top / shrink)
        return self.speed

    def _bent(self, way: np.ndarray) -> float:
        """Way of the contact over the surface for each way of the probe's centre."""
        return 1.0 + self._dome.skin_radius * float(way @ self._surface.bend @ way)

    def _on_edge(self) -> bool:
        """Whether the contact hardly moves over the object, however the centre goes."""
        sharpest = -float(np.linalg.eigvalsh(self._surface.bend)[0])
        return 1.0 - self._dome.skin_radius * sharpest < EDGE

    def _known(self, way: np.ndarray) -> float:
        """Speed of the centre at which the curvature ahead is known well enough [m/s]."""
        reach = math.sqrt(2.0 * self.config.course.blind / max(self._surface.bend_std(way), 1e-9))
        return reach / (self.age + ANSWER)

    def press(self, pose: np.ndarray, commanded: np.ndarray, felt: Felt, aim: Told,
              wanted: float, depth: float | None, dt: float) -> float:
        """
        Velocity along the normal [m/s] that keeps the force by a depth that is `wanted` [m].

        It is that of the measured pose: a robot that lags behind cuts the bends. But where that
        is not heard of in time, what was commanded counts: see `UNHEARD`. The integral is of the
        depth [m] that was felt, None until the force was met once.
        """
        predicted, _ = self._surface.predict(self.centre_of(pose))
        sent, _ = self._surface.predict(self.centre_of(commanded))
        predicted = max(predicted, sent - UNHEARD * aim.force / self.config.probe.stiffness)
        near = abs(felt.force - aim.force) < INTEGRATED * aim.force
        return self._force.speed(
            wanted - predicted, wanted - depth if depth is not None and near else None, dt,
            # At the rim of the pad a part of the force is not felt.
            may_press=math.hypot(*felt.place) <= ASIDE * self._half)

    def twist(self, way: np.ndarray, normal: np.ndarray, press: float, commanded: np.ndarray,
              aim: Told, agility: Agility, dt: float) -> np.ndarray:
        """
        Twist (6,) of the sensor in its own frame, along a way (3,) at a normal (3,).

        The probe turns with the normal, and brings to it the axis from its centre to where the
        contact is wanted; it presses with a velocity [m/s].
        """
        rotation, velocity = commanded[:3, :3], self._speed.speed * way
        axis = rotation @ self._dome.direction(aim.place)
        error, ahead = np.cross(axis, normal), np.cross(normal, self._surface.bend @ velocity)
        about = self._twist(np.zeros(3), self._attitude.way(error, ahead), rotation)
        able = TURNING * agility.along(about).acceleration
        turn = self._attitude.rate(error, ahead, dt, able)
        self._velocity = velocity + press * normal
        return self._twist(self._velocity, turn, rotation, dt)
