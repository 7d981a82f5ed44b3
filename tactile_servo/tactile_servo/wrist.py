"""Force at the robot's wrist: a second measurement, which checks the force of the pad."""

import math

import numpy as np

from tactile_servo.control.press_check import most_unfelt
from tactile_servo.reasons import Reason, ReasonCode

REST_WEIGHT = 0.02  # weight of the newest force in the running mean at rest
DISAGREEING = 0.1  # s for which pad and wrist may differ: they are filtered differently


class Wrist:
    """
    Force at the wrist relative to its value while the pad was free and no goal was active [N].

    This baseline includes the weight of the tool. If the tool is rotated much, its weight must be
    compensated.
    """

    def __init__(self) -> None:
        self.force, self._rest = 0.0, np.full(3, np.nan)
        self._arrival, self._agreed = math.nan, math.inf

    def see(self, force: np.ndarray, arrival: float, at_rest: bool) -> None:
        """Process a force (3,) [N] and its steady arrival time [s]; ignore one not finite."""
        if not np.isfinite(force).all():
            return
        if not self.heard:
            self._rest = force.copy()
        elif at_rest:
            self._rest += REST_WEIGHT * (force - self._rest)
        self._arrival, self.force = arrival, float(np.linalg.norm(force - self._rest))

    def judge(self, load: float, now: float) -> None:
        """Compare with the load on the pad [N] at a steady time [s]."""
        most = most_unfelt(max(self.force, load))
        if not self.heard or abs(self.force - load) <= most:
            self._agreed = now

    @property
    def heard(self) -> bool:
        """Whether any force has been received."""
        return not math.isnan(self._arrival)

    def missing(self, now: float, within: float) -> bool:
        """Return whether the wrist sent forces before, but none within a time [s]."""
        return now - self._arrival > within  # false without a wrist: NaN

    def problem(self, load: float, now: float) -> Reason | None:
        """Return why the pad cannot be trusted, or None."""
        if now - self._agreed <= DISAGREEING:
            return None
        return Reason(ReasonCode.SENSOR_DISAGREES,
                      f'{load:.1f} N on the pad, {self.force:.1f} N at the wrist')
