"""Motion of a pad along an edge: speed and path in the plane, force along the normal, turn."""

from dataclasses import dataclass
import math

import numpy as np

from tactile_common.config import bounded, check_fields
from tactile_servo.control.attitude_controller import AttitudeController, off_edge, TURNING
from tactile_servo.control.force_controller import (
    BRAKING,
    ForceController,
    INTEGRATED,
    REACTION,
    stopping_speed,
    unseen_way,
)
from tactile_servo.control.scaling import caution, clipped
from tactile_servo.control.stability import DEAD_TIME, LAG, stable_gain
from tactile_servo.edge_map.path_queries import PathPosition
from tactile_servo.edge_map.traced_path import PathEnd
from tactile_servo.laws.edge_sight import EdgeSight, Load
from tactile_servo.motion.motion import COMMITTED, Motion
from tactile_servo.types import EdgeGoal

# Speeds [m/s]
ENTRY = 0.03  # at which the second leg of a corner may reach the pad: its load comes suddenly
NORMAL = 0.05  # largest along the normal
RETURN_SPEED = 0.1  # largest back to the path
# Share of the robot's acceleration that is planned; the rest is for corrections
AGILE = 0.8
# m beyond the end of the visible path within which the pad can stop: 50 mm/s at 2 m/s^2
OVERRUN = 9e-4
CORNER_SETTLE = 3e-4  # m before and after a sharp corner that are passed at its speed, for the lag
# Grains
LOOK_AHEAD = 0.2  # length along the path over which its direction is measured
ON_PATH, ASTRAY = 0.1, 0.6  # distance from the path: full speed up to it, standstill from it on
# Time over which the delay from command to motion is averaged [s], and mean speed at which the
# measured delay counts as much as the assumed one [m/s]
AVERAGED, SLOW = 0.3, 1e-3
# Force
SHORTEST = 0.5  # least edge length that carries the force, as a share of the pad's half size
COMING_SHARE = 0.35  # share of the coming edge's length for which the pad unloads in advance
INTEGRAL = 60.0  # integral gain of the force control [1/s^2]
# Turn along the edge: gain [1/s], largest rate [rad/s] and acceleration [rad/s^2]
TURN_GAIN, TURN_RATE, TURN_ACCELERATION = 5.0, 1.5, 5.0
ABOUT_NORMAL = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 1.0])  # twist per radian


@dataclass(frozen=True)
class EdgeFollowingConfig:
    """User settings of robot and task for the law 'trace'."""

    acceleration: float = bounded(
        2.0, 'largest acceleration of the pad in the plane of the edge', 'm/s^2', 0.01, 100.0,
        name='speed.acceleration')
    lateral_gain: float = bounded(
        30.0, "rate at which the pad's distance from the traced edge is made up", '1/s',
        1.0, 200.0, live=True, name='path.lateral_gain')
    corner_cut: float = bounded(
        5e-5, 'distance from a sharp corner at which the pad may pass it; what the task allows',
        'm', 1e-6, 1e-2, name='path.corner_cut')
    force_gain: float = bounded(
        60.0, 'rate at which an error of the force is made up', '1/s', 1.0, 200.0, live=True,
        name='force.gain')
    max_turn: float = bounded(
        7.0, 'the pad is turned with the edge up to this angle from where it began, and '
        'kept beyond', 'rad', 0.0, 100.0, name='attitude.max_turn')

    def __post_init__(self) -> None:
        check_fields(self)


def missing_depth(force: float, load: Load, *, half: float, length: float, pressed: float,
                  skin_stiffness: float) -> float:
    """
    Return the additional indentation that the wanted force needs [m].

    The present line force is predicted from that of the image and from the pad's motion since.
    The wanted line force is the wanted force [N] over the edge `length` [m] that will soon be
    under the pad, whose smaller half side is `half` [m]. Since the image the indentation has
    increased by `pressed` [m]; `skin_stiffness` is the line force per indentation [N/m^2].
    """
    shortest = SHORTEST * half
    predicted = load.force / max(load.length, shortest) + skin_stiffness * pressed
    # Unload in advance for a part of the coming edge: the force is then too low before it arrives
    # by as much as it is too high afterwards.
    wanted = force / (max(length, shortest) + COMING_SHARE * load.coming)
    return (wanted - max(predicted, 0.0)) / skin_stiffness


