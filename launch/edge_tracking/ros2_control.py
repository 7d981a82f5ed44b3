"""Robot description with mock hardware for ros2_control, and the packages that it needs."""
from collections.abc import Collection, Mapping
from xml.etree import ElementTree

from ament_index_python.packages import get_packages_with_prefixes

from tactile_common.errors import ConfigurationError
from tactile_servo.motion.urdf import parse

CONTROL = ('controller_manager', 'hardware_interface', 'joint_state_broadcaster',
           'joint_trajectory_controller', 'robot_state_publisher')


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
