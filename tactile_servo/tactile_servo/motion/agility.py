"""What the joints of a robot can, told to what plans the motion of its sensor."""
import math
from typing import NamedTuple, Protocol

import numpy as np

from tactile_common.kernels import njit
from tactile_servo.motion.limits import ACCELERATION, POSITION, room, VELOCITY

WITHIN = 0.8  # of a joint's velocity, which a way may take: corrections need some too


class Pace(NamedTuple):
    """How fast a robot's joints can follow a way, and how soon they can be faster or slower."""

    speed: float = math.inf  # per unit of the way: m/s of one in metres, rad/s of a turn
    acceleration: float = math.inf  # likewise, per second
    bound: str = ''  # limit that bounds the speed, for instance 'position of joint1'


class Agility(Protocol):
    """What the joints can where the robot is commanded to be."""

    def across(self) -> float:
        """Acceleration of the sensor across its normal that all joints allow [m/s^2]."""
        ...

    def along(self, way: np.ndarray, speed: float = 0.0, bending: float = 1.0) -> Pace:
        """Pace on a way, which is a twist (6,) of the sensor per unit, see `Motion.along`."""
        ...


class Unbounded:
    """Agility of a robot of which nothing is known."""

    def across(self) -> float:
        """Any acceleration."""
        return math.inf

    def along(self, way: np.ndarray, speed: float = 0.0, bending: float = 1.0) -> Pace:
        """Any pace."""
        return Pace()


UNBOUNDED = Unbounded()


@njit(cache=True)
def pace(lower, upper, fastest, acceleration, stopping_time, positions, rates, bend, speed,
         bending, horizon):
    """
    Law of `Motion.along`: speed, acceleration, index of the kind of limit and of the joint.

    Of joints that move by `rates` (n,) per unit of a way, which change by `bend` (n,) per unit:
    at a speed v their velocities are rates v, and their accelerations rates dv/dt + bend v^2.
    """
    down, up = room(lower, upper, stopping_time, positions, horizon)
    top, most, kind, joint = np.inf, np.inf, VELOCITY, 0
    for k in range(len(rates)):
        rate, change = max(abs(rates[k]), 1e-12), max(abs(bend[k]), 1e-12)
        left = up[k] if rates[k] > 0.0 else -down[k]
        bent = math.sqrt(bending * acceleration[k] / change)
        for one, of in ((WITHIN * fastest[k] / rate, VELOCITY), (left / rate, POSITION),
                        (bent, ACCELERATION)):
            if one < top:
                top, kind, joint = one, of, k
        most = min(most, (acceleration[k] - change * speed * speed) / rate)
    return top, max(most, 0.0), kind, joint
