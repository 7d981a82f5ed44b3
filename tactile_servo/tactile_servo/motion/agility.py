"""What the joints of a robot can, for those who plan the motion of its sensor."""

import math
from typing import NamedTuple, Protocol

import numpy as np


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
