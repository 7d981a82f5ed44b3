"""User settings of robot and task for the law 'trace'."""

from dataclasses import dataclass, field

from tactile_common.config import bounded


@dataclass(frozen=True)
class SpeedConfig:
    """Motion in the plane of the edge."""

    acceleration: float = bounded(
        2.0, 'largest acceleration of the pad in the plane of the edge', 'm/s^2', 0.01, 100.0)


@dataclass(frozen=True)
class PathConfig:
    """Accuracy with which a path is followed."""

    lateral_gain: float = bounded(
        30.0, "rate at which the pad's distance from the traced edge is made up", '1/s',
        1.0, 200.0, live=True)
    corner_cut: float = bounded(
        5e-5, 'distance from a sharp corner at which the pad may pass it; what the task allows',
        'm', 1e-6, 1e-2)


@dataclass(frozen=True)
class ForceConfig:
    """Motion along the normal."""

    gain: float = bounded(
        60.0, 'rate at which an error of the force is made up', '1/s', 1.0, 200.0, live=True)


@dataclass(frozen=True)
class AttitudeConfig:
    """Rotation of the pad."""

    max_turn: float = bounded(
        7.0, 'the pad is turned with the edge up to this angle from where it began, and '
        'kept beyond', 'rad', 0.0, 100.0)


@dataclass(frozen=True)
class EdgeFollowingConfig:
    """User settings of robot and task for the law 'trace'."""

    speed: SpeedConfig = field(default_factory=SpeedConfig)
    path: PathConfig = field(default_factory=PathConfig)
    force: ForceConfig = field(default_factory=ForceConfig)
    attitude: AttitudeConfig = field(default_factory=AttitudeConfig)
