"""Motion of a round probe over a surface: speed along it, force, rotation about its centre."""
import math

import numpy as np

from tactile_common.geometry import cross
from tactile_sensing.dome.geometry import Dome
from tactile_servo.control.attitude_controller import AttitudeController, TURNING
from tactile_servo.control.force_controller import ForceController, INTEGRATED
from tactile_servo.control.scaling import caution
from tactile_servo.control.surface_filter import SurfaceFilter
from tactile_servo.control.surface_path import PathStep
from tactile_servo.laws.surface_config import SurfaceConfig
from tactile_servo.laws.surface_features import Felt, PadContact
from tactile_servo.motion.motion import BENDING, JointPace, Motion

# Share of the force:
UNHEARD = 0.2  # largest increase by commanded motion that no joint state has confirmed
# Shares of half the pad:
ASIDE, CENTRED = 0.7, 0.3  # distance of the contact from its wanted place: stop; full speed
# Force and attitude:
INTEGRAL = 150.0  # integral gain of the force control [1/s^2]
PRESS, LIFT = 0.01, 0.05  # largest speed along the normal [m/s], towards the object and off it
ROLL = 15.0  # rate at which the contact is brought to its wanted place on the pad [1/s]
ROLL_RATE = 10.0  # rad/s, largest: that of 0.2 m/s over a radius of 20 mm
# Speed:
ANSWER = 0.02  # time until the robot reacts to an image [s]
TURNED = 0.4  # least motion of the contact relative to the centre's: on an edge it is zero
EDGE = 1.0 / 3.0  # this ratio for an object half as wide as the probe; below it, an edge
EDGE_SPEED = 0.015  # speed of the centre round an edge [m/s]: the surface behind it is unknown
BRAKE = 8.0  # deceleration, as a multiple of the acceleration
SPARED = 0.5  # share of the acceleration that the joints have left, which speeding up may use
# The turn accelerates as `speed.acceleration` asks for on a radius of 33 mm [rad/m]; speeding up
# may use a share of it.
TURNS, AT_ONCE = 30.0, 0.7
STOP = PathStep(np.zeros(3), 0.0, math.inf)


