"""Test of a sensor after the touch: press and release must change the force as predicted."""

from collections.abc import Callable
import math

import numpy as np

from tactile_servo.config import PRESS_DEPTH
from tactile_servo.control.force_controller import BRAKING

PRESSED = 0.6  # share of the goal's force to press with: it is enough to see the whole edge
SURPLUS = 0.1  # share of the goal's force to aim at in addition, or PRESSED is barely reached
RELEASED = 0.5  # share of the test's force that is released again
TOUCHING = 0.2  # share of the test's force; with less the pad may have lost contact
SURE = 3.0  # standard deviations of the measured slope that the decision allows for
LASTING = 0.4  # s, duration of release and return
RELIEVING = 0.05  # s, time constant of the relief before a later test
IMAGES = 30  # least number of images in that time, of a slow sensor
UNLIKE = 3.0  # factor between measured and predicted change of the force above which it fails
UNLIKE_FIRST = 1.15  # factor between the changes in this and in the first test


class PressTest:
    """
    Presses the pad, releases it for a short time, and returns to the previous depth.

    The depth computed from the force is a function of the depth measured by the robot, which must
    have the slope 1. `pressed` is True once the pad was pressed with the force of the test, at the
    latest at the distance `deepest` from the touch.

    With the slope `first` of a test that proved the sensor, a later test must prove it too. It
    relieves the pad first, because a skin with hysteresis gives the same slope only if the load
    comes from below; it moves off no faster than `lift` [m/s]. The test takes longer with a lower
    `rate` of images [Hz].
    """

    def __init__(self, force: float, load: float, depth: Callable[[float], float],
                 first: float = math.nan, rate: float = math.inf, lift: float = math.inf):
        self._depth, self._first, again = depth, first, not math.isnan(first)
        self._lift = lift
        self._lasting = max(LASTING, IMAGES / rate)
        self._least = PRESSED * force if again else max(PRESSED * force, load)
        self._aim, self._low = self._least + SURPLUS * force, (1.0 - RELEASED) * self._least
        self._expected = max(depth(self._least) - depth(load), 0.0)
        # How far the pad may be relieved before it presses [m]
        self._relief = UNLIKE * max(depth(load) - depth(self._low), 0.0) if again else 0.0
        self.pressed, self._release, self._lasted = False, 0.0, 0.0
        self.slope = math.nan  # measured change of the force, as a share of the predicted one
        self._way: dict[int, tuple[float, float]] = {}  # advance and load, by stamp

    @property
    def over(self) -> bool:
        """Whether the pad has returned."""
        return self._lasted >= self._lasting

    def deepest(self, saturated: bool) -> float:
        """
        Return how far from the touch the pad may go to be pressed [m].

        It may have touched the end of an edge, where it would meet little force for long. While
        tactels are saturated, the force is larger than the load, and the stiffness is trusted.
        """
        return min((1.0 if saturated else UNLIKE) * self._expected, PRESS_DEPTH)

    def see(self, stamp_ns: int, load: float, advance: float) -> None:
        """Process a load [N], its stamp [ns], and the advance of the pad then [m] or NaN."""
        if load <= self._low:
            self._relief = 0.0
        if self._relief <= 0.0 and not self.pressed and load >= self._least:
            self.pressed = True
            self._release = self._depth(self._least) - self._depth(self._low)
        if self.pressed and math.isfinite(advance):
            self._way[stamp_ns] = advance, load

    def speed(self, load: float, dt: float) -> float:
        """Compute the speed along the normal [m/s] for the next cycle, of `dt` [s]."""
        if self._relief > 0.0:
            surplus = self._depth(load) - self._depth(TOUCHING * self._least)
            speed = min(max(surplus, 0.0) / RELIEVING, self._lift)
            self._relief -= speed * dt
            return -speed
        if not self.pressed:
            missing = max(self._depth(self._aim) - self._depth(load), 0.0)
            return math.sqrt(2.0 * BRAKING * missing)
        self._lasted += dt
        if self.over:
            return 0.0
        # Smooth release and return: the displacement is (1 - cos) / 2 of the release.
        turn = 2.0 * math.pi / self._lasting
        return -0.5 * self._release * turn * math.sin(turn * self._lasted)

    def problem(self) -> str:
        """Return what contradicts the stiffness, or the first test; '' if nothing does."""
        # Depths are computed only now: pressing may have brought more of the edge under the pad.
        begin = min(self._way, default=0)  # stamps of a burst differ by less than a float shows
        way = np.array([(1e-9 * (stamp - begin), advance, self._depth(load))
                        for stamp, (advance, load) in sorted(self._way.items())
                        if load > TOUCHING * self._least])
        if len(way) < 7:
            return 'it was felt too briefly, or with stamps apart from those of joint states'
        time, actual, shown = (way - way.mean(axis=0)).T
        # Late stamps delay the force, a skin with hysteresis holds it, and one that creeps drifts.
        speed = np.gradient(actual, time)
        known = np.column_stack([actual, speed, np.sign(speed), time])
        known -= known.mean(axis=0)
        square = known.T @ known
        if np.linalg.matrix_rank(known) < len(square):
            return 'the pad was not seen to be released'
        answer = np.linalg.solve(square, known.T @ shown)
        self.slope, left = float(answer[0]), shown - known @ answer
        variance = float(left @ left) / (len(way) - 5) * np.linalg.inv(square)[0, 0]
        slope, doubt = self.slope, SURE * math.sqrt(variance)
        changes = f'the force changes by {slope:.2g} of what the stiffness says'
        first = self._first
        if math.isnan(first):
            right = slope + doubt >= 1.0 / UNLIKE and slope - doubt <= UNLIKE
            return '' if right else changes
        sure = first / UNLIKE_FIRST < slope - doubt and slope + doubt < first * UNLIKE_FIRST
        return '' if sure else f'{changes}, {first:.2g} at first'
