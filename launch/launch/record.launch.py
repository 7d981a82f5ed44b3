"""
Record all topics of a sensor, its servo and its robot.

  ros2 launch edge_tracking record.launch.py bag:=run
"""
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node


def generate_launch_description():
    """Declare the arguments and the recorder."""
    return LaunchDescription([
        DeclareLaunchArgument('bag', description='new folder to write'),
        DeclareLaunchArgument('namespace', default_value='tactile', description='of the sensor'),
        Node(package='edge_tracking', executable='record_bag', output='screen', arguments=[
            LaunchConfiguration('bag'), '--namespace', LaunchConfiguration('namespace')])])
