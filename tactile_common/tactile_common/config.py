"""Checks of configuration dataclasses, whose metadata hold the bounds."""
import dataclasses

from tactile_common.errors import ConfigurationError


def check_fields(config):
    """Raise ConfigurationError where a field is outside the `range` of its metadata."""
    for field in dataclasses.fields(config):
        if 'range' in field.metadata:
            low, high = field.metadata['range']
            value = getattr(config, field.name)
            if not low <= value <= high:  # NaN fails as well
                unit = f' {field.metadata["unit"]}' if 'unit' in field.metadata else ''
                raise ConfigurationError(
                    f'{field.name} is {value}, must be between {low:g} and {high:g}{unit}')
