"""Configuration of the supervisor: bounds and times. Gains belong to its servo law."""

from dataclasses import dataclass, field

from tactile_common.config import bounded, checked
from tactile_common.errors import ConfigurationError
from tactile_servo.motion.motion import MotionConfig

SLOWEST = 1e-4  # m/s


@dataclass(frozen=True)
class SpeedBounds:
    """Bounds of a goal's speed."""

    max: float = bounded(0.2, 'largest speed that a goal may ask for', 'm/s', 0.001, 2.0)


@dataclass(frozen=True)
class ForceBounds:
    """Bounds of the force on the pad."""

    max: float = bounded(10.0, 'largest force that a goal may ask for', 'N', 0.1, 1e3)
    max_load: float = bounded(12.0, 'the pad is lifted off above this force', 'N', 0.1, 1e4)
    press_depth: float = bounded(
        0.003, 'the force loop may press this much deeper than where it last met half of the '
        'force', 'm', 1e-4, 0.1)

    def __post_init__(self) -> None:
        if not self.max < self.max_load:
            raise ConfigurationError(
                f'force.max: {self.max} N is not below force.max_load, {self.max_load} N')


@dataclass(frozen=True)
class ApproachConfig:
    """Approach to the object."""

    speed: float = bounded(
        0.01, 'speed along the normal towards the object, and away from it', 'm/s', 1e-4, 0.1)
    contact_force: float = bounded(
        0.5, 'force from which the pad counts as touching', 'N', 0.01, 100.0)
    distance: float = bounded(0.03, 'the approach gives up after this way', 'm', 0.001, 1.0)


@dataclass(frozen=True)
class RetreatConfig:
    """Retreat from the object."""

    distance: float = bounded(0.01, 'how far the pad lifts off at the end', 'm', 0.0, 1.0)


@dataclass(frozen=True)
class InputConfig:
    """Largest age of an input, and largest deviation from the commanded path."""

    stale_image: float = bounded(
        0.05, 'hold when no image came, or none showed what is tracked, for this long', 's', 0.002,
        10.0)
    stale_joints: float = bounded(
        0.05, 'hold when no joint state came for this long', 's', 0.002, 10.0)
    max_stamp_age: float = bounded(
        0.1, 'hold when the newest stamp is older, or further in the future, than this',
        's', 0.005, 10.0)
    following_distance: float = bounded(
        0.002, 'hold when the sensor is measured this far from the way that it was sent on '
        'lately; a rotation counts on 40 mm', 'm', 1e-4, 0.1)


@dataclass(frozen=True)
class HoldConfig:
    """How a hold ends."""

    resume_within: float = bounded(
        0.5, 'a hold whose cause goes away within this time ends by itself; a longer one '
        'waits for ~/pause false', 's', 0.0, 60.0)
    lift: bool = field(default=True, metadata={
        'doc': 'a hold of tracking that does not end by itself lifts the pad off, unless somebody '
               'asked for it or the robot does not follow'})
    give_up: float = bounded(
        30.0, 'a hold that nobody ended by then aborts the goal', 's', 0.1, 3600.0)


@dataclass(frozen=True)
class ServoConfig:
    """Configuration of the supervisor, the same for every law."""

    rate: float = bounded(400.0, 'control cycles per second', 'Hz', 10.0, 2000.0)
    speed: SpeedBounds = field(default_factory=SpeedBounds)
    force: ForceBounds = field(default_factory=ForceBounds)
    approach: ApproachConfig = field(default_factory=ApproachConfig)
    retreat: RetreatConfig = field(default_factory=RetreatConfig)
    input: InputConfig = field(default_factory=InputConfig)
    hold: HoldConfig = field(default_factory=HoldConfig)
    self_test: bool = field(default=True, metadata={
        'doc': 'press and release the pad once as it has touched, and compare with its stiffness, '
               'before it moves along anything'})
    motion: MotionConfig = field(default_factory=MotionConfig)


def check_goal(speed: float, force: float, config: ServoConfig) -> None:
    """
    Check the speed [m/s] and the force [N] of a goal.

    ConfigurationError if one is outside the servo's bounds. The force must be at least
    `approach.contact_force`: a smaller one cannot be detected and so cannot be controlled.
    """
    checked('speed', speed, float, {'range': (SLOWEST, config.speed.max), 'unit': 'm/s'})
    checked('force', force, float, {
        'range': (config.approach.contact_force, config.force.max), 'unit': 'N'})
