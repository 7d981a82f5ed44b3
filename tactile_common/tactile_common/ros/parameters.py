"""ROS parameters declared from a configuration dataclass, where the defaults live."""
import dataclasses

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor
from rclpy.exceptions import ParameterException

from tactile_common.config import checked, types_of
from tactile_common.errors import ConfigurationError


def declare_from(node, config_class, read_only=True, prefix='', defaults=None):
    """
    Declare one parameter per field of a dataclass; returns it with the values of the user.

    The fields of a nested dataclass become parameters of its name, a dot and theirs, such as
    `force.gain`.

    Parameters
    ----------
    config_class : type
        Frozen dataclass. Every field has a default and a type among `bool`, `int`, `float`,
        `str`, `tuple` of one of them, and such dataclasses. The metadata, see
        `tactile_common.config`, become the parameters' descriptors.
    read_only : bool
        Whether the parameters can no longer be set once the node runs.
    prefix : str
        Of the names of the parameters.
    defaults : config_class, optional
        In place of the fields' own.

    Raises
    ------
    ConfigurationError
        A value has the wrong type, is out of range or is refused by `config_class`.
    """
    values = {}
    for field in dataclasses.fields(config_class):
        name, kind = prefix + field.name, types_of(config_class)[field.name]
        default = field.default if defaults is None else getattr(defaults, field.name)
        if callable(field.default_factory) and default is dataclasses.MISSING:
            default = field.default_factory()
        if dataclasses.is_dataclass(kind):
            values[field.name] = declare_from(node, kind, read_only, f'{name}.', default)
            continue
        try:
            parameter = node.declare_parameter(
                name, list(default) if isinstance(default, tuple) else default,
                _descriptor(field.metadata, kind, read_only))
        except ParameterException as error:
            raise ConfigurationError(f"parameter '{name}': {error}") from error
        values[field.name] = checked(f"parameter '{name}'", parameter.value, kind, field.metadata)
    return config_class(**values)


def _descriptor(metadata, kind, read_only):
    text = metadata.get('doc', '')
    if metadata.get('unit'):
        text = f'{text} [{metadata["unit"]}]'.lstrip()
    # Dynamic typing lets a user write 30 where 30.0 is meant; `checked` looks at the type.
    descriptor = ParameterDescriptor(description=text, read_only=read_only, dynamic_typing=True)
    if 'choices' in metadata:
        descriptor.additional_constraints = f'one of {", ".join(map(str, metadata["choices"]))}'
    if 'range' in metadata and kind in (int, float):
        low, high = metadata['range']
        if kind is float:
            descriptor.floating_point_range = [
                FloatingPointRange(from_value=float(low), to_value=float(high))]
        else:
            descriptor.integer_range = [
                IntegerRange(from_value=_integer(low), to_value=_integer(high))]
    return descriptor


def _integer(bound):
    """Bound of an integer parameter, which has 64 bits."""
    return int(min(max(bound, -2**63), 2**63 - 1))
