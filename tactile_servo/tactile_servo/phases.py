"""Phases of a goal: what the servo does, in more detail than the published states."""

from enum import auto, Enum

from tactile_servo.types import State


class Phase(Enum):
    """Activity of a servo with a goal. A hold has four phases."""

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


HELD = frozenset({Phase.SETTLING, Phase.WAITING, Phase.ASKED, Phase.UNLOADING})
STANDING = frozenset({Phase.WAITING, Phase.ASKED})
TRACKING = frozenset({Phase.TRACK, Phase.CORNER, Phase.SEARCH})  # the law moves the sensor
APPROACHING = frozenset({Phase.APPROACH, Phase.TEST})
TOUCHING = TRACKING | APPROACHING
MOVING = TOUCHING | {Phase.RETREAT}
LIFTING = frozenset({Phase.RETREAT, Phase.UNLOADING})  # these need only the pose, no image
_STATES = {phase: State.HOLD if phase in HELD | {Phase.STOPPING} else
           State.APPROACH if phase is Phase.TEST else State[phase.name] for phase in Phase}
