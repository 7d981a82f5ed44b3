"""
Play a recording to the estimators, with simulated time and the parameters of the recording.

  ros2 launch edge_tracking replay.launch.py bag:=run/bag rate:=0.5 view:=true

The new estimates use the usual topics, the recorded ones are below `recorded`. No robot moves.
"""
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction, SetEnvironmentVariable
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

from edge_tracking.launch_arguments import SWITCH
from edge_tracking.launch_interrupt import leave_interrupt_to_launch, PREFIX
from edge_tracking.launch_nodes import ends_with, typed
from edge_tracking.parameters import parameters_of
from edge_tracking.recording.settings import Settings
from edge_tracking.recording.topics import GraphBag
from edge_tracking.replay import play_bag
from edge_tracking.transport import local_environment

# Package and first topic by node.
ESTIMATORS = {'contact_estimator': ('tactile_sensing', 'contact'),
              'shape_estimator': ('tactile_shape', 'surface_patch')}


def actions(context):
    """Yield the actions for the given arguments; nothing starts if the bag cannot be played."""
    def value(name):
        return LaunchConfiguration(name).perform(context)

    leave_interrupt_to_launch()
    arguments = [value('bag'), '--rate', value('rate'), *(
        f'--{name.replace("_", "-")}' for name in ('loop', 'start_paused')
        if value(name) == 'true')]
    play_bag.parser().parse_args(arguments)  # refuses wrong arguments before anything is started
    with GraphBag(value('bag'), value('namespace') or None) as bag:
        bag.require_touch()
        settings = Settings(bag)
    common = {'namespace': bag.prefix or '/', 'output': 'screen', 'prefix': PREFIX}
    yield from (SetEnvironmentVariable(*it) for it in local_environment().items())
    estimators = {name: row for name, row in ESTIMATORS.items()
                  if 'image' in bag.topic or row[1] not in play_bag.OF_IMAGES}
    for name, (package, _) in estimators.items():
        recorded = settings.recorded.get(name, {})
        own = {it.name: recorded[it.name] for it in parameters_of(name, settings.law)
               if it.name in recorded}
        node = Node(package=package, executable=name, exec_name=name,
                    parameters=[typed({'use_sim_time': True, **own})], **common)
        yield from (node, *ends_with(node))
    if value('view') == 'true':
        yield Node(package='edge_tracking', executable='view', exec_name='view',
                   parameters=[{'use_sim_time': True}], **common)
    player = Node(package='edge_tracking', executable='play_bag', exec_name='play_bag', arguments=[
        *arguments, '--namespace', bag.prefix,
        '--wait-for', *(topic for _, topic in estimators.values())], **common)
    yield from (player, *ends_with(player))


def generate_launch_description():
    """Declare the arguments; the nodes depend on the recording."""
    return LaunchDescription([
        DeclareLaunchArgument('bag', description='folder, .mcap or .db3 file of a recording'),
        DeclareLaunchArgument('rate', default_value='1.0', description='times real time'),
        DeclareLaunchArgument('loop', default_value='false', choices=[*SWITCH],
                              description='begin anew at the end'),
        DeclareLaunchArgument('start_paused', default_value='false', choices=[*SWITCH],
                              description='wait for play_bag/pause false'),
        DeclareLaunchArgument('view', default_value='false', choices=[*SWITCH],
                              description='show what is felt on a web page'),
        DeclareLaunchArgument('namespace', default_value='',
                              description='of the sensor in a bag that has several; '
                              'default: tactile'),
        OpaqueFunction(function=lambda it: [*actions(it)])])
