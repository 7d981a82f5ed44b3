"""Whether a pad that has touched answers to being pressed and released as its stiffness says."""

from collections.abc import Callable
import math

import numpy as np

from tactile_servo.control.force_controller import ForceGains

PRESSED = 0.6  # of the force, to press with: all of an edge is seen then
LASTING = 0.4  # s of release and return
UNLIKE = 3.0  # times stiffer or softer than told, and the sensor is not believed


class PressTest:
    """
    A press of a pad, a short release, and the return to where it was.

    The depth that the force stands for, over the depth that the robot measures, has the slope 1.

    Attributes
    ----------
    pressed : bool
        Whether it has been pressed so far as it is to be.
    deepest : float
        Way from the touch at which that should have been so [m].
    """

    def __init__(self, force: float, load: float, depth: Callable[[float], float]):
        self._depth, self._least = depth, max(PRESSED * force, load)
        self._aim = self._least + 0.1 * force  # or it would hardly come to the least
        self.deepest = UNLIKE * (depth(self._least) - depth(load))
        self.pressed, self._release, self._lasted = False, 0.0, 0.0
        self._way: dict[int, tuple[float, float]] = {}  # by the stamp

    @property
    def over(self) -> bool:
        """Whether the pad has returned."""
        return self._lasted >= LASTING

    def see(self, stamp_ns: int, load: float, advance: float) -> None:
        """Take a load [N], its stamp [ns], and how far the pad had advanced then [m]."""
        if not self.pressed and load >= self._least:
            self.pressed = True
            self._release = self._depth(self._least) - self._depth(0.6 * self._least)
        if self.pressed:
            self._way[stamp_ns] = advance, load

    def speed(self, load: float, dt: float) -> float:
        """Speed along the normal [m/s] of the next cycle."""
        if not self.pressed:
            missing = max(self._depth(self._aim) - self._depth(load), 0.0)
            return math.sqrt(2.0 * ForceGains.braking * missing)
        self._lasted += dt
        if self.over:
            return 0.0
        # Up and down again without a jerk: (1 - cos) / 2 of the way.
        turn = 2.0 * math.pi / LASTING
        return -0.5 * self._release * turn * math.sin(turn * self._lasted)

    def problem(self) -> str:
        """What contradicts the stiffness, '' if nothing does."""
        # Depths as of now: more of an edge may have come under the pad as it was pressed.
        way = np.array([(advance, self._depth(load)) for advance, load in self._way.values()
                        if load > 0.2 * self._least])  # with less it may have come off
        if len(way) < 4:
            return 'it was not felt long enough'
        actual, told = (way - way.mean(axis=0)).T
        square = float(actual @ actual)
        if square == 0.0:
            return 'the pad was not seen to be released'
        slope = float(actual @ told) / square
        left = told - slope * actual
        doubt = 3.0 * math.sqrt(float(left @ left) / (len(way) - 2) / square)
        if slope + doubt < 1.0 / UNLIKE or slope - doubt > UNLIKE:
            return f'the force changes by {slope:.2g} of what the stiffness says'
        return ''
