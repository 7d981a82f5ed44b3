"""ROS parameters declared from a configuration dataclass, where the defaults live."""
import dataclasses
import typing

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor
from rclpy.exceptions import ParameterException

from tactile_common.errors import ConfigurationError

_NAMES = {bool: 'a boolean', int: 'an integer', float: 'a number', str: 'a text'}


def declare_from(node, config_class, read_only=True):
    """
    Declare one parameter per field of a dataclass and return the dataclass that they make.

    Parameters
    ----------
    node : rclpy.node.Node
        Node that gets the parameters.
    config_class : type
        Frozen dataclass. Every field has a default and a type among `bool`, `int`, `float`,
        `str` and `tuple` of one of them. Its metadata may hold `doc` (description), `unit` and
        `range` (smallest and largest value, both allowed).
    read_only : bool
        Whether the parameters can no longer be set once the node runs.

    Returns
    -------
    config_class
        Instance with the values given by the user, else the defaults.

    Raises
    ------
    ConfigurationError
        A value has the wrong type, is out of range or is refused by `config_class`.
    """
    types = typing.get_type_hints(config_class)
    values = {}
    for field in dataclasses.fields(config_class):
        default = field.default
        if default is dataclasses.MISSING:
            default = field.default_factory()
        descriptor = _descriptor(field, types[field.name], read_only)
        try:
            parameter = node.declare_parameter(
                field.name, list(default) if isinstance(default, tuple) else default, descriptor,
            )
        except ParameterException as error:
            raise ConfigurationError(f"parameter '{field.name}': {error}") from error
        values[field.name] = _converted(field, types[field.name], parameter.value)
    return config_class(**values)


def _descriptor(field, kind, read_only):
    text = field.metadata.get('doc', '')
    if field.metadata.get('unit'):
        text = f'{text} [{field.metadata["unit"]}]'.lstrip()
    # Dynamic typing lets a user write 30 where 30.0 is meant; `_converted` checks the type.
    descriptor = ParameterDescriptor(description=text, read_only=read_only, dynamic_typing=True)
    if 'range' in field.metadata and kind in (int, float):
        low, high = (kind(bound) for bound in field.metadata['range'])
        if kind is float:
            descriptor.floating_point_range = [FloatingPointRange(from_value=low, to_value=high)]
        else:
            descriptor.integer_range = [IntegerRange(from_value=low, to_value=high)]
    return descriptor


def _converted(field, kind, value):
    """Value of a parameter as `kind`, checked against the field's range."""
    if kind is tuple or typing.get_origin(kind) is tuple:
        item_kind = (typing.get_args(kind) or (str,))[0]
        if isinstance(value, (str, bytes)) or not hasattr(value, '__iter__'):
            raise ConfigurationError(f"parameter '{field.name}' is {value!r}, must be a list")
        return tuple(_converted(field, item_kind, item) for item in value)
    accepted = (int, float) if kind is float else kind
    if not isinstance(value, accepted) or (isinstance(value, bool) and kind is not bool):
        raise ConfigurationError(f"parameter '{field.name}' is {value!r}, must be {_NAMES[kind]}")
    if 'range' in field.metadata:
        low, high = field.metadata['range']
        if not low <= value <= high:  # NaN fails as well
            raise ConfigurationError(
                f"parameter '{field.name}' is {value!r}, must be between {low} and {high}")
    return kind(value)
