"""A hold: what it is about, and whether it ends by itself or only when asked."""

from dataclasses import dataclass

import numpy as np

from tactile_servo.reasons import Reason, ReasonCode
from tactile_servo.state_machine import Event

# What goes on only when asked: who caused it must know that the robot will move.
ASKED = frozenset({ReasonCode.PAUSED, ReasonCode.NOT_FOLLOWING, ReasonCode.CONTROLLER_INACTIVE,
                   ReasonCode.SEVERAL_PUBLISHERS, ReasonCode.CLOCK_STOPPED})


@dataclass
class Hold:
    """
    What a hold is about.

    One that is `bound` ends only when it is `asked` for, any other by itself as well, if what is
    wrong is well again within `resume_within` [s].
    """

    paused: bool = False  # it was asked for
    lost: Reason | None = None  # what the law said, if it is the law's
    searching: bool = False  # it interrupted a search, which need not see what is tracked
    resumption: Event = Event.RESUME_APPROACH  # what takes up again what it interrupted
    cause: Reason = Reason(ReasonCode.NONE)  # what is wrong
    began: float = -np.inf  # steady time at which it went wrong [s],
    back: float | None = None  # and at which it no longer was
    bound: bool = False
    asked: bool = False

    @property
    def strayed(self) -> bool:
        """Whether the robot does not go, or stand, where it was sent."""
        return self.cause.code is ReasonCode.NOT_FOLLOWING

    def worsen(self, why: Reason, now: float, resume_within: float) -> None:
        """Take what is wrong at a steady time [s]."""
        if not self.strayed:
            self.cause = why
        # A robot that was not heard of for so long may have come to be elsewhere.
        elsewhere = why.code is ReasonCode.STALE_JOINT_STATE and now - self.began > resume_within
        self.bound, self.asked = self.bound or elsewhere or why.code in ASKED, False

    def stray(self, off: float) -> None:
        """Take that the robot stands off where it was sent [m]."""
        self.bound, self.cause = True, Reason(
            ReasonCode.NOT_FOLLOWING, f'it stands {1e3 * off:.1f} mm from where it was sent')

    def see(self, back: bool, now: float) -> None:
        """Take whether all is well again at a steady time [s]."""
        self.back = None if not back else now if self.back is None else self.back

    def over(self, resume_within: float) -> bool:
        """Whether it may end."""
        in_time = self.back is not None and self.back - self.began <= resume_within
        return self.asked or (in_time and not self.bound)
