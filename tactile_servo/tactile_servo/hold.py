"""A hold: its cause, and whether it may end by itself."""

from dataclasses import dataclass

from tactile_servo.phases import Phase
from tactile_servo.reasons import Reason, ReasonCode

# Causes after which the robot continues only when asked: whoever caused the hold must know that
# the robot will move.
BINDING = frozenset({ReasonCode.PAUSED, ReasonCode.NOT_FOLLOWING, ReasonCode.CONTROLLER_INACTIVE,
                     ReasonCode.SEVERAL_PUBLISHERS, ReasonCode.CLOCK_STOPPED})


@dataclass
class Hold:
    """
    Cause of a hold, and conditions of its end.

    Once the hold is `bound`, later problems do not change its cause, except `stray`.
    """

    after: Phase  # in which the goal continues
    cause: Reason
    began: float  # steady time [s]
    blind: bool = False  # it interrupted a search, which needs no observation of the edge
    of_law: bool = False  # the law requested it
    bound: bool = False  # it ends only when asked
    asked: bool = False  # somebody has asked to continue
    well_since: float | None = None  # steady time [s], None while there is a problem

    def worsen(self, why: Reason, elsewhere: bool) -> None:
        """Process a problem, and whether the robot may have been moved (`elsewhere`)."""
        self.asked = False
        if not self.bound:
            self.cause, self.bound = why, elsewhere or why.code in BINDING

    def stray(self, off: float) -> None:
        """Bind the hold because the robot is at a distance [m] from its commanded pose."""
        self.bound, self.cause = True, Reason(
            ReasonCode.NOT_FOLLOWING, f'it is {1e3 * off:.1f} mm from where it was sent')

    def see(self, well: bool, now: float) -> None:
        """Update `well_since`: whether there is no problem at a steady time [s]."""
        if not well:
            self.well_since = None
        elif self.well_since is None:
            self.well_since = now
