"""
Parameters of the graph: check of a parameter file before a node starts, and a full list.

The check uses the same dataclasses from which the nodes declare their parameters.
"""
from collections.abc import Mapping
from pathlib import Path
import sys
from typing import Any

import yaml

from edge_tracking.goals import TrackConfig
from edge_tracking.resources import NAMESPACE
from edge_tracking.view import ViewConfig
from tactile_common.command_line import Parser, refusing
from tactile_common.config import did_you_mean
from tactile_common.errors import ConfigurationError
from tactile_common.parameter_file import matches, Parameter, ParameterFile
from tactile_common.parameter_file import parameters_of as declared
from tactile_sensing.contact.estimator import EstimatorConfig
from tactile_sensing.devices.registry import options_of, protocol_named
from tactile_sensing.nodes.driver import DriverConfig
from tactile_servo.config import ServoConfig
from tactile_servo.laws.registry import DEFAULT, LAWS
from tactile_servo.robot_config import NodeConfig
from tactile_shape.local_surface.local_quadric import LocalQuadricConfig
from tactile_shape.nodes.shape_estimator import ShapeEstimatorConfig
from tactile_simulation.nodes.mock_robot import MockRobotConfig
from tactile_simulation.nodes.mock_sensor import MockSensorConfig

# Dataclasses of the parameters of each node; the servo's law adds its own.
NODES: dict[str, tuple[type, ...]] = {
    'driver': (DriverConfig,), 'contact_estimator': (EstimatorConfig,),
    'shape_estimator': (ShapeEstimatorConfig, LocalQuadricConfig),
    'edge_servo': (NodeConfig, ServoConfig), 'mock_sensor': (MockSensorConfig,),
    'mock_robot': (MockRobotConfig,), 'track': (TrackConfig,), 'view': (ViewConfig,)}
SERVO = 'edge_servo'
# Values that the launch file or the demo sets, regardless of the file.
GIVEN = {'driver': {'port': '-'}}


def driver_parameters(value: Mapping[str, Any]) -> dict[str, Any]:
    """
    Return the driver's parameters from the launch arguments, except those of the mock sensor.

    Raises a ConfigurationError if the arguments do not describe the sensor completely.
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
    """Return every parameter that a node declares; for the servo, with a law."""
    return declared(configs_of(node, law))


def configs_of(node: str, law: str) -> tuple[type, ...]:
    """Return the dataclasses of the parameters of a node; for the servo, with a law."""
    return NODES[node] + ((LAWS[law].law.config_type,) if node == SERVO else ())


def check_file(path: str | Path, nodes: Mapping[str, str], law: str = DEFAULT) -> list[str]:
    """
    Check a parameter file for a graph; return warnings about probable mistakes.

    `nodes` are the full names, such as `/tactile/driver`, of the graph's nodes by their names, and
    `law` is that of the servo. Raises a ConfigurationError if the file cannot be read, a section
    is for a node of the graph in another namespace, a value has the wrong type or is out of
    bounds, or a node has no such parameter.
    """
    file, warnings = ParameterFile(path), []
    for section, values in file.sections:
        name = section.rpartition('/')[2]
        meant = [node for node, full in nodes.items() if matches(section, full)]
        if name in nodes and not meant:
            raise ConfigurationError(
                f'parameter file {path}: {section} is not the name of the node, which is '
                f"{nodes[name]}; '/**/{name}' holds in every namespace")
        if not meant and name not in NODES:
            warnings.append(f'parameter file {path}: no node {section}{did_you_mean(name, NODES)}')
        if of_nodes := [name] if name in NODES else meant:
            file.refuse_unknown(section, values, [
                parameter.name for node in of_nodes for law_of_it in LAWS
                for parameter in parameters_of(node, law_of_it)])
    for node, full in nodes.items():
        given = GIVEN.get(node, {})
        for config in configs_of(node, law):
            file.config(full, config, given)
    return warnings


def text_of_all(law: str = DEFAULT) -> str:
    """Return the text of a parameter file with all parameters of all nodes at their defaults."""
    lines = ['# Every parameter with its default; what is deleted keeps it. [live]: can be set '
             'while the node runs.', '']
    for node in NODES:
        lines += [f'/**/{node}:', '  ros__parameters:']
        for parameter in parameters_of(node, law):
            mark = '# ' if parameter.default == () else ''  # ROS cannot read empty lists
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
    """
    Print every parameter, or check a file.

    The exit status is 2 if a node would refuse the file, 1 if a name in it is unknown.
    """
    parser = Parser(
        prog='parameters', description='Prints a parameter file with every parameter, its '
        'default, unit and bounds; or checks a file.')
    parser.add_argument('--law', choices=tuple(LAWS), default=DEFAULT, help='of the servo')
    parser.add_argument('--check', metavar='FILE.yaml', help='check this file instead')
    parser.add_argument('--namespace', default=NAMESPACE, help='of the nodes, for --check')
    with refusing('parameters') as command:
        options = parser.parse_args(args)
        if not options.check:
            print(text_of_all(options.law))
            return command.status
        nodes = names_in(options.namespace, robot_namespace(options.namespace))
        warnings = check_file(options.check, nodes, options.law)
        for text in warnings:
            print(f'parameters: {text}', file=sys.stderr)
        if not warnings:
            print(f'parameters: {options.check} is right', file=sys.stderr)
        command.status = int(bool(warnings))
    return command.status


def robot_namespace(namespace: str) -> str:
    """Return the namespace of a mock robot in a launch: the sensor's, or none by default."""
    own = namespace.strip('/')
    return '' if own == NAMESPACE else own


def names_in(namespace: str, robot_namespace: str = '') -> dict[str, str]:
    """Return the full names of all nodes in a namespace; the mock robot has its own."""
    own = {'mock_robot': robot_namespace}
    return {name: f'/{own.get(name, namespace).strip("/")}/{name}'.replace('//', '/')
            for name in NODES}
