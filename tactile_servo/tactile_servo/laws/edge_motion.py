"""Motion of a pad along an edge: speed and way in its plane, force along its normal, turn."""

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
BLIND = 0.05  # to which the pad can slow down where it sees no further
ENTRY = 0.03  # at which a second leg may come under it: its load comes at once
SEARCH = 0.02  # of a search for an edge that is lost
NORMAL = 0.05  # largest along the normal
# Of the acceleration in the plane, for which turns are planned: the rest is for corrections
AGILE = 0.8
SHORTEST = 0.5  # of the pad's half size, the edge that the force is spread over at the least


def missing_depth(force: float, load: Load, *, half: float, length: float, pressed: float,
                  skin_stiffness: float) -> float:
    """
    How much deeper in the edge a pad should be [m].

    The line force of the image and the way of the pad since give the line force now; with the
    length that is under the pad in a moment, it gives the indentation that is missing.

    Parameters
    ----------
    force, load : float, Load
        Wanted [N], and that of the newest image.
    half, length : float
        Half the pad's smaller size, and length of the edge under the pad in a moment [m].
    pressed : float
        How much deeper in the edge the pad is than as the image was taken [m].
    skin_stiffness : float
        Line force per length and indentation [N/m^2].
    """
    shortest = SHORTEST * half
    predicted = load.force / max(load.length, shortest) + skin_stiffness * pressed
    # A share of what is to come is given way to before: as much too little first as it is too
    # much then.
    wanted = force / (max(length, shortest) + 0.35 * load.coming)
    return (wanted - max(predicted, 0.0)) / skin_stiffness


class EdgeMotion:
    """Controllers of a pad at an edge, and what they ask for."""

    def __init__(self, config: EdgeFollowingConfig, goal: EdgeGoal, sight: EdgeSight):
        self.config, self.goal, self.sight = config, goal, sight
        self._speed, self._path = SpeedController(), PathController(config.path.lateral_gain)
        self._force = ForceController(
            ForceGains(config.force.gain, integral=60.0, press=NORMAL, lift=NORMAL))
        self._attitude = AttitudeController(AttitudeGains(
            gain=5.0, max_rate=1.5, acceleration=config.attitude.acceleration))

    def retune(self, config: EdgeFollowingConfig) -> None:
        """Take other gains from now on."""
        self.config, self._path.gain = config, config.path.lateral_gain
        self._force.gains = replace(self._force.gains, gain=config.force.gain)

    def reset(self) -> None:
        """Stand still."""
        for controller in (self._speed, self._path, self._force, self._attitude):
            controller.reset()

    @property
    def speed(self) -> float:
        """Along the edge [m/s]."""
        return self._speed.speed

    def soon(self) -> tuple[float, float]:
        """Way x, y [m] until an error of the force is made up."""
        x, y = self._path.velocity
        return x / self.config.force.gain, y / self.config.force.gain

    def along(self, stand: Stand, agility: Agility, dt: float, *,
              may_lift: bool = False) -> tuple[float, float]:
        """Velocity x, y along the path and back to it [m/s]; `may_lift`: it need not press."""
        edge, load, goal = self.sight.edge, self.sight.load, self.goal
        scale, pressed = edge.scale, load.force / goal.force
        # A second leg that comes under the pad adds its load at once: give way first.
        share = min(load.coming / min(scale.half_x, scale.half_y), 1.0)
        top = goal.speed - max(goal.speed - ENTRY, 0.0) * share
        # Within a tenth of a grain it is on the path, half a grain further it stands.
        off = (math.hypot(*stand.aside) / scale.grain - 0.1) / 0.5
        top *= caution(max(pressed, 1.0) if may_lift else pressed, off)
        top = min(top, AGILE * NORMAL / max(abs(self.sight.slope), 1e-9))  # up or down
        most = min(self.config.speed.acceleration, agility.across())
        top = edge.speed_limit(stand.ahead, top, AGILE * most,
                               BLIND if edge.path.end is PathEnd.VIEW else top,
                               self.config.path.corner_cut, settle=3e-4)  # for the lag
        speed = self._speed.change(top, AGILE * most * dt, math.inf)
        x, y = edge.way(stand.ahead, stand.ahead + 0.2 * scale.grain + speed * dt)
        return self._path.follow((speed * x, speed * y), stand.aside, most, dt)

    def touch_speed(self, left: float) -> float:
        """Speed along the normal [m/s] at which a touch is seen in time, and a way [m] ends."""
        seen = touch_speed(self.goal.force, self.config.force.stiffness, self.sight.age)
        # With half of the braking: commands are played on before they brake.
        return min(NORMAL, seen, math.sqrt(self._force.gains.braking * left))

    def aside(self, x: float, y: float, dt: float) -> tuple[float, float]:
        """Velocity x, y [m/s] towards a wanted one, off the path."""
        self._speed.speed = math.hypot(x, y)
        return self._path.change(x, y, self.config.speed.acceleration * dt)

    def depth(self, force: float) -> float:
        """Indentation [m] that a force [N] stands for, on the length that is under the pad."""
        scale = self.sight.edge.scale
        length = max(self.sight.load.length, SHORTEST * min(scale.half_x, scale.half_y))
        return force / (self.config.force.skin_stiffness * length)

    def press(self, stand: Stand, dt: float, *, may_press: bool = True) -> float:
        """Velocity along the normal that keeps the force [m/s]."""
        sight, goal, c = self.sight, self.goal, self.config.force
        load, scale, depth = sight.load, sight.edge.scale, stand.there.item(2, 3)
        missing = missing_depth(
            goal.force, load, half=min(scale.half_x, scale.half_y), length=stand.length,
            pressed=depth - sight.height - sight.slope * (stand.ahead - sight.station),
            skin_stiffness=c.skin_stiffness)
        off = goal.force - load.force
        give = self._force.speed(
            missing, off / c.stiffness if abs(off) < INTEGRATED * goal.force else None, dt,
            # There is not much time, and what was moved since the image is known.
            haste=5.0 if load.coming > 0.0 and missing < 0.0 else 1.0,
            # What touches, and is no edge, is no reason to press.
            may_press=may_press and sight.problem is None)
        return clipped(give + sight.slope * self.speed, -NORMAL, NORMAL)

    def turn(self, stand: Stand, dt: float) -> np.ndarray:
        """Angular velocity (3,) along the edge and square to it [rad/s]."""
        return self._attitude.rate(
            off_edge(stand.there, stand.way, self.sight.slope, self.goal.direction,
                     self.config.attitude.max_turn), np.zeros(3), dt)
