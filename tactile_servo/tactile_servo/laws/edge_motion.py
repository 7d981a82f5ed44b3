"""Motion of a pad along an edge: speed and path in the plane, force along the normal, turn."""

from dataclasses import replace
import math

import numpy as np

from tactile_servo.control.attitude_controller import (
    AttitudeController,
    AttitudeGains,
    off_edge,
)
from tactile_servo.control.force_controller import (
    ForceController,
    ForceGains,
    INTEGRATED,
    touch_speed,
)
from tactile_servo.control.path_controller import PathController
from tactile_servo.control.scaling import clipped
from tactile_servo.control.speed_controller import caution, SpeedController
from tactile_servo.edge_map.edge_map import Stand
from tactile_servo.edge_map.traced_path import PathEnd
from tactile_servo.laws.edge_config import EdgeFollowingConfig
from tactile_servo.laws.edge_sight import EdgeSight, Load
from tactile_servo.motion.agility import Agility
from tactile_servo.types import EdgeGoal

# Speeds [m/s]
BLIND = 0.05  # largest at the end of the visible path
ENTRY = 0.03  # at which the second leg of a corner may reach the pad: its load comes suddenly
SEARCH = 0.02  # in the search for a lost edge
NORMAL = 0.05  # largest along the normal
# Share of the acceleration in the plane that is planned; the rest is for corrections
AGILE = 0.8
CORNER_SETTLE = 3e-4  # m before and after a sharp corner that are passed at its speed, for the lag
# Grains
LOOK_AHEAD = 0.2  # length along the path over which its direction is measured
ON_PATH, ASTRAY = 0.1, 0.6  # distance from the path: full speed up to it, standstill from it on
# Force
SHORTEST = 0.5  # least edge length that carries the force, as a share of the pad's half size
COMING_SHARE = 0.35  # share of the coming edge's length for which the pad unloads in advance
HASTE = 5.0  # factor of the force gain while the pad unloads for a coming edge
INTEGRAL = 60.0  # integral gain of the force control [1/s^2]
# Turn along the edge
TURN_GAIN, TURN_RATE = 5.0, 1.5  # gain [1/s] and largest rate [rad/s]


def missing_depth(force: float, load: Load, *, half: float, length: float, pressed: float,
                  skin_stiffness: float) -> float:
    """
    Return the additional indentation that the wanted force needs [m].

    The present line force is predicted from that of the image and from the pad's motion since.
    The wanted line force is the wanted force over the edge length that will soon be under the pad.

    Parameters
    ----------
    force, load : float, Load
        Wanted force [N], and load of the newest image.
    half, length : float
        Half the pad's smaller size, and edge length that will soon be under the pad [m].
    pressed : float
        Increase of the indentation since the image was taken [m].
    skin_stiffness : float
        Line force per indentation [N/m^2].
    """
    shortest = SHORTEST * half
    predicted = load.force / max(load.length, shortest) + skin_stiffness * pressed
    # Unload in advance for a part of the coming edge: the force is then too low before it arrives
    # by as much as it is too high afterwards.
    wanted = force / (max(length, shortest) + COMING_SHARE * load.coming)
    return (wanted - max(predicted, 0.0)) / skin_stiffness


