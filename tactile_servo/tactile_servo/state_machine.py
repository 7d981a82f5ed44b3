"""The states of a servo and every change between them that there is."""

from enum import auto, Enum

from tactile_common.errors import TactileError
from tactile_servo.reasons import Reason, ReasonCode
from tactile_servo.types import State


class Event(Enum):
    """What changes the state of a servo."""

    START = auto()  # a goal is accepted
    TOUCH = auto()  # the approach has met what is to be tracked
    TRACK = auto()  # the law tracks,
    CORNER = auto()  # is at a corner,
    SEARCH = auto()  # or searches
    HOLD = auto()  # something is wrong
    RESUME_APPROACH = auto()  # it no longer is: go on with what was held
    RESUME_TRACK = auto()
    RESUME_RETREAT = auto()
    LIFT = auto()  # the goal ends: lift off,
    STOP = auto()  # or stop where the pad is
    REST = auto()  # that has been done, the robot stands
    FINISH = auto()  # the result has been taken


_TRACKING = {Event.TRACK: State.TRACK, Event.CORNER: State.CORNER, Event.SEARCH: State.SEARCH,
             Event.HOLD: State.HOLD, Event.LIFT: State.RETREAT, Event.STOP: State.HOLD}
TRANSITIONS: dict[State, dict[Event, State]] = {
    State.IDLE: {Event.START: State.APPROACH},
    State.APPROACH: {Event.TOUCH: State.TRACK, Event.HOLD: State.HOLD,
                     Event.LIFT: State.RETREAT, Event.STOP: State.HOLD},
    State.TRACK: _TRACKING, State.CORNER: _TRACKING, State.SEARCH: _TRACKING,
    State.HOLD: {Event.RESUME_APPROACH: State.APPROACH, Event.RESUME_TRACK: State.TRACK,
                 Event.RESUME_RETREAT: State.RETREAT, Event.LIFT: State.RETREAT,
                 Event.STOP: State.HOLD, Event.REST: State.DONE},
    State.RETREAT: {Event.HOLD: State.HOLD, Event.STOP: State.HOLD, Event.REST: State.DONE},
    State.DONE: {Event.FINISH: State.IDLE},
}
# What takes up again what a hold interrupted; the law says anew whether it is at a corner.
RESUMPTION = {State.APPROACH: Event.RESUME_APPROACH, State.TRACK: Event.RESUME_TRACK,
              State.CORNER: Event.RESUME_TRACK, State.SEARCH: Event.RESUME_TRACK,
              State.RETREAT: Event.RESUME_RETREAT}
# What a law's assessment means.
ASSESSED = {State.TRACK: Event.TRACK, State.CORNER: Event.CORNER, State.SEARCH: Event.SEARCH}


class IllegalTransition(TactileError):
    """An event that a state does not know: a fault of the program, not of its input."""


class StateMachine:
    """State of a servo, why it is so, and since when (steady time of the last event [s])."""

    def __init__(self) -> None:
        self.state, self.reason = State.IDLE, Reason(ReasonCode.WAITING)
        self.since = float('-inf')

    @property
    def active(self) -> bool:
        """Whether a goal is being worked on."""
        return self.state not in (State.IDLE, State.DONE)

    def fire(self, event: Event, reason: Reason, now: float | None = None) -> None:
        """Change the state by the table; IllegalTransition if it knows no such event."""
        following = TRANSITIONS[self.state].get(event)
        if following is None:
            raise IllegalTransition(f'{event.name} while {self.state.name}')
        self.state, self.reason = following, reason
        if now is not None:
            self.since = now