class EdgeMotion:
    """
    Controllers of a pad at an edge; `speed` along it and `velocity` x, y in the plane [m/s].

    The stiffness is the total one along the normal [N/m].
    """

    def __init__(self, config: EdgeFollowingConfig, goal: EdgeGoal, sight: EdgeSight,
                 stiffness: float):
        self.config, self.goal, self.sight = config, goal, sight
        self._stiffness = stiffness
        self._force = ForceController(config.force_gain, INTEGRAL, press=NORMAL, lift=NORMAL)
        self._attitude = AttitudeController(TURN_GAIN, TURN_RATE)
        self._behind = self._mean_speed = 0.0  # way behind the command [m] and speed [m/s]
        self.reset()

    def retune(self, config: EdgeFollowingConfig) -> None:
        """Use new gains from now on."""
        self.config, self._force.gain = config, config.force_gain

    def reset(self) -> None:
        """Reset all controllers to standstill."""
        self.speed, self.velocity = 0.0, (0.0, 0.0)
        self.halted = False  # True to stop along the path
        self._force.reset()
        self._attitude.reset()

    def soon(self) -> tuple[float, float]:
        """Return the displacement x, y [m] within the time constant of the force control."""
        x, y = self.velocity
        return x / self.config.force_gain, y / self.config.force_gain

    def along(self, place: PathPosition, robot: Motion, dt: float, *,
              may_lift: bool = False) -> tuple[float, float]:
        """
        Return the velocity x, y along the path and back to it [m/s].

        With `may_lift`, a low force does not reduce the speed.
        """
        edge, load, goal = self.sight.edge, self.sight.load, self.goal
        scale, pressed = edge.scale, load.force / goal.force
        # A second leg that reaches the pad adds its load suddenly: slow down before.
        share = min(load.coming / min(scale.half_x, scale.half_y), 1.0)
        top = 0.0 if self.halted else goal.speed - max(goal.speed - ENTRY, 0.0) * share
        distance = math.hypot(*place.aside)
        off = (distance / scale.grain - ON_PATH) / (ASTRAY - ON_PATH)
        top *= caution(max(pressed, 1.0) if may_lift else pressed, off)
        top = min(top, AGILE * NORMAL / max(abs(self.sight.slope), 1e-9))  # on a slope
        course = place.there[:3, :3].T @ (*place.way, self.sight.slope)
        top = min(top, robot.passing(np.array([*course, 0.0, 0.0, 0.0])))
        most = min(self.config.acceleration, robot.across())
        end_speed = top
        if edge.path.end is PathEnd.VIEW:
            end_speed = stopping_speed(OVERRUN, AGILE * most, dt)
        if self.sight.lifted and not may_lift:
            end_speed = 0.0  # turn onto the edge first
        top = edge.speed_limit(place.ahead, top, AGILE * most, end_speed,
                               self.config.corner_cut, settle=CORNER_SETTLE)
        self.speed = speed = min(top, self.speed + AGILE * most * dt)
        ux, uy = edge.way(place.ahead, place.ahead + LOOK_AHEAD * scale.grain + speed * dt)
        # Return to the path slowly enough to stop there.
        gain = min(self.config.lateral_gain, stable_gain(self._measure_delay(place, dt)))
        back = min(gain * distance, math.sqrt(most * distance),
                   RETURN_SPEED) / max(distance, 1e-9)
        x, y = place.aside
        return self._change(speed * ux + back * x, speed * uy + back * y, most * dt)

    def _measure_delay(self, place: PathPosition, dt: float) -> float:
        """Average in this cycle; return how long the pad takes to where it was commanded [s]."""
        share = dt / AVERAGED
        self._behind += share * (place.ahead - place.here - self._behind)
        self._mean_speed += share * (self.speed - self._mean_speed)
        assumed = SLOW * (COMMITTED + DEAD_TIME + LAG)
        return max((self._behind + assumed) / (self._mean_speed + SLOW), COMMITTED)

    def _change(self, x: float, y: float, most: float) -> tuple[float, float]:
        """Change the velocity towards x, y by at most `most` [m/s], and return it."""
        before_x, before_y = self.velocity
        size = math.hypot(x - before_x, y - before_y)
        share = most / size if size > most else 1.0
        self.velocity = before_x + (x - before_x) * share, before_y + (y - before_y) * share
        return self.velocity

    def aside(self, x: float, y: float, dt: float) -> tuple[float, float]:
        """Change the velocity towards a wanted x, y that leaves the path; return it [m/s]."""
        self.speed = math.hypot(x, y)
        return self._change(x, y, self.config.acceleration * dt)

    def touch_speed(self, left: float) -> float:
        """Return the speed along the normal [m/s] that can stop at a touch or after `left` [m]."""
        # Images of this age show a touch in time.
        seen = unseen_way(self.goal.force, self._stiffness) / (self.sight.age + REACTION)
        # Plan half of the deceleration: commands already sent delay the braking.
        return min(NORMAL, seen, math.sqrt(BRAKING * left))

    def depth(self, force: float) -> float:
        """Return the indentation [m] for a force [N], with the edge length under the pad."""
        edge = self.sight.edge
        length = max(self.sight.load.length, SHORTEST * min(edge.scale.half_x, edge.scale.half_y))
        return force / (edge.skin_stiffness * length)

    def press(self, place: PathPosition, robot: Motion, dt: float, *,
              may_press: bool = True) -> float:
        """Return the velocity along the normal that keeps the force [m/s]."""
        sight, goal = self.sight, self.goal
        load, scale, depth = sight.load, sight.edge.scale, place.there.item(2, 3)
        missing = missing_depth(
            goal.force, load, half=min(scale.half_x, scale.half_y), length=place.length,
            pressed=depth - sight.height - sight.slope * (place.ahead - sight.station),
            skin_stiffness=sight.edge.skin_stiffness)
        off = goal.force - load.force
        give = self._force.speed(
            missing, off / self._stiffness if abs(off) < INTEGRATED * goal.force else None, dt,
            # Do not press on contacts that are not the edge.
            may_press=may_press and sight.problem is None)
        if load.coming > 0.0 and missing < 0.0:
            # Unloading for a coming leg must be quick; the motion since the image is known.
            give = min(give, -stopping_speed(-missing, AGILE * robot.lifting(), dt))
        return clipped(give + sight.slope * self.speed, -NORMAL, NORMAL)

    def turn(self, place: PathPosition, robot: Motion, dt: float) -> np.ndarray:
        """Return the angular velocity (3,) that aligns the pad with the edge [rad/s]."""
        error = off_edge(place.there, place.way, self.sight.slope, self.goal.direction,
                         self.config.max_turn)
        most = robot.passing(ABOUT_NORMAL) / TURN_GAIN
        return self._attitude.rate(
            error * min(1.0, most / max(float(np.linalg.norm(error)), 1e-12)), np.zeros(3), dt,
            min(TURN_ACCELERATION, TURNING * robot.turning()))
