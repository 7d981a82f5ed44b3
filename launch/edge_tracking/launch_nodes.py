"""Launch actions for the nodes of one robot with its sensor."""
from collections.abc import Collection, Mapping
import math
import os
from pathlib import Path
import tempfile
from typing import Any
from xml.etree import ElementTree

from ament_index_python.packages import get_packages_with_prefixes
from launch.actions import EmitEvent, LogInfo, OpaqueFunction, RegisterEventHandler
from launch.event_handlers import OnProcessExit, OnShutdown
from launch.events import Shutdown
from launch.logging import get_logger
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

from edge_tracking.launch_arguments import number
from edge_tracking.parameters import check_file, driver_parameters, names_in, robot_namespace
from edge_tracking.resources import NAMESPACE, share
from edge_tracking.track import RESUMES
from tactile_common.config import checked
from tactile_common.errors import ConfigurationError
from tactile_common.parameter_file import ParameterFile
from tactile_sensing.devices.calibration import load_calibration
from tactile_servo.config import check_goal, ServoConfig
from tactile_servo.laws.registry import DEFAULT, law_for, LAWS
from tactile_servo.motion.robot import RobotModel
from tactile_servo.motion.urdf import parse, text_of
from tactile_servo.robot_config import NodeConfig
from tactile_simulation.scene import find_scene, load_scene
from tactile_simulation.world import write_calibration

RESPAWN_DELAY = 1.0  # s
GIVING_WAY = ' nice -n 10'  # lower priority than the servo; follows PREFIX
CONTROL = ('controller_manager', 'hardware_interface', 'joint_state_broadcaster',
           'joint_trajectory_controller', 'robot_state_publisher')
START = 300.0  # s for the start of the nodes; the very first start compiles kernels


def typed(parameters: Mapping[str, Any]) -> dict[str, Any]:
    """Return parameters whose texts stay texts: launch would parse a URDF as YAML."""
    return {name: ParameterValue(value, value_type=str) if isinstance(value, str) else value
            for name, value in parameters.items()}


