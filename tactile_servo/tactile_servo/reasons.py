"""Reasons of a servo's state, of the end of a goal and of its refusal: codes with texts."""

from enum import IntEnum
from typing import NamedTuple

from tactile_common.errors import TactileError


class ReasonCode(IntEnum):
    """The numbers of ServoReason.msg, each with its `text`."""

    text: str

    def __new__(cls, value: int, text: str) -> 'ReasonCode':
        """Create a member from its number and text."""
        member = int.__new__(cls, value)
        member._value_, member.text = value, text
        return member

    NONE = 0, ''
    WAITING = 1, 'waiting for a goal'
    GOAL_ACCEPTED = 2, 'goal accepted'
    CONTACT = 3, 'contact'
    TRACKING = 4, 'tracking goes on'
    CORNER = 5, 'corner'
    COASTING = 6, 'the edge ends here: going straight on'
    SEARCHING = 7, 'edge lost: moving to where the pressure is'
    REACHING_DOWN = 8, 'contact lost: going down'
    RESUMED = 9, 'resumed'
    INPUT_BACK = 10, 'input is back'
    LENGTH_REACHED = 100, 'length reached'
    DURATION_REACHED = 101, 'duration reached'
    PATH_COMPLETED = 102, 'path completed'
    CONTOUR_CLOSED = 103, 'the contour closed'
    EDGE_ENDED = 104, 'the edge ended'
    PAUSED = 200, 'paused'
    NO_JOINT_STATE = 201, 'no joint state'
    STALE_JOINT_STATE = 202, 'joint state is stale'
    NO_IMAGE = 203, 'no tactile image'
    STALE_IMAGE = 204, 'tactile image is stale'
    BAD_IMAGE = 205, 'tactile image cannot be used'
    NOT_TARED = 206, 'sensor is not tared'
    NOT_FOLLOWING = 207, 'robot does not follow'
    EDGE_LOST = 208, 'edge lost'
    CONTACT_LOST = 209, 'contact lost'
    CONTROLLER_INACTIVE = 210, 'the controller of the robot takes no commands'
    SEVERAL_PUBLISHERS = 211, 'an input has more than one source'
    WRONG_FRAME = 212, 'an input is in another frame than tip_frame'
    CLOCK_STOPPED = 213, 'time stopped or went back'
    STALLED = 214, 'the servo was late'
    NO_WRENCH = 215, 'no force of the wrist'
    CANCELLED = 300, 'cancelled'
    OVERLOAD = 301, 'overload'
    OVERFORCE = 302, 'more force than the goal tolerates'
    NO_CONTACT = 303, 'no contact'
    NO_EDGE = 304, 'contact on approach, but nothing to track'
    TOO_DEEP = 305, 'went deeper than the measured force explains'
    NO_PROGRESS = 306, 'no progress along the path'
    ENDED_BESIDE = 307, "the edge ended beside the pad's centre"
    GAVE_UP = 308, 'gave up'
    MOTION_BLOCKED = 309, 'motion blocked'
    TIME_LIMIT = 310, 'a state lasted too long'
    LAP_LIMIT = 311, 'went round a contour that does not close'
    SHUTDOWN = 312, 'the servo is being stopped'
    CLIENT_LOST = 313, 'the client of the goal has fallen silent'
    SENSOR_SILENT = 314, 'tactels that were alive have fallen silent'
    SENSOR_DRIFTED = 315, 'the sensor reads less than nothing'
    SENSOR_DISAGREES = 316, 'pad and wrist measure different forces'
    SELF_TEST = 317, 'pressed and released at first, the pad does not answer as it should'
    WRONG_ORDER = 318, 'the edge moves the wrong way in the images'
    BUSY = 400, 'goal rejected: another one is active'
    INVALID_GOAL = 401, 'goal rejected'
    UNSUPPORTED_GOAL = 402, 'goal rejected: not what this servo law can do'


class Reason(NamedTuple):
    """A code, and the details of this case in words."""

    code: ReasonCode
    detail: str = ''

    @property
    def text(self) -> str:
        """Text for people: the meaning of the code, and the details."""
        return f'{self.code.text}: {self.detail}' if self.detail else self.code.text


class Refused(TactileError, ValueError):
    """A goal or an input that cannot be accepted; `reason` says why."""

    def __init__(self, reason: Reason):
        super().__init__(reason.text)
        self.reason = reason
