"""Phases of a servo, and all transitions between them."""

from enum import auto, Enum

from tactile_common.errors import TactileError
from tactile_servo.reasons import Reason, ReasonCode
from tactile_servo.types import State


class Phase(Enum):
    """Activity of a servo. A hold has four phases; STOPPING also counts as the state HOLD."""

    IDLE = auto()
    APPROACH = auto()
    TEST = auto()  # approach: after the touch, the pad presses and releases once
    TRACK = auto()
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


class Event(Enum):
    """Event that changes the phase of a servo, or only its reason."""

    START = auto()  # a goal is accepted
    TEST = auto()  # the pad has touched, and the sensor is to be tested
    TOUCH = auto()  # the pad touches what it is to track
    TRACK = auto()  # the law tracks
    CORNER = auto()  # the law is at a corner
    SEARCH = auto()  # the law searches
    HOLD = auto()  # there is a problem; or unloading has ended
    STAND = auto()  # the robot is at rest
    BIND = auto()  # from now on the hold ends only when asked
    UNLOAD = auto()  # the hold lasts long: lift the pad off during it
    RESUME = auto()  # continue, with one of the next three events
    APPROACH_AGAIN = auto()
    TRACK_AGAIN = auto()
    RETREAT_AGAIN = auto()
    END = auto()  # the goal ends: LIFT if the goal asks for it, else STOP
    LIFT = auto()  # the goal ends: lift off if that is possible, else STOP
    STOP = auto()  # the goal ends where the pad is
    REST = auto()  # the robot is at rest at the end of a goal
    FINISH = auto()  # the result has been read
    REPORT = auto()  # only the reason changes


HELD = frozenset({Phase.SETTLING, Phase.WAITING, Phase.ASKED, Phase.UNLOADING})
STANDING = frozenset({Phase.WAITING, Phase.ASKED})
TRACKING = frozenset({Phase.TRACK, Phase.CORNER, Phase.SEARCH})  # the law moves the sensor
APPROACHING = frozenset({Phase.APPROACH, Phase.TEST})
TOUCHING = TRACKING | APPROACHING
MOVING = TOUCHING | {Phase.RETREAT}
LIFTING = frozenset({Phase.RETREAT, Phase.UNLOADING})  # these need only the pose, no image
_STATES = {phase: State.HOLD if phase in HELD | {Phase.STOPPING} else
           State.APPROACH if phase is Phase.TEST else State[phase.name] for phase in Phase}

_TRACKING = {Event.TRACK: Phase.TRACK, Event.CORNER: Phase.CORNER, Event.SEARCH: Phase.SEARCH,
             Event.HOLD: Phase.SETTLING, Event.LIFT: Phase.RETREAT, Event.STOP: Phase.STOPPING}
_APPROACHING = {Event.TOUCH: Phase.TRACK, Event.HOLD: Phase.SETTLING, Event.LIFT: Phase.RETREAT,
                Event.STOP: Phase.STOPPING}
_STANDING = {Event.APPROACH_AGAIN: Phase.APPROACH, Event.TRACK_AGAIN: Phase.TRACK,
             Event.RETREAT_AGAIN: Phase.RETREAT, Event.STOP: Phase.STOPPING}
TRANSITIONS: dict[Phase, dict[Event, Phase]] = {
    Phase.IDLE: {Event.START: Phase.APPROACH, Event.REPORT: Phase.IDLE},
    Phase.APPROACH: {Event.TEST: Phase.TEST, **_APPROACHING}, Phase.TEST: _APPROACHING,
    Phase.TRACK: _TRACKING, Phase.CORNER: _TRACKING, Phase.SEARCH: _TRACKING,
    Phase.RETREAT: {Event.HOLD: Phase.SETTLING, Event.STOP: Phase.STOPPING,
                    Event.REST: Phase.DONE},
    Phase.SETTLING: {Event.HOLD: Phase.SETTLING, Event.REPORT: Phase.SETTLING,
                     Event.STAND: Phase.WAITING, Event.STOP: Phase.STOPPING},
    Phase.WAITING: {Event.HOLD: Phase.WAITING, Event.REPORT: Phase.WAITING,
                    Event.BIND: Phase.ASKED, Event.UNLOAD: Phase.UNLOADING,
                    Event.LIFT: Phase.RETREAT, **_STANDING},
    Phase.ASKED: {Event.HOLD: Phase.ASKED, Event.REPORT: Phase.ASKED, **_STANDING},
    Phase.UNLOADING: {Event.HOLD: Phase.SETTLING, Event.STOP: Phase.STOPPING},
    Phase.STOPPING: {Event.STOP: Phase.STOPPING, Event.REST: Phase.DONE},
    Phase.DONE: {Event.FINISH: Phase.IDLE},
}
# Event that continues the phase which a hold interrupted; the law detects a corner again.
RESUMPTION = {Phase.APPROACH: Event.APPROACH_AGAIN, Phase.TEST: Event.APPROACH_AGAIN,
              Phase.TRACK: Event.TRACK_AGAIN, Phase.CORNER: Event.TRACK_AGAIN,
              Phase.SEARCH: Event.TRACK_AGAIN, Phase.RETREAT: Event.RETREAT_AGAIN}


class IllegalTransition(TactileError):
    """An event that is not allowed in the phase: a bug of the program, not a bad input."""


class StateMachine:
    """Phase of a servo, its reason, and the steady time of the last change of phase [s]."""

    def __init__(self) -> None:
        self.phase, self.reason = Phase.IDLE, Reason(ReasonCode.WAITING)
        self.since = float('-inf')

    @property
    def active(self) -> bool:
        """Whether a goal is active."""
        return self.phase not in (Phase.IDLE, Phase.DONE)

    def fire(self, event: Event, reason: Reason, now: float) -> None:
        """Change the phase by TRANSITIONS; IllegalTransition if the event is not allowed."""
        following = TRANSITIONS[self.phase].get(event)
        if following is None:
            raise IllegalTransition(f'{event.name} while {self.phase.name}')
        if following is not self.phase:
            self.since = now
        self.phase, self.reason = following, reason
