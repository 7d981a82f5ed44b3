"""Errors of tactile_servo."""


class TactileServoError(Exception):
    """Base of every error that this package raises."""


class ConfigurationError(TactileServoError, ValueError):
    """A value, file or model that cannot be used; the message is one line."""


class UnreachableError(TactileServoError, ValueError):
    """No joint configuration within the limits reaches a pose."""


class Rejected(TactileServoError, ValueError):
    """A trajectory that a joint_trajectory_controller does not accept."""

    @property
    def reason(self):
        """Why it was rejected, one line."""
        return str(self)