class Nodes:
    """The nodes of one robot with its sensor, for the values of the arguments."""

    def __init__(self, value: Mapping[str, Any], prefix: str):
        self.value, self.prefix = value, prefix
        self.mock_sensor = value['sensor'] == 'mock'
        self.robot = value['robot']
        if self.robot == 'auto':
            self.robot = 'mock' if self.mock_sensor else 'real'
        robot = value['robot_namespace'].strip('/')
        if robot == 'auto':
            robot = '' if self.robot == 'real' else robot_namespace(value['namespace'])
        self.robot_namespace = f'/{robot}'.rstrip('/')
        self.driver = driver_parameters(value)
        simulated = self.mock_sensor or self.robot != 'real'
        self.scene_path = str(find_scene(value['scene'])) if simulated else ''
        self.scene: Any = load_scene(self.scene_path) if simulated else None
        law = None if value['law'] == 'auto' else value['law']
        self.law = law_for(self.scene.action, law) if self.scene else law or DEFAULT
        self.own = self.scene.parameters() if self.scene else {}
        # With the process id, so that another launch on this machine does not take the link over.
        own = Path(tempfile.gettempdir(),
                   f'tactile_{os.getpid()}_{value["namespace"].replace("/", "_")}')
        self.port = value['port'] or str(own)
        self.mock_calibration = Path(f'{own}.yaml')
        self.goal: dict[str, Any] = {
            name: number(name, value[name]) for name in ('speed', 'force', 'length')}

    def check(self) -> RobotModel:
        """Refuse a parameter file, goal, robot or calibration that a node would refuse."""
        value = self.value
        nodes = names_in(value['namespace'], self.robot_namespace)
        for name, there in (('mock_sensor', self.mock_sensor),
                            ('driver', value['sensor'] != 'none'), ('track', self.starts),
                            ('view', value['view']),
                            ('mock_robot', self.robot == 'mock')):
            if not there:
                del nodes[name]
        for text in check_file(value['params_file'], nodes, self.law):
            get_logger('launch').warning(text)
        file = ParameterFile(value['params_file'])
        servo = file.values(nodes['edge_servo'])
        if self.starts:
            check_goal(self.goal['speed'], self.goal['force'],
                       file.config(nodes['edge_servo'], ServoConfig))
            checked('length', self.goal['length'], float, {'range': (0.0, math.inf), 'unit': 'm'})
        model = RobotModel.from_urdf(
            value['robot_description'], servo.get('tip_frame', NodeConfig.tip_frame))
        if self.robot == 'real' and not {'workspace.lower', 'workspace.upper'} <= servo.keys():
            raise ConfigurationError('a real robot needs workspace.lower and workspace.upper, the '
                                     'box that its sensor stays in, in the params_file')
        if value['pattern'] != 'line' and LAWS[self.law].action != 'track_surface':
            raise ConfigurationError(
                f'pattern:={value["pattern"]} does not apply to an edge: it is a way over a '
                'surface')
        if value['calibration']:
            load_calibration(value['calibration'])
        if self.robot == 'ros2_control':
            require_packages('robot:=ros2_control', CONTROL, 'take robot:=mock')
        if value['use_rviz']:
            require_packages('use_rviz:=true', ('rviz2',), 'leave it out')
        if self.mock_sensor:
            self.scene.world()  # solves the skin of a round probe in advance
        return model

    @property
    def starts(self) -> bool:
        """True if a goal is sent at once."""
        return self.value['start'] == 'true' or (
            self.value['start'] == 'auto' and self.robot != 'real')

    def node(self, package: str, executable: str, namespace: str | None = None,
             dies: bool = True, env: Mapping[str, str] | None = None, prefix: str = '',
             **parameters: Any) -> list[Any]:
        """Return the actions of a node, with a longer prefix, and of the launch's end with it."""
        value = self.value
        action = Node(
            package=package, executable=executable, name=executable, output='screen',
            namespace=value['namespace'] if namespace is None else namespace or '/',
            prefix=f'{self.prefix}{prefix}', exec_name=executable, additional_env=env,
            respawn=value['use_respawn'] and dies, respawn_delay=RESPAWN_DELAY,
            remappings=[('/joint_states', f'{self.robot_namespace}/joint_states')],
            ros_arguments=['--log-level', value['log_level']],
            parameters=[value['params_file'], typed({
                'use_sim_time': value['use_sim_time'], **self.own.get(executable, {}),
                **parameters})])
        return [action, *ends_with(action)] if dies and not value['use_respawn'] else [action]

    def sensing(self) -> list[Any]:
        """Return driver and estimators, and the mock sensor with its calibration."""
        actions, driver = [], self.driver
        if self.mock_sensor:
            own = self.mock_calibration

            def remove(*_: Any) -> None:
                own.unlink(missing_ok=True)
                if Path(self.port).is_symlink():  # left by a killed mock sensor
                    Path(self.port).unlink(missing_ok=True)

            # Written by an action, after all arguments have been checked.
            actions += [OpaqueFunction(function=lambda _: write_calibration(self.scene, own)
                                       and None),
                        RegisterEventHandler(OnShutdown(on_shutdown=remove)),
                        *self.node('tactile_simulation', 'mock_sensor', port=self.port,
                                   scene=self.scene_path)]
            driver = {'port': self.port, 'calibration': str(own), **driver}
        if self.value['sensor'] != 'none':
            actions += self.node('tactile_sensing', 'driver', **driver)
        if self.value['view']:
            actions += self.node('edge_tracking', 'view', dies=False)
        return [*actions, *self.node('tactile_sensing', 'contact_estimator'),
                *self.node('tactile_shape', 'shape_estimator', prefix=GIVING_WAY)]

    def servo(self) -> list[Any]:
        """Return the servo, the mock robot and the goal."""
        value = self.value
        robot = {'robot_description': value['robot_description']}
        if value['controller'] or self.robot_namespace:
            robot['controller'] = value['controller'] or (
                f'{self.robot_namespace}/joint_trajectory_controller')
        actions = self.node('tactile_servo', 'edge_servo', law=self.law, **robot)
        if self.robot == 'mock':
            actions += self.node('tactile_simulation', 'mock_robot', self.robot_namespace,
                                 scene=self.scene_path, **robot)
        if self.starts:
            row = LAWS[self.law]
            closed = bool(row.closes_contours and self.scene and self.scene.closed)
            track, = self.node('edge_tracking', 'track', dies=False, wait=START, closed=closed,
                               resumes=RESUMES if self.robot != 'real' else 0,
                               env={'INTERRUPTED_STATUS': '0'}, action=row.action,
                               **{'surface.pattern': value['pattern']}, **self.goal)
            actions.append(track)
            if value['shutdown']:
                actions += ends_with(track)
        return actions

    def controllers(self, model: RobotModel) -> list[Any]:
        """Return the controller manager with mock hardware, and its controllers."""
        value, namespace = self.value, self.robot_namespace
        settings = str(share('config', 'controllers.yaml'))
        manager = Node(
            package='controller_manager', executable='ros2_control_node', output='screen',
            namespace=namespace or '/', remappings=[('~/robot_description', 'robot_description')],
            parameters=[settings, {'use_sim_time': value['use_sim_time']}])
        spawner = Node(
            package='controller_manager', executable='spawner', output='screen',
            namespace=namespace or '/',
            arguments=['joint_state_broadcaster', 'joint_trajectory_controller',
                       '--controller-manager', f'{namespace}/controller_manager',
                       '--param-file', settings])
        start = dict(zip(model.joint_names, model.inverse(self.scene.start_pose(), None),
                         strict=True)) if self.scene else {}
        text = starting_at(text_of(value['robot_description']), start)
        return [manager, *ends_with(manager), spawner, *ends_with(spawner, may_end=True),
                *self.state_publisher(text)]

    def state_publisher(self, text: str) -> list[Any]:
        """Return the robot_state_publisher, which publishes TF and the topic robot_description."""
        if 'robot_state_publisher' not in get_packages_with_prefixes():
            return [LogInfo(msg='robot_state_publisher is not installed: neither TF nor the '
                            'topic robot_description')]
        return [Node(
            package='robot_state_publisher', executable='robot_state_publisher',
            namespace=self.robot_namespace or '/', remappings=self.frames(''),
            parameters=[typed({'robot_description': text,
                               'use_sim_time': self.value['use_sim_time']})])]

    def frames(self, namespace: str) -> list[tuple[str, str]]:
        """Return remappings that give a robot in a namespace a separate tree of frames."""
        return [(f'/{topic}', f'{namespace}/{topic}' if namespace else topic)
                for topic in ('tf', 'tf_static')] if self.robot_namespace else []

    def rviz(self) -> list[Any]:
        """Return RViz, subscribed to the topics of these nodes."""
        own, robot = f'/{self.value["namespace"].strip("/")}', self.robot_namespace
        return [Node(
            package='rviz2', executable='rviz2', namespace=robot or '/',
            arguments=['-d', str(share('rviz', 'edge_tracking.rviz'))],
            remappings=[*((f'/{NAMESPACE}/{topic}', f'{own}/{topic}'.replace('//', '/'))
                          for topic in ('sensor_pose', 'wrench', 'markers')),
                        ('/robot_description', f'{robot}/robot_description'),
                        *self.frames(robot)],
            parameters=[{'use_sim_time': self.value['use_sim_time']}])]


