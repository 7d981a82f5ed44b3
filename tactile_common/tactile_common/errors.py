"""Errors that these packages raise on purpose."""
from collections.abc import Iterator
from contextlib import contextmanager


class TactileError(Exception):
    """Base of every error that these packages raise on purpose."""


class ConfigurationError(TactileError, ValueError):
    """A value given by the user is missing or out of bounds; the message gives the reason."""


@contextmanager
def naming(what: str) -> Iterator[None]:
    """Put what a ConfigurationError of a block is about, such as a file, before its message."""
    try:
        yield
    except ConfigurationError as error:
        raise ConfigurationError(f'{what}: {error}') from error


class SurfaceError(TactileError, ValueError):
    """A matrix is not a surface (not symmetric), or a point on it has no normal."""


class UnreachableError(TactileError, ValueError):
    """No joint configuration within the limits reaches a pose."""


class Rejected(TactileError, ValueError):
    """A joint_trajectory_controller does not accept a trajectory; the message gives the reason."""
