"""
A robot follows an edge by touch.

Without arguments the mock sensor and the mock robot are used, and tracking starts at once.
With a real array and a real robot, whose joint_trajectory_controller is running:

  ros2 launch edge_tracking edge_tracking.launch.py sensor:=flexitac port:=/dev/ttyUSB0 \
      robot_description:=/path/to/robot.urdf

There nothing moves before a goal is sent to the action track_edge, or with start:=true.
"""
import os
from pathlib import Path
import tempfile

from launch import LaunchDescription
from launch.actions import (
    DeclareLaunchArgument,
    EmitEvent,
    OpaqueFunction,
    RegisterEventHandler,
    SetEnvironmentVariable,
)
from launch.event_handlers import OnProcessExit, OnShutdown
from launch.events import Shutdown
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

from edge_tracking.resources import find_scene, scene_names, share
from edge_tracking.transport import local_environment
from tactile_sensing.devices.registry import PROTOCOLS
from tactile_servo.laws.registry import DEFAULT, LAWS
from tactile_simulation.scene import load_scene
from tactile_simulation.scene_calibration import write_calibration

ARGUMENTS = (
    ('sensor', 'mock', 'mock: synthetic array on a pseudo-terminal; else the byte protocol of a '
     'real array on a serial port', ('mock', *PROTOCOLS)),
    ('port', '', 'serial port of a real array; for the mock, the link to its pseudo-terminal '
     '(default: one of its own in the folder for temporary files)'),
    ('robot', 'auto', 'mock: robot in software; real: a running joint_trajectory_controller; '
     'auto: mock with the mock sensor, else real', ('auto', 'mock', 'real')),
    ('scene', 'straight', f'what the mock sensor touches: {", ".join(scene_names())}, or the '
     'path of a .yaml file'),
    ('tracker', DEFAULT, 'law by which the edge is followed', tuple(LAWS)),
    ('speed', '0.03', 'along the edge [m/s]'),
    ('force', '5.0', 'normal force on the pad [N]'),
    ('length', '0.0', 'way to track [m]; 0 = until the edge ends'),
    ('start', 'auto', 'send the goal at once; auto: with the mock robot only',
     ('auto', 'true', 'false')),
    ('shutdown', 'false', 'end the launch when the goal has ended', ('true', 'false')),
    ('robot_description', str(share('urdf', 'puma260.urdf')),
     'URDF of the robot with a link tactile_pad: path of a file, or the text'),
    ('parameters', str(share('config', 'edge_tracking.yaml')), 'parameter file of all nodes'),
    ('namespace', 'tactile', 'of sensor, estimators and servo'),
    ('use_sim_time', 'false', 'take the time from /clock', ('true', 'false')),
    ('rviz', 'false', 'show the robot in RViz', ('true', 'false')),
)


def number(name, text):
    """Value of an argument that must be a number."""
    try:
        return float(text)
    except ValueError:
        raise RuntimeError(f'{name}:={text} is not a number') from None


def as_text(text):
    """Keep a parameter a text, whatever it looks like: a URDF would be read as YAML."""
    return ParameterValue(text, value_type=str)


def nodes(context):
    """Nodes for the arguments given."""
    value = {name: LaunchConfiguration(name).perform(context) for name, *_ in ARGUMENTS}
    on = {name: value[name] == 'true' for name in ('use_sim_time', 'rviz', 'shutdown')}
    mock_sensor = value['sensor'] == 'mock'
    mock_robot = value['robot'] == 'mock' or (value['robot'] == 'auto' and mock_sensor)
    start = value['start'] == 'true' or (value['start'] == 'auto' and mock_robot)
    if not mock_sensor and not value['port']:
        raise RuntimeError(
            f'sensor:={value["sensor"]} needs its port, for instance port:=/dev/ttyUSB0')
    path = str(find_scene(value['scene'])) if mock_sensor or mock_robot else ''
    scene = load_scene(path) if path else None
    # Not only by its namespace: another launch on this machine must not take the link over.
    port = value['port'] or str(Path(
        tempfile.gettempdir(), f'tactile_{os.getpid()}_{value["namespace"].replace("/", "_")}'))

    def node(package, executable, namespace=value['namespace'], **parameters):
        return Node(
            package=package, executable=executable, name=executable, namespace=namespace,
            output='screen', parameters=[value['parameters'], {
                'use_sim_time': on['use_sim_time'],
                **{key: as_text(it) if isinstance(it, str) else it
                   for key, it in parameters.items()}}])

    robot = {'robot_description': value['robot_description']}
    actions, driver = [], {'protocol': value['sensor']}
    if mock_sensor and mock_robot:
        actions += [SetEnvironmentVariable(*it) for it in local_environment().items()]
    if mock_sensor:
        calibration = Path(f'{port}.yaml')
        driver = {'calibration': str(calibration)}

        def write(_):
            write_calibration(scene, calibration)

        actions += [
            OpaqueFunction(function=write),  # once every argument has proved right
            RegisterEventHandler(OnShutdown(
                on_shutdown=lambda *_: calibration.unlink(missing_ok=True)))]
    actions += [
        node('tactile_sensing', 'driver', port=port, **driver),
        node('tactile_sensing', 'contact_estimator'),
        node('tactile_shape', 'shape_estimator'),
        node('tactile_servo', 'edge_servo', tracker=value['tracker'], **robot)]
    if mock_sensor:
        actions.append(node('tactile_simulation', 'mock_sensor', port=port, scene=path))
    if mock_robot:
        actions.append(node('tactile_simulation', 'mock_robot', '/', scene=path, **robot))
    if start:
        # The nodes start along with it, and their first start ever compiles their kernels.
        closed = (scene is not None and scene.edge.closed
                  and LAWS[value['tracker']].closes_contours)
        track = node('edge_tracking', 'track', wait=60.0, closed=closed, **{
            name: number(name, value[name]) for name in ('speed', 'force', 'length')})
        actions.append(track)
        if on['shutdown']:
            actions.append(RegisterEventHandler(OnProcessExit(
                target_action=track,
                on_exit=[EmitEvent(event=Shutdown(reason='the goal has ended'))])))
    if on['rviz']:
        actions += rviz(value['robot_description'], on['use_sim_time'])
    return actions


def rviz(description, use_sim_time):
    """Robot state publisher and RViz."""
    text = description if '<' in description else Path(description).read_text(encoding='utf-8')
    return [
        Node(package='robot_state_publisher', executable='robot_state_publisher',
             parameters=[{'robot_description': as_text(text), 'use_sim_time': use_sim_time}]),
        Node(package='rviz2', executable='rviz2',
             arguments=['-d', str(share('rviz', 'edge_tracking.rviz'))],
             parameters=[{'use_sim_time': use_sim_time}])]


def generate_launch_description():
    """Declare the arguments; the nodes depend on their values."""
    declared = [
        DeclareLaunchArgument(name, default_value=default, description=description,
                              **({'choices': list(*choices)} if choices else {}))
        for name, default, description, *choices in ARGUMENTS]
    return LaunchDescription([*declared, OpaqueFunction(function=nodes)])
