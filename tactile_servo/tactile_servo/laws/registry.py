"""The servo laws there are: one row each, and nothing else knows one by its name."""

from typing import Any, NamedTuple

from tactile_common.errors import ConfigurationError
from tactile_servo.config import ServoConfig
from tactile_servo.law import ServoLaw
from tactile_servo.laws.edge_following import EdgeFollowing
from tactile_servo.laws.resolved_rate import ResolvedRate


class Row(NamedTuple):
    """A servo law."""

    law: type[ServoLaw]  # made of a ServoConfig and its `config_type`
    action: str  # that takes its goals, see `tactile_servo.conversions.ACTIONS`
    closes_contours: bool = False  # whether it tracks a contour until that closes


_ROWS = (
    Row(EdgeFollowing, 'track_edge', closes_contours=True),
    Row(ResolvedRate, 'track_edge'),
)
LAWS: dict[str, Row] = {row.law.name: row for row in _ROWS}
DEFAULT: str = _ROWS[0].law.name


def law_named(name: str) -> Row:
    """Row of a law; ConfigurationError if there is none of that name."""
    if name not in LAWS:
        raise ConfigurationError(f'law: {name!r} is not one of {", ".join(LAWS)}')
    return LAWS[name]


def make_law(name: str, servo: ServoConfig, settings: Any = None) -> ServoLaw:
    """Make a law, with its parameters or the defaults of these, as `law_named`."""
    return law_named(name).law(servo, settings)