def ends_with(action: Any, may_end: bool = False) -> list[Any]:
    """Return actions that end the launch with a process; an exit code is an error."""
    def on_exit(event: Any, context: Any) -> Any:
        name = event.process_name.rpartition('-')[0]
        if context.is_shutdown or (may_end and event.returncode == 0):
            return None
        if event.returncode == 0:
            return EmitEvent(event=Shutdown(reason=f'{name} has ended'))
        raise RuntimeError(f'{name} has died (exit code {event.returncode}), so the launch ends')
    return [RegisterEventHandler(OnProcessExit(target_action=action, on_exit=on_exit))]


def require_packages(wanted: str, packages: Collection[str], instead: str) -> None:
    """Raise a ConfigurationError that names missing packages and how to install them."""
    missing = [name for name in packages if name not in get_packages_with_prefixes()]
    if missing:
        names = ' '.join(f'ros-$ROS_DISTRO-{name.replace("_", "-")}' for name in missing)
        raise ConfigurationError(
            f'{wanted} needs {", ".join(missing)}: apt install {names}, or {instead}')


def starting_at(description: str, positions: Mapping[str, float]) -> str:
    """
    Return the URDF with other start positions [rad] of its `<ros2_control>` joints.

    `positions` are given by joint name. Raises a ConfigurationError if the URDF has no element
    `<ros2_control>`.
    """
    robot = parse(description)
    joints = robot.findall('ros2_control/joint')
    if not joints:
        raise ConfigurationError('robot description: has no element <ros2_control> with joints, '
                                 'which robot:=ros2_control needs; urdf/puma260.urdf shows one')
    for joint in joints:
        value = joint.find("state_interface[@name='position']/param[@name='initial_value']")
        if value is not None and joint.get('name') in positions:
            value.text = repr(float(positions[joint.get('name', '')]))
    return ElementTree.tostring(robot, encoding='unicode')
