"""Types of a servo's interface: states, goal, status."""

from collections.abc import Iterable
from dataclasses import dataclass, field
from enum import IntEnum
from typing import NamedTuple

import numpy as np

from tactile_common.errors import ConfigurationError
from tactile_sensing.types.image import Layer
from tactile_servo.reasons import Reason

NAN = float('nan')
IMPOSSIBLE = 1e9  # Pa, from which on a pressure is a fault and does not count


def pressure_layer(layers: Iterable[Layer]) -> Layer | None:
    """Return the layer with the pressure, of an image or a sensor; None if there is none."""
    return next((one for one in layers if one.component == 'zz'), None)


def depth_of(layers: Iterable[Layer]) -> float:
    """Return the depth of the layer with the pressure [m]; ConfigurationError if unknown."""
    layer = pressure_layer(layers)
    if layer is None or not layer.depth > 0.0:
        raise ConfigurationError('the calibration does not say how deep below the surface of the '
                                 'skin the tactels are (`depth`)')
    return layer.depth


class State(IntEnum):
    """States of a servo, with the numbers of ServoStatus.msg."""

    IDLE = 0
    APPROACH = 1
    TRACK = 2
    CORNER = 3
    SEARCH = 4
    RETREAT = 5
    DONE = 6
    HOLD = 7

    __hash__ = int.__hash__  # faster than Enum's, which is written in Python


# States in which the law moves the sensor.
ON_TRACK = (State.TRACK, State.CORNER)  # without SEARCH, in which there is no edge
TRACKING = (*ON_TRACK, State.SEARCH)


@dataclass(frozen=True, eq=False)
class Goal:
    """What every goal says."""

    speed: float  # along the edge or over the surface [m/s]
    force: float  # N
    retreat: bool = field(default=True, kw_only=True)  # whether to lift off at the end
    # s without the client's heartbeat that end the goal; 0 = no limit
    client_timeout: float = field(default=0.0, kw_only=True)

    @property
    def way(self) -> float:
        """Length of the path [m]; 0 if it is not known."""
        return 0.0


@dataclass(frozen=True)
class EdgeGoal(Goal):
    """Goal of tracking an edge, as in TrackEdge.action."""

    direction: int = 1  # or -1, along the sensor's y
    length: float = 0.0  # m; 0 = until the edge ends
    closed: bool = False  # end when the contour closes on its start

    @property
    def way(self) -> float:
        return self.length


class TaskError(NamedTuple):
    """Last observed position of the edge or contact in the sensor frame; NaN = unknown."""

    lateral: float = NAN  # along the sensor's x [m]
    longitudinal: float = NAN  # along the sensor's y [m]
    angle: float = NAN  # yaw [rad]
    force: float = NAN  # on the pad [N]


class Timing(NamedTuple):
    """Durations [s] and counts of cycles, as in ServoStatus.msg."""

    latency: float
    cycle_time: float
    cpu_time: float
    cycles: int
    missed_cycles: int


AT_REST = np.zeros(6)
AT_REST.flags.writeable = False


@dataclass(eq=False)  # not frozen: one is made every cycle
class Status:
    """Status after one control cycle, as in ServoStatus.msg; SI units, NaN = unknown."""

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
