"""
Record all topics of a sensor, its servo and its robot into a new bag, until interrupted.

The recording stays readable if the process is killed or the disk is full. Exit status 1 if the
recording ended early; the last line says why.
"""
from pathlib import Path
import sys
from typing import Any

from edge_tracking.recording.topics import topics
from edge_tracking.recording.writer import RecorderNode
from edge_tracking.resources import NAMESPACE
from tactile_common.command_line import Parser, refusing
from tactile_common.ros.runner import run, split_ros_args


def parser() -> Parser:
    """Return the command-line parser; it does not cover arguments after --ros-args."""
    arguments = Parser(prog='record_bag', description=(__doc__ or '').strip())
    arguments.add_argument('bag', type=Path, metavar='BAG', help='new folder to write')
    arguments.add_argument('--namespace', default=NAMESPACE, help='of the sensor')
    return arguments


def main(args: list[str] | None = None) -> int:
    """Record; return the exit status, see above."""
    given, ros = split_ros_args(sys.argv[1:] if args is None else args)
    nodes: list[RecorderNode] = []
    with refusing('record_bag') as command:
        options = parser().parse_args(given)
        namespace = options.namespace.strip('/')

        def record_bag(context: Any) -> RecorderNode:
            nodes.append(RecorderNode(
                options.bag, topics(namespace), context=context, namespace=namespace))
            return nodes[0]

        command.status = run(record_bag, ros, lambda node: bool(node.failed))
        for node in nodes:
            if node.failed:
                print(f'record_bag: {node.failed}', file=sys.stderr)
                command.status = 1
    return command.status
