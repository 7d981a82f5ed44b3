"""A hold: what it is about, and whether it may end by itself."""

from dataclasses import dataclass

from tactile_servo.reasons import Reason, ReasonCode
from tactile_servo.state_machine import Event

# What goes on only when asked: who caused it must know that the robot will move.
BINDING = frozenset({ReasonCode.PAUSED, ReasonCode.NOT_FOLLOWING, ReasonCode.CONTROLLER_INACTIVE,
                     ReasonCode.SEVERAL_PUBLISHERS, ReasonCode.CLOCK_STOPPED})


@dataclass
class Hold:
    """
    What a hold is about. Its phases are those of the state machine.

    A cause that binds stays the cause, whatever else goes wrong meanwhile.
    """

    resumption: Event  # what takes up again what it interrupted
    cause: Reason
    began: float  # steady time [s]
    blind: bool = False  # it interrupted a search, which need not see what is tracked
    of_law: bool = False  # the law asked for it
    bound: bool = False  # it ends only when asked
    asked: bool = False  # somebody asked
    well_since: float | None = None  # steady time [s], None while something is wrong

    def worsen(self, why: Reason, elsewhere: bool) -> None:
        """Take what is wrong, and whether the robot may have come to be elsewhere."""
        self.asked = False
        if not self.bound:
            self.cause, self.bound = why, elsewhere or why.code in BINDING

    def stray(self, off: float) -> None:
        """Take that the robot stands off where it was sent [m]."""
        self.bound, self.cause = True, Reason(
            ReasonCode.NOT_FOLLOWING, f'it stands {1e3 * off:.1f} mm from where it was sent')

    def see(self, well: bool, now: float) -> None:
        """Take whether all is well at a steady time [s]."""
        if not well:
            self.well_since = None
        elif self.well_since is None:
            self.well_since = now
