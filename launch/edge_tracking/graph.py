"""Nodes of the graph in one process, as in `edge_tracking.launch.py`."""
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
import math
from pathlib import Path
import sys
import tempfile
from typing import Any

import rclpy
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.signals import SignalHandlerOptions

from edge_tracking.resources import NAMESPACE, share
from tactile_common.ros.runner import make_executor, name_of, spin
from tactile_sensing.nodes.contact_estimator import ContactEstimatorNode
from tactile_sensing.nodes.driver import DriverNode
from tactile_servo.laws.registry import DEFAULT
from tactile_servo.nodes.servo import EdgeServoNode
from tactile_simulation.nodes.mock_robot import MockRobotNode
from tactile_simulation.nodes.mock_sensor import MockSensorNode
from tactile_simulation.world import Scene, write_calibration

# Longest time that a thread holds the interpreter while another one waits [s]. The default of
# 5 ms is a whole sensor period.
SWITCH_INTERVAL = 2e-4
PARAMETERS = share('config', 'edge_tracking.yaml')
SETTLE = 0.3  # s of spinning after the end, so that the last messages arrive


class Graph:
    """
    Nodes of one process with their context and executor; use it in a `with` statement.

    Without a parameter file or ROS domain, the package's file and the environment's domain are
    used. `own` are parameters by node that override those of the file, see `Scene.parameters`.
    """

    def __init__(self, parameters: str | Path | None = None, namespace: str = NAMESPACE,
                 domain: int | None = None, own: Mapping[str, Mapping[str, Any]] | None = None):
        self._domain, self._own = domain, own or {}
        self._arguments = ['--ros-args', '--params-file',
                           str(parameters or PARAMETERS)]
        self.namespace = namespace
        self.nodes: list[Node] = []

    def __enter__(self) -> 'Graph':
        sys.setswitchinterval(SWITCH_INTERVAL)
        self.context = rclpy.Context()
        rclpy.init(args=self._arguments, context=self.context, domain_id=self._domain,
                   signal_handler_options=SignalHandlerOptions.NO)
        self.executor = make_executor(self.context)
        return self

    def __exit__(self, *_: Any) -> None:
        self.executor.shutdown()  # first: no message may reach a destroyed node
        for node in reversed(self.nodes):
            node.destroy_node()
        self.context.try_shutdown()

    def add(self, node_class: Callable[..., Node], *, namespace: str | None = None,
            own: Mapping[str, Any] | None = None, **parameters: Any) -> Any:
        """Make a node, with parameters that override all others, and return it."""
        given = {**self._own.get(name_of(node_class), {}), **parameters}
        node = node_class(
            context=self.context, **(own or {}),
            namespace=self.namespace if namespace is None else namespace,
            parameter_overrides=[Parameter(k, value=v) for k, v in given.items()])
        self.nodes.append(node)
        self.executor.add_node(node)
        return node

    def spin(self, until: Callable[[], bool], seconds: float = math.inf) -> None:
        """Process callbacks for a time, until the context is shut down or `until()` is True."""
        spin(self.executor, self.context, until, seconds)


def add_mocks(graph: Graph, port: str | Path, scene: str | Path, robot: str | Path,
              seed: int = 0) -> Node:
    """Add the mock sensor on a pseudo-terminal and the mock robot, both in a scene."""
    graph.add(MockSensorNode, port=str(port), scene=str(scene), seed=seed)
    return graph.add(MockRobotNode, namespace='', robot_description=str(robot), scene=str(scene))


def add_sensing(graph: Graph, port: str | Path, calibration: str | Path = '') -> None:
    """Add the contact estimator, then the driver, so that the estimator receives every image."""
    graph.add(ContactEstimatorNode)
    graph.add(DriverNode, port=str(port), calibration=str(calibration))


def add_servo(graph: Graph, robot: str | Path, law: str = DEFAULT, **parameters: Any) -> Node:
    """Add the servo with its parameters; with sensing it is the control loop."""
    return graph.add(EdgeServoNode, robot_description=str(robot), law=law, **parameters)


@contextmanager
def private_port() -> Iterator[Path]:
    """Yield a path for the link of a pseudo-terminal, in a new temporary folder."""
    with tempfile.TemporaryDirectory(prefix='tactile_') as folder:
        yield Path(folder, 'sensor')


def calibrate(port: Path, scene: Scene) -> Path:
    """Write the calibration of a scene's mock sensor next to its port; return its path."""
    return write_calibration(scene, port.with_name(f'{port.name}.yaml'))
