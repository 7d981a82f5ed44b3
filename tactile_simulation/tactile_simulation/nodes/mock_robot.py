"""Simulated robot behind the topics of a joint_trajectory_controller."""
from dataclasses import dataclass
from typing import Any

from rclpy.qos import QoSProfile
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory

from tactile_common.config import bounded, documented
from tactile_common.errors import Rejected
from tactile_common.ros.conversions import stamp_from_ns
from tactile_common.ros.node import TactileNode
from tactile_common.ros.parameters import declare_from
from tactile_common.ros.runner import run
from tactile_servo.conversions import joint_state_to_msg, trajectory_from_msg
from tactile_servo.motion.robot import RobotModel
from tactile_servo.robot_config import NodeConfig
from tactile_simulation.joint_controller import Late, MockController, RATE
from tactile_simulation.scene import load_scene
from tactile_simulation.world import Plant


@dataclass(frozen=True)
class MockRobotConfig:
    """Parameters of the mock robot."""

    robot_description: str = documented('', 'URDF of the robot: path of a file, or the XML itself')
    tip_frame: str = documented(
        NodeConfig.tip_frame, 'link of the URDF that is the sensor frame')
    scene: str = documented(
        '', "scene file that gives the start pose of the sensor and the plant; '' = none: "
        'the robot begins in the middle of its limits')
    rate: float = bounded(
        RATE, 'rate of the controller and of the joint states', 'Hz', 10.0, 2000.0)
    controller: str = documented(
        NodeConfig.controller, 'name of the controller; its topic is joint_trajectory below it')


class MockRobotNode(TactileNode):
    """
    Plays trajectories with a mock controller and publishes the joint states.

    Attributes
    ----------
    rejected, late : int
        Number of rejected trajectories, and of those among them that arrived too late.
    """

    def __init__(self, **kwargs: Any):
        super().__init__('mock_robot', **kwargs)
        config = declare_from(self, MockRobotConfig)
        self.robot = RobotModel.from_urdf(config.robot_description, config.tip_frame)
        start, plant = self.robot.middle, Plant()
        if config.scene:
            scene = load_scene(config.scene)
            start, plant = self.robot.inverse(scene.start_pose(), None), scene.plant
        self.controller = MockController(self.robot, start, plant, rate=config.rate)
        self.rejected = self.late = 0
        self._violations = 0
        self._state = JointState()
        self._states = self.create_publisher(JointState, '/joint_states', QoSProfile(depth=10))
        self.create_subscription(
            JointTrajectory, f'{config.controller}/joint_trajectory', self._on_trajectory,
            QoSProfile(depth=10))
        self.create_timer(1.0 / config.rate, self._on_timer)

    def _on_trajectory(self, message: JointTrajectory) -> None:
        try:
            self.controller.accept(
                trajectory_from_msg(message), 1e-9 * self.get_clock().now().nanoseconds)
        except Rejected as error:
            self.rejected += 1
            self.late += isinstance(error, Late)
            self.get_logger().error(
                f'trajectory rejected ({self.rejected} so far): {error}',
                throttle_duration_sec=1.0)

    def _on_timer(self) -> None:
        now_ns = self.get_clock().now().nanoseconds
        positions, velocities = self.controller.run_to(1e-9 * now_ns)
        self._states.publish(joint_state_to_msg(
            stamp_from_ns(now_ns), self.robot.joint_names, positions, velocities, self._state))
        if self.controller.limit_violations > self._violations:
            self._violations = self.controller.limit_violations
            self.get_logger().warning(
                f'command clamped to a joint limit ({self._violations} steps so far)',
                throttle_duration_sec=1.0)


def main(args: list[str] | None = None) -> int:
    """Run the node."""
    return run(MockRobotNode, args)
