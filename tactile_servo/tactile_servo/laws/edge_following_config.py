"""Gains and bounds of the law 'trace'."""

from dataclasses import dataclass, field

from tactile_common.config import bounded
from tactile_servo.control.attitude_controller import AttitudeConfig
from tactile_servo.control.force_controller import ForceConfig
from tactile_servo.control.path_controller import PathConfig
from tactile_servo.control.speed_planner import SpeedConfig


@dataclass(frozen=True)
class SearchConfig:
    """What is done where the edge is not seen."""

    coast: float = bounded(
        1.42, 'how far the pad goes on straight where the ridge ends, in halves of its longer '
        'side: the edge has passed from under it', '', 0.0, 10.0)
    distance: float = bounded(
        1.18, 'how far the pad moves to where the pressure is when it shows no ridge, in halves '
        'of its longer side', '', 0.0, 10.0)
    stall_time: float = bounded(
        5.0, 'the goal ends when the pad tracks, but has come no further in this time', 's',
        0.5, 600.0)


@dataclass(frozen=True)
class EdgeFollowingConfig:
    """Gains and bounds of the law 'trace'."""

    speed: SpeedConfig = field(default_factory=SpeedConfig)
    path: PathConfig = field(default_factory=PathConfig)
    force: ForceConfig = field(default_factory=ForceConfig)
    attitude: AttitudeConfig = field(default_factory=AttitudeConfig)
    search: SearchConfig = field(default_factory=SearchConfig)
