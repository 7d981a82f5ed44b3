"""Phases of a goal, in more detail than the published states, and what is known of a hold."""

from dataclasses import dataclass
from enum import auto, Enum

from tactile_servo.reasons import Reason, ReasonCode
from tactile_servo.types import State


class Phase(Enum):
    """Activity of a servo with a goal. A hold has four phases."""

    APPROACH = auto()
    TEST = auto()  # approach: after the touch, the pad presses and releases once
    TRACK = auto()
    HALT = auto()  # track: the pad stops, to be tested again
    CORNER = auto()
    SEARCH = auto()
    RETREAT = auto()
    SETTLING = auto()  # hold: the robot executes its last command
    WAITING = auto()  # hold: the robot is at rest, and continues by itself if the cause ends soon
    ASKED = auto()  # hold: the robot is at rest, and continues only when asked
    UNLOADING = auto()  # hold: the pad lifts off and then waits
    STOPPING = auto()  # the goal ends where the pad is; the robot executes its last command
    DONE = auto()

    @property
    def state(self) -> State:
        """State that is published."""
        return _STATES[self]


HELD = frozenset({Phase.SETTLING, Phase.WAITING, Phase.ASKED, Phase.UNLOADING})
STANDING = frozenset({Phase.WAITING, Phase.ASKED})
# The law moves the sensor.
TRACKING = frozenset({Phase.TRACK, Phase.HALT, Phase.CORNER, Phase.SEARCH})
APPROACHING = frozenset({Phase.APPROACH, Phase.TEST})
TOUCHING = TRACKING | APPROACHING
MOVING = TOUCHING | {Phase.RETREAT}
LIFTING = frozenset({Phase.RETREAT, Phase.UNLOADING})  # these need only the pose, no image
_STATES = {phase: State.HOLD if phase in HELD | {Phase.STOPPING} else
           State.APPROACH if phase is Phase.TEST else State.TRACK if phase is Phase.HALT
           else State[phase.name] for phase in Phase}

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
