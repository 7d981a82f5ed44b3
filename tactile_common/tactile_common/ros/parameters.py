"""ROS parameters declared from configuration dataclasses, which contain the defaults."""
from collections.abc import Callable, Mapping
from typing import Any

from rcl_interfaces.msg import (
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
    SetParametersResult,
)
from rclpy.exceptions import ParameterException
from rclpy.node import Node
from rclpy.parameter import Parameter

from tactile_common.config import built, leaves
from tactile_common.errors import ConfigurationError


def declare_from(node: Node, config_class: type) -> Any:
    """
    Declare one parameter per field of a dataclass; return the dataclass with the user's values.

    Every field of the frozen dataclass has a default and one of these types: `bool`, `int`,
    `float`, `str`, `tuple` of one of them, or another such dataclass, whose parameters include its
    name and a dot, such as `force.gain`. The metadata (see `tactile_common.config`) become the
    parameters' descriptors. Parameters that are not `live` cannot be set while the node runs.

    Raises a ConfigurationError if a value has the wrong type, is out of range or is refused by
    the dataclass.
    """
    for name, default, kind, metadata in leaves(config_class):
        try:
            node.declare_parameter(name, list(default) if isinstance(default, tuple) else default,
                                   _descriptor(metadata, kind))
        except ParameterException as error:
            raise ConfigurationError(f"parameter '{name}': {error}") from error
    return _values(node, config_class, {})


def follow_changes(node: Node, config_class: type, apply: Callable[[Any], None]) -> None:
    """
    Call `apply(config)` with the dataclass whenever one of its parameters has been set.

    Values of the wrong type, out of range, or refused by the dataclass are not set; the answer
    says why. The parameters must have been declared by `declare_from`.
    """
    def check(parameters: list[Parameter]) -> SetParametersResult:
        try:
            _values(node, config_class, {it.name: it.value for it in parameters})
        except ConfigurationError as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    node.add_on_set_parameters_callback(check)
    node.add_post_set_parameters_callback(lambda _: apply(_values(node, config_class, {})))


def _values(node: Node, config_class: type, changed: Mapping[str, Any]) -> Any:
    """Return the dataclass of a node's parameters with some of them changed."""
    values = {name: node.get_parameter(name).value for name, *_ in leaves(config_class)}
    return built(config_class, {**values, **changed}, called="parameter '{}'")


def _descriptor(metadata: Mapping, kind: Any) -> ParameterDescriptor:
    text = metadata.get('doc', '')
    if metadata.get('unit'):
        text = f'{text} [{metadata["unit"]}]'.lstrip()
    # Dynamic typing lets a user write 30 for 30.0; `checked` checks the type.
    descriptor = ParameterDescriptor(
        description=text, read_only=not metadata.get('live', False), dynamic_typing=True)
    if 'choices' in metadata:
        descriptor.additional_constraints = f'one of {", ".join(map(str, metadata["choices"]))}'
    if 'range' in metadata and kind is float:
        low, high = map(float, metadata['range'])
        descriptor.floating_point_range = [FloatingPointRange(from_value=low, to_value=high)]
    elif 'range' in metadata and kind is int:  # of 64 bits
        low, high = (int(min(max(bound, -2**63), 2**63 - 1)) for bound in metadata['range'])
        descriptor.integer_range = [IntegerRange(from_value=low, to_value=high)]
    return descriptor
