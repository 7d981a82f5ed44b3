"""Capability of a robot's joints, for planning the motion of its sensor."""

import math
from typing import NamedTuple, Protocol

import numpy as np


class Pace(NamedTuple):
    """Speed and acceleration that a robot's joints allow along a path."""

    speed: float = math.inf  # m/s for a direction per metre, rad/s for a turn per radian
    acceleration: float = math.inf  # m/s^2 or rad/s^2
    bound: str = ''  # limit that bounds the speed, for instance 'position of joint1'


class Agility(Protocol):
    """Capability of the joints at the commanded configuration."""

    def across(self) -> float:
        """Return the acceleration across the sensor's normal that all joints allow [m/s^2]."""
        ...

    def along(self, way: np.ndarray, speed: float = 0.0, bending: float = 1.0) -> Pace:
        """Return the pace along a twist (6,) of the sensor per unit of path; `Motion.along`."""
        ...
