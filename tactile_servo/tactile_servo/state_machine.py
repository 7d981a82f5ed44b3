"""The phases of a servo and every change between them that there is."""

from enum import auto, Enum

from tactile_common.errors import TactileError
from tactile_servo.reasons import Reason, ReasonCode
from tactile_servo.types import State


class Phase(Enum):
    """What a servo does. A hold has three phases, and the end of a goal is a hold as well."""

    IDLE = auto()
    APPROACH = auto()
    TEST = auto()  # approach: the pad has touched, and is pressed and released once
    TRACK = auto()
    CORNER = auto()
    SEARCH = auto()
    RETREAT = auto()
    SETTLING = auto()  # hold: the last command is played out
    WAITING = auto()  # hold: the robot stands, and goes on by itself if all is well soon
    ASKED = auto()  # hold: the robot stands, and goes on only when asked
    UNLOADING = auto()  # hold: the pad lifts off, to wait there
    STOPPING = auto()  # the goal ends where the pad is: the last command is played out
    DONE = auto()

    @property
    def state(self) -> State:
        """State that messages tell."""
        return _STATES[self]


class Event(Enum):
    """What changes the phase of a servo, or the reason of it."""

    START = auto()  # a goal is accepted
    TEST = auto()  # the approach has touched, and the sensor is to be tested
    TOUCH = auto()  # what is to be tracked has been met
    TRACK = auto()  # the law tracks,
    CORNER = auto()  # is at a corner,
    SEARCH = auto()  # or searches
    HOLD = auto()  # something is wrong
    STAND = auto()  # the robot stands
    BIND = auto()  # who caused the hold must know that the robot will move
    UNLOAD = auto()  # the hold lasts: lift the pad off meanwhile
    RESUME = auto()  # go on, with one of the next three
    APPROACH_AGAIN = auto()
    TRACK_AGAIN = auto()
    RETREAT_AGAIN = auto()
    END = auto()  # the goal ends: LIFT where it asks for that, else STOP
    LIFT = auto()  # the goal ends: lift off where that is possible, else STOP
    STOP = auto()  # the goal ends where the pad is
    REST = auto()  # the robot stands at the end of a goal
    FINISH = auto()  # the result has been taken
    REPORT = auto()  # only the reason is another


HELD = frozenset({Phase.SETTLING, Phase.WAITING, Phase.ASKED, Phase.UNLOADING})
STANDING = frozenset({Phase.WAITING, Phase.ASKED})
TRACKING = frozenset({Phase.TRACK, Phase.CORNER, Phase.SEARCH})  # the law moves the sensor
APPROACHING = frozenset({Phase.APPROACH, Phase.TEST})
TOUCHING = TRACKING | APPROACHING
MOVING = TOUCHING | {Phase.RETREAT}
LIFTING = frozenset({Phase.RETREAT, Phase.UNLOADING})  # off what is touched, by the pose alone
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
# What takes up again what a hold interrupted; the law says anew whether it is at a corner.
RESUMPTION = {Phase.APPROACH: Event.APPROACH_AGAIN, Phase.TEST: Event.APPROACH_AGAIN,
              Phase.TRACK: Event.TRACK_AGAIN, Phase.CORNER: Event.TRACK_AGAIN,
              Phase.SEARCH: Event.TRACK_AGAIN, Phase.RETREAT: Event.RETREAT_AGAIN}


class IllegalTransition(TactileError):
    """An event that a phase does not know: a fault of the program, not of its input."""


class StateMachine:
    """Phase of a servo, the reason of it, and since when (steady time [s])."""

    def __init__(self) -> None:
        self.phase, self.reason = Phase.IDLE, Reason(ReasonCode.WAITING)
        self.since = float('-inf')

    @property
    def active(self) -> bool:
        """Whether a goal is being worked on."""
        return self.phase not in (Phase.IDLE, Phase.DONE)

    def fire(self, event: Event, reason: Reason, now: float) -> None:
        """Change the phase by the table; IllegalTransition if it knows no such event."""
        following = TRANSITIONS[self.phase].get(event)
        if following is None:
            raise IllegalTransition(f'{event.name} while {self.phase.name}')
        if following is not self.phase:
            self.since = now
        self.phase, self.reason = following, reason