class SurfaceMotion:
    """
    Speed, force and rotation of a probe on the surface that the filter estimates.

    Vectors are in the base frame; `half` is half the width of the pad [m].
    """

    def __init__(self, config: SurfaceConfig, dome: Dome, surface: SurfaceFilter,
                 half: float, age: float):
        self.config, self._dome, self._surface, self._half = config, dome, surface, half
        self.age = age  # running mean of the images' age [s]
        self._force = ForceController(config.force_gain, INTEGRAL, PRESS, LIFT)
        self._attitude = AttitudeController(ROLL, ROLL_RATE)
        self.reset()

    def retune(self, config: SurfaceConfig) -> None:
        """Use new gains from now on."""
        self._force.gain = config.force_gain

    def reset(self) -> None:
        """Reset all controllers to standstill."""
        self._force.reset()
        self._attitude.reset()
        self.bound = ''  # joint limit that reduces the speed, or empty
        self.halted = False  # True to stop along the path
        self._speed = self.speed = 0.0  # along the path, of the centre and of the contact [m/s]
        self.velocity = np.zeros(3)  # of the centre [m/s]

    def centre_of(self, pose: np.ndarray) -> np.ndarray:
        """Return the centre (3,) of the probe at a pose (4, 4) [m]."""
        return pose[:3, 3] + pose[:3, :3] @ self._dome.centre

    def _twist(self, velocity: np.ndarray, turn: np.ndarray, rotation: np.ndarray,
               dt: float = 0.0) -> np.ndarray:
        """Return the twist (6,) in the sensor's frame, which turns, for a motion of the centre."""
        own = rotation.T @ turn
        linear = rotation.T @ (velocity - dt * cross(turn, velocity))
        return np.concatenate([linear - cross(own, self._dome.centre), own])

    def pace(self, way: np.ndarray, normal: np.ndarray, commanded: np.ndarray,
             robot: Motion) -> JointPace:
        """Return the pace that the joints allow along a direction (3,) at a normal (3,)."""
        course = self._twist(way, cross(normal, self._surface.bend @ way), commanded[:3, :3])
        return robot.along(course, self._speed, BENDING)

    def advance(self, step: PathStep, felt: Felt, aim: PadContact, wanted: float, pace: JointPace,
                dt: float) -> float:
        """
        Return the speed of the contact along a path [m/s], at most the wanted one.

        The bounded acceleration is that of the centre: at an unexpected bend the contact becomes
        slower, but the centre does not become faster.
        """
        off = math.hypot(*(felt.place - aim.place)) / self._half
        bent = float(step.way @ self._surface.bend @ step.way)
        shrink = max(1.0 + self._dome.skin_radius * bent, TURNED)
        top = 0.0 if self.halted else min(wanted, step.top) / shrink
        reach = math.sqrt(  # within which the curvature is known well enough
            2.0 * self.config.blind / max(self._surface.bend_std(step.way), 1e-9))
        top = min(top, reach / (self.age + ANSWER)) * caution(
            felt.force / aim.force, (off - CENTRED) / (ASIDE - CENTRED))
        self.bound = pace.bound if pace.speed < top else ''
        top = min(top, pace.speed)
        # The probe must turn as it moves. While the turn is late, the speed does not increase.
        turn = max(float(np.linalg.norm(self._surface.bend @ step.way)), 1e-9)
        sharpest = -float(np.linalg.eigvalsh(self._surface.bend)[0])
        if 1.0 - self._dome.skin_radius * sharpest < EDGE:
            top = min(top, EDGE_SPEED / (self._dome.skin_radius * turn))
        acceleration = self.config.acceleration
        along = acceleration / shrink
        faster = 0.0 if self._attitude.late else min(
            along, SPARED * pace.acceleration, AT_ONCE * TURNS * acceleration / turn)
        slower = BRAKE * acceleration
        self._speed = min(max(top, self._speed - slower * dt), self._speed + faster * dt,
                          step.top / shrink)
        self.speed = self._speed * shrink  # of the contact
        return self.speed

    def press(self, pose: np.ndarray, commanded: np.ndarray, felt: Felt, aim: PadContact,
              wanted: float, depth: float | None, dt: float) -> float:
        """
        Return the velocity along the normal [m/s] that controls the depth to `wanted` [m].

        The depth is predicted at the measured pose, because a lagging robot cuts the bends. If
        the joint states come late, the commanded pose limits it: see `UNHEARD`. The integral uses
        the measured `depth` [m], None until the force was reached once.
        """
        predicted, _ = self._surface.predict(self.centre_of(pose))
        sent, _ = self._surface.predict(self.centre_of(commanded))
        stiffness = self.config.probe.stiffness(aim.force)
        predicted = max(predicted, sent - UNHEARD * aim.force / stiffness)
        near = abs(felt.force - aim.force) < INTEGRATED * aim.force
        return self._force.speed(
            wanted - predicted, wanted - depth if depth is not None and near else None, dt,
            # At the rim of the pad a part of the force is not measured.
            may_press=math.hypot(*felt.place) <= ASIDE * self._half)

    def twist(self, way: np.ndarray, normal: np.ndarray, press: float, commanded: np.ndarray,
              aim: PadContact, robot: Motion, dt: float) -> np.ndarray:
        """
        Return the twist (6,) in the sensor's frame, for a direction (3,) and a normal (3,).

        The probe turns with the normal, and aligns with it the axis from its centre to the wanted
        place of the contact. `press` is its velocity along the normal [m/s].
        """
        rotation, velocity = commanded[:3, :3], self._speed * way
        axis = rotation @ self._dome.direction(aim.place)
        error, ahead = cross(axis, normal), cross(normal, self._surface.bend @ velocity)
        about = self._twist(np.zeros(3), self._attitude.way(error, ahead), rotation)
        turn = self._attitude.rate(error, ahead, dt, min(
            TURNS * self.config.acceleration, TURNING * robot.along(about).acceleration))
        self.velocity = velocity + press * normal
        return self._twist(self.velocity, turn, rotation, dt)
