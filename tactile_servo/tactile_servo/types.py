"""What a servo is told and what it tells: states, goal, status."""

from dataclasses import dataclass, field
from enum import IntEnum
from typing import NamedTuple

import numpy as np

from tactile_servo.reasons import Reason

NAN = float('nan')


class State(IntEnum):
    """States of a servo; the numbers of ServoStatus.msg."""

    IDLE = 0
    APPROACH = 1
    TRACK = 2
    CORNER = 3
    SEARCH = 4
    RETREAT = 5
    DONE = 6
    HOLD = 7

    __hash__ = int.__hash__  # Enum's is no built-in one, and states are looked up in every cycle


# While in one of these the law moves the sensor.
ON_TRACK = (State.TRACK, State.CORNER)  # while searching there is no edge to be near to
TRACKING = (*ON_TRACK, State.SEARCH)


@dataclass(frozen=True)
class EdgeGoal:
    """What to track, as in TrackEdge.action."""

    speed: float  # m/s
    force: float  # N
    direction: int = 1  # or -1, along the sensor's y
    length: float = 0.0  # m; 0 = until the edge ends
    retreat: bool = True  # at the end
    closed: bool = False  # end when the contour closes on its start
    client_timeout: float = 0.0  # s of the client's silence that ends it; 0 = none does


class TaskError(NamedTuple):
    """Where what is tracked lies in the sensor frame, as last observed; NaN = unknown."""

    lateral: float = NAN  # along the sensor's x [m]
    longitudinal: float = NAN  # along its y [m]
    angle: float = NAN  # yaw [rad]
    force: float = NAN  # on the pad [N]


class Timing(NamedTuple):
    """How long things took, as in ServoStatus.msg: times [s] and counts."""

    latency: float
    cycle_time: float
    cpu_time: float
    cycles: int
    missed_cycles: int


AT_REST = np.zeros(6)
AT_REST.flags.writeable = False


@dataclass(eq=False)  # not frozen: one is made every cycle
class Status:
    """One control cycle, as in ServoStatus.msg; SI units, NaN = unknown."""

    state: State
    reason: Reason
    contact_stamp_ns: int = 0
    contact_fresh: bool = False
    joints_fresh: bool = False
    lateral_error: float = NAN
    longitudinal_error: float = NAN
    angle_error: float = NAN
    normal_force: float = NAN
    force_target: float = NAN
    speed: float = 0.0
    progress: float = 0.0
    twist: np.ndarray = field(default_factory=lambda: AT_REST)
    limit_scale: float = 1.0
    limited_by: str = ''
    manipulability: float = NAN
