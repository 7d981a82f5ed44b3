"""What the edge servo is told and what it tells: configuration, goal, status."""

from dataclasses import dataclass, field
from enum import IntEnum

import numpy as np

from tactile_common.errors import ConfigurationError
from tactile_servo.motion.motion import MotionConfig

WINDOW_PERIODS = 2.0  # control periods that a window of commands looks ahead
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


# While in one of these the tracker moves the sensor.
TRACKING = (State.TRACK, State.CORNER, State.SEARCH)


@dataclass(frozen=True)
class Verdict:
    """
    What a tracker decides about the next cycle.

    state : State
        One of TRACKING, or HOLD, or DONE to end the goal.
    reason : str
    success : bool
        Of an end: whether the edge was tracked as asked for.
    lift : bool
        Of an end: whether to lift off whatever the goal says.
    """

    state: State
    reason: str = ''
    success: bool = False
    lift: bool = False


KEEP = Verdict(State.TRACK)


@dataclass(frozen=True)
class EdgeServoConfig(MotionConfig):
    """Bounds of the servo, beside the gains of `ResolvedRateConfig`."""

    rate: float = field(default=400.0, metadata={
        'doc': 'control cycles per second', 'unit': 'Hz', 'range': (10.0, 2000.0)})
    array_half_width: float = field(default=0.0127, metadata={
        'doc': 'half the size of the tactel array', 'unit': 'm', 'range': (0.001, 1.0)})
    max_speed: float = field(default=0.2, metadata={
        'doc': 'largest speed along the edge that a goal may ask for', 'unit': 'm/s',
        'range': (0.001, 2.0)})
    max_force: float = field(default=10.0, metadata={
        'doc': 'largest force that a goal may ask for', 'unit': 'N', 'range': (0.1, 1e3)})
    max_load: float = field(default=12.0, metadata={
        'doc': 'the pad is lifted off above this force', 'unit': 'N', 'range': (0.1, 1e4)})
    contact_force: float = field(default=0.5, metadata={
        'doc': 'force that ends the approach', 'unit': 'N', 'range': (0.01, 100.0)})
    approach_speed: float = field(default=0.01, metadata={
        'doc': 'speed along the normal towards the object, and away from it', 'unit': 'm/s',
        'range': (1e-4, 0.1)})
    soft_touch: float = field(default=2.5, metadata={
        'doc': 'a goal of less force than this approaches slower, in proportion', 'unit': 'N',
        'range': (0.01, 100.0)})
    approach_distance: float = field(default=0.03, metadata={
        'doc': 'the approach gives up after this way', 'unit': 'm', 'range': (0.001, 1.0)})
    retreat_distance: float = field(default=0.01, metadata={
        'doc': 'how far the pad lifts off at the end', 'unit': 'm', 'range': (0.0, 1.0)})
    press_depth: float = field(default=0.003, metadata={
        'doc': 'the force loop may press this much deeper than where it last met half of the '
               'force',
        'unit': 'm', 'range': (1e-4, 0.1)})
    max_acceleration: float = field(default=1.0, metadata={
        'doc': 'acceleration along the edge', 'unit': 'm/s^2', 'range': (0.01, 100.0)})
    end_of_edge: float = field(default=0.35, metadata={
        'doc': 'the edge ends when the centre of pressure falls behind by this fraction of '
               'half the array', 'range': (0.1, 1.0)})
    stale_image: float = field(default=0.05, metadata={
        'doc': 'hold when no image came for this long', 'unit': 's', 'range': (0.002, 10.0)})
    stale_joints: float = field(default=0.05, metadata={
        'doc': 'hold when no joint state came for this long', 'unit': 's',
        'range': (0.002, 10.0)})
    max_stamp_age: float = field(default=0.1, metadata={
        'doc': 'hold when the newest stamp is older, or further in the future, than this',
        'unit': 's', 'range': (0.005, 10.0)})
    edge_lost: float = field(default=0.05, metadata={
        'doc': 'hold when the images show no edge for this long', 'unit': 's',
        'range': (0.002, 10.0)})
    resume_within: float = field(default=0.5, metadata={
        'doc': 'a hold whose cause goes away within this time ends by itself; a longer one '
               'waits for ~/pause false', 'unit': 's', 'range': (0.0, 60.0)})
    give_up: float = field(default=30.0, metadata={
        'doc': 'a hold that nobody ended by then aborts the goal', 'unit': 's',
        'range': (0.1, 3600.0)})
    following_error: float = field(default=0.15, metadata={
        'doc': 'hold when a joint is this far from where it was commanded', 'unit': 'rad',
        'range': (0.001, 3.0)})

    def __post_init__(self):
        if not self.max_force < self.max_load:
            raise ConfigurationError(
                f'max_force: {self.max_force} N is not below max_load, {self.max_load} N')


@dataclass(frozen=True)
class EdgeGoal:
    """
    What to track, as in TrackEdge.action.

    speed [m/s]; force [N]; direction +1 or -1 along the sensor's y; length [m], 0 = until the
    edge ends; retreat at the end; closed: end when the contour closes on its start.
    """

    speed: float
    force: float
    direction: int = 1
    length: float = 0.0
    retreat: bool = True
    closed: bool = False


@dataclass(frozen=True)
class Status:
    """One control cycle, as in ServoStatus.msg; SI units, NaN = unknown."""

    state: State
    reason: str
    contact_stamp_ns: int = 0
    contact_fresh: bool = False
    joints_fresh: bool = False
    lateral_error: float = NAN
    angle_error: float = NAN
    normal_force: float = NAN
    force_target: float = NAN
    speed: float = 0.0
    progress: float = 0.0
    twist: np.ndarray = field(default_factory=lambda: np.zeros(6))
    limit_scale: float = 1.0
    limited_by: str = ''
    manipulability: float = NAN
