"""Errors that this package raises on purpose."""


class TactileShapeError(Exception):
    """Base of every error of this package."""


class ConfigurationError(TactileShapeError, ValueError):
    """A value given by the user is missing or out of bounds; one line says which and why."""


class SurfaceError(TactileShapeError, ValueError):
    """A matrix, or a point on it, that is no surface: not symmetric, without a normal."""
