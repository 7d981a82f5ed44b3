"""Errors that this package raises on purpose."""


class TactileSensingError(Exception):
    """Base of every error of this package."""


class ConfigurationError(TactileSensingError, ValueError):
    """A value given by the user is missing or out of bounds; one line says which and why."""
