"""The ways to follow an edge, by name."""

from tactile_common.errors import ConfigurationError
from tactile_servo.laws.edge_following import Trace
from tactile_servo.laws.resolved_rate import ResolvedRate

TRACKERS = {tracker.name: tracker for tracker in (Trace, ResolvedRate)}
DEFAULT = Trace.name


def check_name(name):
    """
    Return the class of a tracker.

    Raises
    ------
    ConfigurationError
        There is none of that name.
    """
    if name not in TRACKERS:
        raise ConfigurationError(f'tracker: {name!r} is not one of {", ".join(TRACKERS)}')
    return TRACKERS[name]


def make_tracker(name, servo, settings=None):
    """
    Return a tracker.

    Parameters
    ----------
    name : str
        One of TRACKERS.
    servo : EdgeServoConfig
    settings : object, optional
        Configuration of that tracker.

    Raises
    ------
    ConfigurationError
        There is none of that name.
    """
    return check_name(name)(servo, settings)
