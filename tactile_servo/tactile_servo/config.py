"""Bounds of the supervisor; the gains are those of its servo law."""

from dataclasses import dataclass, field

from tactile_common.errors import ConfigurationError
from tactile_servo.motion.motion import MotionConfig

WINDOW_PERIODS = 2.0  # control periods that a window of commands looks ahead


@dataclass(frozen=True)
class SpeedBounds:
    """What a goal may ask for."""

    max: float = field(default=0.2, metadata={
        'doc': 'largest speed that a goal may ask for', 'unit': 'm/s', 'range': (0.001, 2.0)})


@dataclass(frozen=True)
class ForceBounds:
    """What the pad may bear."""

    max: float = field(default=10.0, metadata={
        'doc': 'largest force that a goal may ask for', 'unit': 'N', 'range': (0.1, 1e3)})
    max_load: float = field(default=12.0, metadata={
        'doc': 'the pad is lifted off above this force', 'unit': 'N', 'range': (0.1, 1e4)})
    press_depth: float = field(default=0.003, metadata={
        'doc': 'the force loop may press this much deeper than where it last met half of the '
               'force',
        'unit': 'm', 'range': (1e-4, 0.1)})

    def __post_init__(self):
        if not self.max < self.max_load:
            raise ConfigurationError(
                f'force.max: {self.max} N is not below force.max_load, {self.max_load} N')


@dataclass(frozen=True)
class ApproachConfig:
    """Way to the object."""

    speed: float = field(default=0.01, metadata={
        'doc': 'speed along the normal towards the object, and away from it', 'unit': 'm/s',
        'range': (1e-4, 0.1)})
    contact_force: float = field(default=0.5, metadata={
        'doc': 'force that ends the approach', 'unit': 'N', 'range': (0.01, 100.0)})
    soft_touch: float = field(default=2.5, metadata={
        'doc': 'a goal of less force than this approaches slower, in proportion', 'unit': 'N',
        'range': (0.01, 100.0)})
    distance: float = field(default=0.03, metadata={
        'doc': 'the approach gives up after this way', 'unit': 'm', 'range': (0.001, 1.0)})


@dataclass(frozen=True)
class RetreatConfig:
    """Way back from the object."""

    distance: float = field(default=0.01, metadata={
        'doc': 'how far the pad lifts off at the end', 'unit': 'm', 'range': (0.0, 1.0)})


@dataclass(frozen=True)
class InputConfig:
    """How old an input may be."""

    stale_image: float = field(default=0.05, metadata={
        'doc': 'hold when no image came for this long', 'unit': 's', 'range': (0.002, 10.0)})
    stale_joints: float = field(default=0.05, metadata={
        'doc': 'hold when no joint state came for this long', 'unit': 's',
        'range': (0.002, 10.0)})
    max_stamp_age: float = field(default=0.1, metadata={
        'doc': 'hold when the newest stamp is older, or further in the future, than this',
        'unit': 's', 'range': (0.005, 10.0)})
    lost_after: float = field(default=0.05, metadata={
        'doc': 'what is tracked counts as lost when no image has shown it for this long',
        'unit': 's', 'range': (0.002, 10.0)})
    following_error: float = field(default=0.15, metadata={
        'doc': 'hold when a joint is this far from where it was commanded', 'unit': 'rad',
        'range': (0.001, 3.0)})


@dataclass(frozen=True)
class HoldConfig:
    """How a hold ends."""

    resume_within: float = field(default=0.5, metadata={
        'doc': 'a hold whose cause goes away within this time ends by itself; a longer one '
               'waits for ~/pause false', 'unit': 's', 'range': (0.0, 60.0)})
    give_up: float = field(default=30.0, metadata={
        'doc': 'a hold that nobody ended by then aborts the goal', 'unit': 's',
        'range': (0.1, 3600.0)})


@dataclass(frozen=True)
class ServoConfig:
    """Bounds of the supervisor, whatever its law."""

    rate: float = field(default=400.0, metadata={
        'doc': 'control cycles per second', 'unit': 'Hz', 'range': (10.0, 2000.0)})
    speed: SpeedBounds = field(default_factory=SpeedBounds)
    force: ForceBounds = field(default_factory=ForceBounds)
    approach: ApproachConfig = field(default_factory=ApproachConfig)
    retreat: RetreatConfig = field(default_factory=RetreatConfig)
    input: InputConfig = field(default_factory=InputConfig)
    hold: HoldConfig = field(default_factory=HoldConfig)
    motion: MotionConfig = field(default_factory=MotionConfig)
