"""Configuration of the supervisor: bounds and times. Gains belong to its servo law."""

from dataclasses import dataclass

from tactile_common.config import bounded, check_fields, checked, documented
from tactile_common.errors import ConfigurationError

SLOWEST = 1e-4  # m/s
SLOWEST_RATE = 25.0  # Hz; with less, every cycle would count as a stall, see `clocks.STALL`
# Time without an image or joint state, or without seeing what is tracked, after which the servo
# holds [s]: ten images at 200 Hz; the fastest pad moves 10 mm meanwhile.
STALE_AFTER = 0.05
IMAGES, LONGEST_PATIENCE = 2.5, 0.25  # see `image_patience`: images, s
# Largest age of a stamp [s]: STALE_AFTER, and as much again for latency and different clocks.
MAX_STAMP_AGE = 0.1
# Depth by which the force loop may press beyond the pose where it last met half of the force [m]:
# a force of 10 N on the softest pad in use, 5000 N/m, needs 2 mm.
PRESS_DEPTH = 0.003
# Least force of a goal, as a multiple of `approach.contact_force`: the force varies about its
# target, and below that parameter contact counts as lost: on edges with 1.1, never with 1.2.
LEAST_FORCE = 1.2


def image_patience(rate: float) -> float:
    """
    Return the time without an image after which the servo holds [s].

    It is STALE_AFTER, or that of some images of a slow sensor, of 10 Hz at least. A rate of 0 [Hz]
    is unknown.
    """
    return max(STALE_AFTER, min(IMAGES / rate, LONGEST_PATIENCE)) if rate > 0.0 else STALE_AFTER


@dataclass(frozen=True)
class ServoConfig:
    """Configuration of the supervisor, the same for every law."""

    rate: float = bounded(400.0, 'control cycles per second', 'Hz', SLOWEST_RATE, 2000.0)
    max_speed: float = bounded(
        0.2, 'largest speed that a goal may ask for', 'm/s', 0.001, 2.0, name='speed.max')
    max_load: float = bounded(
        12.0, 'the pad is lifted off above this force; a goal may ask for two thirds of it', 'N',
        0.1, 1e4, name='force.max_load')
    approach_speed: float = bounded(
        0.01, 'speed along the normal towards the object, and away from it', 'm/s', 1e-4, 0.1,
        name='approach.speed')
    contact_force: float = bounded(
        0.5, 'force from which the pad counts as touching, if it is no noise; goals need 1.2 '
             "times as much; for `trace` on its way at least a quarter of the goal's force", 'N',
        0.01, 100.0, name='approach.contact_force')
    approach_distance: float = bounded(
        0.03, 'the approach gives up after this way', 'm', 0.001, 1.0, name='approach.distance')
    retreat_distance: float = bounded(
        0.01, 'how far the pad lifts off at the end', 'm', 0.0, 1.0, name='retreat.distance')
    following_distance: float = bounded(
        0.002, 'hold when the sensor is measured this far from the way that it was sent on '
        'lately; a rotation counts on 40 mm', 'm', 1e-4, 0.1, name='input.following_distance')
    give_up: float = bounded(
        30.0, 'a hold that nobody ended by then aborts the goal', 's', 0.1, 3600.0,
        name='hold.give_up')
    self_test: bool = documented(
        True, 'press and release the pad as it has touched, and compare with its stiffness, '
        'before it moves along anything; on edges again where it seems to be too deep')

    def __post_init__(self) -> None:
        check_fields(self)
        if self.max_force < self.min_force:
            raise ConfigurationError(
                f'force.max_load of {self.max_load:g} N allows goals of {self.max_force:.3g} N at '
                f'most, approach.contact_force of {self.contact_force:g} N those of '
                f'{self.min_force:.3g} N at least')

    @property
    def min_force(self) -> float:
        """Smallest force that a goal may ask for [N]."""
        return LEAST_FORCE * self.contact_force

    @property
    def max_force(self) -> float:
        """Largest force that a goal may ask for [N]: corners of 90 degrees raise it by half."""
        return self.max_load / 1.5


def check_goal(speed: float, force: float, config: ServoConfig) -> None:
    """Check speed [m/s] and force [N] of a goal; ConfigurationError if one is out of bounds."""
    checked('speed', speed, float, {'range': (SLOWEST, config.max_speed), 'unit': 'm/s'})
    checked('force', force, float, {
        'range': (config.min_force, config.max_force), 'unit': 'N'})
