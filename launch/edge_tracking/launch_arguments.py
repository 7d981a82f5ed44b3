"""Arguments of the launch file: declarations and given values."""
from typing import Any

from launch import LaunchContext
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration

from edge_tracking.goals import PATTERNS
from edge_tracking.resources import NAMESPACE, share
from tactile_common.errors import ConfigurationError
from tactile_sensing.devices.registry import PROTOCOLS
from tactile_servo.laws.registry import law_for, LAWS
from tactile_simulation.scene import shipped_scenes

SWITCH = ('true', 'false')
ARGUMENTS = (
    ('sensor', 'mock', 'mock: synthetic array on a pseudo-terminal; topic: raw images of another '
     'driver; none: you publish tactile images; else the byte protocol of a real array on a '
     'serial port', ('mock', *PROTOCOLS, 'topic', 'none')),
    ('topic', '', 'of raw images (sensor:=topic): Image, Float32MultiArray or UInt16MultiArray'),
    ('options', '', 'of the byte protocol, for instance stamp=us,checksum=true'),
    ('port', '', 'serial port of a real array; for the mock, the link to its pseudo-terminal '
     '(default: one of its own in the folder for temporary files)'),
    ('calibration', '', 'calibration file of the array (default: of its protocol; the mock: of '
     'its scene)'),
    ('robot', 'auto', 'mock: robot in software; ros2_control: controller_manager with mock '
     'hardware; real: a running joint_trajectory_controller; auto: mock with the mock sensor, '
     'else real', ('auto', 'mock', 'ros2_control', 'real')),
    ('robot_description', str(share('urdf', 'puma260.urdf')),
     'URDF of the robot with a link tactile_pad: path of a file, or the text'),
    ('controller', '', 'name of the joint trajectory controller (default: '
     'joint_trajectory_controller in robot_namespace)'),
    ('scene', 'straight', f'what the mock sensor touches: {", ".join(shipped_scenes())}, or the '
     'path of a .yaml file'),
    ('law', 'auto', f'servo law; auto: {law_for("track_edge")} for an edge, '
     f'{law_for("track_surface")} for a surface', (*LAWS, 'auto')),
    ('speed', '0.03', 'along the edge, over the surface [m/s]'),
    ('force', '5.0', 'normal force on the pad [N]'),
    ('length', '0.0', 'way to track [m]; 0 = until the edge ends, 60 mm of a line over a surface'),
    ('pattern', 'line', 'way over a surface', tuple(PATTERNS)),
    ('start', 'auto', 'send the goal at once; auto: unless the robot is a real one',
     ('auto', *SWITCH)),
    ('shutdown', 'false', 'end the launch when the goal has ended', SWITCH),
    ('params_file', str(share('config', 'edge_tracking.yaml')), 'parameter file of all nodes; '
     '`ros2 run edge_tracking parameters` prints one with every parameter'),
    ('namespace', NAMESPACE, 'of sensor, estimators and servo'),
    ('robot_namespace', 'auto', "of the robot's joint states and controller, / for none; auto: "
     'none for a real robot and in the default namespace, else that of the sensor',),
    ('use_sim_time', 'false', 'take the time from /clock', SWITCH),
    ('view', 'false', 'show what is felt on a web page, whose address is in the log', SWITCH),
    ('use_rviz', 'false', 'show the robot in RViz', SWITCH),
    ('use_respawn', 'false', 'start a node that has died again; else its death ends the launch',
     SWITCH),
    ('log_level', 'info', 'of all nodes', ('debug', 'info', 'warn', 'error', 'fatal')),
)


def declared() -> list[DeclareLaunchArgument]:
    """Return the declarations of the arguments."""
    return [DeclareLaunchArgument(name, default_value=default, description=description,
                                  **({'choices': list(*choices)} if choices else {}))
            for name, default, description, *choices in ARGUMENTS]


def given(context: LaunchContext) -> dict[str, Any]:
    """Return the values of the arguments by name."""
    value = {name: LaunchConfiguration(name).perform(context) for name, *_ in ARGUMENTS}
    switches = {name for name, _, _, *choices in ARGUMENTS if choices == [SWITCH]}
    return {name: text == 'true' if name in switches else text for name, text in value.items()}


def number(name: str, text: str) -> float:
    """Convert the value of an argument that must be a number."""
    try:
        return float(text)
    except ValueError:
        raise ConfigurationError(f'{name}:={text} is not a number') from None
