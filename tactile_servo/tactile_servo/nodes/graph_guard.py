"""Checks of the ROS graph: who publishes, and whether the robot's controller is active."""

from collections.abc import Callable, Sequence
from time import perf_counter
from typing import Any

from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import JointState

from tactile_servo.reasons import Reason, ReasonCode

try:
    from control_msgs.msg import JointTrajectoryControllerState
except ImportError:  # then only the robot's motion shows whether it follows commands
    JointTrajectoryControllerState = None

SILENT = 0.2  # s without a state, after which a controller that published states is not active


class GraphGuard:
    """
    Checks that no topic has a second publisher, and that the robot's controller is active.

    The state of the `controller` is subscribed to if control_msgs is installed; `see_reference`
    then receives the positions that it commands at its stamp. Topics in `shared` may have several
    publishers.
    """

    def __init__(self, node: Node, topics: Sequence[str], shared: Sequence[str],
                 controller: str, see_reference: Callable[[JointState], None]):
        self._node, self._see_reference = node, see_reference
        self._topics = sorted({*map(node.resolve_topic_name, topics)}
                              - {*map(node.resolve_topic_name, shared)})
        self._state_arrival: float | None = None  # steady time of the controller's last state [s]
        if JointTrajectoryControllerState is not None:
            node.create_subscription(
                JointTrajectoryControllerState, f'{controller}/controller_state', self._on_state,
                qos_profile_sensor_data)

    def _on_state(self, msg: Any) -> None:
        self._state_arrival = perf_counter()
        self._see_reference(JointState(
            header=msg.header, name=msg.joint_names, position=msg.reference.positions))

    def problem(self) -> Reason | None:
        """Return what is wrong now, or None."""
        for topic in self._topics:
            count = self._node.count_publishers(topic)
            if count > 1:
                return Reason(ReasonCode.SEVERAL_PUBLISHERS, f'{topic} has {count}')
        if self._state_arrival is not None and perf_counter() - self._state_arrival > SILENT:
            return Reason(ReasonCode.CONTROLLER_INACTIVE, f'no state for {SILENT:g} s')
        return None
