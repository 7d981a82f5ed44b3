"""Interruption of a goal: its cause, and the conditions under which it ends."""

from dataclasses import dataclass

from tactile_servo.following import Driven
from tactile_servo.phases import Phase, TRACKING
from tactile_servo.reasons import Reason, ReasonCode

# Time within which a hold ends by itself when its cause goes away [s]; people near the robot still
# remember that it moved. After a longer one the pad lifts off and the robot waits to be asked.
RESUME_WITHIN = 0.5
# Causes after which the robot continues only when asked: whoever caused the hold must know that
# the robot will move.
BINDING = frozenset({ReasonCode.PAUSED, ReasonCode.NOT_FOLLOWING, ReasonCode.CONTROLLER_INACTIVE,
                     ReasonCode.SEVERAL_PUBLISHERS, ReasonCode.CLOCK_STOPPED})


@dataclass
class Hold:
    """
    Cause of a hold, and conditions of its end.

    Once the hold is `bound`, later problems do not change its cause, except if the robot was
    moved. Methods that return a `Reason | None` are guards of `goal_run.RULES`.
    """

    after: Phase  # in which the goal continues; only TRACK needs an observation of the edge
    cause: Reason
    began: float  # steady time [s]
    of_law: bool = False  # the law requested it
    bound: bool = False  # it ends only when asked
    asked: bool = False  # somebody has asked to continue
    well_since: float | None = None  # steady time [s], None while there is a problem

    def worsen(self, why: Reason, elsewhere: bool) -> None:
        """Process a problem, and whether the robot may have been moved (`elsewhere`)."""
        self.asked = False
        if not self.bound:
            self.cause, self.bound = why, elsewhere or why.code in BINDING

    def see(self, well: bool, now: float) -> None:
        """Update `well_since`: whether there is no problem at a steady time [s]."""
        if not well:
            self.well_since = None
        elif self.well_since is None:
            self.well_since = now

    def check_place(self, robot: Driven) -> None:
        """Bind the hold if the robot, which is at rest, is not where it was sent."""
        if robot.astray:
            self.bound, self.cause = True, Reason(
                ReasonCode.NOT_FOLLOWING, f'it is {1e3 * robot.off:.1f} mm from where it was sent')

    def binds(self, robot: Driven) -> Reason | None:
        """Return the cause if the hold ends only when asked, also as the robot was moved."""
        self.check_place(robot)
        return self.cause if self.bound else None

    def presses_long(self, why: Reason | None, now: float) -> bool:
        """Return whether the pad is pressed in a long hold; `why` the robot must not move."""
        bound = self.bound or (why is not None and why.code in BINDING)
        return self.after in TRACKING and not bound and now - self.began > RESUME_WITHIN

    def ends_soon(self) -> bool:
        """Return whether its cause went away so soon that the robot may continue unasked."""
        return self.well_since is not None and self.well_since - self.began <= RESUME_WITHIN
