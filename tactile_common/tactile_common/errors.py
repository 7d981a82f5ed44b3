"""Errors that these packages raise on purpose."""


class TactileError(Exception):
    """Base of every error that these packages raise on purpose."""


class ConfigurationError(TactileError, ValueError):
    """A value given by the user is missing or out of bounds; one line says which and why."""


class SurfaceError(TactileError, ValueError):
    """A matrix, or a point on it, that is no surface: not symmetric, without a normal."""


class UnreachableError(TactileError, ValueError):
    """No joint configuration within the limits reaches a pose."""


class Rejected(TactileError, ValueError):
    """A trajectory that a joint_trajectory_controller does not accept; one line says why."""
