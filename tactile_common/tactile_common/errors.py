"""Errors that these packages raise on purpose."""


class TactileError(Exception):
    """Base of every error that these packages raise on purpose."""


class ConfigurationError(TactileError, ValueError):
    """A value given by the user is missing or out of bounds; the message gives the reason."""


class SurfaceError(TactileError, ValueError):
    """A matrix is not a surface (not symmetric), or a point on it has no normal."""


class UnreachableError(TactileError, ValueError):
    """No joint configuration within the limits reaches a pose."""


class Rejected(TactileError, ValueError):
    """A joint_trajectory_controller does not accept a trajectory; the message gives the reason."""
