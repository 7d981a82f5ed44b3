"""
Parameters of the graph: the check of a parameter file before a node starts, and all of them.

What a node declares and what is checked here are the same dataclasses.
"""
from collections.abc import Collection, Iterator, Mapping
from pathlib import Path
import re
import sys
from typing import Any, NamedTuple

import yaml

from edge_tracking.track import TrackConfig
from tactile_common.command_line import Parser
from tactile_common.config import built, checked, did_you_mean
from tactile_common.errors import ConfigurationError
from tactile_common.yaml_file import read_yaml
from tactile_sensing.contact.estimator import EstimatorConfig
from tactile_sensing.devices.registry import options_of, protocol_named
from tactile_sensing.nodes.driver import DriverConfig
from tactile_servo.config import ServoConfig
from tactile_servo.laws.registry import DEFAULT, LAWS
from tactile_servo.nodes.parameters import NodeConfig, OF_ROS
from tactile_shape.contour.object_model import ModelConfig
from tactile_shape.local_surface.local_quadric import LocalQuadricConfig
from tactile_shape.nodes.shape_estimator import ShapeEstimatorConfig
from tactile_simulation.joint_controller import MockRobotConfig
from tactile_simulation.nodes.mock_sensor import MockSensorConfig

# What each node declares its parameters from; the servo's law comes on top.
NODES: dict[str, tuple[type, ...]] = {
    'driver': (DriverConfig,), 'contact_estimator': (EstimatorConfig,),
    'shape_estimator': (ShapeEstimatorConfig, LocalQuadricConfig, ModelConfig),
    'edge_servo': (NodeConfig, ServoConfig), 'mock_sensor': (MockSensorConfig,),
    'mock_robot': (MockRobotConfig,), 'track': (TrackConfig,)}
SERVO = 'edge_servo'
# What launch file or demo give, whatever the file says.
GIVEN = {'driver': {'port': '-'}}


class Parameter(NamedTuple):
    """A parameter: its name, default and what the field says of it."""

    name: str
    default: Any
    kind: Any
    metadata: Mapping


def driver_parameters(value: Mapping[str, Any]) -> dict[str, Any]:
    """
    Return the driver's parameters that the launch arguments say, but those of the mock sensor.

    Raises a ConfigurationError where too little is said of a sensor.
    """
    sensor = value['sensor']
    given = {'calibration': value['calibration']} if value['calibration'] else {}
    if sensor in ('mock', 'none'):
        return given
    name, example = ('topic', '/my_sensor/image') if sensor == 'topic' else (
        'port', '/dev/ttyUSB0')
    if not value[name]:
        raise ConfigurationError(
            f'sensor:={sensor} needs its {name}, for instance {name}:={example}')
    if not given and (sensor == 'topic' or not protocol_named(sensor).calibration):
        raise ConfigurationError(f'sensor:={sensor} needs calibration:=FILE.yaml, which says at '
                                 'least rows, columns, pitch and gain')
    if sensor == 'topic':
        return {**given, 'topic': value['topic']}
    options_of(sensor, value['options'])
    options = {'options': value['options']} if value['options'] else {}
    return {**given, 'port': value['port'], 'protocol': sensor, **options}


def parameters_of(node: str, law: str = DEFAULT) -> list[Parameter]:
    """Every parameter that a node declares, the servo with a law."""
    found: list[Parameter] = []

    def note(name, default, kind, metadata):
        found.append(Parameter(name, default, kind, metadata))
        return GIVEN.get(node, {}).get(name, default)

    for config in _configs(node, law):
        built(config, note)
    return found


def _configs(node: str, law: str) -> tuple[type, ...]:
    return NODES[node] + ((LAWS[law].law.config_type,) if node == SERVO else ())


def read_sections(path: str | Path) -> list[tuple[str, dict[str, Any]]]:
    """
    Names of nodes, with wildcards, and their parameters, in the order of a parameter file.

    ConfigurationError if it cannot be read, is no YAML, or has another form.
    """
    try:
        return list(_sections(read_yaml(path), ''))
    except ConfigurationError as error:
        raise ConfigurationError(f'parameter file {path}: {error}') from error


def _sections(tree: Any, name: str) -> Iterator[tuple[str, dict[str, Any]]]:
    if not isinstance(tree, dict) or not tree:
        raise ConfigurationError(f"{name or 'the whole'}: must be a mapping of names of nodes to "
                                 "'ros__parameters' and these to values")
    for key, value in tree.items():
        if key == 'ros__parameters' and name:
            if not isinstance(value, dict):
                raise ConfigurationError(f'{name}: ros__parameters must be a mapping')
            yield name, dict(_flat(value))
        else:
            yield from _sections(value, '/'.join((name, str(key).strip('/'))))


def _flat(tree: Mapping, prefix: str = '') -> Iterator[tuple[str, Any]]:
    for key, value in tree.items():
        if isinstance(value, dict):
            yield from _flat(value, f'{prefix}{key}.')
        else:
            yield f'{prefix}{key}', value


def _matches(section: str, node: str) -> bool:
    """Whether a name with the wildcards * (one part) and ** (any) is that of a node."""
    parts = {'**': '(/[^/]+)*', '*': '/[^/]+'}
    pattern = ''.join(parts.get(part, f'/{re.escape(part)}') for part in section[1:].split('/'))
    return re.fullmatch(pattern, node) is not None


