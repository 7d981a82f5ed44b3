"""
The graph in several processes, so that no part waits for another's interpreter.

`sensing` is driver and contact estimator. `mocks` replace hardware, which is never late. The
`recorder` is as urgent as the servo, because what it receives too late is lost. `shape`, the shape
estimator, has a low priority, for machines with few processors.
"""
from collections.abc import Callable, Iterator
from contextlib import contextmanager
import json
import os
import select
import signal
import subprocess
import sys
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.exceptions import ParameterException
from rclpy.node import Node

from edge_tracking.graph import add_mocks, add_sensing, Graph
from edge_tracking.recording.record_bag import RecorderNode
from edge_tracking.recording.topics import topics
from tactile_common.command_line import refusing
from tactile_common.ros.runner import freeze_heap
from tactile_shape.nodes.shape_estimator import ShapeEstimatorNode

# Topics that a run begins with.
WANTED = {'joint_states', 'image', 'sensor_info', 'contact', 'surface_patch', 'servo_status',
          'sensor_pose'}
PATIENCE = 10.0  # s for a part to end by itself and write its recording


class Heard:
    """
    True in `all` when the recorder's diagnostics name all `WANTED` topics.

    These include the shape estimator's patches, for which it needs contacts and poses.
    """

    def __init__(self, node: Node):
        self.all, self.failed = False, ''  # why the recording ended early
        node.create_subscription(DiagnosticArray, '/diagnostics', self._take, 10)

    def _take(self, msg: DiagnosticArray) -> None:
        for status in msg.status:
            heard = {pair.key: pair.value for pair in status.values}.get('heard', '')
            self.all = self.all or WANTED <= set(heard.split())
            if status.name.endswith(': recorder') and status.level == DiagnosticStatus.ERROR:
                self.failed = status.message


def _add_recorder(graph: Graph, bag: str) -> None:
    graph.add(RecorderNode, own={'path': bag, 'topics': topics(graph.namespace)})


# Function that makes each part, and its niceness.
PARTS: dict[str, tuple[Callable[..., Any], int]] = {
    'sensing': (add_sensing, 0), 'mocks': (add_mocks, 0), 'recorder': (_add_recorder, 0),
    'shape': (lambda graph: graph.add(ShapeEstimatorNode), 10)}


@contextmanager
def apart(part: str, *arguments: Any, **graph: Any) -> Iterator[subprocess.Popen]:
    """
    Run one of `PARTS` in a process that ends with this one, however this one ends.

    `arguments`, paths and numbers, are passed to the part's function, `graph` to its `Graph`.
    """
    call = json.dumps([part, arguments, graph], default=str)
    # A separate process group: Ctrl-C must reach only this process, which ends the part; it would
    # kill a part during its imports. Not a new session: niceness only acts within a session.
    process = subprocess.Popen(
        [sys.executable, '-m', __name__, call], stdin=subprocess.PIPE,
        stdout=subprocess.DEVNULL, preexec_fn=os.setpgrp)
    try:
        yield process
    finally:
        try:
            process.communicate(timeout=PATIENCE)  # closes its standard input
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


def main() -> int:
    """Run a part until the standard input ends."""
    part, arguments, options = json.loads(sys.argv[1])
    add, niceness = PARTS[part]
    for number in (signal.SIGINT, signal.SIGTERM):  # the parent handles them and ends this part
        signal.signal(number, signal.SIG_IGN)

    def ended() -> bool:
        return bool(select.select([sys.stdin], (), (), 0.0)[0])

    with refusing(part, ValueError, RuntimeError, ParameterException) as command, \
            Graph(**options) as graph:
        add(graph, *arguments)
        freeze_heap()
        # Lower the priority only when the servo is heard: earlier it would delay the start.
        graph.spin(lambda: ended() or graph.nodes[0].count_publishers(
            f'/{graph.namespace}/servo_status') > 0)
        os.nice(niceness)
        graph.spin(ended)
    return command.status


if __name__ == '__main__':
    sys.exit(main())
