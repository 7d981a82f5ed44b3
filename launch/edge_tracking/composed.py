"""All nodes of a mock robot in one process: the dry run without `ros2 launch`."""
import argparse
import os
import sys

from rclpy.exceptions import ParameterException

from edge_tracking.graph import add_mocks, add_sensing, add_servo, calibrate, Graph, private_port
from edge_tracking.parameters import check_file, names_in
from edge_tracking.resources import NAMESPACE, share
from edge_tracking.transport import local_environment
from tactile_common.command_line import Help, Parser, refusing
from tactile_common.ros.runner import freeze_heap, stop_on_signals
from tactile_servo.laws.registry import law_for, LAWS
from tactile_shape.nodes.shape_estimator import ShapeEstimatorNode
from tactile_simulation.cli.simulate import LAW_HELP, SEED
from tactile_simulation.scene import describe_scenes, find_scene, load_scene


def parser() -> argparse.ArgumentParser:
    """Return the command-line parser of the composed process."""
    arguments = Parser(
        prog='composed', formatter_class=Help, epilog=describe_scenes(),
        description='Runs mock sensor, estimators, servo and mock robot in one process. Send '
        'goals to its action, track_edge or, for a surface, track_surface, for instance with '
        '`ros2 run edge_tracking track --ros-args -r __ns:=/tactile`.')
    add = arguments.add_argument
    add('--scene', default='straight', help='what the mock sensor touches, see below')
    add('--law', choices=tuple(LAWS), help=LAW_HELP)
    add('--robot-description', default=str(share('urdf', 'puma260.urdf')),
        help='URDF of the robot, with a link tactile_pad')
    add('--parameters', help='parameter file')
    add('--namespace', default=NAMESPACE, help='of sensor, estimators and servo')
    add('--seed', type=SEED, default=0, help="of the mock sensor's noise")
    return arguments


def main(args: list[str] | None = None) -> int:
    """Run the graph until it is interrupted; exit status 2 if it cannot start."""
    with refusing('composed', ValueError, RuntimeError, ParameterException) as command:
        options = parser().parse_args(args)
        path = find_scene(options.scene)
        scene = load_scene(path)
        law = law_for(scene.action, options.law)
        os.environ.update(local_environment())
        if options.parameters:
            for text in check_file(options.parameters, names_in(options.namespace), law):
                print(text, file=sys.stderr)
        with private_port() as port, stop_on_signals() as stop, Graph(
                options.parameters, options.namespace, own=scene.parameters()) as graph:
            add_servo(graph, options.robot_description, law)
            graph.add(ShapeEstimatorNode)
            add_sensing(graph, port, calibrate(port, scene))
            add_mocks(graph, port, path, options.robot_description, options.seed)
            freeze_heap()
            graph.spin(stop.is_set)
    return command.status
