"""Registry of servo laws: one row each, the only place that refers to them by name."""

from typing import Any, NamedTuple

from tactile_common.errors import ConfigurationError
from tactile_servo.config import ServoConfig
from tactile_servo.law import ServoLaw
from tactile_servo.laws.edge_following import EdgeFollowing
from tactile_servo.laws.resolved_rate import ResolvedRate
from tactile_servo.laws.surface_following import JacobianRate, SurfaceFollowing


class Row(NamedTuple):
    """A servo law."""

    law: type[ServoLaw]  # constructed from a ServoConfig and its `config_type`
    action: str  # action that accepts its goals, see `tactile_servo.conversions.ACTIONS`
    closes_contours: bool = False  # True if it can track a contour until it closes
    maps_surface: bool = False  # True if its `touch` gives points of the surface


_ROWS = (
    Row(EdgeFollowing, 'track_edge', closes_contours=True),
    Row(ResolvedRate, 'track_edge'),
    Row(SurfaceFollowing, 'track_surface', maps_surface=True),
    Row(JacobianRate, 'track_surface', maps_surface=True),
)
LAWS: dict[str, Row] = {row.law.name: row for row in _ROWS}
DEFAULT: str = _ROWS[0].law.name


def law_named(name: str) -> Row:
    """Return the row of a law; raise a ConfigurationError for an unknown name."""
    if name not in LAWS:
        raise ConfigurationError(f'law: {name!r} is not one of {", ".join(LAWS)}')
    return LAWS[name]


def law_for(action: str, name: str | None = None) -> str:
    """
    Return the law's name for an action: the given one, or the first that accepts its goals.

    Raises a ConfigurationError if the name is unknown or the law belongs to another action.
    """
    able = [law for law, row in LAWS.items() if row.action == action]
    if name and law_named(name).action != action:
        raise ConfigurationError(
            f'law: {name!r} works on goals of {LAWS[name].action}; what is to be touched here '
            f'asks for {action}, which {", ".join(able)} can')
    return name or able[0]


def make_law(name: str, servo: ServoConfig, settings: Any = None) -> ServoLaw:
    """Construct a law with its settings or their defaults; raises as `law_named` does."""
    return law_named(name).law(servo, settings)
