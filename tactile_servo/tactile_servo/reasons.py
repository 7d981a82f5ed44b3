"""Why a servo is in its state, why a goal ended or was refused: codes, and their one text each."""

from enum import IntEnum
from typing import NamedTuple

from tactile_common.errors import TactileError


class ReasonCode(IntEnum):
    """The numbers of ServoReason.msg."""

    NONE = 0
    WAITING = 1
    GOAL_ACCEPTED = 2
    CONTACT = 3
    TRACKING = 4
    CORNER = 5
    COASTING = 6
    SEARCHING = 7
    REACHING_DOWN = 8
    RESUMED = 9
    INPUT_BACK = 10
    LENGTH_REACHED = 100
    DURATION_REACHED = 101
    PATH_COMPLETED = 102
    CONTOUR_CLOSED = 103
    EDGE_ENDED = 104
    PAUSED = 200
    NO_JOINT_STATE = 201
    STALE_JOINT_STATE = 202
    NO_IMAGE = 203
    STALE_IMAGE = 204
    BAD_IMAGE = 205
    NOT_TARED = 206
    NOT_FOLLOWING = 207
    EDGE_LOST = 208
    CONTACT_LOST = 209
    CONTROLLER_INACTIVE = 210
    SEVERAL_PUBLISHERS = 211
    WRONG_FRAME = 212
    CLOCK_STOPPED = 213
    STALLED = 214
    CANCELLED = 300
    OVERLOAD = 301
    OVERFORCE = 302
    NO_CONTACT = 303
    NO_EDGE = 304
    TOO_DEEP = 305
    NO_PROGRESS = 306
    ENDED_BESIDE = 307
    GAVE_UP = 308
    MOTION_BLOCKED = 309
    TIME_LIMIT = 310
    LAP_LIMIT = 311
    SHUTDOWN = 312
    BUSY = 400
    INVALID_GOAL = 401
    UNSUPPORTED_GOAL = 402


_Code = ReasonCode
TEXTS: dict[ReasonCode, str] = {
    _Code.NONE: '',
    _Code.WAITING: 'waiting for a goal',
    _Code.GOAL_ACCEPTED: 'goal accepted',
    _Code.CONTACT: 'contact',
    _Code.TRACKING: 'tracking goes on',
    _Code.CORNER: 'corner',
    _Code.COASTING: 'the edge ends here: going straight on',
    _Code.SEARCHING: 'edge lost: moving to where the pressure is',
    _Code.REACHING_DOWN: 'contact lost: going down',
    _Code.RESUMED: 'resumed',
    _Code.INPUT_BACK: 'input is back',
    _Code.LENGTH_REACHED: 'length reached',
    _Code.DURATION_REACHED: 'duration reached',
    _Code.PATH_COMPLETED: 'path completed',
    _Code.CONTOUR_CLOSED: 'the contour closed',
    _Code.EDGE_ENDED: 'the edge ended',
    _Code.PAUSED: 'paused',
    _Code.NO_JOINT_STATE: 'no joint state',
    _Code.STALE_JOINT_STATE: 'joint state is stale',
    _Code.NO_IMAGE: 'no tactile image',
    _Code.STALE_IMAGE: 'tactile image is stale',
    _Code.BAD_IMAGE: 'tactile image cannot be used',
    _Code.NOT_TARED: 'sensor is not tared',
    _Code.NOT_FOLLOWING: 'robot does not follow',
    _Code.EDGE_LOST: 'edge lost',
    _Code.CONTACT_LOST: 'contact lost',
    _Code.CONTROLLER_INACTIVE: 'the controller of the robot takes no commands',
    _Code.SEVERAL_PUBLISHERS: 'an input has more than one source',
    _Code.WRONG_FRAME: 'an input is in another frame than tip_frame',
    _Code.CLOCK_STOPPED: 'time stands still or went back',
    _Code.STALLED: 'the servo was late',
    _Code.CANCELLED: 'cancelled',
    _Code.OVERLOAD: 'overload',
    _Code.OVERFORCE: 'more force than the goal tolerates',
    _Code.NO_CONTACT: 'no contact',
    _Code.NO_EDGE: 'contact on approach, but nothing to track',
    _Code.TOO_DEEP: 'went deeper than allowed without meeting the force',
    _Code.NO_PROGRESS: 'no progress along the edge',
    _Code.ENDED_BESIDE: "the edge ended beside the pad's centre",
    _Code.GAVE_UP: 'gave up',
    _Code.MOTION_BLOCKED: 'motion blocked',
    _Code.TIME_LIMIT: 'a state lasted too long',
    _Code.LAP_LIMIT: 'went round a contour that does not close',
    _Code.SHUTDOWN: 'the servo is being stopped',
    _Code.BUSY: 'goal rejected: another one is active',
    _Code.INVALID_GOAL: 'goal rejected',
    _Code.UNSUPPORTED_GOAL: 'goal rejected: not what this servo law can do',
}


class Reason(NamedTuple):
    """A code, and the particulars of this case in words."""

    code: ReasonCode
    detail: str = ''

    @property
    def text(self) -> str:
        """For people: what the code means, and the particulars."""
        meaning = TEXTS[self.code]
        return f'{meaning}: {self.detail}' if self.detail else meaning


class GoalRefused(TactileError, ValueError):
    """A goal that cannot be accepted now; `reason` says why."""

    def __init__(self, reason: Reason):
        super().__init__(reason.text)
        self.reason = reason
