"""
Launch a robot that follows an edge by touch.

Without arguments the mock sensor and the mock robot are used, and tracking starts at once.
With a real array and a real robot, whose joint_trajectory_controller is running:

  ros2 launch edge_tracking edge_tracking.launch.py sensor:=flexitac port:=/dev/ttyUSB0 \
      robot_description:=/path/to/robot.urdf params_file:=/path/to/edge_tracking.yaml

The real robot does not move until a goal is sent to the action track_edge, or with start:=true.
"""
from launch import LaunchDescription
from launch.actions import OpaqueFunction, SetEnvironmentVariable

from edge_tracking.launch_arguments import declared, given
from edge_tracking.launch_interrupt import leave_interrupt_to_launch, PREFIX
from edge_tracking.launch_nodes import Nodes
from edge_tracking.transport import lease_environment, local_environment
from tactile_servo.motion.urdf import text_of


def actions(context):
    """Yield the actions for the given arguments; nothing starts if an argument is wrong."""
    leave_interrupt_to_launch()
    # A prefix given by the user, such as a debugger, replaces the default one.
    own = context.launch_configurations.get('launch-prefix')
    nodes = Nodes(given(context), own or PREFIX)
    model = nodes.check()
    local = nodes.mock_sensor and nodes.robot != 'real'
    added = local_environment() if local else lease_environment()
    yield from (SetEnvironmentVariable(*it) for it in added.items())
    yield from nodes.sensing()
    yield from nodes.servo()
    if nodes.robot == 'ros2_control':
        yield from nodes.controllers(model)
    elif nodes.robot == 'mock' or nodes.value['use_rviz']:
        yield from nodes.state_publisher(text_of(nodes.value['robot_description']))
    if nodes.value['use_rviz']:
        yield from nodes.rviz()


def generate_launch_description():
    """Declare the arguments; the nodes depend on their values."""
    return LaunchDescription([*declared(), OpaqueFunction(function=lambda it: [*actions(it)])])