def check_file(path: str | Path, nodes: Mapping[str, str], law: str = DEFAULT) -> list[str]:
    """
    Check a parameter file for a graph; returns what is no error, but looks like a mistake.

    Parameters
    ----------
    path : str or Path
    nodes : Mapping
        Of the graph: full name, such as `/tactile/driver`, by name.
    law : str
        The servo's.

    Raises
    ------
    ConfigurationError
        The file cannot be read; a section is for a node of the graph in another namespace; a
        value has the wrong type or is out of bounds; a node has no such parameter.
    """
    sections, warnings = read_sections(path), []
    for section, values in sections:
        name = section.rpartition('/')[2]
        meant = [node for node, full in nodes.items() if _matches(section, full)]
        if name in nodes and not meant:
            raise ConfigurationError(
                f'parameter file {path}: {section} is not the name of the node, which is '
                f"{nodes[name]}; '/**/{name}' holds in every namespace")
        if not meant and name not in NODES:
            warnings.append(f'parameter file {path}: no node {section}{did_you_mean(name, NODES)}')
        for text in _unknown([name] if name in NODES else meant, values):
            raise ConfigurationError(f'parameter file {path}: {section}: {text}')
    for node, full in nodes.items():
        values = _values(sections, full)
        try:
            _check_values(node, law, {**values, **GIVEN.get(node, {})})
        except ConfigurationError as error:
            raise ConfigurationError(f'parameter file {path}: {full}: {error}') from error
    return warnings


def values_in(path: str | Path, full: str) -> dict[str, Any]:
    """Parameters that a file gives to the node of a full name."""
    return _values(read_sections(path), full)


def config_in(path: str | Path, full: str, config_class: type) -> Any:
    """Configuration that the node of a full name takes from a file."""
    values = values_in(path, full)
    return built(config_class, lambda name, default, kind, metadata: checked(
        name, values.get(name, default), kind, metadata))


def _values(sections, full):
    return {key: value for section, values in sections if _matches(section, full)
            for key, value in values.items()}


def _check_values(node: str, law: str, values: Mapping[str, Any]) -> None:
    def value_of(name, default, kind, metadata):
        return checked(name, values.get(name, default), kind, metadata)

    for config in _configs(node, law):
        built(config, value_of)


def _unknown(nodes: Collection[str], values: Mapping[str, Any]) -> Iterator[str]:
    known = {parameter.name for law in LAWS for node in nodes
             for parameter in parameters_of(node, law)}
    for name in values if nodes else ():
        if name not in known and name.split('.')[0] not in OF_ROS:
            yield f'no parameter {name}{did_you_mean(name, known)}'


def text_of_all(law: str = DEFAULT) -> str:
    """Text of a parameter file with every parameter of every node at its default."""
    lines = ['# Every parameter with its default; what is deleted keeps it. [live]: can be set '
             'while the node runs.', '']
    for node in NODES:
        lines += [f'/**/{node}:', '  ros__parameters:']
        for parameter in parameters_of(node, law):
            mark = '# ' if parameter.default == () else ''  # ROS reads no empty list
            lines += [f'    # {_about(parameter)}',
                      f'    {mark}{parameter.name}: {_yaml(parameter.default)}']
        lines.append('')
    return '\n'.join(lines)


def _about(parameter: Parameter) -> str:
    data = parameter.metadata
    low, high = data.get('range', (None, None))
    parts = [data.get('doc', ''), f'[{data["unit"]}]' if data.get('unit') else '',
             '' if low is None else f'{low:g} .. {high:g}', '[live]' if data.get('live') else '']
    return ' '.join(' '.join(part for part in parts if part).split())


def _yaml(value: Any) -> str:
    if isinstance(value, (tuple, list)):
        return f'[{", ".join(map(_yaml, value))}]'
    # PyYAML writes 1e-05, which YAML reads as a text.
    if isinstance(value, float) and '.' not in repr(value):
        return repr(value).replace('e', '.0e')
    return yaml.safe_dump(value, default_flow_style=True).removesuffix('...\n').strip()


def main(args: list[str] | None = None) -> int:
    """Print every parameter, or check a file; exit status 1 if it is wrong."""
    parser = Parser(
        prog='parameters', description='Prints a parameter file with every parameter, its '
        'default, unit and bounds; or checks a file.')
    parser.add_argument('--law', choices=tuple(LAWS), default=DEFAULT, help='of the servo')
    parser.add_argument('--check', metavar='FILE.yaml', help='check this file instead')
    parser.add_argument('--namespace', default='tactile', help='of the nodes, for --check')
    try:
        options = parser.parse_args(args)
        if not options.check:
            print(text_of_all(options.law))
            return 0
        warnings = check_file(options.check, names_in(options.namespace), options.law)
    except ConfigurationError as error:
        print(f'parameters: {error}', file=sys.stderr)
        return 1
    for text in warnings:
        print(f'parameters: {text}', file=sys.stderr)
    return 0


def names_in(namespace: str, robot_namespace: str = '') -> dict[str, str]:
    """Full name of every node by its name, in a namespace; the mock robot in its own."""
    def full(name):
        of = robot_namespace if name == 'mock_robot' else namespace
        return '/'.join(('', *(part for part in (of.strip('/'), name) if part)))
    return {name: full(name) for name in NODES}
