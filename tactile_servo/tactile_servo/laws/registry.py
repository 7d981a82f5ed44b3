"""The servo laws there are: one row each, and nothing else knows one by its name."""

from typing import Any, NamedTuple

from tactile_common.errors import ConfigurationError
from tactile_servo.config import ServoConfig
from tactile_servo.law import ServoLaw
from tactile_servo.laws.edge_following import EdgeFollowing
from tactile_servo.laws.jacobian_rate import JacobianRate
from tactile_servo.laws.resolved_rate import ResolvedRate
from tactile_servo.laws.surface_following import SurfaceFollowing


class Row(NamedTuple):
    """A servo law."""

    law: type[ServoLaw]  # made of a ServoConfig and its `config_type`
    action: str  # that takes its goals, see `tactile_servo.conversions.ACTIONS`
    closes_contours: bool = False  # whether it tracks a contour until that closes
    maps_surface: bool = False  # whether its `touch` says where a surface is


_ROWS = (
    Row(EdgeFollowing, 'track_edge', closes_contours=True),
    Row(ResolvedRate, 'track_edge'),
    Row(SurfaceFollowing, 'track_surface', maps_surface=True),
    Row(JacobianRate, 'track_surface', maps_surface=True),
)
LAWS: dict[str, Row] = {row.law.name: row for row in _ROWS}
DEFAULT: str = _ROWS[0].law.name


def law_named(name: str) -> Row:
    """Row of a law; ConfigurationError if there is none of that name."""
    if name not in LAWS:
        raise ConfigurationError(f'law: {name!r} is not one of {", ".join(LAWS)}')
    return LAWS[name]


def law_for(action: str, name: str | None = None) -> str:
    """
    Name of the law for the goals of an action: the given one, else the first that takes them.

    ConfigurationError if there is none of that name, or it takes the goals of another action.
    """
    able = [law for law, row in LAWS.items() if row.action == action]
    if name and law_named(name).action != action:
        raise ConfigurationError(
            f'law: {name!r} works on goals of {LAWS[name].action}; what is to be touched here '
            f'asks for {action}, which {", ".join(able)} can')
    return name or able[0]


def make_law(name: str, servo: ServoConfig, settings: Any = None) -> ServoLaw:
    """Make a law, with its parameters or the defaults of these, as `law_named`."""
    return law_named(name).law(servo, settings)