class EdgeMotion:
    """Controllers of a pad at an edge."""

    def __init__(self, config: EdgeFollowingConfig, goal: EdgeGoal, sight: EdgeSight):
        self.config, self.goal, self.sight = config, goal, sight
        self._speed, self._path = SpeedController(), PathController(config.path.lateral_gain)
        self._force = ForceController(
            ForceGains(config.force.gain, integral=INTEGRAL, press=NORMAL, lift=NORMAL))
        self._attitude = AttitudeController(AttitudeGains(
            gain=TURN_GAIN, max_rate=TURN_RATE, acceleration=config.attitude.acceleration))

    def retune(self, config: EdgeFollowingConfig) -> None:
        """Use new gains from now on."""
        self.config, self._path.gain = config, config.path.lateral_gain
        self._force.gains = replace(self._force.gains, gain=config.force.gain)

    def reset(self) -> None:
        """Reset all controllers to standstill."""
        for controller in (self._speed, self._path, self._force, self._attitude):
            controller.reset()

    @property
    def speed(self) -> float:
        """Speed along the edge [m/s]."""
        return self._speed.speed

    def soon(self) -> tuple[float, float]:
        """Return the displacement x, y [m] within the time constant of the force control."""
        x, y = self._path.velocity
        return x / self.config.force.gain, y / self.config.force.gain

    def along(self, stand: Stand, agility: Agility, dt: float, *,
              may_lift: bool = False) -> tuple[float, float]:
        """
        Return the velocity x, y along the path and back to it [m/s].

        With `may_lift`, a low force does not reduce the speed.
        """
        edge, load, goal = self.sight.edge, self.sight.load, self.goal
        scale, pressed = edge.scale, load.force / goal.force
        # A second leg that reaches the pad adds its load suddenly: slow down before.
        share = min(load.coming / min(scale.half_x, scale.half_y), 1.0)
        top = goal.speed - max(goal.speed - ENTRY, 0.0) * share
        off = (math.hypot(*stand.aside) / scale.grain - ON_PATH) / (ASTRAY - ON_PATH)
        top *= caution(max(pressed, 1.0) if may_lift else pressed, off)
        top = min(top, AGILE * NORMAL / max(abs(self.sight.slope), 1e-9))  # on a slope
        most = min(self.config.speed.acceleration, agility.across())
        top = edge.speed_limit(stand.ahead, top, AGILE * most,
                               BLIND if edge.path.end is PathEnd.VIEW else top,
                               self.config.path.corner_cut, settle=CORNER_SETTLE)
        speed = self._speed.change(top, AGILE * most * dt, math.inf)
        x, y = edge.way(stand.ahead, stand.ahead + LOOK_AHEAD * scale.grain + speed * dt)
        return self._path.follow((speed * x, speed * y), stand.aside, most, dt)

    def touch_speed(self, left: float) -> float:
        """Return the speed along the normal [m/s] that can stop at a touch or after `left` [m]."""
        seen = touch_speed(self.goal.force, self.config.force.stiffness, self.sight.age)
        # Plan half of the deceleration: commands already sent delay the braking.
        return min(NORMAL, seen, math.sqrt(self._force.gains.braking * left))

    def aside(self, x: float, y: float, dt: float) -> tuple[float, float]:
        """Change the velocity towards a wanted x, y that leaves the path; return it [m/s]."""
        self._speed.speed = math.hypot(x, y)
        return self._path.change(x, y, self.config.speed.acceleration * dt)

    def depth(self, force: float) -> float:
        """Return the indentation [m] for a force [N], with the edge length under the pad."""
        scale = self.sight.edge.scale
        length = max(self.sight.load.length, SHORTEST * min(scale.half_x, scale.half_y))
        return force / (self.config.force.skin_stiffness * length)

    def press(self, stand: Stand, dt: float, *, may_press: bool = True) -> float:
        """Return the velocity along the normal that keeps the force [m/s]."""
        sight, goal, c = self.sight, self.goal, self.config.force
        load, scale, depth = sight.load, sight.edge.scale, stand.there.item(2, 3)
        missing = missing_depth(
            goal.force, load, half=min(scale.half_x, scale.half_y), length=stand.length,
            pressed=depth - sight.height - sight.slope * (stand.ahead - sight.station),
            skin_stiffness=c.skin_stiffness)
        off = goal.force - load.force
        give = self._force.speed(
            missing, off / c.stiffness if abs(off) < INTEGRATED * goal.force else None, dt,
            # Unloading for a coming leg must be quick; the motion since the image is known.
            haste=HASTE if load.coming > 0.0 and missing < 0.0 else 1.0,
            # Do not press on contacts that are not the edge.
            may_press=may_press and sight.problem is None)
        return clipped(give + sight.slope * self.speed, -NORMAL, NORMAL)

    def turn(self, stand: Stand, dt: float) -> np.ndarray:
        """Return the angular velocity (3,) that aligns the pad with the edge [rad/s]."""
        return self._attitude.rate(
            off_edge(stand.there, stand.way, self.sight.slope, self.goal.direction,
                     self.config.attitude.max_turn), np.zeros(3), dt)
