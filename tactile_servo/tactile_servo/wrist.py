"""Force at the robot's wrist: a second channel, that says whether the pad's is to be believed."""

import math

import numpy as np

from tactile_servo.control.press_check import most_unfelt
from tactile_servo.reasons import Reason, ReasonCode


class Wrist:
    """
    Force on the wrist beside what it was while the pad was free and no goal worked on [N].

    The weight of the tool is known from there, and must be compensated where the tool is turned
    much.
    """

    def __init__(self) -> None:
        self.force, self._rest = 0.0, np.full(3, np.nan)
        self._arrival, self._agreed = math.nan, math.inf

    def see(self, force: np.ndarray, arrival: float, at_rest: bool) -> None:
        """Take a force (3,) [N] and its steady arrival time [s]; one not finite is passed over."""
        if not np.isfinite(force).all():
            return
        if not self.heard:
            self._rest = force.copy()
        elif at_rest:
            self._rest += 0.02 * (force - self._rest)
        self._arrival, self.force = arrival, float(np.linalg.norm(force - self._rest))

    def judge(self, load: float, now: float) -> None:
        """Compare with the load that the pad tells [N], at a steady time [s]."""
        most = most_unfelt(max(self.force, load))
        if not self.heard or abs(self.force - load) <= most:
            self._agreed = now

    @property
    def heard(self) -> bool:
        """Whether there was any force."""
        return not math.isnan(self._arrival)

    def missing(self, now: float, within: float) -> bool:
        """Whether a wrist that was heard of is silent for so long [s]."""
        return now - self._arrival > within  # not of one that is not there: NaN

    def problem(self, load: float, now: float) -> Reason | None:
        """Why the pad is not to be believed, or None."""
        if now - self._agreed <= 0.1:  # they are filtered differently
            return None
        return Reason(ReasonCode.SENSOR_DISAGREES,
                      f'{load:.1f} N on the pad, {self.force:.1f} N at the wrist')
