"""Phases of a goal, in more detail than the published states, their longest times, and holds."""

from collections import defaultdict
from dataclasses import dataclass
from enum import auto, Enum

from tactile_servo.config import ServoConfig
from tactile_servo.reasons import Reason, ReasonCode
from tactile_servo.types import Goal, State

# Time limit of a state: SLACK, and the time for its distance at the share SLOWNESS of its speed.
SLACK, SLOWNESS = 10.0, 0.05  # s
LONGEST_TRACK = 1800.0  # s, for a goal without a length
# Time within which a hold ends by itself when its cause goes away [s]; people near the robot still
# remember that it moved. After a longer one the pad lifts off and the robot waits to be asked.
RESUME_WITHIN = 0.5
# Causes after which the robot continues only when asked: whoever caused the hold must know that
# the robot will move.
BINDING = frozenset({ReasonCode.PAUSED, ReasonCode.NOT_FOLLOWING, ReasonCode.CONTROLLER_INACTIVE,
                     ReasonCode.SEVERAL_PUBLISHERS, ReasonCode.CLOCK_STOPPED})


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


@dataclass
class Hold:
    """Cause of an interruption of a goal, and what decides how it ends (`goal_run.RULES`)."""

    after: Phase  # in which the goal continues; only TRACK needs an observation of the edge
    cause: Reason
    began: float  # steady time [s]
    of_law: bool = False  # the law requested it
    bound: bool = False  # it ends only when asked, and later problems do not change its cause
    asked: bool = False  # somebody has asked to continue
    well_since: float | None = None  # steady time [s], None while there is a problem


class TimeLimits:
    """Total times of approach, tracking and retreat, and the longest ones that are allowed [s]."""

    def __init__(self, config: ServoConfig, goal: Goal):
        speed, way = config.approach_speed, goal.way
        self._spent: dict[State, float] = defaultdict(float)
        self._longest = {
            State.APPROACH: _longest(config.approach_distance, speed),
            State.TRACK: max(_longest(way, goal.speed) if way else LONGEST_TRACK,
                             SLACK + getattr(goal, 'duration', 0.0)),
            State.RETREAT: _longest(max(config.retreat_distance, config.approach_distance), speed)}

    def spend(self, phase: Phase, time: float) -> None:
        """Add a time in a phase [s]."""
        self._spent[_limited(phase)] += time

    def problem(self, phase: Phase) -> Reason | None:
        """Return that one of these states has lasted too long, or None."""
        longest = self._longest[_limited(phase)]
        over = self._spent[_limited(phase)] > longest
        return Reason(ReasonCode.TIME_LIMIT, f'{longest:.0f} s') if over else None


def _longest(distance: float, speed: float) -> float:
    return SLACK + distance / (SLOWNESS * speed)


def _limited(phase: Phase) -> State:
    """Return the state whose time limit holds in a phase."""
    return State.TRACK if phase in TRACKING else phase.state
